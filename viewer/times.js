"use strict";
// When frames are shown, where that is not the same length for each: chunks `t` (spec.md section 6.11).
globalThis.GSVC ??= {};

{
  const PREFIX_SIZE = 10; // bytes in front of the first chunk
  const MOST_RUNS = 4096; // of a chunk
  const MOST_KEPT = 2 ** 16; // runs of a stream, and those that came with the last of them
  const MOST_FRAMES = 2 ** 32;

  /** What a chunk's payload says; null if it breaks R-6.11-1. */
  function readTimes(payload) {
    try {
      const p = new GSVC.Bits(payload);
      const [ticks, first, count] = [p.uv(), p.uv(), p.uv()];
      const runs = [];
      let end = first;
      if (ticks === 0 || count > MOST_RUNS) return null;
      for (let i = 0; i < count; i++) {
        const [frames, length] = [p.uv(), p.uv()];
        if (frames === 0 || length === 0) return null;
        runs.push({ first: end, end: end + frames, length: length / ticks });
        end += frames;
      }
      return end > MOST_FRAMES || p.at !== 8 * payload.length ? null : { ticks, first, runs };
    } catch (fault) {
      if (!(fault instanceof GSVC.Fault)) throw fault;
      return null; // it ends inside of an element
    }
  }

  /** The runs of all chunks `t` that keep R-6.11-2, in order. */
  function runsOf({ bytes, state, frames }) {
    const chunks = new GSVC.WholeChunks(bytes, state.limits.payload);
    const runs = [];
    let told = 0; // the end of what was told
    let ticks = null;
    let n = 0; // the next frame
    for (let at = PREFIX_SIZE; at < bytes.length; ) {
      while (n < frames.length && frames[n].byteOffset < at) n++;
      const payload = chunks.payload(at);
      if (payload === null || payload.end > bytes.length) { // damage: go on with the next frame
        if (n === frames.length || frames[n].byteOffset === at) break;
        at = frames[n].byteOffset;
        continue;
      }
      if (bytes[at] === 0x74 && chunks.at(at) !== null) {
        const found = readTimes(bytes.subarray(payload.begin, payload.end));
        const next = frames[n]?.number ?? MOST_FRAMES;
        const holds = found && found.first >= Math.max(told, next) && (ticks ?? found.ticks) === found.ticks;
        if (holds && runs.length < MOST_KEPT) {
          runs.push(...found.runs);
          [told, ticks] = [runs.at(-1)?.end ?? 0, found.ticks];
        }
      }
      at = payload.end + 4;
    }
    return runs;
  }

  /**
   * The seconds at which the frames of a reading are shown, and after them that at which the last one ends.
   *
   * null: they are evenly spaced.
   */
  GSVC.timesOf = (reading) => {
    const { header, frames } = reading;
    const runs = runsOf(reading);
    if (runs.length === 0) return null;
    const usual = header.frame_rate_denominator / header.frame_rate_numerator;
    let [run, number, time] = [0, 0, 0];
    const goTo = (wanted) => {
      while (number < wanted) {
        const { first, end, length } = runs[run] ?? { first: MOST_FRAMES, end: Infinity };
        const stop = Math.min(wanted, number < first ? first : end);
        time += (stop - number) * (number < first ? usual : length);
        number = stop;
        if (number >= end) run++;
      }
      return time;
    };
    const numbers = frames.map((frame) => frame.number);
    return [...numbers, numbers.at(-1) + 1].map(goTo);
  };
}
