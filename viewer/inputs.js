"use strict";
// Where the bytes of a stream come from: each input has a name and `pieces`, which gives them one after the other.
globalThis.GSVC ??= {};

{
  /** The bytes of an answer as they come. */
  async function* piecesOf(url, signal) {
    if (location.protocol === "file:") throw new Error("a page opened from a disk may not look for files. Drop it here.");
    const response = await fetch(url, { mode: "same-origin", signal });
    if (!response.ok) throw new Error(`${response.status} ${response.statusText}`);
    const reader = response.body.getReader();
    try {
      for (;;) {
        const { done, value } = await reader.read();
        if (done) return;
        yield value;
      }
    } finally {
      reader.cancel().catch(() => {}); // nobody wants the rest
    }
  }

  /** A file that was chosen or dropped. */
  const ofFile = (file) => ({
    name: file.name,
    pieces: async function* () {
      yield new Uint8Array(await file.arrayBuffer());
    },
  });

  /** A stream inside of the page. */
  const ofText = ({ name, base64 }) => ({
    name,
    pieces: async function* () {
      yield Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
    },
  });

  /** Bytes that were read already. */
  const ofBytes = (input, bytes) => ({
    ...input,
    live: false,
    pieces: async function* () {
      yield bytes;
    },
  });

  /** A file that the page's address names, `index.html?file=clip.gsvc`, on the server that the page came from. */
  const named = (path) => ({ name: path.split("/").pop(), pieces: (signal) => piecesOf(path, signal) });

  /** What `gsvc view` shows, `index.html?view=PATH`: the stream and, if it has one, its source. */
  async function viewed(path) {
    const at = new URL(path, location.href);
    const response = await fetch(at, { mode: "same-origin" });
    if (!response.ok) throw new Error(`${response.status} ${response.statusText}`);
    const { name, live, source } = await response.json();
    const pieces = (signal) => piecesOf(new URL("stream", at), signal);
    return { name, live, source, pieces, folder: new URL("source/", at) };
  }

  GSVC.inputs = { ofFile, ofText, ofBytes, named, viewed };
}
