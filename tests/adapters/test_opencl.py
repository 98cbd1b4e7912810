import ast
import inspect
from itertools import pairwise

import numpy as np
import pytest

cl = pytest.importorskip("pyopencl", reason="pyopencl is one of the extra adapters")

from gsvc_conformance import spec  # noqa: E402
from gsvc_conformance.adapters import main_frames, main_operations, opencl  # noqa: E402
from gsvc_conformance.adapters.opencl import device, reconstruction, rendering  # noqa: E402
from gsvc_conformance.operation import operations  # noqa: E402
from gsvc_conformance.vector import VECTORS  # noqa: E402


def _has_device():
    try:
        return any(platform.get_devices() for platform in cl.get_platforms())
    except cl.Error:
        return False


pytestmark = pytest.mark.skipif(not _has_device(), reason="there is no OpenCL device, such as that of pocl-opencl-icd")

MODULE = "gsvc_conformance.adapters.opencl"
OPERATIONS = sorted(operations().keys() & vars(opencl).keys())


@pytest.fixture
def wide_scene():
    """Splats of all sizes on a frame of several regions of 256 pixels and more than 256 tiles."""
    random = np.random.default_rng(1)
    width, height, count = 530, 300, 900
    size = np.exp(random.uniform(np.log(0.3), np.log(40), (count, 1)))
    place = random.uniform(-20, (width + 20, height + 20), (count, 2))
    factors = size * np.column_stack([random.uniform(0.3, 1, count), random.normal(0, 1, count), np.ones(count)])
    colors = random.normal(0, 1, (count, 3))
    return np.concatenate([place, factors, colors], axis=1).astype(np.float32), width, height


@pytest.fixture
def small_work_groups(monkeypatch):
    """As on a device whose work-groups have at most 64 work-items."""
    cached = (device.program, device.kernel)
    for function in cached:
        function.cache_clear()
    for module in (device, rendering):
        monkeypatch.setattr(module, "tile", lambda: 8)
    yield
    for function in cached:
        function.cache_clear()


@pytest.mark.parametrize("operation", OPERATIONS)
def test_vectors(judge, operation):
    assert all(result.outcome == "pass" for result in judge(MODULE, operation))


def test_the_docstring_names_what_is_missing():
    parsers = {"read_stream", "decode_plane", "encode_plane", "planes_to_frame", "frame_to_planes", "metrics"}
    missing = operations().keys() - set(OPERATIONS) - parsers - {"encode_video"}  # it is no encoder
    assert all(f"`{name}`" in opencl.__doc__ for name in missing)


def test_every_kernel_file_is_compiled_and_named():
    files = {path.stem for path in device.KERNELS.glob("*.cl")}
    assert files == set(device.SOURCES)
    assert all(f"{name}.cl" in opencl.__doc__ for name in files)


def test_environment():
    assert set(opencl.environment()) == {"device", "platform", "driver", "opencl_c", "pyopencl"}
    assert all(opencl.environment().values())


def test_a_large_frame_has_the_bytes_of_the_specification(wide_scene):
    expected = spec.namespace()["render_sum_deterministic"](*wide_scene)["sum"]
    assert opencl.render_sum_deterministic(*wide_scene)["sum"].tobytes() == expected.tobytes()


def test_smaller_work_groups_give_the_same_bytes(wide_scene, small_work_groups):
    expected = spec.namespace()["render_sum_deterministic"](*wide_scene)["sum"]
    assert opencl.render_sum_deterministic(*wide_scene)["sum"].tobytes() == expected.tobytes()


@pytest.mark.parametrize("most", [1, 5000])
def test_bands_give_the_same_bytes(monkeypatch, wide_scene, most):
    whole = opencl.render_sum_deterministic(*wide_scene)["sum"]
    monkeypatch.setattr(rendering, "MAX_ENTRIES", most)
    assert opencl.render_sum_deterministic(*wide_scene)["sum"].tobytes() == whole.tobytes()


def test_lists_have_every_splat_that_covers_a_pixel_of_the_tile_in_order(wide_scene):
    parameters, width, height = wide_scene
    side = device.tile()
    splats = rendering.prepared(parameters, exact=True)
    (lists,) = rendering.divided(splats, rendering.everything(len(parameters)), (64, side), (width, height), True)
    start = device.download(lists.start, (lists.columns * lists.rows + 1,), "u8")
    entries = device.download(lists.splats, (int(start[-1]),), "u4")
    listed = [entries[first:end] for first, end in pairwise(start)]
    assert all(np.all(np.diff(tile.astype(int)) > 0) for tile in listed)
    squared_distance, most = spec.namespace()["squared_distance"], spec.namespace()["SUPPORT_SQUARED"]
    columns, rows = np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32)
    needed = 0
    for number, splat in enumerate(parameters):
        y, x = np.nonzero(squared_distance(splat, columns, rows) <= most)
        tiles = np.unique(y // side * lists.columns + x // side)
        needed += len(tiles)
        assert all(number in listed[tile] for tile in tiles)
    assert len(entries) < 1.1 * needed  # and few that cover none


def test_gradients_are_the_same_in_every_run(wide_scene):
    parameters, width, height = wide_scene
    residual = np.random.default_rng(2).normal(0, 1, (height, width, 3)).astype(np.float32)
    first = opencl.render_gradients(parameters, residual)["gradients"]
    assert opencl.render_gradients(parameters, residual)["gradients"].tobytes() == first.tobytes()


def test_splats_far_thinner_than_a_pixel_have_gradients(pinpoints):
    gradients = opencl.render_gradients(pinpoints, np.ones((9, 20, 3), np.float32))["gradients"]
    assert np.array_equal(gradients, np.repeat([[0, 0, 0, 0, 0, 1, 1, 1]], len(pinpoints), 0))


def test_a_device_without_binary64_decodes(monkeypatch):
    monkeypatch.setattr(reconstruction, "has_binary64", lambda: False)
    stream = (VECTORS / "core" / "decode_stream" / "moving_frames" / "stream.gsvc").read_bytes()
    assert opencl.decode_stream(stream)["frames"].any()
    with pytest.raises(NotImplementedError, match="no binary64"):
        opencl.rendering_work(np.zeros((1, 8), np.float32), 8, 8)


def test_without_a_driver_it_says_which_to_install(monkeypatch):
    def no_platform():
        raise cl.LogicError("clGetPlatformIDs failed: PLATFORM_NOT_FOUND_KHR")

    monkeypatch.setattr(cl, "get_platforms", no_platform)
    with pytest.raises(RuntimeError, match=r"there is no OpenCL device: install .* pocl-opencl-icd"):
        device.context.__wrapped__()


def test_a_device_that_is_not_there_is_told_with_those_that_are(monkeypatch):
    monkeypatch.setenv("PYOPENCL_CTX", "no such platform")
    with pytest.raises(RuntimeError, match=r"PYOPENCL_CTX=no such platform is not a device; there are 0:0 \("):
        device.context.__wrapped__()


def test_no_device_that_rounds_is_no_failure(monkeypatch):
    class Device:
        single_fp_config = cl.device_fp_config.DENORM
        double_fp_config = 0
        max_work_group_size = 256

    monkeypatch.setattr(device, "device", Device)
    with pytest.raises(NotImplementedError, match="correctly rounded division"):
        device.program.__wrapped__(exact=True)


def test_the_kernels_of_the_source_are_those_that_are_launched():
    launched = set()
    for path in device.KERNELS.parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "launch":
                launched.add(node.args[0].value)
    kernels = {kernel.function_name for kernel in device.program(exact=True).all_kernels()}
    assert launched == {name for name in kernels if not name.startswith("main_")}
    named = set()
    for module in (main_frames, main_operations):
        nodes = ast.walk(ast.parse(inspect.getsource(module)))
        named |= {node.value for node in nodes if isinstance(node, ast.Constant)}
    assert {name.removeprefix("main_") for name in kernels - launched} <= named
