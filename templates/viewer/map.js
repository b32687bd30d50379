// The drive on the map, from above: lines by their purpose, the vehicle at the cursor, and where it failed.
"use strict";

dodo.map = (function () {
  const { test, channel, channels, field, at } = dodo.data;
  const { make, svg } = dodo.dom;
  const { frame, lines, models } = test.scene;
  const [length, width] = [test.scene.length || 0.36, test.scene.width || 0.16];
  const MOST = 2000;
  const driven = read(channel(frame.message, frame.sender) || channels.find((c) => c.message === frame.message));
  const bodies = test.scene.bodies.map((body) => ({ ...body, ...read(channel(frame.message, body.sender)) })).filter((body) => body.poses.length);

  function read(source) {
    const poses = [];
    if (source) {
      const [x, y, qx, qy, qz, qw] = ["x", "y", "qx", "qy", "qz", "qw"].map((name) => (field(source, name) || { values: [] }).values);
      for (let n = 0; n < source.times.length; n++) {
        const heading = Math.atan2(2 * (qw[n] * qz[n] + qx[n] * qy[n]), qw[n] ** 2 + qx[n] ** 2 - qy[n] ** 2 - qz[n] ** 2);
        if (Number.isFinite(x[n] + y[n] + heading)) poses.push({ time: source.times[n], x: x[n], y: y[n], heading });
      }
    }
    return { poses, times: Float32Array.from(poses, (pose) => pose.time) };
  }

  // The pose at a time, between those that were sent.
  function pose({ poses, times }, time) {
    const n = Math.max(at(times, time), 0);
    const [a, b] = [poses[n], poses[Math.min(n + 1, poses.length - 1)]];
    if (a === b || time <= a.time) return a;
    const share = Math.min(1, (time - a.time) / (b.time - a.time));
    const turn = Math.atan2(Math.sin(b.heading - a.heading), Math.cos(b.heading - a.heading));
    return { time, x: a.x + share * (b.x - a.x), y: a.y + share * (b.y - a.y), heading: a.heading + share * turn };
  }

  const placed = ({ x, y, heading }) => `translate(${x} ${y}) rotate(${(heading * 180) / Math.PI})`;
  const closed = (points) => `M${points.map(([x, y]) => `${x} ${y}`).join("L")}Z`;

  function painted(element, property, colour) {
    element.style[property] = `rgb(${colour.map((part) => Math.round(255 * part)).join(" ")})`;
    return element;
  }

  function trace(until) {
    const { poses } = driven;
    const every = Math.ceil(poses.length / MOST);
    const kept = poses.filter((one, n) => one.time <= until && (n % every === 0 || n === poses.length - 1));
    return kept.map(({ x, y }, n) => `${n ? "L" : "M"}${x} ${y}`).join("");
  }

  function vehicle() {
    const [l, w] = [length / 2, width / 2];
    return svg("path", { class: "vehicle", d: `${closed([[l, w], [-l, w], [-l, -w], [l, -w]])}M0 0H${1.5 * l}` });
  }

  // A drawing whose `box(time)` is left, low, width and height in m. `fixed` parts keep their size on the screen.
  function view(parent, label, box) {
    const fixed = [];
    const still = (x, y, ...parts) => {
      const group = svg("g", {}, ...parts);
      fixed.push([group, x, y]);
      return group;
    };
    const name = (text, kind, x, y) => still(x, y, svg("text", { class: kind, x: 8, y: 4 }, text));
    const cones = models.map((model) => [model.colour, model.points.map(([x, y]) => `M${x} ${y}h0`).join("")]);
    const ground = cones.flatMap(([colour, d]) => [svg("path", { class: "cone edge", d }), painted(svg("path", { class: "cone", d }), "stroke", colour)]);
    for (const each of lines) {
      ground.push(svg("path", { class: each.role, d: each.lines.map(([a, b, c, d]) => `M${a} ${b}L${c} ${d}`).join("") }));
      if (["gate", "goal"].includes(each.role) && each.lines.length) ground.push(name(each.name, each.role, each.lines[0][2], each.lines[0][3]));
    }
    const now = svg("path", { class: "driven" });
    const own = vehicle();
    const moving = bodies.map((body) => {
      const shape = painted(svg("path", { class: "body", d: closed(body.outline) }), "fill", body.colour);
      return [body, shape, name(body.name, "other", 0, 0)];
    });
    const parts = [...ground, svg("path", { class: "whole", d: trace(Infinity) }), now, ...moving.flatMap(([, ...each]) => each)];
    if (test.test.outcome !== "passed") {
      const { x, y } = test.moment.x === null ? pose(driven, test.moment.time) : test.moment;
      parts.push(still(x, y, svg("path", { class: "failure", d: "M-10 0a10 10 0 1 0 20 0a10 10 0 1 0 -20 0M-5 -5L5 5M-5 5L5 -5" })));
    }
    const element = svg("svg", { class: "map", role: "img", "aria-label": label }, svg("g", { transform: "scale(1 -1)" }, ...parts, own));
    parent.append(make("div", { class: "view" }, element));

    function show(time) {
      const [left, low, wide, high] = box(time);
      element.setAttribute("viewBox", `${left} ${-low - high} ${wide} ${high}`);
      const metres = Math.max(wide / (element.clientWidth || 1), high / (element.clientHeight || 1));
      now.setAttribute("d", trace(time));
      own.setAttribute("transform", placed(pose(driven, time)));
      for (const [body, shape, text] of moving) {
        const at = pose(body, time);
        shape.setAttribute("transform", placed(at));
        fixed.find(([group]) => group === text).splice(1, 2, at.x, at.y);
      }
      for (const [group, x, y] of fixed) group.setAttribute("transform", `translate(${x} ${y}) scale(${metres} ${-metres})`);
      element.setAttribute("aria-label", `${label} at ${time.toFixed(2)} s`);
    }
    element.addEventListener("click", (event) => {
      const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(element.firstChild.getScreenCTM().inverse());
      const away = (one) => (one.time < 0 ? Infinity : Math.hypot(one.x - x, one.y - y));
      dodo.cursor.move(driven.poses.reduce((a, b) => (away(b) < away(a) ? b : a)).time);
    });
    dodo.cursor.follow(show);
    new ResizeObserver(() => show(dodo.cursor.time())).observe(element);
  }

  // Equal axes around paths and lines; far cones may fall outside.
  function whole() {
    const points = [...driven.poses, ...bodies.flatMap((body) => body.poses)].map(({ x, y }) => [x, y]);
    for (const each of lines) for (const [a, b, c, d] of each.lines) points.push([a, b], [c, d]);
    const [left, low] = [0, 1].map((n) => points.reduce((least, point) => Math.min(least, point[n]), Infinity) - length);
    const [right, high] = [0, 1].map((n) => points.reduce((most, point) => Math.max(most, point[n]), -Infinity) + length);
    return [left, low, right - left, high - low];
  }

  function close(time) {
    const { x, y } = pose(driven, time);
    const size = 4 * Math.max(length, 0.35);
    return [x - size / 2, y - size / 2, size, size];
  }

  function show(parent) {
    if (!driven.poses.length) return;
    const all = whole();
    view(parent, "The drive from above", () => all);
    if (!dodo.camera.isNeeded()) view(parent, "The vehicle from above", close);
    const caption = make("p", { class: "caption" });
    parent.lastChild.append(caption);
    dodo.cursor.follow((time) => {
      const { x, y, heading } = pose(driven, time);
      caption.textContent = `x ${x.toFixed(2)} m, y ${y.toFixed(2)} m, heading ${((heading * 180) / Math.PI).toFixed(0)}°`;
    });
  }

  return { show };
})();
