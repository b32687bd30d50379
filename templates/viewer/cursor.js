// The one cursor in time: whatever moves it reports here, and all parts of the page follow.
"use strict";

dodo.cursor = (function () {
  const followers = [];
  const last = Math.max(dodo.data.test.duration, dodo.data.test.moment.time, 0.01);
  let now = 0;
  let speed = 1;
  let frame = null;
  let linking = null;

  function move(time) {
    now = Math.min(Math.max(time, 0), last);
    for (const follow of followers) follow(now);
    if (frame === null) link();
  }

  // The address is changed when the cursor rests, as browsers limit how often it may be.
  function link() {
    clearTimeout(linking);
    linking = setTimeout(() => history.replaceState(null, "", `#t=${now.toFixed(2)}`), 200);
  }

  function play() {
    if (now >= last) move(0);
    let before = performance.now();
    const step = (moment) => {
      frame = requestAnimationFrame(step);
      const after = now + ((moment - before) / 1000) * speed;
      before = moment;
      move(after);
      if (now >= last) pause();
    };
    frame = requestAnimationFrame(step);
    changed(true);
  }

  function pause() {
    cancelAnimationFrame(frame);
    frame = null;
    link();
    changed(false);
  }

  let changed = () => {};

  function linked() {
    const found = /^#t=(\d+(?:\.\d*)?)$/.exec(location.hash);
    return found ? Number(found[1]) : null;
  }

  window.addEventListener("hashchange", () => {
    const time = linked();
    if (time !== null && Math.abs(time - now) > 0.005) move(time);
  });

  return {
    last,
    move,
    play,
    pause,
    linked,
    time: () => now,
    toggle: () => (frame === null ? play() : pause()),
    setSpeed: (value) => (speed = value),
    follow: (follower) => followers.push(follower),
    whenPlaying: (state) => (changed = state),
  };
})();
