// Profile main, the bodies of frames: spec.md sections 15.5 to 15.12. Each table of section 15 is one function.
"use strict";
globalThis.GSVC ??= {};
{
  const { Fault, main } = GSVC;
  const { FAMILIES, CLASS_MOST, MAGNITUDE_CLASSES, SIDES, CELL, REMOVED, Run, FrameModels } = main;
  const ALPHAS = [1, 2, 3, 4, 6, 10, 20, 100];
  const PLANES = ["luma", "chroma1", "chroma2", "size", "aspect", "shear"];
  const SLOPED = ["chroma1", "chroma2", "size", "aspect"];
  const GROUPS = [["position", 0, 2], ["shape", 2, 5], ["color", 5, 8]]; // of differences, by the bit of the mode

  /**
   * What the profile carries from frame to frame: states and past of the splats, models, and densities or null. Nothing
   * changes one: a frame makes another.
   */
  const newMainState = () =>
    ({ splats: new Int32Array(0), past: new Uint8Array(0), models: main.newModels(), densities: null });

  /** The halvings of a frame: two for each doubling of its cells. */
  const halvingCount = (width, height) =>
    2 * main.bitLength(Math.max(Math.ceil(width / CELL), Math.ceil(height / CELL)) - 1);

  /**
   * frame_body(type): its elements by name, with count, vectors, modes and differences; `after`, the state behind it;
   * and `bits`, the code lengths of the parts of its run, with those of its densities.
   *
   * `before` is the state behind the frame before, `header` the sequence header, and `mostSplats` what the level allows.
   */
  function readBody(p, type, before, header, mostSplats) {
    const start = type === "I" ? newMainState() : before;
    const { width, height } = header;
    const referenceCount = start.past.length;
    const body = readTools(p, referenceCount, header.lane_count);
    body.count = p.uv();
    if (body.count + referenceCount > mostSplats) throw new Fault("R-5-2", p.element);
    checkDensities(body, type, start);
    const densitiesBit = p.position();
    const densities = body.densities_present ? readDensities(p, halvingCount(width, height)) : start.densities;
    body.bits = { densities: p.position() - densitiesBit };
    Object.assign(body, { vectors: new Int32Array(0), modes: new Int32Array(0), differences: new Int32Array(0) });
    body.after = { ...start, densities };
    if (body.count + referenceCount === 0) return body;
    const run = new Run(p, body.lane_exponent, body.bits);
    const D = main.stepOf(body.quantizer);
    if (referenceCount > 0) Object.assign(body.after, readPredicted(run, start, body, D, width, height));
    if (body.count > 0) {
      const added = readIntra(run, body.count, D, width, height, densities);
      body.after.splats = joined(Int32Array, body.after.splats, added);
      body.after.past = joined(Uint8Array, body.after.past, new Uint8Array(body.count).fill(type === "I" ? 0 : 2));
    }
    run.finish();
    return body;
  }

  function joined(Type, first, second) {
    const all = new Type(first.length + second.length);
    all.set(first);
    all.set(second, first.length);
    return all;
  }

  /** The elements of a body before its count. */
  function readTools(p, referenceCount, laneCount) {
    const body = {};
    body.quantizer = p.le(1);
    if (body.quantizer > 79) throw new Fault("R-3.2-1", p.element);
    body.lane_exponent = p.u(3);
    if (2 ** body.lane_exponent > laneCount) throw new Fault("R-15.5-1", p.element);
    body.motion_cell = p.u(2);
    if (body.motion_cell > 0 && referenceCount === 0) throw new Fault("R-15.5-2", p.element);
    body.densities_present = p.u(1);
    body.densitiesBit = p.element;
    if (p.u(2) !== 0) throw new Fault("R-3.2-1", p.element); // frame_reserved
    return body;
  }

  function checkDensities({ densities_present: present, count, densitiesBit }, type, start) {
    const wrong = present ? count === 0 : count > 0 && type === "I";
    if (wrong) throw new Fault("R-15.5-3", densitiesBit);
    if (!present && count > 0 && start.densities === null) throw new Fault("R-15.5-4", densitiesBit);
  }

  /** densities(): of each plane T, scaleCode, centre and slope; and `alphas`, that of each halving. */
  function readDensities(p, halvings) {
    const densities = {};
    for (const plane of PLANES) {
      const T = FAMILIES[p.u(1)];
      const scaleCode = p.u(5);
      const centre = p.u(10) - 512;
      densities[plane] = { T, scaleCode, centre, slope: SLOPED.includes(plane) ? p.u(8) - 128 : 0 };
    }
    densities.alphas = Array.from({ length: halvings }, () => ALPHAS[p.u(3)]);
    p.align();
    return densities;
  }

  /** The cells of splats, halving by halving (15.8): columns and rows. */
  function readCells(run, count, width, height, alphas) {
    const inside = [Math.ceil(width / CELL), Math.ceil(height / CELL)];
    let size = 2 ** (alphas.length / 2);
    let parts = [{ origin: [0, 0], n: count }];
    alphas.forEach((alpha, halving) => {
      const axis = halving % 2;
      if (axis === 0) size /= 2;
      const tables = new Map(); // by n and the cells of the second half
      const asked = [];
      for (const part of parts) {
        const q = Math.min(size, inside[axis] - part.origin[axis] - size);
        if (q <= 0) continue;
        const key = part.n * 2 ** 16 + q;
        if (!tables.has(key)) tables.set(key, main.halves(part.n, size, q, alpha));
        asked.push({ part, table: tables.get(key) });
      }
      const upper = run.symbols(asked.map(({ table }) => table.C), asked.map((_, i) => i));
      const lower = run.rawBits(Int32Array.from(asked, ({ table }) => table.lowBits));
      const first = new Map(asked.map(({ part, table }, i) => [part, upper[i] * 2 ** table.lowBits + lower[i]]));
      const halves = [];
      for (const part of parts) {
        const k = Math.min(first.get(part) ?? part.n, part.n);
        const other = [...part.origin];
        other[axis] += size;
        if (k > 0) halves.push({ origin: part.origin, n: k });
        if (k < part.n) halves.push({ origin: other, n: part.n - k });
      }
      parts = halves;
    });
    const cells = [new Int32Array(count), new Int32Array(count)];
    let at = 0;
    for (const { origin, n } of parts) {
      cells.forEach((column, axis) => column.fill(origin[axis], at, at + n));
      at += n;
    }
    return cells;
  }

  /** The states of the splats of an I-frame, or of new ones (15.9). */
  function readIntra(run, count, D, width, height, densities) {
    run.part = "cells";
    const cells = readCells(run, count, width, height, densities.alphas);
    run.part = "luma";
    const { luma } = densities;
    const { q, magnitudes } = run.magnitudes([main.magnitudeDensity(luma, luma.centre)], new Int32Array(count));
    const colors = [run.signed(magnitudes)];
    run.part = "chroma";
    for (const plane of ["chroma1", "chroma2"]) {
      const { centre, slope } = densities[plane];
      const tables = Array.from({ length: MAGNITUDE_CLASSES }, (_, of) =>
        main.magnitudeDensity(densities[plane], centre + Math.floor((slope * of) / 4)));
      colors.push(run.signed(run.magnitudes(tables, q).magnitudes));
    }
    const j = main.classesOfCodes(colors, D);
    const shapes = [["size", main.sizeStep], ["aspect", main.sizeStep], ["shear", main.shearStep]].map(([plane, h]) => {
      run.part = plane;
      return readWindowed(run, densities[plane], h, j);
    });
    run.part = "place";
    const places = [1, -1].map((sign) => run.rawBits(j.map((of, i) =>
      2 - main.placeStep(main.codedSize(shapes[0][i], shapes[1][i], of, sign), of))));
    return main.intraStates({ cells, colors, shapes, places }, D);
  }

  /** The codes of size, aspect or shear, of splats of the classes j: bins, and low bits. */
  function readWindowed(run, density, h, j) {
    const windows = Array.from({ length: CLASS_MOST + 1 }, (_, of) =>
      main.windowDensity(density, 64 * density.centre + 16 * density.slope * of, h(of)));
    const bins = run.symbols(windows.map(({ C }) => C), j);
    const low = run.rawBits(j.map((of) => windows[of].lowBits));
    return bins.map((bin, i) => (bin + windows[j[i]].first) * 2 ** windows[j[i]].lowBits + low[i]);
  }

  /** What a P-frame says of the splats of the frame before; the splats, past and models that they become. */
  function readPredicted(run, start, body, D, width, height) {
    const models = new FrameModels(start.models);
    const side = SIDES[body.motion_cell];
    let motion = new Int32Array(2 * start.past.length);
    let field = null;
    if (side > 0) {
      run.part = "motion";
      field = readField(run, models, width, height, side);
      body.vectors = field.vectors;
      motion = main.fieldMotion(start.splats, field, side);
    }
    run.part = "modes";
    const contexts = main.modeContexts(start.splats, start.past, motion, field, side, width, height);
    body.modes = models.symbols(run, "mode", contexts);
    body.differences = readDifferences(run, models, body.modes);
    const stay = (values, columns) => values.filter((_, i) => body.modes[Math.floor(i / columns)] !== REMOVED);
    return {
      splats: main.addDifferences(stay(start.splats, 8), stay(motion, 2), stay(body.differences, 8), D),
      past: Uint8Array.from(stay(body.modes, 1), (mode) => Math.min(mode, 1)),
      models: models.adapted(),
    };
  }

  /** The field (15.10): columns, rows, and the vectors row by row. */
  function readField(run, models, width, height, side) {
    const [columns, rows] = main.fieldSize(width, height, side);
    const x = models.magnitudes(run, "vector", new Int32Array(columns * rows));
    const y = models.magnitudes(run, "vector", x.q.map((q) => (q === 0 ? 1 : q <= 2 ? 2 : q <= 7 ? 3 : 4)));
    const vectors = new Int32Array(2 * columns * rows);
    [run.signed(x.magnitudes), run.signed(y.magnitudes)].forEach((steps, axis) => {
      steps.forEach((step, cell) => {
        const from = cell % columns > 0 ? cell - 1 : cell - columns; // to the left, or above in the first column
        const before = from < 0 ? 0 : vectors[2 * from + axis];
        vectors[2 * cell + axis] = ((before + step) << 16) >> 16; // -2^15 .. 2^15 - 1
      });
    });
    return { columns, rows, vectors };
  }

  /** The differences q, 8 of each splat of the frame before. */
  function readDifferences(run, models, modes) {
    const q = new Int32Array(8 * modes.length);
    GROUPS.forEach(([group, first, end], bit) => {
      run.part = group;
      const changed = [];
      modes.forEach((mode, n) => mode !== REMOVED && (mode >> bit) & 1 && changed.push(n));
      const before = new Int32Array(changed.length); // the sums of the magnitudes of the components before
      const columns = [];
      for (let i = 0; i < end - first; i++) {
        const contexts = before.map((sum) => (i === 0 ? 0 : 3 * (i - 1) + 1 + Math.min(sum, 2)));
        const { magnitudes } = models.magnitudes(run, group, contexts);
        const isLast = i === end - first - 1; // it is not 0 where all before it are
        columns.push(magnitudes.map((magnitude, n) => magnitude + (isLast && before[n] === 0 ? 1 : 0)));
        columns[i].forEach((magnitude, n) => (before[n] += magnitude));
      }
      columns.forEach((magnitudes, i) =>
        run.signed(magnitudes).forEach((value, n) => (q[8 * changed[n] + first + i] = value)));
    });
    return q;
  }

  /**
   * What a frame, or a layer of one, says of its splats: type, newCount, and survivors (a number for each splat of the
   * frame before, 0 if it is removed) or null; `body` is null if it repeats the one before.
   */
  const toldOf = (type, body) => ({
    type,
    newCount: body?.count ?? 0,
    survivors: type === "P" ? body.modes.map((mode) => (mode === REMOVED ? 0 : 1)) : null,
  });

  Object.assign(main, { newMainState, readBody, toldOf });
}
