"use strict";
// Words of the viewer: numbers, and faults of files for people who do not know the specification by heart.
globalThis.GSVC ??= {};

{
  const format = (digits) => new Intl.NumberFormat("en", { maximumFractionDigits: digits });

  /** A number with at most so many digits after the point. */
  const number = (value, digits = 0) => format(digits).format(value);

  /** Bytes as people say them. */
  function bytes(count) {
    if (count < 10_000) return `${number(count)} bytes`;
    return count < 1e6 ? `${number(count / 1e3, 1)} kB` : `${number(count / 1e6, 2)} MB`;
  }

  /** A parameter of a splat: enough digits to tell it from another. */
  function parameter(value) {
    const size = Math.abs(value);
    const told = size === 0 || (size >= 1e-3 && size < 1e5) ? value.toFixed(3) : value.toExponential(3);
    return told.replaceAll("-", "−");
  }

  const RULES = { // the most likely rules; the others are about elements with values that they may not have
    "R-6.1-1": "This is no GSVC file: its first bytes are not those of one.",
    "R-6.2-4": "The file breaks off: its end is missing.",
    "R-6.2-2": "Bytes were changed: the checksum of a chunk is wrong.",
    "R-6.2-1": "Bytes were changed: where a chunk should begin there is none.",
    "R-6.1-3": "The header is not where it must be.",
    "R-6.1-4": "There are bytes after the end of the stream.",
    "R-6.1-5": "The file has no frame.",
    "R-6.3-2": "The number of frames is not the one that the header tells.",
    "R-6.4-1": "A frame is missing, or frames are out of order.",
    "R-6.4-2": "The stream does not begin with an I-frame.",
    "R-6.4-3": "The splats of a frame are not those that the encoder had: their checksum differs.",
    "R-6.8-1": "The number of frames is not the one that the end of the stream tells.",
    "R-5-1": "The picture is larger than the stream's level allows.",
    "R-5-2": "A frame has more splats than the stream's level allows.",
    "R-5-3": "A chunk is longer than the stream's level allows.",
    "R-5-4": "A frame takes more work than the stream's level allows.",
    "R-5-7": "A second takes more than the stream's level allows of one that keeps pace.",
    "R-5-8": "A stream that says it keeps pace goes too long without an I-frame.",
    "R-5-9": "A quality takes more than the level that the header tells of it allows.",
    "R-5-11": "The stream may use more lanes than its level allows.",
    "R-15.13-1": "A layer of a frame is out of order, or is none that the frame names.",
    "R-15.13-2": "A layer does not begin with an I, or goes on after a gap.",
    "R-15.13-4": "A layer is that of another frame.",
    "R-15.13-6": "A layer that a frame names is missing.",
    "R-8-1": "A splat has a parameter that is no finite number.",
  };

  const KINDS = {
    malformed: "The file is damaged, or was written wrongly.",
    invalid: "The file breaks a rule of the format: its encoder is at fault, or something changed it.",
    unsupported: "The file uses something that the format does not define yet.",
    limit: "The file asks for more than its level allows.",
  };

  /** The version of a stream that this viewer does not read, by its `version_major`. */
  function versionInWords(major) {
    const draft = major - 128; // there are drafts from 129 on
    const ours = GSVC.VERSION_MAJOR - 128;
    const theirs = draft > 0 ? `draft ${draft}` : `version ${major}`;
    const told = `The file is of ${theirs} of the format; this viewer reads draft ${ours}.`;
    return draft > 0 && draft < ours ? `${told} It has to be encoded again.` : told;
  }

  /** The name of a quality: how many layers are added to the base. */
  const quality = (layers) => (layers === 0 ? "base" : `base + ${layers}`);

  const MOST_RUNS = 6; // of missing frames that are listed

  /** The numbers of frames that are missing, after some words; nothing where none is. */
  function missingInWords(frames, missingAtEnd, words = "") {
    const runs = frames.filter((frame) => frame.missing).map(({ number: next, missing }) => [next - missing, next - 1]);
    const next = (frames.at(-1)?.number ?? -1) + 1;
    if (missingAtEnd > 0) runs.push([next, next + missingAtEnd - 1]);
    const told = runs.map(([first, last]) => (first === last ? number(first) : `${number(first)} to ${number(last)}`));
    if (told.length > 0) told[0] = `${runs.length === 1 && runs[0][0] === runs[0][1] ? "frame" : "frames"} ${told[0]}`;
    if (told.length > MOST_RUNS) told.splice(MOST_RUNS, Infinity, `${number(runs.length - MOST_RUNS)} more runs`);
    if (missingAtEnd === null) told.push(`what followed ${next === 0 ? "the header" : `frame ${number(next - 1)}`}`);
    return told.length ? words + told.join(", ") : "";
  }

  /**
   * What is wrong with a stream, as sentences.
   *
   * @param {{kind: string, rule: string, bit: number}} fault the first one
   * @param {number} size of the file in bytes
   * @param {Object} reading what was read of it
   */
  function faultInWords({ kind, rule, bit }, size, { bytes: read, frames, faultCount, missingAtEnd }) {
    const what = size === 0 ? "The file is empty." : rule === "R-6.1-2" ? versionInWords(read[8])
      : RULES[rule] ?? KINDS[kind];
    const behind = frames.filter((frame) => 8 * frame.byteOffset > bit).length;
    const before = frames.length - behind;
    const lacking = frames.filter((frame) => frame.lacking.length > 0).length;
    const [whole, is, are] = lacking === 0 ? ["whole ", "is whole and is", "are whole and are"] : ["", "is", "are"];
    const rest = frames.length === 0 ? "No frame can be shown."
      : behind > 0 ? `The ${number(frames.length)} ${whole}frames are shown, ${number(behind)} of them after the damage.`
        : before === 1 ? `The frame before it ${is} shown.`
          : `The ${number(before)} frames before it ${are} shown.`;
    const missing = missingInWords(frames, missingAtEnd, "Missing: ");
    const where = `Found at byte ${number(Math.floor(bit / 8))} of ${number(size)} (${kind}, rule ${rule} of spec.md).`;
    const others = faultCount < 2 ? [] : [faultCount === 2 ? "One more fault follows."
      : `${number(faultCount - 1)} more faults follow.`];
    const lack = lacking === 1 ? "frame lacks" : "frames lack";
    const incomplete = lacking === 0 ? [] : [`${number(lacking)} ${lack} a layer.`];
    return [what, rest, ...(missing && frames.length ? [`${missing}.`] : []), ...incomplete, where, ...others];
  }

  /** Why a stream of a high level is not decoded before somebody asks for it, as sentences. */
  function levelInWords(name, level, most) {
    const { pixels, splats } = GSVC.LEVELS[level];
    return [
      name,
      `This stream is of level ${level}: a frame may have up to ${number(pixels)} pixels and ${number(splats)} splats, ` +
        "and decoding one may take seconds.",
      `Streams above level ${most} are decoded only when you ask for it.`,
    ];
  }

  /** An element with attributes and children; children that are texts stay texts. */
  function element(name, attributes = {}, ...children) {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    made.append(...children);
    return made;
  }

  /** Fill a list of facts: rows of a term and what is said about it. */
  function tell(list, facts) {
    list.replaceChildren(...facts.flatMap(([term, ...told]) => [element("dt", {}, term), element("dd", {}, ...told)]));
  }

  GSVC.words = { number, bytes, parameter, quality, missingInWords, faultInWords, levelInWords, element, tell };
}
