"use strict";
// The panels beside the picture: facts about the file, the frame, a splat, and the drawing.
globalThis.GSVC ??= {};

{
  const { number, bytes, parameter, quality, element } = GSVC.words;
  const CHROMA = ["R′G′B′", "4:2:0", "4:2:2", "4:4:4"];
  const TYPES = { I: "I, a whole picture", P: "P, predicted from the one before", R: "R, the one before again" };
  const PARTS = { // parts of a frame, in the order in which they are stacked
    positions: "positions", cholesky: "shapes", colors: "colours", codebooks: "codebooks", survivors: "survivors",
    motion: "motion field", modes: "modes", densities: "densities", other: "other",
  };
  const PROFILES = ["paper", "main"];

  /** The number of a frame among those that there are. */
  const numbered = (n, frames) => (frames.length > 1 ? `${number(n)} of 0–${number(frames.at(-1).number)}` : `${n}`);

  /** How samples that are not square are shown; null: they are, or it is unknown. */
  function aspect({ sample_aspect_numerator: wide, sample_aspect_denominator: high }) {
    if (wide === high || wide === 0 || high === 0) return null;
    return ["samples", `${wide}:${high}, shown square`];
  }

  /** Facts about a file with at least one frame; `psnr` has what was measured, if it has a source. */
  function fileFacts({ name, size, header, frames, times, fault, source, psnr = [] }) {
    const rate = header.frame_rate_numerator / header.frame_rate_denominator;
    const seconds = times?.at(-1) ?? frames.length / rate;
    const spaced = times ? "not evenly spaced" : `at ${number(rate, 3)} a second`;
    const used = fault ? frames.reduce((sum, frame) => sum + frame.size, 0) : size;
    const told = header.frame_count > frames.length ? ` of ${number(header.frame_count)}` : ""; // the others are lost
    const pixels = header.width * header.height * frames.length;
    const count = (type) => frames.filter((frame) => frame.type === type).length;
    return [
      ["name", name],
      ["size", bytes(size)],
      ["picture", `${header.width} × ${header.height}, ${header.bit_depth} bits`],
      ["frames", `${number(frames.length)}${told} ${spaced}: ${number(seconds, 2)} s`],
      ["of these", `${number(count("I"))} I, ${number(count("P"))} P, ${number(count("R"))} R`],
      ["rate", `${number((8 * used) / pixels, 4)} bits a pixel, ${number(used / 125 / seconds, 1)} kbit/s`],
      ["level", `${header.level}: at most ${number(GSVC.LEVELS[header.level].pixels)} pixels, ` +
        `${number(GSVC.LEVELS[header.level].splats)} splats${header.flags & 2 ? ", and paced" : ""}`],
      ["source", `${CHROMA[header.chroma_format] ?? CHROMA[0]}${header.flags & 1 ? "; splats have checksums" : ""}`],
      ...(source ? [["beside", source.name], ["PSNR", ...psnrInWords(frames, psnr)]] : []),
      ["profile", PROFILES[header.profile]],
      ...(header.profile === GSVC.MAIN ? mainTools(header) : paperTools(header)),
      aspect(header),
    ].filter(Boolean);
  }

  /** A PSNR; Infinity: the frames are the same. */
  const decibels = (value) => (value === Infinity ? "identical" : `${number(value, 2)} dB`);

  /** The mean of the frames that were measured and differ, as `gsvc compare` has it, and the least. */
  function psnrInWords(frames, psnr) {
    const found = [...psnr.entries()].filter(([, value]) => typeof value === "number");
    const finite = found.filter(([, value]) => value < Infinity);
    if (found.length === 0) return ["…"];
    if (finite.length === 0) return ["identical"];
    const mean = finite.reduce((sum, [, value]) => sum + value, 0) / finite.length;
    const [at, least] = finite.reduce((low, one) => (one[1] < low[1] ? one : low));
    const part = found.length < frames.length ? ` (${number(found.length)} frames so far)` : "";
    return [`${decibels(mean)} on average, ${decibels(least)} in frame ${number(frames[at].number)}${part}`];
  }

  const lanes = (count) => `${count} ${count === 1 ? "lane" : "lanes"}`;

  const paperTools = (header) => [
    ["quantisers", `shapes ${header.cholesky_bits} bits; colours ${header.color_stages} × ${header.color_codewords}`],
    ["coder", `${lanes(header.lane_count)}, ${header.entropy_precision} bits`],
  ];

  const mainTools = ({ max_lane_exponent: most, layer_count: layers, points }) => [
    ["coder", `${most === 0 ? "" : "at most "}${lanes(2 ** most)}`],
    ["layers", layers === 1 ? "none" : `${layers - 1} above the base`],
    ...(layers === 1 ? [] : [["qualities", points.map(pointInWords).join("; ")]]),
  ];

  const pointInWords = ({ level, halvings }, n) =>
    `${quality(n)}: level ${level}${halvings > 0 ? ` at 1/${2 ** halvings} of the size` : ""}`;

  /** What a body of profile main says of all its splats. */
  function codingInWords({ quantizer, step, lanes: count, motionCell }) {
    const field = motionCell > 0 ? `, motion field of ${motionCell} × ${motionCell}` : "";
    return `D ${number(step, 2)} (quantizer ${quantizer}), ${lanes(count)}${field}`;
  }

  /** A row of facts for each layer of a frame, in their order. */
  function layerFacts({ type, layers, carried, lacking }) {
    const coded = layers.map(({ layer, type: layerType, byteLength, coding }) => {
      const field = layerType === "P" && coding.motionCell === 0 ? ", motion of the base" : "";
      const told = coding ? `: ${codingInWords(coding)}${field}` : "";
      return [layer, `${layerType}, ${number(byteLength)} bytes${told}`];
    });
    const rows = [
      ...coded,
      ...carried.map((layer) => [layer, type === "R" ? "stays as it was: no bytes" : "moves with the base: no bytes"]),
      ...lacking.map((layer) => [layer, element("span", { class: "lacking" }, "lost, and not shown before its next I")]),
    ];
    return rows.sort(([one], [other]) => one - other).map(([layer, told]) => [`layer ${layer}`, told]);
  }

  /** Facts about the frame at n, shown at `time`; `psnr`: undefined if it was not measured, null if the source lacks it. */
  function frameFacts(n, frames, time, psnr) {
    const frame = frames[n];
    const { type, splatCount, newCount, survivorCount, size } = frame;
    const before = type === "P" ? frames[n - 1].splatCount : 0;
    const gone = before - survivorCount;
    const facts = [
      ["number", `${numbered(frame.number, frames)}, at ${number(time, 2)} s`],
      ["type", element("span", { class: `key ${type}` }), ` ${TYPES[type]}`],
      ["splats", `${number(splatCount)}`],
      ["bytes", `${number(size)}, from byte ${number(frame.byteOffset)}`],
    ];
    if (type === "P") {
      facts[2][1] += `: ${number(survivorCount)} kept, ${number(newCount)} new; ${number(gone)} gone`;
    }
    if (psnr !== undefined) facts.push(["PSNR", psnr === null ? "the source has no such frame" : decibels(psnr)]);
    if (splatCount > 0) facts.push(["bits a splat", number((8 * size) / splatCount, 1)]);
    if (frame.coding) facts.push(["steps", codingInWords(frame.coding)]);
    return [...facts, ...layerFacts(frame)];
  }

  /** Where the bits of a frame went: a bar of parts, and a list of them. */
  function showParts(bar, legend, { planeBits, size }) {
    const parts = Object.entries(PARTS).filter(([key]) => planeBits[key] > 0);
    const share = (key) => (100 * planeBits[key]) / (8 * size);
    bar.replaceChildren(...parts.map(([key, name]) => {
      const part = element("span", { class: `part-${key}`, title: `${name}: ${number(planeBits[key])} bits` });
      part.style.width = `${share(key)}%`;
      return part;
    }));
    const told = parts.map(([key, name]) => `${name} ${number(share(key))} %`);
    bar.setAttribute("aria-label", `Where its bits went: ${told.join(", ")}`);
    legend.replaceChildren(...parts.map(([key], i) =>
      element("li", {}, element("span", { class: `key part-${key}` }), told[i])));
  }

  /** A patch of a colour, as far as a screen can show it. */
  function patch(color) {
    const made = element("span", { class: "patch" });
    made.style.background = `rgb(${color.map((c) => Math.round(255 * Math.min(Math.max(c, 0), 1))).join(" ")})`;
    return made;
  }

  function splatFacts(parameters, index, isNew) {
    const [x, y, l11, l21, l22, ...color] = parameters.subarray(8 * index, 8 * index + 8);
    const { large, small, angle } = GSVC.splats.axes(l11, l21, l22);
    return [
      ["splat", `${number(index)} of ${number(parameters.length / 8)}, ${isNew ? "new" : "kept"}`],
      ["centre x, y", `${parameter(x)}, ${parameter(y)}`],
      ["l11, l21, l22", `${parameter(l11)}, ${parameter(l21)}, ${parameter(l22)}`],
      ["deviations", `${parameter(large)} and ${parameter(small)} px, ${number(angle, 1)}°`],
      ["R, G, B", patch(color), ` ${color.map(parameter).join(", ")}`],
    ];
  }

  /** Facts about a place (x, y) of the frame: its pixel, and the splats there. */
  function placeFacts(found, { x, y }) {
    return [
      ["pixel", `${Math.floor(x)}, ${Math.floor(y)}`],
      ["covered by", `${number(found.covering)} ${found.covering === 1 ? "splat" : "splats"}`],
      ["sum", patch(found.sum), ` ${found.sum.map(parameter).join(", ")}`],
    ];
  }

  GSVC.panels = { numbered, decibels, fileFacts, frameFacts, showParts, splatFacts, placeFacts };
}
