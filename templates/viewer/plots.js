// Signals over one time axis, by uPlot: what is judged with its limits and target, and others of the bus to choose from.
// The wheel zooms about the pointer, a drag to a part, shift and a drag pan, a double click shows all; a click moves the cursor.
"use strict";

dodo.plots = (function () {
  const { data, cursor } = dodo;
  const { make, number, withUnit, colour } = dodo.dom;
  const [AXIS, RIGHT, LEAST] = [56, 12, 0.02];
  const MARKS = ["", "warned", "failed"];
  const charts = new Set();
  let range = [0, cursor.last];

  // What an evaluator recorded: which samples failed, it says.
  function recorded(raw) {
    const target = raw.target.times ? { times: data.unpack(raw.target.times), values: data.unpack(raw.target.values) } : null;
    const marks = data.bytes(raw.marks);
    return {
      title: raw.name, unit: raw.unit, note: raw.note, times: data.unpack(raw.times), values: data.unpack(raw.values), target,
      min: raw.low, max: raw.high, reaches: [[raw.distance, "allowed"], [raw.band, "good"]].filter(([reach]) => reach), mark: (n) => MARKS[marks[n]],
    };
  }

  function plain(channel, field) {
    const note = channel.every > 1 ? `one of ${channel.every} samples` : "";
    return { title: field.title, unit: field.unit, times: channel.times, values: field.values, note };
  }

  // How many boxes of each frame became what.
  const counted = ([kind, name]) => ({ title: `${name} in each frame`, unit: "", times: data.frameTimes, values: data.frames.map((frame) => frame[kind].length), min: 0, isPlain: true });

  const others = () => data.channels.filter((channel) => !channel.message.startsWith("dodo."));
  // Of a message with several fields those that are not 0 all the time: the others can be added.
  const used = (fields) => (fields.length > 1 && fields.some((one) => one.values.some(Boolean)) ? fields.filter((one) => one.values.some(Boolean)) : fields);

  function judged() {
    const isOf = (channel, { message, sender }) => channel.message === message && (sender === null || channel.sender === sender);
    const channels = data.test.messages.flatMap((each) => data.channels.filter((channel) => isOf(channel, each)));
    const fields = channels.flatMap((channel) => used(channel.fields).map((field) => plain(channel, field)));
    return [...data.test.judged.map(recorded), ...fields, ...(data.frames.length ? Object.entries(data.kinds).map(counted) : [])];
  }

  function heights(signal) {
    const near = (signal.reaches || []).concat([[0]]).reduce((most, [reach]) => Math.max(most, reach), 0);
    let [low, high] = [signal.min ?? Infinity, signal.max ?? -Infinity];
    for (const values of [signal.values, ...(signal.target ? [signal.target.values] : [])]) {
      for (const value of values) if (Number.isFinite(value)) [low, high] = [Math.min(low, value), Math.max(high, value)];
    }
    if (!Number.isFinite(low + high)) return [0, 1];
    const pad = Math.max(high - low, 0.2 * (Math.max(-low, high) || 1)) * 0.08 + near * 0.2;
    return [signal.isPlain && low === signal.min ? low : Math.min(low, signal.max ?? low) - pad, Math.max(high, signal.min ?? high) + pad];
  }

  // Limits as shaded areas, and the target with what may lie around it.
  function behind(u, signal) {
    const { ctx, bbox } = u;
    const [x, y] = [(time) => u.valToPos(time, "x", true), (value) => u.valToPos(value, "y", true)];
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    for (const [limit, end] of [[signal.max, bbox.top], [signal.min, bbox.top + bbox.height]]) {
      if (limit === null || limit === undefined || signal.isPlain) continue;
      ctx.fillStyle = colour("refused");
      ctx.fillRect(bbox.left, Math.min(y(limit), end), bbox.width, Math.abs(y(limit) - end));
      ctx.fillStyle = colour("failed");
      ctx.fillRect(bbox.left, y(limit) - 0.5, bbox.width, devicePixelRatio);
    }
    const { times, values } = signal.target || { times: [], values: [] };
    for (const [reach, name] of signal.reaches || []) {
      ctx.fillStyle = colour(name);
      ctx.beginPath();
      times.forEach((time, n) => ctx.lineTo(x(time), y(values[n] + reach)));
      for (let n = times.length - 1; n >= 0; n--) ctx.lineTo(x(times[n]), y(values[n] - reach));
      ctx.fill();
    }
    ctx.strokeStyle = colour("target");
    ctx.lineWidth = 1.5 * devicePixelRatio;
    ctx.setLineDash([5 * devicePixelRatio, 3 * devicePixelRatio]);
    ctx.beginPath();
    times.forEach((time, n) => ctx.lineTo(x(time), y(values[n])));
    ctx.stroke();
    ctx.restore();
  }

  function marks(u, signal) {
    for (let n = 0; signal.mark && n < signal.times.length; n++) {
      if (!signal.mark(n) || signal.times[n] < range[0] || signal.times[n] > range[1]) continue;
      u.ctx.fillStyle = colour(signal.mark(n));
      u.ctx.beginPath();
      u.ctx.arc(u.valToPos(signal.times[n], "x", true), u.valToPos(signal.values[n], "y", true), 2.6 * devicePixelRatio, 0, 7);
      u.ctx.fill();
    }
  }

  function zoom(first, last) {
    const wide = Math.min(Math.max(last - first, LEAST), cursor.last);
    const from = Math.min(Math.max(first, 0), cursor.last - wide);
    range = [from, from + wide];
    for (const { u, now } of charts) {
      u.setScale("x", { min: range[0], max: range[1] });
      place(u, now);
    }
  }

  function place(u, now) {
    const at = u.valToPos(cursor.time(), "x");
    now.hidden = at < 0 || at > u.over.clientWidth;
    now.style.transform = `translateX(${at}px)`;
  }

  function pan(u, event) {
    const [[first, last], from, scale] = [range, event.clientX, (range[1] - range[0]) / u.over.clientWidth];
    const move = (now) => zoom(first - (now.clientX - from) * scale, last - (now.clientX - from) * scale);
    document.addEventListener("mousemove", move);
    document.addEventListener("mouseup", () => document.removeEventListener("mousemove", move), { once: true });
  }

  function wheel(u, event) {
    event.preventDefault();
    const [at, factor] = [u.posToVal(event.offsetX, "x"), Math.exp(event.deltaY / 500)];
    zoom(at - (at - range[0]) * factor, at + (range[1] - at) * factor);
  }

  // A chart in an element that fills it; `read` takes the time under the pointer, null where there is none.
  function chart(element, signal, read) {
    const look = { stroke: () => colour("soft"), grid: { stroke: () => colour("grid"), width: 1 }, ticks: { show: false }, font: "11px system-ui, sans-serif" };
    const line = { stroke: () => colour("line"), width: 1.6, points: { show: false } };
    const gaps = (values) => Array.from(values, (value) => (Number.isFinite(value) ? value : null));
    const [low, high] = heights(signal);
    const u = new uPlot(
      {
        width: element.clientWidth || 300,
        height: element.clientHeight || 80,
        padding: signal.isAxis ? [0, RIGHT, 0, 0] : [6, RIGHT, 6, 0],
        legend: { show: false },
        cursor: {
          y: false,
          sync: { key: "time", setSeries: false },
          drag: { x: true, y: false, dist: 4, setScale: false },
          points: { show: !signal.isAxis },
          bind: {
            mousedown: (self, _, begin) => (event) => (event.shiftKey ? pan(self, event) : begin(event)),
            dblclick: () => () => zoom(0, cursor.last),
          },
        },
        scales: { x: { time: false, auto: false, range: () => range }, y: { auto: false, range: () => [low, high] } },
        axes: [
          { ...look, size: signal.isAxis ? 24 : 0, values: signal.isAxis ? (_, ticks) => ticks.map((each) => `${number(each)} s`) : () => [], space: 70 },
          {
            ...look,
            size: AXIS,
            space: 26,
            values: (_, ticks) => (signal.isAxis ? [] : ticks.map(number)),
            grid: { ...look.grid, show: !signal.isAxis },
          },
        ],
        series: [{}, line],
        hooks: {
          drawClear: [(self) => behind(self, signal)],
          draw: [(self) => marks(self, signal)],
          setCursor: [(self) => read(self.cursor.left >= 0 ? self.posToVal(self.cursor.left, "x") : null)],
          setSelect: [(self) => self.select.width > 4 && select(self)],
        },
      },
      [signal.times, gaps(signal.values)],
      element,
    );
    const now = make("div", { class: "now-line" });
    u.over.append(now);
    u.over.addEventListener("click", (event) => cursor.move(u.posToVal(event.clientX - u.over.getBoundingClientRect().left, "x")));
    u.over.addEventListener("wheel", (event) => wheel(u, event), { passive: false });
    const one = { u, now };
    charts.add(one);
    new ResizeObserver(() => element.clientWidth && (u.setSize({ width: element.clientWidth, height: element.clientHeight }), place(u, now))).observe(element);
    return one;
  }

  function select(u) {
    const [first, last] = [u.select.left, u.select.left + u.select.width].map((at) => u.posToVal(at, "x"));
    u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
    zoom(first, last);
  }

  function interpolated({ times, values }, time) {
    const n = data.at(times, time);
    if (n < 0 || n + 1 >= times.length) return n >= 0 && time <= times[n] + 1e-3 ? values[n] : NaN;
    return values[n] + ((time - times[n]) / (times[n + 1] - times[n] || 1)) * (values[n + 1] - values[n]);
  }

  function text(signal, time) {
    const n = data.at(signal.times, time + 1e-4);
    const value = n < 0 ? "–" : withUnit(signal.values[n], signal.unit);
    return signal.target ? `${value} · target ${withUnit(interpolated(signal.target, time), signal.unit)}` : value;
  }

  function add(parent, signal) {
    const value = make("output", {});
    const plot = make("div", { class: "plot", role: "img", "aria-label": signal.title });
    const figure = make("figure", {}, make("figcaption", {}, make("b", {}, signal.title), make("small", {}, signal.note || ""), value), plot);
    parent.append(figure);
    const read = (time) => (value.textContent = text(signal, time ?? cursor.time()));
    const one = chart(plot, signal, read);
    one.read = read;
    read(null);
    place(one.u, one.now);
    return figure;
  }

  function chooser(parent) {
    const select = make("select", { "aria-label": "Add a signal" }, make("option", { value: "" }, "Add a signal…"));
    const choices = [];
    const group = (label, entries) => {
      const options = entries.map(([name, choice]) => make("option", { value: choices.push(choice) - 1 }, name));
      if (options.length) select.append(make("optgroup", { label }, ...options));
    };
    for (const channel of others()) group(`${channel.message}/${channel.sender}`, channel.fields.map((field) => [field.name, () => plain(channel, field)]));
    select.addEventListener("change", () => {
      if (select.value !== "") add(parent, choices[Number(select.value)]()).scrollIntoView({ block: "nearest" });
      select.value = "";
    });
    return choices.length ? select : "";
  }

  function show(parent) {
    const list = judged();
    const plots = make("div", { class: "plots", tabindex: "0" });
    const axis = make("div", { class: "axis", role: "img", "aria-label": "Time of the test in seconds" });
    const pointed = make("output", { title: "Time under the pointer" });
    const keys = "Wheel: zoom. Drag: zoom to a part. Shift and drag: pan. Double click: all";
    const whole = make("button", { title: keys, onclick: () => zoom(0, cursor.last) }, "Whole test");
    parent.append(make("h2", {}, "Signals", chooser(plots), whole, pointed), plots, axis);
    if (data.test.why) plots.append(make("p", { class: "nothing" }, data.test.why));
    if (!list.length && !data.test.why) plots.append(make("p", { class: "nothing" }, "No signal that is judged was recorded."));
    for (const signal of list) add(plots, signal);
    const line = { isAxis: true, isPlain: true, times: [0, cursor.last], values: [null, null] };
    chart(axis, line, (time) => (pointed.textContent = time === null ? "" : `pointer at ${time.toFixed(2)} s`)).read = () => {};
    cursor.follow((time) => {
      if (time < range[0] || time > range[1]) zoom(time - (range[1] - range[0]) / 2, time + (range[1] - range[0]) / 2);
      for (const { u, now, read } of charts) {
        place(u, now);
        if (!(u.cursor.left >= 0)) read(null);
      }
    });
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => charts.forEach(({ u }) => u.redraw()));
  }

  return { show, judged, zoom, range: () => range };
})();
