"use strict";
// What the list of a stream's frames tells of each: its splats, and where its bits went.
globalThis.GSVC ??= {};

{
  const { main } = GSVC;

  const PLANES = { // of profile main: the parts of a run that are about the same, by the names that those of paper have
    positions: ["cells", "place", "position"],
    cholesky: ["size", "aspect", "shear", "shape"],
    colors: ["luma", "chroma", "color"],
    motion: ["motion"],
    modes: ["modes"],
    densities: ["densities"],
  };

  /** The bits of a body by `PLANES`. */
  const planesOf = (bits) => Object.fromEntries(Object.entries(PLANES).map(([plane, parts]) =>
    [plane, parts.reduce((sum, part) => sum + (bits[part] ?? 0), 0)]));

  /** What the body of a frame of profile main, or of a layer of one, says of all its splats. */
  const codingOf = ({ quantizer, lane_exponent: laneExponent, motion_cell: motionCell }) => // of a layer 0: inherited
    ({ quantizer, step: main.stepOf(quantizer) / 16, lanes: 2 ** laneExponent, motionCell: main.SIDES[motionCell] });

  /** What the list of frames tells of one; bits are those of its chunks, `other` being all that is not listed. */
  function summary(frame) {
    const { type, number, byteOffset, byteLength, parameters, parts, bits, body = null } = frame;
    const { chunks = [], carried = [], lacking = [] } = frame; // of a stream with layers
    const splatCount = parameters.length / 8;
    const newCount = parts.reduce((sum, part) => sum + part.newCount, 0);
    const survivorCount = splatCount - newCount;
    const size = chunks.reduce((sum, chunk) => sum + chunk.byteLength, byteLength);
    const bodies = [body, ...chunks.map((chunk) => chunk.body)].filter(Boolean);
    const planeBits = { ...bits };
    for (const told of bodies) {
      for (const [plane, count] of Object.entries(planesOf(told.bits))) {
        planeBits[plane] = (planeBits[plane] ?? 0) + count;
      }
    }
    planeBits.other = Object.values(planeBits).reduce((left, part) => left - part, 8 * size);
    const layers = chunks.map((chunk) => ({
      layer: chunk.layer, type: chunk.type, byteOffset: chunk.byteOffset, byteLength: chunk.byteLength,
      coding: chunk.body && codingOf(chunk.body),
    }));
    const coding = body && codingOf(body);
    return {
      number, type, splatCount, newCount, survivorCount, byteOffset, byteLength, size, layers, carried, lacking, coding,
      planeBits,
    };
  }

  Object.assign(GSVC, { summary });
}
