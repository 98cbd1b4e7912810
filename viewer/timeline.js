"use strict";
// The bytes of each frame as a chart, over the slider that seeks.
globalThis.GSVC ??= {};

{
  const PAD = 8; // half of the slider's thumb: where its middle can go, bars stand
  const WIDEST = 14;
  const TYPES = { I: "whole picture", P: "predicted", R: "repeated" };

  GSVC.Timeline = class {
    /** @param {function(number)} onSeek takes the number of the frame that is asked for */
    constructor(chart, slider, onSeek) {
      Object.assign(this, { chart, slider, frames: [] });
      slider.addEventListener("input", () => onSeek(slider.valueAsNumber));
      const seek = (event) => onSeek(this.#frameAt(event.offsetX));
      chart.addEventListener("pointerdown", (event) => {
        chart.setPointerCapture(event.pointerId);
        seek(event);
      });
      chart.addEventListener("pointermove", (event) => {
        if (event.buttons & 1) seek(event);
        const frame = this.frames[this.#frameAt(event.offsetX)];
        chart.title = frame ? `frame ${frame.number}, ${frame.type}: ${GSVC.words.bytes(frame.size)}` : "";
      });
      new ResizeObserver(() => this.#draw()).observe(chart);
    }

    setFrames(frames) {
      this.frames = frames;
      this.slider.max = Math.max(frames.length - 1, 0);
      this.slider.disabled = frames.length < 2;
      const counts = ["I", "P", "R"].map((type) => [type, frames.filter((frame) => frame.type === type).length]);
      const told = counts.filter(([, count]) => count > 0).map(([type, count]) => `${count} ${type} (${TYPES[type]})`);
      this.most = frames.reduce((most, { size }) => Math.max(most, size), 1);
      this.chart.setAttribute("aria-label", `Bytes of each frame: ${told.join(", ")}; at most ${this.most} bytes`);
      this.show(0);
    }

    show(number) {
      this.number = number;
      this.slider.value = number;
      const frame = this.frames[number];
      if (frame) {
        const told = `frame ${GSVC.panels.numbered(number, this.frames)}, ${TYPES[frame.type]}, ${frame.size} bytes`;
        this.slider.setAttribute("aria-valuetext", told);
      }
      this.#draw();
    }

    #place(number) {
      const width = this.chart.clientWidth - 2 * PAD;
      return PAD + (this.frames.length > 1 ? (number / (this.frames.length - 1)) * width : 0);
    }

    #frameAt(x) {
      const share = (x - PAD) / Math.max(this.chart.clientWidth - 2 * PAD, 1);
      return Math.round(Math.min(Math.max(share, 0), 1) * (this.frames.length - 1));
    }

    /** The frames that have a bar: where there are more than pixels, the largest of those that share one. */
    #bars(width) {
      const shared = Math.ceil(this.frames.length / Math.max(width, 1));
      if (shared <= 1) return this.frames;
      const bars = [];
      for (let first = 0; first < this.frames.length; first += shared) {
        const some = this.frames.slice(first, first + shared);
        bars.push(some.reduce((largest, frame) => (frame.size > largest.size ? frame : largest)));
      }
      return bars;
    }

    #draw() {
      const { chart, frames } = this;
      const density = devicePixelRatio;
      const [width, height] = [chart.clientWidth, chart.clientHeight];
      chart.width = Math.round(width * density);
      chart.height = Math.round(height * density);
      const context = chart.getContext("2d");
      context.scale(density, density);
      const colors = getComputedStyle(chart);
      const gap = frames.length > 1 ? this.#place(1) - this.#place(0) : Infinity;
      const wide = Math.min(Math.max(gap * 0.8, 1), WIDEST);
      for (const { number, type, size } of this.#bars(width)) {
        const high = Math.max((size / this.most) * (height - 1), 2);
        context.fillStyle = colors.getPropertyValue(`--frame-${type}`);
        context.globalAlpha = number === this.number ? 1 : 0.62;
        context.fillRect(this.#place(number) - wide / 2, height - high, wide, high);
      }
      context.globalAlpha = 1;
      if (frames.length === 0) return;
      context.fillStyle = colors.getPropertyValue("--ink");
      context.fillRect(this.#place(this.number) - 0.75, 0, 1.5, height);
    }
  };
}
