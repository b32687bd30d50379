"use strict";
// Search and filters of the tests. Without this script the page shows all of them, what did not pass first.
(function () {
  const form = document.getElementById("_filters");
  const count = document.getElementById("_count");
  const list = document.getElementById("_tests");
  const matrices = Array.from(list.querySelectorAll(".matrix"), (element) => ({ element, isOpen: element.open }));
  const tests = Array.from(list.querySelectorAll(".test"), (element) => ({ element, text: null }));

  function text(test) {
    if (test.text === null) test.text = test.element.textContent.toLowerCase();
    return test.text;
  }

  function isWanted(test, words) {
    const wanted = form.elements.outcome.value;
    return (wanted === "all" || test.element.dataset.outcome === wanted) && words.every((word) => text(test).includes(word));
  }

  function filter() {
    const words = form.elements.search.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const test of tests) {
      test.element.hidden = !isWanted(test, words);
      if (!test.element.hidden) shown += 1;
    }
    for (const { element, isOpen } of matrices) {
      element.hidden = !element.querySelector(".test:not([hidden])");
      element.open = shown < tests.length || isOpen;
    }
    const all = tests.length === 1 ? "1 test" : `${tests.length} tests`;
    count.textContent = shown === tests.length ? all : `${shown} of ${all}`;
  }

  // A link to a test shows it, also where filters hide it, with its details.
  function reveal() {
    const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (!target || !target.classList.contains("test")) return;
    if (target.hidden) {
      form.reset();
      filter();
    }
    const matrix = target.closest(".matrix");
    if (matrix) matrix.open = true;
    target.querySelector("details").open = true;
    target.scrollIntoView();
  }

  form.addEventListener("input", filter);
  form.addEventListener("submit", (event) => event.preventDefault());
  window.addEventListener("hashchange", reveal);
  form.hidden = false;
  filter();
  reveal();
})();
