// How much of the view is drawn, in how many colours, and which materials are there: hiding one after the other changes it.
(async () => {
  await ready();
  const seen = pixels();
  note.drawn = Math.round((100 * seen.filter((pixel) => pixel >>> 24).length) / seen.length);
  note.colours = new Set(seen).size;
  note.across = canvas.clientWidth;
  let materials = 0;
  const listed = [...document.querySelectorAll(".legend-list input")];
  note.orbit = await change(() => key("ArrowLeft"));
  note.reflectance = await change(() => set("colour-by", "1"));
  for (const input of listed) materials += (await change(() => input.click())) > 0;
  [note.materials, note.listed] = [materials, listed.length];
  note.train = await change(() => set("show-train", false));
  note.heldOut = await change(() => set("show-held-out", false));
  note.left = pixels().filter((pixel) => pixel >>> 24).length;
  note.ended = "1";
})();
