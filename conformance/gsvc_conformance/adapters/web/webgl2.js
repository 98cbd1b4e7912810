"use strict";
// GSVC rendering with WebGL2 (spec.md section 9): one rectangle a splat, added up by the blending unit.
//
// Nothing sorts splats into tiles here: the rasteriser that every GPU has does it. Pass 1 draws the box of each splat
// as an instance of one rectangle; its fragments are the pixels of (5-1), and the blend function ONE, ONE adds their
// g c' to a texture of binary32, one splat after the other: (9-2). Pass 2 clamps that and puts it on the canvas.
//
// The driver may take all numbers for finite. So the tests that (9-1) makes fail for a NaN compare bit patterns: those
// of numbers that are not negative are ordered as the numbers are, and NaN and infinity lie above all finite ones.
globalThis.GSVC ??= {};

{
  const BLOCK = 2048; // side of the texture of a sum; larger frames are made of several

  const PREAMBLE = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
`;

  const SPLAT_VERTICES = `${PREAMBLE}
const float REACH = 3.3290683677126687;   // rho' of (5-1): the radius of the support, with room for roundings

layout(location = 0) in vec2 corner;      // 0 or 1
layout(location = 1) in vec4 geometry;    // x, y, l11, l21: per splat
layout(location = 2) in vec4 rest;        // l22, R, G, B
uniform vec2 origin;                      // pixel at which the texture begins
uniform vec2 size;                        // pixels of the texture that are drawn
uniform float scale;                      // (9-8), below 1 (9-9), with a = e: 1 for the coded size
uniform vec2 shift;                       // then added to the centres: minus the left and top of a zoomed view
flat out vec4 splat;
flat out vec4 splat_rest;

// Finite, and at least 2^-126: else the splat is degenerate (section 9.1).
bool normal(float factor) {
  uint bits = floatBitsToUint(factor);
  return bits >= 0x00800000u && bits < 0x7f800000u;
}

// (9-9) of a splat with (9-8): what is smaller than a pixel of the picture is spread over it.
void smooth_out() {
  float width = sqrt((1.0 - scale) * (1.0 + scale) / 12.0);   // the root of v
  float m11 = length(vec2(splat.z, width));
  float m22 = length(vec3(splat_rest.x, width, splat.w * (width / m11)));
  splat_rest = vec4(m22, splat_rest.yzw * (splat.z / m11 * (splat_rest.x / m22)));
  splat.zw = vec2(m11, splat.w * (splat.z / m11));
}

void main() {
  splat = vec4(geometry.xy * scale + shift, geometry.zw * scale);
  splat_rest = vec4(rest.x * scale, rest.yzw);
  bool given = normal(geometry.z) && normal(rest.x);
  if (given && scale < 1.0) smooth_out();
  // Half the box of (5-1), and room for every rounding on the way: what the box holds too much, sigma takes away.
  vec2 extent = REACH * vec2(splat.z, abs(splat.w) + splat_rest.x);
  vec2 margin = 1.0 + (abs(splat.xy) + extent) * exp2(-16.0);
  vec2 low = clamp(splat.xy - extent - margin - origin, vec2(0), size);
  vec2 high = clamp(splat.xy + extent + margin - origin, vec2(0), size);
  bool drawn = given && normal(splat.z) && normal(splat_rest.x);
  gl_Position = drawn ? vec4(mix(low, high, corner) / size * 2.0 - 1.0, 0, 1) : vec4(2, 2, 2, 1);
}`;

  const SPLAT_FRAGMENTS = `${PREAMBLE}
const float LN_255 = 5.541263545158426;

uniform vec2 origin;
flat in vec4 splat;
flat in vec4 splat_rest;
layout(location = 0) out vec4 color;

void main() {
  vec2 d = (gl_FragCoord.xy + origin) - splat.xy;     // the sum is exact: pixel centres are half-integers below 2^16
  float u1 = d.x / splat.z;
  float u2 = (d.y - splat.w * u1) / splat_rest.x;     // first the difference, then the quotient: it may cancel
  float sigma = 0.5 * (u1 * u1 + u2 * u2);            // (9-1)
  if (floatBitsToUint(sigma) > floatBitsToUint(LN_255)) discard;   // also a NaN
  color = vec4(exp(-sigma) * splat_rest.yzw, 1);      // one term of (9-2)
}`;

  const PICTURE_VERTICES = `${PREAMBLE}
layout(location = 0) in vec2 corner;
void main() { gl_Position = vec4(corner * 2.0 - 1.0, 0, 1); }`;

  const PICTURE_FRAGMENTS = `${PREAMBLE}
uniform sampler2D sums;
uniform ivec2 first;     // pixel of the canvas at which the texture begins
uniform int height;      // of the canvas: its rows count from the bottom, those of a frame from the top
uniform float peak;      // 2^bit_depth - 1
layout(location = 0) out vec4 color;

void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec3 sum = texelFetch(sums, ivec2(pixel.x, height - 1 - pixel.y) - first, 0).rgb;
  color = vec4(roundEven(clamp(sum, 0.0, 1.0) * peak) / peak, 1);     // R-9.1-1
}`;

  /** A linked program and its uniforms by name. */
  function program(gl, vertices, fragments, uniforms) {
    const linked = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, vertices], [gl.FRAGMENT_SHADER, fragments]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(linked, shader);
      gl.deleteShader(shader);
    }
    gl.linkProgram(linked);
    if (!gl.getProgramParameter(linked, gl.LINK_STATUS)) {
      const logs = gl.getAttachedShaders(linked).map((shader) => gl.getShaderInfoLog(shader));
      throw new Error(`WebGL2 shader: ${gl.getProgramInfoLog(linked)} ${logs.join(" ")}`);
    }
    const places = uniforms.map((name) => [name, gl.getUniformLocation(linked, name)]);
    return { linked, at: Object.fromEntries(places) };
  }

  /** What a texture of sums can be here: binary32 wherever it can be blended, binary16 (good to look at) elsewhere. */
  function sumFormat(gl) {
    const floats = gl.getExtension("EXT_color_buffer_float");
    if (floats && gl.getExtension("EXT_float_blend")) return { internal: gl.RGBA32F, bits: 32 };
    if (floats || gl.getExtension("EXT_color_buffer_half_float")) return { internal: gl.RGBA16F, bits: 16 };
    throw new Error("this browser's WebGL2 cannot add up numbers in a texture (EXT_color_buffer_float)");
  }

  class WebGL2Renderer {
    kind = "webgl2";

    constructor(canvas) {
      this.canvas = canvas ?? new OffscreenCanvas(1, 1);
      const options = { alpha: true, antialias: false, depth: false, stencil: false, premultipliedAlpha: true };
      const gl = this.gl = this.canvas.getContext("webgl2", options);
      if (!gl) throw new Error("this browser has no WebGL2");
      this.format = sumFormat(gl);
      this.largest = Math.min(BLOCK, gl.getParameter(gl.MAX_TEXTURE_SIZE));
      this.splats = program(gl, SPLAT_VERTICES, SPLAT_FRAGMENTS, ["origin", "size", "scale", "shift"]);
      this.picture = program(gl, PICTURE_VERTICES, PICTURE_FRAGMENTS, ["first", "height", "peak"]);
      this.sums = null; // the texture
      this.target = gl.createFramebuffer();
      this.targetSize = [0, 0];
      this.#layOut();
      const names = gl.getExtension("WEBGL_debug_renderer_info");
      const device = gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
      this.description = `WebGL2, ${device}${this.format.bits === 16 ? ", sums of 16 bits" : ""}`;
    }

    /** Attributes: the corners of one rectangle, and 32 bytes of parameters for each instance of it. */
    #layOut() {
      const gl = this.gl;
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([0, 0, 1, 0, 0, 1, 1, 1]), gl.STATIC_DRAW);
      gl.enableVertexAttribArray(0);
      gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
      this.parameters = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, this.parameters);
      for (const [location, first] of [[1, 0], [2, 16]]) {
        gl.enableVertexAttribArray(location);
        gl.vertexAttribPointer(location, 4, gl.FLOAT, false, 32, first);
        gl.vertexAttribDivisor(location, 1);
      }
    }

    /** Have the texture of sums hold at least so many pixels. */
    #reserve(width, height) {
      const gl = this.gl;
      gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
      if (width <= this.targetSize[0] && height <= this.targetSize[1]) return;
      this.targetSize = [Math.max(width, this.targetSize[0]), Math.max(height, this.targetSize[1])];
      gl.deleteTexture(this.sums);
      this.sums = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, this.sums);
      gl.texStorage2D(gl.TEXTURE_2D, 1, this.format.internal, ...this.targetSize);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST); // else it could not even be fetched from
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.sums, 0);
    }

    #upload(parameters) {
      this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.parameters);
      this.gl.bufferData(this.gl.ARRAY_BUFFER, parameters, this.gl.STREAM_DRAW);
    }

    /** Pass 1: the sums of a block of the frame, of so many splats, into the texture. */
    #addUp(count, { scale, shift }, [left, top, width, height]) {
      const gl = this.gl;
      this.#reserve(width, height);
      gl.viewport(0, 0, width, height);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT);
      gl.useProgram(this.splats.linked);
      gl.uniform2f(this.splats.at.origin, left, top);
      gl.uniform2f(this.splats.at.size, width, height);
      gl.uniform1f(this.splats.at.scale, scale);
      gl.uniform2f(this.splats.at.shift, ...shift);
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.ONE, gl.ONE);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
      gl.disable(gl.BLEND);
    }

    /** The blocks that a picture is made of: left, top, width, height. */
    * #blocks(width, height) {
      for (let top = 0; top < height; top += this.largest) {
        for (let left = 0; left < width; left += this.largest) {
          yield [left, top, Math.min(this.largest, width - left), Math.min(this.largest, height - top)];
        }
      }
    }

    async sum(parameters, width, height) {
      if (this.format.bits < 32) throw new Error("this device cannot add up in binary32 (EXT_float_blend)");
      const sum = new Float32Array(3 * width * height);
      this.#upload(parameters);
      for (const [left, top, columns, rows] of this.#blocks(width, height)) {
        this.#addUp(parameters.length / 8, { scale: 1, shift: [0, 0] }, [left, top, columns, rows]);
        const pixels = await this.#read(columns, rows);
        for (let j = 0; j < rows; j++) {
          for (let i = 0, from = 4 * j * columns; i < columns; i++, from += 4) {
            const to = 3 * ((top + j) * width + left + i);
            sum[to] = pixels[from];
            sum[to + 1] = pixels[from + 1];
            sum[to + 2] = pixels[from + 2];
          }
        }
      }
      return sum;
    }

    /** The texture of sums, R G B A for each pixel, when the GPU is done with it. */
    async #read(columns, rows) {
      const gl = this.gl;
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
      gl.bufferData(gl.PIXEL_PACK_BUFFER, 16 * columns * rows, gl.STREAM_READ);
      gl.readPixels(0, 0, columns, rows, gl.RGBA, gl.FLOAT, 0);
      const done = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
      gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
      gl.flush();
      while (gl.clientWaitSync(done, 0, 0) === gl.TIMEOUT_EXPIRED) await new Promise((next) => setTimeout(next));
      gl.deleteSync(done);
      const pixels = new Float32Array(4 * columns * rows);
      gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
      gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, pixels);
      gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
      gl.deleteBuffer(buffer);
      this.#check();
      return pixels;
    }

    async draw(parameters, view) {
      const { width, height } = this.canvas;
      this.#checkContext();
      this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, null);
      this.gl.clearColor(0, 0, 0, 0);
      this.gl.clear(this.gl.COLOR_BUFFER_BIT);
      this.#upload(parameters);
      for (const block of this.#blocks(width, height)) {
        this.#addUp(parameters.length / 8, GSVC.placed(view), block);
        this.#show(GSVC.seen(view, width, height), block, view.bitDepth);
      }
    }

    /** Pass 2: a block of sums, clamped and rounded, on its place of the canvas. */
    #show([x, y, columns, rows], [left, top, width, height], bitDepth) {
      const gl = this.gl;
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
      gl.viewport(0, 0, this.canvas.width, this.canvas.height);
      gl.enable(gl.SCISSOR_TEST); // the block, as far as it shows the frame
      const right = Math.min(x + columns, left + width);
      const bottom = Math.min(y + rows, top + height);
      const first = [Math.max(x, left), this.canvas.height - bottom];
      gl.scissor(...first, Math.max(right - first[0], 0), Math.max(bottom - Math.max(y, top), 0));
      gl.useProgram(this.picture.linked);
      gl.bindTexture(gl.TEXTURE_2D, this.sums);
      gl.uniform2i(this.picture.at.first, left, top);
      gl.uniform1i(this.picture.at.height, this.canvas.height);
      gl.uniform1f(this.picture.at.peak, 2 ** bitDepth - 1);
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
      gl.disable(gl.SCISSOR_TEST);
    }

    #check() {
      const fault = this.gl.getError();
      this.#checkContext();
      if (fault) throw new Error(`WebGL2 error ${fault}`);
    }

    #checkContext() {
      if (this.gl.isContextLost()) throw new Error("the GPU has taken WebGL2 away; load the page again");
    }

    destroy() {
      this.gl.getExtension("WEBGL_lose_context")?.loseContext();
    }
  }

  GSVC.renderers ??= {};
  GSVC.renderers.webgl2 = async (canvas) => new WebGL2Renderer(canvas);
}
