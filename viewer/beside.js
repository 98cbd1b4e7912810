"use strict";
// What lies over the picture: the source on one side of a movable line, all of it, or the difference.
globalThis.GSVC ??= {};

{
  const STEP = 0.02; // of the width, for a key
  const ALONE = "stream"; // the mode that shows nothing beside the stream
  const SIDE_BY_SIDE = "split";
  const MODES = [ALONE, SIDE_BY_SIDE, "source", "difference"];
  const clamp = (value) => Math.min(Math.max(value, 0), 1);

  GSVC.Beside = class {
    /**
     * @param {HTMLElement} screen
     * @param {function(HTMLCanvasElement): void} place puts a canvas of the frame's size where the frame is seen
     * @param {function(Error): void} failed
     */
    constructor(screen, place, failed) {
      const { element } = GSVC.words;
      Object.assign(this, { screen, place, failed, comparison: null, mode: ALONE, gain: 8, at: 0.5 });
      this.canvas = element("canvas", { class: "picture" });
      this.cover = element("div", { class: "beside", "aria-hidden": "true", hidden: "" }, this.canvas);
      this.line = element("div", {
        class: "wipe", hidden: "", role: "slider", tabindex: 0, "aria-label": "Where the source begins",
        "aria-valuemin": 0, "aria-valuemax": 100,
      });
      this.labels = ["left", "right"].map((side) => element("p", { class: `tip side ${side}`, hidden: "" }));
      screen.append(this.cover, this.line, ...this.labels);
      this.#listen();
      this.#wipe(0.5);
    }

    /** Compare with another source from now on, side by side at first, or with none. */
    use(comparison) {
      this.comparison = comparison;
      if (!comparison) this.show(ALONE);
      else if (this.mode === ALONE) this.show(SIDE_BY_SIDE);
    }

    show(mode, gain = this.gain) {
      Object.assign(this, { mode, gain });
      this.cover.hidden = mode === ALONE;
      this.line.hidden = mode !== SIDE_BY_SIDE;
      this.#wipe(this.at);
      const full = 128 / gain;
      const told = {
        stream: ["", ""], split: ["GSVC", "source"], source: ["", "source"],
        difference: ["", `GSVC − source, × ${gain}: grey is 0, white +${full} of 255, black −${full}`],
      }[mode];
      this.labels.forEach((label, side) => {
        label.textContent = told[side];
        label.hidden = told[side] === "";
      });
      if (this.number !== undefined) this.frame(this.number);
    }

    /** The mode after this one. */
    next() {
      return MODES[(MODES.indexOf(this.mode) + 1) % MODES.length];
    }

    /** Have the frame at n lie there, as soon as it has come; of several only the last. */
    async frame(n) {
      this.number = n;
      if (this.mode === ALONE || !this.comparison) return;
      this.wanted = { n, mode: this.mode, gain: this.gain, comparison: this.comparison };
      if (this.busy) return;
      this.busy = true;
      while (this.wanted) {
        const { n: at, mode, gain, comparison } = this.wanted;
        this.wanted = null;
        try {
          this.#paint(await comparison.picture(at, mode, gain));
        } catch (error) {
          if (comparison === this.comparison) this.failed(error);
        }
      }
      this.busy = false;
    }

    /** The frame is seen at another place. */
    moved() {
      if (this.mode !== ALONE && this.canvas.width > 1) this.place(this.canvas);
    }

    #paint(image) {
      this.canvas.hidden = image === null;
      if (image === null) return;
      this.canvas.width = image.width;
      this.canvas.height = image.height;
      this.canvas.getContext("2d").putImageData(image, 0, 0);
      this.place(this.canvas);
    }

    /** Let the source begin at a part of the screen's width. */
    #wipe(at) {
      this.at = clamp(at);
      this.line.style.left = `${100 * this.at}%`;
      this.line.setAttribute("aria-valuenow", Math.round(100 * this.at));
      this.cover.style.clipPath = this.mode === "split" ? `inset(0 0 0 ${100 * this.at}%)` : "";
    }

    #listen() {
      const { line, screen } = this;
      line.addEventListener("pointerdown", (event) => {
        event.stopPropagation(); // the picture is not moved
        line.setPointerCapture(event.pointerId);
      });
      line.addEventListener("pointermove", (event) => {
        event.stopPropagation();
        if (!(event.buttons & 1)) return;
        const { left, width } = screen.getBoundingClientRect();
        this.#wipe((event.clientX - left) / width);
      });
      line.addEventListener("pointerup", (event) => event.stopPropagation());
      line.addEventListener("keydown", (event) => {
        const step = { ArrowLeft: -STEP, ArrowRight: STEP }[event.key];
        if (step === undefined) return;
        event.preventDefault();
        event.stopPropagation();
        this.#wipe(this.at + step);
      });
    }
  };

  GSVC.Beside.MODES = MODES;
}
