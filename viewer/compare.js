"use strict";
// The source beside the stream: its frames from the server of `gsvc view`, differences, and the PSNR of each frame.
globalThis.GSVC ??= {};

{
  const MOST_CACHED = 2 ** 26; // bytes of frames of the source that are kept

  /** (11-5) of two frames: one MSE over the three channels; Infinity for equal ones. */
  function psnr(one, other, bitDepth) {
    let sum = 0; // exact: below 2^53
    for (let i = 0; i < one.length; i++) sum += (one[i] - other[i]) ** 2;
    return 10 * Math.log10((2 ** bitDepth - 1) ** 2 / (sum / one.length));
  }

  /** Samples as a picture of 8 bits. */
  function painted(width, height, bitDepth, sample) {
    const image = new ImageData(width, height);
    const { data } = image;
    for (let to = 0, from = 0; to < data.length; from += 3) {
      for (let c = 0; c < 3; c++) data[to++] = sample(from + c); // rounded and clamped
      data[to++] = 255;
    }
    return image;
  }

  /** The source of a stream: compares frames, and keeps what it found in `psnr`, by the place of the frame. */
  GSVC.Comparison = class {
    /**
     * @param {{name: string, width: number, height: number, bits: number}} source
     * @param {URL} folder behind which the frames lie by their number
     * @param {Object} stream with frames and a seeker of its own
     * @param {string} kind of the renderer
     */
    constructor(source, folder, stream, kind) {
      Object.assign(this, { source, folder, stream, kind, psnr: [], cached: new Map(), running: null });
    }

    /** Why the source cannot be compared with a stream; null: it can. */
    static misfit({ name, width, height, bits }, header) {
      const ours = `${header.width} × ${header.height}, ${header.bit_depth} bits`;
      const other = `${width} × ${height}, ${bits} bits`;
      return ours === other ? null : `${name} is not compared: it has ${other}, and the stream ${ours}.`;
    }

    /** The samples of the source for a frame, R G B; null: it has no such frame. */
    async samples(number) {
      if (!this.cached.has(number)) {
        const most = Math.max(1, Math.floor(MOST_CACHED / (6 * this.source.width * this.source.height)));
        for (const old of [...this.cached.keys()].slice(0, -most)) this.cached.delete(old);
        this.cached.set(number, this.#fetched(number));
      }
      try {
        return await this.cached.get(number);
      } catch (error) {
        this.cached.delete(number);
        throw error;
      }
    }

    async #fetched(number) {
      const response = await fetch(new URL(String(number), this.folder), { mode: "same-origin" });
      if (response.status === 204) return null;
      if (!response.ok) throw new Error(`${this.source.name}: ${(await response.text()).trim()}`);
      const bytes = await response.arrayBuffer();
      if (this.source.bits === 8) return new Uint8Array(bytes);
      const view = new DataView(bytes);
      return Uint16Array.from({ length: bytes.byteLength / 2 }, (_, i) => view.getUint16(2 * i, true));
    }

    /** The samples of a frame of the stream as they are decoded; by the GPU, if one of its renderers works. */
    async decoded(n) {
      const { width, height, bits } = this.source;
      this.renderer ??= GSVC.createRenderer(this.kind, null).catch(() => null);
      const renderer = await this.renderer;
      const turn = (this.turn ?? Promise.resolve()).then(async () => { // a renderer, and a seeker, do one thing at a time
        const { parameters } = await GSVC.inSteps(this.stream.frame.steps(n));
        if (!renderer) return GSVC.toFrameDeterministic(await GSVC.inSteps(GSVC.renderingSteps(parameters, width, height)), bits);
        return GSVC.toFrame(await renderer.sum(parameters, width, height), bits);
      });
      this.turn = turn.catch(() => null);
      return turn;
    }

    /** The PSNR of the frame at n, which is kept; null: the source has no such frame. */
    async measure(n) {
      if (this.psnr[n] !== undefined) return this.psnr[n];
      const samples = await this.samples(this.stream.frames[n].number);
      this.psnr[n] = samples && psnr(await this.decoded(n), samples, this.source.bits);
      return this.psnr[n];
    }

    /** Measure all frames that there are by now, and tell after each; until it is ended, or something fails. */
    async measureAll(told, failed) {
      if (this.running) return;
      this.running = true;
      try {
        for (let n = 0; n < this.stream.frames.length && !this.ended; n++) {
          if (this.psnr[n] !== undefined) continue;
          await this.measure(n);
          if (this.ended) break;
          told(n);
          await new Promise((resolve) => setTimeout(resolve));
        }
      } catch (error) {
        if (!this.ended) failed(error);
      }
      this.running = false;
    }

    /** What lies over the picture in a mode: the source, or the difference, `gain` times, around grey. */
    async picture(n, mode, gain) {
      const { width, height, bits } = this.source;
      const samples = await this.samples(this.stream.frames[n].number);
      if (samples === null) return null;
      const scale = 255 / (2 ** bits - 1);
      if (mode !== "difference") return painted(width, height, bits, (i) => samples[i] * scale);
      const decoded = await this.decoded(n);
      return painted(width, height, bits, (i) => 128 + gain * scale * (decoded[i] - samples[i]));
    }

    async end() {
      this.ended = true;
      (await this.renderer)?.destroy();
    }
  };

  GSVC.psnr = psnr;
}
