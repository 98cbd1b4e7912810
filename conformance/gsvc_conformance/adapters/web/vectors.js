// Where golden vectors come from: over HTTP, or from a folder that a user chooses or drops on the page.
//
// Each source is {ids, listed, sums, verified, read}: the ids of the vectors that are there, those that SHA256SUMS
// lists (null without it), the SHA-256 of SHA256SUMS (one number for the whole set, or null), whether files are held
// against SHA256SUMS, and read(path) -> Promise<Uint8Array>.
"use strict";
globalThis.GSVC ??= {};
{
  const SUMS = "SHA256SUMS";
  const PATH = /(?:^|\/)((?:core|uncommon|stress|faulty|full)\/[a-z0-9_]+\/[^/]+\/[^/]+)$/;

  async function sha256(bytes) {
    const digest = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
    return Array.from(digest, (byte) => byte.toString(16).padStart(2, "0")).join("");
  }

  const MANIFEST = "/manifest.json";
  const idsOf = (paths) =>
    paths.filter((path) => path.endsWith(MANIFEST)).map((path) => path.slice(0, -MANIFEST.length)).sort();

  /** The source of the files at `paths`, null: of all that are listed; `text` is SHA256SUMS, or null without it. */
  async function source(paths, text, fetchFile) {
    const lines = text === null ? [] : new TextDecoder().decode(text).trim().split("\n");
    const expected = new Map(lines.map((line) => [line.slice(66), line.slice(0, 64)]));
    const canHash = globalThis.crypto?.subtle !== undefined; // pages over http: from another machine have no hashes
    const verified = text !== null && canHash;
    const read = async (path) => {
      const bytes = await fetchFile(path);
      if (verified && (await sha256(bytes)) !== expected.get(path)) throw new Error(`${path} is not what ${SUMS} says`);
      return bytes;
    };
    const listed = text === null ? null : idsOf([...expected.keys()]);
    return { ids: paths ? idsOf(paths) : listed, listed, sums: verified ? await sha256(text) : null, verified, read };
  }

  /** The vectors in the folder at a URL, which has SHA256SUMS. */
  async function vectorsAt(url) {
    const fetchFile = async (path) => {
      const response = await fetch(new URL(path, new URL(url, document.baseURI)));
      if (!response.ok) throw new Error(`${path}: ${response.status} ${response.statusText}`);
      return new Uint8Array(await response.arrayBuffer());
    };
    return source(null, await fetchFile(SUMS), fetchFile);
  }

  /**
   * The vectors among files: a FileList of <input type="file" webkitdirectory>, or what droppedFiles gives.
   *
   * The folder may be vectors/, one that holds it, or a tier of it.
   */
  async function vectorsAmong(files) {
    const byPath = new Map();
    let sums = null;
    for (const file of files) {
      const path = file.pathInDrop ?? file.webkitRelativePath;
      const match = PATH.exec(path);
      if (match) byPath.set(match[1], file);
      if (path.endsWith(SUMS)) sums = file;
    }
    const bytesOf = async (file) => new Uint8Array(await file.arrayBuffer());
    const fetchFile = async (path) => {
      if (!byPath.has(path)) throw new Error(`${path} is missing`);
      return bytesOf(byPath.get(path));
    };
    const found = await source([...byPath.keys()], sums && (await bytesOf(sums)), fetchFile);
    if (found.ids.length === 0) throw new Error("there are no vectors in this folder: choose the folder vectors");
    return found;
  }

  /**
   * All files of the folders and files in a drop event's dataTransfer, each with its path as `pathInDrop`.
   *
   * Call it in the event itself: what was dropped can't be asked for later. Chromium has handles, and its entries fail
   * on a page that was opened from a disk; other browsers have entries only.
   */
  async function droppedFiles(dataTransfer) {
    const items = Array.from(dataTransfer.items).filter((item) => item.kind === "file");
    const handles = items.every((item) => item.getAsFileSystemHandle);
    const roots = items.map((item) => (handles ? item.getAsFileSystemHandle() : item.webkitGetAsEntry()));
    const found = (await Promise.all(roots)).map((root) => (handles ? filesOfHandle(root, "") : filesOfEntry(root)));
    return (await Promise.all(found)).flat();
  }

  async function filesOfHandle(handle, home) {
    const path = `${home}/${handle.name}`;
    if (handle.kind === "file") return [Object.assign(await handle.getFile(), { pathInDrop: path })];
    const found = [];
    for await (const inner of handle.values()) found.push(filesOfHandle(inner, path));
    return (await Promise.all(found)).flat();
  }

  async function filesOfEntry(entry) {
    if (entry.isFile) {
      const file = await new Promise((resolve, reject) => entry.file(resolve, reject));
      return [Object.assign(file, { pathInDrop: entry.fullPath })];
    }
    const reader = entry.createReader();
    const files = [];
    for (;;) {
      // At most a hundred entries come at a time; none means that there are no more.
      const entries = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
      if (entries.length === 0) return files;
      files.push(...(await Promise.all(entries.map(filesOfEntry))).flat());
    }
  }

  Object.assign(GSVC, { vectorsAt, vectorsAmong, droppedFiles });
}
