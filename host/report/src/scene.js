// A scene with its viewpoints and pairs. Triangles arrive packed as `packed.rs` says; the page around them is Rust's.
// Until the first drawing a still picture stands in the view's place, and stays there where nothing can be drawn.
(() => {
  const body = document.body;
  addEventListener("error", (event) => (body.dataset.error = event.message));
  addEventListener("unhandledrejection", (event) => (body.dataset.error = String(event.reason)));
  const byId = (id) => document.getElementById(id);
  const all = (mark) => [...document.querySelectorAll(mark)];
  const scene = JSON.parse(byId("scene-data").textContent);
  const stage = byId("stage");
  const canvas = byId("view-scene");
  const moved = (point) => point.map((x, k) => x - scene.middle[k]); // what is shown first has its middle at the origin

  // ---- what is shown ------------------------------------------------------------------------------------------
  const SETS = ["train", "held-out"];
  const pairs = scene.pairs.map((pair) => ({ ...pair, at: pair.at.map(moved) }));
  let selected = -1;
  let hovered = -1;
  const isShown = (pair) => byId("show-" + SETS[pair.set]).checked;

  // ---- camera -------------------------------------------------------------------------------------------------
  const NEAREST = 0.15; // m: nothing stands nearer to a viewpoint, and the depth buffer has to tell kerbs apart
  const redraw = atNextFrame(() => draw());
  const { camera, size, fit, reset, clipFromWorld, steer } = orbitCamera(scene.half, scene.start, NEAREST, redraw);
  const lookAt = (pair) => {
    const [a, b] = pair.at;
    const focus = a.map((x, k) => (x + b[k]) / 2);
    const distance = Math.max(40, 3 * Math.hypot(...a.map((x, k) => x - b[k])));
    Object.assign(camera, { focus, distance, pitch: Math.max(camera.pitch, 1.1) }); // from high, so that houses do not hide it
  };
  const standAt = (pair, which) => {
    const ahead = pair.ahead[which];
    const distance = size / 200;
    const focus = pair.at[which].map((x, k) => x + distance * ahead[k]);
    Object.assign(camera, { focus, distance, yaw: Math.atan2(-ahead[1], -ahead[0]), pitch: Math.asin(-ahead[2]) });
  };

  // ---- unpacking ----------------------------------------------------------------------------------------------
  const inflated = async (text) => {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  };
  const unpacked = (bytes) => {
    const count = scene.vertices;
    const corners = new Uint16Array(4 * count); // the fourth is padding: cards want multiples of four bytes
    for (let axis = 0; axis < 3; axis++) {
      const [low, high] = [2 * axis * count, (2 * axis + 1) * count];
      for (let i = 0, last = 0; i < count; i++) {
        const folded = bytes[low + i] | bytes[high + i] << 8;
        last += (folded >> 1) ^ -(folded & 1);
        corners[4 * i + axis] = last;
      }
    }
    const triangles = scene.groups.reduce((sum, group) => sum + group.triangles, 0);
    const indices = new Uint32Array(3 * triangles);
    for (let i = 0, at = 6 * count, next = 0; i < indices.length; i++) {
      let [back, shift] = [0, 0];
      for (let more = true; more; shift += 7) {
        const byte = bytes[at++];
        back += (byte & 127) * 2 ** shift;
        more = byte > 127;
      }
      indices[i] = next - back;
      if (back === 0) next++;
    }
    return { corners, indices };
  };

  // ---- drawing ------------------------------------------------------------------------------------------------
  const SURFACE = [`#version 300 es
    in vec3 code;
    uniform vec3 origin, extent;
    uniform mat4 clip;
    out vec3 place;
    void main() {
      place = origin + code * extent;
      gl_Position = clip * vec4(place, 1);
    }`, `#version 300 es
    precision highp float;
    in vec3 place;
    uniform vec3 tint, paper, sun, eye;
    uniform float reach;
    out vec4 pixel;
    void main() {
      vec3 normal = cross(dFdx(place), dFdy(place));
      float area = length(normal);
      normal = area > 0. ? normal / area : vec3(0, 0, 1);
      if (dot(normal, eye - place) < 0.) normal = -normal;
      float up = .5 + .5 * normal.z;
      vec3 light = max(dot(normal, sun), 0.) * vec3(.50, .48, .43) + mix(vec3(.40, .39, .37), vec3(.60, .63, .68), up);
      float haze = .35 * smoothstep(1., 4., length(eye - place) / reach);
      pixel = vec4(mix(tint * light, paper, haze), 1);
    }`];
  // Lines with round ends, so wide in pixels whatever their distance; one without length is a dot.
  const MARK = [`#version 300 es
    in vec3 a, b;
    in float wide;
    uniform mat4 clip;
    uniform vec2 window;
    uniform float scale;
    flat out vec2 from, to;
    flat out float half_width;
    out vec2 at;
    void main() {
      vec4 p = clip * vec4(a, 1), q = clip * vec4(b, 1);
      const float NEAR = .01;
      gl_Position = vec4(2, 2, 2, 1);
      if (max(p.w, q.w) < NEAR) return;
      if (p.w < NEAR) p = mix(q, p, (q.w - NEAR) / (q.w - p.w));
      if (q.w < NEAR) q = mix(p, q, (p.w - NEAR) / (p.w - q.w));
      from = .5 * window * p.xy / p.w;
      to = .5 * window * q.xy / q.w;
      half_width = .5 * wide * scale;
      vec2 way = to - from;
      way = length(way) > .001 ? normalize(way) : vec2(1, 0);
      int corner = gl_VertexID % 6;
      bool is_end = corner == 1 || corner == 2 || corner == 4;
      float side = corner == 0 || corner == 1 || corner == 3 ? -1. : 1.;
      float more = half_width + 1.;
      at = (is_end ? to + way * more : from - way * more) + side * more * vec2(-way.y, way.x);
      gl_Position = vec4(2. * at / window, is_end ? q.z / q.w : p.z / p.w, 1);
    }`, `#version 300 es
    precision highp float;
    flat in vec2 from, to;
    flat in float half_width;
    in vec2 at;
    uniform vec3 tint, edge;
    uniform float strength;
    out vec4 pixel;
    void main() {
      vec2 way = to - from, p = at - from;
      float along = clamp(dot(p, way) / max(dot(way, way), .0001), 0., 1.);
      float inside = half_width - length(p - along * way);
      float alpha = strength * clamp(inside + .5, 0., 1.);
      if (alpha <= 0.) discard;
      vec3 colour = half_width > 3. ? mix(edge, tint, clamp(inside - 1., 0., 1.)) : tint;
      pixel = vec4(colour * alpha, alpha);
    }`];

  const REFLECTANCE = [[0.19, 0.16, 0.44], [0.10, 0.47, 0.56], [0.36, 0.73, 0.39], [0.95, 0.83, 0.20]]; // of 0 to WHITE
  const WHITE = 0.7;
  const ofReflectance = (reflectance) => {
    const at = Math.min(1, reflectance / WHITE) * (REFLECTANCE.length - 1);
    const [low, share] = [Math.min(Math.floor(at), REFLECTANCE.length - 2), at - Math.min(Math.floor(at), REFLECTANCE.length - 2)];
    return REFLECTANCE[low].map((x, k) => x + share * (REFLECTANCE[low + 1][k] - x));
  };
  const tintOf = (material) => (byId("colour-by").value === "1" ? ofReflectance(material.reflectance) : material.colour.map((x) => x / 255));

  // A dot where each sensor stands, a line between the two, and one the way each looks.
  const AHEAD_M = 1.5;
  const marksOf = (which, widths) => {
    const [dot, line, look] = widths;
    return new Float32Array(which.flatMap(({ at: [a, b], ahead }) => {
      const looks = [a, b].map((at, k) => [...at, ...at.map((x, i) => x + AHEAD_M * ahead[k][i]), look]);
      return [...a, ...b, line, ...looks.flat(), ...a, ...a, dot, ...b, ...b, dot];
    }));
  };
  const FLOATS = 7; // of a mark: two ends and a width

  let gl = null;
  let drawn = null; // what is on the card
  const load = ({ corners, indices }) => {
    const surface = linkedProgram(gl, ...SURFACE);
    const mesh = gl.createVertexArray();
    gl.bindVertexArray(mesh);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    const code = gl.getAttribLocation(surface, "code");
    gl.enableVertexAttribArray(code);
    gl.vertexAttribPointer(code, 3, gl.UNSIGNED_SHORT, true, 8, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
    drawn = { surface, mesh, mark: linkedProgram(gl, ...MARK) };
    drawn.marks = SETS.map((_, set) => upload(marksOf(pairs.filter((pair) => pair.set === set), [9, 3, 2])));
    choose(selected);
  };
  const upload = (floats) => {
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, floats, gl.STATIC_DRAW);
    [["a", 3, 0], ["b", 3, 12], ["wide", 1, 24]].forEach(([name, count, offset]) => {
      const place = gl.getAttribLocation(drawn.mark, name);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, count, gl.FLOAT, false, 4 * FLOATS, offset);
      gl.vertexAttribDivisor(place, 1);
    });
    return { array, count: floats.length / FLOATS };
  };
  const setter = (program) => (name, kind, ...value) => gl["uniform" + kind](gl.getUniformLocation(program, name), ...value);
  const aspect = () => canvas.clientWidth / canvas.clientHeight || 1;

  const drawSurfaces = (clip, paper) => {
    const set = setter(drawn.surface);
    gl.useProgram(drawn.surface);
    gl.uniformMatrix4fv(gl.getUniformLocation(drawn.surface, "clip"), false, clip);
    const { yaw, pitch, distance, focus } = camera;
    const back = [Math.cos(yaw) * Math.cos(pitch), Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch)];
    set("eye", "3fv", focus.map((f, k) => f + distance * back[k]));
    set("sun", "3fv", scene.sun);
    set("reach", "1f", Math.max(distance, size));
    set("paper", "3fv", paper);
    set("origin", "3fv", scene.origin);
    set("extent", "3fv", scene.extent);
    gl.bindVertexArray(drawn.mesh);
    let first = 0;
    scene.groups.forEach((group, k) => {
      if (byId("material-" + k).checked) {
        set("tint", "3fv", tintOf(group));
        gl.drawElements(gl.TRIANGLES, 3 * group.triangles, gl.UNSIGNED_INT, 12 * first);
      }
      first += group.triangles;
    });
  };
  // Faintly through walls, then fully what is in sight.
  const drawMarks = (clip, { width, height, scale }, colours) => {
    const set = setter(drawn.mark);
    gl.useProgram(drawn.mark);
    gl.uniformMatrix4fv(gl.getUniformLocation(drawn.mark, "clip"), false, clip);
    set("window", "2f", width, height);
    set("scale", "1f", scale);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    const shown = SETS.flatMap((name, k) => (byId("show-" + name).checked ? [[drawn.marks[k], colours.sets[k], colours.paper]] : []));
    const chosen = pairs[selected];
    if (chosen) shown.push([drawn.chosen, colours.sets[chosen.set], colours.ink]);
    for (const [marks, tint, edge] of shown) {
      gl.bindVertexArray(marks.array);
      set("tint", "3fv", tint);
      set("edge", "3fv", edge);
      for (const [test, strength] of [[gl.ALWAYS, 0.4], [gl.LEQUAL, 1]]) {
        gl.depthFunc(test);
        set("strength", "1f", strength);
        gl.drawArraysInstanced(gl.TRIANGLES, 0, 6, marks.count);
      }
    }
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    gl.depthFunc(gl.LESS);
  };
  const draw = () => {
    if (!drawn || gl.isContextLost()) return;
    if (!camera.distance) camera.distance = fit(aspect());
    const screen = sharpened(canvas);
    const [train, heldOut, paper, ink] = styleColours(stage, "--target", "--source", "--view", "--ink");
    const clip = clipFromWorld(screen.width / screen.height);
    gl.viewport(0, 0, screen.width, screen.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    drawSurfaces(clip, paper);
    drawMarks(clip, screen, { sets: [train, heldOut], paper, ink });
    showName();
  };

  // ---- names and choices --------------------------------------------------------------------------------------
  // Where a place is in the canvas, in pixels of the page; nothing behind the eye.
  const onScreen = (point, clip) => {
    const [x, y, , w] = [0, 1, 2, 3].map((row) => clip[row] * point[0] + clip[4 + row] * point[1] + clip[8 + row] * point[2] + clip[12 + row]);
    return w > 0.01 ? [(0.5 + (0.5 * x) / w) * canvas.clientWidth, (0.5 - (0.5 * y) / w) * canvas.clientHeight] : null;
  };
  const WITHIN_PX = 14;
  const pairAt = (event) => {
    const box = canvas.getBoundingClientRect();
    const clip = clipFromWorld(aspect());
    let [nearest, best] = [WITHIN_PX, -1];
    pairs.forEach((pair, k) => {
      for (const at of isShown(pair) ? pair.at.map((point) => onScreen(point, clip)) : []) {
        const apart = at ? Math.hypot(at[0] - event.clientX + box.left, at[1] - event.clientY + box.top) : nearest;
        if (apart < nearest) [nearest, best] = [apart, k];
      }
    });
    return best;
  };
  // Stands beside the pair that the pointer is on, else beside the chosen one.
  const showName = () => {
    const label = byId("pair-name");
    const pair = pairs[hovered] || pairs[selected];
    const at = pair && onScreen(pair.at[0], clipFromWorld(aspect()));
    const isInside = at && at[0] > 0 && at[1] > 0 && at[0] < canvas.clientWidth && at[1] < canvas.clientHeight;
    label.hidden = !isInside;
    if (!isInside) return;
    label.textContent = pair.name;
    label.style.left = Math.min(at[0] + 12, canvas.clientWidth - label.offsetWidth - 4) + "px";
    label.style.top = Math.max(at[1] - 30, 2) + "px";
  };
  const choose = (index) => {
    selected = index;
    const pair = pairs[index];
    if (pair && drawn) {
      if (drawn.chosen) gl.deleteVertexArray(drawn.chosen.array);
      drawn.chosen = upload(marksOf([pair], [15, 5, 4]));
    }
    buttons.forEach((button) => button.setAttribute("aria-pressed", String(Number(button.dataset.pair) === index)));
    byId("pair-told").textContent = pair ? `${pair.name}: ${pair.told}` : "No pair is selected.";
    byId("pair-hands").hidden = !pair;
  };
  const select = (index) => {
    choose(index);
    const pair = pairs[index];
    if (!pair) return redraw();
    byId("show-" + SETS[pair.set]).checked = true;
    const button = buttons.find((button) => Number(button.dataset.pair) === index);
    const list = button && button.closest(".pairs");
    if (list) list.scrollTop = button.offsetTop - list.offsetTop - list.clientHeight / 2;
    lookAt(pair);
    redraw();
  };
  const buttons = all("button[data-pair]");
  const next = (step) => select(selected < 0 ? (step > 0 ? 0 : pairs.length - 1) : (selected + step + pairs.length) % pairs.length);
  const listen = () => {
    steer(canvas);
    let pressed = null;
    canvas.addEventListener("pointerdown", (event) => (pressed = [event.clientX, event.clientY]));
    canvas.addEventListener("pointerup", (event) => {
      const apart = pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]);
      const found = apart !== null && apart < 4 ? pairAt(event) : -1;
      if (found >= 0) select(found);
    });
    canvas.addEventListener("pointermove", (event) => {
      const found = event.buttons ? -1 : pairAt(event);
      if (found === hovered) return;
      hovered = found;
      showName();
    });
    canvas.addEventListener("pointerleave", () => ((hovered = -1), showName()));
    canvas.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || !pairs.length) return;
      if (event.key === "n") next(1);
      if (event.key === "p") next(-1);
      if (event.key === "Escape") select(-1);
    });
    buttons.forEach((button) => button.addEventListener("click", () => select(Number(button.dataset.pair))));
    all("button[data-stand]").forEach((button) => button.addEventListener("click", () => (standAt(pairs[selected], Number(button.dataset.stand)), redraw())));
    byId("pair-leave").addEventListener("click", () => select(-1));
    byId("view-reset").addEventListener("click", () => (reset(), redraw()));
    byId("view-top").addEventListener("click", () => (reset({ yaw: -Math.PI / 2, pitch: 1.57 }), redraw()));
    byId("colour-by").addEventListener("input", () => {
      scene.groups.forEach((group, k) => {
        byId("swatch-" + k).style.background = `rgb(${tintOf(group).map((x) => Math.round(255 * x))})`;
      });
      redraw();
    });
    for (const input of all(".legend-list input, .controls input")) input.addEventListener("input", redraw);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
    addEventListener("beforeprint", draw);
    new ResizeObserver(redraw).observe(canvas);
  };

  // ---- start --------------------------------------------------------------------------------------------------
  const stand = () => {
    Object.assign(body.dataset, { webgl: "0", ready: "1" });
    byId("no-view").hidden = false;
  };
  const begin = async () => {
    gl = "DecompressionStream" in window && canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    if (!gl) return stand();
    const geometry = unpacked(await inflated(byId("geometry").textContent));
    load(geometry);
    canvas.addEventListener("webglcontextlost", (event) => (event.preventDefault(), (drawn = null)));
    canvas.addEventListener("webglcontextrestored", () => (load(geometry), draw()));
    byId("still").hidden = true;
    for (const part of all("[data-live]")) part.hidden = false;
    reset();
    draw();
    listen();
    body.dataset.ready = "1";
  };
  begin();
})();
