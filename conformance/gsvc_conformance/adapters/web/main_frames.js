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
    ({ splats: new Int32Array(0), past: new Uint8Array(0), models: main.FIRST_MODELS, densities: null });

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
    let counts = Int32Array.of(count); // of the splats of each part, none of which is empty
    let origins = [Int32Array.of(0), Int32Array.of(0)]; // the first column and the first row of each
    alphas.forEach((alpha, halving) => {
      const axis = halving % 2;
      if (axis === 0) size /= 2;
      const seconds = new Int32Array(counts.length);
      for (let part = 0; part < seconds.length; part++) {
        seconds[part] = Math.min(size, inside[axis] - origins[axis][part] - size);
      }
      const first = run.halves(counts, size, seconds, alpha);
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
      counts = halves.subarray(0, many);
      origins = places.map((column) => column.subarray(0, many));
    });
    return origins.map((column) => repeated(column, counts, count));
  }

  /** Values, each as often as `counts` says. */
  function repeated(values, counts, length) {
    const all = new Int32Array(length);
    for (let i = 0, at = 0; i < counts.length; i++) for (let k = counts[i]; k > 0; k--) all[at++] = values[i];
    return all;
  }

  /** The states of the splats of an I-frame, or of new ones (15.9). */
  function readIntra(run, count, D, width, height, densities) {
    run.begin("cells");
    const cells = readCells(run, count, width, height, densities.alphas);
    run.begin("luma");
    const { luma } = densities;
    const { q, magnitudes } = run.magnitudes([main.magnitudeDensity(luma, luma.centre)], new Int32Array(count));
    const colors = [run.signed(magnitudes)];
    run.begin("chroma");
    for (const plane of ["chroma1", "chroma2"]) {
      const { centre, slope } = densities[plane];
      const tables = Array.from({ length: MAGNITUDE_CLASSES }, (_, of) =>
        main.magnitudeDensity(densities[plane], centre + Math.floor((slope * of) / 4)));
      colors.push(run.signed(run.magnitudes(tables, q).magnitudes));
    }
    const j = main.classesOfCodes(colors, D);
    const shapes = [["size", main.sizeStep], ["aspect", main.sizeStep], ["shear", main.shearStep]].map(([plane, h]) => {
      run.begin(plane);
      return readWindowed(run, densities[plane], h, j);
    });
    run.begin("place");
    const places = [1, -1].map((sign) => run.rawBits(main.placeBits(shapes, j, sign)));
    return main.intraStates({ cells, colors, shapes, places }, D);
  }

  /** The codes of size, aspect or shear, of splats of the classes j: bins, and low bits. */
  function readWindowed(run, density, h, j) {
    const windows = Array.from({ length: CLASS_MOST + 1 }, (_, of) =>
      main.windowDensity(density, 64 * density.centre + 16 * density.slope * of, h(of)));
    const codes = run.symbols(windows.map(({ C }) => C), j);
    const sizes = new Uint8Array(j.length);
    for (let i = 0; i < sizes.length; i++) sizes[i] = windows[j[i]].lowBits;
    const low = run.rawBits(sizes);
    for (let i = 0; i < codes.length; i++) codes[i] = ((codes[i] + windows[j[i]].first) << sizes[i]) + low[i];
    return codes;
  }

  /** What a P-frame says of the splats of the frame before; the splats, past and models that they become. */
  function readPredicted(run, start, body, D, width, height) {
    const models = new FrameModels(start.models);
    const side = SIDES[body.motion_cell];
    let motion = new Int32Array(2 * start.past.length);
    let field = null;
    if (side > 0) {
      run.begin("motion");
      field = readField(run, models, width, height, side);
      body.vectors = field.vectors;
      motion = main.fieldMotion(start.splats, field, side);
    }
    run.begin("modes");
    const contexts = main.modeContexts(start.splats, start.past, motion, field, side, width, height);
    body.modes = models.symbols(run, "mode", contexts);
    body.differences = readDifferences(run, models, body.modes);
    return {
      splats: main.addDifferences(start.splats, motion, body.modes, body.differences, D),
      past: main.pastOf(body.modes),
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
      run.begin(group);
      const changed = splatsWith(modes, bit);
      const before = new Int32Array(changed.length); // the sums of the magnitudes of the components before
      const contexts = new Int32Array(changed.length);
      const columns = [];
      for (let i = 0; i < end - first; i++) {
        if (i > 0) for (let k = 0; k < before.length; k++) contexts[k] = 3 * (i - 1) + 1 + Math.min(before[k], 2);
        const { magnitudes } = models.magnitudes(run, group, contexts);
        const isLast = i === end - first - 1; // it is not 0 where all before it are
        for (let k = 0; k < before.length; k++) {
          if (isLast && before[k] === 0) magnitudes[k] += 1;
          before[k] += magnitudes[k];
        }
        columns.push(magnitudes);
      }
      columns.forEach((magnitudes, i) => {
        const values = run.signed(magnitudes);
        for (let k = 0; k < values.length; k++) q[8 * changed[k] + first + i] = values[k];
      });
    });
    return q;
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

  Object.assign(main, { newMainState, readBody, toldOf });
}
