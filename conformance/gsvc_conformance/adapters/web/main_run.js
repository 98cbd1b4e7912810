// Profile main, the entropy coder and the models: spec.md sections 15.6 and 15.11.
"use strict";
globalThis.GSVC ??= {};
{
  const { Fault, main } = GSVC;
  const { TOTAL } = main;
  const PRECISION = 14;
  const LOWEST_STATE = 2 ** 16;
  const GROUP_BITS = 5; // a group has 32 lanes

  const PARTS = [
    "cells", "luma", "chroma", "size", "aspect", "shear", "place", "motion", "modes", "position", "shape", "color",
  ];
  const LENGTH_UNIT = 2 ** 16; // the parts of a bit in which code lengths are added up
  const LENGTHS = Int32Array.from({ length: TOTAL + 1 }, (_, f) => Math.round(LENGTH_UNIT * (PRECISION - Math.log2(f))));

  /** How many low bits each magnitude has, by its class q. */
  function lowBitsOf(q) {
    const sizes = new Uint8Array(q.length);
    for (let i = 0; i < q.length; i++) sizes[i] = q[i] < 4 ? 0 : (q[i] >> 1) - 1;
    return sizes;
  }

  /** Magnitudes of classes q, and their low bits. */
  function magnitudesOf(q, low) {
    const magnitudes = new Int32Array(q.length);
    for (let i = 0; i < q.length; i++) {
      magnitudes[i] = q[i] < 4 ? q[i] : ((2 + (q[i] & 1)) << ((q[i] >> 1) - 1)) + low[i];
    }
    return magnitudes;
  }

  /** A sign for each magnitude that is not 0, by values that are 0 if and only if it is. */
  function signsOf(values) {
    const sizes = new Uint8Array(values.length);
    for (let i = 0; i < sizes.length; i++) sizes[i] = values[i] === 0 ? 0 : 1;
    return sizes;
  }

  /** Magnitudes become signed by signs, of which 1 is negative. */
  function sign(magnitudes, signs) {
    for (let i = 0; i < signs.length; i++) if (signs[i] === 1) magnitudes[i] = -magnitudes[i];
    return magnitudes;
  }

  /** Bits from the least significant one of the first byte on, each value with its least bit first; after the end, 0. */
  class RawBits {
    constructor(bytes) {
      this.bytes = bytes;
      this.at = 0; // the bit that comes next
    }

    /** Values of so many bits each, at most 25. */
    values(sizes) {
      const { bytes } = this;
      const found = new Int32Array(sizes.length);
      const safe = 8 * (bytes.length - 4); // up to this bit all of four bytes are there
      let { at } = this;
      for (let i = 0; i < sizes.length; i++) {
        const size = sizes[i];
        if (size === 0) continue;
        const byte = at >> 3;
        const word = at <= safe ? bytes[byte] | (bytes[byte + 1] << 8) | (bytes[byte + 2] << 16) | (bytes[byte + 3] << 24)
          : this.#last(byte);
        found[i] = (word >>> (at & 7)) & ((1 << size) - 1);
        at += size;
      }
      this.at = at;
      return found;
    }

    #last(byte) {
      let word = 0;
      for (let i = 0; i < 4 && byte + i < this.bytes.length; i++) word |= this.bytes[byte + i] << (8 * i);
      return word;
    }
  }

  /** How many bits values have that are `sizes` long. */
  const bitsOf = (sizes) => {
    let bits = 0;
    for (let i = 0; i < sizes.length; i++) bits += sizes[i];
    return bits;
  };

  /**
   * The run of the entropy coder of a frame: all that is left of its payload.
   *
   * Symbol i of a pass belongs to lane i modulo their number, and lane j to group j div 32, which has words of its own.
   * Raw bits stand after the words, from the last byte backwards: first the early ones, which passes depend on.
   * Loops over all splats have typed arrays and nothing that is made anew for each: a frame has up to 2^22 of them.
   */
  class Run {
    /**
     * @param {Object} bits gets the code lengths by part of the frame
     * @param {?number[]} noted gets c(s), f(s), pass and lane of each symbol, if somebody wants them
     */
    constructor(p, laneExponent, bits, noted = null) {
      Object.assign(this, { bits, noted, part: "" });
      this.stateBit = p.position();
      this.left = p.bitsLeft(); // bits of the run
      this.states = new Uint32Array(2 ** laneExponent);
      p.need(32 * this.states.length);
      for (let lane = 0; lane < this.states.length; lane++) {
        this.states[lane] = p.le(4);
        if (this.states[lane] < LOWEST_STATE) throw new Fault("R-6.6-5", p.element);
      }
      this.#readWords(p);
      this.symbol = 0; // of the pass, the one that comes next
      this.pass = 0;
      this.length = 0; // of the codes of the part so far, in parts of a bit
    }

    /** The word lists of all groups, and the bytes after them as bits, the last byte first. */
    #readWords(p) {
      const groups = Math.max(1, this.states.length >> GROUP_BITS);
      this.next = new Int32Array(groups); // of each group, the word that comes next
      this.ends = new Int32Array(groups); // and the one after its last
      let words = 0;
      for (let group = 0; group + 1 < groups; group++) {
        this.next[group] = words;
        words += p.uv();
        if (2 * words > p.bitsLeft() / 8) throw new Fault("R-15.6-5", p.element);
        this.ends[group] = words;
      }
      this.wordBit = p.position();
      const bytes = p.raw(p.bitsLeft() / 8);
      this.next[groups - 1] = words;
      this.ends[groups - 1] = bytes.length >> 1;
      this.words = new Uint16Array(bytes.length >> 1);
      for (let i = 0; i < this.words.length; i++) this.words[i] = bytes[2 * i] | (bytes[2 * i + 1] << 8);
      this.raw = new RawBits(bytes.slice().reverse());
    }

    /** What is read from now on belongs to this part of the frame. */
    begin(part) {
      if (this.length > 0) this.bits[this.part] = (this.bits[this.part] ?? 0) + this.length / LENGTH_UNIT;
      this.part = part;
      this.length = 0;
    }

    /**
     * All passes of the parts of a frame, which are generators that end each of theirs with a yield: pass t of the frame is
     * pass t of each part, one after the other. Gives what the parts return.
     */
    passes(parts) {
      const ends = parts.map(() => null);
      for (let left = parts.length; left > 0; ) {
        this.symbol = 0;
        this.pass += 1;
        parts.forEach((part, i) => {
          if (ends[i] !== null) return;
          const { done, value } = part.next();
          if (!done) return;
          ends[i] = value;
          left -= 1;
        });
      }
      return ends;
    }

    /** The slot of the next symbol of a pass. */
    #slot() {
      return this.states[this.symbol & (this.states.length - 1)] & (TOTAL - 1);
    }

    /** (7-1) of that symbol, which begins at the slot `lowest` and has a frequency. */
    #advance(slot, lowest, frequency) {
      const { states } = this;
      const lane = this.symbol++ & (states.length - 1);
      let x = (Math.imul(frequency, states[lane] >>> PRECISION) + slot - lowest) >>> 0; // below 2^32
      if (x < LOWEST_STATE) {
        const group = lane >> GROUP_BITS;
        const word = this.next[group]++;
        if (word === this.ends[group]) throw new Fault("R-7-1", this.wordBit);
        x = ((x << 16) | this.words[word]) >>> 0;
      }
      states[lane] = x;
      this.length += LENGTHS[frequency];
      if (this.noted !== null) this.noted.push(lowest, frequency, this.pass, lane);
    }

    /** The next symbol of a pass, whose cumulative frequencies are C. */
    #next(C) {
      const slot = this.#slot();
      let s = 0; // C[s] <= slot < C[end]
      for (let end = C.length - 1; end - s > 1; ) {
        const middle = (s + end) >> 1;
        if (C[middle] <= slot) s = middle;
        else end = middle;
      }
      this.#advance(slot, C[s], C[s + 1] - C[s]);
      return s;
    }

    /** Symbols of a pass: symbol i has the cumulative frequencies tables[which[i]]. */
    symbols(tables, which) {
      const found = new Int32Array(which.length);
      for (let i = 0; i < found.length; i++) found[i] = this.#next(tables[which[i]]);
      return found;
    }

    /** Early raw values of so many bits each, of what was read last. */
    early(sizes) {
      this.length += LENGTH_UNIT * bitsOf(sizes);
      return this.raw.values(sizes);
    }

    /**
     * A pass: of each part with so many splats, how many are in its first half.
     *
     * A half has `size` cells; `seconds` has how many of the second one are in the frame. Where there is none, all splats
     * are in the first half.
     */
    halves(counts, size, seconds, alpha) {
      const first = counts.slice();
      const lowBits = new Uint8Array(counts.length);
      const tables = []; // of (15-8), by the number of splats
      for (let i = 0; i < counts.length; i++) {
        if (seconds[i] <= 0) continue;
        if (main.isBetaBinomial(counts[i], size, seconds[i])) {
          first[i] = this.#next((tables[counts[i]] ??= main.betaBinomial(counts[i], alpha)));
        } else {
          const half = main.halfDensity(counts[i], size, seconds[i], alpha);
          lowBits[i] = half.lowBits;
          first[i] = this.#half(half) << half.lowBits;
        }
      }
      const low = this.early(lowBits);
      for (let i = 0; i < counts.length; i++) first[i] = Math.min(first[i] + low[i], counts[i]);
      return first;
    }

    /** The next symbol of a pass, of a density (15-9): of its up to 513 cumulative frequencies some ten are looked at. */
    #half(half) {
      const slot = this.#slot();
      let s = 0; // C[s] = lowest <= slot < C[end] = next
      let lowest = 0;
      let next = TOTAL;
      for (let end = half.m + 1; end - s > 1; ) {
        const middle = (s + end) >> 1;
        const C = main.cumulativeOfHalf(middle, half);
        if (C <= slot) {
          s = middle;
          lowest = C;
        } else {
          end = middle;
          next = C;
        }
      }
      this.#advance(slot, lowest, next - lowest);
      return s;
    }

    /** R-15.6-2, after the last symbol; then the late raw values, of which `late` has pairs of a part and sizes. */
    finish(late) {
      const lateBits = late.reduce((sum, [, sizes]) => sum + bitsOf(sizes), 0);
      const carried = Math.min(this.states.length, lateBits >> 4); // lanes whose end states have 16 of these bits
      this.#checkEnd(lateBits, carried);
      const bits = new RawBits(this.#lateBytes(carried));
      const values = late.map(([part, sizes]) => {
        this.begin(part);
        this.length = LENGTH_UNIT * bitsOf(sizes);
        return bits.values(sizes);
      });
      this.#divide();
      return values;
    }

    /** Divide the bits of the run among its parts: whole ones, in the order of `PARTS`, as long as there are some. */
    #divide() {
      this.begin("");
      for (const part of PARTS.filter((name) => name in this.bits)) {
        this.bits[part] = Math.min(Math.floor(this.bits[part]), this.left);
        this.left -= this.bits[part];
      }
    }

    #checkEnd(lateBits, carried) {
      const { next, ends, states, raw } = this;
      const last = next.length - 1;
      for (let group = 0; group < last; group++) if (next[group] < ends[group]) throw new Fault("R-7-1", this.wordBit);
      for (let lane = 0; lane < states.length; lane++) {
        const most = lane < carried ? 2 * LOWEST_STATE - 1 : LOWEST_STATE;
        if (states[lane] > most) throw new Fault("R-7-1", this.stateBit + 32 * lane);
      }
      const rawBits = raw.at + lateBits - 16 * carried;
      const size = Math.ceil(rawBits / 8);
      const rest = rawBits % 8 === 0 ? 0 : raw.bytes[size - 1] >> (rawBits % 8);
      if (2 * next[last] + size !== raw.bytes.length || rest !== 0) {
        throw new Fault("R-7-1", this.wordBit + 8 * (raw.bytes.length - 1));
      }
    }

    /** The late raw bits: those of the end states of so many lanes, then what follows the early ones. */
    #lateBytes(carried) {
      const { bytes, at } = this.raw;
      const shift = at & 7;
      const first = at >> 3;
      const late = new Uint8Array(2 * carried + bytes.length - first);
      for (let lane = 0; lane < carried; lane++) {
        late[2 * lane] = this.states[lane];
        late[2 * lane + 1] = this.states[lane] >> 8;
      }
      for (let from = first, to = 2 * carried; from < bytes.length; from++, to++) {
        late[to] = ((bytes[from] | (bytes[from + 1] << 8)) >> shift); // behind the last byte: 0
      }
      return late;
    }
  }

  /**
   * R-15.6-3: the lane states, the words of each group, and the bytes of raw bits with which a Run finds all again.
   *
   * `early` and `late` are raw values, with so many bits each.
   */
  function encodeRun({ starts, frequencies, lanes, laneCount, early, earlySizes, late, lateSizes }) {
    const lateString = stringOf(late, lateSizes);
    const carried = Math.min(laneCount, lateString.length >> 4);
    const states = Uint32Array.from({ length: laneCount }, (_, lane) =>
      (lane < carried ? numberOf(lateString.slice(16 * lane, 16 * lane + 16)) : 0) + LOWEST_STATE);
    const groups = Array.from({ length: Math.max(1, laneCount >> GROUP_BITS) }, () => []);
    for (let i = starts.length - 1; i >= 0; i--) {
      const f = frequencies[i];
      let x = states[lanes[i]];
      while (x >= f * 2 ** (32 - PRECISION)) {
        groups[lanes[i] >> GROUP_BITS].push(x & 0xffff);
        x >>>= 16;
      }
      states[lanes[i]] = Math.floor(x / f) * TOTAL + (x % f) + starts[i]; // (7-2)
    }
    const raw = [...stringOf(early, earlySizes), ...lateString.slice(16 * carried)];
    const tail = Uint8Array.from({ length: Math.ceil(raw.length / 8) }, (_, i) => numberOf(raw.slice(8 * i, 8 * i + 8)));
    return {
      laneStates: states,
      wordCounts: groups.map(({ length }) => length),
      words: Uint16Array.from(groups.flatMap((words) => words.reverse())),
      tail: tail.reverse(),
    };
  }

  /** The bits of values, the least one of each first. */
  const stringOf = (values, sizes) =>
    sizes.flatMap((size, i) => Array.from({ length: size }, (_, bit) => Math.floor(values[i] / 2 ** bit) % 2));

  const numberOf = (bits) => bits.reduceRight((number, bit) => 2 * number + bit, 0);

  const position = "432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2";
  const shape = "576, 320, 156, 72, 70, 28, 24, 10, 8, 3, 2";
  const color = ["736, 320, 96, 42, 32, 14, 14, 7, 5, 3, 2", "944, 224, 44, 18, 14, 6, 6, 3, 2, 2, 2"];
  const MODELS = { // the number of symbols, and the counts at the start of each context, less those that are 1
    vector: [24, [
      "736, 152, 76, 40, 52, 36, 44, 28, 36, 20, 20, 10, 8, 4, 3, 2, 2",
      "1024, 116, 36, 16, 16, 10, 12, 8, 10, 6, 6, 4, 3, 2",
      "500, 286, 116, 56, 62, 40, 50, 36, 44, 22, 28, 14, 10, 4, 2",
      "320, 148, 80, 56, 82, 68, 108, 74, 112, 68, 72, 36, 32, 10, 6, 2",
      "386, 102, 48, 44, 60, 50, 104, 66, 98, 80, 96, 54, 46, 18, 10, 5, 4",
    ]],
    mode: [9, [
      "1184, 20, 24, 10, 14, 6, 7, 9, 6",
      "1032, 52, 68, 32, 40, 11, 17, 22, 6",
      "752, 92, 116, 66, 96, 26, 52, 74, 6",
      "928, 68, 92, 46, 48, 14, 33, 45, 6",
      "736, 116, 146, 92, 70, 26, 46, 50, 6",
      "336, 97, 193, 176, 92, 48, 122, 216, 6",
      "944, 52, 79, 49, 44, 16, 33, 57, 6",
      "912, 53, 84, 54, 56, 18, 41, 58, 6",
      "784, 53, 87, 70, 66, 22, 54, 138, 6",
      "1056, 27, 62, 32, 24, 11, 20, 26, 22",
    ]],
    position: [24, [position, position, position, position]],
    shape: [24, [position, position, position, position, shape, shape, shape]],
    color: [24, ["264, 244, 228, 148, 152, 76, 72, 36, 24, 10, 8, 4", ...[0, 0, 0, 1, 1, 1].map((i) => color[i])]],
  };

  function countsOf([symbols, rows]) {
    return rows.map((row) => {
      const counts = new Uint32Array(symbols).fill(1);
      counts.set(row.split(", ").map(Number));
      return counts;
    });
  }

  /** The models at the start (R-15.11-1): by name, the counts of each context. Nothing changes one. */
  const FIRST_MODELS = Object.fromEntries(Object.entries(MODELS).map(([name, model]) => [name, countsOf(model)]));

  /** C of a context with such counts, whose sum is below 2^32 (15-14). */
  function frequenciesOf(counts) {
    const r = Math.max(0, main.bitLength(counts.reduce((sum, count) => sum + count, 0)) - 17);
    const scaled = counts.map((count) => count >>> r);
    const sum = scaled.reduce((all, count) => all + count, 0);
    const f = scaled.map((count) => 1 + (((TOTAL - counts.length) * count) / sum));
    const missing = f.reduce((left, frequency) => left - frequency, TOTAL);
    f[f.indexOf(f.reduce((most, frequency) => Math.max(most, frequency), 0))] += missing;
    const C = new Int32Array(counts.length + 1);
    f.forEach((frequency, s) => (C[s + 1] = C[s] + frequency));
    return C;
  }

  /** The counts of a context after a P-frame (15-11), `seen` being how often each symbol was decoded in it. */
  function adapted(counts, seen) {
    if (seen.every((times) => times === 0)) return counts;
    return counts.map((count, s) => count - ((count + 7) >>> 3) + 64 * seen[s]);
  }

  /** The models of a frame: they note what is read by them, and know what they are after it. */
  class FrameModels {
    constructor(models) {
      this.models = models;
      this.tables = {};
      this.seen = {};
      for (const [name, contexts] of Object.entries(models)) {
        this.tables[name] = contexts.map(frequenciesOf);
        this.seen[name] = contexts.map((counts) => new Uint32Array(counts.length));
      }
    }

    #note(name, contexts, symbols) {
      const seen = this.seen[name];
      for (let i = 0; i < symbols.length; i++) seen[contexts[i]][symbols[i]] += 1;
    }

    symbols(run, name, contexts) {
      const found = run.symbols(this.tables[name], contexts);
      this.#note(name, contexts, found);
      return found;
    }

    /** The models after the frame. */
    adapted() {
      const after = {};
      for (const [name, contexts] of Object.entries(this.models)) {
        after[name] = contexts.map((counts, context) => adapted(counts, this.seen[name][context]));
      }
      return after;
    }
  }

  Object.assign(main, {
    lowBitsOf, magnitudesOf, signsOf, sign, Run, encodeRun, FIRST_MODELS, frequenciesOf, adapted, FrameModels,
  });
}
