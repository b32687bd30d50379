// What was measured against which limit, and which lines of the spec set it; what failed comes first.
"use strict";

dodo.checks = (function () {
  const { make, svg } = dodo.dom;

  function place({ file, line, text, isDefault }) {
    const source = text ? make("code", {}, text) : null;
    return make("p", { class: "place", title: file }, `${file.split("/").pop()}:${line} `, source, isDefault ? " by default" : "");
  }

  // From the nearest limit to the value, on the scale of the report's first page: 100 wide, values grow to the right.
  function bar([first, last, left, width, isOk]) {
    const part = (kind, from, wide) => svg("rect", { class: kind, x: `${from}%`, width: wide && `${wide}%` });
    const edges = [first, last].filter((at) => at > 0 && at < 100).map((at) => part("edge", at, null));
    return svg("svg", { class: "bar", "aria-hidden": "true" }, part("room", first, last - first), part(isOk ? "ok" : "no", left, width), ...edges);
  }

  function row(check) {
    const meaning = check.meaning ? make("small", {}, check.meaning) : "";
    if (check.follows) return make("li", {}, make("span", {}, make("b", {}, `– ${check.name}`), ` ${check.value}, when the drive ended`), meaning);
    const state = check.ok ? "passed" : "failed";
    const measured = [check.value, check.limits.join(", ")].filter(Boolean).join(", expected ");
    const name = make("b", {}, `${check.ok ? "✓" : "✗"} ${check.name}`);
    return make("li", { class: state }, make("span", {}, name, ` ${measured}`), check.bar ? bar(check.bar) : "", meaning, ...(check.ok ? [] : check.places.map(place)));
  }

  function show(parent) {
    const all = [...dodo.data.test.checks].sort((a, b) => a.ok - b.ok || a.follows - b.follows || (a.value === "none") - (b.value === "none"));
    parent.append(make("h2", {}, "Checks"));
    if (!all.length) parent.append(make("p", { class: "nothing" }, "No evaluator measured anything."));
    const judged = all.filter((check) => check.limits.length || !check.ok);
    const others = all.filter((check) => !judged.includes(check));
    const notes = dodo.data.test.test.notes.map((note) => make("li", {}, `Note: ${note}`));
    parent.append(make("ul", { tabindex: "0" }, ...judged.map(row), ...notes, ...others.map(row)));
  }

  return { show };
})();
