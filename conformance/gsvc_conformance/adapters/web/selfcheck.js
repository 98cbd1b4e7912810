// The page judges its own decoder by the golden vectors, as `gsvc-conformance run` does.
"use strict";
globalThis.GSVC ??= {};
{
  const { operations, Unsupported, readNpy, expandRuns, judge } = GSVC;
  const AHEAD = 8; // vectors that are read while one is judged

  const CLASSES = { // those of a decoder (13.1)
    bitstream: [
      "read_stream", "decode_plane", "encode_plane", "reconstruct_stream", "read_main_stream", "encode_run",
      "density_frequencies", "window_frequencies", "half_frequencies", "model_frequencies", "adapt_model", "mode_contexts",
    ],
    reconstruction: [
      "from_half", "to_half", "reconstruct_intra", "reconstruct_inter", "parameter_checksum", "rendering_work",
      "codes_of_classes", "cells_of_halves", "field_vectors", "splat_classes", "main_intra", "motion_of_splats", "main_inter", "state_parameters", "main_work",
    ],
    rendering: ["render_sum", "to_frame", "render_frame", "decode_stream"],
    deterministic: ["render_sum_deterministic", "to_frame_deterministic", "decode_stream_deterministic"],
    seeking: ["seek"],
    sizes: ["scale_parameters", "scale_parameters_filtered"],
    layers: ["reconstruct_layers", "decode_layers"],
  };

  /** Reads a vector: its manifest, its inputs, and the parts of its expected outputs. */
  async function readVector(vectors, id) {
    const file = (name) => vectors.read(`${id}/${name}`);
    const manifest = JSON.parse(new TextDecoder().decode(await file("manifest.json")));
    const value = async (entry) => {
      if ("value" in entry) return entry.value;
      const bytes = await file(entry.file);
      if (!entry.dtype) return bytes;
      return entry.runs ? expandRuns(readNpy(bytes), entry) : readNpy(bytes);
    };
    const values = async (entries) => {
      const pairs = Object.entries(entries).map(async ([name, entry]) => [name, await value(entry)]);
      return Object.fromEntries(await Promise.all(pairs));
    };
    const parts = (entry) => values(Object.fromEntries(Object.entries(entry).filter(([, part]) => part?.file)));
    const outputs = Object.entries(manifest.outputs).map(async ([name, entry]) =>
      ({ name, entry, parts: await parts(entry) }));
    // All are waited for together, so that none is refused with nobody waiting for it.
    const [inputs, ...read] = await Promise.all([values(manifest.inputs), ...outputs]);
    return { manifest, inputs, outputs: read };
  }

  /** The result of a vector: outcome (pass, fail, error or unsupported), message, and the worst ratio or null. */
  async function judgeVector({ manifest, inputs, outputs }) {
    let actual;
    try {
      actual = await operations[manifest.operation](inputs);
    } catch (error) {
      if (error instanceof Unsupported) return { outcome: "unsupported", message: error.message, ratio: null };
      return { outcome: "error", message: error.message, ratio: null };
    }
    const judged = outputs.map(({ name, entry, parts }) => ({ name, ...judge(entry, parts, actual[name]) }));
    const ratios = judged.map(({ ratio }) => ratio).filter((ratio) => ratio !== null);
    const wrong = judged.find(({ passed }) => !passed);
    const message = wrong ? `${wrong.name} ${wrong.message}` : "";
    return { outcome: wrong ? "fail" : "pass", message, ratio: ratios.length ? Math.max(...ratios) : null };
  }

  /** The verdict on a class of operations, from its results and the ids of all of its vectors, or null (R-13-1). */
  function verdictOf(results, listed) {
    const outcomes = results.map(({ outcome }) => outcome);
    if (outcomes.includes("fail") || outcomes.includes("error")) return "failed";
    if (!outcomes.includes("pass")) return "not claimed";
    const judged = new Set(results.map(({ id }) => id));
    const whole = listed !== null && listed.every((id) => judged.has(id));
    return whole && results.every(({ outcome }) => outcome === "pass") ? "passed" : "incomplete";
  }

  const operationOf = (id) => id.split("/")[1];

  /** A row of the table: how many vectors of an operation passed, are wrong and are unsupported, and the worst ratio. */
  function row(operation, results) {
    const count = (...outcomes) => results.filter(({ outcome }) => outcomes.includes(outcome)).length;
    const ratios = results.map(({ ratio }) => ratio).filter((ratio) => ratio !== null);
    return {
      operation,
      group: results[0]?.group,
      checks: [...new Set(results.flatMap(({ checks }) => checks))],
      vectors: results.length,
      passed: count("pass"),
      wrong: count("fail", "error"),
      unsupported: count("unsupported"),
      ratio: ratios.length ? Math.max(...ratios) : null,
    };
  }

  /**
   * Judges GSVC.operations by vectors; what is bounded is drawn by GSVC.renderer, which the page has to set before.
   *
   * @param {Object} vectors from GSVC.vectorsAt(url) or GSVC.vectorsAmong(files)
   * @param {Object} options onProgress({done, total, id}) after each vector; signal, an AbortSignal; only, the names
   *   of the operations to judge
   * @returns {Promise<Object>} rows (a row an operation: operation, group, checks, vectors, passed, wrong, unsupported, ratio;
   *   checks are those of spec.md section 13.2 that its outputs were held against, ratio is of bounded ones), classes
   *   ({name, verdict, vectors} with verdict passed, failed, incomplete or not claimed; passed only if all vectors that
   *   SHA256SUMS lists were judged), failures ({id, title, reason, message}), complete (false: it was aborted),
   *   verified and sums as of the source, and seconds
   */
  async function selfCheck(vectors, options = {}) {
    const { onProgress = () => {}, signal = null, only = Object.keys(operations) } = options;
    const start = performance.now();
    const ids = vectors.ids.filter((id) => only.includes(operationOf(id)));
    const reading = []; // results, not rejections: one that nobody waits for yet would be reported as unhandled
    const results = [];
    while (results.length < ids.length && !signal?.aborted) {
      while (reading.length < Math.min(results.length + AHEAD, ids.length)) {
        reading.push(readVector(vectors, ids[reading.length]).catch((error) => ({ error })));
      }
      const id = ids[results.length];
      const vector = await reading[results.length];
      reading[results.length] = null; // its arrays are free again
      if (vector.error) throw vector.error;
      const { operation, class: group, title, reason } = vector.manifest;
      const checks = vector.outputs.map(({ entry }) => entry.check);
      results.push({ id, operation, group, checks, title, reason, ...(await judgeVector(vector)) });
      onProgress({ done: results.length, total: ids.length, id });
    }
    const rows = only.map((name) => row(name, results.filter(({ operation }) => operation === name)));
    return {
      rows: rows.filter(({ vectors: count }) => count > 0),
      classes: Object.entries(CLASSES).map(([name, members]) => {
        const some = results.filter(({ operation }) => members.includes(operation));
        const listed = vectors.listed && vectors.listed.filter((id) => members.includes(operationOf(id)));
        return { name, verdict: verdictOf(some, listed), vectors: some.length };
      }),
      failures: results.filter(({ outcome }) => outcome === "fail" || outcome === "error"),
      complete: results.length === ids.length,
      verified: vectors.verified,
      sums: vectors.sums,
      seconds: (performance.now() - start) / 1000,
    };
  }

  Object.assign(GSVC, { selfCheck });
}
