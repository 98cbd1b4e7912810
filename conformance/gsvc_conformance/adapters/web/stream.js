// Whole streams: the order of checks (spec.md section 12.2), frame by frame. opened.js has a stream that seeks.
"use strict";
globalThis.GSVC ??= {};
{
  const { Fault, LEVELS, LONGEST_HEADER, MAIN, readPrefix, readChunk, readSequenceHeader, main } = GSVC;
  const { readFrame, readFrameHead } = GSVC;
  const { checkIndex, checkEnd, checkLimit, checkSecond, addToSecond, reconstructIntra, reconstructInter } = GSVC;
  const { areFinite, renderingWork, parameterChecksum } = GSVC;
  const LAYERS = 0b1110; // bits of `layer_mask`

  /** What a decoder carries from chunk to chunk. */
  class State {
    /** @param {number} quality that is wanted of a stream with layers, 0 being the base */
    constructor(header, quality = 0) {
      this.header = header;
      this.limits = LEVELS[header.level];
      this.point = pointOf(header, quality); // the operating point, or null where the level says all
      this.layers = quality > 0 && header.profile === MAIN ? new main.Layers(quality) : null;
      this.waiting = null; // a frame that may get layers
      this.noted = null; // gets all symbols of profile main, as Run says, if somebody wants them
      this.nextNumber = 0;
      this.chunkBit = 0; // where the chunk that is read begins: a fault is about it
      this.indexLength = 0; // bytes of the chunk directly before, if it is an index
      this.framesCounted = 0; // how many frames have been decoded from the first one on
      this.second = {}; // sums of the second so far
      this.bytesWaiting = 0; // bytes of the chunks after the frame before
      this.lastIFrame = 0; // its number
      this.main = main.newMainState(); // what profile main carries
      this.forget();
    }

    /** What an I-frame of profile paper begins with: no splats, nothing kept. */
    forget() {
      this.parameters = new Float32Array(0);
      this.work = this.pointWork = 0; // of these splats, in pairs
      this.checksum = null; // and their checksum, if the stream has some
      this.kept = { intra: {}, inter: {} };
    }

    /** About how many bytes it takes to keep. */
    get byteLength() {
      const { parameters, main: { splats, past } } = this;
      return parameters.byteLength + splats.byteLength + past.byteLength + (this.layers?.byteLength ?? 0) + 2 ** 13;
    }

    /** A state that goes on from here; arrays are shared, since nothing ever changes one. */
    copy() {
      const copy = Object.assign(Object.create(State.prototype), this);
      copy.kept = { intra: { ...this.kept.intra }, inter: { ...this.kept.inter } };
      copy.layers = this.layers?.copy() ?? null;
      copy.waiting = null;
      return copy;
    }
  }

  /** What a quality is decoded at: its limits, and how often pictures are halved in size; null where `level` says all. */
  function pointOf({ points, level }, quality) {
    if (points.length === 0) return null;
    const point = points[Math.min(quality, points.length - 1)];
    return point.level === level && point.halvings === 0 ? null : { ...point, limits: LEVELS[point.level] };
  }

  /** Reads all that precedes the first frame: the bits after it, and the state for a quality. */
  function readStart(stream, quality = 0) {
    const { s, versionMinor } = readPrefix(stream);
    const { type, bit, payload } = readChunk(s, LONGEST_HEADER);
    checkKnown(type, bit);
    if (type !== "H") throw new Fault("R-6.1-3", bit);
    const header = readSequenceHeader(payload);
    if (versionMinor === 0) payload.checkFilled();
    return { s, state: new State(header, quality) };
  }

  function checkKnown(type, bit) {
    if (/[A-Z]/.test(type) && !"HIPRE".includes(type)) throw new Fault("R-3.2-1", bit);
  }

  function checkMayStand(type, bit, state) {
    if (type === "H") throw new Fault("R-6.1-3", bit);
    if (state.nextNumber === 0 && type === "E") throw new Fault("R-6.1-5", bit);
    if (state.nextNumber === 0 && "PR".includes(type)) throw new Fault("R-6.4-2", bit);
  }

  /**
   * Yields each complete frame, with `parameters`, to the end of the stream; throws the first Fault.
   *
   * Where layers are wanted, a frame comes with the last of those that it names; one that gets more is `state.waiting`.
   */
  function* readFrames(s, state) {
    const { layers, limits, point } = state;
    for (let type = "H"; type !== "E"; ) {
      state.chunkBit = s.position();
      const chunk = readChunk(s, limits.payload, { longestFrame: (point ?? state).limits.payload });
      const { bit, payload } = chunk;
      const size = (s.position() - bit) / 8;
      type = chunk.type;
      checkKnown(type, bit);
      checkMayStand(type, bit, state);
      if ("IPRE".includes(type) && state.waiting !== null) {
        layers.checkMissing(bit);
        yield* waitingFrame(state);
      }
      if (type === "E") {
        checkEnd(payload, state);
        payload.checkFilled();
      }
      state.indexLength = 0;
      if (type === "x") {
        checkIndex(payload, bit / 8);
        payload.checkFilled();
        state.indexLength = size;
      }
      state.bytesWaiting += size;
      if (type === "n" && state.nextNumber > 0) {
        if (layers !== null) layers.read(chunk, size, state);
        else if (state.header.points.length > 0) addToSecond({}, bit, state);
      }
      if ("IPR".includes(type)) {
        const frame = completeFrame(chunk, state);
        frame.byteOffset = bit / 8;
        frame.byteLength = size;
        if (layers === null) yield frame;
        else state.waiting = frame;
      }
      if (layers?.isComplete) yield* waitingFrame(state);
    }
    if (s.bitsLeft() > 0) throw new Fault("R-6.1-4", s.position());
  }

  /** Yields the frame that waits for layers, if one does, with those that it has. */
  function* waitingFrame(state) {
    const frame = state.waiting;
    if (frame === null) return;
    state.waiting = null;
    state.layers.finish();
    yield frame;
  }

  /** Hops over a chunk, of which only type and length are looked at (section 12.6); its type. */
  function hop(s, state) {
    const { type, bit } = readChunk(s, state.limits.payload, { compareCrc: false });
    checkKnown(type, bit);
    checkMayStand(type, bit, state);
    if ("IPR".includes(type)) state.nextNumber += 1;
    if (type !== "E") state.indexLength = type === "x" ? (s.position() - bit) / 8 : 0; // E says how long that is
    return type;
  }

  /** Goes to the last I-frame at or before frame `first`, or to the end chunk if there are fewer frames. */
  function find(s, state, first) {
    let place = null;
    for (let type = "H"; state.nextNumber <= first && type !== "E"; ) {
      const here = [s.at, state.nextNumber];
      type = hop(s, state);
      if ("IE".includes(type)) place = here;
    }
    [s.at, state.nextNumber] = place;
    state.framesCounted = -1; // the sums of a second are not known
  }

  /** Yields the frames `first` to `last`, as far as there are such; throws the first Fault on the way. */
  function* framesBetween(stream, first, last) {
    const { s, state } = readStart(stream);
    if (first > 0) find(s, state, first);
    for (const frame of readFrames(s, state)) {
      if (frame.number >= first) yield frame;
      if (frame.number === last) return;
    }
  }

  /** Yields all frames of a stream in the quality of a layer. */
  function* framesWithLayers(stream, quality) {
    const { s, state } = readStart(stream, quality);
    try {
      yield* readFrames(s, state);
    } catch (fault) {
      yield* waitingFrame(state);
      throw fault;
    }
  }

  function completeFrame({ type, bit, payload }, state) {
    const { header, layers } = state;
    const isMain = header.profile === MAIN;
    const frame = isMain ? readMainFrame(payload, type, state) : readFrame(payload, type, state);
    payload.checkFilled();
    const isRepeated = type === "R";
    const { parameters, work, pointWork } = isRepeated ? state : isMain ? main.decoded(frame.after, state)
      : reconstructed(frame, bit, state);
    const base = { parameters, work, pointWork };
    const behind = layers?.behind(frame, state);
    const shown = [base, ...(behind?.there.values() ?? [])].map(main.amountsOf);
    const amounts = shown.reduce((all, one) =>
      ({ splats: all.splats + one.splats, work: all.work + one.work, pointWork: all.pointWork + one.pointWork }));
    if (isMain) checkLimit("R-5-2", "splats", bit, state, amounts.splats); // with layers that are carried
    checkLimit("R-5-4", "work", bit, state, amounts.work, amounts.pointWork);
    const checksum = frame.checksum === null ? null : isRepeated ? state.checksum : parameterChecksum(parameters);
    if (frame.checksum !== checksum) throw new Fault("R-6.4-3", frame.checksumBit);
    Object.assign(frame, base);
    frame.parts[0].count = parameters.length / 8;
    checkSecond(frame, amounts, bit, state);
    Object.assign(state, base, { checksum });
    if (isMain) state.main = frame.after;
    state.nextNumber += 1;
    layers?.begin(frame, behind, base, state);
    return frame;
  }

  /** main_frame(): what a frame of profile main says; `body` as main.readBody returns it, or null. */
  function readMainFrame(p, type, state) {
    const frame = readFrameHead(p, type, state);
    frame.mask = state.header.points.length > 0 ? p.le(1) : 0;
    if (frame.mask & ~LAYERS) throw new Fault("R-3.2-1", p.element);
    const isRepeated = type === "R";
    frame.body = isRepeated ? null : main.readBody(p, type, state.main, state);
    frame.after = isRepeated ? state.main : frame.body.after;
    frame.parts = [{ ...main.toldOf(type, frame.body), first: 0 }];
    return frame;
  }

  /** Parameters and work of a frame of profile paper. */
  function reconstructed(frame, bit, state) {
    const parameters = reconstructFrame(frame, state);
    if (!areFinite(parameters)) throw new Fault("R-8-1", bit);
    const work = renderingWork(parameters, state.header.width, state.header.height);
    return { parameters, work, pointWork: work };
  }

  /** The parameters (N, 8) of a frame: survivors first, then new splats. */
  function reconstructFrame(frame, { parameters: reference, header: { width, height } }) {
    const none = new Float32Array(0);
    const old = frame.inter ? reconstructInter(width, height, reference, frame.survivors, frame.inter) : none;
    const added = frame.intra ? reconstructIntra(width, height, frame.intra) : none;
    if (old.length === 0 || added.length === 0) return old.length === 0 ? added : old;
    const parameters = new Float32Array(old.length + added.length);
    parameters.set(old);
    parameters.set(added, old.length);
    return parameters;
  }

  Object.assign(GSVC, { readStart, readFrames, waitingFrame, completeFrame, framesBetween, framesWithLayers });
}
