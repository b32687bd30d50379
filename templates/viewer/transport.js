// The time line: slider, buttons, keys.
"use strict";

dodo.transport = (function () {
  const { cursor } = dodo;
  const { make, seconds } = dodo.dom;
  const { moment, test } = dodo.data.test;
  const STEP = 0.1;
  const LONG = 1;

  function button(text, title, action) {
    return make("button", { title, "aria-label": title, onclick: action }, text);
  }

  function jump() {
    const title = `${seconds(moment.time)}: ${moment.what} (D)`;
    const text = test.outcome === "passed" ? "Jump to verdict" : "Jump to failure";
    return make("button", { class: "jump", title, onclick: () => cursor.move(moment.time) }, text);
  }

  function keys(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target.closest("select, input[type=search], dialog")) return;
    const size = event.shiftKey ? LONG : STEP;
    const actions = {
      ArrowLeft: () => cursor.move(cursor.time() - size),
      ArrowRight: () => cursor.move(cursor.time() + size),
      Home: () => cursor.move(0),
      End: () => cursor.move(cursor.last),
      " ": () => cursor.toggle(),
      d: () => cursor.move(moment.time),
      n: () => dodo.header.step(1),
      p: () => dodo.header.step(-1),
      "?": () => dodo.header.help(),
    };
    if (event.key === " " && event.target.closest("button, summary")) return;
    if (!Object.hasOwn(actions, event.key)) return;
    event.preventDefault();
    actions[event.key]();
  }

  function show(parent) {
    const play = button("▶", "Play (space)", () => cursor.toggle());
    const slider = make("input", { type: "range", min: 0, max: cursor.last, step: 0.01, "aria-label": "Time of the test in seconds" });
    slider.addEventListener("input", () => cursor.move(Number(slider.value)));
    const mark = make("span", { class: `mark ${test.outcome}`, title: `Decided at ${seconds(moment.time)}: ${moment.what}` });
    mark.style.setProperty("--share", moment.time / cursor.last);
    const speed = make("select", { "aria-label": "Speed" }, ...[0.1, 0.25, 0.5, 1, 2, 5].map((each) => make("option", { value: each, selected: each === 1 }, `${each}×`)));
    speed.addEventListener("change", () => cursor.setSpeed(Number(speed.value)));
    const time = make("output", {});
    const line = make("div", { class: "line" }, slider, mark);
    const timeline = make("div", { class: "slider" });
    dodo.film.show(timeline);
    timeline.append(line);
    parent.append(
      play,
      button("‹", "Back 0.1 s (left arrow; with shift 1 s)", () => cursor.move(cursor.time() - STEP)),
      button("›", "On 0.1 s (right arrow; with shift 1 s)", () => cursor.move(cursor.time() + STEP)),
      timeline,
      time,
      speed,
      jump(),
    );
    cursor.follow((now) => {
      slider.value = now;
      slider.setAttribute("aria-valuetext", seconds(now));
      time.textContent = `${now.toFixed(2)} / ${seconds(cursor.last)}`;
    });
    cursor.whenPlaying((isPlaying) => (play.textContent = isPlaying ? "❚❚" : "▶"));
    document.addEventListener("keydown", keys);
  }

  return { show };
})();
