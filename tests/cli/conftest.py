import io
import sys
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from gsvc_lab.scenes import demo_clip
from gsvc_ref.cli import main
from gsvc_ref.video import ColorDescription, VideoFormat, open_writer

QUICK = ["--splats", "12", "--key-frames", "2", "--quiet"]


def video_format(width=32, height=24, bit_depth=8, chroma_format="420") -> VideoFormat:
    color = ColorDescription(primaries=1, transfer=1, matrix=1, full_range=False, chroma_location=0)
    return VideoFormat(width, height, Fraction(24), bit_depth, chroma_format, color)


def write_clip(path: Path, frames=4, **changes) -> Path:
    video = video_format(**changes)
    with open_writer(path, video) as writer:
        for frame in demo_clip(video.width, video.height, frames):
            writer.write(frame if video.bit_depth == 8 else frame.astype(np.uint16) << (video.bit_depth - 8))
    return path


@pytest.fixture(scope="session")
def clip(tmp_path_factory) -> Path:
    """Four frames of 32x24 pixels."""
    return write_clip(tmp_path_factory.mktemp("clip") / "clip.y4m")


@pytest.fixture(scope="session")
def stream(clip) -> Path:
    """The clip encoded: I P I P."""
    path = clip.with_name("clip.gsvc")
    assert main(["encode", str(clip), str(path), *QUICK]) == 0
    return path


@pytest.fixture(scope="session", autouse=True)
def compiled(stream, tmp_path_factory) -> None:
    """All kernels, so that no test finds the notice of the compiler among a command's messages."""
    output = str(tmp_path_factory.mktemp("compiled"))
    assert main(["decode", str(stream), output, "--quiet"]) == 0
    assert main(["info", str(stream), "--salvage", "--json"]) == 0
    assert main(["compare", output, str(stream), "--no-vmaf", "--quiet"]) == 0


@pytest.fixture
def standard_input(monkeypatch) -> Callable[[bytes], None]:
    """Lets a test say what stands on standard input."""

    def feed(data: bytes) -> None:
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))

    return feed
