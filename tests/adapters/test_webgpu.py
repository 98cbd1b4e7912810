"""The WGSL adapter: what the vectors say, and what they don't reach."""

from types import SimpleNamespace

import numpy as np
import pytest

wgpu = pytest.importorskip("wgpu", reason="wgpu is one of the extra adapters")

from gsvc_conformance import spec  # noqa: E402
from gsvc_conformance.adapters import webgpu  # noqa: E402
from gsvc_conformance.adapters.webgpu import entropy, gpu, main_profile, rendering  # noqa: E402

MODULE = "gsvc_conformance.adapters.webgpu"
OPERATIONS = (
    "read_stream",
    "decode_plane",
    "encode_plane",
    "reconstruct_stream",
    "from_half",
    "to_half",
    "lsq_dequantize",
    "reconstruct_intra",
    "reconstruct_inter",
    "render_sum",
    "to_frame",
    "render_frame",
    "decode_stream",
    "scale_parameters",
    "scale_parameters_filtered",
    "render_sum_deterministic",
    "to_frame_deterministic",
    "decode_stream_deterministic",
    "render_gradients",
    "read_main_stream",
    "reconstruct_layers",
    "decode_layers",
    "encode_run",
    "density_frequencies",
    "half_frequencies",
    "model_frequencies",
    "adapt_model",
    "mode_contexts",
    "splat_classes",
    "main_intra",
    "motion_of_splats",
    "main_inter",
    "state_parameters",
    "main_work",
    "window_frequencies",
    "codes_of_classes",
    "cells_of_halves",
    "field_vectors",
)


@pytest.fixture(scope="module", autouse=True)
def device():
    if not wgpu.gpu.enumerate_adapters_sync():
        pytest.skip("there is no WebGPU device; Mesa's lavapipe is one")
    return gpu.device()


@pytest.fixture
def splats():
    def made(count, width, height, seed=1):
        r = np.random.default_rng(seed)
        centres = r.uniform(0, [width, height], (count, 2))
        factors = np.stack([r.uniform(0.5, 9, count), r.normal(0, 3, count), r.uniform(0.5, 9, count)], axis=1)
        return np.concatenate([centres, factors, r.normal(0, 0.3, (count, 3))], axis=1).astype(np.float32)

    return made


@pytest.mark.parametrize("operation", OPERATIONS)
def test_every_vector_of_an_operation_passes(judge, operation):
    results = judge(MODULE, operation)
    assert {result.outcome for result in results} == {"pass"}


def test_the_environment_names_device_and_driver():
    environment = webgpu.environment()
    assert environment.keys() == {"device", "driver", "back end", "wgpu"}
    assert all(environment.values())


def test_what_a_driver_does_not_tell_is_left_out(monkeypatch):
    info = {"device": "Apple M2", "description": "", "backend_type": "Metal", "adapter_type": "IntegratedGPU"}
    monkeypatch.setattr(webgpu, "device", lambda: SimpleNamespace(adapter=SimpleNamespace(info=info)))
    assert webgpu.environment().keys() == {"device", "back end", "wgpu"}


def test_without_a_driver_it_says_which_to_install(monkeypatch):
    def no_adapter(**_):
        raise RuntimeError("Request adapter failed (3): Validation Error")

    monkeypatch.setattr(wgpu.gpu, "request_adapter_sync", no_adapter)
    monkeypatch.setattr(wgpu.gpu, "enumerate_adapters_sync", list)
    with pytest.raises(RuntimeError, match=r"there is no WebGPU device: install .* mesa-vulkan-drivers"):
        gpu.device.__wrapped__()


def test_a_device_that_is_not_there_is_told_with_those_that_are(monkeypatch):
    monkeypatch.setenv("WGPUPY_WGPU_ADAPTER_NAME", "no such device")
    with pytest.raises(RuntimeError, match=r"'no such device' not found\. There are: \w"):
        gpu.device.__wrapped__()


def test_a_browser_reads_the_same_text_as_python():
    text = (rendering.Path(rendering.__file__).parents[1] / "web" / "render.wgsl.js").read_text(encoding="utf-8")
    assert text.count("`") == 2
    assert not set(rendering.bounded_shader()) & {"\\", "$"}


ARITHMETIC = """
@group(0) @binding(0) var<storage, read> pairs: array<vec2<u32>>;
@group(0) @binding(1) var<storage, read_write> results: array<u32>;

@compute @workgroup_size(64)
fn all_operations(@builtin(global_invocation_id) id: vec3<u32>) {
    let pair = pairs[id.x];
    results[4u * id.x] = add(pair.x, pair.y);
    results[4u * id.x + 1u] = subtract(pair.x, pair.y);
    results[4u * id.x + 2u] = multiply(pair.x, pair.y);
    results[4u * id.x + 3u] = divide(pair.x, pair.y);
}
"""


@pytest.fixture(scope="module")
def operands():
    """Pairs of patterns: any, near to each other, products near to the ends of the range, and special ones."""
    r = np.random.default_rng(7)
    count = 2**16
    anything = r.integers(0, 2**32, (count, 2), np.uint32)
    near = anything.copy()
    near[:, 1] = (anything[:, 0] + r.integers(-(2**26), 2**26, count)) % 2**32 ^ r.integers(0, 2, count) << 31
    small = anything.copy()
    small[:, 1] = (anything[:, 1] & 0x807FFFFF) | ((127 + r.integers(-24, 25, count) - 126) % 255 << 23)
    fewer_bits = anything & 0xFFFF8000
    special = np.array(
        [0, 1, 0x7FFFFF, 0x800000, 0x3F800000, 0x3F800001, 0x7F7FFFFF, 0x7F800000, 0x7FC00000], np.uint32
    )
    special = np.concatenate([special, special | 0x80000000])
    pairs = np.stack(np.meshgrid(special, special), axis=-1).reshape(-1, 2)
    return np.concatenate([anything, near, small, fewer_bits, pairs]).astype(np.uint32)


def test_binary32_in_integers_is_that_of_ieee_754(operands):
    padded = np.concatenate([operands, np.zeros((-len(operands) % 64, 2), np.uint32)])
    buffers = {0: gpu.upload(padded), 1: gpu.storage(16 * len(padded))}
    passes = [("all_operations", (len(padded) // 64,), (0, 1))]
    gpu.run(gpu.wgsl("binary32.wgsl") + ARITHMETIC, passes, buffers)
    results = gpu.download(buffers[1], np.float32, 4 * len(padded)).reshape(-1, 4)[: len(operands)]
    a, b = operands.view(np.float32).T
    with np.errstate(all="ignore"):
        expected = np.stack([a + b, a - b, a * b, a / b], axis=1)
    divisor = abs(b)
    asked = np.ones(expected.shape, bool)
    asked[:, 3] = (divisor >= np.float32(2.0**-126)) & (divisor < np.inf)
    same = (results.view(np.uint32) == expected.view(np.uint32)) | (np.isnan(results) & np.isnan(expected))
    wrong = np.argwhere(asked & ~same)
    assert len(wrong) == 0, [(hex(operands[n, 0]), hex(operands[n, 1]), "+-*/"[k]) for n, k in wrong[:5]]


@pytest.mark.parametrize("exact", [False, True])
def test_bands_and_slices_change_no_bit(splats, monkeypatch, exact):
    width, height = 50, 45
    parameters = splats(150, width, height)

    def results():
        sums = rendering.read_sums(rendering.rendered(parameters, width, height, exact=exact))
        return [sums, rendering.read_frame(rendering.rendered(parameters, width, height, 10, exact), 10, exact)]

    whole = results()
    monkeypatch.setattr(rendering, "PIXELS_OF_BAND", 7 * width)
    bands = results()
    monkeypatch.setattr(rendering, "SPLATS_OF_SLICE", 64)
    slices = results()
    assert whole[0].any()
    assert all(np.array_equal(one, other) for one, other in zip(whole, bands, strict=True))
    if exact:
        assert all(np.array_equal(one, other) for one, other in zip(whole, slices, strict=True))
    else:
        assert np.allclose(whole[0], slices[0], rtol=0, atol=1e-6)


def test_gradients_of_bands_and_slices_are_those_of_the_whole(splats, monkeypatch):
    width, height = 50, 45
    parameters = splats(70, width, height)
    residual = np.random.default_rng(3).normal(size=(height, width, 3)).astype(np.float32)
    whole = webgpu.render_gradients(parameters, residual)["gradients"]
    monkeypatch.setattr(rendering, "PIXELS_OF_BAND", 7 * width)
    monkeypatch.setattr(webgpu.training, "SPLATS_OF_SLICE", 32)
    parts = webgpu.render_gradients(parameters, residual)["gradients"]
    assert abs(whole).min(axis=0).min() > 0
    assert np.allclose(parts, whole, rtol=1e-4, atol=1e-4)


def test_splats_far_thinner_than_a_pixel_have_gradients(pinpoints):
    gradients = webgpu.render_gradients(pinpoints, np.ones((9, 20, 3), np.float32))["gradients"]
    assert np.array_equal(gradients, np.repeat([[0, 0, 0, 0, 0, 1, 1, 1]], len(pinpoints), 0))


def test_more_splats_of_a_tile_than_lanes_and_of_a_frame_than_one_round_of_masks(splats):
    parameters = splats(9000, 40, 24)
    parameters[:, :2] = parameters[:, :2] % 16  # they touch tiles (0, 0) to (2, 1)
    bounded = webgpu.render_sum(parameters, 40, 24)["sum"]
    again = webgpu.render_sum(parameters, 40, 24)["sum"]
    reference = webgpu.render_sum_deterministic(parameters[::-1].copy(), 40, 24)["sum"]
    assert np.array_equal(bounded, again)
    assert np.allclose(bounded, reference, rtol=0, atol=2e-3)


def test_a_zoomed_view_is_that_of_scaled_and_shifted_splats(splats):
    parameters = splats(40, 30, 20)
    zoom, left, top = np.float32(2.5), np.float32(20), np.float32(13)
    scaled = webgpu.scale_parameters(parameters, 30, 20, 75, 50)["parameters"]
    expected = webgpu.render_sum(scaled - np.array([left, top, 0, 0, 0, 0, 0, 0], np.float32), 33, 31)["sum"]
    origin_and_extent = np.array([0, 0, 33, 31], np.uint32)
    scale_and_shift = np.array([zoom, zoom, -left, -top], np.float32)
    view = gpu.uniform(origin_and_extent, scale_and_shift, np.uint32(40), np.float32(255))
    sums = gpu.storage(12 * 33 * 31)
    rendering.add_slice(parameters, 33, 31, view, sums, exact=False)
    seen = gpu.download(sums, np.float32, 3 * 33 * 31).reshape(31, 33, 3)
    assert abs(expected).max() > 0.1
    inside = np.isclose(seen, expected, rtol=0, atol=1e-5)  # but for pixels whose coverage rounding decides
    assert np.mean(inside) > 0.999


def test_slices_of_values_keep_their_columns(splats, monkeypatch):
    parameters = splats(20, 30, 20)
    whole = webgpu.scale_parameters(parameters, 30, 20, 45, 50)["parameters"]
    monkeypatch.setattr(webgpu.reconstruction, "VALUES_OF_SLICE", 27)
    assert np.array_equal(webgpu.scale_parameters(parameters, 30, 20, 45, 50)["parameters"], whole)


@pytest.mark.parametrize("lane_count", [1, 2, 31, 32, 33, 63, 64])
@pytest.mark.parametrize("precision", [12, 16])
def test_lanes_write_what_the_code_of_the_specification_writes_and_read_it(lane_count, precision):
    r = np.random.default_rng(lane_count)
    frequencies = r.multinomial(2**precision - 300, r.dirichlet(np.full(300, 0.1))) + 1
    symbols = r.choice(300, 1000, p=frequencies / 2**precision).astype(np.uint16)
    states, words = entropy.encode_symbols(symbols, frequencies, precision, lane_count)
    expected = spec.namespace()["encode_plane"](symbols, frequencies, precision, lane_count)
    assert np.array_equal(states, expected["lane_states"])
    assert np.array_equal(words, expected["words"])
    again, final, needed = entropy.decode_symbols(len(symbols), frequencies, precision, states, words)
    assert np.array_equal(again, symbols)
    assert needed == len(words) > 0
    assert set(final) == {2**16}


def test_words_that_are_missing_are_counted():
    frequencies = np.full(256, 2**4)
    symbols = np.arange(500, dtype=np.uint16) % 256
    states, words = entropy.encode_symbols(symbols, frequencies, 12, 4)
    needed = entropy.decode_symbols(len(symbols), frequencies, 12, states, words[:-3])[2]
    assert needed > len(words) - 3


@pytest.mark.parametrize("count", [1, 31, 32, 33, 255, 256, 257, 5000])
def test_lists_have_the_items_that_fulfil_a_condition_in_their_order(count):
    numbers = np.random.default_rng(count).integers(0, 16, 3 * count)
    items = gpu.storage(4 * (count + 1))
    recording = gpu.Recording()
    condition = [count, 1, 3, 8, 12, 4]
    buffers = {1: main_profile.MAIN.integers(numbers), 2: items}
    recording.dispatch(main_profile.shader("main_lists"), "choose", 1, buffers, condition)
    recording.submit()
    expected = np.flatnonzero(((numbers[1::3] ^ 8) & 12) > 4)
    found = gpu.download(items, np.uint32, count + 1)
    assert found[0] == len(expected)
    assert np.array_equal(found[1 : 1 + len(expected)], expected)
