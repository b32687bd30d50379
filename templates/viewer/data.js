// What drive.js holds, unpacked: times and values as arrays of numbers, all times in seconds of the test.
"use strict";
var dodo = {};

dodo.data = (function () {
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const unpack = (text) => new Float32Array(bytes(text).buffer);

  // The index of the last time that is not after `time`; -1 before the first.
  function at(times, time) {
    let low = 0;
    let high = times.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (times[middle] <= time) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  }

  function unpacked(raw) {
    const fields = raw.fields.map((field) => ({ name: field.name, values: unpack(field.values) }));
    return { ...raw, times: unpack(raw.times), fields };
  }

  const test = window.dodoTest;
  const channels = test.channels.map(unpacked);

  return {
    test,
    channels,
    unpack,
    bytes,
    unpacked,
    at,
    channel: (message, sender) => channels.find((c) => c.message === message && c.sender === sender),
    field: (found, name) => found && found.fields.find((f) => f.name === name),
    // Messages by the last parts of their names, which distinguish them.
    short: (message) => message.slice(message.lastIndexOf(".") + 1),
  };
})();
