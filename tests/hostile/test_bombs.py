"""Decompression bombs: a count or a size one past its limit, or without the bytes it needs, is refused before memory is
taken for it, whichever way the stream is read. What is at a limit and legal is measured in `test_memory`."""

import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from gsvc_base.errors import GsvcError
from gsvc_ref.testing import RICH_HEADER, Lie, rich_frames, write_stream
from tests.hostile.hostile_streams import (
    chunk,
    constant,
    encode_uv,
    end,
    header,
    intra,
    main_frames,
    main_header,
    opening,
)
from tests.hostile.memory import ENTRIES

LARGEST_PEAK = 16 << 20
"""Bytes. The frames before the fault need a part of it, a stream at the limits of level 5 hundreds of times as much."""


def huge(*lies: Lie) -> Callable[[], bytes]:
    """Level 5, so that all limits are far away from what is there."""
    head = replace(RICH_HEADER, level=5, color_codewords=1024, cholesky_bits=12)
    return lambda: write_stream(head, rich_frames(), lies=lies)


def one_frame(*lies: Lie) -> Callable[[], bytes]:
    """A stream of one frame."""
    return lambda: write_stream(replace(RICH_HEADER, level=5), rich_frames()[:1], lies=lies)


def area(splats: int) -> Callable[[], bytes]:
    """Splats that fill a frame of 2^17 pixels each: the level allows 2^8. It is shown again."""
    everything = (1e6, 0.0, 1e6)
    frame = intra(0, splats, factor=everything, long=False)
    return lambda: opening(header(1, 512, 256)) + frame + chunk("R", encode_uv(1)) + end(2)


def survivors() -> bytes:
    """As many splats as allowed stay, and one comes."""
    frame = chunk("P", encode_uv(1), encode_uv(1), constant(1, 1), bytes(100))
    return opening(header(1, 16, 16)) + intra(0, 1 << 14, long=False) + frame + end(2)


def main(*lies: Lie, level: int = 5) -> Callable[[], bytes]:
    """A stream of profile `main`, of an I-frame of 20 splats and two P-frames with fields of motion, and its lies."""
    head = main_header(level, 64, 48)
    return lambda: write_stream(head, main_frames(head, 20, 2), lies=lies)


BOMBS: dict[str, tuple[Callable[[], bytes], str]] = {
    "width and height": (huge(Lie("width", 65535), Lie("height", 65535)), "R-5-1"),
    "one row too many": (huge(Lie("width", 8192), Lie("height", 8193)), "R-5-1"),
    "chunk_length of the header": (huge(Lie("chunk_length", 1025)), "R-5-3"),
    "longest chunk_length of the header": (huge(Lie("chunk_length", 2**32 - 1)), "R-5-3"),
    "chunk_length": (huge(Lie("chunk_length", 2**28 + 1, 1)), "R-5-3"),
    "chunk_length without the bytes": (huge(Lie("chunk_length", 2**28, 1)), "R-6.2-4"),
    "chunk_length of 2^32": (huge(Lie("chunk_length", b"\xff\xff\xff\xff\x1f", 1)), "R-3.1-1"),
    "splat_count": (huge(Lie("splat_count", 2**22 + 1)), "R-5-2"),
    "splat_count of 2^32": (huge(Lie("splat_count", b"\xff\xff\xff\xff\x1f")), "R-3.1-1"),
    "splat_count without the bytes": (huge(Lie("splat_count", 2**22), Lie("plane_mode", 1)), "R-6.2-3"),
    "new_splat_count": (huge(Lie("new_splat_count", 2**22 + 1)), "R-5-2"),
    "survivors": (survivors, "R-5-2"),
    "splat area": (area(257), "R-5-4"),
    "stage_count": (huge(Lie("stage_count", 255)), "R-6.5-6"),
    "codeword_count": (huge(Lie("codeword_count", 1025)), "R-6.5-6"),
    "codeword_count without the bytes": (huge(Lie("codeword_count", 1024)), "R-6.2-3"),
    "cholesky_bits": (huge(Lie("cholesky_bits", 255)), "R-6.3-1"),
    "entropy_precision": (huge(Lie("entropy_precision", 255)), "R-6.3-1"),
    "lane_count": (huge(Lie("lane_count", 255)), "R-6.3-1"),
    "table_bits": (huge(Lie("table_bits", 31)), "R-6.6-3"),
    "word_count": (huge(Lie("word_count", 2**32 - 1)), "R-6.6-6"),
    "entry_count": (huge(Lie("entry_count", 2**32 - 1)), "R-6.2-3"),
    "index_length": (huge(Lie("index_length", 2**32 - 1)), "R-6.8-2"),
    "frame_count": (huge(Lie("frame_count", 2**32 - 1, 1)), "R-6.8-1"),
    "main, width and height": (main(Lie("width", 65535), Lie("height", 65535)), "R-5-1"),
    "main, splat_number": (main(Lie("splat_number", 2**23 + 1)), "R-5-2"),
    "main, splat_number of 2^32": (main(Lie("splat_number", b"\xff\xff\xff\xff\x1f")), "R-3.1-1"),
    "main, splat_number without the words": (main(Lie("splat_number", 2**15 - 1), level=1), "R-7-1"),
    "main, reserved lanes": (main(Lie("lane_exponent", 15)), "R-3.2-1"),
    "main, lanes beyond those of the header": (main(Lie("lane_exponent", 7)), "R-15.5-1"),
    "main, lanes without the bytes": (main(Lie("lane_exponent", 6)), "R-6.2-3"),
    "main, layer_count": (main(Lie("layer_count", 255)), "R-3.2-1"),
    "main, words": (main(Lie("word", bytes(2**16))), "R-7-1"),
    "frame_count of the header": (one_frame(Lie("frame_count", 2**32 - 1)), "R-6.3-2"),
}


@pytest.fixture(scope="module", params=BOMBS)
def bomb(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    make, rule = BOMBS[request.param]
    path = tmp_path_factory.mktemp("bomb") / "bomb.gsvc"
    path.write_bytes(make())
    return path, rule


@pytest.fixture(scope="module", autouse=True)
def compiled(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Compiled kernels and imported modules are no part of the measurement."""
    path = tmp_path_factory.mktemp("legal") / "legal.gsvc"
    path.write_bytes(huge()())
    path_main = tmp_path_factory.mktemp("legal") / "main.gsvc"
    path_main.write_bytes(main()())
    for run in ENTRIES.values():
        run(path)
        run(path_main)


@pytest.mark.parametrize("entry", ENTRIES)
def test_is_refused_before_memory_is_taken(bomb: tuple[Path, str], entry: str) -> None:
    """Of two runs the one that takes less counts: a thread that another test has left may allocate in either."""
    path, rule = bomb
    peaks = []
    for _ in range(2):
        tracemalloc.start()
        try:
            with pytest.raises((GsvcError, SystemExit)) as raised:
                ENTRIES[entry](path)
            peaks.append(tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()
        if isinstance(raised.value, GsvcError):
            assert raised.value.rule == rule
        else:  # a command's exit code and what it said
            assert str(raised.value).startswith("1: gsvc ")
            assert rule in str(raised.value)
    assert min(peaks) < LARGEST_PEAK


def test_as_much_area_as_allowed(tmp_path: Path) -> None:
    path = tmp_path / "area.gsvc"
    path.write_bytes(area(256)())
    ENTRIES["decode"](path)
