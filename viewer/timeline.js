"use strict";
// The bytes of each frame as a chart, over the slider that seeks; gaps between frames stand in it.
globalThis.GSVC ??= {};

{
  const PAD = 8; // half of the slider's thumb: where its middle can go, bars stand
  const WIDEST = 14;
  const LACKS = 3; // the height of the mark of a frame that lacks a layer
  const TYPES = { I: "whole picture", P: "predicted", R: "repeated" };

  GSVC.Timeline = class {
    /**
     * @param {HTMLElement[]} charts the one that is drawn, and others above it with the same places
     * @param {function(number)} onSeek takes the place of the frame that is asked for
     * @param {function(number): string} more words about the frame at a place
     */
    constructor([chart, ...others], slider, onSeek, more = () => "") {
      Object.assign(this, { chart, slider, more, frames: [], missingAtEnd: 0, number: 0 });
      slider.addEventListener("input", () => onSeek(slider.valueAsNumber));
      for (const one of [chart, ...others]) this.#listen(one, onSeek);
      new ResizeObserver(() => this.#draw()).observe(chart);
    }

    #listen(chart, onSeek) {
      const seek = (event) => onSeek(this.#frameAt(event.offsetX));
      chart.addEventListener("pointerdown", (event) => {
        chart.setPointerCapture(event.pointerId);
        seek(event);
      });
      chart.addEventListener("pointermove", (event) => {
        if (event.buttons & 1) seek(event);
        const at = this.#frameAt(event.offsetX);
        const frame = this.frames[at];
        const told = frame ? `frame ${frame.number}, ${frame.type}: ${GSVC.words.bytes(frame.size)}${this.more(at)}` : "";
        const lacking = frame?.lacking.length ? `; it lacks layer ${frame.lacking.join(" and ")}` : "";
        chart.title = told + lacking + (frame?.missing ? `; before it ${frame.missing} are missing` : "");
      });
    }

    /** Frames from now on; how many are missing after the last one (null: nobody knows), and where they are shown. */
    setFrames(frames, missingAtEnd = 0, number = 0) {
      this.frames = frames;
      this.missingAtEnd = missingAtEnd;
      this.slider.max = Math.max(frames.length - 1, 0);
      this.slider.disabled = frames.length < 2;
      const counts = ["I", "P", "R"].map((type) => [type, frames.filter((frame) => frame.type === type).length]);
      const told = counts.filter(([, count]) => count > 0).map(([type, count]) => `${count} ${type} (${TYPES[type]})`);
      this.most = frames.reduce((most, { size }) => Math.max(most, size), 1);
      const missing = GSVC.words.missingInWords(frames, missingAtEnd, "; missing: ");
      const lacking = frames.filter((frame) => frame.lacking.length > 0).length;
      const incomplete = lacking > 0 ? `; ${lacking} without a layer` : "";
      const label = `Bytes of each frame: ${told.join(", ")}; at most ${this.most} bytes${missing}${incomplete}`;
      this.chart.setAttribute("aria-label", label);
      this.show(number);
    }

    show(number) {
      this.number = number;
      this.slider.value = number;
      const frame = this.frames[number];
      if (frame) {
        const told = `frame ${GSVC.panels.numbered(frame.number, this.frames)}, ${TYPES[frame.type]}, ${frame.size} bytes`;
        this.slider.setAttribute("aria-valuetext", told);
      }
      this.#draw();
    }

    /** How far across the frame at a place is. */
    place(number) {
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
      if (shared <= 1) return [...this.frames.entries()];
      const bars = [];
      for (let first = 0; first < this.frames.length; first += shared) {
        const some = [...this.frames.entries()].slice(first, first + shared);
        bars.push(some.reduce((largest, one) => (one[1].size > largest[1].size ? one : largest)));
      }
      return bars;
    }

    /** The mark of a gap: a line with teeth. */
    #gap(context, x, height) {
      const colors = getComputedStyle(this.chart);
      context.strokeStyle = colors.getPropertyValue("--bad");
      context.lineWidth = 2;
      context.beginPath();
      context.moveTo(x, 0);
      for (let y = 3, side = 1; y < height + 3; y += 4, side = -side) {
        context.lineTo(x + 2.5 * side, Math.min(y, height));
      }
      context.stroke();
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
      const gap = frames.length > 1 ? this.place(1) - this.place(0) : Infinity;
      const wide = Math.min(Math.max(gap * 0.8, 1), WIDEST);
      for (const [number, { type, size, lacking }] of this.#bars(width)) {
        const high = Math.max((size / this.most) * (height - 1), 2);
        context.fillStyle = colors.getPropertyValue(`--frame-${type}`);
        context.globalAlpha = number === this.number ? 1 : 0.62;
        context.fillRect(this.place(number) - wide / 2, height - high, wide, high);
        if (lacking.length === 0) continue;
        context.fillStyle = colors.getPropertyValue("--bad");
        context.fillRect(this.place(number) - wide / 2, 0, wide, LACKS);
      }
      context.globalAlpha = 1;
      if (frames.length === 0) return;
      const between = Math.min(gap, 2 * PAD) / 2;
      frames.forEach(({ missing }, number) => missing && this.#gap(context, this.place(number) - between, height));
      if (this.missingAtEnd !== 0) this.#gap(context, width - PAD / 2, height);
      context.fillStyle = colors.getPropertyValue("--ink");
      context.fillRect(this.place(this.number) - 0.75, 0, 1.5, height);
    }
  };
}
