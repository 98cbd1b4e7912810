"use strict";
// Which frame is shown when.
globalThis.GSVC ??= {};

GSVC.Player = class {
  /**
   * @param {function(number)} show shows a frame
   * @param {function()} changed playing has begun or ended
   */
  constructor(show, changed) {
    Object.assign(this, { show, changed, count: 0, number: 0, rate: 25, speed: 1, loop: true, playing: false, tick: 0 });
  }

  /** Begin with the first of so many frames, so many a second. */
  load(count, rate) {
    this.pause();
    Object.assign(this, { count, rate });
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

  /** Shows the frame whose time has come; frames are left out where drawing is too slow for them. */
  #tick(now) {
    const length = 1000 / (this.rate * this.speed);
    this.due ??= now + length; // when the next frame is to be seen
    if (now >= this.due) {
      const frames = 1 + Math.floor((now - this.due) / length);
      let next = this.number + frames;
      if (next >= this.count && this.loop) next %= this.count;
      const due = this.due + frames * length;
      this.seek(next);
      this.due = due;
      if (next >= this.count - 1 && !this.loop) this.pause();
    }
    if (this.playing) this.tick = requestAnimationFrame((later) => this.#tick(later));
  }
};
