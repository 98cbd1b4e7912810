"""More that is fuzzed: single planes, source videos (y4m and PNG), and settings."""

import io
import math
from random import Random
from typing import Any, Final

import numpy as np

from gsvc_base.errors import ERROR_KINDS, GsvcError, UsageError
from gsvc_conformance.spec import namespace
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.planes import plane
from gsvc_ref.bitstream.rans import encode_plane
from gsvc_ref.encoder import Settings
from gsvc_ref.video.images import ImageReader
from gsvc_ref.video.png import PNG_SIGNATURE
from gsvc_ref.video.stream import VideoReader
from gsvc_ref.video.y4m import Y4mReader

from .targets import ACCEPTED

PLANE_HEAD: Final = 6
"""Bytes before those of a plane: its count, its alphabet, `entropy_precision` and `lane_count`."""

MAX_FRAMES: Final = 20


def plane_numbers(data: bytes) -> tuple[int, int, int, int]:
    """Count, alphabet, `entropy_precision` and `lane_count` from the first bytes of an input."""
    head = data[:PLANE_HEAD].ljust(PLANE_HEAD, b"\0")
    return 1 + (head[0] | head[1] << 8) % 600, 1 + (head[2] | head[3] << 8) % 4096, 12 + head[4] % 5, 1 + head[5] % 64


def planes(data: bytes) -> str:
    """A plane: gsvc_ref and spec.md's code read and encode the same, and what is written of it is read again."""
    count, alphabet, precision, lanes = plane_numbers(data)
    header = SequenceHeader(level=1, width=1, height=1, entropy_precision=precision, lane_count=lanes)
    spec = namespace()
    reader, bits = Reader(data[PLANE_HEAD:]), spec["Bits"](data[PLANE_HEAD:])
    mine: Any = None
    theirs: Any = None
    error = fault = ""
    try:
        mine = plane(reader, header, "colors", "plane", count, alphabet)
    except GsvcError as raised:
        error = f"{raised.kind} {raised.rule} {raised.bit}"
    try:
        theirs = spec["read_plane"](bits, vars(header), count, alphabet)
    except spec["Fault"] as raised:
        fault = str(raised)
    assert error == fault, f"gsvc_ref says {error!r}, spec.md's decoder {fault!r}"
    if mine is None:
        return error.split()[1]
    assert mine.tobytes() == theirs.tobytes()
    assert reader.position == bits.position()
    _check_writing(mine, header, alphabet)
    _check_encoding(mine, precision, lanes, alphabet)
    return ACCEPTED


def _check_writing(symbols: np.ndarray[Any, Any], header: SequenceHeader, alphabet: int) -> None:
    """What a writer makes of a plane, a reader reads."""
    writer = Writer()
    plane(writer, header, "colors", "plane", len(symbols), alphabet, symbols)
    reader = Reader(writer.getvalue())
    again = plane(reader, header, "colors", "plane", len(symbols), alphabet)
    assert again.tobytes() == symbols.tobytes()
    assert reader.bits_left == 0


def _check_encoding(symbols: np.ndarray[Any, Any], precision: int, lanes: int, alphabet: int) -> None:
    """With any table, gsvc_ref and spec.md's encoder find the same states and words."""
    counts = np.bincount(symbols, minlength=alphabet).astype(np.int64) + 1
    if counts.sum() > 1 << precision:
        return
    frequencies = (counts << precision) // counts.sum()
    frequencies[-1] += (1 << precision) - frequencies.sum()
    states, words = encode_plane(symbols, frequencies, precision, lanes)
    theirs = namespace()["encode_plane"](symbols, frequencies, precision, lanes)
    assert states.tobytes() == theirs["lane_states"].tobytes()
    assert words.tobytes() == theirs["words"].tobytes()


def videos(data: bytes) -> str:
    """A y4m file or a PNG: frames of the stated format, or GsvcError; twice the same."""
    first, second = _frames(data), _frames(data)
    assert first[1] == second[1]
    assert [frame.tobytes() for frame in first[0]] == [frame.tobytes() for frame in second[0]]
    return first[1]


def _frames(data: bytes) -> tuple[list[Any], str]:
    frames: list[Any] = []
    try:
        source = io.BytesIO(data)
        reader: VideoReader = ImageReader([data], "it") if data.startswith(PNG_SIGNATURE) else Y4mReader(source, "it")
        with reader:
            for frame in reader:
                video = reader.format
                assert frame.shape == (video.height, video.width, 3)
                assert frame.dtype == video.dtype
                assert frame.max() <= video.peak
                frames.append(frame)
                if len(frames) == MAX_FRAMES:
                    break
    except GsvcError as error:
        return frames, _kind(error)
    return frames, ACCEPTED


def _kind(error: GsvcError) -> str:
    """The kind of an error that is not about a stream."""
    assert error.kind in ERROR_KINDS
    assert error.message
    assert error.rule is None
    return error.kind


NUMBERS: Final = (
    None, True, False, -1, 0, 1, 2, 3, 7, 12, 13, 64, 65, 100, 1 << 22, (1 << 22) + 1, 1 << 32, -(1 << 63), 1 << 63,
    1 << 200, 0.0, -0.0, 0.5, 1e-300, 1e300, math.inf, -math.inf, math.nan, 30.0,
)  # fmt: skip
NAMES: Final = (
    "quality", "profile",
    "splats", "psnr", "key_frames", "frames", "seed", "threads", "precision", "lane_count", "entropy_precision",
    "index", "checksums", "iterations", "cholesky_bits", "color_stages", "color_codewords", "low_latency", "effects",
    "decisions", "nonsense",
)  # fmt: skip
WORDS: Final = {
    "key_frames": ("auto",),
    "precision": ("fast", ""),
    "profile": ("main", "paper"),
    "effects": ("auto", "all,gsa=off", "auto,gsa", ""),
}
"""The settings that take words; the types of all others are numbers, as their annotations say."""


def settings(data: bytes) -> str:
    """Settings by name: UsageError, or settings that say the number of splats of a frame."""
    rng = Random(data)
    preset = rng.choice((Settings.quick, Settings.slow, Settings.paper))
    given = {name: _value(rng, name) for name in rng.sample(NAMES, rng.randrange(1, 4))}
    try:
        made = preset(**given)
        count = made.splat_count(rng.randrange(1, 65536), rng.randrange(1, 65536))
    except UsageError:
        return "refused"
    assert count >= 1
    return ACCEPTED


def _value(rng: Random, name: str) -> Any:
    if name == "frames":
        return rng.choice(((0, None), (0, 0), (-1, 3), (3, 2), (0, 1 << 70), (1 << 70, None)))
    if name == "key_frames" and rng.randrange(2):
        return rng.choice(((), (0,), (-1,), (5, 5), (0, 1 << 70)))
    words = WORDS.get(name, ())
    return rng.choice((*NUMBERS, *words))
