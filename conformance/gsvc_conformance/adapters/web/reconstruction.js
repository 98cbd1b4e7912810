// Codes to splats, to the bit: spec.md section 8; their checksum (6.4) and their rendering work (section 5).
//
// Math.fround rounds a binary64 result to binary32. For + - * / of two binary32 numbers that is the correctly rounded
// binary32 result, as if there had been no step in between: 53 bits are at least 2 * 24 + 2.
"use strict";
globalThis.GSVC ??= {};
{
  const { crc32c } = GSVC;
  const fl = Math.fround;
  const SMALLEST_NORMAL = 2 ** -126;
  const REACH = 3.3290429691304455 * (1 + 2 ** -17); // rho' of (5-1)

  /** The value of a binary16 pattern (8-5); infinities are kept. */
  function halfValue(bits) {
    const sign = bits >> 15 ? -1 : 1;
    const exponent = (bits >> 10) & 31;
    const fraction = bits & 1023;
    if (exponent === 0) return sign * 2 ** -24 * fraction;
    if (exponent === 31) return fraction ? NaN : sign * Infinity;
    return sign * 2 ** (exponent - 25) * (1024 + fraction);
  }

  const HALF_VALUES = Float32Array.from({ length: 2 ** 16 }, (_, bits) => halfValue(bits));

  /** The values of binary16 patterns, as Float32Array. */
  function halfValues(bits) {
    const values = new Float32Array(bits.length);
    for (let i = 0; i < bits.length; i++) values[i] = HALF_VALUES[bits[i]];
    return values;
  }

  const word = new Uint32Array(1);
  const single = new Float32Array(word.buffer);

  /** A whole or half number that is not negative, rounded to the nearest integer, ties to even. */
  const roundHalfEven = (v) => v + 2 ** 52 - 2 ** 52; // binary64 has no bits after the point from 2^52 on

  /** The pattern of the binary16 nearest to a binary32 number, ties to even (8-6). */
  function halfBits(value) {
    single[0] = value;
    const exponent = Math.max(((word[0] >>> 23) & 255) - 127, -14); // of a subnormal: -127, so -14
    const steps = roundHalfEven(Math.abs(value) * 2 ** (10 - exponent));
    return (word[0] >>> 31) * 2 ** 15 + (exponent + 14) * 2 ** 10 + steps;
  }

  /** fl(fl(q s) + beta) of code n in a channel (8-3). */
  const cholesky = (codes, n, channel) =>
    fl(fl(codes.cholesky[3 * n + channel] * codes.scale[channel]) + codes.offset[channel]);

  /** Puts the sum of the codewords of splat n, added in the order of the stages (8-4), into a Float32Array at `at`. */
  function putCodewordSum({ codebookSizes, colorIndices }, values, n, to, at) {
    const stages = codebookSizes.length;
    let row = 3 * colorIndices[stages * n];
    let red = values[row];
    let green = values[row + 1];
    let blue = values[row + 2];
    for (let k = 1, first = codebookSizes[0]; k < stages; first += codebookSizes[k++]) {
      row = 3 * (first + colorIndices[stages * n + k]); // `first`: of the stage
      red = fl(red + values[row]);
      green = fl(green + values[row + 1]);
      blue = fl(blue + values[row + 2]);
    }
    to[at] = red;
    to[at + 1] = green;
    to[at + 2] = blue;
  }

  /**
   * The splats of an intra block.
   *
   * `codes` has positions (n, 2), cholesky (n, 3), scale (3), offset (3), colorIndices (n, M), codebookSizes (M) and
   * codewords (sum of sizes, 3), all flat; the result is flat, (n, 8).
   */
  function reconstructIntra(width, height, codes) {
    const count = codes.positions.length / 2;
    const values = halfValues(codes.codewords);
    const parameters = new Float32Array(8 * count);
    for (let n = 0; n < count; n++) {
      const at = 8 * n;
      parameters[at] = fl(fl(HALF_VALUES[codes.positions[2 * n]] + 1) * (width / 2)); // (8-1)
      parameters[at + 1] = fl(fl(HALF_VALUES[codes.positions[2 * n + 1]] + 1) * (height / 2)); // (8-2)
      for (let c = 0; c < 3; c++) parameters[at + 2 + c] = cholesky(codes, n, c); // (8-3)
      putCodewordSum(codes, values, n, parameters, at + 5); // (8-4)
    }
    return parameters;
  }

  /** The survivors of a frame after the differences of an inter block; an attribute without codes keeps its bits. */
  function reconstructInter(width, height, reference, survivors, codes) {
    const parameters = survivorsOf(reference, survivors);
    const values = halfValues(codes.codewords);
    const color = new Float32Array(3);
    for (let at = 0, n = 0; at < parameters.length; at += 8, n++) {
      if (codes.positions.length > 0) {
        parameters[at] += fl(HALF_VALUES[codes.positions[2 * n]] * (width / 2)); // storing rounds: fl(ref(x) + ...)
        parameters[at + 1] += fl(HALF_VALUES[codes.positions[2 * n + 1]] * (height / 2));
      }
      if (codes.cholesky.length > 0) {
        for (let c = 0; c < 3; c++) parameters[at + 2 + c] += cholesky(codes, n, c);
      }
      if (codes.colorIndices.length > 0) {
        putCodewordSum(codes, values, n, color, 0);
        for (let c = 0; c < 3; c++) parameters[at + 5 + c] += color[c];
      }
    }
    return parameters;
  }

  function survivorsOf(reference, survivors) {
    let count = 0;
    for (let n = 0; n < survivors.length; n++) count += survivors[n];
    const kept = new Float32Array(8 * count);
    for (let n = 0, at = 0; n < survivors.length; n++) {
      if (survivors[n] !== 1) continue;
      for (let c = 0; c < 8; c++) kept[at++] = reference[8 * n + c];
    }
    return kept;
  }

  const checksums = new WeakMap(); // of splats by their array: frames repeat it, and nothing changes one

  /** R-6.4-3: positions of all splats, then all Cholesky factors, then all colours. */
  function parameterChecksum(parameters) {
    if (!checksums.has(parameters)) checksums.set(parameters, crc32c(storedInOrder(parameters)));
    return checksums.get(parameters);
  }

  function storedInOrder(parameters) {
    const stored = new DataView(new ArrayBuffer(4 * parameters.length));
    let at = 0;
    for (const [first, end] of [[0, 2], [2, 5], [5, 8]]) {
      for (let n = 0; n < parameters.length; n += 8) {
        for (let c = first; c < end; c++, at += 4) stored.setFloat32(at, parameters[n + c], true);
      }
    }
    return new Uint8Array(stored.buffer);
  }

  /** R-8-1. */
  function areFinite(parameters) {
    for (let i = 0; i < parameters.length; i++) if (!Number.isFinite(parameters[i])) return false;
    return true;
  }

  /** The box of the splat at `at`: [first column, end column, first row, end row], equal ends if it is empty (5-1). */
  function boxOf(parameters, at, width, height) {
    const x = parameters[at];
    const y = parameters[at + 1];
    const l11 = parameters[at + 2];
    const l21 = parameters[at + 3];
    const l22 = parameters[at + 4];
    const drawn = l11 >= SMALLEST_NORMAL && l22 >= SMALLEST_NORMAL && l11 < Infinity && l22 < Infinity;
    if (!drawn) return [0, 0, 0, 0];
    const ex = REACH * l11;
    const ey = REACH * (Math.abs(l21) + l22);
    const clamp = (v, size) => Math.min(Math.max(v, 0), size);
    return [
      clamp(Math.floor(x - ex), width),
      clamp(Math.ceil(x + ex), width),
      clamp(Math.floor(y - ey), height),
      clamp(Math.ceil(y + ey), height),
    ];
  }

  /** (5-1): how many (splat, pixel) pairs the boxes hold. */
  function renderingWork(parameters, width, height) {
    let work = 0;
    for (let at = 0; at < parameters.length; at += 8) {
      const [left, right, top, bottom] = boxOf(parameters, at, width, height);
      work += (right - left) * (bottom - top);
    }
    return work;
  }

  Object.assign(GSVC, {
    halfValues, halfBits, roundHalfEven, reconstructIntra, reconstructInter, areFinite, parameterChecksum, boxOf,
    renderingWork,
  });
}
