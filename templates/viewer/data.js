// What drive.js holds, unpacked, with all times in seconds of the test; and elements with text, never made from HTML.
"use strict";
var dodo = {};

dodo.data = (function () {
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const unpack = (text) => new Float32Array(bytes(text).buffer);

  // The index of the last time that is not after `time`; -1 before the first.
  function at(times, time) {
    let low = 0;
    let high = times.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (times[middle] <= time) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  }

  const test = window.dodoTest;
  const field = (raw) => ({ ...raw, values: unpack(raw.values) });
  const channels = test.channels.map((raw) => ({ ...raw, times: unpack(raw.times), fields: raw.fields.map(field) }));
  const box = ([label, x, y, width, height, score]) => ({ label, x, y, width, height, score });
  const frames = test.frames.map((frame) => ({ ...frame, hit: frame.hit.map(box), false: frame.false.map(box), missed: frame.missed.map(box) }));
  const frameTimes = Float32Array.from(frames, (frame) => frame.time);

  return {
    test,
    channels,
    unpack,
    bytes,
    at,
    frames,
    frameTimes,
    kinds: { hit: "true positives", missed: "missed", false: "false positives" },
    frameAt: (time) => frames[at(frameTimes, time + 1e-3)] || null,
    channel: (message, sender) => channels.find((c) => c.message === message && c.sender === sender),
    field: (found, name) => found && found.fields.find((f) => f.name === name),
  };
})();

dodo.dom = (function () {
  const SVG = "http://www.w3.org/2000/svg";

  function filled(element, attributes, children) {
    for (const [name, value] of Object.entries(attributes || {})) {
      if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
      else if (value !== false && value != null) element.setAttribute(name, value === true ? "" : value);
    }
    element.append(...children.filter((child) => child != null && child !== ""));
    return element;
  }

  const make = (tag, attributes, ...children) => filled(document.createElement(tag), attributes, children);

  // A select of pairs of value and text; `change` gets the value that is chosen.
  function choice(label, pairs, change) {
    const element = make("select", { "aria-label": label }, ...pairs.map(([value, text]) => make("option", { value }, text)));
    element.addEventListener("change", () => change(element.value));
    return element;
  }

  // Three digits, of whole numbers all of them.
  function number(value) {
    if (value === null || value === undefined || Number.isNaN(value)) return "none";
    const size = Math.abs(value);
    if (size >= 1e7 || (size < 1e-4 && size > 0)) return value.toExponential(2);
    return String(Number.isInteger(value) || size >= 1000 ? Math.round(value) : Number(value.toPrecision(3)));
  }

  return {
    make,
    choice,
    svg: (tag, attributes, ...children) => filled(document.createElementNS(SVG, tag), attributes, children),
    number,
    seconds: (value) => `${value.toFixed(2)} s`,
    withUnit: (value, unit) => (unit && value !== null && !Number.isNaN(value) ? `${number(value)} ${unit}` : number(value)),
    colour: (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim(),
  };
})();
