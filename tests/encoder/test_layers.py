"""Encodes with quality layers: I-frames fit all of them together; each is predicted from itself, or moves along."""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gsvc_ref
from gsvc_base.arrays import Frame
from gsvc_base.errors import UsageError
from gsvc_lab.scenes import demo_clip
from gsvc_ref.cli import main
from gsvc_ref.encoder import EncodeReport, IncompleteEncodeError, Settings
from gsvc_ref.encoder.log import read_log
from gsvc_ref.encoder.main.coordinates import to_parameters
from gsvc_ref.encoder.main.target import LayeredTarget, Target
from gsvc_ref.main import layers
from gsvc_ref.metrics import psnr
from gsvc_ref.stream import Stream
from gsvc_ref.testing import split_chunks
from gsvc_ref.video import open_writer
from tests.cli.conftest import video_format

CLIP = np.stack(list(demo_clip(48, 32, 3)))[[0, 1, 2, 2]]
"""Four frames, of which the last is the third once more."""


STILL = np.stack([CLIP[0], CLIP[0] ^ 1, CLIP[0], CLIP[0] ^ 1])
"""Frames that are nearly equal."""

MOVING = np.stack([np.roll(demo_frame, 3 * number, axis=1) for number, demo_frame in enumerate([CLIP[0]] * 3)])
"""A picture that moves to the right."""


def encoded(clip: Frame = CLIP, **changes: object) -> tuple[EncodeReport, bytes]:
    target = BytesIO()
    settings = Settings.quick(profile="main", key_frames=10, **changes)
    return gsvc_ref.encode(clip, target, settings), target.getvalue()


@pytest.fixture(scope="module")
def layered() -> tuple[EncodeReport, bytes]:
    return encoded(layer_splats=(10, 25, 60), checksums=True)


def test_every_layer_adds_quality(layered: tuple[EncodeReport, bytes]) -> None:
    report, data = layered
    assert report.header.layer_count == 3
    qualities = []
    for layer in range(3):
        decoded = list(gsvc_ref.decode(data, layer=layer))
        found = [psnr(frame, picture, 255) for frame, picture in zip(CLIP, decoded, strict=True)]
        assert found == pytest.approx([frame.layers[layer].psnr for frame in report.frames], abs=1e-9)
        qualities.append(np.mean(found))
    assert qualities[0] < qualities[1] < qualities[2]
    assert report.mean_psnr == pytest.approx(qualities[2])
    assert gsvc_ref.reconstruct_layers(data, 2).error == ""


def test_what_is_said_of_layers_is_what_is_written(layered: tuple[EncodeReport, bytes]) -> None:
    report, data = layered
    with gsvc_ref.open(data) as stream:
        for frame, said in zip(stream, report.frames, strict=True):
            assert said.layers[0].bits == said.bits == frame.bits
            for chunk in frame.chunks:
                told = said.layers[chunk.layer]
                assert (told.type, told.splats, told.bits) == (chunk.type, len(chunk.splats), chunk.bits)
                assert told.new_splats == chunk.codes.intra_count


def test_frames_that_repeat_have_no_chunks_of_layers(layered: tuple[EncodeReport, bytes]) -> None:
    report, data = layered
    assert [frame.type for frame in report.frames] == ["I", "P", "P", "R"]
    assert [chunk[0] for chunk in split_chunks(data)].count(b"n") == 6
    assert [layer.bits for layer in report.frames[3].layers[1:]] == [{}, {}]


def test_a_layer_may_move_with_the_base_or_take_its_field() -> None:
    report, data = encoded(MOVING, layers=2, splats=40, checksums=True)
    first, *others = report.frames
    assert [layer.splats for layer in first.layers] > [10, 10]
    assert {layer.type for frame in others for layer in frame.layers} >= {"P"}
    with gsvc_ref.open(data) as stream:
        frames = list(stream)[1:]
    fields = [frame.codes.motion_cell for frame in frames]
    assert any(fields)
    own = [chunk.codes.motion_cell for frame in frames for chunk in frame.chunks if chunk.layer == 1]
    assert len(own) < len(frames) or 0 in own  # carried, or with the field of the base
    for layer in range(2):
        found = [
            psnr(frame, shown, 255) for frame, shown in zip(MOVING, gsvc_ref.decode(data, layer=layer), strict=True)
        ]
        assert found == pytest.approx([frame.layers[layer].psnr for frame in report.frames], abs=1e-9)


def test_a_layer_that_moves_with_the_base_has_no_chunk() -> None:
    report, data = encoded(STILL, layer_splats=(10, 25), checksums=True)
    kept = [frame.layers[1].bits == {} for frame in report.frames]
    assert kept[0] is False
    assert any(kept)
    assert [chunk[0] for chunk in split_chunks(data)].count(b"n") == kept.count(False)
    assert gsvc_ref.reconstruct_layers(data, 1).error == ""


def test_a_base_that_weighs_more_is_better_for_more_bits() -> None:
    made = [encoded(CLIP[:1], layer_splats=(20, 60), layers_base=weight)[0].frames[0].layers for weight in (0.02, 1.0)]
    light, heavy = (base for base, _ in made)
    assert heavy.psnr > light.psnr + 2
    assert sum(heavy.bits.values()) > sum(light.bits.values())


def test_layers_by_their_number_halve_the_splats() -> None:
    """All together begin with more than a single layer of their quality would."""
    settings = Settings.quick(layers=3, splats=100)
    assert [one.splats for one in settings.of_layers(64, 48)] == [35, 35, 70]
    assert [one.splats for one in Settings.quick(layers=2).of_layers(80, 40)] == [60, 60]
    assert settings.layer_weights == (0.1, 0.2, 1.0)
    assert Settings.quick(layers=2).layer_weights == (0.15, 1.0)
    assert Settings.quick(layers=3, layers_base=0.5).layer_weights == (0.5, 0.5, 1.0)


def test_the_error_of_several_qualities_is_their_weighted_sum() -> None:
    rng = np.random.default_rng(0)
    picture = np.asarray(CLIP[0] / 255, np.float32)
    z = Target(picture, threads=1).new_splats(6, 6, rng)
    parameters = to_parameters(z)
    alone = [Target(picture, threads=1).evaluate(parameters[:count]) for count in (2, 6)]
    together = LayeredTarget([Target(picture, threads=1) for _ in range(2)], (0.25, 1.0), np.array([0, 0, 1, 1, 1, 1]))
    error, gradient = together.evaluate(parameters)
    assert error == 0.25 * alone[0][0] + alone[1][0]
    assert (gradient[2:] == alone[1][1][2:]).all()
    assert (gradient[:2] == 0.25 * alone[0][1] + alone[1][1][:2]).all()
    together.hold([parameters[:1], parameters[2:4]])
    together.layers = np.array([0, 1, 1])
    assert together.evaluate(parameters[[1, 4, 5]])[0] == pytest.approx(error, rel=1e-5)


def test_an_encode_with_layers_is_the_same_again(layered: tuple[EncodeReport, bytes]) -> None:
    assert encoded(layer_splats=(10, 25, 60), checksums=True, threads=1)[1] == layered[1]


@pytest.mark.exhaustive
def test_layers_by_quality() -> None:
    report, data = encoded(layers=(22, 26))
    first = report.frames[0]
    assert [layer.psnr >= goal for layer, goal in zip(first.layers, (22, 26), strict=True)] == [True, True]
    assert gsvc_ref.open(data).header.layer_count == 2
    report, _ = encoded(layers=(22, 99))
    assert "up to layer 1 4 of 4 frames have less than 99 dB" in " ".join(report.notes)


REFUSED = {
    "at most 4 values that grow": {"layers": (30, 30)},
    "give at most 4": {"layer_splats": (1, 2, 3, 4, 5)},
    "layers is 101": {"layers": (30, 101)},
    "a setting of profile main": {"layers": (30, 34), "profile": "paper"},
    "and so does psnr": {"layers": (30, 34), "psnr": 30},
    "and so does splats": {"layer_splats": (30, 34), "splats": 30},
    "and so does layers": {"layer_splats": (30, 34), "layers": (30, 34)},
    "layers is 5": {"layers": 5},
    "layers says how good each layer is, and so does quality": {"layers": 2, "quality": 30},
    "layers_base is 0.1; give more than 0, and layers by": {"layers_base": 0.1, "layers": (30, 34)},
    "layers_base is 2": {"layers_base": 2.0, "layers": 2},
}


@pytest.mark.parametrize("said", REFUSED)
def test_settings_that_are_refused(said: str) -> None:
    with pytest.raises(UsageError, match=said):
        Settings.quick(**{"profile": "main", **REFUSED[said]})


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, out = tmp_path / "clip.y4m", tmp_path / "out.gsvc"
    with open_writer(source, video_format(48, 32)) as writer:
        for frame in CLIP[:2]:
            writer.write(frame)
    options = ["--profile", "main", "--key-frames", "10"]
    assert main(["encode", str(source), str(out), *options, "--layers-splats", "10,25"]) == 0
    told = capsys.readouterr().out
    assert "2 layers of 10 splats, 25 splats" in told
    assert [line.split(":")[0].strip() for line in told.splitlines() if "mean PSNR" in line][1:] == ["base", "layer 1"]
    assert main(["encode", str(source), str(out), *options, "--layers", "22,26", "--json"]) == 0
    assert '"layers"' in capsys.readouterr().out
    assert main(["encode", str(source), str(out), *options, "--splats", "30", "--layers-base", "0.3", "--layers"]) == 0
    assert "2 layers about as good as one of 30 splats" in capsys.readouterr().out
    assert main(["encode", str(source), str(out), *options, "--layers", "30,x"]) == 2
    assert "'x' is not a finite number" in capsys.readouterr().err


def test_a_frame_whose_layer_is_at_fault_is_not_written(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mask names the layers that follow, so a frame is written with all of them or not at all."""
    written = layers.layer_body

    def refused(s: Any, header: Any, shown: Any, *rest: Any) -> Any:
        if shown.number == 1:
            raise UsageError("no room for this layer")
        return written(s, header, shown, *rest)

    monkeypatch.setattr("gsvc_ref.stream.writer.layer_body", refused)
    file = BytesIO()
    settings = Settings.quick(layer_splats=(12, 30), threads=1, decisions=True)
    with pytest.raises(IncompleteEncodeError, match=r"no room for this layer.*1 complete frame") as caught:
        gsvc_ref.encode(CLIP, file, settings)
    report = caught.value.report
    assert [len(frame.layers) for frame in report.frames] == [2]
    data = file.getvalue()
    assert len(list(gsvc_ref.decode(data))) == 1
    assert len(read_log(Stream(data).info().ancillary, 1)) == 1
