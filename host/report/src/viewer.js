// Two views of one pair with one camera. Points arrive as 16-bit steps within a box; the page around them is Rust's.
// After the first drawing the page counts the pixels that points lit, so that a test can tell a view from a blank.
"use strict";
(() => {
  const body = document.body;
  addEventListener("error", (event) => (body.dataset.error = event.message));
  const byId = (id) => document.getElementById(id);
  const data = byId("viewer");
  if (!data) return void (body.dataset.ready = "1");

  const numbers = (text) => text.split(" ").map(Number);
  const half = numbers(data.dataset.view); // half the box to show, whose centre is the origin
  const layers = [...data.querySelectorAll("script")].map((script) => ({
    origin: numbers(script.dataset.origin),
    extent: numbers(script.dataset.extent),
    bytes: Uint8Array.from(atob(script.textContent), (c) => c.charCodeAt(0)),
  }));
  const redraw = atNextFrame(() => drawAll());
  const { camera, size, fit, reset, clipFromWorld, steer } = orbitCamera(half, { yaw: -2.5, pitch: 0.55 }, 0, redraw);
  const gridStep = [1, 2, 5, 10, 20, 50, 100, 200, 500].find((step) => step * 5 > size) || 1000;

  // ---- drawing ------------------------------------------------------------------------------------------------
  const VERTEX = `#version 300 es
    in vec4 code;
    uniform vec3 origin, extent, tint, paper;
    uniform mat4 clip;
    uniform float pixels, distance, mode, dark;
    uniform vec2 heights;
    out vec3 colour;
    vec3 ramp(float t) {
      t = clamp(t, 0.0, 1.0);
      vec3 a = mix(vec3(.19, .16, .44), vec3(.10, .47, .56), smoothstep(0., .4, t));
      vec3 b = mix(a, vec3(.36, .73, .39), smoothstep(.3, .7, t));
      return mix(b, mix(vec3(.85, .66, .05), vec3(.98, .89, .25), dark), smoothstep(.65, 1., t)) + .12 * dark;
    }
    void main() {
      vec3 p = origin + code.xyz * extent;
      gl_Position = clip * vec4(p, 1);
      gl_PointSize = clamp(pixels * distance / gl_Position.w, pixels * .7, pixels * 4.);
      float t = mode == 1. ? (p.z - heights.x) / (heights.y - heights.x) : code.w;
      float haze = .45 * smoothstep(.7, 2.2, gl_Position.w / distance);
      colour = mix(mode == 0. ? tint : ramp(t), paper, haze);
    }`;
  const FRAGMENT = `#version 300 es
    precision mediump float;
    in vec3 colour;
    uniform float round;
    out vec4 pixel;
    void main() {
      vec2 d = gl_PointCoord - .5;
      if (round > 0. && dot(d, d) > .25) discard;
      pixel = vec4(colour, 1);
    }`;
  const theme = () => {
    const [target, source, grid, paper] = styleColours(data.parentElement, "--target", "--source", "--view-grid", "--view");
    return { layers: [target, source], grid, paper };
  };
  const upload = (gl, program, bytes, stride, type, normalised) => {
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, bytes, gl.STATIC_DRAW);
    const place = gl.getAttribLocation(program, "code");
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 4, type, normalised, stride, 0);
    return { array, count: bytes.byteLength / stride };
  };
  const gridLines = () => {
    const ends = [0, 1].map((k) => Math.ceil(half[k] / gridStep) * gridStep);
    const lines = [];
    for (let x = -ends[0]; x <= ends[0]; x += gridStep) lines.push(x, -ends[1], -half[2], 0, x, ends[1], -half[2], 0);
    for (let y = -ends[1]; y <= ends[1]; y += gridStep) lines.push(-ends[0], y, -half[2], 0, ends[0], y, -half[2], 0);
    return new Float32Array(lines);
  };

  class View {
    constructor(name, layers) {
      this.name = name;
      this.layers = layers;
      this.canvas = byId("view-" + name);
      this.gl = this.canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
      if (!this.gl) return;
      this.load();
      this.canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
      this.canvas.addEventListener("webglcontextrestored", () => (this.load(), this.draw()));
      steer(this.canvas);
    }
    load() {
      const gl = this.gl;
      this.program = linkedProgram(gl, VERTEX, FRAGMENT);
      this.clouds = this.layers.map((layer) => upload(gl, this.program, layer.bytes, 8, gl.UNSIGNED_SHORT, true));
      this.grid = upload(gl, this.program, gridLines(), 16, gl.FLOAT, false);
    }
    get aspect() {
      return this.canvas.clientWidth / this.canvas.clientHeight || 1;
    }
    draw(withGrid = true) {
      const { gl, canvas, program } = this;
      const { width, height, scale } = sharpened(canvas);
      const colours = theme();
      const set = (name, kind, ...value) => gl["uniform" + kind](gl.getUniformLocation(program, name), ...value);
      gl.viewport(0, 0, width, height);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.DEPTH_TEST);
      gl.useProgram(program);
      gl.uniformMatrix4fv(gl.getUniformLocation(program, "clip"), false, clipFromWorld(width / height));
      set("pixels", "1f", 1.9 * scale * Number(byId("point-size").value));
      set("distance", "1f", camera.distance);
      set("heights", "2f", -half[2], half[2]);
      set("paper", "3fv", colours.paper);
      set("dark", "1f", colours.paper[0] < 0.5 ? 1 : 0);
      set("round", "1f", 1);
      set("mode", "1f", Number(byId("colour-by").value));
      this.clouds.forEach((cloud, k) => {
        if (!byId(k ? "show-source" : "show-target").checked) return;
        set("origin", "3fv", this.layers[k].origin);
        set("extent", "3fv", this.layers[k].extent);
        set("tint", "3fv", colours.layers[k]);
        gl.bindVertexArray(cloud.array);
        gl.drawArrays(gl.POINTS, 0, cloud.count);
      });
      if (!withGrid) return;
      set("mode", "1f", 0);
      set("round", "1f", 0);
      set("origin", "3f", 0, 0, 0);
      set("extent", "3f", 1, 1, 1);
      set("tint", "3fv", colours.grid);
      gl.bindVertexArray(this.grid.array);
      gl.drawArrays(gl.LINES, 0, this.grid.count);
    }
    // Pixels that are not background; the background alone is transparent.
    lit() {
      this.draw(false);
      const { gl, canvas } = this;
      const pixels = new Uint8Array(canvas.width * canvas.height * 4);
      gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
      let count = 0;
      for (let i = 3; i < pixels.length; i += 4) if (pixels[i]) count++;
      return count;
    }
  }

  const drawAll = () => {
    if (!camera.distance) camera.distance = fit(Math.min(...views.map((view) => view.aspect)));
    views.forEach((view) => view.draw());
  };

  // ---- start --------------------------------------------------------------------------------------------------
  const views = [new View("before", layers.slice(0, 2)), new View("after", layers.slice(2, 4))];
  if (views.some((view) => !view.gl)) {
    for (const view of views) {
      view.canvas.hidden = true;
      view.canvas.nextElementSibling.hidden = false;
    }
    document.querySelector(".controls").hidden = true;
    Object.assign(body.dataset, { webgl: "0", ready: "1" });
    return;
  }
  byId("view-grid").textContent = `Grid: ${gridStep} m.`;
  for (const id of ["show-target", "show-source", "colour-by", "point-size"]) byId(id).addEventListener("input", redraw);
  byId("view-reset").addEventListener("click", () => (reset(), redraw()));
  byId("view-top").addEventListener("click", () => (reset({ yaw: -Math.PI / 2, pitch: 1.57 }), redraw()));
  for (const query of ["(prefers-color-scheme: dark)", "print"]) matchMedia(query).addEventListener("change", drawAll);
  addEventListener("beforeprint", drawAll);
  reset();
  drawAll();
  for (const view of views) body.dataset["lit" + view.name[0].toUpperCase() + view.name.slice(1)] = view.lit();
  drawAll();
  const sized = new ResizeObserver(redraw);
  views.forEach((view) => sized.observe(view.canvas));
  body.dataset.ready = "1";
})();
