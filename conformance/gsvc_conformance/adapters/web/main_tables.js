// Profile main, numbers that every part of it uses: spec.md sections 15.3, 15.4 and 15.7.
//
// Integers of 32 bits: Math.imul where a product may pass 2^31, and >>> where it is of 32 bits without a sign. Quotients of
// such integers are made by numbers of 53 bits, and cut: exactly.
"use strict";
globalThis.GSVC ??= {};
{
  const TOTAL = 2 ** 14; // the frequencies of a symbol's alternatives add up to it
  const MAGNITUDE_CLASSES = 40;
  const CLASS_MOST = 10;
  const MOST_BINS = 512;

  // The number nearest to a half is 0.002 away from it: a power that is a little off is rounded to the same integer.
  const EXP2 = Uint16Array.from({ length: 1024 }, (_, i) => Math.round(2 ** (15 + i / 1024)));

  /** (15-2): 2^(v / 1024) with k bits after the point. */
  function exp2(v, k) {
    const shift = (v >> 10) - 15 + k;
    return shift >= 0 ? EXP2[v & 1023] << shift : EXP2[v & 1023] >> Math.min(-shift, 31);
  }

  /** A distribution function in 2^-16 at 257 places, from those at 1 to 128 (15-3). */
  function distribution(lower) {
    const values = new Int32Array(257);
    for (let i = 1; i <= 128; i++) {
      const value = lower(exp2(96 * (128 - i), 15));
      values[i] = value;
      values[256 - i] = 2 ** 16 - value;
    }
    values[256] = 2 ** 16;
    return values;
  }

  const FAMILIES = [ // by `density_family`
    distribution((t) => Math.floor(2 ** 31 / (2 ** 15 + t))),
    distribution((t) => Math.floor(2 ** 30 / t)),
  ];

  /** D of a `quantizer`, in 1/16. */
  const stepOf = (quantizer) => (EXP2[128 * (quantizer & 7)] << (quantizer >> 3)) >> 12;

  /** The class j of a splat of the colour n (15-4). */
  function classOf(n0, n1, n2, D) {
    const half = D >> 1;
    const k0 = Math.min(((Math.abs(n0) + half) / D) | 0, 1024);
    const k1 = Math.min(((Math.abs(n1) + half) / D) | 0, 1024);
    const k2 = Math.min(((Math.abs(n2) + half) / D) | 0, 1024);
    const energy = k0 * k0 + k1 * k1 + k2 * k2;
    return Math.min((32 - Math.clz32(energy)) >> 1, CLASS_MOST); // 2^(2 j - 1) has 2 j binary digits
  }

  /**
   * C[i] of (15-6), of bins with doubled inner edges, for i = 1 .. bins - 1.
   *
   * @param {number} edge the doubled edge before bin i
   * @param {Int32Array} T one of FAMILIES
   */
  function cumulativeAt(i, bins, edge, centre, T, scaleCode, unitBits) {
    const mantissa = EXP2[(-256 * scaleCode) & 1023] >> 2;
    const scaled = Math.imul(edge - 2 * centre, mantissa) >> (2 + ((scaleCode + 3) >> 2) + unitBits);
    const u = Math.min(Math.max(2 ** 15 + scaled, 0), 2 ** 16 - 1);
    const place = u >> 8;
    const v = T[place] + (((T[place + 1] - T[place]) * (u & 255)) >> 8);
    return i + (((TOTAL - bins) * v) >> 16);
  }

  /** All of C of (15-6); `edgeOf` gives the doubled edge before bin i, for i = 1 .. bins - 1. */
  function density(bins, edgeOf, centre, T, scaleCode, unitBits) {
    const C = new Int32Array(bins + 1);
    for (let i = 1; i < bins; i++) C[i] = cumulativeAt(i, bins, edgeOf(i), centre, T, scaleCode, unitBits);
    C[bins] = TOTAL;
    return C;
  }

  /** C of the classes of magnitudes; `centre` is in 1/16 of a class. */
  const magnitudeDensity = ({ T, scaleCode }, centre) =>
    density(MAGNITUDE_CLASSES, (i) => 16 * (2 * i - 1), centre, T, scaleCode, 2);

  /** The window of (15-7) around a centre, in steps of h: C of its bins, how many low bits are raw, the first bin. */
  function windowDensity({ T, scaleCode }, centre, h) {
    const scale = exp2(256 * scaleCode, 4);
    let r = 0;
    while (16 * scale > MOST_BINS * (h << r)) r += 1;
    const width = h << r;
    const first = Math.floor((centre - 8 * scale) / width);
    const last = Math.ceil((centre + 8 * scale) / width);
    const edgeOf = (i) => (((2 * (first + i)) << r) - 1) * h;
    return { C: density(last - first + 1, edgeOf, centre, T, scaleCode, 4), lowBits: r, first };
  }

  /** Whether (15-8) says how many of n splats are in the first half of a part, of p and q cells; else (15-9) does. */
  const isBetaBinomial = (n, p, q) => p === q && n <= 15;

  /** (15-9): what says how many of n splats are in the first half of a part; `lowBits` of the number are raw. */
  function halfDensity(n, p, q, alpha) {
    const lowBits = Math.max(0, bitLength(n) - 9);
    const m = n >> lowBits;
    const b = ((256 * p) / (p + q)) | 0;
    const t = (((2 * alpha + m) * 1245) / (2 * alpha + 1)) | 0;
    const v = Math.imul((m * b * (256 - b)) >> 9, t) >>> 7;
    const e = bitLength(Math.max(v, 1)) - 1;
    const scaleCode = 2 * e + (e > 0 ? (v >> (e - 1)) & 1 : 0);
    return { m, centre: (m * b) >> 2, scaleCode, lowBits };
  }

  /** C[i] of such a density, for i = 1 .. m. */
  const cumulativeOfHalf = (i, { m, centre, scaleCode }) =>
    cumulativeAt(i, m + 1, 64 * (2 * i - 1), centre, FAMILIES[0], scaleCode, 0);

  /** C of how many of n splats are in the first half of a part, and how many low bits are raw. */
  function halves(n, p, q, alpha) {
    if (isBetaBinomial(n, p, q)) return { C: betaBinomial(n, alpha), lowBits: 0 };
    const half = halfDensity(n, p, q, alpha);
    const C = new Int32Array(half.m + 2);
    for (let i = 1; i <= half.m; i++) C[i] = cumulativeOfHalf(i, half);
    C[half.m + 1] = TOTAL;
    return { C, lowBits: half.lowBits };
  }

  /** (15-8). */
  function betaBinomial(n, alpha) {
    const w = new Float64Array(n + 1);
    w[0] = w[n] = 2 ** 16;
    for (let i = 0; i + 1 <= n >> 1; i++) {
      w[i + 1] = w[n - i - 1] = Math.floor((w[i] * (n - i) * (i + alpha)) / ((i + 1) * (n - i - 1 + alpha)));
    }
    const all = w.reduce((sum, weight) => sum + weight, 0);
    const C = new Int32Array(n + 2);
    let sum = 0;
    for (let i = 1; i <= n; i++) {
      sum += w[i - 1];
      C[i] = i + Math.floor(((TOTAL - n - 1) * sum) / all);
    }
    C[n + 1] = TOTAL;
    return C;
  }

  /** How many binary digits a number below 2^32 has. */
  const bitLength = (value) => 32 - Math.clz32(value);

  GSVC.main = {
    TOTAL, MAGNITUDE_CLASSES, CLASS_MOST, EXP2, FAMILIES, exp2, stepOf, classOf, density, magnitudeDensity,
    windowDensity, isBetaBinomial, halfDensity, cumulativeOfHalf, halves, betaBinomial, bitLength,
  };
}
