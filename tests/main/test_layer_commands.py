"""Streams with layers joined and cut, and the commands that know layers."""

import json
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

import gsvc_ref
from gsvc_base.errors import UsageError
from gsvc_ref import spec
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.bitstream.header import MAIN, Quality
from gsvc_ref.cli import main
from gsvc_ref.testing import join_chunks, split_chunks
from gsvc_ref.video import open_video
from gsvc_tools.editing.cutting import up_to
from tests.main.material import stream_of, with_payload
from tests.main.test_main_layers import TYPES, layered


@pytest.fixture(scope="module")
def data() -> bytes:
    return layered()


@pytest.fixture
def path(data: bytes, tmp_path: Path) -> Path:
    path = tmp_path / "layers.gsvc"
    path.write_bytes(data)
    return path


def parameters(stream: bytes, layer: int) -> tuple[list[int], bytes]:
    found = spec.reconstruct_layers(stream, layer)
    assert found["error"] == ""
    return found["counts"].tolist(), found["parameters"].tobytes()


@pytest.mark.parametrize("layer", [0, 1, 2])
def test_cut(data: bytes, layer: int) -> None:
    """The frames of a stream that was cut are those of the quality that stays."""
    target = BytesIO()
    report = gsvc_ref.cut(data, target, layer)
    cut = target.getvalue()
    assert (report.frame_count, report.file_bytes) == (len(TYPES), len(cut))
    assert report.left_out == ({"n": 12 - sum(chunk[0] == b"n" for chunk in split_chunks(cut))} if layer < 2 else {})
    with gsvc_ref.open(cut) as stream:
        assert stream.header.layer_count == layer + 1
        assert len(list(stream)) == len(TYPES)
    assert parameters(cut, 3 if layer else 0) == parameters(data, layer)
    assert parameters(cut, 0) == parameters(data, 0)
    if layer == 2:
        assert gsvc_ref.reconstruct_layers(cut, 2).error == ""
    with pytest.raises(UsageError, match=rf"has the layers 0 \(the base\) to {layer}; {layer + 1} is none of them"):
        gsvc_ref.cut(cut, BytesIO(), layer + 1)


def test_decisions_stay_when_layers_are_cut(data: bytes) -> None:
    """What is safe to copy stays, and what was decided about the frames; other data may depend on what is dropped."""
    chunks = split_chunks(data)
    end = [chunk[0] for chunk in chunks].index(b"x")
    extra = [(b"d", b"\0"), (b"q", bytes(17)), (b"r", bytes(18))]
    joined = join_chunks([*chunks[:end], *extra, (b"E", chunks[-1][1][:4] + bytes(4))], prefix=data[:PREFIX_SIZE])
    target = BytesIO()
    report = gsvc_ref.cut(joined, target, 1)
    kinds = [kind for kind, _ in split_chunks(target.getvalue())]
    assert b"d" in kinds
    assert b"q" in kinds
    assert report.left_out["r"] == 1


def test_concatenation(data: bytes) -> None:
    """Layers come along with their frames, also after the I-frame that a part begins with."""
    other = layered("IR", ({}, {}))
    target = BytesIO()
    report = gsvc_ref.concat([data, other, data], target)
    assert report.left_out == {}
    for layer in range(3):
        parts = [parameters(part, layer) for part in (data, other, data)]
        assert parameters(target.getvalue(), layer) == (
            [count for counts, _ in parts for count in counts], b"".join(values for _, values in parts),
        )  # fmt: skip


def test_numbers_of_frames_are_raised_in_layers_too(data: bytes) -> None:
    """`frame_low` follows `frame_number`, from 15 to 0 as well; one that was wrong stays wrong (R-6.10-3, R-6.10-8)."""
    target = BytesIO()
    gsvc_ref.concat([data, data, data], target)
    joined = target.getvalue()
    number, lows = -1, []
    for kind, payload in split_chunks(joined):
        number += kind in (b"I", b"P", b"R")
        if kind == b"n":
            lows.append((number, payload[0] & 15))
    assert all(low == number % 16 for number, low in lows)
    assert max(number for number, _ in lows) > 15
    part = BytesIO()
    gsvc_ref.cut(joined, part, start=14)
    assert parameters(part.getvalue(), 2) == parameters(data, 2)
    wrong = with_payload(data, 2, lambda p: bytes([p[0] ^ 1]) + p[1:])
    assert gsvc_ref.reconstruct_layers(wrong, 2).error.split()[1] == "R-15.13-4"
    joined_wrong = BytesIO()
    gsvc_ref.concat([data, wrong], joined_wrong)
    assert gsvc_ref.reconstruct_layers(joined_wrong.getvalue(), 2).error.split()[1] == "R-15.13-4"


def test_a_cut_keeps_what_its_qualities_promise() -> None:
    points = (Quality(1, 1), Quality(1, 1), Quality(2))
    header = SequenceHeader(profile=MAIN, level=2, width=600, height=300, layer_count=3, qualities=points)
    assert up_to(header, 2) == header
    one = up_to(header, 1)  # at full size it asks for level 2
    assert (one.level, one.operating_points) == (2, (Quality(1, 1), Quality(2, 1)))
    assert (up_to(header, 0).level, up_to(header, 0).operating_points) == (2, ())
    whole = replace(header, width=60, height=30, qualities=(Quality(1), Quality(1), Quality(2)))
    assert (up_to(whole, 1).level, up_to(whole, 1).qualities) == (1, ())
    assert up_to(whole, 0).level == 1


def test_streams_of_other_numbers_of_layers_are_not_joined(data: bytes) -> None:
    target = BytesIO()
    gsvc_ref.cut(data, target, 1)
    with pytest.raises(UsageError, match="`layer_count` is 3 in part 1 and 2 in part 2"):
        gsvc_ref.concat([data, target.getvalue()], BytesIO())


def test_cut_command(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = path.with_name("out.gsvc")
    assert main(["cut", str(path), str(out), "--layer", "1"]) == 0
    told = capsys.readouterr().out
    assert "7 frames, the base and 1 layer" in told
    assert "left out: 6 chunks n, of layers above" in told
    assert gsvc_ref.open(out.read_bytes()).header.layer_count == 2
    assert main(["cut", str(path), str(out), "--layer", "0", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["left_out"] == {"n": 12}
    assert report["header"]["layer_count"] == 1
    assert report["file_bytes"] == out.stat().st_size
    assert main(["cut", str(path), str(out), "--layer", "0", "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    assert main(["cut", str(path), str(out), "--layer", "3"]) == 2
    assert "has the layers 0 (the base) to 2" in capsys.readouterr().err
    path.write_bytes(path.read_bytes()[:-20])
    assert main(["cut", str(path), str(out), "--layer", "0"]) == 1
    assert "R-6.2-4" in capsys.readouterr().err
    assert gsvc_ref.open(out.read_bytes()).header.layer_count == 1  # what stood there still does


@pytest.mark.parametrize("layer", [None, 0, 1, 2])
def test_decode_and_compare(path: Path, data: bytes, layer: int | None, capsys: pytest.CaptureFixture[str]) -> None:
    option = [] if layer is None else ["--layer", str(layer)]
    frames = path.with_name("frames")
    frames.mkdir()
    assert main(["decode", str(path), str(frames), "--quiet", *option]) == 0
    expected = list(gsvc_ref.decode(data, layer=2 if layer is None else layer))
    with open_video(frames) as reader:
        assert np.array_equal(list(reader), expected)
    assert main(["compare", str(frames), str(path), "--no-vmaf", "--quiet", *option]) == 0
    assert "identical" in capsys.readouterr().out


def test_a_layer_that_there_is_not(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["decode", str(path), str(path.with_name("v.y4m")), "--layer", "3"]) == 2
    assert "layers.gsvc: layer 3 was asked for; the stream has layers 0 (the base) to 2" in capsys.readouterr().err


def test_info(path: Path, data: bytes, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(path)]) == 0
    told = capsys.readouterr().out
    assert "3 layers" in told
    for name in ("base  ", "layer 1", "layer 2"):
        line = next(line for line in told.splitlines() if line.strip().startswith(name))
        assert "of the file" in line
    assert main(["info", str(path), "--json"]) == 0
    info = json.loads(capsys.readouterr().out)
    assert sum(info["bits"].values()) == 8 * len(data)
    assert [[layer["layer"] for layer in frame["layers"]] for frame in info["frames"]] == [
        [1, 2], [1, 2], [2], [1, 2], [1], [1, 2], [1, 2],
    ]  # fmt: skip


def test_dump(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["dump", str(path), "--frames", "2:3"]) == 0
    told = capsys.readouterr().out
    assert "layer, chunk n, frame 2" in told
    assert "layer_type, chunk n, frame 2" in told
    assert "frame 3" not in told


def test_info_of_a_stream_without_layers_says_nothing_of_them(capsys: pytest.CaptureFixture[str], path: Path) -> None:
    path.write_bytes(stream_of("IP"))
    assert main(["info", str(path)]) == 0
    assert "base " not in capsys.readouterr().out


def test_headers_of_one_layer(data: bytes) -> None:
    """A chunk of a layer that the header does not have is a fault for who wants layers, and for nobody else."""
    target = BytesIO()
    gsvc_ref.cut(data, target, 0)
    chunks = split_chunks(target.getvalue())
    stream = join_chunks([*chunks[:2], (b"n", b"\x40"), *chunks[2:]], prefix=data[:PREFIX_SIZE])
    assert gsvc_ref.open(stream).header.layer_count == 1
    assert len(list(gsvc_ref.open(stream))) == len(TYPES)
    ours, theirs = gsvc_ref.reconstruct_layers(stream, 1), spec.reconstruct_layers(stream, 1)
    assert ours.error == theirs["error"]
    assert ours.error.split()[1] == "R-15.13-1"
