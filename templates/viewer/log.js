// The log lines of all services by time: errors marked, in step with the cursor, to be searched.
"use strict";

dodo.log = (function () {
  const { choice, make } = dodo.dom;
  const { services, lines, left } = dodo.data.test.log;
  // What a choice hides: lines of the level "info" are those that DoDo's own services say in passing.
  const LEVELS = [["Without DoDo's INFO", ["info"]], ["All lines", []], ["Warnings and errors", ["info", ""]], ["Errors", ["info", "", "warning"]]];
  const shown = { text: "", hidden: ["info"] };
  const times = Float32Array.from(lines.map(([time]) => time).filter((time) => time !== null));
  let rows = [];
  let current = -1;

  function row([time, service, level, text]) {
    const when = make("time", {}, time === null ? "–" : time.toFixed(2));
    const move = () => time !== null && dodo.cursor.move(time);
    return make("p", { class: level, onclick: move }, when, make("b", { title: services[service] }, services[service]), make("span", {}, text));
  }

  function isShown([, service, level, text]) {
    return !shown.hidden.includes(level) && `${services[service]} ${text}`.toLowerCase().includes(shown.text);
  }

  function filter(list) {
    lines.forEach((line, n) => rows[n].classList.toggle("hidden", !isShown(line)));
    follow(list, dodo.cursor.time(), true);
  }

  // The last line that is shown until a time; one without a time is never current.
  function follow(list, time, isFiltered) {
    let n = dodo.data.at(times, time + 0.005);
    while (n >= 0 && rows[n].classList.contains("hidden")) n--;
    if (n === current && !isFiltered) return;
    if (current >= 0) rows[current].classList.remove("now");
    if (n >= 0) rows[n].classList.add("now");
    current = n;
    const place = rows[Math.max(n, 0)];
    list.scrollTop = place ? place.offsetTop - list.offsetTop - list.clientHeight * 0.7 : 0;
  }

  function controls(list) {
    const search = make("input", { type: "search", placeholder: "Search", "aria-label": "Search the log" });
    search.addEventListener("input", () => ((shown.text = search.value.toLowerCase()), filter(list)));
    const count = (hidden) => lines.filter(([, , level]) => !hidden.includes(level)).length;
    const level = choice("Level", LEVELS.map(([name, hidden], n) => [n, `${name} (${count(hidden)})`]), (n) => {
      shown.hidden = LEVELS[n][1];
      filter(list);
    });
    return [search, level];
  }

  function show(parent) {
    const list = make("div", { class: "lines", tabindex: "0" });
    parent.append(make("h2", {}, "Log", ...(lines.length ? controls(list) : [])), list);
    if (!lines.length) list.append(make("p", { class: "nothing" }, "No service wrote a line."));
    rows = lines.map(row);
    list.append(...rows);
    filter(list);
    if (left) list.append(make("p", {}, `${left} lines of the middle are left out; the files in logs/ have all.`));
    dodo.cursor.follow((time) => follow(list, time));
  }

  return { show };
})();
