// What the camera saw at the cursor, with found and true boxes over it.
"use strict";

dodo.camera = (function () {
  const { test, at, channels, field, frames, frameAt, kinds } = dodo.data;
  const { choice, make, svg } = dodo.dom;
  const videos = test.videos.map((each) => ({ ...each, times: Float32Array.from(each.times) }));
  const TEXTS = { hit: (each) => each.score.toFixed(2), false: (each) => `false ${each.label}`, missed: (each) => `missed ${each.label}` };
  const SAME = 1e-3;
  const WIDE = 640;
  let video = videos[0];

  // Height by width: of the video, or else as the bus announced it.
  function shape() {
    if (video) return video.height / video.width;
    const shared = channels.find((each) => each.message === "opendlv.proxy.ImageReadingShm");
    const [width, height] = ["width", "height"].map((name) => shared && field(shared, name).values[0]);
    return width > 0 && height > 0 ? height / width : 3 / 4;
  }

  // The number of the picture to show: of the frame whose boxes are shown, or else the last one; -1 where there is none.
  function pictured(time) {
    const frame = frameAt(time);
    const n = video ? at(video.times, (frame ? frame.time : time) + SAME) : -1;
    return n >= 0 && frame && Math.abs(video.times[n] - frame.time) > SAME ? -1 : n;
  }

  function boxes(frame) {
    const high = WIDE * shape();
    const written = [];
    return ["hit", "missed", "false"].flatMap((kind) =>
      (frame ? frame[kind] : []).flatMap((each) => {
        const [x, y] = [each.x * WIDE, each.y * high];
        const outline = svg("rect", { class: kind, x, y, width: each.width * WIDE, height: each.height * high });
        const isHidden = written.some(([a, b]) => Math.abs(a - x) < 40 && Math.abs(b - y) < 12);
        if (!isHidden) written.push([x, y]);
        return isHidden ? [outline] : [outline, svg("text", { class: kind, x, y: Math.max(y - 4, 11) }, TEXTS[kind](each))];
      }),
    );
  }

  function caption(time) {
    const frame = frameAt(time);
    const n = pictured(time);
    if (!frame) return n < 0 ? "no frame yet" : `frame of ${video.times[n].toFixed(2)} s`;
    const counts = Object.entries(kinds).map(([kind, name]) => `${frame[kind].length} ${name}`);
    const found = `frame of ${frame.time.toFixed(2)} s: ${frame.isKnown ? counts.join(", ") : "no true boxes are known"}`;
    return video && n < 0 ? `${found}; it was not recorded` : found;
  }

  const why = "No frames in H.264 were recorded; record: {frames: always} in the test keeps those of a test that passed.";
  const isNeeded = () => videos.length > 0 || frames.length > 0;

  function show(parent) {
    if (!isNeeded()) return;
    const high = WIDE * shape();
    const screen = make("video", { preload: "auto", muted: true });
    const over = svg("svg", { viewBox: `0 0 ${WIDE} ${high}`, role: "img", "aria-label": "What the camera saw" });
    const chooser = choice("Camera", videos.map((_, n) => [n, `Camera ${n + 1}`]), (n) => {
      video = videos[Number(n)];
      screen.src = video.file;
    });
    chooser.hidden = videos.length < 2;
    const text = make("p", { class: "caption" });
    const shown = make("div", { class: "screen" }, video ? screen : "", over);
    shown.style.aspectRatio = `${WIDE} / ${high}`;
    shown.style.setProperty("--ratio", WIDE / high);
    parent.append(make("div", { class: "view" }, make("div", { class: "stage" }, shown), make("p", { class: "caption" }, videos.length ? "" : why), text, chooser));
    parent.classList.add("pictured");
    const seek = (time) => {
      const n = pictured(time);
      screen.hidden = n < 0;
      if (n >= 0) screen.currentTime = video.times[n] - video.times[0] + SAME;
      over.replaceChildren(...boxes(frameAt(time)));
      text.textContent = caption(time);
    };
    screen.addEventListener("loadedmetadata", () => seek(dodo.cursor.time()));
    if (video) screen.src = video.file;
    dodo.cursor.follow(seek);
  }

  return { show, isNeeded };
})();
