// The head of the page: what became of the test, its files and commands, and the time line.
"use strict";

dodo.header = (function () {
  const { cursor } = dodo;
  const { choice, make, seconds } = dodo.dom;
  const { test, moment, files, spec } = dodo.data.test;

  function links() {
    const found = files.filter((file) => /^[a-z]+\.rec$/.test(file)).map((file) => make("a", { href: file, download: file }, file));
    if (dodo.data.test.log.lines.length) found.push(make("a", { href: "logs/" }, "logs"));
    if (spec) found.push(make("a", { href: URL.createObjectURL(new Blob([spec], { type: "text/plain;charset=utf-8" })), target: "_blank", title: test.spec }, "spec"));
    const mcap = `dodo rec export ${test.slug}/test.rec --mcap -o ${test.slug}.mcap`;
    return files.includes("test.rec") ? [...found, make("button", { title: mcap, onclick: () => window.prompt("The recording for Foxglove", mcap) }, "MCAP command")] : found;
  }

  // Keys of the whole page; what has the focus and keys of its own keeps them.
  function pressed(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target.closest("input, select")) return;
    const moves = { ArrowLeft: -0.1, ArrowRight: 0.1, Home: -cursor.last, End: cursor.last };
    if (event.key === " " && !event.target.closest("button, summary")) cursor.toggle();
    else if (Object.hasOwn(moves, event.key)) cursor.move(cursor.time() + moves[event.key]);
    else return;
    event.preventDefault();
  }

  function transport(parent) {
    const play = make("button", { "aria-label": "Play", onclick: cursor.toggle }, "▶");
    const slider = make("input", { type: "range", min: 0, max: cursor.last, step: 0.01, "aria-label": "Time of the test in seconds" });
    slider.addEventListener("input", () => cursor.move(Number(slider.value)));
    const mark = make("span", { class: `mark ${test.outcome}`, title: `Decided at ${seconds(moment.time)}: ${moment.what}` });
    mark.style.setProperty("--share", moment.time / cursor.last);
    const speed = choice("Speed", [0.1, 0.25, 0.5, 1, 2, 5].map((each) => [each, `${each}×`]), (value) => cursor.setSpeed(Number(value)));
    speed.value = 1;
    const time = make("output", {});
    const jump = { class: "jump", title: `${seconds(moment.time)}: ${moment.what}`, onclick: () => cursor.move(moment.time) };
    const back = make("button", jump, test.outcome === "passed" ? "Jump to verdict" : "Jump to failure");
    parent.append(play, make("div", { class: "line" }, slider, mark), time, speed, back);
    cursor.follow((now) => {
      slider.value = now;
      slider.setAttribute("aria-valuetext", seconds(now));
      time.textContent = `${now.toFixed(2)} / ${seconds(cursor.last)}`;
    });
    cursor.whenPlaying((isPlaying) => (play.textContent = isPlaying ? "❚❚" : "▶"));
  }

  function show(part) {
    document.title = `${test.name}: ${test.outcome}`;
    part("name").textContent = test.name;
    part("name").title = test.description;
    part("facts").textContent = [test.level, test.kind, `${test.clock} clock`, `${test.backend} backend`, `seed ${test.seed}`].join(" · ");
    part("outcome").textContent = test.outcome;
    part("outcome").className = `badge ${test.outcome}`;
    part("reason").textContent = test.title;
    part("reason").title = test.reason;
    part("files").append(...links());
    if (dodo.data.test.duration > 0) transport(part("transport"));
    document.addEventListener("keydown", pressed);
  }

  return { show };
})();
