"use strict";
// The PSNR of each frame as a line over the chart of the timeline.
globalThis.GSVC ??= {};

{
  const EDGE = 5; // pixels above and below the line
  const LEAST_SPAN = 1; // decibels from the lowest to the highest, at least

  GSVC.Curve = class {
    /** @param {function(number): number} place across for the frame at n */
    constructor(canvas, place) {
      Object.assign(this, { canvas, place, values: [], frames: [], number: 0 });
      new ResizeObserver(() => this.draw()).observe(canvas);
    }

    /** Values by the place of the frame, null or undefined where there is none; the frames; the one that is shown. */
    show(values, frames, number) {
      Object.assign(this, { values, frames, number });
      this.canvas.hidden = false;
      this.draw();
    }

    draw() {
      const { canvas, values } = this;
      const [width, height] = [canvas.clientWidth, canvas.clientHeight];
      canvas.width = Math.round(width * devicePixelRatio);
      canvas.height = Math.round(height * devicePixelRatio);
      const finite = values.filter(Number.isFinite);
      if (finite.length === 0 || width === 0) return;
      const lowest = finite.reduce((low, value) => Math.min(low, value));
      const highest = finite.reduce((high, value) => Math.max(high, value));
      const context = canvas.getContext("2d");
      context.scale(devicePixelRatio, devicePixelRatio);
      const colors = getComputedStyle(canvas);
      const middle = (lowest + highest) / 2;
      const span = Math.max(highest - lowest, LEAST_SPAN);
      const down = (value) => height / 2 - ((Math.min(value, highest) - middle) / span) * (height - 2 * EDGE);
      this.#line(context, down, colors.getPropertyValue("--psnr"));
      const told = [[highest, EDGE + 5, "top"], [lowest, height - 2, "bottom"]];
      context.font = `11px ${colors.fontFamily}`;
      for (const [value, y] of highest - lowest < 0.05 ? told.slice(0, 1) : told) {
        const text = `${GSVC.words.number(value, 1)} dB`;
        const wide = context.measureText(text).width + 6;
        context.fillStyle = colors.getPropertyValue("--page");
        context.globalAlpha = 0.8;
        context.fillRect(0, y - 10, wide, 12);
        context.globalAlpha = 1;
        context.fillStyle = colors.getPropertyValue("--soft");
        context.fillText(text, 2, y);
      }
      const part = finite.length === values.length ? "" : `, of ${finite.length} frames so far`;
      const range = `${GSVC.words.number(lowest, 2)} to ${GSVC.words.number(highest, 2)} dB`;
      canvas.setAttribute("aria-label", `PSNR of each frame: ${range}${part}`);
    }

    #line(context, down, color) {
      context.strokeStyle = context.fillStyle = color;
      context.lineWidth = 1.5;
      context.beginPath();
      let before = false;
      this.values.forEach((value, n) => {
        const there = typeof value === "number";
        if (there) context[before && !this.frames[n].missing ? "lineTo" : "moveTo"](this.place(n), down(value));
        before = there;
      });
      context.stroke();
      const now = this.values[this.number];
      if (typeof now !== "number") return;
      context.beginPath();
      context.arc(this.place(this.number), down(now), 3.5, 0, 2 * Math.PI);
      context.fill();
    }
  };
}
