"use strict";
// Which renderer draws: WebGPU where the browser has it on a GPU, else WebGL2; and what both of them need.
globalThis.GSVC ??= {};

{
  const KINDS = ["webgpu", "webgl2"]; // "auto" takes the first that works

  /**
   * A renderer of splats.
   *
   * @param {"auto"|"webgpu"|"webgl2"} kind
   * @param {HTMLCanvasElement|OffscreenCanvas|null} canvas that `draw` draws on; a canvas serves one kind for good
   * @returns {Promise<{kind: string, description: string, sum: function, draw: function, destroy: function}>}
   *   sum(parameters, width, height) gives a promise of the sums (9-2) of a frame, H W 3 numbers, before the clamp.
   *   draw(parameters, view) draws a part of a frame, clamped and rounded, over the canvas. view: width, height of the
   *   frame; left, top: the place of it, in its pixels, that is seen at the upper left corner of the canvas; scale:
   *   how many pixels of the canvas one of its pixels is, below 1 filtered (9-9); bitDepth. What is outside of the frame stays transparent. It
   *   gives a promise, to wait for before drawing again.
   *   parameters: Float32Array of x, y, l11, l21, l22, R, G, B for each splat.
   */
  GSVC.createRenderer = async (kind, canvas) => {
    const faults = [];
    for (const candidate of kind === "auto" ? KINDS : [kind]) {
      try {
        return await GSVC.renderers[candidate](canvas, kind !== "auto");
      } catch (error) {
        faults.push(`${candidate}: ${error.message}`);
      }
    }
    throw new Error(`${kind === "auto" ? "no renderer works in this browser: " : ""}${faults.join("; ")}`);
  };

  /** (9-8), or (9-9) where it is smaller, for a view, and what is added to the centres after it. */
  GSVC.placed = ({ scale, left, top }) => ({ scale, shift: [-left * scale, -top * scale] });

  /** The part of a canvas that shows the frame: first column and row, columns, rows. */
  GSVC.seen = ({ width, height, scale, left, top }, columns, rows) => {
    const x = Math.min(Math.max(Math.round(-left * scale), 0), columns);
    const y = Math.min(Math.max(Math.round(-top * scale), 0), rows);
    const right = Math.min(Math.max(Math.round((width - left) * scale), x), columns);
    const bottom = Math.min(Math.max(Math.round((height - top) * scale), y), rows);
    return [x, y, right - x, bottom - y];
  };
}
