// Whole streams: the order of checks (spec.md section 12.2), frame by frame, and a stream that seeks.
"use strict";
globalThis.GSVC ??= {};
{
  const { Fault, Bits, LEVELS, LONGEST_HEADER, MAIN, readPrefix, readChunk, readSequenceHeader, main } = GSVC;
  const { readFrame, readFrameHead } = GSVC;
  const { checkIndex, checkEnd, checkSecond, reconstructIntra, reconstructInter, renderingWork, parameterChecksum } = GSVC;
  const MAX_KEPT = 2 ** 26; // bytes of splats that a stream keeps to seek from
  const BEST = 3; // the highest layer that a stream can have
  const LONGEST_STEP = 30; // milliseconds for which a page may stand still

  /** What a decoder carries from chunk to chunk. */
  class State {
    constructor(header) {
      this.header = header;
      this.limits = LEVELS[header.level];
      this.nextNumber = 0;
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
        const chunk = readChunk(s, state.limits.payload);
        const { bit, payload } = chunk;
        type = chunk.type;
        checkKnown(type, bit);
        checkMayStand(type, bit, state);
        if ("IPRE".includes(type) && waiting !== null) {
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
      if (waiting !== null) yield waiting;
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
    if (!parameters.every(Number.isFinite)) throw new Fault("R-8-1", bit);
    const work = renderingWork(parameters, width, height);
    if (work > state.limits.work) throw new Fault("R-5-4", bit);
    if (frame.checksum !== null && frame.checksum !== parameterChecksum(parameters)) {
      throw new Fault("R-6.4-3", frame.checksumBit);
    }
    state.parameters = frame.parameters = parameters;
    frame.parts[0].count = parameters.length / 8;
    if (profile === MAIN) state.main = frame.after;
    if (state.header.flags & 2 && frame.number === state.framesCounted) checkSecond(frame, work, bit, state);
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
    const parameters = new Float32Array(old.length + added.length);
    parameters.set(old);
    parameters.set(added, old.length);
    return parameters;
  }

  /** States to go on from, of every `step`-th frame: as many as fit into `most` bytes. */
  class KeptStates {
    constructor(most) {
      this.most = most;
      this.step = 1;
      this.bytes = 0;
      this.states = new Map(); // by the number of the next frame
    }

    add(state) {
      if (state.nextNumber % this.step !== 0) return;
      this.states.set(state.nextNumber, state.copy());
      this.bytes += state.byteLength;
      while (this.bytes > this.most && this.states.size > 1) this.thin(); // frame 0 stays
    }

    thin() {
      this.step *= 2;
      this.bytes = 0;
      for (const [number, state] of this.states) {
        if (number % this.step !== 0) this.states.delete(number);
        else this.bytes += state.byteLength;
      }
    }

    /** A state from which frame n can be reached: that of the I-frame or of the kept state that is nearest. */
    before(n, frames) {
      const kept = this.states.get(n - (n % this.step)).copy();
      for (let at = n; at > kept.nextNumber; at--) {
        if (frames[at].type === "I") kept.nextNumber = at; // it forgets all else
      }
      kept.framesCounted = -1; // the limits of a second were checked when all was read
      return kept;
    }
  }

  const PLANES = { // of profile main: the parts of a run that are about the same, by the names that those of paper have
    positions: ["cells", "place", "position"],
    cholesky: ["size", "aspect", "shear", "shape"],
    colors: ["luma", "chroma", "color"],
    motion: ["motion"],
    modes: ["modes"],
    densities: ["densities"],
  };

  /** The bits of a body by `PLANES`; what is no whole bit of a part is left to what is not listed. */
  const planesOf = (bits) => Object.fromEntries(Object.entries(PLANES).map(([plane, parts]) =>
    [plane, parts.reduce((sum, part) => sum + Math.floor(bits[part] ?? 0), 0)]));

  /** What the body of a frame of profile main, or of a layer of one, says of all its splats. */
  const codingOf = ({ quantizer, lane_exponent: laneExponent, motion_cell: motionCell }) =>
    ({ quantizer, step: main.stepOf(quantizer) / 16, lanes: 2 ** laneExponent, motionCell: main.SIDES[motionCell] });

  /** What the list of frames tells of one; bits are those of its chunks, `other` being all that is not listed. */
  function summary({ type, number, byteOffset, byteLength, parameters, parts, chunks = [], bits, body = null }) {
    const splatCount = parameters.length / 8;
    const newCount = parts.reduce((sum, part) => sum + part.newCount, 0);
    const survivorCount = splatCount - newCount;
    const size = chunks.reduce((sum, chunk) => sum + chunk.byteLength, byteLength);
    const bodies = [body, ...chunks.map((chunk) => chunk.body)].filter(Boolean);
    const planeBits = { ...bits };
    for (const told of bodies) {
      for (const [plane, count] of Object.entries(planesOf(told.bits))) {
        planeBits[plane] = (planeBits[plane] ?? 0) + count;
      }
    }
    planeBits.other = Object.values(planeBits).reduce((left, part) => left - part, 8 * size);
    const layers = chunks.map((chunk) => ({
      layer: chunk.layer, type: chunk.type, byteOffset: chunk.byteOffset, byteLength: chunk.byteLength,
      coding: chunk.body && codingOf(chunk.body),
    }));
    const coding = body && codingOf(body);
    return {
      number, type, splatCount, newCount, survivorCount, byteOffset, byteLength, size, layers, coding, planeBits,
    };
  }

  /** Reads a stream to its first fault or its end; after each frame it yields how many bytes were read. */
  function* reading(bytes, mostKept, quality) {
    const frames = [];
    const states = new KeptStates(mostKept);
    let header = null;
    let fault = null;
    try {
      const { s, state } = readStart(bytes);
      header = state.header;
      if (quality > 0 && header.layer_count > 1) state.layers = new main.Layers(quality);
      states.add(state);
      for (const frame of readFrames(s, state)) {
        frames.push(summary(frame));
        states.add(state);
        yield s.at / 8;
      }
    } catch (error) {
      if (!(error instanceof Fault)) throw error;
      fault = { kind: error.kind, rule: error.rule, bit: error.bit, message: error.message };
    }
    return { header, frames, fault, frame: seeker(bytes, frames, states) };
  }

  /**
   * Reads a stream from its first to its last byte.
   *
   * @param {Uint8Array} bytes
   * @param {number} mostKept how many bytes of splats may be kept to seek from
   * @param {number} quality the highest layer that is wanted, of a stream with layers; 0 is the base
   * @returns {{header: ?Object, frames: Object[], fault: ?Object, frame: function(number): Object}}
   *   header: the elements of the sequence header by name, or null if it is at fault.
   *   frames: of each complete frame number, type, splatCount, newCount, survivorCount; byteOffset and byteLength of its
   *     chunk; layers: layer, type, byteOffset, byteLength and coding of each chunk of one; size: the bytes of all these
   *     chunks; coding: null, or of profile main quantizer, step (D), lanes and motionCell (pixels, 0 for none); and
   *     planeBits: how many bits tell positions, cholesky, colors, other, of profile paper codebooks and survivors, of
   *     profile main motion, modes and densities.
   *   fault: null, or kind, rule, bit and message of the first fault; the frames are those before it.
   *   frame(n): parameters (Float32Array of 8 a splat), and origins (Int32Array: of each splat its index in the frame
   *     before, -1 if it is new). Do not change its arrays.
   */
  function openStream(bytes, mostKept = MAX_KEPT, quality = BEST) {
    const steps = reading(bytes, mostKept, quality);
    for (;;) {
      const { done, value } = steps.next();
      if (done) return value;
    }
  }

  /**
   * openStream for a page that must not freeze: every LONGEST_STEP it tells what part is read and lets it go on.
   *
   * A signal, an AbortSignal, may end it: the promise is rejected then.
   */
  async function openStreamInSteps(bytes, onProgress = () => {}, signal = null, quality = BEST) {
    const steps = reading(bytes, MAX_KEPT, quality);
    let rested = performance.now();
    for (;;) {
      const { done, value } = steps.next();
      if (done) return value;
      if (performance.now() - rested < LONGEST_STEP) continue;
      onProgress(value / bytes.length);
      await new Promise((resolve) => setTimeout(resolve));
      signal?.throwIfAborted();
      rested = performance.now();
    }
  }

  /** frame(n) of a stream that was read once; going forwards reads each frame once. */
  function seeker(bytes, frames, states) {
    let current = null; // the state behind the frame that was read last
    let last = null; // that frame
    return (n) => {
      if (!(n in frames)) throw new RangeError(`there is no frame ${n}`);
      if (last === null || last.number !== n) {
        const nearest = states.before(n, frames);
        if (!current || current.nextNumber > n || current.nextNumber < nearest.nextNumber) current = nearest;
        while (current.nextNumber <= n) last = frameAgain(bytes, frames[current.nextNumber], current);
      }
      return { parameters: last.parameters, origins: originsOf(last) };
    };
  }

  /** A frame that was read before, with its layers. */
  function frameAgain(bytes, told, state) {
    const frame = completeFrame(chunkOf(bytes, told), state);
    for (const layer of told.layers) state.layers.read(chunkOf(bytes, layer), layer.byteLength, state);
    return frame;
  }

  /** For each splat of a frame its index in the frame before; -1 if it is new. */
  function originsOf({ parameters, parts }) {
    const origins = new Int32Array(parameters.length / 8).fill(-1);
    let begin = 0;
    for (const { type, survivors, first, count } of parts) {
      let at = begin;
      if (type === "R") while (at < begin + count) origins[at] = first + at++ - begin;
      survivors?.forEach((stays, n) => stays && (origins[at++] = first + n));
      begin += count;
    }
    return origins;
  }

  function chunkOf(bytes, { byteOffset, byteLength }) {
    const s = new Bits(bytes.subarray(byteOffset, byteOffset + byteLength), 8 * byteOffset, "R-6.2-4");
    return readChunk(s, byteLength);
  }

  Object.assign(GSVC, { readStart, readFrames, framesBetween, framesWithLayers, openStream, openStreamInSteps });
}
