"""Decisions of an encode as the payload of an ancillary chunk of type ``d`` (spec.md section 6.9), and back.

The payload holds no times, so that the same encode gives the same bytes, and of most numbers one digit. It is written
column by column, effect after effect within each, because most of them hardly change, and deflated.
"""

import struct
import zlib
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.encoder.decisions import CAUSE_NAMES, MAX_VALUE, Decision
from gsvc_ref.encoder.effects import EFFECT_NAMES
from gsvc_ref.errors import UsageError

SIGNATURE: Final = b"DEC\x01"
"""What such a payload begins with: applications may give the type another meaning. The last byte is the version."""

NO_VALUE: Final = MAX_VALUE + 1

MAX_STEPS: Final = (1 << 32) - 1

COLUMNS: Final = (("u1", "cause"), ("u1", "done"), ("<u2", "value"), ("<u4", "iterations"), ("<u4", "saved"))
"""The type of a number and what it is. The bytes of wider numbers stand in planes, lowest first."""

_PLANES: Final = sum(np.dtype(kind).itemsize for kind, _ in COLUMNS)


def pack(frames: Sequence[Sequence[Decision]]) -> bytes:
    """The payload for the decisions of all frames, each with one decision per effect in the order of `EFFECT_NAMES`."""
    decided = [frame[number] for number, _ in enumerate(EFFECT_NAMES) for frame in frames]
    numbers: dict[str, list[int]] = {
        "cause": [CAUSE_NAMES.index(one.cause) for one in decided],
        "done": [int(one.done) for one in decided],
        "value": [NO_VALUE if (value := one.stored) is None else value for one in decided],
        "iterations": [min(one.iterations, MAX_STEPS) for one in decided],
        "saved": [min(one.saved, MAX_STEPS) for one in decided],
    }
    body = b"".join(_planes(np.array(numbers[name], kind)) for kind, name in COLUMNS)
    deflater = zlib.compressobj(9, wbits=-15)
    return SIGNATURE + struct.pack("<I", len(frames)) + deflater.compress(body) + deflater.flush()


def unpack(payload: bytes, frame_count: int) -> list[tuple[Decision, ...]]:
    """The decisions of all frames, whatever the payload is: never more memory than the number of frames calls for.

    Parameters
    ----------
    payload
        Of a chunk of type `gsvc_ref.bitstream.chunks.DECISIONS`.
    frame_count
        Frames of the stream that it was found in.

    Raises
    ------
    UsageError
        The payload is no such table, or not one of so many frames.
    """
    if payload[: len(SIGNATURE)] != SIGNATURE or len(payload) < len(SIGNATURE) + 4:
        raise UsageError("the chunk of type d is not one of decisions, or of a later version")
    (count,) = struct.unpack_from("<I", payload, len(SIGNATURE))
    if count != frame_count:
        raise UsageError(f"the chunk of decisions is about {count} frames, and the stream has {frame_count}")
    size = _PLANES * len(EFFECT_NAMES) * count
    inflater = zlib.decompressobj(-15)
    try:
        body = inflater.decompress(payload[len(SIGNATURE) + 4 :], size + 1)
    except zlib.error as error:
        raise UsageError(f"the chunk of decisions cannot be inflated: {error}") from None
    if len(body) != size or not inflater.eof or inflater.unused_data:
        raise UsageError("the chunk of decisions has another length than its frames need")
    columns = _columns(body, len(EFFECT_NAMES) * count)
    if int(columns["cause"].max(initial=0)) >= len(CAUSE_NAMES):
        raise UsageError("the chunk of decisions gives a reason that this version does not know")
    if int(columns["done"].max(initial=0)) > 1:
        raise UsageError("the chunk of decisions has a flag that is neither 0 nor 1")
    rows = zip(*(columns[name].tolist() for _, name in COLUMNS), strict=True)
    decided = [
        Decision(
            EFFECT_NAMES[n // count], bool(done), CAUSE_NAMES[cause], None if value == NO_VALUE else value, made, saved
        )
        for n, (cause, done, value, made, saved) in enumerate(rows)
    ]
    return [tuple(decided[n::count]) for n in range(count)]


def _planes(numbers: NDArray[Any]) -> bytes:
    """The bytes of numbers, all lowest ones first."""
    return numbers.view(np.uint8).reshape(len(numbers), numbers.itemsize).T.tobytes()


def _columns(body: bytes, count: int) -> dict[str, NDArray[Any]]:
    """The columns of so many numbers each."""
    columns, at = {}, 0
    for kind, name in COLUMNS:
        size = np.dtype(kind).itemsize
        planes = np.frombuffer(body, np.uint8, size * count, at).reshape(size, count)
        columns[name] = np.ascontiguousarray(planes.T).view(kind).reshape(count)
        at += size * count
    return columns
