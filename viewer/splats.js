"use strict";
// Splats as things to look at: which one is at a place, their outlines, and one that is followed from frame to frame.
globalThis.GSVC ??= {};

{
  const SUPPORT_RADIUS = 3.3290429691304455; // sqrt(2 ln 255)
  const LN_255 = 5.541263545158426;
  const LONGEST_WALK = 300; // frames that a splat is followed in one go
  const MOST_DECODED = 2 ** 22; // splats of frames that may have to be decoded for it

  const isFactor = (value) => value >= 2 ** -126 && value < Infinity;

  const degenerate = (parameters, at) => !isFactor(parameters[at + 2]) || !isFactor(parameters[at + 4]);

  /** sigma of (9-1) of the splat whose parameters begin at `at`; NaN if it is degenerate. */
  function sigmaAt(parameters, at, x, y) {
    if (degenerate(parameters, at)) return NaN;
    const u1 = (x - parameters[at]) / parameters[at + 2];
    const u2 = (y - parameters[at + 1] - parameters[at + 3] * u1) / parameters[at + 4];
    return (u1 * u1 + u2 * u2) / 2;
  }

  /**
   * What is at a place: how many splats cover it, their sum, and the index of the one that is meant by who points there
   * (-1: none): the smallest of those within whose standard deviation it lies, else the nearest in its own deviations.
   */
  function lookAt(parameters, x, y) {
    const found = { index: -1, covering: 0, sum: [0, 0, 0] };
    let best = Infinity;
    for (let at = 0; at < parameters.length; at += 8) {
      const sigma = sigmaAt(parameters, at, x, y);
      if (!(sigma <= LN_255)) continue;
      found.covering += 1;
      for (let c = 0; c < 3; c++) found.sum[c] += parameters[at + 5 + c] * Math.exp(-sigma);
      const area = parameters[at + 2] * parameters[at + 4];
      const rank = sigma <= 0.5 ? -1 / area : sigma; // those within come first, the smallest before all
      if (rank < best) {
        best = rank;
        found.index = at / 8;
      }
    }
    return found;
  }

  /** The axes of a splat: its largest and its smallest standard deviation, and the angle of the largest, clockwise. */
  function axes(l11, l21, l22) {
    const [xx, xy, yy] = [l11 * l11, l11 * l21, l21 * l21 + l22 * l22]; // L L^T
    const large = (xx + yy + Math.hypot(xx - yy, 2 * xy)) / 2;
    const small = (l11 * l22) ** 2 / large; // the determinant over it: no cancellation
    return { large: Math.sqrt(large), small: Math.sqrt(small), angle: (Math.atan2(2 * xy, xx - yy) * 90) / Math.PI };
  }

  /** Draws outlines. `to` maps the frame to the canvas: x * scale + left, y * scale + top. */
  class Outlines {
    constructor(context, parameters, to) {
      Object.assign(this, { context, parameters, to });
      const { canvas } = context;
      this.width = canvas.width;
      this.height = canvas.height;
    }

    /** Whether any of a splat can be seen. */
    seen(at) {
      const { parameters: p, to } = this;
      if (degenerate(p, at)) return false;
      const x = p[at] * to.scale + to.left;
      const y = p[at + 1] * to.scale + to.top;
      const wide = SUPPORT_RADIUS * p[at + 2] * to.scale;
      const high = SUPPORT_RADIUS * (Math.abs(p[at + 3]) + p[at + 4]) * to.scale;
      return x + wide > 0 && x - wide < this.width && y + high > 0 && y - high < this.height;
    }

    /** Adds the ellipse of `radius` standard deviations to the path: the image of a circle under L. */
    ellipse(at, radius) {
      const { context, parameters: p, to } = this;
      context.setTransform(
        p[at + 2] * to.scale, p[at + 3] * to.scale, 0, p[at + 4] * to.scale,
        p[at] * to.scale + to.left, p[at + 1] * to.scale + to.top,
      );
      context.moveTo(radius, 0);
      context.arc(0, 0, radius, 0, 2 * Math.PI);
      context.resetTransform();
    }

    /** Adds a dot at the centre to the path. */
    centre(at, size) {
      const x = this.parameters[at] * this.to.scale + this.to.left;
      const y = this.parameters[at + 1] * this.to.scale + this.to.top;
      this.context.rect(x - size / 2, y - size / 2, size, size);
    }

    /** Outlines of the splats that `isMeant` in one colour. */
    draw(isMeant, color, { sigma, support, centres }, line) {
      const { context } = this;
      const each = (add) => {
        context.beginPath();
        for (let at = 0; at < this.parameters.length; at += 8) if (isMeant(at / 8) && this.seen(at)) add(at);
      };
      context.strokeStyle = context.fillStyle = color;
      context.lineWidth = line;
      if (support) {
        each((at) => this.ellipse(at, SUPPORT_RADIUS));
        context.globalAlpha = 0.45;
        context.stroke();
      }
      context.globalAlpha = 1;
      if (sigma) {
        each((at) => this.ellipse(at, 1));
        context.stroke();
      }
      if (centres) {
        each((at) => this.centre(at, 3 * line));
        context.fill();
      }
    }

    /** One splat that stands out: both ellipses, light on dark, so that it shows on every picture. */
    highlight(index, line) {
      const { context } = this;
      if (!this.seen(8 * index)) return;
      for (const [color, width] of [["#000c", 3.5 * line], ["#fff", 1.5 * line]]) {
        context.strokeStyle = color;
        context.lineWidth = width;
        context.setLineDash([]);
        context.beginPath();
        this.ellipse(8 * index, 1);
        context.stroke();
        context.setLineDash([4 * line, 4 * line]);
        context.beginPath();
        this.ellipse(8 * index, SUPPORT_RADIUS);
        context.stroke();
      }
      context.setLineDash([]);
    }

    /** The way of a centre from frame to frame: x and y of each. */
    trail(points, line) {
      const { context, to } = this;
      for (const [color, width] of [["#000a", 3 * line], ["#fff", 1.25 * line]]) {
        context.strokeStyle = color;
        context.lineWidth = width;
        context.beginPath();
        for (const [x, y] of points) context.lineTo(x * to.scale + to.left, y * to.scale + to.top);
        context.stroke();
      }
    }
  }

  /** A splat followed through the frames. */
  class Track {
    constructor(stream, number, index) {
      this.stream = stream;
      this.at = new Map(); // frame number -> {index, x, y}
      this.first = 0; // it is in no frame before this one ...
      this.end = Infinity; // ... and in none from this one on, as far as is known
      this.#note(number, index);
    }

    #note(number, index) {
      const { parameters } = this.stream.frame(number);
      this.at.set(number, { index, x: parameters[8 * index], y: parameters[8 * index + 1] });
    }

    /** The splat's index in a frame; -1 if it is not there; null if that is too far away to tell. */
    indexIn(number) {
      if (number < this.first || number >= this.end) return -1;
      const known = [...this.at.keys()];
      const nearest = known.reduce((best, one) => (Math.abs(one - number) < Math.abs(best - number) ? one : best));
      if (Math.abs(nearest - number) > LONGEST_WALK) return null;
      let left = MOST_DECODED;
      for (let n = nearest; n < number; n++) {
        if ((left -= this.#cost(n + 1)) < 0) return null;
        if (!this.#forwards(n)) return -1;
      }
      for (let n = nearest; n > number; n--) {
        if ((left -= this.#cost(n) + this.#cost(n - 1)) < 0) return null;
        if (!this.#backwards(n)) return -1;
      }
      return this.at.get(number).index;
    }

    /** About how many splats have to be decoded for a frame. */
    #cost(n) {
      return this.stream.frame.distance(n) * this.stream.frames[n].splatCount;
    }

    #forwards(n) {
      const index = this.stream.frame(n + 1).origins.indexOf(this.at.get(n).index);
      if (index < 0) this.end = n + 1;
      else this.#note(n + 1, index);
      return index >= 0;
    }

    #backwards(n) {
      const index = this.stream.frame(n).origins[this.at.get(n).index];
      if (index < 0) this.first = n;
      else this.#note(n - 1, index);
      return index >= 0;
    }

    /** The centres of all frames that were visited, in their order. */
    points() {
      return [...this.at.keys()].sort((a, b) => a - b).map((n) => [this.at.get(n).x, this.at.get(n).y]);
    }
  }

  GSVC.splats = { lookAt, axes, Outlines, Track };
}
