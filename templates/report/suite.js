"use strict";
// Search and filter of the tests. Without this script the page shows all of them, what did not pass first.
(function () {
  const form = document.getElementById("_filters");
  const tests = Array.from(document.querySelectorAll(".test"));
  const opened = new Set(document.querySelectorAll(".matrix[open]"));

  function filter() {
    const [outcome, search] = ["outcome", "search"].map((name) => form.elements[name].value.toLowerCase());
    const words = search.split(/\s+/).filter(Boolean);
    for (const test of tests) {
      const text = words.length ? test.textContent.toLowerCase() : "";
      test.hidden = !(["all", test.dataset.outcome].includes(outcome) && words.every((word) => text.includes(word)));
    }
    const shown = tests.filter((test) => !test.hidden).length;
    for (const matrix of document.querySelectorAll(".matrix")) {
      matrix.hidden = !matrix.querySelector(".test:not([hidden])");
      matrix.open = shown < tests.length || opened.has(matrix);
    }
    document.getElementById("_count").textContent = `${shown} of ${tests.length}`;
  }

  // A link to a test shows it, also where filters hide it, with its details.
  function reveal() {
    const target = tests.find((test) => `#${test.id}` === location.hash);
    if (!target) return;
    if (target.hidden) form.reset(), filter();
    for (const closed of [target.closest(".matrix"), target.querySelector("details")]) if (closed) closed.open = true;
    target.scrollIntoView();
  }

  form.addEventListener("input", filter);
  form.addEventListener("submit", (event) => event.preventDefault());
  window.addEventListener("hashchange", reveal);
  form.hidden = false;
  filter();
  reveal();
})();
