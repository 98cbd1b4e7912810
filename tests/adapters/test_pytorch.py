"""The PyTorch adapter: every operation by the vectors, and what no vector is large enough for."""

import ast
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gsvc_base.rendering.error_models import ERROR_MODELS

torch = pytest.importorskip("torch", reason="PyTorch, of the extra peers, is not installed")

import pytorch_tf32  # noqa: E402

from gsvc_conformance.adapters import pytorch  # noqa: E402
from gsvc_conformance.adapters.pytorch import deterministic, device, quantization, rendering, tiles, training  # noqa: E402
from gsvc_conformance.operation import operations  # noqa: E402

MODULE = "gsvc_conformance.adapters.pytorch"

MISSING = {
    "read_stream", "decode_plane", "encode_plane", "seek", "encode_video",
    "read_main_stream", "reconstruct_layers", "encode_run", "half_frequencies",
}  # fmt: skip

WIDTH, HEIGHT = 100, 75
OUTPUTS = {"render_sum": "sum", "render_gradients": "gradients"}


@pytest.fixture(scope="module", autouse=True)
def one_thread():
    """Vectors are small: on a busy machine threads that wait for each other take most of the time."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(scope="module")
def splats():
    rng = np.random.default_rng(1)
    centers, factors = rng.uniform(-10, 110, (300, 2)), rng.lognormal(1, 0.6, (300, 3))
    factors[:, 1] = rng.normal(0, 3, 300)
    factors[7] = 300, 10, 200  # on every tile
    return np.concatenate([centers, factors, rng.normal(0.1, 0.3, (300, 3))], 1).astype("f4")


@pytest.fixture(scope="module")
def residual():
    return np.random.default_rng(2).normal(0, 1, (HEIGHT, WIDTH, 3)).astype("f4")


@pytest.fixture
def in_small_parts(monkeypatch):
    monkeypatch.setattr(tiles, "MAX_PAIRS", 500)
    monkeypatch.setattr(rendering, "BATCHES", 20)
    monkeypatch.setattr(deterministic, "MAX_TILES", 10)
    monkeypatch.setattr(quantization, "MAX_DISTANCES", 40)


@pytest.mark.parametrize("operation", sorted(operations().keys() - MISSING))
def test_the_vectors_of_an_operation_pass(judge, operation):
    assert all(result.outcome == "pass" for result in judge(MODULE, operation))


def test_what_is_missing_is_what_the_parser_does():
    assert not any(hasattr(pytorch, name) for name in MISSING)


def test_the_environment_names_versions():
    environment = pytorch.environment()
    assert environment["PyTorch"] == torch.__version__
    assert all(isinstance(text, str) and text for text in environment.values())


def test_the_environment_of_a_gpu_names_its_driver(monkeypatch):
    monkeypatch.setattr(pytorch, "DEVICE", torch.device("cuda"))
    monkeypatch.setattr(torch.cuda, "get_device_name", lambda _: "NVIDIA H200")
    monkeypatch.setattr(torch.cuda, "get_device_capability", lambda _: (9, 0))
    answer = SimpleNamespace(stdout="580.159.04\n580.159.04\n")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: answer)
    told = pytorch.environment()
    assert (told["device"], told["driver"], told["compute capability"]) == ("NVIDIA H200", "580.159.04", "9.0")

    def missing(*_, **__):
        raise FileNotFoundError("nvidia-smi")

    monkeypatch.setattr(subprocess, "run", missing)
    assert "driver" not in pytorch.environment()


BY_ATOMICS = {"index_add", "index_add_", "index_reduce", "scatter_add", "scatter_add_", "scatter_reduce"}
"""Functions of tensors that add by float atomics with CUDA, and those whose backward pass does."""
BACKWARD_BY_ATOMICS = {"index_select", "gather", "take", "take_along_dim", "embedding"}


def test_no_sum_goes_through_float_atomics_which_flush_subnormal_numbers():
    def called(path):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        return {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}

    files = sorted(Path(pytorch.__file__).parent.glob("*.py"))
    assert not {path.name: found for path in files if (found := called(path) & BY_ATOMICS)}
    differentiated = [Path(module.__file__) for module in (rendering, tiles, training)]
    assert not {path.name: found for path in differentiated if (found := called(path) & BACKWARD_BY_ATOMICS)}


@pytest.mark.parametrize("name", ["no such device", "meta", "cuda:99"])
def test_a_device_that_cannot_compute_is_refused_with_what_can(monkeypatch, name):
    monkeypatch.setenv("GSVC_TORCH_DEVICE", name)
    with pytest.raises(
        ValueError, match=f"cannot calculate in binary64 on {name}; GSVC_TORCH_DEVICE may be cpu, or cuda"
    ):
        device._chosen()


def test_splats_far_thinner_than_a_pixel_have_gradients(pinpoints):
    gradients = pytorch.render_gradients(pinpoints, np.ones((9, 20, 3), np.float32))["gradients"]
    assert np.array_equal(gradients, np.repeat([[0, 0, 0, 0, 0, 1, 1, 1]], len(pinpoints), 0))


def test_deterministic_rendering_does_not_depend_on_its_parts(splats, request):
    whole = pytorch.render_sum_deterministic(splats, WIDTH, HEIGHT)["sum"]
    request.getfixturevalue("in_small_parts")
    np.testing.assert_array_equal(pytorch.render_sum_deterministic(splats, WIDTH, HEIGHT)["sum"], whole)


def test_rendering_and_gradients_hardly_depend_on_their_parts(splats, residual, request):
    picture = pytorch.render_sum(splats, WIDTH, HEIGHT)["sum"]
    gradients = pytorch.render_gradients(splats, residual)["gradients"]
    request.getfixturevalue("in_small_parts")
    np.testing.assert_allclose(pytorch.render_sum(splats, WIDTH, HEIGHT)["sum"], picture, rtol=0, atol=1e-5)
    again = pytorch.render_gradients(splats, residual)["gradients"]
    assert np.linalg.norm(again - gradients) <= 1e-5 * np.linalg.norm(gradients)


def test_codewords_do_not_depend_on_the_parts(request):
    rng = np.random.default_rng(3)
    inputs = rng.normal(size=(50, 3)).astype("f4"), np.array([7, 5]), rng.normal(size=(12, 3)).astype("f4")
    whole = pytorch.rvq_assign(*inputs)["indices"]
    request.getfixturevalue("in_small_parts")
    np.testing.assert_array_equal(pytorch.rvq_assign(*inputs)["indices"], whole)


def test_a_loss_of_a_rendered_picture_can_be_differentiated(splats, residual):
    target = (residual > 0).astype("f4")
    parameters = torch.tensor(splats, device=rendering.DEVICE, requires_grad=True)
    picture = rendering.render(parameters, WIDTH, HEIGHT)
    training.loss_of(picture, torch.tensor(target, device=rendering.DEVICE)).backward()
    of_picture = pytorch.loss(picture.detach().cpu().numpy(), target)["residual"]
    expected = pytorch.render_gradients(splats, of_picture)["gradients"]
    np.testing.assert_allclose(parameters.grad.cpu().numpy(), expected, rtol=1e-5, atol=1e-9)


def test_the_schedule_is_that_of_pytorch():
    parameter = torch.nn.Parameter(torch.zeros(1))
    optimizer = torch.optim.SGD([parameter], lr=1e-3)
    scheduler = torch.optim.lr_scheduler.StepLR(optimizer, step_size=7, gamma=0.5)
    rates = []
    for _ in range(30):
        rates.append(scheduler.get_last_lr()[0])
        optimizer.step()
        scheduler.step()
    mine = pytorch.learning_rates(np.arange(30), 1e-3, 0.5, 7)["rates"]
    np.testing.assert_allclose(mine, rates, rtol=1e-12)


@pytest.mark.parametrize("name", ["render_sum", "render_gradients"])
def test_products_on_tensor_cores_are_those_of_tf32_and_not_of_binary32(splats, residual, name):
    """As one H200 with ``set_float32_matmul_precision("high")``: 94 of 204 vectors were beyond fp32/1."""
    size = {"width": WIDTH, "height": HEIGHT}
    inputs = {"parameters": splats, **(size if name == "render_sum" else {"residual": residual})}
    (output,) = getattr(pytorch_tf32, name)(**inputs).values()
    (expected,) = operations()[name].oracle(**inputs).values()
    (by_model,) = operations()[name].by_model(ERROR_MODELS["tf32/1"], {OUTPUTS[name]: expected}, inputs).values()
    assert not expected.judge(output).passed
    assert by_model.judge(output).passed
