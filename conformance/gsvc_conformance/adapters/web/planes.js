// Planes of symbols, and rANS: spec.md sections 6.6 and 7.
"use strict";
globalThis.GSVC ??= {};
{
  const { Fault } = GSVC;
  const LOWEST_STATE = 2 ** 16;
  const symbolOfSlot = new Uint16Array(2 ** 16); // filled anew for each plane: its frequencies cover all slots

  /** A plane of `count` symbols below `alphabet`, as Uint16Array; `header` has entropy_precision and lane_count. */
  function readPlane(p, header, count, alphabet) {
    const w = 32 - Math.clz32(alphabet - 1); // bits of a symbol in constant and raw planes
    const mode = p.u(2);
    if (mode === 3) throw new Fault("R-6.6-1", p.element);
    let symbols;
    if (mode === 0) {
      symbols = new Uint16Array(count).fill(readSymbol(p, w, alphabet));
    } else if (mode === 1) {
      symbols = readRawSymbols(p, count, alphabet, w);
    } else {
      symbols = readCodedSymbols(p, header, count, alphabet, w);
    }
    p.align();
    return symbols;
  }

  function readSymbol(p, w, alphabet) {
    const symbol = p.u(w);
    if (symbol >= alphabet) throw new Fault("R-6.6-2", p.element);
    return symbol;
  }

  /** What a plane of mode 1 has: u(w) of each symbol, here without a call for each. */
  function readRawSymbols(p, count, alphabet, w) {
    p.need(count * w); // the run as a whole, before its first symbol is looked at
    const symbols = new Uint16Array(count);
    const first = p.position();
    let next = Math.floor(p.at / 8); // the byte of `data` that comes next
    let held = 0; // bits of bytes that were begun, which are the low ones of `bits`
    let bits = 0;
    if (p.at % 8 > 0) {
      bits = p.data[next++];
      held = 8 - (p.at % 8);
    }
    for (let i = 0; i < count; i++) {
      for (; held < w; held += 8) bits = (bits << 8) | p.data[next++]; // those above `held` may go
      held -= w;
      const symbol = (bits >> held) & ((1 << w) - 1);
      if (symbol >= alphabet) throw new Fault("R-6.6-2", first + i * w);
      symbols[i] = symbol;
    }
    p.at += count * w;
    return symbols;
  }

  /** What a plane of mode 2 has after `plane_mode`. */
  function readCodedSymbols(p, header, count, alphabet, w) {
    const table = readFrequencies(p, header.entropy_precision, alphabet, w);
    p.align();
    const wordCount = p.uv();
    if (2 * wordCount > p.bitsLeft() / 8) throw new Fault("R-6.6-6", p.element);
    const states = new Uint32Array(Math.min(header.lane_count, count));
    const stateBit = p.position();
    p.need(32 * states.length);
    for (let lane = 0; lane < states.length; lane++) {
      states[lane] = p.le(4);
      if (states[lane] < LOWEST_STATE) throw new Fault("R-6.6-5", p.element);
    }
    const wordBit = p.position();
    return decodeSymbols(count, table, states, p.raw(2 * wordCount), stateBit, wordBit);
  }

  /** The scaled frequencies f and their sums c (section 7), of all symbols 0 .. last_symbol. */
  function readFrequencies(p, precision, alphabet, w) {
    const tableBits = p.u(5);
    if (tableBits < 1 || tableBits > precision) throw new Fault("R-6.6-3", p.element);
    const order = p.u(4);
    const first = readSymbol(p, w, alphabet);
    const last = readSymbol(p, w, alphabet);
    if (first >= last) throw new Fault("R-6.6-4", p.element);
    const tableBit = p.position();
    const frequencies = new Float64Array(last + 1); // not integers of 32 bits: what is too large must add up as it is
    let sum = 0;
    for (let s = first; s <= last; s++) sum += frequencies[s] = p.eg(order);
    if (frequencies[first] === 0 || frequencies[last] === 0 || sum !== 2 ** tableBits) {
      throw new Fault("R-6.6-4", tableBit);
    }
    return cumulated(frequencies.map((frequency) => frequency * 2 ** (precision - tableBits)), precision);
  }

  function cumulated(frequencies, precision) {
    const cumulative = new Uint32Array(frequencies.length);
    for (let s = 1; s < frequencies.length; s++) cumulative[s] = cumulative[s - 1] + frequencies[s - 1];
    return { frequencies: Uint32Array.from(frequencies), cumulative, precision };
  }

  /** (7-1) for all symbols, then R-7-1: words left over come before wrong final states. `words` has two bytes each. */
  function decodeSymbols(count, { frequencies, cumulative, precision }, states, words, stateBit, wordBit) {
    for (let s = 0; s < frequencies.length; s++) {
      symbolOfSlot.fill(s, cumulative[s], cumulative[s] + frequencies[s]);
    }
    const mask = 2 ** precision - 1;
    const symbols = new Uint16Array(count);
    let taken = 0;
    for (let i = 0, lane = 0; i < count; i++) {
      let x = states[lane];
      const slot = x & mask;
      const s = symbolOfSlot[slot];
      x = frequencies[s] * (x >>> precision) + slot - cumulative[s]; // below 2^32: exact, as a number
      if (x < LOWEST_STATE) {
        if (taken === words.length) throw new Fault("R-7-1", wordBit);
        x = x * 2 ** 16 + words[taken] + 256 * words[taken + 1];
        taken += 2;
      }
      states[lane] = x;
      symbols[i] = s;
      if (++lane === states.length) lane = 0;
    }
    if (taken < words.length) throw new Fault("R-7-1", wordBit + 8 * taken);
    const wrong = states.findIndex((x) => x !== LOWEST_STATE);
    if (wrong >= 0) throw new Fault("R-7-1", stateBit + 32 * wrong);
    return symbols;
  }

  /** (7-2): the lane states and words with which decodeSymbols finds the symbols again. */
  function encodeSymbols(symbols, scaledFrequencies, precision, laneCount) {
    const { frequencies, cumulative } = cumulated(scaledFrequencies, precision);
    const states = new Uint32Array(Math.min(laneCount, symbols.length)).fill(LOWEST_STATE);
    const words = [];
    for (let i = symbols.length - 1; i >= 0; i--) {
      const f = frequencies[symbols[i]];
      const lane = i % states.length;
      let x = states[lane];
      while (x >= f * 2 ** (32 - precision)) {
        words.push(x & 0xffff);
        x >>>= 16;
      }
      states[lane] = Math.floor(x / f) * 2 ** precision + (x % f) + cumulative[symbols[i]];
    }
    return { laneStates: states, words: Uint16Array.from(words.reverse()) };
  }

  Object.assign(GSVC, { readPlane, encodeSymbols });
}
