// Which signals are plotted: those that are judged, and others of the bus to choose from.
"use strict";

dodo.signals = (function () {
  const { data } = dodo;
  const { make } = dodo.dom;

  // The target at a time by straight lines; NaN outside.
  function interpolated(target, time) {
    const n = data.at(target.times, time);
    const next = Math.min(n + 1, target.times.length - 1);
    if (n < 0 || (n === next && time > target.times[n] + 1e-3)) return NaN;
    const span = target.times[next] - target.times[n];
    const share = span ? (time - target.times[n]) / span : 0;
    return target.values[n] + share * (target.values[next] - target.values[n]);
  }

  const MARKS = ["", "warned", "failed"];

  // What an evaluator recorded: which samples failed, it says.
  function recorded(raw) {
    const [times, values, marks] = [data.unpack(raw.times), data.unpack(raw.values), data.bytes(raw.marks)];
    const target = raw.target.times ? { times: data.unpack(raw.target.times), values: data.unpack(raw.target.values) } : null;
    const text = (time) => {
      const n = data.at(times, time + 1e-4);
      const value = n < 0 ? "–" : dodo.dom.withUnit(values[n], raw.unit);
      return target ? `${value} · target ${dodo.dom.number(interpolated(target, time))}` : value;
    };
    const limits = { min: raw.low, max: raw.high, band: raw.band, reach: raw.distance };
    return { title: raw.name, unit: raw.unit, times, values, target, ...limits, marked: (n) => MARKS[marks[n]], text, note: raw.note };
  }

  // Right, missed and false boxes of each frame, one on top of the other.
  function detected() {
    const { frames, times } = dodo.detection;
    const sums = frames.map((frame) => frame.hit.length + frame.missed.length + frame.false.length);
    const paint = (context, x, y) => {
      const wide = Math.max(1.5, (x(dodo.cursor.last) - x(0)) / Math.max(frames.length, 1) - 1);
      frames.forEach((frame) => {
        let base = 0;
        for (const [kind, colour] of [["hit", "passed"], ["missed", "failed"], ["false", "warned"]]) {
          context.fillStyle = dodo.canvas.colour(colour);
          context.fillRect(x(frame.time) - wide / 2, y(base + frame[kind].length), wide, y(base) - y(base + frame[kind].length));
          base += frame[kind].length;
        }
      });
    };
    const text = (time) => {
      const frame = dodo.detection.at(time);
      return frame ? `${frame.hit.length} right, ${frame.missed.length} missed, ${frame.false.length} false` : "–";
    };
    return { title: "Boxes of each frame", unit: "", times, values: Float32Array.from(sums), min: 0, paint, text, note: "green right, red missed, yellow false", isPlain: true };
  }

  const plain = (channel, field) => ({
    title: `${field.name} of ${data.short(channel.message)}/${channel.sender}`,
    unit: "",
    times: channel.times,
    values: field.values,
    note: channel.every > 1 ? `one of ${channel.every} samples` : "",
  });

  // How many messages of a channel came in each part of the test, as messages a second.
  function rate(channel) {
    const wide = Math.max(0.5, dodo.cursor.last / 100);
    const parts = Math.max(1, Math.ceil(dodo.cursor.last / wide));
    const counts = new Float32Array(parts);
    for (const time of channel.times) if (time >= 0) counts[Math.min(parts - 1, Math.floor(time / wide))] += channel.every;
    const spans = counts.map((_, n) => Math.min(wide, dodo.cursor.last - n * wide) || wide);
    const [times, values] = [new Float32Array(2 * parts), new Float32Array(2 * parts)];
    counts.forEach((count, n) => {
      times.set([n * wide, n * wide + spans[n]], 2 * n);
      values.fill(count / spans[n], 2 * n, 2 * n + 2);
    });
    return { title: `${data.short(channel.message)}/${channel.sender} a second`, unit: "1/s", times, values, min: 0, isPlain: true, note: "" };
  }

  // Of a message with several fields those that are not 0 all the time: the others can be added.
  const used = (fields) => (fields.length > 1 && fields.some((one) => one.values.some(Boolean)) ? fields.filter((one) => one.values.some(Boolean)) : fields);

  function judged() {
    const channels = data.test.messages.flatMap((each) => data.channels.filter((c) => c.message === each.message && (each.sender === null || c.sender === each.sender)));
    return [
      ...data.test.judged.map(recorded),
      ...channels.flatMap((channel) => used(channel.fields).map((field) => plain(channel, field))),
      ...(dodo.detection.frames.length ? [detected()] : []),
    ];
  }

  const others = () => data.channels.filter((channel) => !channel.message.startsWith("dodo."));

  function chooser(parent) {
    const select = make("select", { "aria-label": "Add a signal" }, make("option", { value: "" }, "Add a signal…"));
    const choices = [];
    const group = (label, entries) => {
      const options = entries.map(([name, choice]) => make("option", { value: choices.push(choice) - 1 }, name));
      if (options.length) select.append(make("optgroup", { label }, ...options));
    };
    group("Messages a second", others().map((channel) => [`${channel.message}/${channel.sender}`, () => rate(channel)]));
    for (const channel of others()) {
      group(`${channel.message}/${channel.sender}`, channel.fields.map((field) => [field.name, () => plain(channel, field)]));
    }
    select.addEventListener("change", () => {
      if (select.value === "") return;
      const figure = dodo.plot.show(parent, choices[Number(select.value)](), () => figure.remove());
      figure.scrollIntoView({ block: "nearest" });
      select.value = "";
    });
    return choices.length ? select : "";
  }

  function show(parent) {
    const list = judged();
    if (!data.test.checks.length) list.push(...others().filter((channel) => channel.message.startsWith("opendlv.proxy.") && channel.message.endsWith("Request")).map(rate));
    const plots = make("div", { class: "plots", tabindex: "0" });
    parent.append(make("h2", {}, "Signals", chooser(plots)), plots);
    if (data.test.why) plots.append(make("p", { class: "nothing" }, data.test.why));
    if (!list.length && !data.test.why) plots.append(make("p", { class: "nothing" }, "No signal that is judged was recorded."));
    for (const signal of list) dodo.plot.show(plots, signal, null);
  }

  return { show, judged, rate };
})();
