// The way on the map: lines by their purpose, the vehicle at the cursor, and where it failed.
"use strict";

dodo.map = (function () {
  const { test } = dodo.data;
  const way = dodo.way;
  const PAD = 14;
  const CLOSE = 1.4;
  const FONT = "11px system-ui, sans-serif";
  let view = null;
  let labels = [];

  function around(x, y, scale, width, height) {
    return {
      scale,
      to: (px, py) => [width / 2 + (px - x) * scale, height / 2 - (py - y) * scale],
      from: (sx, sy) => [x + (sx - width / 2) / scale, y - (sy - height / 2) / scale],
    };
  }

  // Equal axes around way and lines; far cones may fall outside.
  function fit(width, height) {
    const points = [...way.poses, ...way.before, ...way.bodies.flatMap((body) => body.poses)].map((pose) => [pose.x, pose.y]);
    for (const each of test.scene.lines) for (const [a, b, c, d] of each.lines) points.push([a, b], [c, d]);
    const [xs, ys] = [0, 1].map((n) => points.map((point) => point[n]));
    const [left, right, low, high] = [Math.min, Math.max].flatMap((f) => [xs, ys].map((all) => all.reduce((a, b) => f(a, b))))
      .reduce((box, value, n) => ((box[[0, 2, 1, 3][n]] = value), box), []);
    const reach = Math.max(way.length, 0.2);
    const scale = Math.min((width - 2 * PAD) / (right - left + reach), (height - 2 * PAD) / (high - low + reach));
    return around((left + right) / 2, (low + high) / 2, scale, width, height);
  }

  // Some lengths of the vehicle around it.
  function close(width, height) {
    const pose = way.pose(dodo.cursor.time());
    return around(pose.x, pose.y, Math.min(width, height) / (CLOSE * Math.max(3 * way.length, 1)), width, height);
  }

  function trace(context, points) {
    context.beginPath();
    points.forEach(([x, y], n) => (n ? context.lineTo(x, y) : context.moveTo(x, y)));
  }

  function ground(context) {
    for (const model of test.scene.models) {
      context.fillStyle = `rgb(${model.colour.map((part) => Math.round(255 * part)).join(" ")})`;
      context.strokeStyle = dodo.canvas.colour("soft");
      for (const [x, y] of model.points) {
        context.beginPath();
        context.arc(...view.to(x, y), 2.6, 0, 7);
        context.fill();
        context.stroke();
      }
    }
    const styles = { wall: ["wall", 2, []], gate: ["gate", 2, [6, 4]], goal: ["goal", 3, []], other: ["soft", 1, [2, 3]] };
    for (const each of test.scene.lines) {
      const [colour, thick, dash] = styles[each.role];
      context.strokeStyle = dodo.canvas.colour(colour);
      context.lineWidth = thick;
      context.setLineDash(dash);
      for (const [a, b, c, d] of each.lines) {
        trace(context, [view.to(a, b), view.to(c, d)]);
        context.stroke();
      }
      context.setLineDash([]);
      if (each.role !== "other" && each.role !== "wall" && each.lines.length) name(each);
    }
  }

  // The name of a line stands beyond one of its ends, or beside its middle.
  function name(each) {
    const [a, b, c, d] = each.lines[0];
    const [[x1, y1], [x2, y2]] = [view.to(a, b), view.to(c, d)];
    const size = Math.hypot(x2 - x1, y2 - y1) || 1;
    const [dx, dy] = [(x2 - x1) / size, (y2 - y1) / size];
    const middle = [(x1 + x2) / 2, (y1 + y2) / 2];
    const places = [[x1 - 9 * dx, y1 - 9 * dy, -dx, -dy], [x2 + 9 * dx, y2 + 9 * dy, dx, dy], [middle[0] + 6, middle[1], 1, 0], [middle[0] - 6, middle[1], -1, 0]];
    labels.push({ text: each.name, colour: each.role, places });
  }

  // Each label where it hides neither vehicle nor another one, and else nowhere: what it names is still drawn.
  function write(context, width, height, taken) {
    context.font = FONT;
    context.textAlign = "center";
    context.textBaseline = "middle";
    for (const { text, colour, places } of labels) {
      const wide = context.measureText(text).width + 4;
      const boxes = places.map(([x, y, dx, dy]) => ({ x: x + (dx * wide) / 2, y: y + dy * 7, wide, high: 14 }));
      const isFree = (box) => taken.every((other) => Math.abs(box.x - other.x) > (box.wide + other.wide) / 2 || Math.abs(box.y - other.y) > (box.high + other.high) / 2);
      const isInside = (box) => box.x > wide / 2 && box.x < width - wide / 2 && box.y > 7 && box.y < height - 7;
      const box = boxes.find((each) => isInside(each) && isFree(each));
      if (!box) continue;
      taken.push(box);
      context.lineWidth = 3;
      context.strokeStyle = dodo.canvas.colour("paper");
      context.strokeText(text, box.x, box.y);
      context.fillStyle = dodo.canvas.colour(colour);
      context.fillText(text, box.x, box.y);
    }
    context.textBaseline = "alphabetic";
  }

  // What no label may hide: the vehicle, the place of failure, and the scale.
  function occupied(time, height) {
    const [x, y] = view.to(way.pose(time).x, way.pose(time).y);
    const size = Math.max((way.length || 0.36) * 1.6 * view.scale, 16);
    const found = [{ x, y, wide: size, high: size }, { x: 55, y: height - 14, wide: 110, high: 28 }];
    if (test.test.outcome !== "passed") {
      const at = failed();
      found.push({ x: at[0], y: at[1], wide: 24, high: 24 });
    }
    return found;
  }

  function driven(context, poses, colour, thick) {
    context.strokeStyle = dodo.canvas.colour(colour);
    context.lineWidth = thick;
    trace(context, poses.map((pose) => view.to(pose.x, pose.y)));
    context.stroke();
  }

  // What the same test did in the report that this one is compared with.
  function earlier(context, time) {
    if (!way.before.length) return;
    context.setLineDash([5, 4]);
    driven(context, way.before, "before", 2);
    context.setLineDash([]);
    vehicle(context, way.poseBefore(time), "before");
  }

  // The corners of a vehicle about its centre, from the front left counter-clockwise.
  function corners(pose, length, width) {
    const cos = Math.cos(pose.heading);
    const sin = Math.sin(pose.heading);
    return [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([along, across]) => [
      pose.x + (along * cos * length - across * sin * width) / 2,
      pose.y + (along * sin * length + across * cos * width) / 2,
    ]);
  }

  function vehicle(context, pose, colour) {
    const ring = corners(pose, way.length || 0.36, way.width || 0.16);
    trace(context, ring.map(([x, y]) => view.to(x, y)));
    context.closePath();
    context.fillStyle = dodo.canvas.colour(colour);
    context.globalAlpha = 0.35;
    context.fill();
    context.globalAlpha = 1;
    context.strokeStyle = context.fillStyle;
    context.lineWidth = 1.6;
    context.stroke();
    const ahead = 0.75 * (way.length || 0.36);
    const tip = view.to(pose.x + ahead * Math.cos(pose.heading), pose.y + ahead * Math.sin(pose.heading));
    trace(context, [view.to(pose.x, pose.y), tip]);
    context.stroke();
    context.beginPath();
    context.arc(...tip, 3, 0, 7);
    context.fill();
  }

  // Other vehicles, by the outlines of their models: where they have been, and are.
  function others(context, time) {
    for (const body of way.bodies) {
      const colour = `rgb(${body.colour.map((part) => Math.round(255 * part)).join(" ")})`;
      driven(context, body.poses.slice(0, dodo.data.at(body.times, time) + 1), "soft", 1.2);
      if (time < body.times[0]) continue;
      const pose = body.pose(time);
      const [cos, sin] = [Math.cos(pose.heading), Math.sin(pose.heading)];
      trace(context, body.outline.map(([x, y]) => view.to(pose.x + cos * x - sin * y, pose.y + sin * x + cos * y)));
      context.closePath();
      context.fillStyle = colour;
      context.fill();
      context.strokeStyle = context.fillStyle = dodo.canvas.colour("ink");
      context.lineWidth = 1.2;
      context.stroke();
      const [front, reach] = [Math.max(...body.outline.map(([x]) => x)), Math.max(...body.outline.map(([x, y]) => Math.hypot(x, y)))];
      trace(context, [view.to(pose.x, pose.y), view.to(pose.x + front * cos, pose.y + front * sin)]);
      context.stroke();
      const [x, y] = view.to(pose.x, pose.y);
      const beside = reach * view.scale + 4;
      labels.push({ text: body.name, colour: "ink", places: [[x + beside, y, 1, 0], [x - beside, y, -1, 0], [x, y - beside, 0, -1], [x, y + beside, 0, 1]] });
    }
  }

  // Where the test failed: a ring and a cross that print well, too.
  function failed() {
    const { time, x, y } = test.moment;
    const place = x === null ? way.pose(time) : { x, y };
    return view.to(place.x, place.y);
  }

  function failure(context) {
    const [sx, sy] = failed();
    context.strokeStyle = dodo.canvas.colour("failed");
    context.lineWidth = 2;
    context.beginPath();
    context.arc(sx, sy, 10, 0, 7);
    context.stroke();
    trace(context, [[sx - 5, sy - 5], [sx + 5, sy + 5]]);
    context.stroke();
    trace(context, [[sx + 5, sy - 5], [sx - 5, sy + 5]]);
    context.stroke();
  }

  function scaleBar(context, height) {
    const power = 10 ** Math.floor(Math.log10(90 / view.scale));
    const size = [5, 2, 1].map((each) => each * power).find((each) => each * view.scale <= 90);
    context.strokeStyle = context.fillStyle = dodo.canvas.colour("soft");
    context.lineWidth = 2;
    trace(context, [[10, height - 8], [10 + size * view.scale, height - 8]]);
    context.stroke();
    context.font = "11px system-ui, sans-serif";
    context.textAlign = "left";
    context.fillText(`${dodo.dom.number(size)} m`, 10, height - 13);
  }

  function draw(context, width, height, look) {
    const time = dodo.cursor.time();
    view = look(width, height);
    labels = [];
    ground(context);
    earlier(context, time);
    driven(context, way.poses, "faint", 2);
    driven(context, way.poses.slice(0, dodo.data.at(way.times, time) + 1), "way", 2.5);
    others(context, time);
    if (test.test.outcome !== "passed") failure(context);
    vehicle(context, way.pose(time), "vehicle");
    scaleBar(context, height);
    write(context, width, height, occupied(time, height));
  }

  function apart(time) {
    const [a, b] = [way.pose(time), way.poseBefore(time)];
    return `; dashed: before (${window.dodoBefore.outcome}), ${Math.hypot(a.x - b.x, a.y - b.y).toFixed(2)} m apart`;
  }

  function label(time) {
    const pose = way.pose(time);
    const rest = way.before.length ? apart(time) : "";
    return `x ${pose.x.toFixed(2)} m, y ${pose.y.toFixed(2)} m, heading ${((pose.heading * 180) / Math.PI).toFixed(0)}°${rest}`;
  }

  function add(parent, name, look) {
    const canvas = dodo.canvas.make(parent, name, (context, width, height) => draw(context, width, height, look));
    canvas.element.addEventListener("click", (event) => {
      const { clientWidth: width, clientHeight: height } = canvas.element;
      const time = way.nearest(...look(width, height).from(event.offsetX, event.offsetY));
      if (time !== null) dodo.cursor.move(time);
    });
    return canvas;
  }

  function show(parent) {
    if (!way.poses.length) return;
    const whole = dodo.dom.make("div", { class: "view" });
    parent.append(whole);
    const canvases = [add(whole, "The way from above", fit)];
    if (!dodo.camera.isNeeded()) {
      const near = dodo.dom.make("div", { class: "view" });
      parent.append(near);
      canvases.push(add(near, "The vehicle from above", close));
    }
    const caption = dodo.dom.make("p", { class: "caption" });
    parent.lastChild.append(caption);
    dodo.cursor.follow((time) => {
      for (const canvas of canvases) canvas.redraw();
      caption.textContent = label(time);
      canvases[0].label(`The way from above: at ${time.toFixed(2)} s ${caption.textContent}`);
    });
  }

  return { show };
})();
