// Whole streams: the order of checks (spec.md section 12.2), frame by frame. opened.js has a stream that seeks.
"use strict";
globalThis.GSVC ??= {};
{
  const { Fault, LEVELS, LONGEST_HEADER, MAIN, readPrefix, readChunk, readSequenceHeader, main } = GSVC;
  const { readFrame, readFrameHead } = GSVC;
  const { checkIndex, checkEnd, checkSecond, reconstructIntra, reconstructInter } = GSVC;
  const { areFinite, renderingWork, parameterChecksum } = GSVC;

  /** What a decoder carries from chunk to chunk. */
  class State {
    constructor(header) {
      this.header = header;
      this.limits = LEVELS[header.level];
      this.nextNumber = 0;
      this.chunkBit = 0; // where the chunk that is read begins: a fault is about it
      this.indexLength = 0; // bytes of the chunk directly before, if it is an index
      this.framesCounted = 0; // how many frames have been decoded from the first one on
      this.second = {}; // sums of the second so far
      this.bytesWaiting = 0; // bytes of the chunks behind the frame before
      this.lastIFrame = 0; // its number
      this.main = main.newMainState(); // what profile main carries
      this.layers = null; // the Layers of profile main, if layers are wanted
      this.forget();
    }

    /** What an I-frame of profile paper begins with: no splats, nothing kept. */
    forget() {
      this.parameters = new Float32Array(0);
      this.work = 0; // of these splats, in pairs
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
      return copy;
    }
  }

  /** Reads all that precedes the first frame: the bits behind it, and the state. */
  function readStart(stream) {
    const { s, versionMinor } = readPrefix(stream);
    const { type, bit, payload } = readChunk(s, LONGEST_HEADER);
    checkKnown(type, bit);
    if (type !== "H") throw new Fault("R-6.1-3", bit);
    const header = readSequenceHeader(payload);
    if (versionMinor === 0) payload.checkFilled();
    return { s, state: new State(header) };
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
   * Where layers are wanted, a frame comes as soon as it is sure that no more layers of it do.
   */
  function* readFrames(s, state) {
    let waiting = null; // a frame that may get layers
    try {
      for (let type = "H"; type !== "E"; ) {
        state.chunkBit = s.position();
        const chunk = readChunk(s, state.limits.payload);
        const { bit, payload } = chunk;
        type = chunk.type;
        checkKnown(type, bit);
        checkMayStand(type, bit, state);
        if ("IPRE".includes(type) && waiting !== null) {
          state.layers.finish();
          yield waiting;
          waiting = null;
        }
        state.bytesWaiting += (s.position() - bit) / 8;
        if (type === "E") {
          checkEnd(payload, state);
          payload.checkFilled();
        }
        state.indexLength = 0;
        if (type === "x") {
          checkIndex(payload, bit / 8);
          payload.checkFilled();
          state.indexLength = (s.position() - bit) / 8;
        }
        if (type === "n" && waiting !== null) state.layers.read(chunk, (s.position() - bit) / 8, state);
        if ("IPR".includes(type)) {
          const frame = completeFrame(chunk, state);
          frame.byteOffset = bit / 8;
          frame.byteLength = (s.position() - bit) / 8;
          if (state.layers === null) yield frame;
          else waiting = frame;
        }
      }
      if (s.bitsLeft() > 0) throw new Fault("R-6.1-4", s.position());
    } catch (fault) {
      if (waiting !== null) {
        state.layers.finish();
        yield waiting;
      }
      throw fault;
    }
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
    const { s, state } = readStart(stream);
    if (state.header.profile === MAIN) state.layers = new main.Layers(quality);
    yield* readFrames(s, state);
  }

  function completeFrame({ type, bit, payload }, state) {
    const { width, height, profile } = state.header;
    const frame = profile === MAIN ? readMainFrame(payload, type, state) : readFrame(payload, type, state);
    payload.checkFilled();
    const parameters = profile === MAIN ? mainParameters(frame, state) : reconstructFrame(frame, state);
    const isKnown = parameters === state.parameters; // an R-frame has the splats of the frame before
    if (!isKnown && !areFinite(parameters)) throw new Fault("R-8-1", bit);
    const work = isKnown ? state.work : renderingWork(parameters, width, height);
    if (work > state.limits.work) throw new Fault("R-5-4", bit);
    const checksum = frame.checksum === null ? null : isKnown ? state.checksum : parameterChecksum(parameters);
    if (frame.checksum !== checksum) throw new Fault("R-6.4-3", frame.checksumBit);
    Object.assign(frame, { parameters, work });
    frame.parts[0].count = parameters.length / 8;
    if (state.header.flags & 2 && frame.number === state.framesCounted) checkSecond(frame, work, bit, state);
    Object.assign(state, { parameters, work, checksum });
    if (profile === MAIN) state.main = frame.after;
    state.nextNumber += 1;
    state.layers?.begin(frame);
    return frame;
  }

  /** main_frame(): what a frame of profile main says; `body` as main.readBody returns it, or null. */
  function readMainFrame(p, type, state) {
    const frame = readFrameHead(p, type, state);
    const isRepeated = type === "R";
    frame.body = isRepeated ? null : main.readBody(p, type, state.main, state.header, state.limits.splats);
    frame.after = isRepeated ? state.main : frame.body.after;
    frame.parts = [{ ...main.toldOf(type, frame.body), first: 0 }];
    return frame;
  }

  const mainParameters = ({ type, after }, { parameters }) =>
    (type === "R" ? parameters : main.stateParameters(after.splats));

  /** The parameters (N, 8) of a frame: survivors first, then new splats. */
  function reconstructFrame(frame, { parameters: reference, header: { width, height } }) {
    if (frame.type === "R") return reference;
    const none = new Float32Array(0);
    const old = frame.inter ? reconstructInter(width, height, reference, frame.survivors, frame.inter) : none;
    const added = frame.intra ? reconstructIntra(width, height, frame.intra) : none;
    if (old.length === 0 || added.length === 0) return old.length === 0 ? added : old;
    const parameters = new Float32Array(old.length + added.length);
    parameters.set(old);
    parameters.set(added, old.length);
    return parameters;
  }

  Object.assign(GSVC, { readStart, readFrames, completeFrame, framesBetween, framesWithLayers });
}
