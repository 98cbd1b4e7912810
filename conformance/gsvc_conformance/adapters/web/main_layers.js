// Profile main, layers: spec.md section 15.13.
"use strict";
globalThis.GSVC ??= {};
{
  const { Fault, main, parameterChecksum, checkLimit, addToSecond } = GSVC;
  const { toldOf } = main;
  const TYPES = "IPR"; // by `layer_type`
  const NUMBERS = [1, 2, 3]; // of all layers that there can be

  /**
   * The layers of a stream up to the quality that is wanted: frames get their splats after those of the base.
   *
   * Layers that are there stand in a Map by number, in their order: their `state`, their `parameters`, the work of these
   * (`work`, and `pointWork` at the size of the operating point), what the frame `told` of them (main.toldOf), and their
   * `first` splat in the frame before. Nothing changes such a Map. A chunk may have a few bytes: what it costs depends on the
   * splats that it changes, not on all of the frame.
   */
  class Layers {
    constructor(quality) {
      this.quality = quality;
      this.count = 1; // of the layers that the stream has, with the base
      this.there = new Map(); // in the frame
      this.before = this.there; // in the frame before
      this.awaited = []; // layers that the mask names, of which no chunk has come
      this.base = { parameters: new Float32Array(0), work: 0, pointWork: 0 };
      this.joined = { parts: [], all: null }; // the arrays of the parts of the frame before, and all in one
      this.last = 0; // the layer of the last chunk
      this.lost = []; // layers that damage has taken: their chunks are skipped up to an `I`
      this.damaged = false; // whether a part of the stream was skipped after the frame
      this.frame = null; // the frame that chunks belong to
    }

    /** A copy that goes on after the frame. */
    copy() {
      return Object.assign(new Layers(this.quality), this, { frame: null, joined: { parts: [], all: null } });
    }

    /** How many bytes of splats it has. */
    get byteLength() {
      return [...this.there.values()].reduce((sum, { parameters }) => sum + 2 * parameters.byteLength, 0);
    }

    /** What a frame of the base makes of the layers before its own chunks: what these build on, and what is carried. */
    behind(frame, state) {
      if (frame.type === "I") return { before: new Map(), there: new Map() };
      const before = this.#placed();
      const there = new Map();
      for (const [layer, entry] of before) {
        if (frame.mask & (1 << layer)) continue;
        const carried = frame.type === "P" ? moved(entry, frame.body.field, state) : entry;
        there.set(layer, { ...carried, told: toldOf("R", null) });
      }
      return { before, there };
    }

    /** A frame of the base is complete; `behind` is what it makes of the layers. */
    begin(frame, behind, base, { header: { layer_count: count } }) {
      Object.assign(this, behind, { base, count, last: 0, damaged: false });
      if (frame.type === "I") this.lost = [];
      this.awaited = NUMBERS.filter((layer) => layer <= this.quality && layer < count && frame.mask & (1 << layer));
      this.frame = Object.assign(frame, { chunks: [], carried: [...this.there.keys()] });
    }

    /** R-15.13-5: whether all chunks of the frame have come that are wanted. */
    get isComplete() {
      return this.awaited.length === 0;
    }

    /**
     * R-15.13-6: refuses the chunk at a bit, before which those of all layers below `end` must have come. Such layers are
     * lost; after damage that is no surprise.
     */
    checkMissing(bit, end = Infinity) {
      const missing = this.awaited.filter((layer) => layer < end && !this.lost.includes(layer));
      this.lost = [...this.lost, ...missing];
      if (missing.length > 0 && !this.damaged) throw new Fault("R-15.13-6", bit, { isSound: true });
    }

    /** No more layers of the frame come: it gets the splats of the base, and after them those of layers (R-15.13-3). */
    finish() {
      const layers = [...this.there.values()];
      this.frame.parameters = this.#all([this.base.parameters, ...layers.map(({ parameters }) => parameters)]);
      this.frame.parts = [this.frame.parts[0], ...layers.map(({ told, first, parameters }) =>
        ({ ...told, first, count: parameters.length / 8 }))];
      this.lost = NUMBERS.filter((layer) => this.lost.includes(layer) || this.awaited.includes(layer));
      this.frame.lacking = this.lost.filter((layer) => layer <= this.quality && layer < this.count);
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
      let first = this.base.parameters.length / 8;
      const placed = new Map();
      for (const [layer, entry] of this.there) {
        placed.set(layer, { ...entry, first });
        first += entry.parameters.length / 8;
      }
      return placed;
    }

    /** A chunk `n` of so many bytes, of the frame before it. */
    read({ bit: chunkBit, payload: p }, byteLength, state) {
      const { header } = state;
      const layer = p.u(2);
      if (layer === 0) throw new Fault("R-3.2-1", p.element);
      const isNamed = this.frame.mask & (1 << layer);
      if (layer <= this.last || layer >= header.layer_count || !isNamed) {
        if (this.damaged) return; // it is of a frame that is lost
        throw new Fault("R-15.13-1", p.element);
      }
      this.checkMissing(chunkBit, layer);
      if (layer > this.quality) {
        this.#passed(layer);
        addToSecond({}, chunkBit, state);
        return;
      }
      if (state.point !== null && p.data.length > state.point.limits.payload) throw new Fault("R-5-9", chunkBit + 8);
      const type = TYPES[p.u(2)];
      if (type === undefined) throw new Fault("R-3.2-1", p.element);
      const typeBit = p.element;
      const known = this.before.get(layer);
      const isLost = type !== "I" && !known;
      if (isLost && !this.lost.includes(layer)) throw new Fault("R-15.13-2", typeBit);
      if (p.u(4) !== this.frame.number % 16) {
        if (this.damaged) return;
        throw new Fault("R-15.13-4", p.element);
      }
      if (isLost) {
        this.#passed(layer);
        return;
      }
      const others = [this.base, ...this.there.values()];
      const otherSplats = others.reduce((sum, { parameters }) => sum + parameters.length / 8, 0);
      if (type === "R") checkLimit("R-5-2", "splats", typeBit, state, otherSplats + known.parameters.length / 8);
      const stated = header.flags & 1 ? p.le(4) : null;
      const checksumBit = p.element;
      const inherited = this.frame.body?.field; // a layer that has no field of its own has the one of the base
      const body = type === "R" ? null : main.readBody(p, type, known?.state, state, { otherSplats, inherited });
      p.checkFilled();
      const entry = body ? decoded(body.after, state) : { ...known };
      Object.assign(entry, { told: toldOf(type, body), first: known?.first ?? 0 });
      const sum = (name) => others.reduce((all, other) => all + other[name], entry[name]);
      checkLimit("R-5-4", "work", chunkBit, state, sum("work"), sum("pointWork"));
      if (stated !== null && stated !== parameterChecksum(entry.parameters)) throw new Fault("R-6.4-3", checksumBit);
      addToSecond(amountsOf(entry), chunkBit, state);
      this.there = new Map([...this.there, [layer, entry]].sort(([one], [other]) => one - other));
      this.#passed(layer);
      this.lost = this.lost.filter((other) => other !== layer);
      this.frame.chunks.push({ layer, type, byteOffset: chunkBit / 8, byteLength, body });
    }

    #passed(layer) {
      this.last = layer;
      this.awaited = this.awaited.filter((other) => other > layer);
    }
  }

  const amountsOf = ({ parameters, work, pointWork }) => ({ splats: parameters.length / 8, work, pointWork });

  /** What is kept of a layer, or of the base, with such a state. */
  function decoded(after, { header: { width, height }, point }) {
    const work = main.mainWork(after.splats, width, height);
    const pointWork = point?.halvings > 0 ? main.mainWork(after.splats, width, height, point.halvings) : work;
    return { state: after, parameters: main.stateParameters(after.splats), work, pointWork };
  }

  /** A layer that a P-frame of the base carries on by its field. */
  function moved(entry, field, state) {
    const after = { ...entry.state, past: new Uint8Array(entry.state.past.length) };
    if (field.side === 0) return { ...entry, state: after };
    return { ...decoded({ ...after, splats: main.movedBy(after.splats, field) }, state), first: entry.first };
  }

  Object.assign(main, { Layers, decoded, amountsOf });
}
