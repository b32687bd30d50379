// Canvases that are sharp on any display, in the colours of the style.
"use strict";

dodo.canvas = (function () {
  const drawings = [];

  // `draw(context, width, height)` in CSS pixels, again whenever size or colours change.
  function make(parent, label, draw) {
    const element = dodo.dom.make("canvas", { role: "img", "aria-label": label });
    parent.append(element);
    const redraw = () => {
      const { clientWidth: width, clientHeight: height } = element;
      if (!width || !height) return;
      const scale = window.devicePixelRatio || 1;
      element.width = Math.round(width * scale);
      element.height = Math.round(height * scale);
      const context = element.getContext("2d");
      context.scale(scale, scale);
      draw(context, width, height);
    };
    drawings.push(redraw);
    new ResizeObserver(redraw).observe(element);
    return { element, redraw, label: (text) => element.setAttribute("aria-label", text) };
  }

  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    for (const redraw of drawings) redraw();
  });

  // Round steps of an axis: about `count` of them between two numbers.
  function steps(low, high, count) {
    const raw = (high - low) / count;
    const power = 10 ** Math.floor(Math.log10(raw));
    const size = [1, 2, 5, 10].map((each) => each * power).find((each) => each >= raw) || raw;
    const found = [];
    for (let n = Math.ceil(low / size); n * size <= high + size * 1e-6 && found.length < 50; n++) found.push(n * size);
    return found;
  }

  return { make, colour, steps };
})();
