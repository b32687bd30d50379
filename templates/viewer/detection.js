// Which found box is paired with which true one: boxes of a class that overlap by more than the test's limit, as many
// pairs as can be, and of those the largest sum of overlaps.
"use strict";

dodo.detection = (function () {
  const raw = dodo.data.test.judged.find((each) => each.kind === "detection");
  const box = ([label, x, y, width, height]) => ({ label, x, y, width, height });

  // Intersection over union.
  function overlap(a, b) {
    const wide = Math.min(a.x + a.width, b.x + b.width) - Math.max(a.x, b.x);
    const high = Math.min(a.y + a.height, b.y + b.height) - Math.max(a.y, b.y);
    if (!(wide > 0 && high > 0)) return 0;
    return (wide * high) / (a.width * a.height + b.width * b.height - wide * high);
  }

  // The cheapest column of each row; there are no more rows than columns (Jonker and Volgenant 1987).
  function assigned(costs) {
    const [rows, columns] = [costs.length, costs[0].length];
    const rowPrice = new Float64Array(rows + 1);
    const columnPrice = new Float64Array(columns + 1);
    const rowOf = new Int32Array(columns + 1);
    const before = new Int32Array(columns + 1);
    for (let newcomer = 1; newcomer <= rows; newcomer++) {
      const lengths = new Float64Array(columns + 1).fill(Infinity);
      const settled = new Uint8Array(columns + 1);
      let column = 0;
      rowOf[0] = newcomer;
      do {
        settled[column] = 1;
        const row = rowOf[column];
        let [next, least] = [0, Infinity];
        for (let n = 1; n <= columns; n++) {
          if (settled[n]) continue;
          const length = costs[row - 1][n - 1] - rowPrice[row] - columnPrice[n];
          if (length < lengths[n]) [lengths[n], before[n]] = [length, column];
          if (lengths[n] < least) [next, least] = [n, lengths[n]];
        }
        for (let n = 0; n <= columns; n++) {
          if (settled[n]) {
            rowPrice[rowOf[n]] += least;
            columnPrice[n] -= least;
          } else lengths[n] -= least;
        }
        column = next;
      } while (rowOf[column]);
      while (column) {
        rowOf[column] = rowOf[before[column]];
        column = before[column];
      }
    }
    const found = new Array(rows).fill(-1);
    for (let n = 1; n <= columns; n++) if (rowOf[n]) found[rowOf[n] - 1] = n - 1;
    return found;
  }

  // Pairs [found, true, overlap] by their places in two lists.
  function pairs(found, real, limit) {
    const isTurned = found.length > real.length;
    const [short, long] = isTurned ? [real, found] : [found, real];
    if (!short.length) return [];
    const scores = short.map((a) => long.map((b) => overlap(a, b)));
    const costs = scores.map((row) => row.map((score) => (score > limit ? -score - short.length - 1 : 0)));
    return assigned(costs)
      .map((column, row) => [isTurned ? column : row, isTurned ? row : column, scores[row][column]])
      .filter(([, , score]) => score > limit);
  }

  // The boxes of a frame by what became of them; true ones of a hit are not shown, as the found one is.
  function compare(frame) {
    const counts = (each) => !raw.classes.length || raw.classes.includes(each.label);
    const found = frame.found.map(box).filter(counts);
    const real = (frame.true || []).map(box).filter(counts);
    const result = { time: frame.time, hit: [], false: [], missed: [], isKnown: frame.true !== null };
    for (const label of new Set([...found, ...real].map((each) => each.label))) {
      const [mine, wanted] = [found, real].map((list) => list.filter((each) => each.label === label));
      const matched = result.isKnown ? pairs(mine, wanted, raw.iou ?? 0.5) : [];
      for (const [a, , score] of matched) result.hit.push({ ...mine[a], score });
      result.false.push(...mine.filter((_, n) => !matched.some(([a]) => a === n)));
      result.missed.push(...wanted.filter((_, n) => !matched.some(([, b]) => b === n)));
    }
    return result;
  }

  const frames = raw ? dodo.data.test.frames.map(compare) : [];
  const times = Float32Array.from(frames, (frame) => frame.time);

  return { frames, times, pairs, at: (time) => frames[dodo.data.at(times, time + 1e-3)] || null };
})();
