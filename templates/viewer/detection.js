// The boxes of each frame by what became of them, as the evaluator recorded it.
"use strict";

dodo.detection = (function () {
  const box = ([label, x, y, width, height, score]) => ({ label, x, y, width, height, score });
  const frames = dodo.data.test.frames.map((frame) => ({
    ...frame,
    hit: frame.hit.map(box),
    false: frame.false.map(box),
    missed: frame.missed.map(box),
  }));
  const times = Float32Array.from(frames, (frame) => frame.time);

  return { frames, times, at: (time) => frames[dodo.data.at(times, time + 1e-3)] || null };
})();
