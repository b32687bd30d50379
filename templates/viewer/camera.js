// What the camera saw at the cursor, with found and true boxes over it.
"use strict";

dodo.camera = (function () {
  const { test, at, channels, field } = dodo.data;
  const { make } = dodo.dom;
  const videos = test.videos.filter((each) => each.file).map((each) => ({ ...each, times: Float32Array.from(each.times) }));
  const LOOKS = { hit: [], false: [2, 3], missed: [6, 4] };
  const NAMES = { hit: "right", false: "false", missed: "missed" };
  const SAME = 1e-3;
  let chosen = 0;
  let screen = null;

  // Width by height: of the video, or else as the bus announced it.
  function shape() {
    if (videos.length) return videos[chosen].width / videos[chosen].height;
    const shared = channels.find((each) => each.message === "opendlv.proxy.ImageReadingShm");
    const [width, height] = ["width", "height"].map((name) => shared && field(shared, name).values[0]);
    return width > 0 && height > 0 ? width / height : 4 / 3;
  }

  const TEXTS = {
    hit: (each) => each.score.toFixed(2),
    false: (each) => `✗ ${each.label}`,
    missed: (each) => `missed ${each.label}`,
  };

  function outline(context, each, kind, place) {
    context.strokeStyle = dodo.canvas.colour(kind);
    context.lineWidth = kind === "hit" ? 1.5 : 2.2;
    context.setLineDash(LOOKS[kind]);
    context.strokeRect(place.x + each.x * place.width, place.y + each.y * place.height, each.width * place.width, each.height * place.height);
    context.setLineDash([]);
  }

  // Beside its box, unless that hides what is written already.
  function write(context, each, kind, place, written) {
    const text = TEXTS[kind](each);
    context.font = `${kind === "hit" ? "" : "bold "}11px system-ui, sans-serif`;
    context.textAlign = "left";
    const width = context.measureText(text).width;
    const x = Math.max(0, Math.min(place.x + each.x * place.width, place.x + place.width - width));
    const y = place.y + each.y * place.height - 4;
    if (written.some((other) => x < other.x + other.width && other.x < x + width && Math.abs(y - other.y) < 11)) return;
    written.push({ x, y, width });
    context.fillStyle = dodo.canvas.colour("label");
    context.fillRect(x - 2, y - 10, width + 4, 13);
    context.fillStyle = dodo.canvas.colour(kind);
    context.fillText(text, x, y);
  }

  function draw(context, width, height) {
    const ratio = shape();
    const wide = Math.min(width, height * ratio);
    const place = { x: (width - wide) / 2, y: (height - wide / ratio) / 2, width: wide, height: wide / ratio };
    context.fillStyle = dodo.canvas.colour("screen");
    context.fillRect(place.x, place.y, place.width, place.height);
    const frame = dodo.detection.at(dodo.cursor.time());
    const isThere = screen && screen.readyState > 1 && pictured(dodo.cursor.time(), frame) >= 0;
    if (isThere) context.drawImage(screen, place.x, place.y, place.width, place.height);
    if (!frame) return;
    const written = [];
    for (const kind of Object.keys(LOOKS)) for (const each of frame[kind]) outline(context, each, kind, place);
    for (const kind of ["missed", "false", "hit"]) for (const each of frame[kind]) write(context, each, kind, place, written);
  }

  // The number of the picture to show: of the frame whose boxes are shown, or else the last one; -1 where there is none.
  function pictured(time, frame) {
    const { times } = videos[chosen];
    const n = at(times, (frame ? frame.time : time) + SAME);
    return n >= 0 && frame && Math.abs(times[n] - frame.time) > SAME ? -1 : n;
  }

  function seek(time) {
    const { times } = videos[chosen];
    const n = Math.max(pictured(time, dodo.detection.at(time)), 0);
    screen.currentTime = times[n] - times[0] + SAME;
  }

  function film(canvas) {
    screen = make("video", { src: videos[chosen].file, preload: "auto", muted: true });
    for (const event of ["seeked", "loadeddata"]) screen.addEventListener(event, () => canvas.redraw());
    screen.addEventListener("loadedmetadata", () => seek(dodo.cursor.time()));
  }

  function caption(time) {
    const frame = dodo.detection.at(time);
    const n = videos.length ? pictured(time, frame) : -1;
    if (!frame) return n < 0 ? "no picture yet" : `picture of ${videos[chosen].times[n].toFixed(2)} s`;
    const counts = Object.keys(LOOKS).map((kind) => `${frame[kind].length} ${NAMES[kind]}`);
    const boxes = `frame at ${frame.time.toFixed(2)} s: ${frame.isKnown ? counts.join(", ") : "no true boxes are known"}`;
    return videos.length && n < 0 ? `${boxes}; its picture was not recorded` : boxes;
  }

  function chooser(canvas) {
    if (videos.length < 2) return null;
    const select = make("select", { "aria-label": "Camera" }, ...videos.map((_, n) => make("option", { value: n }, `Camera ${n + 1}`)));
    select.addEventListener("change", () => ((chosen = Number(select.value)), film(canvas)));
    return select;
  }

  const isNeeded = () => videos.length > 0 || dodo.detection.frames.length > 0;

  function why() {
    const problem = test.videos.map((each) => each.problem).find(Boolean);
    if (problem || videos.length) return problem || "";
    return "The recording has no pictures; with record: {frames: 10 Hz} in the test it has.";
  }

  function show(parent) {
    if (!isNeeded()) return;
    const text = make("p", { class: "caption" });
    const box = make("div", { class: "view" });
    parent.append(box);
    parent.classList.add("pictured");
    const canvas = dodo.canvas.make(box, "What the camera saw", draw);
    box.append(make("p", { class: "caption" }, why()), text);
    if (videos.length) film(canvas);
    const select = chooser(canvas);
    if (select) box.append(select);
    dodo.cursor.follow((time) => {
      if (videos.length) seek(time);
      canvas.redraw();
      text.textContent = caption(time);
      canvas.label(`What the camera saw: ${text.textContent}`);
    });
  }

  return { show, isNeeded, screen: () => screen };
})();
