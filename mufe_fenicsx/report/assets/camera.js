// A camera in parallel projection that turns about the vertical.
//
// Lengths are in units of the diagonal of the box around all stages, from its lower corner.

const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const START = { azimuth: -0.933, elevation: 0.42, half: 0.46 };

class Camera {
  constructor(middle) {
    this.middle = middle;
    this.aspect = 1; // width over height of the picture
    this.reset();
  }

  reset() {
    Object.assign(this, START, { focus: [...this.middle] });
  }

  /** Unit vectors to the right, up, and out of the picture. */
  get axes() {
    const { azimuth, elevation } = this;
    const out = [
      Math.cos(elevation) * Math.cos(azimuth),
      Math.cos(elevation) * Math.sin(azimuth),
      Math.sin(elevation),
    ];
    const right = [-Math.sin(azimuth), Math.cos(azimuth), 0];
    return [right, cross(out, right), out];
  }

  /** Half of the width and of the height that the picture shows. */
  get halves() {
    return this.aspect > 1
      ? [this.half * this.aspect, this.half]
      : [this.half, this.half / this.aspect];
  }

  turn(dx, dy) {
    this.azimuth -= dx;
    this.elevation = Math.min(Math.max(this.elevation + dy, -Math.PI / 2), Math.PI / 2);
  }

  /** Move what is seen by parts of the half width and half height. */
  pan(x, y) {
    const [right, up] = this.axes;
    const [w, h] = this.halves;
    this.focus = this.focus.map((f, i) => f - x * w * right[i] - y * h * up[i]);
  }

  zoom(factor) {
    this.half = Math.min(Math.max(this.half * factor, 1e-3), 2);
  }

  /** Look along an axis: 0 or 1 from the side, 2 from above. */
  along(axis) {
    this.elevation = axis === 2 ? Math.PI / 2 : 0;
    this.azimuth = axis === 0 ? 0 : -Math.PI / 2;
  }

  /** Place in the picture, -1 to 1 to the right and up. */
  project(point) {
    const [right, up] = this.axes;
    const [w, h] = this.halves;
    const from = point.map((p, i) => p - this.focus[i]);
    return [dot(from, right) / w, dot(from, up) / h];
  }
}
