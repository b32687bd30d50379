// Elements with text. Nothing on the page is ever made from HTML.
"use strict";

dodo.dom = (function () {
  function make(tag, attributes, ...children) {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes || {})) {
      if (name === "class") element.className = value;
      else if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
      else if (value !== false && value != null) element.setAttribute(name, value === true ? "" : value);
    }
    element.append(...children.filter((child) => child != null && child !== ""));
    return element;
  }

  // Four digits at most, as people read them.
  function number(value) {
    if (value === null || value === undefined || Number.isNaN(value)) return "none";
    if (value === 0) return "0";
    const size = Math.abs(value);
    if (size >= 1e5 || size < 1e-4) return value.toExponential(2);
    return String(Number(value.toPrecision(4)));
  }

  const seconds = (value) => `${value.toFixed(2)} s`;
  const withUnit = (value, unit) => (unit && value !== null ? `${number(value)} ${unit}` : number(value));

  return { make, number, seconds, withUnit };
})();
