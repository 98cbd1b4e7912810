"""The renderers of the page draw what spec.md defines: sums, and views of a frame on a canvas."""

import pytest

pytest.importorskip("playwright", reason="Playwright is one of the extra adapters")

import web_pages

from gsvc_conformance.adapters.web import browser

SPLATS = """
  let seed = 7;
  const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
  const splats = (count, width, height, size) => Float32Array.from({ length: 8 * count }, (_, k) => [
    () => width * random(), () => height * random(), () => size * (0.3 + random()), () => size * (random() - 0.5),
    () => size * (0.3 + random()), () => random() - 0.2, () => random() - 0.2, () => random() - 0.2,
  ][k % 8]());
"""


@pytest.fixture
def new_page():
    with web_pages.pages() as opened:
        yield opened


@pytest.fixture(scope="module", params=["webgl2", "webgpu"])
def drawing_page(request):
    """A page with a renderer of a kind, and its canvas of 61 x 43 pixels."""
    with web_pages.pages() as opened:
        yield from prepared(opened(), request.param)


def prepared(page, kind):
    page.goto(browser.PAGE.as_uri())
    script = """
    async (kind) => {
      globalThis.canvas = Object.assign(document.createElement("canvas"), { width: 61, height: 43 });
      try {
        globalThis.renderer = await GSVC.createRenderer(kind, canvas);
      } catch (error) {
        return error.message;
      }
    }
    """
    message = page.evaluate(script, kind)
    if message:
        pytest.skip(message)
    yield page
    page.evaluate("renderer.destroy()")


@pytest.mark.parametrize(
    ("count", "width", "height"),
    [(0, 3, 2), (300, 2061, 5), (40, 4, 2061), (70_000, 3, 3)],
    ids=["none", "more columns than a block", "more rows", "more splats than a slice"],
)
def test_sums(drawing_page, count, width, height):
    script = f"""
    async ([count, width, height]) => {{
      {SPLATS}
      const parameters = splats(count, width, height, 2);
      const sum = await renderer.sum(parameters, width, height);
      const expected = GSVC.renderSumDeterministic(parameters, width, height);
      const positive = parameters.map((value, k) => (k % 8 > 4 ? Math.abs(value) : value));
      const absolute = GSVC.renderSumDeterministic(positive, width, height);
      return [sum.length, Math.max(...sum.map((v, k) => Math.abs(v - expected[k]) / (absolute[k] + 1)))];
    }}
    """
    samples, error = drawing_page.evaluate(script, [count, width, height])
    assert samples == 3 * width * height
    # A splat on the edge of its support may be in one sum and not in the other; it counts 1/255 of its colour.
    assert error < (1e-5 if count < 1000 else 1 / 255)


@pytest.mark.parametrize(
    "view",
    [
        {"scale": 1, "left": 0, "top": 0},
        {"scale": 3, "left": 10.5, "top": 7.25},
        {"scale": 2.5, "left": -6, "top": -4},
        {"scale": 0.5, "left": -20, "top": 3},
    ],
    ids=["as it is", "inside", "around", "small"],
)
def test_drawing(drawing_page, view):
    script = f"""
    async (view) => {{
      {SPLATS}
      const parameters = splats(60, view.width, view.height, 4);
      await renderer.draw(parameters, view);
      const copy = Object.assign(document.createElement("canvas"), {{ width: 61, height: 43 }}).getContext("2d");
      copy.drawImage(canvas, 0, 0);
      const pixels = copy.getImageData(0, 0, 61, 43).data;

      // (9-8), or (9-9) where it is smaller, and moved by hand.
      const {{ width, height, scale, left, top }} = view;
      const scaled = GSVC.scaleParametersFiltered(parameters, width, height, width * scale, height * scale);
      const moved = scaled.map((value, k) => value - ([left * scale, top * scale][k % 8] ?? 0));
      const frame = GSVC.toFrameDeterministic(GSVC.renderSumDeterministic(moved, 61, 43), 8);
      let worst = 0;
      let transparent = 0;
      for (let j = 0; j < 43; j++) for (let i = 0; i < 61; i++) {{
        const at = 61 * j + i;
        const inside = i >= Math.round(-left * scale) && i < Math.round((view.width - left) * scale) &&
          j >= Math.round(-top * scale) && j < Math.round((view.height - top) * scale);
        if (pixels[4 * at + 3] !== (inside ? 255 : 0)) throw new Error(`alpha at ${{i}}, ${{j}}`);
        if (!inside) transparent += 1;
        else for (let c = 0; c < 3; c++) worst = Math.max(worst, Math.abs(pixels[4 * at + c] - frame[3 * at + c]));
      }}
      return {{ worst, transparent }};
    }}
    """
    result = drawing_page.evaluate(script, {"width": 44, "height": 31, "bitDepth": 8, **view})
    assert result["worst"] <= 1
    assert (result["transparent"] > 0) == (view["left"] < 0 or view["scale"] == 1)


def test_sums_of_16_bits_are_good_to_look_at_and_not_given_out(new_page):
    page = new_page()
    page.goto(browser.PAGE.as_uri())
    script = f"""
    async () => {{
      {SPLATS}
      const {{ getExtension }} = WebGL2RenderingContext.prototype;
      WebGL2RenderingContext.prototype.getExtension = function (name) {{
        return name === "EXT_float_blend" ? null : getExtension.call(this, name);
      }};
      const canvas = Object.assign(document.createElement("canvas"), {{ width: 30, height: 20 }});
      const renderer = await GSVC.createRenderer("webgl2", canvas).catch((error) => error.message);
      if (typeof renderer === "string") return {{ missing: renderer }};
      const parameters = splats(20, 30, 20, 4);
      await renderer.draw(parameters, {{ width: 30, height: 20, scale: 1, left: 0, top: 0, bitDepth: 8 }});
      const copy = Object.assign(document.createElement("canvas"), {{ width: 30, height: 20 }}).getContext("2d");
      copy.drawImage(canvas, 0, 0);
      const {{ data }} = copy.getImageData(0, 0, 30, 20);
      const frame = GSVC.toFrameDeterministic(GSVC.renderSumDeterministic(parameters, 30, 20), 8);
      const errors = Array.from(frame, (sample, k) => Math.abs(sample - data[Math.floor(k / 3) * 4 + (k % 3)]));
      const refusal = await renderer.sum(parameters, 30, 20).catch((error) => error.message);
      return {{ worst: Math.max(...errors), refusal, description: renderer.description }};
    }}
    """
    result = page.evaluate(script)
    if "missing" in result:
        pytest.skip(result["missing"])
    assert result["worst"] <= 3
    assert "EXT_float_blend" in result["refusal"]
    assert "16 bits" in result["description"]


@pytest.mark.parametrize("drawing_page", ["webgpu"], indirect=True)
def test_webgpu_draws_on_the_textures_of_a_canvas(drawing_page):
    # Chromium loses its adapter in software when a canvas is asked for a texture: this canvas is a double.
    script = f"""
    async () => {{
      {SPLATS}
      let settings;
      let texture;
      const context = {{
        configure: (given) => (settings = given),
        getCurrentTexture: () => (texture = settings.device.createTexture({{
          size: [64, 40], format: settings.format, usage: GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC,
        }})),
      }};
      const info = Object.getOwnPropertyDescriptor(GPUAdapter.prototype, "info");
      const other = {{ configurable: true, get: () => ({{ vendor: "double" }}) }};
      Object.defineProperty(GPUAdapter.prototype, "info", other);
      const made = await GSVC.createRenderer("auto", {{ width: 64, height: 40, getContext: () => context }});
      Object.defineProperty(GPUAdapter.prototype, "info", info);
      const {{ device, format }} = settings;
      const parameters = splats(50, 64, 40, 4);
      device.pushErrorScope("validation");
      await made.draw(parameters, {{ width: 64, height: 40, scale: 1, left: 0, top: 0, bitDepth: 8 }});
      const usage = GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ;
      const buffer = device.createBuffer({{ size: 256 * 40, usage }});
      const encoder = device.createCommandEncoder();
      encoder.copyTextureToBuffer({{ texture }}, {{ buffer, bytesPerRow: 256 }}, [64, 40]);
      device.queue.submit([encoder.finish()]);
      const fault = await device.popErrorScope();
      if (fault) throw new Error(fault.message);
      await buffer.mapAsync(GPUMapMode.READ);
      const data = new Uint8Array(buffer.getMappedRange());
      const order = format === "bgra8unorm" ? [2, 1, 0] : [0, 1, 2];
      const frame = GSVC.toFrameDeterministic(GSVC.renderSumDeterministic(parameters, 64, 40), 8);
      const errors = Array.from(frame, (v, k) => Math.abs(v - data[Math.floor(k / 3) * 4 + order[k % 3]]));
      const result = [made.kind, Math.max(...errors), settings.alphaMode];
      made.destroy();
      return result;
    }}
    """
    kind, worst, alpha = drawing_page.evaluate(script)
    assert (kind, alpha) == ("webgpu", "premultiplied")
    assert worst <= 1
