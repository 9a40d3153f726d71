// Mouse, pen and fingers: one turns or moves, two zoom and move, a short touch picks.

class Pointers {
  constructor(canvas, view) {
    Object.assign(this, { canvas, view, down: new Map(), travelled: 0 });
    canvas.addEventListener("pointerdown", (e) => this.start(e));
    canvas.addEventListener("pointermove", (e) => this.move(e));
    for (const kind of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(kind, (e) => this.end(e));
    }
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
  }

  start(event) {
    if (!this.down.size) this.travelled = 0;
    this.down.set(event.pointerId, [event.clientX, event.clientY]);
    if (event.isTrusted) this.canvas.setPointerCapture(event.pointerId);
    this.canvas.focus({ preventScroll: true });
  }

  move(event) {
    const before = this.down.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    this.travelled += Math.hypot(dx, dy);
    const { camera } = this.view;
    const { width, height } = this.canvas.getBoundingClientRect();
    if (this.down.size === 2) {
      const [other] = [...this.down].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
      const length = (at) => Math.hypot(at[0] - other[0], at[1] - other[1]);
      camera.zoom(length(before) / Math.max(length(now), 1));
      camera.pan(dx / width, -dy / height); // half of what the two fingers move
    } else if (event.shiftKey || event.buttons & 2) {
      camera.pan((2 * dx) / width, (-2 * dy) / height);
    } else {
      camera.turn((4 * dx) / width, (4 * dy) / height);
    }
    this.down.set(event.pointerId, now);
    this.view.redraw();
  }

  end(event) {
    const single = this.down.size === 1 && this.down.delete(event.pointerId);
    this.down.delete(event.pointerId);
    if (!single || event.type !== "pointerup" || this.travelled > 4 || event.button !== 0) return;
    const { left, top } = this.canvas.getBoundingClientRect();
    this.view.pick(event.clientX - left, event.clientY - top);
  }

  wheel(event) {
    event.preventDefault();
    this.view.camera.zoom(1.0015 ** event.deltaY);
    this.view.redraw();
  }
}
