"""Which syntax elements a stream or a plane has, and their values."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from gsvc_conformance.profiles import stated_profile

if TYPE_CHECKING:
    from gsvc_ref.bitstream.coder import Element
    from gsvc_ref.paper import FrameCodes, SplatBlock

Number = int | float
Values = dict[str, tuple[int, set[Number]]]
"""The number of occurrences (a run counts once) and the values of each element."""

IGNORED: Final = ("align", "payload", "unknown")
"""Entries of a reader's trace that are no elements."""


OF_MAIN: Final = {"quantizer_present": " (frame_body)", **dict.fromkeys(("lane_state", "word_count", "word"), " (run)")}
"""Elements of profile `main` whose names other structures have, too, and what is added to them."""


def values(stream: bytes) -> Values:
    """The values of every element of a stream and of all its layers, up to its fault if it has one."""
    from gsvc_base.errors import GsvcError
    from gsvc_ref.paper import FrameCodes
    from gsvc_ref.stream import StreamReader

    found: defaultdict[str, tuple[int, set[Number]]] = defaultdict(lambda: (0, set()))
    try:
        splats = 0
        for frame in StreamReader(stream, layer=None, trace=_recorder(found, stated_profile(stream))):
            if isinstance(frame.codes, FrameCodes):
                _note_codes(found, frame.codes, splats)
            splats = len(frame.splats)
    except GsvcError:
        pass
    return dict(found)


def used(stream: bytes) -> dict[str, tuple[Number, Number, int]]:
    """The least value, the largest, and the number of occurrences (a run counts once) of every element of a stream."""
    return {name: (min(some), max(some), times) for name, (times, some) in values(stream).items() if some}


def plane_values(data: bytes, inputs: Mapping[str, int]) -> Values:
    """The values of every element of one plane, given the other inputs of decode_plane."""
    from gsvc_ref.bitstream import SequenceHeader
    from gsvc_ref.bitstream.bit_reader import Reader
    from gsvc_ref.bitstream.planes import plane

    found: defaultdict[str, tuple[int, set[Number]]] = defaultdict(lambda: (0, set()))
    header = SequenceHeader(
        level=1,
        width=1,
        height=1,
        entropy_precision=inputs["entropy_precision"],
        lane_count=inputs["lane_count"],
    )
    plane(Reader(data, trace=_recorder(found)), header, "colors", "", inputs["count"], inputs["alphabet"])
    return dict(found)


def _note(found: defaultdict[str, tuple[int, set[Number]]], name: str, value: Any, times: int = 1) -> None:
    count, some = found[name]
    some.update([value] if isinstance(value, int) else np.unique(np.asarray(value)).tolist())
    found[name] = count + times, some


def _recorder(found: defaultdict[str, tuple[int, set[Number]]], profile: str = "paper") -> Callable[["Element"], None]:
    def record(element: "Element") -> None:
        name = element.name.rpartition(".")[2]
        if name == "frame_number_step, offset_step":
            _note(found, "frame_number_step", element.value[:, 0])
            _note(found, "offset_step", element.value[:, 1])
        elif name not in IGNORED and element.value is not None:
            value = element.value
            end = " (end)" if (element.category, name) == ("end", "frame_count") else ""
            end = OF_MAIN.get(name, end) if profile == "main" else end
            _note(found, name + end, int.from_bytes(value, "little") % 2**63 if isinstance(value, bytes) else value)

    return record


def _note_codes(found: defaultdict[str, tuple[int, set[Number]]], codes: "FrameCodes", reference_count: int) -> None:
    """The planes of a frame by their roles, and the counts that decide what is there."""
    if codes.survivors is not None:
        _note(found, "reference_count", reference_count)
        _note(found, "survivor_count", codes.survivor_count)
        if reference_count:
            _note(found, "survivor_map", codes.survivors.astype(np.int64))
    for block in (codes.inter, codes.intra):
        if block is not None:
            for name, symbols in _planes(block):
                _note(found, name, symbols, symbols.shape[1])


def _planes(block: "SplatBlock") -> Iterable[tuple[str, Any]]:
    """The planes of a block by role, each (count, planes)."""
    if block.positions is not None:
        yield "position_high", block.positions >> 8
        yield "position_low", block.positions & 255
    if block.cholesky is not None:
        yield "cholesky_code", block.cholesky
    if block.colors is not None:
        yield "color_index", block.colors
