// Puts the page together, and opens it at the moment that decided, or at the one of its address.
"use strict";

(function () {
  const { test, moment } = dodo.data.test;
  const part = (id) => document.getElementById(id);
  document.title = `${test.name}: ${test.outcome}`;
  part("name").textContent = test.name;
  part("name").title = test.description;
  part("facts").textContent = [test.level, test.kind, `${test.clock} clock`, `${test.backend} backend`, `seed ${test.seed}`].join(" · ");
  part("outcome").textContent = test.outcome;
  part("outcome").className = test.outcome;
  part("reason").textContent = test.reason;
  if (dodo.data.test.duration > 0) dodo.transport.show(part("transport"));
  dodo.camera.show(part("scene"));
  dodo.map.show(part("scene"));
  dodo.signals.show(part("signals"));
  dodo.log.show(part("log"));
  dodo.checks.show(part("checks"));
  dodo.cursor.move(dodo.cursor.linked() ?? moment.time);
})();
