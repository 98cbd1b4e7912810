"use strict";
// A frame as a PNG file with exactly its samples: a canvas would have 8 bits and the screen's colours.
globalThis.GSVC ??= {};

{
  const crc32 = GSVC.crcBy(0xedb88320); // PNG's

  /** A chunk of PNG: length, type, data, checksum. */
  function chunk(type, data) {
    const made = new Uint8Array(data.length + 12);
    const view = new DataView(made.buffer);
    view.setUint32(0, data.length);
    made.set(new TextEncoder().encode(type), 4);
    made.set(data, 8);
    view.setUint32(data.length + 8, crc32(made.subarray(4, data.length + 8)));
    return made;
  }

  /** Rows of samples, each after the number of its filter (0: none); 9 to 16 bits as 16, the first byte first. */
  function rowsOf(frame, width, height, bitDepth) {
    const bytesOfSample = bitDepth === 8 ? 1 : 2;
    const rows = new Uint8Array(height * (1 + 3 * width * bytesOfSample));
    const peak = 2 ** bitDepth - 1;
    let to = 0;
    for (let j = 0, from = 0; j < height; j++) {
      rows[to++] = 0;
      for (let k = 0; k < 3 * width; k++, from++) {
        if (bytesOfSample === 1) {
          rows[to++] = frame[from];
        } else {
          const sample = Math.round((frame[from] * 65535) / peak);
          rows[to++] = sample >> 8;
          rows[to++] = sample & 255;
        }
      }
    }
    return rows;
  }

  async function deflated(bytes) {
    const stream = new Blob([bytes]).stream().pipeThrough(new CompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  /** A PNG file of a frame (H W 3 samples), as a Blob. */
  GSVC.png = async (frame, width, height, bitDepth) => {
    const header = new Uint8Array(13);
    const view = new DataView(header.buffer);
    view.setUint32(0, width);
    view.setUint32(4, height);
    header.set([bitDepth === 8 ? 8 : 16, 2], 8); // bits of a sample; 2: red, green, blue
    const significant = bitDepth % 8 ? [chunk("sBIT", new Uint8Array(3).fill(bitDepth))] : [];
    const data = chunk("IDAT", await deflated(rowsOf(frame, width, height, bitDepth)));
    const magic = Uint8Array.of(0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a);
    const parts = [magic, chunk("IHDR", header), ...significant, data, chunk("IEND", new Uint8Array(0))];
    return new Blob(parts, { type: "image/png" });
  };
}
