// Puts the page together, and opens it at the moment that decided, or at the one of its address.
"use strict";

(function () {
  const { moment } = dodo.data.test;
  const part = (id) => document.getElementById(id);
  dodo.header.show(part);
  if (dodo.data.test.duration > 0) dodo.transport.show(part("transport"));
  dodo.camera.show(part("scene"));
  dodo.map.show(part("scene"));
  const isBare = !part("scene").firstChild && dodo.data.channels.every((each) => each.message.startsWith("dodo."));
  document.body.classList.toggle("unrecorded", isBare);
  dodo.signals.show(part("signals"));
  dodo.log.show(part("log"));
  dodo.checks.show(part("checks"));
  dodo.cursor.move(dodo.cursor.linked() ?? moment.time);
})();
