"""The syntax element that a fault is about, by the line of spec.md's code that found it: for those without gsvc_ref.

The code raises a `Fault` where it has read an element, or where the element does not fit. Which element that is, the
frames of the traceback tell: the variable that it was read into, or the variable that the offset came from.
"""

import re
from types import FrameType, TracebackType
from typing import Final

from gsvc_base.document import PATH

OFFSETS: Final = {
    "chunk_bit + 8": "chunk_length", "type_bit": "layer_type", "level_bit": "level", "bits[-1]": "quality_level",
    "bit": "quality_level",
    "chunk_bit": "chunk_type", "frame_count_bit": "frame_count", "map_bit": "survivor_map", "table_bit": "frequency",
    "first_bit": "frame_number_step", "word_bit": "word", "state_bit": "lane_state", "start": "position_high",
    'frame["checksum_bit"]': "parameter_checksum",
    "self.word_bit": "word", "self.state_bit": "lane_state", "self.end_bit": "raw_byte",
    "checksum_bit": "parameter_checksum",
}  # fmt: skip
"""Elements by the variable of an offset that is not that of the element that was read last."""
RUNS: Final = {"16 * 3": "codeword", "16 * word_count": "word", "32 * ": "lane_state", "count * w": "symbol"}
"""Elements by the size of a run that does not fit."""
PARTS: Final = {"scale": "cholesky_scale", "offset": "cholesky_offset", "codewords": "codeword", "table": "frequency",
                "symbols": "symbol", "payload": "payload", "states": "lane_state",
                "T": "density_family", "alphas": "halving_code", "words": "word"}  # fmt: skip
"""Elements by the variable that collects several of them."""
SUFFIXES: Final = {"read_block_flags": "_present"}
"""Ends of the names of elements, by the function that has them in a loop without it."""
FORWARDED: Final = ("read_splat_count", "read_symbol")
"""Functions that read an element whose name the caller knows."""

_READ: Final = re.compile(r"\b[ps]\.(?:u|le|uv|eg|f16|f32|raw)\(|= read_(?:splat_count|symbol)\(")
_TARGET: Final = re.compile(r'^\s*(?:if |elif )?(?:self\.)?(?:\w+\[")?(\w+)(?:"\])?(?: \+?= |\.append\()')
_LIMIT: Final = re.compile(r"check_limit\(.*, (\w+), state\)$")
_RAISE: Final = re.compile(r"raise Fault\(.*, (.*?)\)$")


def element_found(traceback: TracebackType | None) -> str:
    """The name of the element that a fault of spec.md's code is about; empty where it is none."""
    frames: list[tuple[FrameType, int]] = []
    while traceback is not None:
        if traceback.tb_frame.f_code.co_filename == str(PATH):
            frames.append((traceback.tb_frame, traceback.tb_lineno))
        traceback = traceback.tb_next
    lines = PATH.read_text(encoding="utf-8").splitlines()
    outside = [place for place in frames if type(place[0].f_locals.get("self")).__name__ != "Bits"]
    if len(outside) == len(frames):
        return _raised(outside, lines)
    if (run := re.search(r"\.need\((.*)\)", lines[outside[-1][1] - 1])) is not None:
        return next((name for size, name in RUNS.items() if size in run[1]), "")
    return _read(outside, lines)


def _raised(frames: list[tuple[FrameType, int]], lines: list[str]) -> str:
    """The element of a fault that was raised after an element: by the offset, or the last one read before."""
    frame, number = frames[-1]
    offset = _RAISE.search(lines[number - 1])
    if frame.f_code.co_name == "check_limit":  # whose caller names the offset
        offset = _LIMIT.search(lines[frames[-2][1] - 1])
    if offset and offset[1] not in ("p.element", "s.element"):
        return next((name for variable, name in OFFSETS.items() if offset[1].startswith(variable)), "")
    before = range(number - 1, frame.f_code.co_firstlineno - 1, -1)
    return _read([*frames[:-1], (frame, next((n for n in before if _READ.search(lines[n - 1])), number))], lines)


def _read(frames: list[tuple[FrameType, int]], lines: list[str]) -> str:
    """The element that a line reads."""
    frame, number = frames[-1]
    if frame.f_code.co_name in FORWARDED and len(frames) > 1:
        return _read(frames[:-1], lines)
    if "MAGIC" in lines[number - 1]:
        return "magic"
    if "[name]" in lines[number - 1]:  # in a loop over elements by name
        return str(frame.f_locals["name"]) + SUFFIXES.get(frame.f_code.co_name, "")
    if ".align()" in lines[number - 1]:
        return "align()"
    target = _TARGET.search(lines[number - 1])
    name = target[1] if target else ""
    return PARTS.get(name, name)
