// Saves a chart as SVG or PNG. A copy of it takes along what the style sheet says now, so that the file stands alone.
"use strict";
(() => {
  const FINE = 10; // units of a drawing for a pixel at its natural size
  const PNG_SCALE = 2;
  const INK = ["fill", "fill-opacity", "stroke", "stroke-opacity", "stroke-width", "stroke-dasharray", "stroke-linejoin",
    "stroke-linecap", "font-family", "font-size", "font-weight"];
  const inUnits = (lengths) => lengths === "none" ? lengths : lengths.split(",").map((l) => FINE * parseFloat(l)).join(" ");

  const alone = (chart) => {
    const copy = chart.cloneNode(true);
    const [theirs, ours] = [chart, copy].map((drawing) => drawing.querySelectorAll("*:not(title)"));
    theirs.forEach((element, k) => {
      const style = getComputedStyle(element);
      for (const name of INK) ours[k].setAttribute(name, style.getPropertyValue(name));
      // In a page lines keep their width whatever the chart's size; alone everything scales.
      for (const name of ["stroke-width", "stroke-dasharray"]) ours[k].setAttribute(name, inUnits(style.getPropertyValue(name)));
      // Areas that only tell what is under the pointer: nobody sees them, in any program.
      if (element.matches(".hint-area")) ours[k].setAttribute("fill", "none"), ours[k].setAttribute("pointer-events", "all");
      ours[k].removeAttribute("class");
    });
    const [left, top, width, height] = chart.dataset.box.split(" ").map(Number);
    const paper = document.createElementNS(copy.namespaceURI, "rect");
    const colour = getComputedStyle(document.documentElement).getPropertyValue("--surface");
    Object.entries({ x: left, y: top, width, height, fill: colour }).forEach(([name, value]) => paper.setAttribute(name, value));
    copy.prepend(paper);
    for (const name of ["style", "data-figure", "data-box"]) copy.removeAttribute(name);
    copy.setAttribute("viewBox", chart.dataset.box);
    copy.setAttribute("width", width / FINE);
    copy.setAttribute("height", height / FINE);
    return new XMLSerializer().serializeToString(copy);
  };

  const save = (name, address) => {
    const link = document.createElement("a");
    [link.download, link.href] = [name, address];
    link.click();
  };
  const svgAddress = (chart) => "data:image/svg+xml;charset=utf-8," + encodeURIComponent(alone(chart));
  const png = (chart, name) => {
    const picture = new Image();
    picture.onload = () => {
      const canvas = document.createElement("canvas");
      [canvas.width, canvas.height] = [picture.width, picture.height].map((side) => Math.ceil(PNG_SCALE * side));
      canvas.getContext("2d").drawImage(picture, 0, 0, canvas.width, canvas.height);
      save(name, canvas.toDataURL("image/png"));
    };
    picture.src = svgAddress(chart);
  };

  for (const chart of document.querySelectorAll("svg[data-figure]")) {
    const name = chart.dataset.figure;
    const buttons = document.createElement("p");
    buttons.className = "save";
    for (const [kind, saved] of [["SVG", () => save(name + ".svg", svgAddress(chart))], ["PNG", () => png(chart, name + ".png")]]) {
      const button = document.createElement("button");
      [button.type, button.textContent] = ["button", kind];
      button.setAttribute("aria-label", `Save the chart ${name} as ${kind}`);
      button.addEventListener("click", saved);
      buttons.append(button);
    }
    chart.after(buttons);
  }
})();
