// Arrays of the view from base64; the writer, and its twin in Python, is report/packing.py.

const GRID_STEPS = 65535;
const BYTE_STEPS = 255;
const ARRAYS = { u1: Uint8Array, u2: Uint16Array, u4: Uint32Array, f4: Uint32Array };

/** Bytes of a deflated text in base64. */
async function inflate(text) {
  const packed = atob(text);
  const bytes = new Uint8Array(packed.length);
  for (let i = 0; i < packed.length; i++) bytes[i] = packed.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** One array by its entry in the header: planes of bytes, differences, floats. */
function unpack(bytes, entry) {
  const { count, at } = entry;
  const values = new ARRAYS[entry.kind](count);
  for (let plane = 0; plane < values.BYTES_PER_ELEMENT; plane++) {
    const start = at + plane * count;
    for (let i = 0; i < count; i++) values[i] |= bytes[start + i] << (8 * plane);
  }
  if (entry.differences) {
    let sum = 0;
    for (let i = 0; i < count; i++) {
      const z = values[i];
      sum += (z >>> 1) ^ -(z & 1);
      values[i] = sum; // a typed array keeps the lowest bits, as the writer's
      sum = values[i];
    }
  }
  return entry.kind === "f4" ? new Float32Array(values.buffer) : values;
}

/** The whole of what the page holds; arrays are unpacked when they are asked for. */
class Run {
  constructor(header, bytes) {
    Object.assign(this, header);
    this.bytes = bytes;
    this.entries = new Map(this.arrays.map((entry) => [entry.name, entry]));
    this.size = this.high.map((h, i) => h - this.low[i]);
    this.numGrains = this.labels.length;
    const counts = this.array("num_of_grain");
    this.numNodes = counts.reduce((sum, count) => sum + count, 0);
    this.grainOfNode = new Uint32Array(this.numNodes);
    let node = 0;
    counts.forEach((count, grain) => {
      this.grainOfNode.fill(grain, node, node + count);
      node += count;
    });
    this.faces = this.readFaces();
    this.places = this.readPlaces();
  }

  has(name) {
    return this.entries.has(name);
  }

  array(name) {
    return unpack(this.bytes, this.entries.get(name));
  }

  /** Triangles, three nodes each: stored are steps of the first, and the others less the first. */
  readFaces() {
    const stored = this.array("faces");
    const count = stored.length / 3;
    const faces = new Uint32Array(3 * count);
    let first = 0;
    for (let i = 0; i < count; i++) {
      first += stored[i];
      faces[3 * i] = first;
      faces[3 * i + 1] = first + stored[count + i];
      faces[3 * i + 2] = first + stored[2 * count + i];
    }
    return faces;
  }

  /** Steps of the grid: of the reference configuration, then of each stage; x of all, y, z. */
  readPlaces() {
    const places = [];
    for (let number = 0; number <= this.stages.length; number++) {
      const steps = this.array(`points.${number}`);
      if (number > 0) {
        const before = places[number - 1];
        for (let i = 0; i < steps.length; i++) steps[i] += before[i];
      }
      places.push(steps);
    }
    return places;
  }

  /** Positions [m] along an axis at a stage; stage -1 is the reference configuration. */
  coordinates(stage, axis) {
    const steps = this.places[stage + 1];
    const start = axis * this.numNodes;
    const scale = this.size[axis] / GRID_STEPS;
    const found = new Float32Array(this.numNodes);
    for (let i = 0; i < this.numNodes; i++) found[i] = this.low[axis] + scale * steps[start + i];
    return found;
  }

  /** Displacement since the reference configuration [m]: its length, or along one axis. */
  displacement(stage, axis) {
    const [before, now] = [this.places[0], this.places[stage + 1]];
    const n = this.numNodes;
    const scale = this.size.map((size) => size / GRID_STEPS);
    const found = new Float32Array(n);
    for (let i = 0; i < n; i++) {
      const d = scale.map((s, k) => s * (now[k * n + i] - before[k * n + i]));
      found[i] = axis === undefined ? Math.hypot(d[0], d[1], d[2]) : d[axis];
    }
    return found;
  }

  /** Values of a packed field at a stage, in SI units; null where it was not stored. */
  field(field, stage) {
    const name = `field.${field.name}.${stage}`;
    if (!this.has(name)) return null;
    const table = new Float32Array(BYTE_STEPS + 1);
    for (let q = 0; q <= BYTE_STEPS; q++) {
      table[q] = field.low + (field.high - field.low) * (q / BYTE_STEPS) ** field.power;
    }
    return Float32Array.from(this.array(name), (q) => table[q]);
  }

  /** Numbers of all grains in a column at a stage, in SI units; null where they are not known. */
  column(name, stage) {
    return this.has(`grain.${name}.${stage}`) ? this.array(`grain.${name}.${stage}`) : null;
  }

  /** Contacts at a stage as arrays, or null. */
  contacts(stage) {
    if (!this.has(`contact.a.${stage}`)) return null;
    const names = ["a", "b", "ends", "force", "ratio", "mobilised", "kind"];
    return Object.fromEntries(names.map((name) => [name, this.array(`contact.${name}.${stage}`)]));
  }
}
