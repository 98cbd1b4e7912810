"use strict";
// Which frame is shown when.
globalThis.GSVC ??= {};

GSVC.Player = class {
  /**
   * @param {function(number)} show shows a frame
   * @param {function()} changed playing has begun or ended
   */
  constructor(show, changed) {
    Object.assign(this, { show, changed, count: 0, number: 0, rate: 25, times: null, speed: 1 });
    Object.assign(this, { loop: true, playing: false, late: false, tick: 0 }); // late: a frame is not shown yet
  }

  /** Begin with the first of so many frames, so many a second, or at the `times` that GSVC.timesOf says. */
  load(count, rate, times = null) {
    this.pause();
    Object.assign(this, { count, rate, times });
    if (count > 0) this.seek(0);
  }

  /** There are more frames by now. */
  extend(count) {
    this.count = count;
  }

  seek(number) {
    if (this.count === 0) return;
    this.number = Math.min(Math.max(number, 0), this.count - 1);
    this.due = null;
    this.show(this.number);
  }

  step(frames) {
    this.pause();
    this.seek(this.number + frames);
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  play() {
    if (this.playing || this.count < 2) return;
    if (this.number === this.count - 1) this.seek(0);
    this.playing = true;
    this.due = null;
    this.changed();
    this.tick = requestAnimationFrame((now) => this.#tick(now));
  }

  pause() {
    if (!this.playing) return;
    this.playing = false;
    cancelAnimationFrame(this.tick); // else there would be two after the next play()
    this.changed();
  }

  /** Milliseconds for which frame n is shown, at least one: it may be told to take none. */
  #length(n) {
    const seconds = this.times ? this.times[n + 1] - this.times[n] : 1 / this.rate;
    return Math.max(1, (1000 * seconds) / this.speed);
  }

  /** Shows the frame whose time has come; frames are left out where drawing is too slow for them. */
  #tick(now) {
    if (this.late) { // a frame that is skipped has to be decoded too, so skipping would make the next one later still
      this.due = null;
      this.tick = requestAnimationFrame((later) => this.#tick(later));
      return;
    }
    this.due ??= now + this.#length(this.number); // when the next frame is to be seen
    if (now >= this.due) {
      let next = this.number;
      let due = this.due;
      while (now >= due && (this.loop || next < this.count - 1)) {
        next = (next + 1) % this.count;
        due += this.#length(next);
      }
      this.seek(next);
      this.due = due;
      if (next >= this.count - 1 && !this.loop) this.pause();
    }
    if (this.playing) this.tick = requestAnimationFrame((later) => this.#tick(later));
  }
};
