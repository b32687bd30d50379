"use strict";
// Search, filters and sorting of the table of tests. Without this script the page shows all of them in their order.
(function () {
  const form = document.getElementById("_filters");
  const table = document.getElementById("_tests");
  const count = document.getElementById("_count");
  const body = table.tBodies[0];
  const tests = Array.from(body.rows, (row) => ({ row, section: document.getElementById(row.dataset.test), text: null }));

  function text(test) {
    if (test.text === null) test.text = (test.row.textContent + " " + (test.section ? test.section.textContent : "")).toLowerCase();
    return test.text;
  }

  function isWanted(test, words) {
    for (const name of ["outcome", "level", "change"]) {
      const wanted = form.elements[name] ? form.elements[name].value : "";
      if (wanted && !wanted.split(",").includes(test.row.dataset[name])) return false;
    }
    return words.every((word) => text(test).includes(word));
  }

  function filter() {
    const words = form.elements.search.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const test of tests) {
      const isShown = isWanted(test, words);
      test.row.hidden = !isShown;
      if (test.section) test.section.hidden = !isShown;
      if (isShown) shown += 1;
    }
    const all = tests.length === 1 ? "1 test" : `${tests.length} tests`;
    count.textContent = shown === tests.length ? all : `${shown} of ${all}`;
  }

  function key(row, column) {
    const cell = row.cells[column];
    return cell.dataset.value === undefined ? cell.textContent.trim() : cell.dataset.value;
  }

  function compare(a, b, isNumber) {
    if (!isNumber) return a.localeCompare(b, "en", { numeric: true });
    if (a === "" || b === "") return (a === "") - (b === "");
    return Number(a) - Number(b);
  }

  function sort(header, column) {
    const isDown = header.getAttribute("aria-sort") === "ascending";
    const isNumber = header.dataset.sort === "number";
    for (const other of header.parentNode.cells) other.removeAttribute("aria-sort");
    header.setAttribute("aria-sort", isDown ? "descending" : "ascending");
    const rows = tests.map(({ row }) => ({ row, key: key(row, column) }));
    rows.sort((a, b) => {
      const order = compare(a.key, b.key, isNumber);
      return isDown && a.key !== "" && b.key !== "" ? -order : order;
    });
    body.append(...rows.map(({ row }) => row));
  }

  // A link to a test that the filters hide shows it.
  function reveal() {
    const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (target && target.hidden) {
      form.reset();
      filter();
      target.scrollIntoView();
    }
  }

  Array.from(table.tHead.rows[0].cells).forEach((header, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...header.childNodes);
    header.append(button);
    button.addEventListener("click", () => sort(header, column));
  });
  form.addEventListener("input", filter);
  form.addEventListener("reset", () => setTimeout(filter));
  form.addEventListener("submit", (event) => event.preventDefault());
  window.addEventListener("hashchange", reveal);
  form.hidden = false;
  filter();
  reveal();
})();
