// Profile main, from codes to states and parameters: spec.md sections 15.4, 15.9 (15-10), 15.10 and 15.11 (15-13).
//
// States are flat: X, Y, A, B, S, n0, n1, n2 of each splat, 32 bits each.
"use strict";
globalThis.GSVC ??= {};
{
  const { main } = GSVC;
  const { EXP2, exp2, stepOf, classOf } = main;
  const fl = Math.fround;
  const SIDES = [0, 64, 32, 16]; // of the cells of a field, by `motion_cell`
  const CELL = 4; // pixels, of an I-frame
  const [X_MOST, A_LEAST, A_MOST, S_MOST, N_MOST] = [2 ** 25, -3072, 13311, 32767, 2 ** 28];
  const STEP_MOST = 2 ** 17 - 1;
  const REMOVED = 8;
  // MAIN_K1, MAIN_K2 and MAIN_K3 of section 15.4 by their bits.
  const [K1, K2, K3] = new Float32Array(Uint32Array.of(0x38a76e2b, 0x38cd0f39, 0x386cc843).buffer);

  const clip = (value, low, high) => Math.min(Math.max(value, low), high);
  const clipSize = (value) => clip(value, A_LEAST, A_MOST);
  const sizeStep = (j) => 1477 >> j; // h of (15-10)
  const shearStep = (j) => 2048 >> j;

  /** The classes of splats. */
  function classesOf(state, quantizer) {
    const D = stepOf(quantizer);
    return Int32Array.from({ length: state.length / 8 }, (_, i) =>
      classOf(state[8 * i + 5], state[8 * i + 6], state[8 * i + 7], D));
  }

  /** 2^(v / 1024), which is exact in binary32. */
  const powerOfTwo = (v) => EXP2[v & 1023] * 2 ** ((v >> 10) - 15);

  /** The parameters of states (15-5). */
  function stateParameters(state) {
    const parameters = new Float32Array(state.length);
    for (let at = 0; at < state.length; at += 8) {
      const l22 = powerOfTwo(state[at + 3]);
      const g = powerOfTwo(-(state[at + 2] + state[at + 3]) >> 1);
      const a = fl(fl(state[at + 5]) * K1);
      const b = fl(fl(state[at + 6]) * K2);
      const c = fl(fl(state[at + 7]) * K3);
      parameters[at] = fl(state[at]) / 256;
      parameters[at + 1] = fl(state[at + 1]) / 256;
      parameters[at + 2] = powerOfTwo(state[at + 2]);
      parameters[at + 3] = (state[at + 4] / 1024) * l22; // storing rounds
      parameters[at + 4] = l22;
      parameters[at + 5] = fl(fl(a + b) + c) * g;
      parameters[at + 6] = fl(a - 2 * c) * g;
      parameters[at + 7] = fl(fl(a - b) + c) * g;
    }
    return parameters;
  }

  /** n of colour codes. */
  const codedColor = (k, D) => clip(k, -Math.floor(N_MOST / D), Math.floor(N_MOST / D)) * D;

  /** The classes of splats with colour codes, of which there are three columns. */
  function classesOfCodes(colors, D) {
    return colors[0].map((_, i) => classOf(...colors.map((column) => codedColor(column[i], D)), D));
  }

  /** A (sign 1) or B (sign -1) of the codes of size and aspect (15-10). */
  const codedSize = (size, aspect, j, sign) => clipSize((size + sign * aspect) * sizeStep(j));

  /** g: a place in a cell is told in steps of 2^g pixels, for x of A and for y of B. */
  const placeStep = (logSize, j) => clip((logSize >> 10) + 1 - j, -4, 2);

  /**
   * The states of new splats.
   *
   * `codes` has columns: cells (column, row), colors (k0, k1, k2), shapes (size, aspect, shear) and places (x, y).
   */
  function intraStates({ cells, colors, shapes, places }, D) {
    const j = classesOfCodes(colors, D);
    const state = new Int32Array(8 * j.length);
    for (let i = 0, at = 0; i < j.length; i++, at += 8) {
      const [size, aspect, shear] = shapes.map((column) => column[i]);
      for (const [axis, sign] of [[0, 1], [1, -1]]) {
        const logSize = codedSize(size, aspect, j[i], sign);
        const g = placeStep(logSize, j[i]);
        const place = 256 * CELL * cells[axis][i] + places[axis][i] * 2 ** (g + 8) + 2 ** (g + 7);
        state[at + axis] = clip(place, -X_MOST, X_MOST);
        state[at + 2 + axis] = logSize;
      }
      state[at + 4] = clip(shear * shearStep(j[i]), -S_MOST, S_MOST);
      for (let c = 0; c < 3; c++) state[at + 5 + c] = codedColor(colors[c][i], D); // within its range: k was clipped
    }
    return state;
  }

  /** Columns and rows of the field of a frame. */
  const fieldSize = (width, height, side) => [Math.ceil(width / side), Math.ceil(height / side)];

  /** Along an axis: the cell before a position, the one behind it, and the 64ths of the way between their centres. */
  function between(position, side, cells) {
    const b = 31 - Math.clz32(256 * side);
    const u = clip(position - 128 * side, 0, (cells - 1) * 2 ** b);
    const i = Math.min(u >> b, Math.max(cells - 2, 0));
    return [i, Math.min(i + 1, cells - 1), (u - i * 2 ** b) >> (b - 6)];
  }

  /** (15-12): the motion of each splat, x and y in 1/256 pixel; a field has columns, rows and vectors. */
  function fieldMotion(state, { columns, rows, vectors }, side) {
    const motion = new Int32Array(state.length / 4);
    for (let at = 0, to = 0; at < state.length; at += 8) {
      const [i, i1, f] = between(state[at], side, columns);
      const [j, j1, h] = between(state[at + 1], side, rows);
      for (let axis = 0; axis < 2; axis++) {
        const of = (row, column) => vectors[2 * (columns * row + column) + axis];
        const upper = (64 - f) * of(j, i) + f * of(j, i1);
        const lower = (64 - f) * of(j1, i) + f * of(j1, i1);
        motion[to++] = ((64 - h) * upper + h * lower + 32) >> 6;
      }
    }
    return motion;
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

  /** The contexts of modes; `past` and `motion` are those of the splats of the frame before, side 0 means no field. */
  function modeContexts(state, past, motion, field, side, width, height) {
    const unrest = side > 0 ? fieldUnrest(field) : null;
    const cellOf = (position, cells) => clip(Math.floor(position / (256 * side)), 0, cells - 1);
    return Int32Array.from(past, (p, i) => {
      const [x, y] = [state[8 * i], state[8 * i + 1]];
      const [X, Y] = [x + motion[2 * i], y + motion[2 * i + 1]];
      if (X < 0 || X >= 256 * width || Y < 0 || Y >= 256 * height) return 9;
      if (unrest === null) return 3 * p;
      const differs = unrest[field.columns * cellOf(y, field.rows) + cellOf(x, field.columns)];
      return 3 * p + (differs < 3 ? 0 : differs < 8 ? 1 : 2);
    });
  }

  /** The first term of S in (15-13). */
  function sheared(S, v) {
    const magnitude = Math.floor(Math.abs(S) * EXP2[v & 1023] * 2 ** ((v >> 10) - 15));
    return Math.sign(S) * Math.min(magnitude, S_MOST);
  }

  /** (15-13), clipped: the states of splats that stay, from their differences q, 8 of each. */
  function addDifferences(state, motion, q, D) {
    const after = new Int32Array(state.length);
    for (let at = 0; at < state.length; at += 8) {
      const [X, Y, A, B, S, n0, n1, n2] = state.subarray(at, at + 8);
      const j = classOf(n0, n1, n2, D);
      const gx = clip(exp2(A + 512 - 1024 * j, 8), 1, STEP_MOST);
      const gy = clip(exp2(B + 512 - 1024 * j, 8), 1, STEP_MOST);
      const gs = Math.sign(S) * Math.min(Math.floor((Math.abs(S) * gy) / 1024), STEP_MOST);
      const newA = clipSize(A + (q[at + 2] + q[at + 3]) * sizeStep(j));
      const newB = clipSize(B + (q[at + 2] - q[at + 3]) * sizeStep(j));
      after[at] = clip(X + motion[at / 4] + q[at] * gx, -X_MOST, X_MOST);
      after[at + 1] = clip(Y + motion[at / 4 + 1] + q[at] * gs + q[at + 1] * gy, -X_MOST, X_MOST);
      after[at + 2] = newA;
      after[at + 3] = newB;
      after[at + 4] = clip(sheared(S, newA - A - (newB - B)) + q[at + 4] * shearStep(j), -S_MOST, S_MOST);
      for (let c = 5; c < 8; c++) after[at + c] = clip(state[at + c] + q[at + c] * D, -N_MOST, N_MOST);
    }
    return after;
  }

  Object.assign(main, {
    SIDES, CELL, REMOVED, sizeStep, shearStep, classesOf, stateParameters, classesOfCodes, codedSize, placeStep,
    intraStates, fieldSize, fieldMotion, modeContexts, addDifferences,
  });
}
