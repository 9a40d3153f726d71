// Draws surfaces and lines with WebGL 2, and tells which grain is at a place of the picture.

const PROJECT = `
uniform vec3 u_focus, u_right, u_up, u_out;
uniform vec2 u_halves;
vec3 to_eye(vec3 place) {
  vec3 from = place - u_focus;
  return vec3(dot(from, u_right), dot(from, u_up), dot(from, u_out));
}
vec4 to_clip(vec3 eye) { return vec4(eye.xy / u_halves, -0.2 * eye.z, 1.0); }
`;

const SURFACE_VERTEX = `#version 300 es
precision highp float;
layout(location = 0) in vec3 a_place;
layout(location = 1) in float a_value;
layout(location = 2) in uint a_grain;
uniform vec3 u_size;
uniform vec2 u_range;
uniform highp sampler2D u_shown;
${PROJECT}
out vec3 v_eye, v_place;
out float v_share;
flat out uint v_grain;
void main() {
  v_place = a_place;
  v_eye = to_eye(a_place * u_size);
  v_share = (a_value - u_range.x) / (u_range.y - u_range.x);
  v_grain = a_grain;
  gl_Position = to_clip(v_eye);
  int g = int(a_grain);
  if (texelFetch(u_shown, ivec2(g % 1024, g / 1024), 0).r < 0.5) gl_Position = vec4(2, 2, 2, 1);
}`;

// Facets are flat: their normal follows from how the place changes from pixel to pixel. Inner sides,
// seen where the sample is cut open, are grey. Faint grains leave out three pixels of four.
const SURFACE_FRAGMENT = `#version 300 es
precision highp float;
in vec3 v_eye, v_place;
in float v_share;
flat in uint v_grain;
uniform sampler2D u_map;
uniform vec4 u_cut;
uniform int u_mode, u_selected;
out vec4 colour;
void main() {
  if (dot(v_place, u_cut.xyz) > u_cut.w) discard;
  if (u_mode == 2) {
    uint id = v_grain + 1u;
    colour = vec4(float(id & 255u), float((id >> 8) & 255u), float(id >> 16), 255.0) / 255.0;
    return;
  }
  bool selected = int(v_grain) == u_selected;
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (u_mode == 1 && !selected && (pixel.x % 2 != 0 || pixel.y % 2 != 0)) discard;
  vec3 normal = normalize(cross(dFdx(v_eye), dFdy(v_eye)));
  vec3 base = texture(u_map, vec2((clamp(v_share, 0.0, 1.0) * 255.0 + 0.5) / 256.0, 0.5)).rgb;
  if (!gl_FrontFacing) base = vec3(0.72);
  float light = 0.5 + 0.42 * max(dot(normal, normalize(vec3(-0.45, 0.6, 1.0))), 0.0)
    + 0.16 * max(dot(normal, normalize(vec3(0.8, 0.1, 1.0))), 0.0);
  light *= 0.6 + 0.4 * smoothstep(0.0, 0.5, abs(normal.z)); // rims are darker: grains stand apart
  colour = vec4(min(base * light, 1.0), 1.0);
  if (selected && (abs(normal.z) < 0.4 || !gl_FrontFacing)) colour = vec4(0.85, 0.0, 0.55, 1.0);
}`;

const LINE_VERTEX = `#version 300 es
precision highp float;
layout(location = 0) in vec3 a_from;
layout(location = 1) in vec3 a_to;
layout(location = 2) in vec4 a_look;
uniform vec2 u_pixels;
uniform float u_scale;
${PROJECT}
out vec3 v_colour;
void main() {
  vec4 from = to_clip(to_eye(a_from)), to = to_clip(to_eye(a_to));
  vec2 along = (to.xy - from.xy) * u_pixels;
  vec2 across = vec2(-along.y, along.x) / max(length(along), 1e-6);
  float end = float(gl_VertexID == 1 || gl_VertexID == 2 || gl_VertexID == 4);
  float side = gl_VertexID == 2 || gl_VertexID == 4 || gl_VertexID == 5 ? 0.5 : -0.5;
  gl_Position = mix(from, to, end);
  gl_Position.xy += side * a_look.w * u_scale * across / u_pixels * 2.0;
  v_colour = a_look.rgb;
}`;

const LINE_FRAGMENT = `#version 300 es
precision highp float;
in vec3 v_colour;
out vec4 colour;
void main() { colour = vec4(v_colour, 1.0); }`;

const NUMBERS_A_LINE = 10; // from, to, colour, width [CSS pixels]

class Painter {
  constructor(canvas) {
    const options = { antialias: true, preserveDrawingBuffer: true, alpha: false };
    const gl = canvas.getContext("webgl2", options);
    if (!gl) throw new Error("this browser has no WebGL 2 here");
    this.gl = gl;
    this.canvas = canvas;
    this.surface = this.program(SURFACE_VERTEX, SURFACE_FRAGMENT);
    this.line = this.program(LINE_VERTEX, LINE_FRAGMENT);
    this.buffers = {};
    this.map = this.texture();
    this.shown = this.texture();
    this.lines = { box: this.lineArray("box"), contacts: this.lineArray("contacts") };
    gl.clearColor(1, 1, 1, 1);
  }

  program(vertex, fragment) {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, text] of [
      [gl.VERTEX_SHADER, vertex],
      [gl.FRAGMENT_SHADER, fragment],
    ]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
        throw new Error(gl.getShaderInfoLog(shader));
      }
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new Error(gl.getProgramInfoLog(program));
    }
    const places = {};
    const count = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS);
    for (let i = 0; i < count; i++) {
      const { name } = gl.getActiveUniform(program, i);
      places[name] = gl.getUniformLocation(program, name);
    }
    return { program, places };
  }

  buffer(name, target, data) {
    const { gl } = this;
    this.buffers[name] ??= gl.createBuffer();
    gl.bindBuffer(target, this.buffers[name]);
    if (data) gl.bufferData(target, data, gl.STATIC_DRAW);
  }

  texture() {
    const { gl } = this;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) {
      gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
    }
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    return texture;
  }

  /** The triangles, and the grain of each node. */
  setSurface(faces, grainOfNode, size) {
    const { gl } = this;
    this.numCorners = faces.length;
    this.size = size;
    this.surfaceArray = gl.createVertexArray();
    gl.bindVertexArray(this.surfaceArray);
    this.buffer("faces", gl.ELEMENT_ARRAY_BUFFER, faces);
    this.buffer("grain", gl.ARRAY_BUFFER, grainOfNode);
    gl.vertexAttribIPointer(2, 1, gl.UNSIGNED_INT, 0, 0);
    this.buffer("places", gl.ARRAY_BUFFER);
    gl.vertexAttribPointer(0, 3, gl.UNSIGNED_SHORT, true, 8, 0);
    this.buffer("values", gl.ARRAY_BUFFER);
    gl.vertexAttribPointer(1, 1, gl.FLOAT, false, 0, 0);
    [0, 1, 2].forEach((place) => gl.enableVertexAttribArray(place));
    gl.bindVertexArray(null);
  }

  /** Steps of the grid, x of all nodes, then y, then z. */
  setPlaces(steps) {
    const n = steps.length / 3;
    const rows = new Uint16Array(4 * n);
    for (let axis = 0; axis < 3; axis++) {
      for (let i = 0; i < n; i++) rows[4 * i + axis] = steps[axis * n + i];
    }
    this.buffer("places", this.gl.ARRAY_BUFFER, rows);
  }

  setValues(values) {
    this.buffer("values", this.gl.ARRAY_BUFFER, values);
  }

  setMap(table) {
    const { gl } = this;
    gl.bindTexture(gl.TEXTURE_2D, this.map);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB8, 256, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, table);
  }

  /** One byte a grain: 0 is hidden. */
  setShown(shown) {
    const { gl } = this;
    const rows = Math.ceil(shown.length / 1024);
    const bytes = new Uint8Array(1024 * rows);
    shown.forEach((yes, grain) => (bytes[grain] = yes ? 255 : 0));
    gl.bindTexture(gl.TEXTURE_2D, this.shown);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R8, 1024, rows, 0, gl.RED, gl.UNSIGNED_BYTE, bytes);
  }

  lineArray(name) {
    const { gl } = this;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    this.buffer(name, gl.ARRAY_BUFFER);
    [3, 3, 4].forEach((size, place) => {
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, gl.FLOAT, false, 4 * NUMBERS_A_LINE, 12 * place);
      gl.vertexAttribDivisor(place, 1);
    });
    gl.bindVertexArray(null);
    return { array, count: 0 };
  }

  /** Lines "box" or "contacts": NUMBERS_A_LINE numbers each. */
  setLines(name, numbers) {
    this.buffer(name, this.gl.ARRAY_BUFFER, numbers);
    this.lines[name].count = numbers.length / NUMBERS_A_LINE;
  }

  /** Set the camera in a program that is in use. */
  look(places, camera) {
    const { gl } = this;
    const [right, up, out] = camera.axes;
    gl.uniform3fv(places.u_focus, camera.focus);
    gl.uniform3fv(places.u_right, right);
    gl.uniform3fv(places.u_up, up);
    gl.uniform3fv(places.u_out, out);
    gl.uniform2fv(places.u_halves, camera.halves);
  }

  /**
   * Draw the picture. `view`: range of the colours, cut (normal and place), faint, selected (grain
   * or -1), surfaces and contacts (whether they are drawn).
   */
  draw(camera, view) {
    const { gl, canvas } = this;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    if (view.surfaces) this.drawSurface(camera, view, view.faint ? 1 : 0);
    this.drawLines("box", camera, view);
    gl.disable(gl.DEPTH_TEST); // contacts lie inside the grains
    if (view.contacts) this.drawLines("contacts", camera, view);
  }

  drawSurface(camera, view, mode) {
    const { gl } = this;
    const { program, places } = this.surface;
    gl.useProgram(program);
    this.look(places, camera);
    gl.uniform3fv(places.u_size, this.size);
    gl.uniform2fv(places.u_range, view.range);
    gl.uniform4fv(places.u_cut, view.cut);
    gl.uniform1i(places.u_mode, mode);
    gl.uniform1i(places.u_selected, view.selected);
    [this.map, this.shown].forEach((texture, unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
    });
    gl.activeTexture(gl.TEXTURE0);
    gl.uniform1i(places.u_map, 0);
    gl.uniform1i(places.u_shown, 1);
    gl.bindVertexArray(this.surfaceArray);
    gl.drawElements(gl.TRIANGLES, this.numCorners, gl.UNSIGNED_INT, 0);
  }

  drawLines(name, camera, view) {
    const { gl, canvas } = this;
    const { program, places } = this.line;
    const { array, count } = this.lines[name];
    if (!count) return;
    gl.useProgram(program);
    this.look(places, camera);
    gl.uniform2f(places.u_pixels, canvas.width, canvas.height);
    gl.uniform1f(places.u_scale, view.pixelRatio);
    gl.bindVertexArray(array);
    gl.drawArraysInstanced(gl.TRIANGLES, 0, 6, count);
  }

  /** Index of the grain at a place of the picture [pixels from the lower left], -1: none. */
  pick(camera, view, x, y) {
    const { gl, canvas } = this;
    const [texture, depth] = [this.texture(), gl.createRenderbuffer()];
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, canvas.width, canvas.height);
    gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, canvas.width, canvas.height);
    const frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    const [target, kind] = [gl.FRAMEBUFFER, gl.TEXTURE_2D];
    gl.framebufferTexture2D(target, gl.COLOR_ATTACHMENT0, kind, texture, 0);
    gl.framebufferRenderbuffer(target, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(x, y, 1, 1);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    if (view.surfaces) this.drawSurface(camera, view, 2);
    const id = new Uint8Array(4);
    gl.readPixels(x, y, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, id);
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(1, 1, 1, 1);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.deleteFramebuffer(frame);
    gl.deleteRenderbuffer(depth);
    gl.deleteTexture(texture);
    return id[0] + 256 * id[1] + 65536 * id[2] - 1;
  }
}
