// What was measured against which limit, and which lines of the spec set it; what failed comes first.
"use strict";

dodo.checks = (function () {
  const { make, svg } = dodo.dom;

  // The line with the parameters that set the limit marked in it.
  function source(line, flags) {
    const parts = flags.length ? line.split(new RegExp(`(?<![\\w-])(${flags.join("|")})(?![\\w-])`)) : [line];
    return make("code", {}, ...parts.map((part) => (flags.includes(part) ? make("mark", {}, part) : part)));
  }

  function places(check) {
    const lines = new Map();
    for (const place of check.places) {
      const key = `${place.file}:${place.line}`;
      lines.set(key, { ...place, flags: [...(lines.get(key)?.flags || []), ...(place.flag ? [place.flag] : [])] });
    }
    return [...lines.values()].map((place) =>
      make(
        "p",
        { class: "place", title: place.file },
        `${place.file.split("/").pop()}:${place.line} `,
        place.text ? source(place.text, place.flags) : null,
        place.flag ? "" : " by default",
      ),
    );
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
    return make("li", { class: state }, make("span", {}, name, ` ${measured}`), check.bar ? bar(check.bar) : "", meaning, ...(check.ok ? [] : places(check)));
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
