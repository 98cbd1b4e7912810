// Profile main, the entropy coder and the models: spec.md sections 15.6 and 15.11.
"use strict";
globalThis.GSVC ??= {};
{
  const { Fault, main } = GSVC;
  const { TOTAL } = main;
  const PRECISION = 14;
  const LOWEST_STATE = 2 ** 16;

  const LENGTH_UNIT = 2 ** 16; // the parts of a bit in which code lengths are added up
  const LENGTHS = Int32Array.from({ length: TOTAL + 1 }, (_, f) => Math.round(LENGTH_UNIT * (PRECISION - Math.log2(f))));

  /** How many low bits a class of magnitudes has. */
  const lowBitsOf = (q) => (q < 4 ? 0 : (q >> 1) - 1);

  /**
   * The run of the entropy coder of a frame: all that is left of its payload.
   *
   * Loops over all splats have typed arrays and nothing that is made anew for each: a frame has up to 2^22 of them.
   */
  class Run {
    /** @param {Object} bits gets the code lengths by part of the frame */
    constructor(p, laneExponent, bits) {
      this.bits = bits;
      this.part = "";
      this.stateBit = p.position();
      this.states = new Uint32Array(2 ** laneExponent);
      p.need(32 * this.states.length);
      for (let lane = 0; lane < this.states.length; lane++) {
        this.states[lane] = p.le(4);
        if (this.states[lane] < LOWEST_STATE) throw new Fault("R-6.6-5", p.element);
      }
      this.wordBit = p.position();
      const bytes = p.raw(2 * Math.floor(p.bitsLeft() / 16));
      this.words = new Uint16Array(bytes.length / 2);
      for (let i = 0; i < this.words.length; i++) this.words[i] = bytes[2 * i] + 256 * bytes[2 * i + 1];
      this.taken = 0;
      this.symbol = 0; // of the pass, the one that comes next
      this.length = 0; // of the codes of the part so far, in parts of a bit
    }

    /** What is read from now on belongs to this part of the frame. */
    begin(part) {
      if (this.length > 0) this.bits[this.part] = (this.bits[this.part] ?? 0) + this.length / LENGTH_UNIT;
      this.part = part;
      this.length = 0;
    }

    /** The slot of the next symbol of a pass: symbol i belongs to lane i modulo their number. */
    #slot() {
      return this.states[this.symbol & (this.states.length - 1)] & (TOTAL - 1);
    }

    /** (7-1) of that symbol, which begins at the slot `lowest` and has a frequency. */
    #advance(slot, lowest, frequency) {
      const { states, words } = this;
      const lane = this.symbol++ & (states.length - 1);
      let x = (Math.imul(frequency, states[lane] >>> PRECISION) + slot - lowest) >>> 0; // below 2^32
      if (x < LOWEST_STATE) {
        if (this.taken === words.length) throw new Fault("R-7-1", this.wordBit);
        x = ((x << 16) | words[this.taken++]) >>> 0;
      }
      states[lane] = x;
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
      const frequency = C[s + 1] - C[s];
      this.#advance(slot, C[s], frequency);
      this.length += LENGTHS[frequency];
      return s;
    }

    /** A pass: symbol i has the cumulative frequencies tables[which[i]]. */
    symbols(tables, which) {
      const found = new Int32Array(which.length);
      this.symbol = 0;
      for (let i = 0; i < found.length; i++) found[i] = this.#next(tables[which[i]]);
      return found;
    }

    /**
     * Two passes: of each part with so many splats, how many are in its first half.
     *
     * A half has `size` cells; `seconds` has how many of the second one are in the frame. Where there is none, all splats
     * are in the first half.
     */
    halves(counts, size, seconds, alpha) {
      const first = counts.slice();
      const lowBits = new Uint8Array(counts.length);
      const tables = []; // of (15-8), by the number of splats
      this.symbol = 0;
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
      const low = this.rawBits(lowBits);
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
      this.length += LENGTHS[next - lowest];
      return s;
    }

    /** Values of so many raw bits each, at most 28: two passes where one of them has more than 14. */
    rawBits(sizes) {
      const found = new Int32Array(sizes.length);
      let most = 0;
      for (let i = 0; i < sizes.length; i++) most = Math.max(most, sizes[i]);
      if (most > PRECISION) this.#uniform(sizes, PRECISION, found);
      if (most > 0) this.#uniform(sizes, 0, found);
      return found;
    }

    /** A pass of the bits above the lowest `left` ones, at most 14 of each; a value without such bits has no symbol. */
    #uniform(sizes, left, found) {
      this.symbol = 0;
      for (let i = 0; i < sizes.length; i++) {
        const size = Math.min(sizes[i] - left, PRECISION);
        if (size <= 0) continue;
        const slot = this.#slot();
        const value = slot >> (PRECISION - size);
        this.#advance(slot, value << (PRECISION - size), TOTAL >> size);
        found[i] = (found[i] << size) | value;
        this.length += size * LENGTH_UNIT;
      }
    }

    /** Magnitudes: a pass of their classes q, as in `symbols`, and those of low bits. */
    magnitudes(tables, which) {
      const q = this.symbols(tables, which);
      const sizes = new Uint8Array(q.length);
      for (let i = 0; i < q.length; i++) sizes[i] = lowBitsOf(q[i]);
      const magnitudes = this.rawBits(sizes);
      for (let i = 0; i < q.length; i++) magnitudes[i] += q[i] < 4 ? q[i] : (2 + (q[i] & 1)) << sizes[i];
      return { q, magnitudes };
    }

    /** A pass of the signs of magnitudes that are not 0: the signed values. */
    signed(magnitudes) {
      const sizes = new Uint8Array(magnitudes.length);
      for (let i = 0; i < sizes.length; i++) sizes[i] = magnitudes[i] === 0 ? 0 : 1;
      const values = this.rawBits(sizes);
      for (let i = 0; i < values.length; i++) values[i] = values[i] === 1 ? -magnitudes[i] : magnitudes[i];
      return values;
    }

    /** R-15.6-2: words left over come before wrong final states. */
    finish() {
      this.begin("");
      if (this.taken < this.words.length) throw new Fault("R-7-1", this.wordBit + 16 * this.taken);
      const wrong = this.states.findIndex((x) => x !== LOWEST_STATE);
      if (wrong >= 0) throw new Fault("R-7-1", this.stateBit + 32 * wrong);
    }
  }

  /** R-15.6-3: the lane states and words with which a Run finds symbols again. */
  function encodeRun(starts, frequencies, lanes, laneCount) {
    const states = new Uint32Array(laneCount).fill(LOWEST_STATE);
    const words = [];
    for (let i = starts.length - 1; i >= 0; i--) {
      const f = frequencies[i];
      let x = states[lanes[i]];
      while (x >= f * 2 ** (32 - PRECISION)) {
        words.push(x & 0xffff);
        x >>>= 16;
      }
      states[lanes[i]] = Math.floor(x / f) * TOTAL + (x % f) + starts[i]; // (7-2)
    }
    return { laneStates: states, words: Uint16Array.from(words.reverse()) };
  }

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
      const counts = new Float64Array(symbols).fill(1);
      counts.set(row.split(", ").map(Number));
      return counts;
    });
  }

  /** The models at the start (R-15.11-1): by name, the counts of each context. Nothing changes one. */
  const FIRST_MODELS = Object.fromEntries(Object.entries(MODELS).map(([name, model]) => [name, countsOf(model)]));

  /** C of a context with such counts (15-14). */
  function frequenciesOf(counts) {
    const total = counts.reduce((sum, count) => sum + count, 0);
    let divisor = 1; // 2^r
    while (total >= 2 ** 17 * divisor) divisor *= 2;
    const scaled = counts.map((count) => Math.floor(count / divisor));
    const sum = scaled.reduce((all, count) => all + count, 0);
    const f = scaled.map((count) => 1 + Math.floor(((TOTAL - counts.length) * count) / sum));
    const missing = f.reduce((left, frequency) => left - frequency, TOTAL);
    f[f.indexOf(f.reduce((most, frequency) => Math.max(most, frequency), 0))] += missing;
    const C = new Int32Array(counts.length + 1);
    f.forEach((frequency, s) => (C[s + 1] = C[s] + frequency));
    return C;
  }

  /** The counts of a context behind a P-frame (15-11), `seen` being how often each symbol was decoded in it. */
  function adapted(counts, seen) {
    if (seen.every((times) => times === 0)) return counts;
    return counts.map((count, s) => Math.floor((7 * count) / 8) + 64 * seen[s]);
  }

  /** The models of a frame: they note what is read by them, and know what they are behind it. */
  class FrameModels {
    constructor(models) {
      this.models = models;
      this.tables = {};
      this.seen = {};
      for (const [name, contexts] of Object.entries(models)) {
        this.tables[name] = contexts.map(frequenciesOf);
        this.seen[name] = contexts.map((counts) => new Float64Array(counts.length));
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

    magnitudes(run, name, contexts) {
      const found = run.magnitudes(this.tables[name], contexts);
      this.#note(name, contexts, found.q);
      return found;
    }

    /** The models behind the frame. */
    adapted() {
      const after = {};
      for (const [name, contexts] of Object.entries(this.models)) {
        after[name] = contexts.map((counts, context) => adapted(counts, this.seen[name][context]));
      }
      return after;
    }
  }

  Object.assign(main, { Run, encodeRun, FIRST_MODELS, frequenciesOf, adapted, FrameModels });
}
