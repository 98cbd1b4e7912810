"""The commands on damaged files: exit code 1, what is wrong, what to do if frames are missing, all complete frames."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import gsvc_ref
from gsvc_ref.cli import main
from gsvc_ref.stream import StreamReader
from gsvc_ref.video import open_video
from tests.hostile.damage import CORE, flipped

NAMES = ("decode_stream/moving_frames", "decode_stream/bit_depth_12", "read_stream/rich_stream")
ADVICE = re.compile("again|salvage|encode|newer version")


def whole(name: str) -> bytes:
    return (CORE / name / "stream.gsvc").read_bytes()


def chunk_of(data: bytes, number: int) -> tuple[int, int]:
    """Where the chunk of a frame begins, and its bytes; a number below 0 counts from the last frame."""
    with StreamReader(data) as reader:
        frame = list(reader)[number]
    return frame.offset, frame.size


def cut_in_frame(number: int) -> Callable[[bytes], bytes]:
    return lambda data: data[: sum(chunk_of(data, number)) - 3]


def flip_in_frame(number: int) -> Callable[[bytes], bytes]:
    return lambda data: flipped(data, 8 * (sum(chunk_of(data, number)) - 5))


DAMAGES: dict[str, tuple[Callable[[bytes], bytes], str]] = {
    "nothing": (lambda data: b"", "R-6.1-1"),
    "magic number": (lambda data: flipped(data, 3), "R-6.1-1"),
    "version": (lambda data: flipped(data, 66), "R-6.1-2"),
    "cut in the header": (lambda data: data[:30], "R-6.2-4"),
    "flip in the header": (lambda data: flipped(data, 8 * 20), "R-6.2-2"),
    "cut in the first frame": (cut_in_frame(0), "R-6.2-4"),
    "cut in the last frame": (cut_in_frame(-1), "R-6.2-4"),
    "cut between frames": (lambda data: data[: chunk_of(data, -1)[0]], "R-6.2-4"),
    "flip in the first frame": (flip_in_frame(0), "R-6.2-2"),
    "flip in the last frame": (flip_in_frame(-1), "R-6.2-2"),
    "no end": (lambda data: data[:-14], "R-6.2-4"),
    "flip in the end": (lambda data: flipped(data, 8 * len(data) - 1), "R-6.2-2"),
    "something follows": (lambda data: data + b"\0", "R-6.1-4"),
    "two streams": (lambda data: data + data, "R-6.1-4"),
}


def complete_frames(data: bytes) -> int:
    count = 0
    try:
        for _ in StreamReader(data):
            count += 1
    except gsvc_ref.GsvcError:
        pass
    return count


@pytest.mark.parametrize("damage", DAMAGES)
def test_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str], damage: str) -> None:
    make, rule = DAMAGES[damage]
    for name in NAMES:
        original, path, output = tmp_path / "whole.gsvc", tmp_path / "damaged.gsvc", tmp_path / "out.y4m"
        original.write_bytes(whole(name))
        path.write_bytes(make(whole(name)))
        count = complete_frames(path.read_bytes())
        capsys.readouterr()

        assert main(["decode", str(path), str(output), "--quiet"]) == 1
        message = capsys.readouterr().err
        assert rule in message
        assert str(path) in message
        assert ADVICE.search(message) or "no frame is missing" in message, message
        assert output.exists() == (count > 0)
        if count:
            assert f"{count} complete frame" in message
            assert main(["decode", str(original), str(tmp_path / "all.y4m"), "--quiet"]) == 0
            with open_video(output) as kept, open_video(tmp_path / "all.y4m") as expected:
                frames = list(kept)
                assert len(frames) == count
                assert all(np.array_equal(a, b) for a, b in zip(frames, expected, strict=False))
            output.unlink()
        capsys.readouterr()

        for command in (["info", str(path)], ["compare", str(original), str(path), "--no-vmaf", "--quiet"]):
            assert main(command) == 1
            assert rule in capsys.readouterr().err
