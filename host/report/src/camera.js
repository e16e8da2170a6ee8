// A camera that circles what it looks at, and the hands that move it: mouse, touch, keys. One for all canvases of a page.
// `half`: half the box to show first, whose centre is the origin; `start`: yaw and pitch, rad; `changed`: called after each move.
"use strict";
const orbitCamera = (half, start, nearest, changed) => {
  const size = Math.hypot(...half);
  const FIELD = Math.tan(0.35); // half the vertical field of view
  const camera = { ...start, distance: 1, focus: [0, 0, 0] };
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const basis = () => {
    const [cy, sy, cp, sp] = [Math.cos(camera.yaw), Math.sin(camera.yaw), Math.cos(camera.pitch), Math.sin(camera.pitch)];
    return { right: [-sy, cy, 0], up: [-cy * sp, -sy * sp, cp], back: [cy * cp, sy * cp, sp] };
  };
  // The distance from which the corners of the box fit, a little closer: corners are mostly empty.
  const fit = (aspect) => {
    const { right, up, back } = basis();
    let distance = 0;
    for (let i = 0; i < 8; i++) {
      const corner = half.map((h, k) => (i >> k & 1 ? h : -h));
      const across = Math.abs(dot(corner, right)) / (FIELD * Math.min(aspect, 2));
      const upward = Math.abs(dot(corner, up)) / FIELD;
      distance = Math.max(distance, Math.max(across, upward) + dot(corner, back));
    }
    return distance * 0.94;
  };
  const reset = (view = start) => Object.assign(camera, view, { focus: [0, 0, 0] }, { distance: 0 });
  // Column by column; after a reset the distance is what fits.
  const clipFromWorld = (aspect) => {
    const { right, up, back } = basis();
    const eye = camera.focus.map((f, k) => f + camera.distance * back[k]);
    const [near, far] = [Math.max(nearest, camera.distance * 0.02), camera.distance + 40 * size];
    const depth = [(far + near) / (near - far), (2 * far * near) / (near - far)];
    const rows = [right.map((c) => c / (FIELD * aspect)), up.map((c) => c / FIELD), back.map((c) => c * depth[0]), back.map((c) => -c)];
    const last = rows.map((row, k) => -dot(row, eye) + (k === 2 ? depth[1] : 0));
    return new Float32Array([0, 1, 2].flatMap((k) => rows.map((row) => row[k])).concat(last));
  };

  // ---- hands --------------------------------------------------------------------------------------------------
  const orbit = (dx, dy) => {
    camera.yaw -= dx;
    camera.pitch = Math.min(1.57, Math.max(-1.57, camera.pitch + dy));
  };
  const pan = (dx, dy) => {
    const { right, up } = basis();
    const reach = 2 * FIELD * camera.distance;
    camera.focus = camera.focus.map((f, k) => f + reach * (dy * up[k] - dx * right[k]));
  };
  const zoom = (factor) => (camera.distance = Math.min(40 * size, Math.max(size / 200, camera.distance * factor)));
  const KEYS = {
    ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1],
    "+": 1 / 1.15, "=": 1 / 1.15, "-": 1.15, 0: "reset", Home: "reset",
  };
  const press = (event) => {
    const action = KEYS[event.key];
    if (!action || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    if (action === "reset") reset();
    else if (typeof action === "number") zoom(action);
    else if (event.shiftKey) pan(action[0] * -0.05, action[1] * -0.05);
    else orbit(action[0] * -0.09, action[1] * -0.09);
    changed();
  };
  const steer = (canvas) => {
    const fingers = new Map();
    const spread = () => {
      const [a, b] = [...fingers.values()];
      return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, gap: Math.hypot(a.x - b.x, a.y - b.y) || 1 };
    };
    const lift = (event) => fingers.delete(event.pointerId);
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    });
    canvas.addEventListener("pointermove", (event) => {
      const old = fingers.get(event.pointerId);
      if (!old) return;
      const before = fingers.size === 2 && spread();
      const [dx, dy] = [event.clientX - old.x, event.clientY - old.y].map((d) => d / canvas.clientHeight);
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      if (before) {
        const after = spread();
        pan((after.x - before.x) / canvas.clientHeight, (after.y - before.y) / canvas.clientHeight);
        zoom(before.gap / after.gap);
      } else if (event.shiftKey || event.buttons & 6) pan(dx, dy);
      else orbit(dx * 4, dy * 4);
      changed();
    });
    canvas.addEventListener("pointerup", lift);
    canvas.addEventListener("pointercancel", lift);
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("dblclick", () => (reset(), changed()));
    canvas.addEventListener("keydown", press);
    canvas.addEventListener("wheel", (event) => {
      if (document.activeElement !== canvas && !event.ctrlKey) return; // the page scrolls until a view is chosen
      event.preventDefault();
      zoom(Math.exp(Math.sign(event.deltaY) * 0.12));
      changed();
    }, { passive: false });
  };
  return { camera, size, fit, reset, clipFromWorld, steer };
};

// What both kinds of views do with WebGL.
const linkedProgram = (gl, ...texts) => {
  const program = gl.createProgram();
  texts.forEach((text, k) => {
    const shader = gl.createShader(k ? gl.FRAGMENT_SHADER : gl.VERTEX_SHADER);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  });
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(gl.getProgramInfoLog(program));
  return program;
};
// Gives a canvas as many pixels as it has on the screen; at most four for one of the page.
const sharpened = (canvas) => {
  const scale = Math.min(devicePixelRatio || 1, 2);
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.max(1, Math.round(side * scale)));
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  return { width, height, scale };
};
const styleColours = (element, ...names) => {
  const style = getComputedStyle(element);
  return names.map((name) => style.getPropertyValue(name).trim().slice(1).match(/../g).map((h) => parseInt(h, 16) / 255));
};
// Draws at the next frame, once for however many calls.
const atNextFrame = (draw) => {
  let due = 0;
  return () => {
    due = due || requestAnimationFrame(() => {
      due = 0;
      draw();
    });
  };
};
