import ast
import importlib.util
import re
import shutil
import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from gsvc_conformance import spec
from gsvc_conformance.adapters import cuda, main_operations
from gsvc_conformance.adapters.cuda import device, errors, fibers, rendering, sources
from gsvc_conformance.adapters.cuda.evaluation import Evaluation
from gsvc_conformance.operation import operations

MODULE = "gsvc_conformance.adapters.cuda"
OPERATIONS = sorted(operations().keys() & vars(cuda).keys())
LONG = {"reconstruct_stream", "read_stream"}
NVCC = shutil.which("nvcc") or shutil.which("/usr/local/cuda/bin/nvcc")
BUILDS = list(product(sources.SOURCES, (False, True), ("80", "90")))


pytestmark = pytest.mark.usefixtures("on_fibers")


@pytest.fixture
def wide_scene():
    """Splats of all sizes on a frame of many blocks, whose edges are within tiles."""
    random = np.random.default_rng(1)
    width, height, count = 210, 130, 300
    size = np.exp(random.uniform(np.log(0.3), np.log(40), (count, 1)))
    place = random.uniform(-20, (width + 20, height + 20), (count, 2))
    factors = size * np.column_stack([random.uniform(0.3, 1, count), random.normal(0, 1, count), np.ones(count)])
    colors = random.normal(0, 1, (count, 3))
    return np.concatenate([place, factors, colors], axis=1).astype(np.float32), width, height


@pytest.mark.parametrize(
    "operation", [pytest.param(name, marks=[pytest.mark.exhaustive] * (name in LONG)) for name in OPERATIONS]
)
def test_vectors(judge, operation):
    assert all(result.outcome == "pass" for result in judge(MODULE, operation))


def test_operations_are_exported():
    assert set(cuda.__all__) == {*OPERATIONS, "environment"}


def test_every_kernel_file_is_compiled_and_named():
    files = {path.stem for path in sources.KERNELS.glob("*.cu")}
    assert files == set(sources.SOURCES)
    assert all(path.name in cuda.__doc__ for path in sources.KERNELS.iterdir())


def test_the_kernels_of_the_sources_are_those_that_are_launched():
    launched = set()
    place = {"launch": 0, "Launch": 0, "draw": 0, "dispatch": 1, "_on_splats": 0}
    for path in (*sources.KERNELS.parent.glob("*.py"), Path(main_operations.__file__)):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            name = isinstance(node, ast.Call) and (getattr(node.func, "id", "") or getattr(node.func, "attr", ""))
            if name in place and isinstance(kernel := node.args[place[name]], ast.Constant):
                launched.add(kernel.value)
    launched -= {"choose", "halve", "starts", "locate"}  # cells_of_halves of this adapter is one kernel
    assert launched == {kernel for source in sources.SOURCES for kernel in sources.kernels(source)}


def test_a_large_frame_has_the_bytes_of_the_specification(wide_scene):
    expected = spec.namespace()["render_sum_deterministic"](*wide_scene)["sum"]
    assert cuda.render_sum_deterministic(*wide_scene)["sum"].tobytes() == expected.tobytes()


def test_larger_regions_give_the_same_bytes(monkeypatch, wide_scene):
    whole = cuda.render_sum_deterministic(*wide_scene)["sum"]
    monkeypatch.setattr(rendering, "MAX_LISTS", 1)
    assert rendering.Scene(210, 130, 300).side == 256
    assert cuda.render_sum_deterministic(*wide_scene)["sum"].tobytes() == whole.tobytes()


def test_more_splats_of_a_region_than_a_block_has_threads(wide_scene):
    parameters = np.repeat(wide_scene[0][:40], 9, axis=0)
    parameters[:, :2] = parameters[:, :2] % 30
    expected = spec.namespace()["render_sum_deterministic"](parameters, 40, 40)["sum"]
    assert cuda.render_sum_deterministic(parameters, 40, 40)["sum"].tobytes() == expected.tobytes()


@pytest.mark.parametrize("bit_depth", [8, 10])
def test_a_frame_that_stays_in_registers_has_the_same_bytes(wide_scene, bit_depth):
    _, width, height = wide_scene
    dtype = "u1" if bit_depth == 8 else "u2"
    frame = device.storage(3 * width * height * np.dtype(dtype).itemsize)
    rendering.filled(*wide_scene, exact=True).frame(frame, bit_depth)
    expected = cuda.to_frame_deterministic(cuda.render_sum_deterministic(*wide_scene)["sum"], bit_depth)["frame"]
    assert np.array_equal(device.download(frame, (height, width, 3), dtype), expected)


def test_splats_far_thinner_than_a_pixel_have_gradients(pinpoints):
    gradients = cuda.render_gradients(pinpoints, np.ones((9, 20, 3), np.float32))["gradients"]
    assert np.array_equal(gradients, np.repeat([[0, 0, 0, 0, 0, 1, 1, 1]], len(pinpoints), 0))


@pytest.mark.parametrize("slots", [None, 10])
def test_an_evaluation_has_the_loss_and_the_gradients_of_its_parts(wide_scene, slots):
    parameters, width, height = wide_scene
    random = np.random.default_rng(2)
    target = random.uniform(0, 1, (height, width, 3)).astype(np.float32)
    base = random.uniform(0, 0.2, (height, width, 3)).astype(np.float32)
    splats, picture = device.upload(parameters, "f4"), device.storage(target.nbytes)
    evaluation = Evaluation(
        device.upload(target, "f4"), width, height, len(parameters), base=device.upload(base, "f4"), slots=slots
    )
    loss = evaluation.evaluate(splats, len(parameters), picture=picture)
    gradients = device.download(evaluation.gradients, parameters.shape, "f4")

    total = device.download(picture, target.shape, "f4")
    assert np.allclose(total, base + cuda.render_sum(*wide_scene)["sum"], atol=1e-5)
    parts = cuda.loss(total, target)
    assert np.isclose(loss, parts["loss"], rtol=1e-6)
    expected = cuda.render_gradients(parameters, parts["residual"])["gradients"]
    assert np.allclose(gradients, expected, rtol=1e-4, atol=1e-6 * np.abs(expected).max())

    assert evaluation.evaluate(splats, len(parameters), picture=picture) == loss  # the recorded launches
    assert np.array_equal(device.download(evaluation.gradients, parameters.shape, "f4"), gradients)
    assert np.isclose(evaluation.evaluate(splats, len(parameters), gradients=False), loss, rtol=1e-12)


def test_arguments_of_all_kinds_arrive():
    rows = np.arange(12, dtype=np.float32).reshape(4, 3)
    left = device.storage(24)
    launched = device.Launch(
        "compact", 1, 6, device.upload(rows, "f4"), device.upload([2, 0], "i8"), 3, np.int64(6), left
    )
    launched()
    assert np.array_equal(device.download(left, (2, 3), "f4"), rows[[2, 0]])
    device.clear(left)
    assert not device.download(left, (2, 3), "f4").any()
    launched()
    assert np.array_equal(device.download(left, (2, 3), "f4"), rows[[2, 0]])


@pytest.fixture
def _caches():
    """Kernels are looked up and compiled again, now and afterwards."""
    cached = (sources.kernels, sources.source_of, fibers.library, fibers.function)
    for function in cached:
        function.cache_clear()
    yield
    for function in cached:
        function.cache_clear()


@pytest.mark.usefixtures("_caches")
def test_the_order_of_threads_changes_nothing(monkeypatch, wide_scene):
    parameters, width, height = wide_scene
    random = np.random.default_rng(3)
    residual = random.normal(0, 1, (height, width, 3)).astype(np.float32)
    vectors, books = random.normal(0, 1, (600, 3)).astype(np.float32), random.normal(0, 1, (9, 3)).astype(np.float32)

    def results():
        indices = cuda.rvq_assign(vectors, [5, 4], books)["indices"]
        state = np.zeros(9), np.zeros((9, 3)), np.linspace(0, 0.9, 9), 0.8, 1e-5, 30.0
        yield cuda.render_sum_deterministic(*wide_scene)
        yield cuda.render_gradients(parameters, residual)
        yield cuda.loss(residual, residual[::-1])
        yield cuda.prune(np.repeat(residual[0, :, 0], 2), 100)
        yield cuda.rvq_update(vectors, indices, [5, 4], books, *state)
        yield cuda.lsq_gradients(vectors, np.full(3, 0.1), np.full(3, -1), 4, vectors)
        yield cuda.encode_plane(indices[:, 0], [500, 1000, 1500, 1000, 96], 12, 64)

    ascending = list(results())
    monkeypatch.setattr(fibers, "OPTIONS", (*fibers.OPTIONS, "-DDESCENDING"))
    fibers.library.cache_clear()
    fibers.function.cache_clear()
    for result, expected in zip(results(), ascending, strict=True):
        assert all(result[name].tobytes() == expected[name].tobytes() for name in expected)


@pytest.fixture
def own_kernels(monkeypatch, tmp_path, _caches):
    """own_kernels(text) makes the kernels of a text the only ones."""

    def made(text):
        for path in (*sources.KERNELS.glob("*.cuh"), sources.KERNELS / "fibers.h"):
            shutil.copy(path, tmp_path)
        (tmp_path / "own.cu").write_text('#include "common.cuh"\n' + text, "utf-8")
        for module in (sources, fibers):
            monkeypatch.setattr(module, "KERNELS", tmp_path)
        monkeypatch.setattr(sources, "SOURCES", ("own",))

    return made


def test_fibers_wait_for_each_other(own_kernels):
    own_kernels("""
        extern "C" __global__ void collect(unsigned *out)
        {
            __shared__ unsigned sums[3];
            unsigned t = threadIdx.x + blockDim.x * threadIdx.y, lane = t % 32, sum = t;
            for (int across = 16; across > 0; across /= 2)
                sum += __shfl_xor_sync(EVERY_LANE, sum, across);
            if (lane == 0)
                sums[t / 32] = sum;
            __syncthreads();
            unsigned part = lane < 16 ? __popc(__ballot_sync(0xffffu, lane % 2)) : __shfl_sync(0xffff0000u, lane, 20);
            out[96 * blockIdx.y + t] = sums[0] + sums[1] + sums[2] + part;
        }""")
    out = device.storage(4 * 96 * 2)
    device.launch("collect", (1, 2), (24, 4), out)
    parts = np.tile([8] * 16 + [20] * 16, 6)
    assert np.array_equal(device.download(out, (192,), "u4"), sum(range(96)) + parts)


def test_fibers_that_wait_in_vain_are_told(own_kernels):
    own_kernels("""
        extern "C" __global__ void stuck()
        {
            if (threadIdx.x % 2)
                __syncthreads();
            else
                __syncwarp();
        }""")
    for _ in range(2):
        with pytest.raises(RuntimeError, match="stuck: a thread waits for others that never come"):
            device.launch("stuck", 1, 64)


def _ptx_by_nvcc(source, exact, machine):
    options = ["-std=c++17", f"-arch=compute_{machine}", *sources.ROUNDING[exact], "--ptx", "-o", "-"]
    command = [NVCC, *options, str(sources.KERNELS / f"{source}.cu")]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


@pytest.mark.exhaustive
@pytest.mark.skipif(NVCC is None, reason="there is no nvcc")
@pytest.mark.parametrize(("source", "exact", "machine"), BUILDS)
def test_what_nvcc_makes_of_the_kernels(source, exact, machine):
    _check_ptx(_ptx_by_nvcc(source, exact, machine), exact)


@pytest.mark.exhaustive
@pytest.mark.skipif(importlib.util.find_spec("cupy") is None, reason="CuPy, one of the extra cuda, has NVRTC")
@pytest.mark.parametrize(("source", "exact", "machine"), BUILDS)
def test_what_nvrtc_makes_of_the_kernels(source, exact, machine):
    from gsvc_conformance.adapters.cuda import gpu

    _check_ptx(gpu.compiled(source, exact, f"compute_{machine}").decode(), exact)
    assert gpu.compiled(source, exact, f"sm_{machine}").startswith(b"\x7fELF")


def _check_ptx(ptx, exact):
    """What can be known of the device's compiler without a device: what it flushes, fuses, approximates."""
    instructions = set(re.findall(r"\b[a-z]\w*(?:\.\w+)+", ptx))
    assert any(instruction.startswith("mul.") for instruction in instructions)
    approximate = {instruction for instruction in instructions if ".ftz" in instruction or ".approx" in instruction}
    assert approximate <= (set() if exact else {"ex2.approx.ftz.f32"})
    assert not exact or "fma.rn.f32" not in instructions
    assert not any(re.match(r"(red|atom)\..*f32", instruction) for instruction in instructions)


def test_without_cupy_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "cupy", None)  # as if it were not there
    monkeypatch.delitem(sys.modules, f"{MODULE}.gpu", raising=False)
    monkeypatch.delattr(cuda, "gpu", raising=False)
    monkeypatch.delenv("GSVC_CUDA")
    device.machine.cache_clear()
    with pytest.raises(RuntimeError, match=r"CuPy is not there: pip install 'gsvc-conformance\[cuda\]'"):
        device.storage(1)
    assert not device.available()
    device.machine.cache_clear()


def test_a_word_that_is_no_machine(monkeypatch):
    monkeypatch.setenv("GSVC_CUDA", "cpu")
    device.machine.cache_clear()
    with pytest.raises(RuntimeError, match="GSVC_CUDA=cpu is neither gpu nor fibers"):
        device.environment()
    device.machine.cache_clear()


def test_without_a_compiler_it_says_which_to_install(monkeypatch):
    monkeypatch.setenv("CXX", "no-such-compiler")
    with pytest.raises(NotImplementedError, match="there is no C\\+\\+ compiler no-such-compiler: install one"):
        fibers.compiler.__wrapped__()


@pytest.mark.parametrize(
    ("said", "advised"),
    [
        ("cudaErrorNoDevice: no CUDA-capable device is detected", "see what `nvidia-smi` lists"),
        ("cudaErrorInsufficientDriver: CUDA driver version is insufficient", "install a newer driver"),
        ("cudaErrorMemoryAllocation: out of memory", "a smaller frame or fewer splats"),
        ("CUDA_ERROR_OUT_OF_MEMORY: out of memory", "a smaller frame or fewer splats"),
        ("CUDA_ERROR_LAUNCH_TIMEOUT: the launch timed out and was terminated", "a GPU without a display"),
        ("cudaErrorLaunchTimeout: the launch timed out and was terminated", "start another one for the rest"),
        ("CUDA_ERROR_NO_BINARY_FOR_GPU: no kernel image", "empty the folder gsvc-cuda"),
        ("cudaErrorIllegalAddress: an illegal memory access was encountered", "compute-sanitizer"),
    ],
)
def test_errors_say_what_to_do(said, advised):
    sentence = errors.advice(said)
    assert advised in sentence
    assert said in sentence


@pytest.mark.skipif(importlib.util.find_spec("cupy") is None, reason="CuPy is one of the extra cuda")
def test_what_cupy_raises_is_explained():
    import cupy

    from gsvc_conformance.adapters.cuda import gpu

    with pytest.raises(RuntimeError, match=r"the GPU has no memory left: .*1,000 bytes"), gpu.explaining():
        raise cupy.cuda.memory.OutOfMemoryError(1000, 2000, 2500)
    with pytest.raises(RuntimeError, match=r"the watchdog of a display .*cudaErrorLaunchTimeout"), gpu.explaining():
        raise cupy.cuda.runtime.CUDARuntimeError(702)


def test_kernels_are_compiled_once(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    made = []

    def make(path: Path) -> None:
        made.append(path)
        path.write_bytes(b"kernels")

    first = sources.kept(".cubin", ["a compiler"], make)
    assert sources.kept(".cubin", ["a compiler"], make) == first
    assert sources.kept(".cubin", ["another compiler"], make) != first
    assert len(made) == 2
    assert first.read_bytes() == b"kernels"
