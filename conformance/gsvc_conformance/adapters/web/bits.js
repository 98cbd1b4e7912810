// Bytes, bits, checksums and faults: spec.md sections 3.1, 6.2 (CRC-32C) and 12.1.
"use strict";
globalThis.GSVC ??= {};
{
  const KIND_OF_RULE = {};
  const kinds = {
    malformed: "R-3.1-1 R-3.1-3 R-6.1-1 R-6.2-1 R-6.2-2 R-6.2-3 R-6.2-4 R-6.6-6 R-7-1 R-15.6-5",
    unsupported: "R-3.2-1 R-6.1-2 R-6.5-1 R-6.6-1",
    limit: "R-5-1 R-5-2 R-5-3 R-5-4 R-5-7 R-5-8 R-5-9 R-5-11 R-9.4-2",
  };
  for (const [kind, rules] of Object.entries(kinds)) for (const rule of rules.split(" ")) KIND_OF_RULE[rule] = kind;

  /**
   * The first rule that a stream breaks: its kind (12.1), its id, and the offset of the element at fault in bits. The chunk
   * there may be sound, and only come too fast or after one that is missing.
   */
  class Fault extends Error {
    constructor(rule, bit, { isSound = false } = {}) {
      const kind = KIND_OF_RULE[rule] ?? "invalid";
      super(`${kind} ${rule} ${bit}`);
      Object.assign(this, { kind, rule, bit, isSound });
    }
  }

  /** The function of bytes that gives their CRC of 32 bits, by a polynomial whose bits are reversed. */
  function crcBy(polynomial) {
    const table = Uint32Array.from({ length: 256 }, (_, byte) => {
      let register = byte;
      for (let i = 0; i < 8; i++) register = (register >>> 1) ^ (register & 1 ? polynomial : 0);
      return register;
    });
    return (bytes) => {
      let register = 0xffffffff;
      for (let i = 0; i < bytes.length; i++) register = (register >>> 8) ^ table[(register ^ bytes[i]) & 255];
      return (register ^ 0xffffffff) >>> 0;
    };
  }

  const crc32c = crcBy(0x82f63b78); // R-6.2-2

  /**
   * Reads the descriptors of section 3.1 from a part of a stream, and knows where in the stream they stand.
   *
   * Offsets in bits pass 2^31, so they are plain numbers and never operands of << or >>.
   */
  class Bits {
    constructor(data, firstBit = 0, endRule = "R-6.2-3") {
      this.data = data;
      this.at = 0; // the bit of `data` that comes next
      this.firstBit = firstBit; // where `data` begins in the stream
      this.endRule = endRule; // the rule that an element breaks which does not fit
      this.element = firstBit; // where the element that was read last begins in the stream
    }

    position() {
      return this.firstBit + this.at;
    }

    bitsLeft() {
      return 8 * this.data.length - this.at;
    }

    /** Refuses an element, or a run, that begins here (or at `start`) and needs more bits than there are. */
    need(bits, start = this.position()) {
      this.element = start;
      if (bits > this.bitsLeft()) throw new Fault(this.endRule, start);
    }

    /** u(n), n at most 32: the most significant bit comes first. */
    u(n) {
      this.need(n);
      return this.take(n);
    }

    /** u(n) inside of a run whose length was checked. */
    take(n) {
      let value = 0;
      for (let left = n; left > 0; ) {
        const used = this.at % 8;
        const byte = this.data[(this.at - used) / 8];
        const count = Math.min(8 - used, left);
        const bits = (byte >> (8 - used - count)) & ((1 << count) - 1);
        value = value * 2 ** count + bits; // no shift: 32 bits would become negative
        this.at += count;
        left -= count;
      }
      return value;
    }

    /** n bytes as they are, not copied. Only at a byte boundary, as are all descriptors below but eg(k). */
    raw(n) {
      this.need(8 * n);
      const first = this.at / 8;
      this.at += 8 * n;
      return this.data.subarray(first, first + n);
    }

    /** le(n), n at most 4: the least significant byte comes first. */
    le(n) {
      this.need(8 * n);
      const first = this.at / 8;
      this.at += 8 * n;
      let value = 0;
      for (let i = first + n - 1; i >= first; i--) value = value * 256 + this.data[i];
      return value;
    }

    uv() {
      const start = this.position();
      let value = 0;
      for (let group = 0; group < 5; group++) {
        this.need(8, start);
        const byte = this.data[this.at / 8];
        this.at += 8;
        value += (byte & 127) * 2 ** (7 * group);
        if (byte < 128) {
          const tooLong = byte === 0 && group > 0;
          if (tooLong || value >= 2 ** 32) break; // R-3.1-1
          return value;
        }
      }
      throw new Fault("R-3.1-1", start);
    }

    /** eg(k): z zero bits, a one, then z + k bits. */
    eg(k) {
      const start = this.position();
      let z = 0;
      for (this.need(1, start); this.take(1) === 0; this.need(1, start)) {
        z += 1;
        if (z > 16) throw new Fault("R-3.1-3", start);
      }
      this.need(z + k, start);
      return (2 ** z - 1) * 2 ** k + this.take(z + k);
    }

    /** The pattern of a binary16. */
    f16() {
      const bits = this.le(2);
      if ((bits & 0x7c00) === 0x7c00) throw new Fault("R-3.1-2", this.element);
      return bits;
    }

    f32() {
      const bytes = this.raw(4);
      const value = new DataView(bytes.buffer, bytes.byteOffset, 4).getFloat32(0, true);
      if (!Number.isFinite(value)) throw new Fault("R-3.1-2", this.element);
      return value;
    }

    align() {
      const used = this.at % 8;
      if (used > 0 && this.u(8 - used) !== 0) throw new Fault("R-3.1-4", this.element);
    }

    /** R-6.2-3, after the last element of a payload. */
    checkFilled() {
      if (this.bitsLeft() > 0) throw new Fault("R-6.2-3", this.position());
    }
  }

  Object.assign(GSVC, { Fault, Bits, crcBy, crc32c });
}
