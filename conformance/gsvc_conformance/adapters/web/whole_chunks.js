"use strict";
// Whole chunks among damaged ones (spec.md section 12.5): any part's checksum follows from the registers at its two ends.
globalThis.GSVC ??= {};

{
  const { LONGEST_HEADER } = GSVC;
  const KEPT_EVERY = 64; // bytes between two positions whose register is kept
  const INVERTED = 0xffffffff;
  const CRC_SIZE = 4;

  const TABLE = Uint32Array.from({ length: 256 }, (_, byte) => { // of CRC-32C, R-6.2-2
    let register = byte;
    for (let i = 0; i < 8; i++) register = (register >>> 1) ^ (register & 1 ? 0x82f63b78 : 0);
    return register;
  });

  /** What a linear map makes of a register; `map` has the images of its bits. */
  function mapped(map, register) {
    let image = 0;
    for (let bit = 0; register !== 0; bit++, register >>>= 1) if (register & 1) image ^= map[bit];
    return image;
  }

  /** The maps of 1, 2, 4, … zero bytes, since the checksum is linear. */
  const ZEROS = [Uint32Array.from({ length: 32 }, (_, bit) => {
    const register = 2 ** bit;
    return (register >>> 8) ^ TABLE[register & 255];
  })];
  while (ZEROS.length < 32) ZEROS.push(ZEROS.at(-1).map((image) => mapped(ZEROS.at(-1), image)));

  GSVC.WholeChunks = class {
    /**
     * @param {Uint8Array} bytes
     * @param {number} longest bytes of a payload
     */
    constructor(bytes, longest) {
      Object.assign(this, { bytes, longest });
      this.kept = [0]; // registers that began as 0 at byte 0
    }

    /** Where the payload of the chunk at `at` ends, and where it begins; null without a letter and a legal length. */
    payload(at) {
      const { bytes } = this;
      const letter = bytes[at] | 0x20;
      if (!(letter >= 0x61 && letter <= 0x7a)) return null;
      let length = 0;
      for (let i = 0, body = at + 1; i < 5 && body < bytes.length; i++) {
        const byte = bytes[body++];
        length += (byte & 127) * 2 ** (7 * i);
        if (byte >= 128) continue;
        const most = bytes[at] === 0x48 ? LONGEST_HEADER : this.longest;
        return (byte === 0 && i > 0) || length > most ? null : { begin: body, end: body + length };
      }
      return null;
    }

    /** The chunk at `at`: its type, the places of its payload, and its end; null if it is not whole. */
    at(at) {
      const payload = this.payload(at);
      if (payload === null || payload.end + CRC_SIZE > this.bytes.length) return null;
      const stated = new DataView(this.bytes.buffer, this.bytes.byteOffset + payload.end, CRC_SIZE).getUint32(0, true);
      if (this.#checksum(at, payload.end) !== stated) return null;
      return { type: String.fromCharCode(this.bytes[at]), ...payload, next: payload.end + CRC_SIZE };
    }

    /** The register after so many bytes. */
    #register(at) {
      const { kept, bytes } = this;
      for (let n = kept.length; n <= Math.floor(at / KEPT_EVERY); n++) {
        kept.push(this.#stepped(kept[n - 1], (n - 1) * KEPT_EVERY, n * KEPT_EVERY));
      }
      const near = Math.floor(at / KEPT_EVERY);
      return this.#stepped(kept[near], near * KEPT_EVERY, Math.min(at, bytes.length));
    }

    #stepped(register, from, to) {
      for (let i = from; i < to; i++) register = (register >>> 8) ^ TABLE[(register ^ this.bytes[i]) & 255];
      return register;
    }

    #checksum(from, to) {
      let first = (this.#register(from) ^ INVERTED) >>> 0;
      for (let k = 0, left = to - from; left > 0; k++, left = Math.floor(left / 2)) {
        if (left % 2 === 1) first = mapped(ZEROS[k], first >>> 0);
      }
      return (first ^ this.#register(to) ^ INVERTED) >>> 0;
    }
  };
}
