"""Seeking, salvage, concatenation and the commands with streams of profile `main`."""

import json
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

import gsvc_ref
from gsvc_base.errors import UsageError
from gsvc_ref import spec
from gsvc_ref.cli import main
from gsvc_ref.stream import Gap, StreamReader
from gsvc_ref.testing import OVERVIEW_HEADER, overview_frames, write_stream
from tests.main.material import both, flipped, stream_of, with_payload

TYPES = "IPRPIPPR"


@pytest.fixture(scope="module")
def data() -> bytes:
    return stream_of(TYPES)


@pytest.fixture
def path(data: bytes, tmp_path: Path) -> Path:
    path = tmp_path / "main.gsvc"
    path.write_bytes(data)
    return path


def test_frames_from_anywhere(data: bytes) -> None:
    with StreamReader(data) as reader:
        frames = list(reader)
        for start in range(len(TYPES) + 1):
            assert list(reader.frames(start, start + 2)) == frames[start : start + 2]
    for first in range(len(TYPES)):
        ours, theirs = gsvc_ref.seek(data, first, first + 1), spec.seek(data, first, first + 1)
        for name, values in theirs.items():
            assert np.array_equal(getattr(ours, name), values), (first, name)


def test_pictures(data: bytes) -> None:
    frames = list(gsvc_ref.decode(data))
    with StreamReader(data) as reader:
        for frame, decoded in zip(frames, reader, strict=True):
            assert np.array_equal(frame, gsvc_ref.render_frame(decoded.splats, 32, 24, 8))
    assert np.array_equal(frames[3:6], list(gsvc_ref.decode(data, start=3, stop=6)))


def test_salvage(data: bytes) -> None:
    with StreamReader(data) as reader:
        whole = list(reader)
    damaged = with_payload(data, 2, flipped(400))  # frame 1; chunk 0 is the header
    parts = list(StreamReader(damaged).salvage())
    gaps = [part for part in parts if isinstance(part, Gap)]
    assert [part for part in parts if not isinstance(part, Gap)] == [whole[0], *whole[4:]]
    assert len(gaps) == 1
    assert (gaps[0].first_missing, gaps[0].missing_count, gaps[0].predicted_from) == (1, 3, 2)
    summary = StreamReader(damaged).summary(salvage=True)
    assert sum(summary.bits.values()) == 8 * len(damaged)


def test_concatenation(data: bytes) -> None:
    other = stream_of("IP", seed=2)
    target = BytesIO()
    report = gsvc_ref.concat([data, other, data], target)
    assert report.frame_count == 2 * len(TYPES) + 2
    ours, theirs = both(target.getvalue())
    assert ours == theirs
    assert ours[2] == ""
    splats = [frame.splats for part in (data, other, data) for frame in StreamReader(part)]
    assert [frame.splats for frame in StreamReader(target.getvalue())] == splats


def test_streams_of_two_profiles_are_not_joined(data: bytes) -> None:
    paper = write_stream(OVERVIEW_HEADER, overview_frames())
    with pytest.raises(UsageError, match="`profile` is 1 in part 1 and 0 in part 2; only streams with the same header"):
        gsvc_ref.concat([data, paper], BytesIO())


def test_info(path: Path, data: bytes, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(path), "--frames-table"]) == 0
    told = capsys.readouterr().out
    for line in ("profile main, level 1", "up to 4 lanes of the entropy coder, one layer", "entropy_coder", "modes"):
        assert line in told
    assert main(["info", str(path), "--json"]) == 0
    info = json.loads(capsys.readouterr().out)
    assert sum(info["bits"].values()) == 8 * len(data)
    assert info["header"]["layer_count"] == 1
    assert "cholesky_bits" not in info["header"]


def test_dump(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["dump", str(path)]) == 0
    told = capsys.readouterr().out
    for name in ("layer_count, chunk H", "quantizer, frame 0", "centre of shear, frame 0", "word, frame 1"):
        assert name in told
    assert main(["dump", str(path), "--json", "--frames", "1:2"]) == 0
    assert all(json.loads(line)["frame"] == 1 for line in capsys.readouterr().out.splitlines())


def test_dump_of_a_damaged_stream(tmp_path: Path, data: bytes, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "damaged.gsvc"
    path.write_bytes(with_payload(data, 1, flipped(48)))  # the highest bit of `quantizer`
    assert main(["dump", str(path)]) == 1
    assert "at quantizer, frame 0" in capsys.readouterr().out


def test_decode_compare_and_concat(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    video, joined = path.with_name("main.y4m"), path.with_name("joined.gsvc")
    assert main(["decode", str(path), str(video), "--quiet"]) == 0
    assert main(["compare", str(video), str(path), "--no-vmaf", "--quiet"]) == 0
    assert "PSNR" in capsys.readouterr().out
    assert main(["concat", str(path), str(path), "-o", str(joined)]) == 0
    assert main(["info", str(joined), "--json"]) == 0
    assert len(gsvc_ref.reconstruct_stream(joined.read_bytes()).counts) == 2 * len(TYPES)


def test_splats_go_out(path: Path) -> None:
    out = path.with_name("splats.npz")
    assert main(["export", str(path), str(out), "--quiet"]) == 0
    assert out.exists()
