// The view of the page: its controls and keys, what they show, the row of a grain.

const COLOURS = { strong: [0.05, 0.25, 0.6], weak: [0.55, 0.55, 0.55], sliding: [0.84, 0.37, 0] };
const KIND = { strong: 1, sliding: 2, chain: 4 };
const NOTES = { pressure: "; grey: none" };
const CIRCLE = 64; // lines of a circle
const WIDEST = 9; // line of a contact [CSS pixels]
const MOTIONS = [
  { name: "displacement", title: "Displacement", signed: false },
  { name: "displacement_z", title: "Displacement upwards", signed: true, axis: 2 },
];

class View {
  constructor(run) {
    this.run = run;
    this.canvas = byId("view-canvas");
    this.unit = Math.hypot(...run.size); // metres
    const size = run.size.map((s) => s / this.unit);
    this.painter = new Painter(this.canvas);
    this.painter.setSurface(run.faces, run.grainOfNode, size);
    this.camera = new Camera(size.map((s) => s / 2));
    this.hidden = new Set();
    this.selected = -1;
    this.stage = run.stages.length - 1;
    this.fields = this.listFields();
    this.upper = {}; // upper end of the colours of each field that was looked at
    this.fillControls();
    this.listen();
    this.setStage(this.stage);
    this.setShown();
  }

  /** What colours the grains: fields at nodes, motions, numbers of grains, labels. */
  listFields() {
    const { run } = this;
    const fields = run.fields.map((f) => ({
      ...f,
      signed: f.power === 1,
      largest: Math.max(f.high, -f.low),
      values: (stage) => run.field(f, stage),
    }));
    for (const motion of run.sources ? [] : MOTIONS) {
      const values = (stage) => run.displacement(stage, motion.axis);
      const largest = values(this.stage).reduce((m, v) => Math.max(m, Math.abs(v)), 0);
      const [factor, unit] = lengthUnit(largest);
      const colours = motion.signed ? "signed" : "stress";
      fields.push({ ...motion, colours, factor, unit, largest, limit: largest, values });
    }
    for (const c of run.columns.filter((column) => column.coloured)) {
      const values = (stage) => {
        const numbers = run.column(c.name, stage);
        return numbers && Float32Array.from(run.grainOfNode, (grain) => numbers[grain]);
      };
      const colours = c.signed ? "signed" : "stress";
      fields.push({ ...c, colours, largest: c.high, limit: c.high, values, ofGrains: true });
    }
    const colour = run.array("colour");
    fields.push({
      name: "grain",
      title: run.sources ? "Scan and run" : "Grain number",
      colours: "labels",
      values: () => Float32Array.from(run.grainOfNode, (grain) => (colour[grain] + 0.5) / 8),
    });
    return fields;
  }

  fillControls() {
    const groups = { "At the surface": (f) => !f.ofGrains, "Of each grain": (f) => f.ofGrains };
    for (const [name, test] of Object.entries(groups)) {
      const group = document.createElement("optgroup");
      group.label = name;
      for (const field of this.fields.filter(test)) group.append(new Option(field.title, field.name));
      if (group.children.length) byId("view-field").append(group);
    }
    byId("view-sources").hidden = !this.run.sources;
    byId("view-stage").max = String(this.run.stages.length - 1);
    this.field = this.fields[0];
    byId("view-field").value = this.field.name;
  }

  listen() {
    const on = (id, kind, action) => byId(id).addEventListener(kind, action);
    on("view-stage", "input", (e) => this.setStage(Number(e.target.value)));
    on("view-field", "change", (e) => this.setField(e.target.value));
    on("view-upper", "input", (e) => this.setUpper(Number(e.target.value)));
    on("view-grains", "change", () => this.redraw());
    on("view-source", "change", () => this.setShown());
    on("view-contacts", "change", (e) => {
      // Contacts lie inside the grains.
      if (e.target.value !== "none" && byId("view-grains").value === "shown") {
        byId("view-grains").value = "faint";
      }
      this.setContacts();
    });
    on("view-cut", "change", () => this.setCut());
    on("view-cut-place", "input", () => this.setCut());
    on("view-label", "change", (e) => {
      this.select(this.find(Number(e.target.value)));
    });
    on("view-hide", "click", () => this.hide());
    on("view-only", "click", () => this.isolate());
    on("view-all", "click", () => {
      this.hidden.clear();
      this.setShown();
    });
    const moved = (action) => () => {
      action(this.camera);
      this.redraw();
    };
    on("view-reset", "click", moved((camera) => camera.reset()));
    ["x", "y", "z"].forEach((name, axis) => {
      on(`view-${name}`, "click", moved((camera) => camera.along(axis)));
    });
    document.querySelector(".view-controls").addEventListener("submit", (e) => e.preventDefault());
    this.canvas.addEventListener("keydown", (event) => this.key(event));
    new Pointers(this.canvas, this);
    new ResizeObserver(() => this.redraw()).observe(this.canvas);
    window.addEventListener("beforeprint", () => this.draw());
    this.canvas.addEventListener("webglcontextlost", () => {
      say("The browser lost its graphics context: reload the page.");
    });
  }

  key(event) {
    const turn = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const actions = {
      "+": () => this.camera.zoom(0.85),
      "=": () => this.camera.zoom(0.85),
      "-": () => this.camera.zoom(1 / 0.85),
      0: () => this.camera.reset(),
      x: () => this.camera.along(0),
      y: () => this.camera.along(1),
      z: () => this.camera.along(2),
      ",": () => this.setStage(this.stage - 1),
      ".": () => this.setStage(this.stage + 1),
      h: () => this.hide(),
      Escape: () => this.select(-1),
    };
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (turn[event.key]) {
      const [x, y] = turn[event.key];
      if (event.shiftKey) this.camera.pan(0.1 * x, 0.1 * y);
      else this.camera.turn(0.1 * x, 0.1 * y);
    } else if (actions[event.key]) {
      actions[event.key]();
    } else {
      return;
    }
    event.preventDefault();
    this.redraw();
  }

  setStage(stage) {
    this.stage = Math.min(Math.max(stage, 0), this.run.stages.length - 1);
    const { strain, stage: name } = this.run.stages[this.stage];
    byId("view-stage").value = String(this.stage);
    byId("view-stage-text").textContent = `strain ${text(strain)}, ${name}`;
    byId("legend-stage").textContent = `At strain ${text(strain)}`;
    this.painter.setPlaces(this.run.places[this.stage + 1]);
    this.contacts = this.run.contacts(this.stage);
    this.setBox();
    if (this.run.sources && this.selected >= 0) this.selected = this.find(this.run.labels[this.selected]);
    this.setShown();
    this.setField(this.field.name);
    this.showGrain();
  }

  setField(name) {
    this.field = this.fields.find((field) => field.name === name);
    const { field } = this;
    const values = field.values(this.stage);
    this.values = values ?? new Float32Array(this.run.numNodes);
    this.painter.setValues(this.values);
    this.painter.setMap(this.run.array(`map.${field.colours}`));
    const labels = field.colours === "labels";
    this.upper[name] ??= labels ? 1 : Math.min(field.limit, field.largest) || 1;
    byId("view-upper").disabled = labels;
    // The slider is logarithmic, from a thousandth of the largest value to all of it.
    byId("view-upper").value = labels ? "1" : String(this.share(this.upper[name]));
    byId("view-field").value = name;
    this.showLegend(values !== null);
    this.redraw();
  }

  share(upper) {
    return this.field.largest > 0 ? 1 + Math.log10(upper / this.field.largest) / 3 : 1;
  }

  setUpper(share) {
    const { field } = this;
    this.upper[field.name] = (field.largest || 1) * 10 ** (3 * (share - 1));
    this.showLegend(true);
    this.redraw();
  }

  /** Lower and upper end of the colours. */
  get range() {
    const upper = this.upper[this.field.name];
    return [this.field.signed ? -upper : 0, upper];
  }

  showLegend(known) {
    const { field } = this;
    const [low, high] = this.range;
    const table = this.run.array(`map.${field.colours}`);
    const pixels = new ImageData(256, 1);
    for (let i = 0; i < 256; i++) pixels.data.set([...table.slice(3 * i, 3 * i + 3), 255], 4 * i);
    byId("legend-colours").getContext("2d").putImageData(pixels, 0, 0);
    const labels = field.colours === "labels";
    const unit = field.unit ? `: ${field.unit}` : "";
    byId("legend-title").textContent = labels
      ? this.run.sources
        ? "Blue: run, orange: scan"
        : "Grain number: colours tell grains that touch apart"
      : field.title + unit + (known ? NOTES[field.colours] ?? "" : " (not stored at this stage)");
    const ends = { low, middle: 0.5 * (low + high), high };
    for (const [name, value] of Object.entries(ends)) {
      byId(`legend-${name}`).textContent = labels ? "" : text(value / field.factor);
    }
    byId("view-upper-text").textContent = labels ? "" : quantity(high, field);
    byId("view-legend").setAttribute(
      "aria-label",
      labels ? "Colours tell grains apart" : `${field.title} from ${quantity(low, field)} to ` +
        quantity(high, field),
    );
  }

  /** A place [m] in the units of the camera. */
  toUnits(place) {
    return place.map((p, i) => (p - this.run.low[i]) / this.unit);
  }

  /** Edges of the box, or of the cylinder, around the nodes of the stage: where walls are. */
  setBox() {
    const { run, stage } = this;
    const steps = run.places[stage + 1];
    const ends = [0, 1, 2].map((axis) => {
      const [start, end] = [axis * run.numNodes, (axis + 1) * run.numNodes];
      let [low, high] = [Infinity, -Infinity];
      for (let i = start; i < end; i++) {
        low = Math.min(low, steps[i]);
        high = Math.max(high, steps[i]);
      }
      return [low, high].map((s) => (s / GRID_STEPS) * (run.size[axis] / this.unit));
    });
    const numbers = [];
    const line = (a, b) => numbers.push(...a, ...b, 0.2, 0.2, 0.2, 1.5);
    const corner = (bits) => ends.map((e, axis) => e[(bits >> axis) & 1]);
    for (let bits = 0; bits < 8; bits++) {
      for (const axis of run.round ? [] : [1, 2, 4]) {
        if (!(bits & axis)) line(corner(bits), corner(bits | axis));
      }
    }
    const [x, y, z] = ends;
    const onCircle = (k, height) => {
      const angle = (2 * Math.PI * k) / CIRCLE;
      const of = (end, part) => 0.5 * (end[0] + end[1] + part * (end[1] - end[0]));
      return [of(x, Math.cos(angle)), of(y, Math.sin(angle)), height];
    };
    for (let k = 0; run.round && k < CIRCLE; k++) {
      for (const height of z) line(onCircle(k, height), onCircle(k + 1, height));
      if (k % (CIRCLE / 4) === 0) line(onCircle(k, z[0]), onCircle(k, z[1]));
    }
    this.painter.setLines("box", new Float32Array(numbers));
  }

  setContacts() {
    const { contacts } = this;
    const kind = byId("view-contacts").value;
    const asked = { all: 0, strong: KIND.strong, chains: KIND.chain }[kind];
    const numbers = [];
    const grains = this.run.numGrains;
    const visible = (grain) => grain >= grains || !this.hidden.has(grain);
    for (let c = 0; contacts && kind !== "none" && c < contacts.a.length; c++) {
      const flags = contacts.kind[c];
      if ((flags & asked) !== asked || !visible(contacts.a[c]) || !visible(contacts.b[c])) continue;
      const start = this.toUnits([...contacts.ends.slice(6 * c, 6 * c + 3)]);
      const end = this.toUnits([...contacts.ends.slice(6 * c + 3, 6 * c + 6)]);
      const name = flags & KIND.sliding ? "sliding" : flags & KIND.strong ? "strong" : "weak";
      const width = Math.min(0.6 + 1.6 * Math.max(contacts.ratio[c], 0), WIDEST);
      numbers.push(...start, ...end, ...COLOURS[name], width);
    }
    this.painter.setLines("contacts", new Float32Array(numbers));
    this.numLines = numbers.length / NUMBERS_A_LINE;
    this.showContactLegend(kind);
    this.redraw();
  }

  showContactLegend(kind) {
    const legend = byId("legend-contacts");
    legend.replaceChildren();
    if (kind === "none") return;
    if (!this.contacts) {
      legend.textContent = "No contacts were stored at this stage.";
      return;
    }
    const names = { strong: "strong (above the mean force)", weak: "weak", sliding: "sliding" };
    legend.append("Contacts, width by normal force: ");
    for (const [name, words] of Object.entries(names)) {
      const mark = document.createElement("b");
      mark.textContent = "▬ ";
      mark.style.color = `rgb(${COLOURS[name].map((c) => Math.round(255 * c)).join(",")})`;
      legend.append(mark, `${words} `);
    }
  }

  setCut() {
    const axis = byId("view-cut").value;
    const place = Number(byId("view-cut-place").value);
    this.cut = axis === "" ? null : { axis: Number(axis), place };
    const from = this.run.size[Number(axis)] * place;
    const [factor, unit] = lengthUnit(this.unit);
    byId("view-cut-text").textContent = this.cut ? `${text(from / factor)} ${unit}` : "";
    this.redraw();
  }

  /** Whether a surface is one of the stage and of what is chosen; all are where scans are not. */
  belongs(grain) {
    const source = this.run.sources?.[grain];
    const kind = byId("view-source").value;
    return !source || (source.stage === this.stage && (kind === "both" || kind === source.kind));
  }

  /** Index of the grain of a number, -1: none. */
  find(label) {
    return this.run.labels.findIndex((other, grain) => other === label && this.belongs(grain));
  }

  setShown() {
    const shown = new Uint8Array(this.run.numGrains).map(
      (_, grain) => !this.hidden.has(grain) && this.belongs(grain),
    );
    this.painter.setShown(shown);
    this.setContacts();
  }

  hide() {
    if (this.selected < 0) return;
    const label = this.run.labels[this.selected];
    this.run.labels.forEach((other, grain) => other === label && this.hidden.add(grain));
    this.select(-1);
    this.setShown();
  }

  /** Show the chosen grain and those that it touches. */
  isolate() {
    if (this.selected < 0) return;
    const near = new Set(this.contactsOf(this.selected).map(({ other }) => other));
    near.add(this.selected);
    const { labels } = this.run;
    const kept = new Set([...near].map((grain) => labels[grain]));
    this.hidden = new Set(labels.map((_, grain) => grain).filter((g) => !kept.has(labels[g])));
    this.setShown();
  }

  /** Contacts of a grain: the other one, force [N], mobilised friction, flags; largest first. */
  contactsOf(grain) {
    const { contacts } = this;
    const found = [];
    for (let c = 0; contacts && c < contacts.a.length; c++) {
      if (contacts.a[c] !== grain && contacts.b[c] !== grain) continue;
      const other = contacts.a[c] === grain ? contacts.b[c] : contacts.a[c];
      const { force, mobilised, kind } = contacts;
      found.push({ other, force: force[c], mobilised: mobilised[c], kind: kind[c] });
    }
    return found.sort((a, b) => b.force - a.force);
  }

  select(grain) {
    this.selected = grain;
    byId("view-label").value = grain < 0 ? "" : String(this.run.labels[grain]);
    this.showGrain();
    this.redraw();
  }

  /** Pick what is at a place of the canvas [CSS pixels from its upper left corner]. */
  pick(x, y) {
    const { width, height } = this.canvas.getBoundingClientRect();
    const [px, py] = [(x / width) * this.canvas.width, (1 - y / height) * this.canvas.height];
    this.select(this.painter.pick(this.camera, this.look(), Math.floor(px), Math.floor(py)));
  }

  showGrain() {
    const place = byId("view-grain");
    place.replaceChildren();
    const { run, selected, stage } = this;
    if (selected < 0) return;
    const head = document.createElement("h3");
    const { strain } = run.stages[stage];
    head.textContent = `Grain ${run.labels[selected]} at strain ${text(strain)}`;
    const numbers = run.columns.map((column) => {
      const values = run.column(column.name, stage);
      return [column.title, values ? quantity(values[selected], column) : "–"];
    });
    const contacts = this.contactsOf(selected).map(({ other, force, mobilised, kind }) => [
      other < run.numGrains ? `grain ${run.labels[other]}` : `wall ${run.walls[other - run.numGrains]}`,
      text(force),
      kind & KIND.sliding ? "sliding" : text(mobilised, 2),
    ]);
    const both = document.createElement("div");
    both.className = "two";
    both.append(
      table("Grain properties", ["", ""], numbers),
      table("Its contacts", ["with", "normal force: N", "mobilised friction"], contacts),
    );
    place.append(head, both);
  }

  /** Normal and place of the cut in parts of the box; what is on the side of the eye goes. */
  cutPlane() {
    if (!this.cut) return [0, 0, 0, 1];
    const { axis, place } = this.cut;
    const sign = this.camera.axes[2][axis] < 0 ? -1 : 1;
    return [0, 1, 2].map((i) => (i === axis ? sign : 0)).concat(sign * place);
  }

  look() {
    const grains = byId("view-grains").value;
    return {
      range: this.range,
      cut: this.cutPlane(),
      faint: grains === "faint",
      surfaces: grains !== "hidden",
      contacts: byId("view-contacts").value !== "none",
      selected: this.selected,
      pixelRatio: this.pixelRatio,
    };
  }

  redraw() {
    this.waiting ??= requestAnimationFrame(() => this.draw());
  }

  draw() {
    if (this.waiting) cancelAnimationFrame(this.waiting);
    this.waiting = undefined;
    const { canvas, camera } = this;
    const { width, height } = canvas.getBoundingClientRect();
    this.pixelRatio = Math.min(window.devicePixelRatio || 1, 2);
    const size = [width, height].map((s) => Math.max(Math.round(s * this.pixelRatio), 1));
    if (canvas.width !== size[0] || canvas.height !== size[1]) {
      [canvas.width, canvas.height] = size;
    }
    camera.aspect = size[0] / size[1];
    this.painter.draw(camera, this.look());
    this.drawScaleBar(width);
    this.drawAxes();
    this.drawTag(width, height);
  }

  drawScaleBar(width) {
    const metres = 2 * this.camera.halves[0] * this.unit;
    const length = roundLength(0.25 * metres);
    const [factor, unit] = lengthUnit(length);
    byId("view-bar").style.width = `${(length / metres) * width}px`;
    byId("view-bar").firstElementChild.textContent = `${text(length / factor)} ${unit}`;
  }

  drawAxes() {
    const [right, up] = this.camera.axes;
    const parts = ["x", "y", "z"].flatMap((name, i) => {
      const [x, y] = [32 * right[i], -32 * up[i]];
      const line = svg("line", { x1: 0, y1: 0, x2: x, y2: y, stroke: "#000", "stroke-width": 2 });
      const letter = svg("text", { x: 1.3 * x, y: 1.3 * y });
      letter.textContent = Math.hypot(x, y) > 6 ? name : "";
      return [line, letter];
    });
    byId("view-axes").replaceChildren(...parts);
  }

  /** The number of the chosen grain, in the middle of its nodes. */
  drawTag(width, height) {
    const tag = byId("view-tag");
    const { run, selected } = this;
    tag.hidden = selected < 0;
    if (selected < 0) return;
    const steps = run.places[this.stage + 1];
    const first = run.grainOfNode.indexOf(selected);
    const last = run.grainOfNode.lastIndexOf(selected);
    const middle = [0, 1, 2].map((axis) => {
      let sum = 0;
      for (let i = first; i <= last; i++) sum += steps[axis * run.numNodes + i];
      return ((sum / (last - first + 1)) * run.size[axis]) / GRID_STEPS / this.unit;
    });
    const [x, y] = this.camera.project(middle);
    tag.textContent = String(run.labels[selected]);
    tag.style.left = `${0.5 * (1 + x) * width}px`;
    tag.style.top = `${0.5 * (1 - y) * height}px`;
  }
}

/** Unpack the data and show the view; a sentence where that is not possible. */
async function start() {
  try {
    const header = JSON.parse(byId("view-header").textContent);
    if (!("DecompressionStream" in window)) throw new Error("this browser is too old");
    const bytes = await inflate(byId("view-data").textContent.trim());
    const run = new Run(header, bytes);
    byId("view-body").hidden = false;
    const view = new View(run);
    say("");
    return view;
  } catch (error) {
    byId("view-body").hidden = true;
    say(`The view cannot be shown: ${error.message}.`);
    throw error;
  }
}

window.mufeView = start();
