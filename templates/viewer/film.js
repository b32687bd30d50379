// A strip of small pictures over the time line, from the first camera's video.
"use strict";

dodo.film = (function () {
  const { make } = dodo.dom;
  const COUNT = 16;
  const HEIGHT = 42;
  const video = dodo.data.test.videos.find((each) => each.file);
  const pictures = [];

  // Each picture fills its part of the strip; what does not fit is cut off at the sides.
  function draw(context, width) {
    const part = width / COUNT;
    pictures.forEach((picture, n) => {
      const wide = Math.min(picture.width, (part * picture.height) / HEIGHT);
      context.drawImage(picture, (picture.width - wide) / 2, 0, wide, picture.height, n * part, 0, part - 1, HEIGHT);
    });
  }

  function small(screen) {
    const picture = make("canvas", { width: Math.round((HEIGHT * video.width) / video.height) * 2, height: 2 * HEIGHT });
    picture.getContext("2d").drawImage(screen, 0, 0, picture.width, picture.height);
    return picture;
  }

  // One after the other, as a video is at one time only.
  function take(canvas) {
    const screen = make("video", { src: video.file, preload: "auto", muted: true });
    const times = Float32Array.from(video.times);
    const seek = () => {
      const n = Math.max(dodo.data.at(times, ((pictures.length + 0.5) / COUNT) * dodo.cursor.last), 0);
      screen.currentTime = times[n] - times[0] + 1e-3;
    };
    screen.addEventListener("loadeddata", seek, { once: true });
    screen.addEventListener("seeked", () => {
      pictures.push(small(screen));
      canvas.redraw();
      if (pictures.length < COUNT) seek();
      else screen.removeAttribute("src");
    });
  }

  function show(parent) {
    if (!video) return;
    const canvas = dodo.canvas.make(parent, "Pictures of the camera over time", draw);
    canvas.element.addEventListener("click", (event) => dodo.cursor.move((event.offsetX / canvas.element.clientWidth) * dodo.cursor.last));
    take(canvas);
  }

  return { show, pictures };
})();
