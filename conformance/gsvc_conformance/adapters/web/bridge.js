// The page's half of the bridge to the conformance kit; __init__.py is the other one.
"use strict";
globalThis.GSVC ??= {};
{
  const { operations, TYPES, Unsupported } = GSVC;

  const bytesOf = (base64) => Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));

  function base64Of(data) {
    const bytes = new Uint8Array(data.buffer, data.byteOffset, data.byteLength);
    let text = "";
    for (let at = 0; at < bytes.length; at += 2 ** 15) text += String.fromCharCode(...bytes.subarray(at, at + 2 ** 15));
    return btoa(text);
  }

  /** An operation's input from a message: an array {dtype, shape, base64}, a stream {base64}, or a number. */
  function received(value) {
    if (typeof value !== "object") return value;
    const data = bytesOf(value.base64);
    if (!value.dtype) return data;
    return { data: new TYPES[value.dtype](data.buffer), shape: value.shape, dtype: value.dtype };
  }

  /** A message of an operation's output: an array, or a text as it is. */
  function sent(value) {
    if (typeof value === "string") return value;
    return { dtype: value.dtype, shape: value.shape, base64: base64Of(value.data) };
  }

  const mapped = (values, change) =>
    Object.fromEntries(Object.entries(values).map(([name, value]) => [name, change(value)]));

  /** Makes the renderer of the page; what it is, in words. A page without one still answers all other operations. */
  async function start(kind) {
    try {
      GSVC.renderer = await GSVC.createRenderer(kind, null);
      return { renderer: GSVC.renderer.kind, adapter: GSVC.renderer.description };
    } catch (error) {
      GSVC.noRenderer = `there is no renderer ${kind}: ${error.message}`;
      return { renderer: "none", adapter: GSVC.noRenderer };
    }
  }

  /** What went wrong, and the line of which script it was. */
  function described({ message, stack }) {
    const place = /[\w.]+\.js:\d+/.exec(stack);
    return `${message}${place ? ` (${place[0]})` : ""}`;
  }

  /** {outputs: those of an operation, as messages}, or {unsupported: a reason}, or {error: what went wrong}. */
  async function answer(operation, inputs) {
    try {
      return { outputs: mapped(await operations[operation](mapped(inputs, received)), sent) };
    } catch (error) {
      if (error instanceof Unsupported) return { unsupported: error.message };
      return { error: described(error) };
    }
  }

  GSVC.bridge = { start, answer };
}
