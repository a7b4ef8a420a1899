// Playing through the images, at a speed: 1 is real time, or all images in 20 s if that is faster.
"use strict";

class Player {
  /** `go` shows an image, `onState` is told whether it plays. */
  constructor(timestamps, go, onState) {
    Object.assign(this, { timestamps, go, onState, frame: timestamps.length - 1, speed: 1, request: 0 });
    const seconds = timestamps[this.frame] - timestamps[0];
    /** Seconds of the recording in a second. */
    this.usual = Math.max(1, seconds / 20);
  }

  get isPlaying() { return this.request !== 0; }

  toggle() { if (this.isPlaying) this.stop(); else this.start(); }

  start() {
    const { timestamps } = this, last = timestamps.length - 1;
    if (this.frame >= last) this.show(0);
    let before = performance.now(), time = timestamps[this.frame];
    const step = (now) => {
      if (!this.isPlaying) return;
      time += (now - before) / 1000 * this.usual * this.speed;
      before = now;
      let next = this.frame;
      while (next < last && timestamps[next + 1] <= time) next += 1;
      if (next !== this.frame) this.show(next);
      if (next >= last) this.stop();
      else this.request = requestAnimationFrame(step);
    };
    this.request = requestAnimationFrame(step);
    this.onState(true);
  }

  stop() {
    cancelAnimationFrame(this.request);
    this.request = 0;
    this.onState(false);
  }

  show(frame) {
    this.frame = frame;
    this.go(frame);
  }
}
