// Profile main, layers: spec.md section 15.13.
"use strict";
globalThis.GSVC ??= {};
{
  const { Fault, main, parameterChecksum, renderingWork } = GSVC;

  /** The layers of a stream up to the quality that is wanted: frames get their splats behind those of the base. */
  class Layers {
    constructor(quality) {
      this.quality = quality;
      this.frame = null; // the frame that chunks belong to
      this.last = 0; // the layer of the chunk before
      this.there = new Map(); // the layers that are shown in the frame: {state, parameters} by number, in their order
      this.before = this.there; // what they are predicted from
    }

    /** A copy that goes on from here; nothing changes a Map once a frame has begun. */
    copy() {
      return Object.assign(Object.create(Layers.prototype), this);
    }

    /** A frame of the base is complete. */
    begin(frame) {
      this.before = frame.type === "I" ? new Map() : this.there;
      this.there = frame.type === "R" ? this.there : new Map();
      this.last = 0;
      this.frame = frame;
      frame.base = { parameters: frame.parameters, newCount: frame.newCount, survivors: frame.survivors };
      frame.layers = new Map(); // what the chunks of its layers say, by number
      frame.parameters = this.#shown(this.there);
    }

    /** The splats of the base, and behind them those of layers (R-15.13-3). */
    #shown(there) {
      const parts = [this.frame.base.parameters, ...[...there.values()].map(({ parameters }) => parameters)];
      const all = new Float32Array(parts.reduce((length, part) => length + part.length, 0));
      parts.reduce((at, part) => (all.set(part, at), at + part.length), 0);
      return all;
    }

    /** A chunk `n` of so many bytes; the state of the stream has header and limits. */
    read({ bit: chunkBit, payload: p }, byteLength, { header, limits }) {
      const layer = p.le(1);
      if (layer <= this.last || layer >= header.layer_count) throw new Fault("R-15.13-1", p.element);
      this.last = layer;
      if (layer > this.quality) return;
      const type = String.fromCharCode(p.le(1));
      if (!"IPR".includes(type)) throw new Fault("R-3.2-1", p.element);
      const known = this.before.get(layer);
      if (type !== "I" && !known) throw new Fault("R-15.13-2", p.element);
      const stated = header.flags & 1 ? p.le(4) : null;
      const checksumBit = p.element;
      const others = new Map([...this.there].filter(([number]) => number !== layer));
      const mostSplats = limits.splats - this.#shown(others).length / 8;
      const body = type === "R" ? null : main.readBody(p, type, known?.state, header, mostSplats);
      p.checkFilled();
      const parameters = body ? main.stateParameters(body.after.splats) : known.parameters;
      const there = new Map([...others, [layer, { state: body ? body.after : known.state, parameters }]].sort(byNumber));
      const shown = this.#shown(there);
      if (renderingWork(shown, header.width, header.height) > limits.work) throw new Fault("R-5-4", chunkBit);
      if (stated !== null && stated !== parameterChecksum(parameters)) throw new Fault("R-6.4-3", checksumBit);
      this.there = there;
      this.frame.parameters = shown;
      this.frame.layers.set(layer, { type, body, byteOffset: chunkBit / 8, byteLength });
    }
  }

  const byNumber = ([one], [other]) => one - other;

  Object.assign(main, { Layers });
}
