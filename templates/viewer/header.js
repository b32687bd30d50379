// The head of the page: what became of the test, steps to other failed ones, its command, and the keys.
"use strict";

dodo.header = (function () {
  const { make } = dodo.dom;
  const { test } = dodo.data.test;
  const SLUG = /^[a-z0-9-]+$/;
  const failed = (window.dodoFailed || []).filter(([slug]) => SLUG.test(slug));
  const KEYS = [
    ["space", "play, pause"], ["← →", "0.1 s back or on, with shift 1 s"], ["Home End", "begin, end"],
    ["D", "the moment that decided"], ["N P", "next, previous failed test"], ["?", "these keys"],
  ];
  const keys = dialog();

  // The failed test so many steps on in the report; null where there is none.
  function other(steps) {
    const own = failed.findIndex(([slug]) => slug === test.slug);
    const at = own < 0 ? (steps > 0 ? 0 : -1) : own + steps;
    return failed[at] || null;
  }

  function link(steps, text) {
    const found = other(steps);
    return found ? make("a", { href: `../${found[0]}/drive.html`, title: `${found[1]}: ${found[2]}` }, text) : "";
  }

  function step(steps) {
    const found = other(steps);
    if (found) location.href = `../${found[0]}/drive.html`;
  }

  // What repeats the test; repetitions and copies of it have the same name but for their number.
  function command() {
    const name = test.name.replace(/(\[(run|report)=\d+\])+$/, "");
    const word = /^[\w.\/-]+$/.test(name) ? name : `'${name.replaceAll("'", "'\\''")}'`;
    return `dodo run ${word}${test.seed ? ` --seed ${test.seed}` : ""}`;
  }

  function copier() {
    const button = make("button", { title: command() }, "Copy command");
    const said = (text) => {
      button.textContent = text;
      setTimeout(() => (button.textContent = "Copy command"), 1500);
    };
    button.addEventListener("click", () => copy(command()).then(() => said("Copied"), () => window.prompt("The command", command())));
    return button;
  }

  async function copy(text) {
    await navigator.clipboard.writeText(text);
  }

  function dialog() {
    const rows = KEYS.flatMap(([key, what]) => [make("dt", {}, ...key.split(" ").map((each) => make("kbd", {}, each))), make("dd", {}, what)]);
    const close = make("button", { onclick: () => keys.close() }, "Close");
    return make("dialog", { "aria-label": "Keys" }, make("h2", {}, "Keys"), make("dl", {}, ...rows), close);
  }

  function show(part) {
    document.title = `${test.name}: ${test.outcome}`;
    part("name").textContent = test.name;
    part("name").title = test.description;
    part("facts").textContent = [test.level, test.kind, `${test.clock} clock`, `${test.backend} backend`, `seed ${test.seed}`].join(" · ");
    part("outcome").textContent = test.outcome;
    part("outcome").className = `badge ${test.outcome}`;
    part("reason").textContent = test.reason;
    const help = make("button", { title: "Keys (?)", "aria-label": "Keys", onclick: () => keys.showModal() }, "?");
    part("actions").append(link(-1, "‹ Previous failed"), link(1, "Next failed ›"), copier(), help);
    document.body.append(keys);
  }

  return { show, step, command, help: () => keys.showModal() };
})();
