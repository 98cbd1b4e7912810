// Profile main, the bodies of frames: spec.md sections 15.5 to 15.12. Each table of section 15 is one function.
"use strict";
globalThis.GSVC ??= {};
{
  const { Fault, main, checkLimit } = GSVC;
  const { FAMILIES, CLASS_MOST, MAGNITUDE_CLASSES, SIDES, CELL, REMOVED, Run, FrameModels } = main;
  const { lowBitsOf, magnitudesOf, signsOf, sign } = main;
  const ALPHAS = [1, 2, 3, 4, 6, 10, 20, 100];
  const PLANES = ["luma", "chroma1", "chroma2", "size", "aspect", "shear"];
  const SLOPED = ["chroma1", "chroma2", "size", "aspect"];
  const GROUPS = [["position", 0, 2], ["shape", 2, 5], ["color", 5, 8]]; // of differences, by the bit of the mode

  const MOST_EXPONENT = 12; // of lanes; greater ones are reserved
  const MOST_QUANTIZER = 79; // greater ones are reserved
  const NO_FIELD = { columns: 0, rows: 0, vectors: new Int32Array(0), side: 0 };

  /**
   * What the profile carries from frame to frame: states and past of the splats, models, densities and quantizer or null.
   * Nothing changes one: a frame makes another.
   */
  const newMainState = () => ({
    splats: new Int32Array(0), past: new Uint8Array(0), models: main.FIRST_MODELS, densities: null, quantizer: null,
  });

  /** The halvings of a frame: two for each doubling of its cells. */
  const halvingCount = (width, height) =>
    2 * main.bitLength(Math.max(Math.ceil(width / CELL), Math.ceil(height / CELL)) - 1);

  /**
   * frame_body(type): its elements by name, with count, field, modes and differences; `after`, the state after it;
   * and `bits`, the code lengths of the parts of its run, with those of its densities.
   *
   * `before` is the state after the frame before; `state`, that of the stream, has header and limits, and `noted` as of
   * Run. Of a layer, `otherSplats` are those that the level counts beside its own, and `inherited` is the field that it has
   * without one of its own: that of the base.
   */
  function readBody(p, type, before, state, { otherSplats = 0, inherited = NO_FIELD } = {}) {
    const start = type === "I" ? newMainState() : before;
    const { header, noted } = state;
    const { width, height } = header;
    const referenceCount = start.past.length;
    const body = readTools(p, type, start, state, otherSplats);
    const densitiesBit = p.position();
    const densities = body.densities_present ? readDensities(p, halvingCount(width, height)) : start.densities;
    body.bits = { densities: p.position() - densitiesBit };
    Object.assign(body, { field: NO_FIELD, modes: new Int32Array(0), differences: new Int32Array(0) });
    body.after = { ...start, densities, quantizer: body.quantizer };
    if (body.count + referenceCount === 0) return body;
    const run = new Run(p, body.lane_exponent, body.bits, noted);
    const D = main.stepOf(body.quantizer);
    const parts = [];
    if (referenceCount > 0) parts.push(readPredicted(run, start, body, D, header, inherited));
    if (body.count > 0) parts.push(readIntra(run, body, D, header, type === "I" ? 0 : 2));
    const ends = run.passes(parts);
    const values = run.finish(ends.flatMap(({ late }) => late));
    for (const { late, finish } of ends) finish(body, values.splice(0, late.length));
    return body;
  }

  function joined(Type, first, second) {
    const all = new Type(first.length + second.length);
    all.set(first);
    all.set(second, first.length);
    return all;
  }

  /** The elements of a body before its densities. */
  function readTools(p, type, start, state, otherSplats) {
    const body = { quantizer: start.quantizer, densities_present: 0, count: 0 };
    const referenceCount = start.past.length;
    body.lane_exponent = p.u(4);
    if (body.lane_exponent > MOST_EXPONENT) throw new Fault("R-3.2-1", p.element);
    if (body.lane_exponent > state.header.max_lane_exponent) throw new Fault("R-15.5-1", p.element);
    body.motion_cell = p.u(2);
    if (body.motion_cell > 0 && referenceCount === 0) throw new Fault("R-15.5-2", p.element);
    body.quantizer_present = p.u(1);
    if (type === "I" && !body.quantizer_present) throw new Fault("R-15.5-5", p.element);
    const newPresent = p.u(1);
    if (body.quantizer_present) {
      body.quantizer = p.le(1);
      if (body.quantizer > MOST_QUANTIZER) throw new Fault("R-3.2-1", p.element);
    }
    if (newPresent) {
      const number = p.uv();
      body.count = Math.floor(number / 2) + 1;
      body.densities_present = number % 2;
    }
    const countBit = p.element;
    checkLimit("R-5-2", "splats", countBit, state, body.count + referenceCount + otherSplats);
    if (body.count > 0 && !body.densities_present) {
      if (type === "I") throw new Fault("R-15.5-3", countBit);
      if (start.densities === null) throw new Fault("R-15.5-4", countBit);
    }
    return body;
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

  /** The cells of splats, a halving a pass (15.8): columns and rows. */
  function* readCells(run, count, width, height, alphas) {
    let parts = wholeFrame(count);
    for (const [halving, alpha] of alphas.entries()) {
      run.begin("cells");
      const { axis, size, seconds } = halvingOf(halving, parts, width, height);
      parts = halved(parts, axis, size, run.halves(parts.counts, size, seconds, alpha));
      yield;
    }
    return cellsOf(parts);
  }

  /** Parts: the splats of all, those of each, never 0, and the first column and row of each. */
  const wholeFrame = (count) => ({ count, counts: Int32Array.of(count), origins: [Int32Array.of(0), Int32Array.of(0)] });

  /** The axis of a halving, the length of first halves, and the cells of each part's second half that are in the frame. */
  function halvingOf(halving, { counts, origins }, width, height) {
    const axis = halving % 2;
    const size = 2 ** (halvingCount(width, height) / 2 - 1 - (halving >> 1));
    const inside = Math.ceil((axis === 0 ? width : height) / CELL);
    const seconds = new Int32Array(counts.length);
    for (let part = 0; part < seconds.length; part++) {
      seconds[part] = Math.min(size, inside - origins[axis][part] - size);
    }
    return { axis, size, seconds };
  }

  /** The halves of parts that have splats, of which `first` has how many are in each first half. */
  function halved({ count, counts, origins }, axis, size, first) {
    const most = Math.min(2 * counts.length, count);
    const halves = new Int32Array(most);
    const places = [new Int32Array(most), new Int32Array(most)];
    let many = 0;
    for (let part = 0; part < counts.length; part++) {
      for (let half = 0; half < 2; half++) {
        const n = half === 0 ? first[part] : counts[part] - first[part];
        if (n === 0) continue;
        halves[many] = n;
        places[axis][many] = origins[axis][part] + half * size;
        places[1 - axis][many] = origins[1 - axis][part];
        many += 1;
      }
    }
    return { count, counts: halves.subarray(0, many), origins: places.map((column) => column.subarray(0, many)) };
  }

  /** Columns and rows of the cells of all splats. */
  const cellsOf = ({ count, counts, origins }) => origins.map((column) => repeated(column, counts, count));

  /** The same from the numbers in the first halves of all parts, halving by halving. */
  function cellsOfHalves(width, height, count, numbers) {
    let parts = wholeFrame(count);
    let at = 0;
    for (let halving = 0; halving < halvingCount(width, height); halving++) {
      const { axis, size, seconds } = halvingOf(halving, parts, width, height);
      const first = parts.counts.map((n, part) => (seconds[part] > 0 ? Math.min(numbers[at + part], n) : n));
      at += first.length;
      parts = halved(parts, axis, size, first);
    }
    return cellsOf(parts);
  }

  /** Values, each as often as `counts` says. */
  function repeated(values, counts, length) {
    const all = new Int32Array(length);
    for (let i = 0, at = 0; i < counts.length; i++) for (let k = counts[i]; k > 0; k--) all[at++] = values[i];
    return all;
  }

  /**
   * The passes of the splats of an I-frame, or of new ones (15.9), which all get this `past`. Returns, as all such
   * generators do, its `late` raw values as of Run, and `finish`, which takes them and completes the body.
   */
  function* readIntra(run, { count, after: { densities } }, D, { width, height }, past) {
    const cells = yield* readCells(run, count, width, height, densities.alphas);
    run.begin("luma");
    const { luma } = densities;
    const q = run.symbols([main.magnitudeDensity(luma, luma.centre)], new Int32Array(count));
    const colors = [magnitudesOf(q, run.early(lowBitsOf(q)))];
    yield;
    run.begin("chroma");
    const classes = ["chroma1", "chroma2"].map((plane) => {
      const { centre, slope } = densities[plane];
      const tables = Array.from({ length: MAGNITUDE_CLASSES }, (_, of) =>
        main.magnitudeDensity(densities[plane], centre + ((slope * of) >> 2)));
      return run.symbols(tables, q);
    });
    for (const of of classes) colors.push(magnitudesOf(of, run.early(lowBitsOf(of))));
    yield;
    const j = main.classesOfCodes(colors, D);
    const [size, aspect, shear] = [["size", main.sizeStep], ["aspect", main.sizeStep], ["shear", main.shearStep]]
      .map(([plane, h]) => readWindowed(run, plane, densities[plane], h, j));
    for (const { plane, codes, lowBits } of [size, aspect]) {
      run.begin(plane);
      addLowBits(codes, lowBits, run.early(lowBits));
    }
    const shapes = [size.codes, aspect.codes, shear.codes];
    const signs = colors.map((magnitudes, i) => [i === 0 ? "luma" : "chroma", signsOf(magnitudes)]);
    const places = [1, -1].map((axis) => ["place", main.placeBits(shapes, j, axis)]);
    return {
      late: [...signs, ["shear", shear.lowBits], ...places],
      finish({ after }, [...values]) {
        colors.forEach((magnitudes, i) => sign(magnitudes, values[i]));
        addLowBits(shear.codes, shear.lowBits, values[3]);
        const splats = main.intraStates({ cells, colors, shapes, places: values.slice(4) }, D);
        after.splats = joined(Int32Array, after.splats, splats);
        after.past = joined(Uint8Array, after.past, new Uint8Array(count).fill(past));
      },
    };
  }

  /** The codes of size, aspect or shear, of splats of the classes j, without their low bits; and how many they have. */
  function readWindowed(run, plane, density, h, j) {
    run.begin(plane);
    const windows = Array.from({ length: CLASS_MOST + 1 }, (_, of) =>
      main.windowDensity(density, 64 * density.centre + 16 * density.slope * of, h(of)));
    const codes = run.symbols(windows.map(({ C }) => C), j);
    const lowBits = new Uint8Array(j.length);
    for (let i = 0; i < codes.length; i++) {
      const { lowBits: r, first } = windows[j[i]];
      lowBits[i] = r;
      codes[i] = (codes[i] + first) << r;
    }
    return { plane, codes, lowBits };
  }

  function addLowBits(codes, lowBits, low) {
    for (let i = 0; i < codes.length; i++) codes[i] |= low[i];
  }

  /** The passes of what a P-frame says of the splats of the frame before; in the end what they become. */
  function* readPredicted(run, start, body, D, { width, height }, inherited) {
    const models = new FrameModels(start.models);
    const side = SIDES[body.motion_cell];
    if (side > 0) body.field = yield* readField(run, models, width, height, side);
    else yield* [null, null]; // two passes without a symbol
    const field = side > 0 ? body.field : inherited;
    const motion = main.fieldMotion(start.splats, field);
    run.begin("modes");
    const contexts = main.modeContexts(start.splats, start.past, motion, field, width, height);
    const modes = (body.modes = models.symbols(run, "mode", contexts));
    yield;
    const components = yield* readDifferences(run, models, modes);
    return {
      late: components.flatMap(({ part, q, signs }) => [[part, lowBitsOf(q)], [part, signs]]),
      finish({ after }, values) {
        const differences = (body.differences = new Int32Array(8 * modes.length));
        components.forEach(({ q, changed, isLast, column, isOneMore }, i) => {
          const magnitudes = magnitudesOf(q, values[2 * i]);
          if (isLast) for (let k = 0; k < magnitudes.length; k++) magnitudes[k] += isOneMore[k];
          sign(magnitudes, values[2 * i + 1]);
          for (let k = 0; k < magnitudes.length; k++) differences[8 * changed[k] + column] = magnitudes[k];
        });
        after.splats = main.addDifferences(start.splats, motion, modes, differences, D);
        after.past = main.pastOf(modes);
        after.models = models.adapted();
      },
    };
  }

  /** The two passes of the field (15.10): columns, rows, side, and the vectors row by row. */
  function* readField(run, models, width, height, side) {
    const [columns, rows] = main.fieldSize(width, height, side);
    const steps = new Int32Array(2 * columns * rows);
    let contexts = new Int32Array(columns * rows);
    for (let axis = 0; axis < 2; axis++) {
      run.begin("motion");
      const q = models.symbols(run, "vector", contexts);
      const magnitudes = magnitudesOf(q, run.early(lowBitsOf(q)));
      sign(magnitudes, run.early(signsOf(magnitudes))).forEach((step, cell) => (steps[2 * cell + axis] = step));
      contexts = q.map((of) => (of === 0 ? 1 : of <= 2 ? 2 : of <= 7 ? 3 : 4));
      yield;
    }
    return { columns, rows, vectors: fieldVectors(steps, columns), side };
  }

  /** The vectors of a field, from the differences that are coded. */
  function fieldVectors(steps, columns) {
    const vectors = new Int32Array(steps.length);
    for (let at = 0; at < steps.length; at++) {
      const from = (at >> 1) % columns > 0 ? at - 2 : at - 2 * columns; // to the left, or above in the first column
      vectors[at] = (((from < 0 ? 0 : vectors[from]) + steps[at]) << 16) >> 16; // -2^15 .. 2^15 - 1
    }
    return vectors;
  }

  /**
   * The passes of the differences, a component of each group in each, but for their low bits and signs: of each component,
   * group by group, the classes `q` of the splats `changed`, whether their magnitudes are one more, and their signs.
   */
  function* readDifferences(run, models, modes) {
    const groups = GROUPS.map(([part, first, end], bit) => {
      const changed = splatsWith(modes, bit);
      return { part, first, end, changed, sums: new Int32Array(changed.length), components: [] };
    });
    for (let i = 0; i < 3; i++) {
      for (const { part, first, end, changed, sums, components } of groups) {
        if (i === end - first) continue;
        run.begin(part);
        const contexts = new Int32Array(changed.length);
        if (i > 0) for (let k = 0; k < sums.length; k++) contexts[k] = 3 * (i - 1) + 1 + Math.min(sums[k], 2);
        const q = models.symbols(run, part, contexts);
        const isOneMore = new Uint8Array(q.length);
        const signs = new Uint8Array(q.length);
        const isLast = i === end - first - 1; // it is not 0 where all before it are
        for (let k = 0; k < q.length; k++) {
          isOneMore[k] = isLast && sums[k] === 0 ? 1 : 0;
          signs[k] = q[k] + isOneMore[k] === 0 ? 0 : 1;
          sums[k] += q[k]; // at least 2 where the magnitude is
        }
        components.push({ part, q, changed, isLast, column: first + i, isOneMore, signs });
      }
      if (i < 2) yield;
    }
    return groups.flatMap(({ components }) => components);
  }

  /** The splats that have differences of a group, by the bit of their mode. */
  function splatsWith(modes, bit) {
    const found = new Int32Array(modes.length);
    let many = 0;
    for (let n = 0; n < modes.length; n++) if (modes[n] !== REMOVED && (modes[n] >> bit) & 1) found[many++] = n;
    return found.subarray(0, many);
  }

  /**
   * What a frame, or a layer of one, says of its splats: type, newCount, and survivors (a number for each splat of the
   * frame before, 0 if it is removed) or null; `body` is null if it repeats the one before.
   */
  const toldOf = (type, body) =>
    ({ type, newCount: body?.count ?? 0, survivors: type === "P" ? survivorsOf(body.modes) : null });

  function survivorsOf(modes) {
    const survivors = new Uint8Array(modes.length);
    for (let n = 0; n < modes.length; n++) survivors[n] = modes[n] === REMOVED ? 0 : 1;
    return survivors;
  }

  Object.assign(main, { NO_FIELD, newMainState, readBody, toldOf, cellsOfHalves, fieldVectors });
}
