"use strict";
// GSVC rendering with WebGPU: the host's side of render.wgsl.js, whose comment at the head names passes and bindings.
globalThis.GSVC ??= {};

{
  const TILE = 16;
  const SPLATS_OF_SLICE = 2 ** 16; // their masks need 64 MiB for the widest frame
  const PIXELS_OF_BAND = 2 ** 23; // their sums need 96 MiB, which is below the 128 MiB that every device binds

  const groups = (things, size) => Math.ceil(things / size);

  /** Where pictures go: the canvas's own textures. */
  class CanvasTarget {
    constructor(device, canvas) {
      this.format = navigator.gpu.getPreferredCanvasFormat();
      this.context = canvas.getContext("webgpu");
      if (!this.context) throw new Error("the canvas cannot show what WebGPU draws");
      this.context.configure({ device, format: this.format, alphaMode: "premultiplied" });
    }

    texture() {
      return this.context.getCurrentTexture();
    }

    async shown() {}
  }

  /** The same for an adapter in software: Chromium's loses the device when a canvas is asked for a texture. */
  class CopiedTarget {
    format = "rgba8unorm";

    constructor(device, canvas) {
      Object.assign(this, { device, canvas, context: canvas.getContext("2d") });
    }

    texture() {
      const { width, height } = this.canvas;
      const usage = GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC;
      this.drawn = this.device.createTexture({ size: [width, height], format: this.format, usage });
      return this.drawn;
    }

    async shown() {
      const { width, height } = this.drawn;
      const bytesPerRow = 256 * groups(4 * width, 256); // as WebGPU asks for
      const usage = GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ;
      const copy = this.device.createBuffer({ size: bytesPerRow * height, usage });
      const encoder = this.device.createCommandEncoder();
      encoder.copyTextureToBuffer({ texture: this.drawn }, { buffer: copy, bytesPerRow }, [width, height]);
      this.device.queue.submit([encoder.finish()]);
      await copy.mapAsync(GPUMapMode.READ);
      const rows = new Uint8ClampedArray(copy.getMappedRange());
      const image = new ImageData(width, height);
      for (let j = 0; j < height; j++) {
        image.data.set(rows.subarray(j * bytesPerRow, j * bytesPerRow + 4 * width), 4 * width * j);
      }
      this.context.putImageData(image, 0, 0);
      copy.destroy();
      this.drawn.destroy();
    }
  }

  class WebGPURenderer {
    kind = "webgpu";

    constructor(device, info) {
      this.device = device;
      this.description = `WebGPU, ${[info.description || info.device || info.vendor, info.architecture]
        .filter(Boolean).join(", ") || "a GPU without a name"}`;
      this.buffers = new Map();
      this.module = device.createShaderModule({ code: GSVC.RENDER_WGSL });
      device.lost.then(({ reason, message }) => {
        if (reason !== "destroyed") this.fault = new Error(`the GPU is lost; load the page again. ${message}`);
      });
    }

    /** Compile the passes of a sum. */
    async prepare() {
      const { device, module } = this;
      const compute = (entryPoint) =>
        device.createComputePipelineAsync({ layout: "auto", compute: { module, entryPoint } });
      [this.first, this.second, this.third] = await Promise.all(["prepare", "mark", "sum"].map(compute));
      return this;
    }

    /** Compile what shows sums on a canvas. */
    async prepareCanvas(canvas, target) {
      const { module } = this;
      Object.assign(this, { canvas, target });
      this.show = await this.device.createRenderPipelineAsync({
        layout: "auto",
        vertex: { module, entryPoint: "corners" },
        fragment: { module, entryPoint: "show", targets: [{ format: target.format }] },
      });
      return this;
    }

    /** A buffer of at least so many bytes, kept under a name from picture to picture. */
    #buffer(name, size, usage = GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_SRC | GPUBufferUsage.COPY_DST) {
      const old = this.buffers.get(name);
      if (old && old.size >= size) return old;
      old?.destroy();
      const made = this.device.createBuffer({ size: Math.max(16, size), usage });
      this.buffers.set(name, made);
      return made;
    }

    /** View of render.wgsl.js. */
    #writeView(first, [columns, rows], { scale, shift }, splats, peak) {
      const view = this.#buffer("view", 48, GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST);
      const words = new DataView(new ArrayBuffer(40));
      [0, first, columns, rows].forEach((value, i) => words.setUint32(4 * i, value, true));
      [scale, scale, ...shift].forEach((value, i) => words.setFloat32(16 + 4 * i, value, true));
      words.setUint32(32, splats, true);
      words.setFloat32(36, peak, true);
      this.device.queue.writeBuffer(view, 0, words.buffer);
      return view;
    }

    /** Sums of a band of rows of a picture into the buffer `sums`, one slice of the splats after the other. */
    #addUp(parameters, first, extent, place, peak) {
      const [columns, rows] = extent;
      const bytes = 12 * columns * rows;
      if (bytes > this.device.limits.maxStorageBufferBindingSize) {
        throw new Error(`this GPU binds ${this.device.limits.maxStorageBufferBindingSize} bytes, ${bytes} are needed`);
      }
      const sums = this.#buffer("sums", bytes);
      const clear = this.device.createCommandEncoder();
      clear.clearBuffer(sums, 0, Math.max(4, bytes));
      this.device.queue.submit([clear.finish()]);
      for (let at = 0; at < parameters.length; at += 8 * SPLATS_OF_SLICE) {
        const slice = parameters.subarray(at, at + 8 * SPLATS_OF_SLICE);
        const view = this.#writeView(first, extent, place, slice.length / 8, peak);
        this.#addSlice(slice, view, sums, groups(columns, TILE), groups(rows, TILE));
      }
      return sums;
    }

    #addSlice(parameters, view, sums, across, down) {
      const count = parameters.length / 8;
      const words = groups(count, 32);
      const given = this.#buffer("parameters", 32 * count);
      this.device.queue.writeBuffer(given, 0, parameters);
      const buffers = [
        view, given, this.#buffer("splats", 32 * count), this.#buffer("spans", 16 * count),
        this.#buffer("masks", 4 * words * (across + down)), sums,
      ];
      const encoder = this.device.createCommandEncoder();
      const pass = encoder.beginComputePass();
      this.#dispatch(pass, this.first, buffers, [0, 1, 2, 3], [groups(count, 64)]);
      this.#dispatch(pass, this.second, buffers, [0, 3, 4], [groups(words, 64), across + down]);
      this.#dispatch(pass, this.third, buffers, [0, 2, 4, 5], [across, down]);
      pass.end();
      this.device.queue.submit([encoder.finish()]);
    }

    #dispatch(pass, pipeline, buffers, bindings, workgroups) {
      pass.setPipeline(pipeline);
      pass.setBindGroup(0, this.#group(pipeline, bindings.map((binding) => [binding, buffers[binding]])));
      pass.dispatchWorkgroups(...workgroups);
    }

    #group(pipeline, bindings) {
      const entries = bindings.map(([binding, buffer]) => ({ binding, resource: { buffer } }));
      return this.device.createBindGroup({ layout: pipeline.getBindGroupLayout(0), entries });
    }

    async sum(parameters, width, height) {
      const sum = new Float32Array(3 * width * height);
      const most = Math.max(1, Math.floor(PIXELS_OF_BAND / width / TILE) * TILE);
      for (let first = 0; first < height; first += most) {
        const rows = Math.min(most, height - first);
        this.device.pushErrorScope("validation");
        const sums = this.#addUp(parameters, first, [width, rows], { scale: 1, shift: [0, 0] }, 255);
        const values = this.#read(sums, 12 * width * rows);
        const fault = this.fault ?? await this.device.popErrorScope();
        if (fault) throw new Error(fault.message);
        sum.set(await values, 3 * width * first);
      }
      return sum;
    }

    async #read(buffer, size) {
      const usage = GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ;
      const copy = this.device.createBuffer({ size, usage });
      const encoder = this.device.createCommandEncoder();
      encoder.copyBufferToBuffer(buffer, 0, copy, 0, size);
      this.device.queue.submit([encoder.finish()]);
      await copy.mapAsync(GPUMapMode.READ);
      const values = new Float32Array(copy.getMappedRange().slice(0));
      copy.destroy();
      return values;
    }

    async draw(parameters, view) {
      if (this.fault) throw this.fault;
      const extent = [this.canvas.width, this.canvas.height];
      const peak = 2 ** view.bitDepth - 1;
      const sums = this.#addUp(parameters, 0, extent, GSVC.placed(view), peak);
      const uniform = this.#writeView(0, extent, GSVC.placed(view), 0, peak);
      const encoder = this.device.createCommandEncoder();
      const pass = encoder.beginRenderPass({
        colorAttachments: [{
          view: this.target.texture().createView(), loadOp: "clear", clearValue: [0, 0, 0, 0], storeOp: "store",
        }],
      });
      pass.setPipeline(this.show);
      pass.setBindGroup(0, this.#group(this.show, [[0, uniform], [7, sums]]));
      pass.setScissorRect(...GSVC.seen(view, ...extent));
      pass.draw(3);
      pass.end();
      this.device.queue.submit([encoder.finish()]);
      await this.target.shown();
    }

    destroy() {
      this.device.destroy();
    }
  }

  GSVC.renderers ??= {};
  GSVC.renderers.webgpu = async (canvas, alsoSoftware) => {
    const adapter = await globalThis.navigator?.gpu?.requestAdapter({ powerPreference: "high-performance" });
    if (!adapter) throw new Error("this browser has no WebGPU, or none for this GPU");
    const software = adapter.info.isFallbackAdapter || adapter.info.architecture === "swiftshader";
    if (software && !alsoSoftware) throw new Error("only in software, where WebGL2 is faster");
    const { maxBufferSize, maxStorageBufferBindingSize } = adapter.limits;
    const device = await adapter.requestDevice({ requiredLimits: { maxBufferSize, maxStorageBufferBindingSize } });
    const renderer = await new WebGPURenderer(device, adapter.info).prepare();
    if (!canvas) return renderer;
    return renderer.prepareCanvas(canvas, new (software ? CopiedTarget : CanvasTarget)(device, canvas));
  };
}
