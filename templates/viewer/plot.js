// A signal over time: line, target, limits as a band, samples outside marked; a click moves the cursor.
"use strict";

dodo.plot = (function () {
  const LEFT = 52;
  const RIGHT = 10;
  const TOP = 6;
  const BOTTOM = 16;

  // `signal`: title, unit, times, values, and where it is judged low, high (arrays or null), edge (the same, weaker),
  // target {times, values}, marked(n): "", "warned" or "failed".
  function range(signal) {
    const all = [signal.values, signal.target && signal.target.values].filter(Boolean);
    let [low, high] = [Infinity, -Infinity];
    for (const values of all) {
      for (const value of values) {
        if (value < low) low = value;
        if (value > high) high = value;
      }
    }
    for (const limit of [signal.min, signal.max]) {
      if (limit !== null && limit !== undefined) [low, high] = [Math.min(low, limit), Math.max(high, limit)];
    }
    if (signal.reach && signal.target) [low, high] = [low - signal.reach * 0.2, high + signal.reach * 0.2];
    if (!Number.isFinite(low + high)) return [0, 1];
    const pad = (high - low || Math.abs(high) || 1) * 0.08;
    return [low - pad, high + pad];
  }

  function path(context, times, values, x, y) {
    let isOpen = false;
    context.beginPath();
    for (let n = 0; n < times.length; n++) {
      if (Number.isFinite(values[n])) {
        if (isOpen) context.lineTo(x(times[n]), y(values[n]));
        else context.moveTo(x(times[n]), y(values[n]));
      }
      isOpen = Number.isFinite(values[n]);
    }
  }

  function band(context, target, reach, x, y) {
    context.beginPath();
    target.times.forEach((time, n) => context.lineTo(x(time), y(target.values[n] + reach)));
    for (let n = target.times.length - 1; n >= 0; n--) context.lineTo(x(target.times[n]), y(target.values[n] - reach));
    context.closePath();
    context.fill();
  }

  function axes(context, width, height, low, high, y) {
    context.font = "10.5px system-ui, sans-serif";
    context.fillStyle = dodo.canvas.colour("soft");
    context.strokeStyle = dodo.canvas.colour("grid");
    context.lineWidth = 1;
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const value of dodo.canvas.steps(low, high, 3)) {
      context.beginPath();
      context.moveTo(LEFT, y(value));
      context.lineTo(width - RIGHT, y(value));
      context.stroke();
      context.fillText(dodo.dom.number(value), LEFT - 5, y(value));
    }
    context.textAlign = "center";
    context.textBaseline = "alphabetic";
    const scale = (width - LEFT - RIGHT) / dodo.cursor.last;
    for (const time of dodo.canvas.steps(0, dodo.cursor.last, Math.max(2, width / 90))) {
      context.textAlign = time ? "center" : "left";
      context.fillText(`${dodo.dom.number(time)} s`, Math.min(LEFT + time * scale, width - RIGHT - 6), height - 3);
    }
  }

  function limits(context, signal, width, low, high, y) {
    const bars = [[signal.max, high], [signal.min, low]];
    for (const [limit, end] of bars) {
      if (limit === null || limit === undefined || signal.isPlain) continue;
      context.fillStyle = dodo.canvas.colour("refused");
      context.fillRect(LEFT, Math.min(y(limit), y(end)), width - LEFT - RIGHT, Math.abs(y(limit) - y(end)));
      context.strokeStyle = dodo.canvas.colour("failed");
      context.setLineDash([5, 4]);
      context.beginPath();
      context.moveTo(LEFT, y(limit));
      context.lineTo(width - RIGHT, y(limit));
      context.stroke();
      context.setLineDash([]);
    }
    if (!signal.target) return;
    const x = (time) => LEFT + (time * (width - LEFT - RIGHT)) / dodo.cursor.last;
    for (const [reach, colour] of [[signal.reach, "allowed"], [signal.band, "good"]]) {
      if (!reach) continue;
      context.fillStyle = dodo.canvas.colour(colour);
      band(context, signal.target, reach, x, y);
    }
    context.strokeStyle = dodo.canvas.colour("target");
    context.lineWidth = 1.5;
    context.setLineDash([5, 3]);
    path(context, signal.target.times, signal.target.values, x, y);
    context.stroke();
    context.setLineDash([]);
  }

  function line(context, signal, x, y) {
    context.strokeStyle = dodo.canvas.colour("line");
    context.lineWidth = 1.6;
    path(context, signal.times, signal.values, x, y);
    context.stroke();
    if (!signal.marked) return;
    for (let n = 0; n < signal.times.length; n++) {
      const mark = signal.marked(n);
      if (!mark) continue;
      context.fillStyle = dodo.canvas.colour(mark);
      context.beginPath();
      context.arc(x(signal.times[n]), y(signal.values[n]), 2.8, 0, 7);
      context.fill();
    }
  }

  function draw(context, width, height, signal) {
    const [low, high] = range(signal);
    const x = (time) => LEFT + (time * (width - LEFT - RIGHT)) / dodo.cursor.last;
    const y = (value) => TOP + ((high - value) * (height - TOP - BOTTOM)) / (high - low);
    axes(context, width, height, low, high, y);
    context.save();
    context.beginPath();
    context.rect(LEFT - 2, TOP, width - LEFT - RIGHT + 4, height - TOP - BOTTOM);
    context.clip();
    limits(context, signal, width, low, high, y);
    if (signal.paint) signal.paint(context, x, y);
    else line(context, signal, x, y);
    context.strokeStyle = dodo.canvas.colour("cursor");
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(x(dodo.cursor.time()), TOP);
    context.lineTo(x(dodo.cursor.time()), height);
    context.stroke();
    context.restore();
  }

  function sweep(element) {
    const take = (event) => {
      const width = element.clientWidth - LEFT - RIGHT;
      dodo.cursor.move(((event.offsetX - LEFT) / width) * dodo.cursor.last);
    };
    element.addEventListener("pointerdown", (event) => {
      element.setPointerCapture(event.pointerId);
      take(event);
    });
    element.addEventListener("pointermove", (event) => {
      if (event.buttons) take(event);
    });
  }

  // Adds a plot to `parent`; `remove` is called by its button, if there is one.
  function show(parent, signal, remove) {
    const value = dodo.dom.make("output", {});
    const close = remove && dodo.dom.make("button", { class: "plain", title: "Remove this plot", onclick: () => remove() }, "×");
    const notes = dodo.dom.make("small", {}, signal.note || "");
    const figure = dodo.dom.make("figure", {}, dodo.dom.make("figcaption", {}, dodo.dom.make("b", {}, signal.title), notes, value, close));
    parent.append(figure);
    const canvas = dodo.canvas.make(figure, signal.title, (context, width, height) => draw(context, width, height, signal));
    sweep(canvas.element);
    const follow = (time) => {
      if (!figure.isConnected) return;
      value.textContent = signal.text ? signal.text(time) : text(signal, time);
      canvas.redraw();
    };
    dodo.cursor.follow(follow);
    follow(dodo.cursor.time());
    return figure;
  }

  function text(signal, time) {
    const n = dodo.data.at(signal.times, time + 1e-4);
    return n < 0 ? "–" : dodo.dom.withUnit(signal.values[n], signal.unit);
  }

  return { show };
})();
