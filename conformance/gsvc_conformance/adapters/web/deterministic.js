// Splats to pixels with every operation stated: spec.md sections 9.3 and 9.4; also frames from sums (R-9.1-1).
//
// fl after each operation rounds as binary32 hardware does (see reconstruction.js), and engines compile fl(a * b) to
// one instruction of binary32. Nothing is fused, since fl stands between a product and its sum.
"use strict";
globalThis.GSVC ??= {};
{
  const { boxOf, roundHalfEven } = GSVC;
  const fl = Math.fround;
  const SMALLEST_NORMAL = 2 ** -126;
  // JavaScript has no hexadecimal fractions: these are the bits of section 9.3.
  const [K, K1, K2, K3, K4, K5] = new Float32Array(
    Uint32Array.of(0x41315208, 0xbd7fffe4, 0x3afff978, 0xb82a3d40, 0x3524c79f, 0xb1c84634).buffer,
  );

  /** exp(-m / 2), as (9-5) has it. */
  function weight(m) {
    const t = fl(m * m);
    const high = fl(fl(K5 * t) + fl(fl(K4 * m) + K3));
    const low = fl(fl(K2 * m) + K1);
    const p = fl(fl(fl(fl(high * t) + low) * m) + 1);
    const h = fl(p * p);
    const q = fl(h * h);
    return fl(q * q);
  }

  /** Adds the splat at `at` to the pixels of its box in `sum`, (H, W, 3). */
  function addSplat(sum, parameters, at, width, height) {
    const [left, right, top, bottom] = boxOf(parameters, at, width, height);
    const [x, y, l11, l21, l22, red, green, blue] = parameters.subarray(at, at + 8);
    const r1 = fl(1 / l11);
    const r2 = fl(1 / l22);
    const l = l22 <= 1 ? l21 : fl(l21 / l22); // (9-3)
    const f = l22 <= 1 ? r2 : 1;
    for (let j = top; j < bottom; j++) {
      const v = fl(fl(j + 0.5 - y) * r2);
      for (let i = left; i < right; i++) {
        const u1 = fl(fl(i + 0.5 - x) * r1);
        const u2 = fl(v - fl(fl(l * u1) * f));
        const m = fl(fl(u1 * u1) + fl(u2 * u2)); // (9-4)
        if (!(m <= K)) continue; // also where m is a NaN
        const g = weight(m);
        const pixel = 3 * (width * j + i);
        sum[pixel] += fl(g * red); // (9-6); storing rounds
        sum[pixel + 1] += fl(g * green);
        sum[pixel + 2] += fl(g * blue);
      }
    }
  }

  /**
   * Returns the sum C of splats over a frame, (H, W, 3); splats in ascending order at every pixel. It yields after each
   * splat which part is done, 0 to 1.
   */
  function* renderingSteps(parameters, width, height) {
    const sum = new Float32Array(3 * width * height);
    for (let at = 0; at < parameters.length; at += 8) {
      addSplat(sum, parameters, at, width, height);
      yield at / parameters.length;
    }
    return sum;
  }

  /** The result of a generator of steps, run without a pause. */
  function finished(steps) {
    for (;;) {
      const { done, value } = steps.next();
      if (done) return value;
    }
  }

  const renderSumDeterministic = (...inputs) => finished(renderingSteps(...inputs));

  /** Samples of a bit depth: one byte at 8 bits, else two. */
  const samples = (count, bitDepth) => (bitDepth === 8 ? new Uint8Array(count) : new Uint16Array(count));

  /** (9-7): the product with the peak is rounded to binary32 first; a NaN is black. */
  function toFrameDeterministic(sum, bitDepth) {
    const peak = 2 ** bitDepth - 1;
    const frame = samples(sum.length, bitDepth);
    for (let i = 0; i < sum.length; i++) {
      const v = sum[i] > 0 ? Math.min(sum[i], 1) : 0;
      frame[i] = roundHalfEven(fl(v * peak));
    }
    return frame;
  }

  /** R-9.1-1 in bounded rendering; the product of a binary32 number and the peak is exact in binary64. */
  function toFrame(sum, bitDepth) {
    const peak = 2 ** bitDepth - 1;
    const frame = samples(sum.length, bitDepth);
    for (let i = 0; i < sum.length; i++) frame[i] = roundHalfEven(Math.min(Math.max(sum[i], 0), 1) * peak);
    return frame;
  }

  /** (9-8): the splats for a frame of another size; ratios and products are rounded to binary32. */
  function scaleParameters(parameters, width, height, newWidth, newHeight) {
    const a = fl(newWidth / width);
    const e = fl(newHeight / height);
    const factors = [a, e, a, e, e, 1, 1, 1];
    return parameters.map((value, i) => value * factors[i % 8]); // storing rounds
  }

  /** (9-9): the splats for bounded rendering at another size, filtered by the pixels of a smaller one. */
  function scaleParametersFiltered(parameters, width, height, newWidth, newHeight) {
    const scaled = parameters.slice();
    const [a, e] = [newWidth / width, newHeight / height];
    const vx = Math.max(0, (width - newWidth) * (width + newWidth)) / (12 * width * width);
    const vy = Math.max(0, (height - newHeight) * (height + newHeight)) / (12 * height * height);
    for (let at = 0; at < scaled.length; at += 8) {
      const isDrawn = parameters[at + 2] >= SMALLEST_NORMAL && parameters[at + 4] >= SMALLEST_NORMAL; // R-9.4-3
      const l11 = a * parameters[at + 2];
      const l21 = e * parameters[at + 3];
      const l22 = e * parameters[at + 4];
      const m11 = isDrawn ? Math.sqrt(l11 * l11 + vx) : l11;
      const m22 = isDrawn ? Math.sqrt(l22 * l22 + vy + (l21 * l21 * vx) / (m11 * m11)) : l22;
      const weaker = isDrawn ? (l11 / m11) * (l22 / m22) : 1;
      scaled[at] *= a;
      scaled[at + 1] *= e;
      scaled[at + 2] = m11;
      scaled[at + 3] = isDrawn ? l21 * (l11 / m11) : l21;
      scaled[at + 4] = m22;
      for (let c = 5; c < 8; c++) scaled[at + c] *= weaker;
    }
    return scaled;
  }

  Object.assign(GSVC, {
    finished, renderingSteps, renderSumDeterministic, toFrameDeterministic, toFrame, scaleParameters,
    scaleParametersFiltered,
  });
}
