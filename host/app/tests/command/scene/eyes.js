// What the tests see of the page: pixels of its view, once it is drawn.
window.requestAnimationFrame = (draw) => setTimeout(draw, 1); // a headless browser stops drawing frames by itself
const note = document.body.dataset;
const byId = (id) => document.getElementById(id);
const canvas = byId("view-scene");
const wait = (ms) => new Promise((done) => setTimeout(done, ms));
const ready = async () => { for (let i = 0; i < 900 && !note.ready; i++) await wait(10); };
const pixels = () => {
  const gl = canvas.getContext("webgl2");
  const seen = new Uint8Array(4 * canvas.width * canvas.height);
  gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, seen);
  return new Uint32Array(seen.buffer);
};
const differing = (a, b) => a.reduce((count, pixel, k) => count + (pixel !== b[k]), 0);
// How many pixels a step changes.
const change = async (step) => {
  const before = pixels();
  step();
  await wait(5);
  return differing(before, pixels());
};
const key = (key, shiftKey) => canvas.dispatchEvent(new KeyboardEvent("keydown", { key, shiftKey }));
const set = (id, value) => {
  const input = byId(id);
  if (input.type === "checkbox") input.checked = value; else input.value = value;
  input.dispatchEvent(new Event("input"));
};
