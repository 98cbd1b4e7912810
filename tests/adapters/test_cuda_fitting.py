"""Losses, gradients and encodes by the CUDA kernels: as fibers, or on the GPU where GSVC_CUDA=gpu asks for it."""

import os
import tomllib
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

import gsvc_ref
from gsvc_conformance.adapters.cuda import device, fitting
from gsvc_ref import plugins
from gsvc_ref.encoder.main.settings import InterSettings, IntraSettings
from gsvc_ref.rendering import Objective, render

WIDTH, HEIGHT = 40, 36
FEW = {"intra": IntraSettings(initialization=20, refinement=10, rounding=2), "inter": InterSettings(iterations=6)}


@pytest.fixture(autouse=True)
def cuda(monkeypatch):
    """The device ``cuda`` as the kit's entry point offers it."""
    monkeypatch.setenv("GSVC_CUDA", os.environ.get("GSVC_CUDA") or "fibers")
    device.machine.cache_clear()
    if not device.available():
        pytest.skip("there is neither a C++ compiler nor a GPU")
    pyproject = Path(__file__).parents[2] / "conformance" / "pyproject.toml"
    groups = tomllib.loads(pyproject.read_text("utf-8"))["project"]["entry-points"]
    entry = EntryPoint("cuda", groups[plugins.DEVICES]["cuda"], plugins.DEVICES)
    monkeypatch.setattr(plugins, "devices", lambda: {"cuda": entry})
    yield
    device.machine.cache_clear()


def some_splats(count, seed):
    """Splats (count, 8) f4 of several sizes, some of them partly outside the frame."""
    random = np.random.default_rng(seed)
    splats = random.normal(0, 0.4, (count, 8))
    splats[:, :2] = random.uniform(-4, (WIDTH + 4, HEIGHT + 4), (count, 2))
    splats[:, [2, 4]] = np.exp(random.uniform(-1, 2.5, (count, 2)))
    return splats.astype(np.float32)


def test_an_objective_on_cuda_is_that_of_the_cpu():
    """With more splats and slots from call to call, without any, and with backgrounds, held and frozen ones."""
    target = np.random.default_rng(0).random((HEIGHT, WIDTH, 3), np.float32)
    behind = some_splats(3, 1)
    ours, theirs = (Objective(target, background=behind, device=device) for device in ("cpu", "cuda"))

    def same(splats):
        for drawn in (True, False):
            for one, other in zip(ours.evaluate(splats), theirs.evaluate(splats, drawn=drawn), strict=True):
                np.testing.assert_allclose(other, one, rtol=1e-4, atol=1e-6)
            np.testing.assert_allclose(theirs.picture(), ours.picture(), atol=1e-5)
            assert theirs.loss(splats, drawn=drawn) == pytest.approx(ours.loss(splats), rel=1e-6)
            np.testing.assert_allclose(theirs.residual(), ours.residual(), atol=1e-5)

    np.testing.assert_allclose(theirs.picture(), render(behind, WIDTH, HEIGHT), atol=1e-5)
    for count in (5, 40, 0, 12):
        same(some_splats(count, count))
    splats = some_splats(20, 2)
    for one in (ours, theirs):
        one.hold(splats[:12])
    same(splats[12:])
    for one in (ours, theirs):
        one.freeze(splats, np.arange(20) % 3 == 0)
    same(splats)
    for one in (ours, theirs):
        one.thaw()
    same(splats)


def test_an_evaluation_has_the_same_bits_each_time():
    target, splats = np.zeros((HEIGHT, WIDTH, 3), np.float32), some_splats(30, 3)
    first = fitting.Evaluator(target, splats[:0])
    loss, gradient = first.evaluate(splats, drawn=False)
    for evaluator in (first, fitting.Evaluator(target, splats[:0])):
        again, same = evaluator.evaluate(splats, drawn=True)
        assert (again, same.tobytes()) == (loss, gradient.tobytes())


def test_a_clip_is_encoded_on_cuda(tmp_path):
    grid = np.random.default_rng(4).integers(0, 256, (4, 4, 3), np.uint8)
    still = np.kron(grid, np.ones((4, 4, 1), np.uint8))
    clip = np.stack([still, np.roll(still, 1, axis=1)])
    settings = replace(gsvc_ref.Settings.quick(splats=8, key_frames=(0,), decisions=False), **FEW)
    files = [tmp_path / name for name in ("cpu", "cuda", "again")]
    reports = [
        gsvc_ref.encode(clip, file, replace(settings, device=name))
        for file, name in zip(files, ("cpu", "cuda", "cuda"), strict=True)
    ]
    assert [frame.type for frame in reports[1].frames] == ["I", "P"]
    assert files[1].read_bytes() == files[2].read_bytes()
    for one, other in zip(reports[0].frames, reports[1].frames, strict=True):
        assert other.psnr == pytest.approx(one.psnr, abs=0.5)


def test_what_is_missing_is_said_in_a_sentence(monkeypatch, tmp_path):
    monkeypatch.setenv("GSVC_CUDA", "neither")
    device.machine.cache_clear()
    with pytest.raises(gsvc_ref.UsageError, match="device cuda: GSVC_CUDA=neither is neither gpu nor fibers"):
        gsvc_ref.encode(np.zeros((1, 16, 16, 3), np.uint8), tmp_path / "x", gsvc_ref.Settings.quick(device="cuda"))
    assert not [*tmp_path.iterdir()]
