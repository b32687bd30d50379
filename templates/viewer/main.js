// Puts the page together, and opens it at the moment that decided, or at the one of its address.
"use strict";

(function () {
  const { test, moment, channels } = dodo.data.test;
  const part = (id) => document.getElementById(id);
  dodo.header.show(part);
  dodo.camera.show(part("scene"));
  dodo.map.show(part("scene"));
  const isBare = !part("scene").firstChild && channels.every((each) => each.message.startsWith("dodo."));
  document.body.classList.toggle("unrecorded", isBare);
  // A program that ended explains itself in its log.
  const isCrash = test.lastLines.length > 0 && test.outcome !== "passed";
  if (isCrash) part("scene").before(part("log"));
  document.body.classList.toggle("crashed", isCrash);
  dodo.plots.show(part("signals"));
  dodo.log.show(part("log"));
  dodo.checks.show(part("checks"));
  dodo.cursor.move(dodo.cursor.linked() ?? moment.time);
})();
