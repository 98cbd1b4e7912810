"""Encodes whose losses and gradients come from a device: here one made of the operations of gsvc_ref."""

import subprocess
import sys
from importlib.metadata import EntryPoint

import numpy as np
import pytest

import gsvc_ref
from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_ref import plugins
from gsvc_ref.rendering import Objective, render, render_gradients
from gsvc_ref.rendering.evaluator import CpuEvaluator

BLOCKS = np.kron(np.random.default_rng(5).integers(0, 256, (5, 7, 3), np.uint8), np.ones((4, 4, 1), np.uint8))
CLIP = np.stack([np.roll(BLOCKS, number, axis=1) for number in range(3)])
PARAMETERS = np.float32([[9, 8, 4, 1, 3, 0.8, 0.4, 0.2], [18, 12, 5, 0, 5, 0, 0.4, 0.6], [5, 15, 2, 0, 2, 3, 0, -1]])


class PlainEvaluator:
    """An operation a call, with nothing kept but arrays."""

    calls: list[str] = []  # noqa: RUF012

    def __init__(self, target, background):
        self.target, self.background = target, background
        self.hold(background[:0])

    def hold(self, splats):
        self.held, self.last = np.concatenate([self.background, splats]), splats[:0]

    def evaluate(self, splats, *, drawn):
        self.calls.append("evaluate")
        residual = self._residual(splats)
        gradient = render_gradients(self._all(), residual * np.float32(2 / residual[..., 0].size))
        return self._loss(residual), gradient[len(self.held) :].astype(np.float32)

    def loss(self, splats, *, drawn):
        self.calls.append("loss")
        return self._loss(self._residual(splats))

    def picture(self):
        height, width, _ = self.target.shape
        return render(self._all(), width, height)

    def _all(self):
        return Splats.from_array(np.concatenate([self.held, self.last]))

    def _residual(self, splats):
        self.last = splats.copy()
        return self.picture() - self.target

    def _loss(self, residual):
        return float(np.square(residual, dtype=np.float64).sum() / residual[..., 0].size)


@pytest.fixture
def plain(monkeypatch):
    """The device ``plain``, and what was asked of it."""
    entry = EntryPoint("plain", f"{__name__}:PlainEvaluator", plugins.DEVICES)
    monkeypatch.setattr(plugins, "devices", lambda: {"plain": entry})
    monkeypatch.setattr(PlainEvaluator, "calls", [])
    return PlainEvaluator.calls


@pytest.fixture
def no_cpu(monkeypatch):
    """What makes every evaluation on the CPU an error, from its call on."""

    def refuse(*arguments, **named):
        raise AssertionError("evaluated on the CPU")

    return lambda: monkeypatch.setattr(CpuEvaluator, "_loss", refuse)


def test_a_clip_is_encoded_by_a_device_alone(plain, no_cpu, tmp_path):
    options = {"splats": 12, "key_frames": (0,), "threads": 1}
    ours = gsvc_ref.encode(CLIP, tmp_path / "cpu.gsvc", gsvc_ref.Settings.quick(**options))
    assert not plain
    no_cpu()
    theirs = gsvc_ref.encode(CLIP, tmp_path / "plain.gsvc", gsvc_ref.Settings.quick(**options, device="plain"))
    assert [frame.type for frame in theirs.frames] == [frame.type for frame in ours.frames] == ["I", "P", "P"]
    assert plain.count("evaluate") == sum(frame.iterations for frame in theirs.frames) > 200
    for one, other in zip(ours.frames, theirs.frames, strict=True):
        assert other.psnr == pytest.approx(one.psnr, abs=0.5)


@pytest.mark.parametrize("settings", [{"layers": 2}, {"profile": "paper", "splats": 12, "iterations": 5}])
def test_detection_layers_and_profile_paper_are_computed_by_a_device(plain, no_cpu, tmp_path, settings):
    no_cpu()
    report = gsvc_ref.encode(CLIP[:2], tmp_path / "x.gsvc", gsvc_ref.Settings.quick(device="plain", **settings))
    assert len(report.frames) == 2
    assert plain.count("evaluate") > sum(frame.iterations for frame in report.frames) > 0


def test_an_objective_of_a_device_is_that_of_the_cpu(plain):
    """Backgrounds, splats that are held or frozen, pictures and residuals."""
    target = CLIP[0] / np.float32(255)
    ours, theirs = (Objective(target, background=PARAMETERS[:1], device=device) for device in ("cpu", "plain"))

    def same(parameters):
        for one, other in zip(ours.evaluate(parameters), theirs.evaluate(parameters, drawn=True), strict=True):
            np.testing.assert_allclose(other, one, rtol=1e-4, atol=1e-6)
        assert theirs.loss(parameters) == pytest.approx(ours.loss(parameters), rel=1e-5)
        np.testing.assert_allclose(theirs.picture(), ours.picture(), atol=1e-5)
        np.testing.assert_allclose(theirs.residual(), ours.residual(), atol=1e-5)

    same(PARAMETERS[1:])
    for one in (ours, theirs):
        one.hold(PARAMETERS[1:2])
    same(PARAMETERS[2:])
    for one in (ours, theirs):
        one.freeze(PARAMETERS[1:], np.array([False, True]))
    same(PARAMETERS[1:])
    for one in (ours, theirs):
        one.thaw()
    same(PARAMETERS[:0])


def test_a_device_that_is_not_there_is_refused_with_those_that_are(plain):
    with pytest.raises(UsageError, match=r"no device 'cuba', only cpu, plain; .*'gsvc-conformance\[cuda\]'"):
        gsvc_ref.Settings.quick(device="cuba")


def test_a_device_has_no_deterministic_precision(plain):
    with pytest.raises(UsageError, match="leave out device plain, or the precision"):
        gsvc_ref.Settings.quick(device="plain", precision="deterministic")


def test_what_fails_on_a_device_ends_an_encode_that_keeps_its_frames(plain, monkeypatch, tmp_path):
    evaluate = PlainEvaluator.evaluate

    def failing(self, splats, *, drawn):
        if len(plain) > 250:
            raise RuntimeError("the card fell out: put it back")
        return evaluate(self, splats, drawn=drawn)

    monkeypatch.setattr(PlainEvaluator, "evaluate", failing)
    settings = gsvc_ref.Settings.quick(splats=12, key_frames=(0,), device="plain")
    with pytest.raises(gsvc_ref.IncompleteEncodeError, match="device plain: the card fell out: put it back"):
        gsvc_ref.encode(CLIP, tmp_path / "x.gsvc", settings)
    assert len(list(gsvc_ref.decode(tmp_path / "x.gsvc"))) == 1


def test_the_command_takes_a_device(tmp_path):
    source = tmp_path / "a.y4m"
    source.write_bytes(b"YUV4MPEG2 W16 H16 F25:1 C420jpeg\nFRAME\n" + bytes(384))
    command = [sys.executable, "-m", "gsvc_ref", "encode", str(source), str(tmp_path / "a.gsvc"), "--device"]
    assert subprocess.run([*command, "cpu"], capture_output=True, timeout=120).returncode == 0
    refused = subprocess.run([*command, "cuba"], capture_output=True, text=True, timeout=120)
    assert refused.returncode == 2
    assert "there is no device 'cuba'" in refused.stderr
