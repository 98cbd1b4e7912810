// The operations of conformance/protocol.md that this decoder has, by name.
"use strict";
globalThis.GSVC ??= {};
{
  const { Bits, Fault, readPlane, encodeSymbols, halfValues, halfBits, reconstructIntra, reconstructInter } = GSVC;
  const { parameterChecksum, renderingWork, readStart, readFrames, framesBetween, framesWithLayers, toFrame } = GSVC;
  const { scaleParameters, scaleParametersFiltered, renderSumDeterministic, toFrameDeterministic, main } = GSVC;

  /** An operation can't do what its inputs ask for. */
  class Unsupported extends Error {}

  const TYPES = {
    "|u1": Uint8Array, "<u2": Uint16Array, "<u4": Uint32Array, "<i8": BigInt64Array, "<f4": Float32Array,
    "<f8": Float64Array,
  };

  /** An array of an operation: {data: a typed array, shape, dtype}; whole numbers may be given as numbers for <i8. */
  function array(dtype, shape, values) {
    if (values instanceof TYPES[dtype]) return { data: values, shape, dtype };
    if (dtype !== "<i8") return { data: TYPES[dtype].from(values), shape, dtype };
    return { data: BigInt64Array.from(values, BigInt), shape, dtype };
  }

  const numbers = (given) => Array.from(given.data, Number);
  const rows = (values, columns, dtype) => array(dtype, [values.length / columns, columns], values);
  const list = (values, dtype) => array(dtype, [values.length], values);
  const single = (value, dtype) => array(dtype, [], [value]);
  const sampleType = (bitDepth) => (bitDepth === 8 ? "|u1" : "<u2");

  /** All values of arrays, one array after the other. */
  function joined(dtype, parts) {
    const values = new TYPES[dtype](parts.reduce((length, part) => length + part.length, 0));
    parts.reduce((at, part) => (values.set(part, at), at + part.length), 0);
    return values;
  }

  /** The inputs of reconstruct_intra and reconstruct_inter as reconstruction.js has them. */
  const codesOf = (inputs) => ({
    positions: inputs.positions.data,
    cholesky: inputs.cholesky.data,
    scale: inputs.scale.data,
    offset: inputs.offset.data,
    colorIndices: inputs.color_indices.data,
    codebookSizes: numbers(inputs.codebook_sizes),
    codewords: inputs.codewords.data,
  });

  /** The states of an operation of profile main. */
  const statesOf = (given) => Int32Array.from(given.data, Number);

  /** A field of vectors (rows, columns, 2). */
  const fieldOf = ({ data, shape: [rows, columns] }, motionCell) =>
    ({ rows, columns, vectors: Int32Array.from(data, Number), side: main.SIDES[motionCell] });

  /** The columns of an array (N, k). */
  function columnsOf({ data, shape: [count, width] }) {
    return Array.from({ length: width }, (_, c) => Int32Array.from({ length: count }, (_, i) => Number(data[width * i + c])));
  }

  /** The rows of an array of counts. */
  const rowsOf = ({ data, shape: [count, width] }) =>
    Array.from({ length: count }, (_, i) => Uint32Array.from(data.subarray(width * i, width * (i + 1)), Number));

  /** Counts and parameters of frames, up to the Fault that ends them, if one does. */
  function splatsOf(frames) {
    const found = [];
    let error = "";
    try {
      for (const frame of frames) found.push(frame.parameters);
    } catch (fault) {
      if (!(fault instanceof Fault)) throw fault;
      error = fault.message;
    }
    const counts = list(found.map((parameters) => parameters.length / 8), "<i8");
    return { counts, parameters: rows(joined("<f4", found), 8, "<f4"), error };
  }

  const operations = {
    async read_stream({ stream }) {
      const { s, state } = readStart(stream);
      return described(state.header, [...readFrames(s, state)]);
    },

    async decode_plane({ data, count, alphabet, entropy_precision, lane_count }) {
      const symbols = readPlane(new Bits(data.data), { entropy_precision, lane_count }, count, alphabet);
      return { symbols: list(symbols, "<u2") };
    },

    async encode_plane({ symbols, frequencies, entropy_precision, lane_count }) {
      const coded = encodeSymbols(symbols.data, numbers(frequencies), entropy_precision, lane_count);
      return { lane_states: list(coded.laneStates, "<u4"), words: list(coded.words, "<u2") };
    },

    async reconstruct_stream({ stream }) {
      return splatsOf(framesBetween(stream, 0, Infinity));
    },

    async seek({ stream, first, last }) {
      return splatsOf(framesBetween(stream, first, last));
    },

    async decode_stream({ stream }) {
      return decoded(stream, boundedFrame);
    },

    async decode_stream_deterministic({ stream }) {
      return decoded(stream, (parameters, { width, height, bit_depth }) =>
        toFrameDeterministic(renderSumDeterministic(parameters, width, height), bit_depth));
    },

    async from_half({ bits }) {
      return { values: list(halfValues(bits.data), "<f4") };
    },

    async to_half({ values }) {
      return { bits: list(Uint16Array.from(values.data, halfBits), "<u2") };
    },

    async reconstruct_intra(inputs) {
      const { width, height } = inputs;
      return { parameters: rows(reconstructIntra(width, height, codesOf(inputs)), 8, "<f4") };
    },

    async reconstruct_inter(inputs) {
      const { width, height, reference, survivors } = inputs;
      const parameters = reconstructInter(width, height, reference.data, survivors.data, codesOf(inputs));
      return { parameters: rows(parameters, 8, "<f4") };
    },

    async parameter_checksum({ parameters }) {
      return { checksum: single(parameterChecksum(parameters.data), "<i8") };
    },

    async rendering_work({ parameters, width, height }) {
      return { work: single(renderingWork(parameters.data, width, height), "<i8") };
    },

    async render_sum({ parameters, width, height }) {
      return { sum: array("<f4", [height, width, 3], await boundedSum(parameters.data, width, height)) };
    },

    async render_sum_deterministic({ parameters, width, height }) {
      return { sum: array("<f4", [height, width, 3], renderSumDeterministic(parameters.data, width, height)) };
    },

    async to_frame({ sum, bit_depth }) {
      return { frame: array(sampleType(bit_depth), sum.shape, toFrame(sum.data, bit_depth)) };
    },

    async to_frame_deterministic({ sum, bit_depth }) {
      return { frame: array(sampleType(bit_depth), sum.shape, toFrameDeterministic(sum.data, bit_depth)) };
    },

    async render_frame({ parameters, width, height, bit_depth }) {
      const frame = await boundedFrame(parameters.data, { width, height, bit_depth });
      return { frame: array(sampleType(bit_depth), [height, width, 3], frame) };
    },

    async read_main_stream({ stream }) {
      const { s, state } = readStart(stream);
      state.noted = [];
      return describedMain(state.header, [...readFrames(s, state)], state.noted);
    },

    async reconstruct_layers({ stream, layer }) {
      return splatsOf(framesWithLayers(stream, layer));
    },

    async decode_layers({ stream, layer }) {
      return decoded(stream, boundedFrame, layer);
    },

    async encode_run(inputs) {
      const named = (names) => Object.fromEntries(names.map(([name, input]) => [name, numbers(inputs[input])]));
      const coded = main.encodeRun({
        ...named([["starts", "starts"], ["frequencies", "frequencies"], ["lanes", "lanes"], ["early", "early"],
          ["earlySizes", "early_sizes"], ["late", "late"], ["lateSizes", "late_sizes"]]),
        laneCount: inputs.lane_count,
      });
      return {
        lane_states: list(coded.laneStates, "<u4"),
        word_counts: list(coded.wordCounts, "<i8"),
        words: list(coded.words, "<u2"),
        tail: list(coded.tail, "|u1"),
      };
    },

    async density_frequencies({ edges, centre, density_family, scale_code, unit_bits }) {
      const inner = numbers(edges);
      const T = main.FAMILIES[density_family];
      const C = main.density(inner.length + 1, (i) => inner[i - 1], centre, T, scale_code, unit_bits);
      return { cumulative: list(C, "<i8") };
    },

    async window_frequencies({ centre, step, density_family, scale_code }) {
      const { C, first, lowBits } =
        main.windowDensity({ T: main.FAMILIES[density_family], scaleCode: scale_code }, centre, step);
      return { cumulative: list(C, "<i8"), first: single(first, "<i8"), low_bits: single(lowBits, "<i8") };
    },

    async codes_of_classes({ classes, low, negative }) {
      return { codes: list(main.sign(main.magnitudesOf(numbers(classes), numbers(low)), numbers(negative)), "<i8") };
    },

    async cells_of_halves({ width, height, count, first_halves }) {
      const [columns, rowsOfCells] = main.cellsOfHalves(width, height, count, numbers(first_halves));
      const cells = new Int32Array(2 * count);
      columns.forEach((column, n) => cells.set([column, rowsOfCells[n]], 2 * n));
      return { cells: rows(cells, 2, "<i8") };
    },

    async field_vectors({ differences }) {
      const { shape } = differences;
      return { vectors: array("<i8", shape, main.fieldVectors(numbers(differences), shape[1])) };
    },

    async half_frequencies({ count, first_half, second_half, alpha }) {
      const { C, lowBits } = main.halves(count, first_half, second_half, alpha);
      return { cumulative: list(C, "<i8"), low_bits: single(lowBits, "<i8") };
    },

    async model_frequencies({ counts }) {
      const tables = rowsOf(counts).map(main.frequenciesOf);
      return { cumulative: rows(joined("<f8", tables), counts.shape[1] + 1, "<i8") };
    },

    async adapt_model({ counts, seen }) {
      const times = rowsOf(seen);
      const after = rowsOf(counts).map((row, i) => main.adapted(row, times[i]));
      return { counts: rows(joined("<f8", after), counts.shape[1], "<i8") };
    },

    async mode_contexts({ width, height, state, past, motion, vectors, motion_cell }) {
      const contexts = main.modeContexts(
        statesOf(state), numbers(past), numbers(motion), fieldOf(vectors, motion_cell), width, height);
      return { contexts: list(contexts, "<i8") };
    },

    async splat_classes({ state, quantizer }) {
      return { classes: list(main.classesOf(statesOf(state), quantizer), "<i8") };
    },

    async main_intra({ quantizer, cells, colors, shapes, places }) {
      const codes = {
        cells: columnsOf(cells), colors: columnsOf(colors), shapes: columnsOf(shapes), places: columnsOf(places),
      };
      return { state: rows(main.intraStates(codes, main.stepOf(quantizer)), 8, "<i8") };
    },

    async motion_of_splats({ state, vectors, motion_cell }) {
      const motion = main.fieldMotion(statesOf(state), fieldOf(vectors, motion_cell));
      return { motion: rows(motion, 2, "<i8") };
    },

    async main_inter({ quantizer, state, motion, differences }) {
      const modes = new Int32Array(state.shape[0]).fill(1); // all have differences
      const after = main.addDifferences(
        statesOf(state), numbers(motion), modes, numbers(differences), main.stepOf(quantizer));
      return { state: rows(after, 8, "<i8") };
    },

    async state_parameters({ state }) {
      return { parameters: rows(main.stateParameters(statesOf(state)), 8, "<f4") };
    },

    async main_work({ state, width, height, halvings = 0 }) {
      return { work: single(main.mainWork(statesOf(state), width, height, halvings), "<i8") };
    },

    async scale_parameters({ parameters, width, height, new_width, new_height }) {
      return { parameters: rows(scaleParameters(parameters.data, width, height, new_width, new_height), 8, "<f4") };
    },

    async scale_parameters_filtered({ parameters, width, height, new_width, new_height }) {
      const scaled = scaleParametersFiltered(parameters.data, width, height, new_width, new_height);
      return { parameters: rows(scaled, 8, "<f4") };
    },
  };

  /** What is judged within bounds comes from the GPU: the page sets GSVC.renderer to what GSVC.createRenderer makes. */
  function boundedSum(parameters, width, height) {
    if (!GSVC.renderer) throw new Unsupported(GSVC.noRenderer ?? "this page has no renderer");
    return GSVC.renderer.sum(parameters, width, height);
  }

  async function boundedFrame(parameters, { width, height, bit_depth }) {
    return toFrame(await boundedSum(parameters, width, height), bit_depth);
  }

  /** All frames of a stream, rendered one after the other. */
  async function decoded(stream, render, quality = 0) {
    const { s, state } = readStart(stream, quality);
    const { width, height, bit_depth } = state.header;
    const frames = [];
    for (const { parameters } of readFrames(s, state)) frames.push(await render(parameters, state.header));
    const dtype = sampleType(bit_depth);
    return { frames: array(dtype, [frames.length, height, width, 3], joined(dtype, frames)) };
  }

  /** What read_stream lists (12.4). */
  function described({ points, ...header }, frames) {
    const blocksOf = (frame) => [frame.inter, frame.intra].filter(Boolean);
    const blocks = frames.flatMap((frame) => blocksOf(frame).map((block) => ({ number: frame.number, ...block })));
    const own = blocks.filter((block) => block.flags.codebooks);
    const quantizers = blocks.filter((block) => block.flags.quantizer).map(({ scale, offset }) =>
      [0, 1, 2].flatMap((channel) => [scale[channel], offset[channel]]));
    const row = ({ number, kind, count, flags }) =>
      [number, kind === "inter" ? 1 : 0, count, flags.positions, flags.cholesky, flags.quantizer, flags.colors,
        flags.codebooks];
    return {
      header: list(Object.values(header), "<i8"),
      frame_types: list(frames.map((frame) => frame.type.charCodeAt(0)), "|u1"),
      counts: list(frames.map((frame) => frame.parameters.length / 8), "<i8"),
      survivors: list(joined("|u1", frames.map((frame) => frame.survivors ?? [])), "|u1"),
      blocks: rows(blocks.flatMap(row), 8, "<i8"),
      positions: rows(joined("<u2", blocks.map((block) => block.positions)), 2, "<u2"),
      cholesky: rows(joined("<u2", blocks.map((block) => block.cholesky)), 3, "<u2"),
      quantizers: array("<f4", [quantizers.length, 3, 2], quantizers.flat()),
      codebook_sizes: list(own.flatMap((block) => block.codebookSizes), "<i8"),
      codewords: rows(joined("<u2", own.map((block) => block.codewords)), 3, "<u2"),
      color_indices: list(joined("<u2", blocks.map(stageByStage)), "<u2"),
    };
  }

  /** What read_main_stream lists (15.12). */
  function describedMain({ points, ...header }, frames, symbols) {
    const told = frames.filter(({ body }) => body !== null);
    const bodies = told.map(({ body }) => body);
    const row = ({ number, body }) =>
      [number, body.quantizer, body.lane_exponent, body.motion_cell, body.densities_present, body.count];
    return {
      header: list([...Object.values(header), ...points.flatMap(({ level, halvings }) => [level, halvings])], "<i8"),
      frame_types: list(frames.map((frame) => frame.type.charCodeAt(0)), "|u1"),
      counts: list(frames.map(({ parameters }) => parameters.length / 8), "<i8"),
      bodies: rows(told.flatMap(row), 6, "<i8"),
      fields: rows(joined("<f8", bodies.map(({ field }) => field.vectors)), 2, "<i8"),
      modes: list(joined("<f8", bodies.map(({ modes }) => modes)), "<i8"),
      differences: rows(joined("<f8", bodies.map(({ differences }) => differences)), 8, "<i8"),
      states: rows(joined("<f8", frames.map(({ after }) => after.splats)), 8, "<i8"),
      symbols: rows(symbols, 4, "<u2"),
    };
  }

  /** The colour indices of a block, all of a stage before the next one. */
  function stageByStage({ colorIndices, codebookSizes, count }) {
    if (colorIndices.length === 0) return [];
    return codebookSizes.flatMap((_, k) =>
      Array.from({ length: count }, (_, n) => colorIndices[codebookSizes.length * n + k]));
  }

  Object.assign(GSVC, { operations, TYPES, Unsupported });
}
