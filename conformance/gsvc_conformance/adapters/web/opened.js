"use strict";
// A stream that is read once, even while it grows or where it is damaged, and then seeks.
globalThis.GSVC ??= {};

{
  const { Fault, Bits, summary, readChunk, readStart, readFrames, waitingFrame, completeFrame, finished } = GSVC;
  const MAX_KEPT = 2 ** 26; // bytes of splats that a stream keeps to seek from
  const BEST = 3; // the highest layer that a stream can have
  const LONGEST_STEP = 30; // milliseconds for which a page may stand still
  const MOST_FAULTS = 20; // that are kept
  const SCANNED = 4096; // bytes that are looked at in a step
  const CUT = "R-6.2-4";

  /** States to go on from, of every `step`-th frame: as many as fit into `most` bytes. */
  class KeptStates {
    constructor(most) {
      this.most = most;
      this.step = 1;
      this.bytes = 0;
      this.states = new Map(); // by how many frames were read
    }

    add(count, state) {
      if (count % this.step !== 0) return;
      this.states.set(count, state.copy());
      this.bytes += state.byteLength;
      while (this.bytes > this.most && this.states.size > 1) this.thin(); // frame 0 stays
    }

    thin() {
      this.step *= 2;
      this.bytes = 0;
      for (const [count, state] of this.states) {
        if (count % this.step !== 0) this.states.delete(count);
        else this.bytes += state.byteLength;
      }
    }

    /** A state from which the frame at n can be reached, `next`: that of the I-frame or of the kept one that is nearest. */
    before(n, frames) {
      const count = n - (n % this.step);
      const state = this.states.get(count).copy();
      let next = n;
      while (next > count && frames[next].type !== "I") next--; // an I-frame forgets all else
      state.framesCounted = -1; // the limits of a second were checked when all was read
      return { state, next };
    }
  }

  /**
   * The reading of a stream, from its first byte to its last one.
   *
   * `append` gives it bytes, and each step of `steps()` takes it on. After a fault it ends, or it goes on as section 12.5
   * of spec.md says: with the frame that was due, else with the next I-frame.
   *
   * header: the elements of the sequence header by name; null as long as there is none.
   * frames: what `openStream` says; one after missing frames has their number as `missing`.
   * faults: those that were found, of which there are `faultCount`.
   * done: whether the end was reached; missingAtEnd: how many frames are missing there, null if nobody knows.
   */
  class StreamReading {
    constructor({ quality = BEST, mostKept = MAX_KEPT, salvage = false } = {}) {
      Object.assign(this, { quality, salvage, header: null, frames: [], faults: [], faultCount: 0 });
      Object.assign(this, { done: false, missingAtEnd: 0, size: 0, complete: false, lost: false });
      this.buffer = new Uint8Array(0);
      this.states = new KeptStates(mostKept);
      this.tried = -1; // the byte at which reading went on after a fault
      this.due = 0; // the number of the frame that was due there
      this.searchFrom = null; // where the search goes on for a chunk to go on with
    }

    get bytes() {
      return this.buffer.subarray(0, this.size);
    }

    /** More bytes; none come after those that are `complete`. Ones that are all there is are not copied. */
    append(piece, complete = false) {
      if (this.size === 0) {
        this.buffer = piece;
      } else {
        if (this.size + piece.length > this.buffer.length) {
          const larger = new Uint8Array(2 * (this.size + piece.length));
          larger.set(this.bytes);
          this.buffer = larger;
        }
        this.buffer.set(piece, this.size);
      }
      this.size += piece.length;
      this.complete = complete;
    }

    /** Reads as far as there are bytes; after each frame it yields how many were read. */
    *steps() {
      if (!this.start()) return;
      const { s, state } = this;
      while (!this.done) {
        s.data = this.bytes;
        try {
          if (this.searchFrom !== null && !(yield* this.#search())) break;
          for (const frame of readFrames(s, state)) {
            this.#add(frame);
            yield s.at / 8;
          }
          this.done = true;
        } catch (fault) {
          if (!(fault instanceof Fault)) throw fault;
          if (fault.rule === CUT && !this.complete) {
            s.at = state.chunkBit; // once more, when its end has come
            return;
          }
          this.#note(fault);
          if (!this.salvage) this.done = true;
          else this.#goOnBehind(fault);
        }
      }
      if (!this.done) return;
      for (const frame of waitingFrame(state)) this.#add(frame);
    }

    /** The prefix and the sequence header, before any frame is decoded; whether they are there and sound. */
    start() {
      if (this.header !== null || this.done) return this.header !== null;
      try {
        const { s, state } = readStart(this.bytes, this.quality);
        Object.assign(this, { s, state, header: state.header });
        if (this.header.points.length === 0) state.layers = null; // no chunk is one of a layer
        this.states.add(0, state);
        return true;
      } catch (fault) {
        if (!(fault instanceof Fault)) throw fault;
        const comes = fault.rule === CUT || (fault.rule === "R-6.1-1" && this.size < 8);
        if (comes && !this.complete) return false;
        this.#note(fault);
        this.done = true;
        return false;
      }
    }

    #add(frame) {
      const told = summary(frame);
      const missing = frame.number - ((this.frames.at(-1)?.number ?? -1) + 1);
      if (missing > 0) told.missing = missing;
      this.frames.push(told);
      this.states.add(this.frames.length, this.state);
    }

    #note({ kind, rule, bit, message }) {
      this.faultCount += 1;
      if (this.faults.length < MOST_FAULTS) this.faults.push({ kind, rule, bit, message });
    }

    // ---- behind a fault

    #goOnBehind({ isSound }) {
      const { s, state } = this;
      state.framesCounted = -1; // what is after a fault may come as fast as it likes
      if (isSound) {
        s.at = state.chunkBit;
        return;
      }
      this.searchFrom = state.chunkBit / 8;
      if (this.searchFrom === this.tried) state.nextNumber = this.due; // it was not gone on with
      if (state.layers) state.layers.damaged = true;
    }

    /** Go to a chunk that can be gone on with; whether there is one. */
    *#search() {
      const { state, bytes } = this;
      const chunks = new GSVC.WholeChunks(bytes, state.limits.payload);
      const due = state.nextNumber;
      let looked = 0;
      for (let at = this.searchFrom; at < bytes.length; ) {
        if (++looked % SCANNED === 0) yield at;
        const chunk = chunks.at(at);
        if (chunk === null) {
          const end = at === this.searchFrom ? (chunks.payload(at)?.end ?? Infinity) + 4 : Infinity;
          at = end === bytes.length || (end < bytes.length && chunks.at(end)) ? end : at + 1;
          continue;
        }
        const { type, begin, next } = chunk;
        const number = "IPR".includes(type) ? numberIn(bytes.subarray(begin, next - 4)) : null;
        const again = 8 * at === state.chunkBit; // this is the chunk at fault
        const wanted = number !== null && at !== this.tried && (!again || number > due) &&
          (type === "I" ? number >= due : number === due && !this.lost);
        const isOfWaiting = type === "n" && state.waiting !== null && !again && !this.lost; // another layer
        if (wanted || isOfWaiting) {
          this.#goOnAt(at, number ?? due);
          return true;
        }
        if (type === "E" && this.#endsWith(bytes.subarray(begin, next - 4))) return false;
        if (type === "H") {
          at = yield* this.#otherStream(chunks, next);
          continue;
        }
        if (/[A-Z]/.test(type) && !(number !== null && number < due)) this.lost = true;
        this.searchFrom = at = next;
      }
      if (this.complete) this.#breakOff();
      return false;
    }

    #goOnAt(at, number) {
      const { s, state } = this;
      Object.assign(this, { tried: at, due: state.nextNumber, lost: false, searchFrom: null });
      s.at = 8 * at;
      state.chunkBit = 8 * at;
      state.nextNumber = number;
      state.indexLength = 0;
    }

    /** After the end chunk of a stream whose header was found inside of this one. */
    *#otherStream(chunks, from) {
      let looked = 0;
      for (let at = from; at < chunks.bytes.length; ) {
        if (++looked % SCANNED === 0) yield at;
        const chunk = chunks.at(at);
        at = chunk?.next ?? at + 1;
        if (chunk?.type === "E") return at;
      }
      return chunks.bytes.length;
    }

    /** Whether an end chunk can be that of this stream: then all is read, and it tells what is missing. */
    #endsWith(payload) {
      if (payload.length !== 8) return false;
      const count = new DataView(payload.buffer, payload.byteOffset, 4).getUint32(0, true);
      const { nextNumber } = this.state;
      if (count < Math.max(nextNumber, 1)) return false;
      if (this.header.frame_count !== 0 && this.header.frame_count !== count) return false;
      Object.assign(this, { done: true, missingAtEnd: count - nextNumber, searchFrom: null });
      return true;
    }

    #breakOff() {
      const missing = this.header.frame_count - this.state.nextNumber;
      this.missingAtEnd = this.header.frame_count > 0 && missing >= 0 ? missing : null;
      this.done = true;
    }

    // ---- seeking

    /**
     * A function of n that gives the frame at n; going forwards reads each frame once.
     *
     * `steps(n)` decodes a frame a step up to n, and returns what the function gives; `distance(n)` is how many frames
     * have to be decoded for it.
     */
    seeker() {
      let current = null; // { state, next }: the state after the frame that was read last
      let last = null; // that frame, and where it stands
      const from = (n) => { // what to go on from
        if (!(n in this.frames)) throw new RangeError(`there is no frame ${n}`);
        const nearest = this.states.before(n, this.frames);
        return !current || current.next > n || current.next < nearest.next ? nearest : current;
      };
      const steps = function* (n) {
        while (last?.at !== n) {
          current = from(n); // again after each step: meanwhile somebody may have asked for another frame
          const at = current.next++;
          last = { at, frame: frameAgain(this.bytes, this.frames[at], current.state) };
          if (at !== n) yield at;
        }
        return { parameters: last.frame.parameters, origins: originsOf(last.frame) };
      }.bind(this);
      const distance = (n) => (last?.at === n ? 0 : n + 1 - from(n).next);
      return Object.assign((n) => finished(steps(n)), { steps, distance });
    }
  }

  /** The number of a frame whose payload has the right checksum and may be anything else; null if it has none. */
  function numberIn(payload) {
    try {
      return new Bits(payload).uv();
    } catch {
      return null;
    }
  }

  /** A frame that was read before, with its layers. */
  function frameAgain(bytes, told, state) {
    state.nextNumber = told.number;
    const frame = completeFrame(chunkOf(bytes, told), state);
    if (state.layers) state.layers.lost = told.lacking;
    for (const layer of told.layers) state.layers.read(chunkOf(bytes, layer), layer.byteLength, state);
    state.layers?.finish();
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
    const s = new Bits(bytes.subarray(byteOffset, byteOffset + byteLength), 8 * byteOffset, CUT);
    return readChunk(s, byteLength);
  }

  /** A reading that ends at the first fault, as the functions below give it. */
  function openedOf(reading) {
    const { header, frames, faults } = reading;
    return { header, frames, fault: faults[0] ?? null, frame: reading.seeker() };
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
   *     chunk; layers: layer, type, byteOffset, byteLength and coding of each chunk of one; carried, lacking: the layers
   *     that are there without a chunk, and those that damage has taken; size: the bytes of all these chunks; coding: null,
   *     or of profile main quantizer, step (D), lanes and motionCell (pixels, 0 for none); and
   *     planeBits: how many bits tell positions, cholesky, colors, other, of profile paper codebooks and survivors, of
   *     profile main motion, modes and densities.
   *   fault: null, or kind, rule, bit and message of the first fault; the frames are those before it.
   *   frame(n): parameters (Float32Array of 8 a splat), and origins (Int32Array: of each splat its index in the frame
   *     before, -1 if it is new). Do not change its arrays.
   */
  function openStream(bytes, mostKept = MAX_KEPT, quality = BEST) {
    const reading = new StreamReading({ mostKept, quality });
    reading.append(bytes, true);
    finished(reading.steps());
    return openedOf(reading);
  }

  /**
   * openStream for a page that must not freeze: every LONGEST_STEP it tells what part is read and lets it go on.
   *
   * A signal, an AbortSignal, may end it: the promise is rejected then.
   */
  async function openStreamInSteps(bytes, onProgress = () => {}, signal = null, quality = BEST) {
    const reading = new StreamReading({ quality });
    reading.append(bytes, true);
    await readInSteps(reading, onProgress, signal);
    return openedOf(reading);
  }

  /** Have a reading go as far as there are bytes, and let the page go on every LONGEST_STEP. */
  const readInSteps = (reading, onProgress = () => {}, signal = null) =>
    inSteps(reading.steps(), (at) => onProgress(at / reading.size), signal);

  /** The result of a generator of steps; every LONGEST_STEP it tells what that yields, and lets the page go on. */
  async function inSteps(steps, onProgress = () => {}, signal = null) {
    let rested = performance.now();
    for (;;) {
      const { done, value } = steps.next();
      if (done) return value;
      if (performance.now() - rested < LONGEST_STEP) continue;
      onProgress(value);
      await new Promise((resolve) => setTimeout(resolve));
      signal?.throwIfAborted();
      rested = performance.now();
    }
  }

  Object.assign(GSVC, { LONGEST_STEP, StreamReading, openStream, openStreamInSteps, readInSteps, inSteps });
}
