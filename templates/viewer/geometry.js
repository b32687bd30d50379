// Rectangles and lines on the ground, in metres.
"use strict";

dodo.geometry = (function () {
  // The corners of a vehicle about its centre, from the front left counter-clockwise.
  function corners(pose, length, width) {
    const cos = Math.cos(pose.heading);
    const sin = Math.sin(pose.heading);
    return [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([along, across]) => [
      pose.x + (along * cos * length - across * sin * width) / 2,
      pose.y + (along * sin * length + across * cos * width) / 2,
    ]);
  }

  function toSegment(x, y, [x1, y1, x2, y2]) {
    const dx = x2 - x1;
    const dy = y2 - y1;
    const size = dx * dx + dy * dy;
    const share = size ? Math.min(1, Math.max(0, ((x - x1) * dx + (y - y1) * dy) / size)) : 0;
    const [ax, ay] = [x - x1 - share * dx, y - y1 - share * dy];
    return Math.sqrt(ax * ax + ay * ay);
  }

  const side = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);

  function cross(a, b, c, d) {
    return side(a, b, c) * side(a, b, d) <= 0 && side(c, d, a) * side(c, d, b) <= 0;
  }

  // The distance of a line to a convex area; 0 where they touch.
  function distance(ring, line) {
    const [a, b] = [[line[0], line[1]], [line[2], line[3]]];
    const turns = ring.map((corner, n) => side(corner, ring[(n + 1) % ring.length], a));
    if (turns.every((turn) => turn >= 0)) return 0;
    let least = Infinity;
    ring.forEach((corner, n) => {
      const next = ring[(n + 1) % ring.length];
      if (cross(corner, next, a, b)) least = 0;
      const edge = [corner[0], corner[1], next[0], next[1]];
      least = Math.min(least, toSegment(corner[0], corner[1], line), toSegment(a[0], a[1], edge), toSegment(b[0], b[1], edge));
    });
    return least;
  }

  // Lines with the circles around them, by which most are left out.
  function circled(lines) {
    return lines.map((line) => {
      const [x1, y1, x2, y2] = line;
      return { line, x: (x1 + x2) / 2, y: (y1 + y2) / 2, reach: Math.hypot(x2 - x1, y2 - y1) / 2 };
    });
  }

  // The smallest distance of a vehicle to any of the circled lines.
  function margin(pose, length, width, lines) {
    const ring = corners(pose, length, width);
    const reach = Math.hypot(length, width) / 2;
    let least = Infinity;
    for (const each of lines) {
      const [dx, dy, far] = [each.x - pose.x, each.y - pose.y, least + reach + each.reach];
      if (dx * dx + dy * dy < far * far) least = Math.min(least, distance(ring, each.line));
    }
    return least;
  }

  return { corners, circled, margin };
})();
