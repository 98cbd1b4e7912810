"""What is fuzzed: functions of bytes that say in a word what came of them, and raise only for a defect.

Only GsvcError may come out of readers; it is caught here. Anything else that is raised, an AssertionError included, is
a defect of gsvc_ref, of spec.md's decoder or of a target.
"""

import io
import zlib
from dataclasses import replace
from typing import Any, Final

import numpy as np

import gsvc_ref
from gsvc_base.errors import GsvcError
from gsvc_conformance.reference import (
    decode_stream_deterministic,
    read_main_stream,
    read_stream,
    reconstruct_stream,
    seek,
)
from gsvc_conformance.spec import namespace
from gsvc_ref.bitstream.header import MAIN
from gsvc_ref.bitstream.work import rendering_work
from gsvc_ref.rendering import Precision
from gsvc_ref.stream import DecodedFrame, StreamReader, StreamWriter

from .checks import (
    check_error,
    check_frames,
    check_same_frames,
    check_summary,
    declared_splats,
    read,
    same_error,
    taken,
)

SKIPPED: Final = "skipped"
ACCEPTED: Final = "accepted"

MAX_SPLATS: Final = {"parser": 20_000, "reencode": 600, "pictures": 2_000, "differential": 20_000}
"""Splats that a stream may declare, lest single executions take seconds; larger ones have tests of their own."""

MAX_PIXELS: Final = 1 << 12
MAX_WORK: Final = 1 << 20
MAX_WORK_OF_SPEC: Final = 1 << 14
"""Pixels of a frame and pairs of rendering work of a stream that are rendered."""

PRECISIONS: Final[tuple[Precision, ...]] = ("fast", "deterministic")


def parser(data: bytes) -> str:
    """The frames of a stream; for some inputs also its summary, the same from a pipe, and from frames in the middle."""
    if declared_splats(data) > MAX_SPLATS["parser"]:
        return SKIPPED
    way = zlib.crc32(data) % 8  # of the input, so that replaying it goes the same way
    header, frames, error = read(data)
    check_frames(frames, data)
    check_error(error, data, frames)
    if way == 0:
        _, from_pipe, error_from_pipe = read(data, pipe=True)
        check_same_frames(from_pipe, frames)
        assert same_error(error_from_pipe, error)
    if header is not None and way == 1:
        check_summary(StreamReader(data).summary(), frames, error, data, header)
    if header is not None and way == 2:
        _check_seeking(StreamReader(data), data, frames, complete=error is None)
    return ACCEPTED if error is None else str(error.rule)


def _check_seeking(reader: StreamReader, data: bytes, frames: list[DecodedFrame], *, complete: bool) -> None:
    """Frames from any number on are those of the whole stream, whatever its index says."""
    count = len(frames)
    told = reader.frame_count
    assert not complete or told == count
    for start in {1, max(0, count - 1), zlib.crc32(data) // 8 % (count + 2)}:
        found, error = taken(reader, start)
        check_error(error, data, [])
        if not complete:
            continue
        check_same_frames(found, frames[start:])
        assert error is None


WRITABLE: Final = {
    "sample_aspect_numerator": 0, "sample_aspect_denominator": 0, "chroma_format": 0, "video_full_range_flag": 1,
    "chroma_sample_loc_type": 0,
}  # fmt: skip
"""Descriptive elements that a writer takes; a reader takes any (R-6.3-3)."""


def reencode(data: bytes) -> str:
    """What a reader accepts, a writer writes, and a reader reads the same again."""
    if declared_splats(data) > MAX_SPLATS["reencode"]:
        return SKIPPED
    header, frames, error = read(data)
    if header is None or not frames:
        return str(error and error.rule)
    target = io.BytesIO()
    writer = StreamWriter(target, replace(header, frame_count=0, **WRITABLE), index=zlib.crc32(data) % 2 == 0)
    for frame in frames:
        assert writer.write_frame(frame.codes).splats == frame.splats
    assert sum(writer.finish().values()) == 8 * len(target.getvalue())
    _, again, fault = read(target.getvalue())
    assert fault is None, fault
    assert len(again) == len(frames)
    for first, second in zip(frames, again, strict=True):
        assert second.codes == first.codes
        assert second.splats == first.splats
    return ACCEPTED if error is None else f"{error.rule} behind frames"


def pictures(data: bytes) -> str:
    """All pictures of a stream, in both precisions."""
    if declared_splats(data) > MAX_SPLATS["pictures"]:
        return SKIPPED
    header, frames, error = read(data, layer=None)
    if header is None:
        return str(error and error.rule)
    size = header.width, header.height
    if size[0] * size[1] > MAX_PIXELS or sum(rendering_work(f.splats, *size) for f in frames) > MAX_WORK:
        return SKIPPED
    for precision in PRECISIONS:
        shown: list[Any] = []
        fault = None
        try:
            shown.extend(gsvc_ref.decode(data, precision=precision, threads=1))
        except GsvcError as raised:
            fault = raised
        assert same_error(fault, error)
        assert len(shown) == len(frames)
        for number, (frame, picture) in enumerate(zip(frames, shown, strict=True)):
            assert picture.shape == (header.height, header.width, 3)
            assert picture.dtype == (np.uint8 if header.bit_depth == 8 else np.uint16)
            assert picture.max() < 1 << header.bit_depth
            assert len(frame.splats) or not picture.any()
            repeated = number > 0 and frame.repeats(frames[number - 1])
            assert not repeated or np.array_equal(picture, shown[number - 1])
    if not frames:
        return str(error and error.rule)
    return ACCEPTED if error is None else f"{error.rule} behind frames"


def differential(data: bytes) -> str:
    """gsvc_ref and spec.md's decoder: the same frames, kind, rule and bit, also after a seek; of legal streams more."""
    if declared_splats(data) > MAX_SPLATS["differential"]:
        return SKIPPED
    mine = reconstruct_stream(stream=data)
    _assert_same(mine, namespace()["reconstruct_stream"](stream=data))
    first = zlib.crc32(data) % (len(mine["counts"]) + 2)
    asked = {"stream": data, "first": first, "last": first + zlib.crc32(data[::2]) % 3}
    _assert_same(seek(**asked), namespace()["seek"](**asked))
    if mine["error"]:
        return str(mine["error"]).split()[1] + (" after frames" if len(mine["counts"]) else "")
    reader = StreamReader(data)
    if reader.header.profile == MAIN:
        _assert_same(read_main_stream(stream=data), namespace()["read_main_stream"](stream=data))
    else:
        _assert_same(read_stream(stream=data), namespace()["read_stream"](stream=data))
    size = reader.header.width, reader.header.height
    if size[0] * size[1] <= MAX_PIXELS and sum(rendering_work(f.splats, *size) for f in reader) <= MAX_WORK_OF_SPEC:
        _assert_same(decode_stream_deterministic(stream=data), namespace()["decode_stream_deterministic"](stream=data))
    return ACCEPTED


def _assert_same(mine: dict[str, Any], theirs: dict[str, Any]) -> None:
    assert mine.keys() == theirs.keys()
    for name, value in mine.items():
        if isinstance(value, str):
            assert value == theirs[name], f"gsvc_ref says {value!r}, spec.md's decoder {theirs[name]!r}"
        else:
            assert (value.dtype, value.shape) == (theirs[name].dtype, theirs[name].shape), name
            assert value.tobytes() == theirs[name].tobytes(), f"{name} differ"
