// What an output must be, and whether it is: the checks of spec.md section 13.2, and .npy files.
"use strict";
globalThis.GSVC ??= {};
{
  const { TYPES } = GSVC;
  const MAX_L2 = 1e-5; // of a group of gradients, relative (13.5)
  const MAX_BIAS = 1e-6;

  /** The array in the bytes of an .npy file, {data, shape, dtype}: version 1.0 or 2.0, little-endian, C order. */
  function readNpy(bytes) {
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
    const [start, length] = bytes[6] === 1 ? [10, view.getUint16(8, true)] : [12, view.getUint32(8, true)];
    const header = String.fromCharCode(...bytes.subarray(start, start + length));
    const fields = /'descr': '(.*?)', 'fortran_order': False, 'shape': \((.*?)\)/.exec(header);
    if (!fields || !TYPES[fields[1]]) throw new Error(`no array that can be read: ${header.trim()}`);
    const shape = fields[2].split(",").filter((size) => size.trim()).map(Number);
    const data = new TYPES[fields[1]](bytes.slice(start + length).buffer); // a copy, since elements must be aligned
    return { data, shape, dtype: fields[1] };
  }

  /** The array that the runs of a manifest's entry stand for (protocol.md), from the elements that its file holds. */
  function expandRuns({ data: elements, dtype }, { runs, shape, differences = false }) {
    const data = new TYPES[dtype](shape.reduce((product, size) => product * size, 1));
    let at = 0;
    for (const [count, first, length, phase] of runs) {
      if (phase >= length || first + length > elements.length || at + count > data.length) {
        throw new Error("runs that do not fit their file or their shape");
      }
      for (let i = 0; i < count; i++) data[at++] = elements[first + (phase + i) % length];
    }
    if (at !== data.length) throw new Error("runs that do not fit their shape");
    if (differences) for (let i = 1; i < at; i++) data[i] += data[i - 1];
    return { data, shape, dtype };
  }

  const passed = (ratio = null) => ({ passed: true, message: "", ratio });
  const failed = (message, ratio = null) => ({ passed: false, message, ratio });

  /** Where element `index` of an array stands, and how many are wrong. */
  function where(shape, index, wrong, count) {
    const place = [];
    for (const size of [...shape].reverse()) {
      place.unshift(index % size);
      index = Math.floor(index / size);
    }
    return `${place.length ? ` at [${place.join(", ")}]` : ""}${count > 1 ? ` (${wrong} of ${count} are wrong)` : ""}`;
  }

  /** The verdict on elements, from a test that tells which are right and what would be. */
  function elementwise({ data, shape }, isRight, wanted) {
    let first = -1;
    let wrong = 0;
    for (let i = 0; i < data.length; i++) {
      if (isRight(i)) continue;
      if (wrong++ === 0) first = i;
    }
    if (wrong === 0) return passed();
    return failed(`is ${data[first]}${where(shape, first, wrong, data.length)}, expected ${wanted(first)}`);
  }

  /** The elements as unsigned integers, so that a NaN and the sign of a zero count. */
  function bitsOf({ data }) {
    const integers = { 4: Uint32Array, 8: BigUint64Array }[data.BYTES_PER_ELEMENT];
    return integers ? new integers(data.buffer, data.byteOffset, data.length) : data;
  }

  function judgeExact(actual, { expected }) {
    const [given, wanted] = [bitsOf(actual), bitsOf(expected)];
    return elementwise(actual, (i) => given[i] === wanted[i], (i) => expected.data[i]);
  }

  function judgeDecision(actual, { expected, alternative = expected }) {
    const { data } = actual;
    return elementwise(
      actual, (i) => data[i] === expected.data[i] || data[i] === alternative.data[i], (i) => expected.data[i]);
  }

  function judgeInterval(actual, { lowest, highest }) {
    const { data } = actual;
    return elementwise(
      actual, (i) => data[i] >= lowest.data[i] && data[i] <= highest.data[i],
      (i) => `${lowest.data[i]} to ${highest.data[i]}`);
  }

  /** R-13-3; the ratio is the worst error as a multiple of the bound of its element. */
  function judgeBounded(actual, { expected, bound }, groups) {
    const { data, shape } = actual;
    const ratioAt = (i) => {
      const [given, wanted] = [data[i], expected.data[i]];
      if (!Number.isFinite(given) || !Number.isFinite(wanted)) return given === wanted ? 0 : Infinity;
      const error = Math.abs(given - wanted);
      return error === 0 ? 0 : error / bound.data[i];
    };
    let [worst, at, wrong] = [0, 0, 0];
    for (let i = 0; i < data.length; i++) {
      const ratio = ratioAt(i);
      if (!(ratio <= 1)) wrong += 1;
      if (ratio > worst) [worst, at] = [ratio, i];
    }
    if (wrong === 0) return judgeGroups(actual, expected, groups, worst);
    const by = `${worst.toPrecision(3)} times the bound ${bound.data[at].toPrecision(3)}`;
    return failed(`is ${data[at]}${where(shape, at, wrong, data.length)}, expected ${expected.data[at]}: ${by}`, worst);
  }

  /** The limits of groups of columns (13.5): relative L2 error, and bias. */
  function judgeGroups({ data, shape }, expected, groups, worst) {
    const columns = shape.at(-1);
    for (const [first, end] of groups) {
      const sums = { error: 0, errors: 0, value: 0, values: 0 };
      for (let i = 0; i < data.length; i++) {
        if (i % columns < first || i % columns >= end) continue;
        const [error, value] = [data[i] - expected.data[i], expected.data[i]];
        sums.error += error;
        sums.errors += error * error;
        sums.value += Math.abs(value);
        sums.values += value * value;
      }
      const tooFar = !(Math.sqrt(sums.errors) <= MAX_L2 * Math.sqrt(sums.values));
      const biased = !(Math.abs(sums.error) <= MAX_BIAS * sums.value);
      if (tooFar || biased) return failed(`columns ${first} to ${end - 1} are off as a whole`, worst);
    }
    return passed(worst);
  }

  /** Only the kind of an error is judged (13.8). */
  function judgeRefusal(actual, value) {
    if (typeof actual === "string" && actual.split(" ")[0] === value.split(" ")[0]) return passed();
    return failed(`is "${actual}", expected "${value}"`);
  }

  /**
   * The verdict on an output: passed, message (empty if it passed), and ratio (of a bounded check, else null).
   *
   * @param {Object} entry what the manifest of the vector says of the output
   * @param {Object} parts the arrays that it names: expected, bound, lowest, highest, alternative
   * @param actual the output, an array of an operation or a text
   */
  function judge(entry, parts, actual) {
    if (entry.check === "refusal") return judgeRefusal(actual, entry.value);
    const { dtype: storedType, shape } = entry.expected;
    const dtype = entry.dtype ?? storedType; // bounded outputs are f4, their expectations f8
    if (actual?.dtype !== dtype) return failed(`has type ${actual?.dtype}; it must be ${dtype}`);
    if (String(actual.shape) !== String(shape)) return failed(`has shape [${actual.shape}]; it must be [${shape}]`);
    if (entry.check === "exact") return judgeExact(actual, parts);
    if (entry.check === "decision") return judgeDecision(actual, parts);
    if (entry.check === "interval") return judgeInterval(actual, parts);
    if (entry.check === "bounded") return judgeBounded(actual, parts, entry.groups);
    throw new Error(`there is no check ${entry.check}`);
  }

  Object.assign(GSVC, { readNpy, expandRuns, judge });
}
