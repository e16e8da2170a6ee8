// Presses, drags, clicks and selects, and notes how many pixels of the view each step changes.
canvas.setPointerCapture = () => {};
const pointer = (type, x, y, more) => {
  const box = canvas.getBoundingClientRect();
  canvas.dispatchEvent(new PointerEvent(type, { pointerId: 1, clientX: box.left + x, clientY: box.top + y, ...more }));
};
const drag = (buttons) => (pointer("pointerdown", 90, 90, { buttons }), pointer("pointermove", 140, 100, { buttons }), pointer("pointerup", 140, 100));
const pinch = () => {
  const fingers = [[1, 100], [2, 200]];
  fingers.forEach(([pointerId, x]) => pointer("pointerdown", x, 100, { pointerId }));
  pointer("pointermove", 260, 100, { pointerId: 2 });
  fingers.forEach(([pointerId]) => pointer("pointerup", 0, 0, { pointerId }));
};
const wheel = () => (canvas.focus(), canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: -100 })));
const button = (pair) => document.querySelector(`[data-pair="${pair}"]`);
const pressed = () => [...document.querySelectorAll("[data-pair]")].filter((b) => b.getAttribute("aria-pressed") === "true").map((b) => b.dataset.pair).join();
const named = () => (byId("pair-name").hidden ? "" : byId("pair-name").textContent);
const steps = {
  orbit: () => key("ArrowLeft"), pan: () => key("ArrowUp", true), zoom: () => key("+"), drag: () => drag(1), slide: () => drag(2),
  pinch, wheel, above: () => byId("view-top").click(), select: () => button(1).click(), stand: () => document.querySelector('[data-stand="1"]').click(),
  next: () => key("n"), leave: () => key("Escape"), previous: () => key("p"), reset: () => key("0"),
};
(async () => {
  await ready();
  const start = pixels();
  const told = [];
  for (const [name, step] of Object.entries(steps)) {
    note[name] = await change(step);
    told.push(`${name} ${pressed()}`);
  }
  note.told = told.join("; ");
  byId("pair-leave").click();
  key("0");
  await wait(5);
  note.back = differing(start, pixels());
  // Where the name of a chosen pair stands says where its first dot is: there the pointer finds it.
  button(0).click();
  await wait(5);
  const label = byId("pair-name");
  const [x, y] = [parseFloat(label.style.left) - 12, parseFloat(label.style.top) + 30];
  note.chosen = named();
  note.says = byId("pair-told").textContent;
  key("Escape");
  await wait(5);
  note.unnamed = named();
  pointer("pointermove", x, y);
  note.hovered = named();
  pointer("pointerdown", x, y, { buttons: 1 });
  pointer("pointerup", x, y);
  note.clicked = pressed();
  pointer("pointermove", 3, 3);
  note.hands = byId("pair-hands").hidden ? "hidden" : "there";
  note.ended = "1";
})();
