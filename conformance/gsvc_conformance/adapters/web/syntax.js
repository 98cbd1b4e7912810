// Chunks and their payloads: spec.md sections 5 (levels) and 6. Each table of section 6 is one function.
"use strict";
globalThis.GSVC ??= {};
{
  const { Bits, Fault, crc32c, readPlane } = GSVC;
  const MAGIC = [0x89, 0x47, 0x53, 0x56, 0x43, 0x0d, 0x0a, 0x1a];
  const VERSION_MAJOR = 128 + 2; // draft 2
  const LONGEST_HEADER = 1024;
  const SMALLEST_NORMAL = 2 ** -126;

  const LEVELS = {
    1: { pixels: 2 ** 17, splats: 2 ** 14, work: 2 ** 25, payload: 2 ** 20, laneExponent: 6 },
    2: { pixels: 2 ** 20, splats: 2 ** 16, work: 2 ** 28, payload: 2 ** 22, laneExponent: 8 },
    3: { pixels: 2 ** 22, splats: 2 ** 18, work: 2 ** 30, payload: 2 ** 24, laneExponent: 10 },
    4: { pixels: 2 ** 24, splats: 2 ** 20, work: 2 ** 32, payload: 2 ** 26, laneExponent: 12 },
    5: { pixels: 2 ** 26, splats: 2 ** 22, work: 2 ** 34, payload: 2 ** 28, laneExponent: 12 },
  };

  const PER_SECOND = { pixels: 64, splats: 64, work: 8, payload: 1 }; // limits of a second, in those of a frame or payload
  const I_FRAME_SECONDS = 4; // from an I-frame to the next one

  const HEADER = [ // element, bytes, lowest and highest value that a decoder accepts
    ["profile", 1, 0, 1],
    ["level", 1, 1, 5],
    ["flags", 1, 0, 3],
    ["width", 2, 1, 65535],
    ["height", 2, 1, 65535],
    ["frame_rate_numerator", 4, 1, 2 ** 32 - 1],
    ["frame_rate_denominator", 4, 1, 2 ** 32 - 1],
    ["sample_aspect_numerator", 2, 0, 65535],
    ["sample_aspect_denominator", 2, 0, 65535],
    ["frame_count", 4, 0, 2 ** 32 - 1],
    ["bit_depth", 1, 8, 16],
    ["chroma_format", 1, 0, 255], // R-6.3-3
    ["color_primaries", 1, 0, 255],
    ["transfer_characteristics", 1, 0, 255],
    ["matrix_coefficients", 1, 0, 255],
    ["video_full_range_flag", 1, 0, 255], // R-6.3-3
    ["chroma_sample_loc_type", 1, 0, 255], // R-6.3-3
  ];
  const OWN_HEADER = [ // of a profile, by its number
    [
      ["cholesky_bits", 1, 1, 12],
      ["color_stages", 1, 1, 8],
      ["color_codewords", 2, 1, 1024],
      ["entropy_precision", 1, 12, 16],
      ["lane_count", 1, 1, 64],
    ],
    [["max_lane_exponent", 1, 0, 12], ["layer_count", 1, 1, 4], ["main_tools", 1, 0, 0]],
  ];
  const MOST_LEVEL = 5;
  const MAIN = 1; // the value of `profile`
  const OTHERS_RESERVED = ["profile", "level", "flags", "layer_count", "main_tools"];

  /** Reads `magic` and version; the bits after them, and version_minor. */
  function readPrefix(stream) {
    const s = new Bits(stream, 0, "R-6.1-1");
    if (s.raw(8).some((byte, i) => byte !== MAGIC[i])) throw new Fault("R-6.1-1", s.element);
    s.endRule = "R-6.2-4";
    if (s.le(1) !== VERSION_MAJOR) throw new Fault("R-6.1-2", s.element);
    return { s, versionMinor: s.le(1) };
  }

  /**
   * A chunk: its type, its first bit, and the bits of its payload, at most `longest` bytes, of a frame of the base at most
   * `longestFrame`; its checksum is compared.
   */
  function readChunk(s, longest, { compareCrc = true, longestFrame = longest } = {}) {
    const bit = s.position();
    const first = s.at / 8;
    const type = String.fromCharCode(s.le(1));
    if (!/[A-Za-z]/.test(type)) throw new Fault("R-6.2-1", s.element);
    const length = s.uv();
    if (length > (type === "H" ? LONGEST_HEADER : longest)) throw new Fault("R-5-3", bit + 8);
    if ("IPR".includes(type) && length > longestFrame) throw new Fault("R-5-9", bit + 8);
    const payload = new Bits(s.raw(length), s.element);
    const covered = s.data.subarray(first, s.at / 8);
    const stated = s.le(4);
    if (compareCrc && stated !== crc32c(covered)) throw new Fault("R-6.2-2", s.element);
    return { type, bit, payload };
  }

  /**
   * sequence_header(): its elements by name, in their order. `points` has the operating points of a stream with layers, by
   * quality: its `level`, and how often pictures are halved in size.
   */
  function readSequenceHeader(p) {
    const header = {};
    readHeaderElements(p, HEADER, header);
    readHeaderElements(p, OWN_HEADER[header.profile], header);
    header.points = header.layer_count > 1 ? readPoints(p, header) : [];
    return header;
  }

  function readPoints(p, header) {
    const points = [];
    for (let quality = 0; quality < header.layer_count; quality++) {
      const level = p.u(3);
      const bit = p.element;
      if (level < 1 || level > MOST_LEVEL) throw new Fault("R-3.2-1", bit);
      const halvings = p.u(2);
      if (p.u(3) !== 0) throw new Fault("R-3.2-1", p.element); // quality_reserved
      points.push({ level, halvings, bit });
    }
    for (const { level, halvings, bit } of points) {
      if (pixelsOf(header, halvings) > LEVELS[level].pixels) throw new Fault("R-5-9", bit);
    }
    if (Math.max(...points.map(({ level }) => level)) !== header.level) throw new Fault("R-5-9", points.at(-1).bit);
    return points;
  }

  /** The pixels of a frame whose sides are halved so often. */
  const pixelsOf = ({ width, height }, halvings = 0) =>
    Math.ceil(width / 2 ** halvings) * Math.ceil(height / 2 ** halvings);

  function readHeaderElements(p, elements, header) {
    for (const [name, size, lowest, highest] of elements) {
      const value = (header[name] = p.le(size));
      if (value < lowest || value > highest) {
        throw new Fault(OTHERS_RESERVED.includes(name) ? "R-3.2-1" : "R-6.3-1", p.element);
      }
      if (name === "height" && pixelsOf(header) > LEVELS[header.level].pixels) throw new Fault("R-5-1", p.element);
      if (name === "max_lane_exponent" && value > LEVELS[header.level].laneExponent) throw new Fault("R-5-11", p.element);
    }
  }

  /**
   * Refuses an amount above the limit of the level, or, as R-5-9, above that of the operating point that is decoded, for
   * which it may be another one. `state` has limits and point.
   */
  function checkLimit(rule, name, bit, { limits, point }, amount, amountAtPoint = amount) {
    if (amount > limits[name]) throw new Fault(rule, bit);
    if (point !== null && amountAtPoint > point.limits[name]) throw new Fault("R-5-9", bit);
  }

  /**
   * The limits of a second of a paced stream, for a frame of the base that is sound.
   *
   * `state` has header, limits, point, framesCounted, second (sums so far) and lastIFrame; `amounts` as of addToSecond.
   */
  function checkSecond(frame, amounts, bit, state) {
    const { header, point } = state;
    if (!(header.flags & 2) || frame.number !== state.framesCounted) return;
    const k = Math.ceil(header.frame_rate_numerator / header.frame_rate_denominator);
    if (frame.number % k === 0) state.second = {};
    state.framesCounted += 1;
    const pixels = { pixels: pixelsOf(header), pointPixels: pixelsOf(header, point?.halvings) };
    addToSecond({ ...amounts, ...pixels }, bit, state);
    if (frame.type === "I") state.lastIFrame = frame.number;
    if (frame.number - state.lastIFrame >= I_FRAME_SECONDS * k) throw new Fault("R-5-8", bit, { isSound: true });
  }

  /**
   * R-5-7, of what a chunk adds to the sums of its second: pixels, splats, work (pointPixels and pointWork are those at the
   * operating point), and the bytes of the chunks since the one that was counted last.
   */
  function addToSecond(amounts, bit, state) {
    if (!(state.header.flags & 2) || state.framesCounted < 0) return;
    const sums = { ...state.second };
    const all = { ...amounts, payload: state.bytesWaiting };
    state.bytesWaiting = 0;
    for (const [name, amount] of Object.entries(all)) sums[name] = (sums[name] ?? 0) + amount;
    state.second = sums; // another object: copies of a state share the one before
    const check = (rule, limits, found) => {
      for (const [name, times] of Object.entries(PER_SECOND)) {
        if (found[name] > times * limits[name]) throw new Fault(rule, bit, { isSound: true });
      }
    };
    check("R-5-7", state.limits, sums);
    if (state.point !== null) check("R-5-9", state.point.limits, { ...sums, pixels: sums.pointPixels, work: sums.pointWork });
  }

  /** What frames of all profiles begin with: their number, and their checksum or null. */
  function readFrameHead(p, type, state) {
    const frame = { type, checksum: null, checksumBit: 0 };
    frame.number = p.uv();
    if (frame.number !== state.nextNumber) throw new Fault("R-6.4-1", p.element);
    if (state.header.flags & 1) {
      frame.checksum = p.le(4);
      frame.checksumBit = p.element;
    }
    return frame;
  }

  /**
   * frame() of profile paper: what a frame says; its splat blocks as readSplatBlock returns them, or null.
   *
   * `parts` has what it says of its splats, as frames of profile main have it of their base and of each layer.
   * `state` has header, limits, nextNumber, parameters of the frame before, and kept, which blocks change.
   */
  function readFrame(p, type, state) {
    const frame = readFrameHead(p, type, state);
    Object.assign(frame, { survivors: null, inter: null, intra: null, bits: newBits() });
    if (type === "I") {
      state.forget();
      const splatCount = readSplatCount(p, state);
      if (splatCount > 0) frame.intra = readSplatBlock(p, state, splatCount, "intra", frame.bits);
    }
    if (type === "P") readPredicted(p, state, frame);
    frame.parts = [{ type, newCount: frame.intra?.count ?? 0, survivors: frame.survivors, first: 0 }];
    return frame;
  }

  /** How many bits of a frame tell what; `other` is left for what is not listed. */
  const newBits = () => ({ survivors: 0, positions: 0, cholesky: 0, colors: 0, codebooks: 0 });

  function readSplatCount(p, state) {
    const count = p.uv();
    if (count > state.limits.splats) throw new Fault("R-5-2", p.element);
    return count;
  }

  /** What only a P-frame has. */
  function readPredicted(p, state, frame) {
    const newCount = readSplatCount(p, state);
    const referenceCount = state.parameters.length / 8;
    const mapBit = p.position();
    frame.survivors = new Uint16Array(0);
    if (referenceCount > 0) frame.survivors = readPlane(p, state.header, referenceCount, 2);
    frame.bits.survivors = p.position() - mapBit;
    let survivorCount = 0;
    for (let n = 0; n < referenceCount; n++) survivorCount += frame.survivors[n];
    if (survivorCount + newCount > state.limits.splats) throw new Fault("R-5-2", mapBit);
    if (survivorCount > 0) frame.inter = readSplatBlock(p, state, survivorCount, "inter", frame.bits);
    if (newCount > 0) frame.intra = readSplatBlock(p, state, newCount, "intra", frame.bits);
  }

  /** The five flags of a splat block. */
  function readBlockFlags(p, kind, kept) {
    const attribute = () => {
      const present = p.u(1);
      if (kind === "intra" && !present) throw new Fault("R-6.5-2", p.element);
      return present;
    };
    const own = (used, some) => {
      const present = p.u(1);
      if (present && !used) throw new Fault("R-6.5-3", p.element);
      if (!present && used && !some) throw new Fault("R-6.5-4", p.element);
      return present;
    };
    const positions = attribute();
    const cholesky = attribute();
    const quantizer = own(cholesky, kept.quantizer);
    const colors = attribute();
    const codebooks = own(colors, kept.codebooks);
    if (p.u(3) !== 0) throw new Fault("R-6.5-1", p.element); // block_reserved
    return { positions, cholesky, quantizer, colors, codebooks };
  }

  /**
   * splat_block(count, kind): flags, and what (8-1) to (8-4) need, in flat arrays that are empty for an attribute that
   * is not present: positions (count, 2), cholesky (count, 3), scale and offset (3), colorIndices (count, M),
   * codebookSizes (M), codewords (sum of the sizes, 3).
   */
  function readSplatBlock(p, state, count, kind, bits) {
    const kept = state.kept[kind];
    const flags = readBlockFlags(p, kind, kept);
    let start = p.position();
    const told = (name) => {
      bits[name] += p.position() - start;
      start = p.position();
    };
    const positions = flags.positions ? interleaved([readAxis(p, state, count), readAxis(p, state, count)]) : [];
    told("positions");
    const cholesky = flags.cholesky ? readCholesky(p, state.header, count, flags.quantizer, kept) : [];
    told("cholesky");
    if (flags.codebooks) kept.codebooks = readCodebooks(p, state.header);
    told("codebooks");
    const { sizes, codewords } = kept.codebooks ?? { sizes: [], codewords: new Uint16Array(0) };
    const colorIndices = flags.colors ? interleaved(sizes.map((size) => readPlane(p, state.header, count, size))) : [];
    told("colors");
    const { scale, offset } = kept.quantizer ?? { scale: new Float32Array(3), offset: new Float32Array(3) };
    return { kind, count, flags, positions, cholesky, scale, offset, colorIndices, codebookSizes: sizes, codewords };
  }

  /** Columns of the same length as one array, row by row. */
  function interleaved(columns) {
    const rows = new Uint16Array(columns.length * columns[0].length);
    columns.forEach((column, c) => {
      for (let n = 0, at = c; n < column.length; n++, at += columns.length) rows[at] = column[n];
    });
    return rows;
  }

  /** x or y of all positions, as patterns of binary16. */
  function readAxis(p, state, count) {
    const start = p.position();
    const patterns = readPlane(p, state.header, count, 256);
    const low = readPlane(p, state.header, count, 256);
    for (let n = 0; n < count; n++) patterns[n] = patterns[n] * 256 + low[n];
    for (let n = 0; n < count; n++) if ((patterns[n] & 0x7c00) === 0x7c00) throw new Fault("R-6.5-7", start);
    return patterns;
  }

  /** The codes; the block's own quantiser is kept once it is whole. */
  function readCholesky(p, header, count, quantizerPresent, kept) {
    const own = { scale: new Float32Array(3), offset: new Float32Array(3) };
    const columns = [];
    for (let channel = 0; channel < 3; channel++) {
      if (quantizerPresent) {
        own.scale[channel] = p.f32();
        if (!(own.scale[channel] >= SMALLEST_NORMAL)) throw new Fault("R-6.5-5", p.element);
        own.offset[channel] = p.f32();
      }
      columns.push(readPlane(p, header, count, 2 ** header.cholesky_bits));
    }
    if (quantizerPresent) kept.quantizer = own;
    return interleaved(columns);
  }

  /** The sizes of the stages, and all codewords as patterns of binary16. */
  function readCodebooks(p, header) {
    const sizes = [];
    const codewords = [];
    const stageCount = p.le(1);
    if (stageCount < 1 || stageCount > header.color_stages) throw new Fault("R-6.5-6", p.element);
    for (let k = 0; k < stageCount; k++) {
      const count = p.le(2);
      if (count < 1 || count > header.color_codewords) throw new Fault("R-6.5-6", p.element);
      sizes.push(count);
      p.need(16 * 3 * count); // the run as a whole, before its first codeword is looked at
      for (let i = 0; i < 3 * count; i++) codewords.push(p.f16());
    }
    return { sizes, codewords: Uint16Array.from(codewords) };
  }

  /** index(): checks an index whose chunk begins at the byte `indexOffset` of the stream; nothing is collected. */
  function checkIndex(p, indexOffset) {
    const entryCount = p.uv();
    const firstBit = p.position();
    let offset = 0;
    for (let entry = 0; entry < entryCount; entry++) {
      const numberStep = p.uv();
      const offsetStep = p.uv();
      offset += offsetStep;
      const grows = entry === 0 || (numberStep > 0 && offsetStep > 0);
      if (!grows || offset >= indexOffset) throw new Fault("R-6.7-1", firstBit);
    }
  }

  /** end(): `state` has nextNumber, header, and indexLength of the chunk before. */
  function checkEnd(p, state) {
    const frameCount = p.le(4);
    const frameCountBit = p.element;
    const indexLength = p.le(4);
    if (frameCount !== state.nextNumber) throw new Fault("R-6.8-1", frameCountBit);
    const stated = state.header.frame_count;
    if (stated !== 0 && stated !== frameCount) throw new Fault("R-6.3-2", frameCountBit);
    if (indexLength !== state.indexLength) throw new Fault("R-6.8-2", p.element);
  }

  Object.assign(GSVC, {
    LEVELS, LONGEST_HEADER, MAIN, VERSION_MAJOR, readPrefix, readChunk, readSequenceHeader, readFrameHead, readFrame,
    checkIndex, checkEnd, checkLimit, checkSecond, addToSecond,
  });
}
