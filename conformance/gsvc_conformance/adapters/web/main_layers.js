// Profile main, layers: spec.md section 15.13.
"use strict";
globalThis.GSVC ??= {};
{
  const { Fault, main, parameterChecksum, renderingWork } = GSVC;
  const { toldOf } = main;

  /**
   * The layers of a stream up to the quality that is wanted: frames get their splats behind those of the base.
   *
   * Layers that are there stand in a Map by number, in their order: their `state`, their `parameters`, the `work` and,
   * where it is stated, the `checksum` of these, what the frame `told` of them (main.toldOf), and their `first` splat in
   * the frame before. Nothing changes such a Map. A chunk may have eight bytes: what it costs depends on the splats that
   * it changes, not on all of the frame.
   */
  class Layers {
    constructor(quality) {
      this.quality = quality;
      this.there = new Map(); // in the frame
      this.before = this.there; // in the frame before
      this.baseCount = 0; // splats of the base
      this.baseWork = 0; // and their work
      this.joined = { parts: [], all: null }; // the arrays of the parts of the frame before, and all in one
      this.last = 0; // the layer of the last chunk
      this.lost = []; // layers that damage has taken
      this.frame = null; // the frame that chunks belong to
    }

    /** A copy that goes on behind the frame. */
    copy() {
      return Object.assign(new Layers(this.quality), this, { frame: null, joined: { parts: [], all: null } });
    }

    /**
     * Behind damage some layers stay, by default those that the frame had before it; the others are lost: their chunks
     * are skipped up to an `I`. Gives the numbers of those that stay.
     */
    interrupt(stay = [...this.there.keys()].filter((layer) => layer <= this.last)) {
      this.there = new Map([...this.there].filter(([layer]) => stay.includes(layer)));
      this.lost = [1, 2, 3].filter((layer) => !stay.includes(layer));
      return stay;
    }

    /** How many bytes of splats it has. */
    get byteLength() {
      return [...this.there.values()].reduce((sum, { parameters }) => sum + 2 * parameters.byteLength, 0);
    }

    /** A frame of the base is complete. */
    begin(frame) {
      this.before = frame.type === "I" ? new Map() : this.#placed();
      this.there = new Map();
      if (frame.type === "R") {
        for (const [layer, entry] of this.before) this.there.set(layer, { ...entry, told: toldOf("R", null) });
      }
      this.baseCount = frame.parameters.length / 8;
      this.baseWork = frame.work;
      this.last = 0;
      if (frame.type === "I") this.lost = [];
      this.frame = Object.assign(frame, { base: frame.parameters, chunks: [] });
    }

    /** No more layers of the frame come: it gets the splats of the base, and behind them those of layers (R-15.13-3). */
    finish() {
      const layers = [...this.there.values()];
      this.frame.parameters = this.#all([this.frame.base, ...layers.map(({ parameters }) => parameters)]);
      this.frame.parts = [this.frame.parts[0], ...layers.map(({ told, first, parameters }) =>
        ({ ...told, first, count: parameters.length / 8 }))];
    }

    /** Arrays in one, which is that of the frame before if they are. */
    #all(parts) {
      const { joined } = this;
      if (parts.length === joined.parts.length && parts.every((part, i) => part === joined.parts[i])) return joined.all;
      const all = new Float32Array(parts.reduce((length, part) => length + part.length, 0));
      parts.reduce((at, part) => (all.set(part, at), at + part.length), 0);
      this.joined = { parts, all };
      return all;
    }

    /** The layers, with the places of their first splats among those of the frame. */
    #placed() {
      let first = this.baseCount;
      const placed = new Map();
      for (const [layer, entry] of this.there) {
        placed.set(layer, { ...entry, first });
        first += entry.parameters.length / 8;
      }
      return placed;
    }

    /** A chunk `n` of so many bytes; the state of the stream has header and limits. */
    read({ bit: chunkBit, payload: p }, byteLength, { header, limits }) {
      const layer = p.le(1);
      if (layer <= this.last || layer >= header.layer_count) throw new Fault("R-15.13-1", p.element);
      if (layer > this.quality) {
        this.last = layer;
        return;
      }
      const type = String.fromCharCode(p.le(1));
      if (!"IPR".includes(type)) throw new Fault("R-3.2-1", p.element);
      const known = this.before.get(layer);
      if (type !== "I" && !known) {
        if (!this.lost.includes(layer)) throw new Fault("R-15.13-2", p.element);
        this.last = layer;
        return;
      }
      const others = [...this.there].filter(([number]) => number !== layer);
      const otherSplats = others.reduce((sum, [, { parameters }]) => sum + parameters.length / 8, this.baseCount);
      const mostSplats = limits.splats - otherSplats;
      if (type === "R" && known.parameters.length / 8 > mostSplats) throw new Fault("R-5-2", p.element);
      const stated = header.flags & 1 ? p.le(4) : null;
      const checksumBit = p.element;
      const body = type === "R" ? null : main.readBody(p, type, known?.state, header, mostSplats);
      p.checkFilled();
      const entry = body ? decoded(body.after, header) : { ...known };
      Object.assign(entry, { told: toldOf(type, body), first: known?.first ?? 0 });
      const there = [...others, [layer, entry]].sort(([one], [other]) => one - other);
      const work = there.reduce((sum, [, layerThere]) => sum + layerThere.work, this.baseWork);
      if (work > limits.work) throw new Fault("R-5-4", chunkBit);
      if (stated !== null && stated !== parameterChecksum(entry.parameters)) throw new Fault("R-6.4-3", checksumBit);
      this.there = new Map(there);
      this.last = layer;
      this.lost = this.lost.filter((other) => other !== layer);
      this.frame.chunks.push({ layer, type, byteOffset: chunkBit / 8, byteLength, body });
    }
  }

  /** What is kept of a layer with such a state. */
  function decoded(state, { width, height }) {
    const parameters = main.stateParameters(state.splats);
    return { state, parameters, work: renderingWork(parameters, width, height) };
  }

  Object.assign(main, { Layers });
}
