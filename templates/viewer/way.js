// Where the vehicle was: its poses over time, and what follows from them.
"use strict";

dodo.way = (function () {
  const { test, channel, field, at } = dodo.data;
  const { frame, length, width } = test.scene;
  const found = channel(frame.message, frame.sender) || dodo.data.channels.find((c) => c.message === frame.message);
  const poses = found ? read(found) : [];
  // Other vehicles of which frames were on the bus.
  const bodies = (test.scene.bodies || []).flatMap((body) => {
    const list = read(channel(frame.message, body.sender) || { times: [], fields: [] });
    const listed = timesOf(list);
    return list.length ? [{ ...body, poses: list, times: listed, pose: (time) => between(list, listed, time) }] : [];
  });
  const before = window.dodoBefore ? read(dodo.data.unpacked(window.dodoBefore)) : [];

  function read(source) {
    const [x, y, qx, qy, qz, qw] = ["x", "y", "qx", "qy", "qz", "qw"].map((name) => (field(source, name) || {}).values);
    const list = [];
    for (let n = 0; n < source.times.length; n++) {
      const heading = Math.atan2(2 * (qw[n] * qz[n] + qx[n] * qy[n]), qw[n] ** 2 + qx[n] ** 2 - qy[n] ** 2 - qz[n] ** 2);
      if (Number.isFinite(x[n] + y[n] + heading)) list.push({ time: source.times[n], x: x[n], y: y[n], heading });
    }
    return list;
  }

  function timesOf(list) {
    return Float32Array.from(list, (pose) => pose.time);
  }

  const [times, timesBefore] = [timesOf(poses), timesOf(before)];
  const pose = (time) => between(poses, times, time);
  const poseBefore = (time) => between(before, timesBefore, time);

  // The pose at a time, between those that were sent.
  function between(list, times, time) {
    const n = Math.max(at(times, time), 0);
    const [a, b] = [list[n], list[Math.min(n + 1, list.length - 1)]];
    if (a === b || time <= a.time) return a;
    const share = Math.min(1, (time - a.time) / (b.time - a.time));
    const turn = Math.atan2(Math.sin(b.heading - a.heading), Math.cos(b.heading - a.heading));
    return { time, x: a.x + share * (b.x - a.x), y: a.y + share * (b.y - a.y), heading: a.heading + share * turn };
  }

  function nearest(x, y) {
    let best = null;
    for (const each of poses) {
      const away = Math.hypot(each.x - x, each.y - y);
      if (each.time >= 0 && (best === null || away < best.away)) best = { away, time: each.time };
    }
    return best && best.time;
  }

  return { poses, times, pose, before, poseBefore, bodies, nearest, length, width };
})();
