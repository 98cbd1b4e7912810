// Profile main, from codes to states and parameters: spec.md sections 15.4, 15.9 (15-10), 15.10 and 15.11 (15-13).
//
// States are flat: X, Y, A, B, S, n0, n1, n2 of each splat, 32 bits each.
"use strict";
globalThis.GSVC ??= {};
{
  const { main } = GSVC;
  const { EXP2, exp2, stepOf, classOf, bitLength } = main;
  const SIDES = [0, 64, 32, 16]; // of the cells of a field, by `motion_cell`
  const CELL = 4; // pixels, of an I-frame
  const [X_MOST, A_LEAST, A_MOST, S_MOST, N_MOST] = [2 ** 24, -3072, 13311, 32767, 2 ** 28];
  const STEP_MOST = 2 ** 17 - 1;
  const REMOVED = 8;
  const [K1, K2, K3] = [42862, 52495, 30308]; // of (15-5)
  const REACH = 54544; // of (5-2), in 2^-14
  const FILTER_REACH = [0, 427, 953, 1953]; // F of (5-2), by the number of halvings
  const POWERS = Float64Array.from({ length: 64 }, (_, i) => 2 ** (i - 48)); // looked up: 2 ** k is a call of a function

  // Functions of all splats have loops and no array or object of a single splat: a frame has up to 2^22 of them.

  const clip = (value, low, high) => Math.min(Math.max(value, low), high);
  const clipSize = (value) => clip(value, A_LEAST, A_MOST);
  const sizeStep = (j) => 1477 >> j; // h of (15-10)
  const shearStep = (j) => 2048 >> j;

  /** The classes of splats. */
  function classesOf(state, quantizer) {
    const D = stepOf(quantizer);
    const j = new Int32Array(state.length / 8);
    for (let i = 0, at = 0; i < j.length; i++, at += 8) j[i] = classOf(state[at + 5], state[at + 6], state[at + 7], D);
    return j;
  }

  const powerOfTwo = (k) => POWERS[k + 48];

  /** A number p, of 32 bits without a sign, to 24 bits: to nearest, ties to even; times 2^exponent. */
  function rounded(p, exponent) {
    const e = Math.max(0, bitLength(p) - 24);
    const q = e === 0 ? p : (p + (1 << (e - 1)) - 1 + ((p >>> e) & 1)) >>> e;
    return q * powerOfTwo(e + exponent); // exact in binary32
  }

  /** A colour of (15-5): T in 2^exponent, times G in 2^-15. */
  function colorOf(T, G, exponent) {
    const size = Math.abs(T);
    const p = (Math.imul(size >> 15, G) + ((Math.imul(size & 0x7fff, G) >>> 15))) >>> 0;
    return T < 0 ? -rounded(p, exponent) : rounded(p, exponent);
  }

  /** The parameters of states (15-5): each is an integer of 24 bits times a power of two, and nothing rounds it. */
  function stateParameters(state) {
    const parameters = new Float32Array(state.length);
    for (let at = 0; at < state.length; at += 8) {
      const A = state[at + 2];
      const B = state[at + 3];
      const S = state[at + 4];
      const n0 = state[at + 5];
      const n1 = state[at + 6];
      const n2 = state[at + 7];
      const v = -(A + B) >> 1;
      const G = EXP2[v & 1023];
      const s = Math.max(0, bitLength(Math.max(Math.abs(n0), Math.abs(n1), Math.abs(n2))) - 14);
      const low = (1 << s) - 1;
      const P0 = (n0 >> s) * K1 + (((n0 & low) * K1) >> s);
      const P1 = (n1 >> s) * K2 + (((n1 & low) * K2) >> s);
      const P2 = (n2 >> s) * K3 + (((n2 & low) * K3) >> s);
      const exponent = s + (v >> 10) - 29;
      const l21 = rounded(Math.imul(Math.abs(S), EXP2[B & 1023]), (B >> 10) - 25);
      parameters[at] = state[at] / 256;
      parameters[at + 1] = state[at + 1] / 256;
      parameters[at + 2] = EXP2[A & 1023] * powerOfTwo((A >> 10) - 15);
      parameters[at + 3] = S < 0 ? -l21 : l21;
      parameters[at + 4] = EXP2[B & 1023] * powerOfTwo((B >> 10) - 15);
      parameters[at + 5] = colorOf(P0 + P1 + P2, G, exponent);
      parameters[at + 6] = colorOf(P0 - 2 * P2, G, exponent);
      parameters[at + 7] = colorOf(P0 - P1 + P2, G, exponent);
    }
    return parameters;
  }

  /** Where (5-2) has a box begin and end in one direction, and how many pixels that is. */
  function pixelsAlong(place, reach, length, halvings) {
    const end = Math.min(length, (place + reach + (256 << halvings) - 1) >> (8 + halvings));
    return Math.max(0, end - Math.max(0, (place - reach) >> (8 + halvings)));
  }

  /** e of (5-2), of A or B. */
  const reachOf = (logSize) => (Math.imul(EXP2[logSize & 1023], REACH) >>> (21 - (logSize >> 10))) + 1;

  /** (5-2): how many (splat, pixel) pairs the boxes of states hold, in a frame that is halved so often. */
  function mainWork(state, width, height, halvings = 0) {
    const columns = Math.ceil(width / 2 ** halvings);
    const rows = Math.ceil(height / 2 ** halvings);
    const filter = FILTER_REACH[halvings];
    let work = 0;
    for (let at = 0; at < state.length; at += 8) {
      const e = reachOf(state[at + 3]);
      const m = 1024 + Math.abs(state[at + 4]);
      const down = (e >> 10) * m + (((e & 1023) * m) >> 10) + 1;
      work += pixelsAlong(state[at], reachOf(state[at + 2]) + filter, columns, halvings) *
        pixelsAlong(state[at + 1], down + filter, rows, halvings);
    }
    return work;
  }

  /** n of colour codes. */
  const codedColor = (k, D) => clip(k, -Math.floor(N_MOST / D), Math.floor(N_MOST / D)) * D;

  /** The classes of splats with colour codes, of which there are three columns. */
  function classesOfCodes([k0, k1, k2], D) {
    const j = new Int32Array(k0.length);
    for (let i = 0; i < j.length; i++) {
      j[i] = classOf(codedColor(k0[i], D), codedColor(k1[i], D), codedColor(k2[i], D), D);
    }
    return j;
  }

  /** A (sign 1) or B (sign -1) of the codes of size and aspect (15-10). */
  const codedSize = (size, aspect, j, sign) => clipSize((size + sign * aspect) * sizeStep(j));

  /** X or Y of a place in a cell (15-15): the middle of 2^g pixels. */
  const codedPlace = (cell, place, g) => clip(256 * CELL * cell + place * (1 << (g + 8)) + (1 << (g + 7)), -X_MOST, X_MOST);

  /** g: a place in a cell is told in steps of 2^g pixels, for x of A and for y of B. */
  const placeStep = (logSize, j) => clip((logSize >> 10) + 1 - j, -4, 2);

  /** How many bits the place in the cell of each splat has, along x (sign 1) or y (sign -1). */
  function placeBits([sizes, aspects], j, sign) {
    const bits = new Uint8Array(j.length);
    for (let i = 0; i < bits.length; i++) bits[i] = 2 - placeStep(codedSize(sizes[i], aspects[i], j[i], sign), j[i]);
    return bits;
  }

  /**
   * The states of new splats.
   *
   * `codes` has columns: cells (column, row), colors (k0, k1, k2), shapes (size, aspect, shear) and places (x, y).
   */
  function intraStates({ cells: [columns, rows], colors, shapes: [sizes, aspects, shears], places: [xs, ys] }, D) {
    const j = classesOfCodes(colors, D);
    const [k0, k1, k2] = colors;
    const state = new Int32Array(8 * j.length);
    for (let i = 0, at = 0; i < j.length; i++, at += 8) {
      const A = codedSize(sizes[i], aspects[i], j[i], 1);
      const B = codedSize(sizes[i], aspects[i], j[i], -1);
      state[at] = codedPlace(columns[i], xs[i], placeStep(A, j[i]));
      state[at + 1] = codedPlace(rows[i], ys[i], placeStep(B, j[i]));
      state[at + 2] = A;
      state[at + 3] = B;
      state[at + 4] = clip(shears[i] * shearStep(j[i]), -S_MOST, S_MOST);
      state[at + 5] = codedColor(k0[i], D); // within its range: k was clipped
      state[at + 6] = codedColor(k1[i], D);
      state[at + 7] = codedColor(k2[i], D);
    }
    return state;
  }

  /** Columns and rows of the field of a frame. */
  const fieldSize = (width, height, side) => [Math.ceil(width / side), Math.ceil(height / side)];

  /** b: a cell of a field is 2^b wide, in 1/256 pixel. */
  const bitsOfCell = (side) => 31 - Math.clz32(256 * side);

  /**
   * (15-12): the motion of each splat, x and y in 1/256 pixel. A field has columns, rows, vectors, and the side of its cells,
   * which is 0 where there is none.
   */
  function fieldMotion(state, { columns, rows, vectors, side }) {
    if (side === 0) return new Int32Array(state.length / 4);
    const b = bitsOfCell(side);
    const [lastI, lastJ] = [Math.max(columns - 2, 0), Math.max(rows - 2, 0)]; // of cells that have another one after them
    const [right, below] = [columns > 1 ? 2 : 0, rows > 1 ? 2 * columns : 0]; // how far away that one stands
    const motion = new Int32Array(state.length / 4);
    for (let at = 0, to = 0; at < state.length; at += 8, to += 2) {
      const u = clip(state[at] - 128 * side, 0, (columns - 1) << b); // from the centre of the first cell
      const v = clip(state[at + 1] - 128 * side, 0, (rows - 1) << b);
      const i = Math.min(u >> b, lastI);
      const j = Math.min(v >> b, lastJ);
      const f = (u - (i << b)) >> (b - 6); // 64ths of the way between the centres of two cells
      const h = (v - (j << b)) >> (b - 6);
      for (let axis = 0; axis < 2; axis++) {
        const cell = 2 * (columns * j + i) + axis;
        const upper = (64 - f) * vectors[cell] + f * vectors[cell + right];
        const lower = (64 - f) * vectors[cell + below] + f * vectors[cell + below + right];
        motion[to + axis] = ((64 - h) * upper + h * lower + 32) >> 6;
      }
    }
    return motion;
  }

  /** States that a field moves, and that nothing else changes. */
  function movedBy(state, field) {
    const motion = fieldMotion(state, field);
    const after = state.slice();
    for (let at = 0, from = 0; at < after.length; at += 8, from += 2) {
      after[at] = clip(after[at] + motion[from], -X_MOST, X_MOST);
      after[at + 1] = clip(after[at + 1] + motion[from + 1], -X_MOST, X_MOST);
    }
    return after;
  }

  /** How much the vector of each cell differs from those of its neighbours. */
  function fieldUnrest({ columns, rows, vectors }) {
    const unrest = new Int32Array(columns * rows);
    const compare = (one, other) => {
      const step = Math.abs(vectors[2 * one] - vectors[2 * other]) +
        Math.abs(vectors[2 * one + 1] - vectors[2 * other + 1]);
      unrest[one] = Math.max(unrest[one], step);
      unrest[other] = Math.max(unrest[other], step);
    };
    for (let cell = 0; cell < unrest.length; cell++) {
      if ((cell + 1) % columns > 0) compare(cell, cell + 1);
      if (cell + columns < unrest.length) compare(cell, cell + columns);
    }
    return unrest;
  }

  /** The contexts of modes; `past` and `motion` are those of the splats of the frame before. */
  function modeContexts(state, past, motion, field, width, height) {
    const { side } = field;
    const unrest = side > 0 ? fieldUnrest(field) : null;
    const b = side > 0 ? bitsOfCell(side) : 0;
    const contexts = new Int32Array(past.length);
    for (let i = 0; i < contexts.length; i++) {
      const x = state[8 * i];
      const y = state[8 * i + 1];
      const X = x + motion[2 * i];
      const Y = y + motion[2 * i + 1];
      if (X < 0 || X >= 256 * width || Y < 0 || Y >= 256 * height) {
        contexts[i] = 9;
        continue;
      }
      contexts[i] = 3 * past[i];
      if (unrest === null) continue;
      const differs = unrest[field.columns * clip(y >> b, 0, field.rows - 1) + clip(x >> b, 0, field.columns - 1)];
      if (differs >= 3) contexts[i] += differs < 8 ? 1 : 2;
    }
    return contexts;
  }

  /** The first term of S in (15-13). */
  function sheared(S, v) {
    const shift = (v >> 10) - 15;
    const product = Math.abs(S) * EXP2[v & 1023]; // 0, or above S_MOST: what is shifted to the left is above it as well
    const magnitude = Math.min(shift >= 0 ? product : product >> Math.min(-shift, 31), S_MOST);
    return S < 0 ? -magnitude : magnitude;
  }

  /** How many splats stay, by the modes of all. */
  function stayingOf(modes) {
    let staying = 0;
    for (let n = 0; n < modes.length; n++) if (modes[n] !== REMOVED) staying += 1;
    return staying;
  }

  /** (15-13), clipped: the states of the splats that stay. Of mode 0 they only move: their differences q are all 0. */
  function addDifferences(state, motion, modes, q, D) {
    const after = new Int32Array(8 * stayingOf(modes));
    for (let n = 0, at = 0, to = 0; n < modes.length; n++, at += 8) {
      if (modes[n] === REMOVED) continue;
      const movedX = state[at] + motion[2 * n];
      const movedY = state[at + 1] + motion[2 * n + 1];
      if (modes[n] === 0) {
        after[to] = clip(movedX, -X_MOST, X_MOST);
        after[to + 1] = clip(movedY, -X_MOST, X_MOST);
        for (let c = 2; c < 8; c++) after[to + c] = state[at + c];
      } else {
        const A = state[at + 2];
        const B = state[at + 3];
        const S = state[at + 4];
        const j = classOf(state[at + 5], state[at + 6], state[at + 7], D);
        const gx = clip(exp2(A + 512 - 1024 * j, 8), 1, STEP_MOST);
        const gy = clip(exp2(B + 512 - 1024 * j, 8), 1, STEP_MOST);
        const gs = Math.min(Math.imul(Math.abs(S), gy) >>> 10, STEP_MOST);
        const newA = clipSize(A + (q[at + 2] + q[at + 3]) * sizeStep(j));
        const newB = clipSize(B + (q[at + 2] - q[at + 3]) * sizeStep(j));
        after[to] = clip(movedX + q[at] * gx, -X_MOST, X_MOST);
        after[to + 1] = clip(movedY + q[at] * (S < 0 ? -gs : gs) + q[at + 1] * gy, -X_MOST, X_MOST);
        after[to + 2] = newA;
        after[to + 3] = newB;
        after[to + 4] = clip(sheared(S, newA - A - (newB - B)) + q[at + 4] * shearStep(j), -S_MOST, S_MOST);
        for (let c = 5; c < 8; c++) after[to + c] = clip(state[at + c] + q[at + c] * D, -N_MOST, N_MOST);
      }
      to += 8;
    }
    return after;
  }

  /** What the next frame knows of the splats that stay: whether they were changed. */
  function pastOf(modes) {
    const past = new Uint8Array(stayingOf(modes));
    for (let n = 0, to = 0; n < modes.length; n++) if (modes[n] !== REMOVED) past[to++] = Math.min(modes[n], 1);
    return past;
  }

  Object.assign(main, {
    SIDES, CELL, REMOVED, sizeStep, shearStep, classesOf, stateParameters, mainWork, classesOfCodes, placeBits,
    intraStates, fieldSize, fieldMotion, movedBy, modeContexts, addDifferences, pastOf,
  });
}
