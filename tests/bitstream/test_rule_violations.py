"""Each rule of spec.md sections 3 and 5 to 8 broken alone, checksums being right: the kind and rule that come out."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gsvc_ref.bitstream import SequenceHeader, StreamReader
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.errors import GsvcError
from gsvc_ref.reconstruction import FrameCodes, Quantizer, SplatBlock
from gsvc_ref.testing import (
    OVERVIEW_HEADER,
    RICH_HEADER,
    Lie,
    join_chunks,
    overview_frames,
    rich_frames,
    split_chunks,
    write_stream,
)

SPEC = (Path(__file__).parents[2] / "spec.md").read_text(encoding="utf-8")
Chunks = list[tuple[bytes, bytes]]


@dataclass(frozen=True)
class Case:
    """`stream` breaks `rule` and no other; `complete` frames precede the fault."""

    rule: str
    kind: str
    stream: Callable[[], bytes]
    complete: int


def rich(*lies: Lie, **header: Any) -> bytes:
    return write_stream(replace(RICH_HEADER, **header), rich_frames(), lies=lies)


def overview(*lies: Lie, index: bool = True, **header: Any) -> bytes:
    return write_stream(replace(OVERVIEW_HEADER, **header), overview_frames(), index=index, lies=lies)


def operated(edit: Callable[[Chunks], Chunks]) -> bytes:
    """The overview stream, without index, after an operation on its chunks H I P R E."""
    data = overview(index=False)
    return join_chunks(edit(split_chunks(data)), prefix=data[:PREFIX_SIZE])


def with_payload(number: int, edit: Callable[[bytes], bytes]) -> bytes:
    def operation(chunks: Chunks) -> Chunks:
        chunks[number] = chunks[number][0], edit(chunks[number][1])
        return chunks

    return operated(operation)


def end_of(frame_count: int) -> tuple[bytes, bytes]:
    return b"E", frame_count.to_bytes(4, "little") + bytes(4)


def flat_frames(count: int, offset: float, header: SequenceHeader) -> list[FrameCodes]:
    """`count` equal splats with l11 = l22 = `offset`, all of which stay; one more comes."""
    assert header.cholesky_bits
    quantizer = Quantizer(np.ones(3, np.float32), np.array([offset, 0, offset], np.float32))
    books = (np.zeros((1, 3), np.float16),)

    def block(n: int) -> SplatBlock:
        zeros = np.zeros((n, 3), np.uint16)
        return SplatBlock(zeros[:, :2], zeros, zeros[:, :1], quantizer, books)

    still = SplatBlock()
    return [
        FrameCodes.intra_frame(block(count)),
        FrameCodes.predicted_frame(np.ones(count, np.bool_), still, block(1)),
    ]


def flat(count: int, offset: float, *lies: Lie) -> bytes:
    header = replace(OVERVIEW_HEADER, width=400, height=300)
    return write_stream(header, flat_frames(count, offset, header), lies=lies)


def overflowing() -> bytes:
    """The Cholesky factors of an I-frame are 3e38, those of the difference too."""
    frames = overview_frames()
    quantizer = Quantizer(np.ones(3, np.float32), np.ones(3, np.float32))
    moved = SplatBlock(cholesky=np.zeros((1, 3), np.uint16), quantizer=quantizer)
    frames[1] = FrameCodes.predicted_frame(np.ones(1, np.bool_), moved)
    lies = [Lie("cholesky_offset", [3e38], channel) for channel in (1, 4)]
    return write_stream(OVERVIEW_HEADER, frames, lies=lies)


def colored(step: int, *lies: Lie) -> bytes:
    """An I-frame of two splats, whose indices into a codebook of 5 are 0 and `step`."""
    block = rich_frames()[0].intra
    assert block is not None
    assert block.positions is not None
    assert block.cholesky is not None
    colors = np.array([[0, 0], [step, 0]], np.uint16)
    few = replace(block, positions=block.positions[:2], cholesky=block.cholesky[:2], colors=colors)
    return write_stream(RICH_HEADER, [FrameCodes.intra_frame(few)], lies=lies)


def first_plus(amount: int) -> Callable[[Any], Any]:
    return lambda truth: [int(truth[0]) + amount, *truth[1:].tolist()]


def swapped_ends(truth: Any) -> Any:
    """Frequencies whose sum is right and whose last one is 0."""
    return [int(truth[0] + truth[-1]), *truth[1:-1].tolist(), 0]


def index_steps(row: int, column: int, value: int) -> Lie:
    def lie(truth: Any) -> Any:
        steps = truth.copy()
        steps[row, column] = value
        return steps

    return Lie("frame_number_step", lie)


INFINITE_HIGH_BYTE = 0x7C
OUT_OF_RANGE = [
    ("width", 0),
    ("height", 0),
    ("frame_rate_numerator", 0),
    ("frame_rate_denominator", 0),
    ("sample_aspect_numerator", 1),
    ("sample_aspect_denominator", 1),
    ("bit_depth", 7),
    ("bit_depth", 17),
    ("video_full_range_flag", 2),
    ("chroma_sample_loc_type", 6),
    ("cholesky_bits", 0),
    ("cholesky_bits", 13),
    ("color_stages", 0),
    ("color_stages", 9),
    ("color_codewords", 0),
    ("color_codewords", 1025),
    ("entropy_precision", 11),
    ("entropy_precision", 17),
    ("lane_count", 0),
    ("lane_count", 65),
]
RESERVED = [("profile", 1), ("level", 0), ("level", 6), ("flags", 2), ("flags", 0x80), ("chroma_format", 4)]

CASES = [
    Case("R-3.1-1", "malformed", lambda: overview(Lie("splat_count", b"\x81\x00")), 0),
    Case("R-3.1-1", "malformed", lambda: overview(Lie("frame_number", b"\xff\xff\xff\xff\x10", 1)), 1),
    Case("R-3.1-1", "malformed", lambda: overview(Lie("chunk_length", b"\xb0\x00", 1)), 0),
    Case("R-3.1-1", "malformed", lambda: overview(Lie("frame_number_step", b"\x80\x00\x01")), 3),
    Case("R-3.1-2", "invalid", lambda: overview(Lie("cholesky_offset", [np.inf])), 0),
    Case("R-3.1-2", "invalid", lambda: overview(Lie("cholesky_scale", [np.nan])), 0),
    Case("R-3.1-2", "invalid", lambda: overview(Lie("codeword", [0, -np.inf, 0])), 0),
    Case("R-3.1-3", "malformed", lambda: rich(Lie("frequency", "0" * 17 + "1" * 40)), 0),
    Case("R-3.1-4", "invalid", lambda: overview(Lie("align", 1)), 0),
    Case("R-3.1-4", "invalid", lambda: rich(Lie("align", 1, 5)), 0),
    *[Case("R-3.2-1", "unsupported", lambda n=n, v=v: overview(Lie(n, v)), 0) for n, v in RESERVED],
    Case("R-3.2-1", "unsupported", lambda: operated(lambda c: [*c[:2], (b"B", b""), *c[2:]]), 1),
    Case("R-3.2-1", "unsupported", lambda: operated(lambda c: [(b"Z", b""), *c]), 0),
    Case("R-5-1", "limit", lambda: overview(Lie("height", 8193)), 0),
    Case("R-5-2", "limit", lambda: overview(Lie("splat_count", 2**14 + 1)), 0),
    Case("R-5-2", "limit", lambda: overview(Lie("new_splat_count", 2**32 - 1)), 1),
    Case("R-5-2", "limit", lambda: flat(2**14 - 1, 0.01, Lie("new_splat_count", 2)), 1),
    Case("R-5-3", "limit", lambda: overview(Lie("chunk_length", 2**20 + 1, 1)), 0),
    Case("R-5-3", "limit", lambda: overview(Lie("chunk_length", 1025)), 0),
    Case("R-5-3", "limit", lambda: operated(lambda c: [*c[:2], (b"a", bytes(2**20 + 1)), *c[2:]]), 1),
    Case("R-5-4", "limit", lambda: flat(300, 1.0, Lie("cholesky_offset", [1e30]), Lie("cholesky_offset", [1e9], 2)), 0),
    Case("R-6.1-1", "malformed", lambda: b"", 0),
    Case("R-6.1-1", "malformed", lambda: overview()[:7], 0),
    Case("R-6.1-1", "malformed", lambda: overview(Lie("magic", b"\x89GSVC\n\x1a\n")), 0),
    Case("R-6.1-2", "unsupported", lambda: overview(Lie("version_major", 2)), 0),
    Case("R-6.1-3", "invalid", lambda: operated(lambda c: c[1:]), 0),
    Case("R-6.1-3", "invalid", lambda: operated(lambda c: [(b"a", b""), *c]), 0),
    Case("R-6.1-3", "invalid", lambda: operated(lambda c: [*c[:2], c[0], *c[2:]]), 1),
    Case("R-6.1-4", "invalid", lambda: overview() + b"\0", 3),
    Case("R-6.1-4", "invalid", lambda: operated(lambda c: [*c, (b"a", b"")]), 3),
    Case("R-6.1-5", "invalid", lambda: operated(lambda c: [(b"H", frame_count_unknown(c[0][1])), end_of(0)]), 0),
    Case("R-6.2-1", "malformed", lambda: operated(lambda c: [*c[:2], (b"1", b""), *c[2:]]), 1),
    Case("R-6.2-1", "malformed", lambda: operated(lambda c: [*c[:2], (b"\xe9", b""), *c[2:]]), 1),
    *[
        Case(
            "R-6.2-2",
            "malformed",
            lambda n=n: overview(Lie("chunk_crc", lambda crc: crc ^ 1 << 31, n)),
            min(max(0, n - 1), 3),
        )
        for n in range(6)
    ],
    *[Case("R-6.2-3", "malformed", lambda n=n: with_payload(n, lambda p: p + b"\0"), n - (n > 0)) for n in range(4)],
    *[Case("R-6.2-3", "malformed", lambda n=n: with_payload(n, lambda p: p[:-1]), n - (n > 0)) for n in range(5)],
    Case("R-6.2-3", "malformed", lambda: with_payload(4, lambda p: p + b"\0"), 3),
    Case("R-6.2-3", "malformed", lambda: overview(Lie("entry_count", 2)), 3),
    Case("R-6.2-3", "malformed", lambda: overview(Lie("entry_count", 0)), 3),
    Case("R-6.2-4", "malformed", lambda: overview()[:-1], 3),
    Case("R-6.2-4", "malformed", lambda: overview()[:9], 0),
    Case("R-6.2-4", "malformed", lambda: operated(lambda c: c[:-1]), 3),
    *[Case("R-6.3-1", "invalid", lambda n=n, v=v: overview(Lie(n, v)), 0) for n, v in OUT_OF_RANGE],
    Case("R-6.3-2", "invalid", lambda: overview(Lie("frame_count", 4)), 3),
    Case("R-6.4-1", "invalid", lambda: overview(Lie("frame_number", 1)), 0),
    Case("R-6.4-1", "invalid", lambda: overview(Lie("frame_number", 0, 1)), 1),
    Case("R-6.4-1", "invalid", lambda: overview(Lie("frame_number", 3, 2)), 2),
    Case("R-6.4-2", "invalid", lambda: operated(lambda c: [c[0], (b"R", b"\0"), end_of(1)]), 0),
    Case("R-6.4-2", "invalid", lambda: operated(lambda c: [c[0], (b"P", b"\0\0"), end_of(1)]), 0),
    *[Case("R-6.4-3", "invalid", lambda n=n: rich(Lie("parameter_checksum", 1, n)), n) for n in range(5)],
    *[Case("R-6.5-1", "unsupported", lambda v=v: overview(Lie("block_reserved", v)), 0) for v in (1, 4)],
    *[
        Case("R-6.5-2", "invalid", lambda n=n: overview(Lie(f"{n}_present", 0)), 0)
        for n in ("positions", "cholesky", "colors")
    ],
    Case("R-6.5-3", "invalid", lambda: overview(Lie("quantizer_present", 1, 1)), 1),
    Case("R-6.5-3", "invalid", lambda: overview(Lie("codebooks_present", 1, 1)), 1),
    Case("R-6.5-4", "invalid", lambda: overview(Lie("quantizer_present", 0)), 0),
    Case("R-6.5-4", "invalid", lambda: overview(Lie("codebooks_present", 0)), 0),
    Case(
        "R-6.5-4", "invalid", lambda: rich(Lie("quantizer_present", 0, 1)), 1
    ),  # what intra blocks have is not for inter
    Case("R-6.5-4", "invalid", lambda: rich(Lie("codebooks_present", 0, 3)), 3),  # an I-frame forgets
    *[
        Case("R-6.5-5", "invalid", lambda v=v: overview(Lie("cholesky_scale", [v], 1)), 0)
        for v in (0.0, -0.0, -1.0, 2.0**-127, 2.0**-149)
    ],
    *[Case("R-6.5-6", "invalid", lambda v=v: overview(Lie("stage_count", v)), 0) for v in (0, 2, 255)],
    *[Case("R-6.5-6", "invalid", lambda v=v: overview(Lie("codeword_count", v)), 0) for v in (0, 2, 65535)],
    Case("R-6.5-7", "invalid", lambda: overview(Lie("symbol", INFINITE_HIGH_BYTE)), 0),
    Case("R-6.5-7", "invalid", lambda: overview(Lie("symbol", INFINITE_HIGH_BYTE | 0x83, 9)), 1),
    Case("R-6.6-1", "unsupported", lambda: overview(Lie("plane_mode", 3)), 0),
    Case("R-6.6-2", "invalid", lambda: colored(0, Lie("color_index[1].symbol", 5)), 0),
    Case("R-6.6-2", "invalid", lambda: rich(Lie("color_index[1].first_symbol", 5)), 0),
    Case("R-6.6-2", "invalid", lambda: rich(Lie("color_index[1].last_symbol", 7)), 0),
    Case("R-6.6-2", "invalid", lambda: colored(1, Lie("color_index[1].symbol", [4, 7])), 0),
    Case("R-6.6-3", "invalid", lambda: rich(Lie("table_bits", 0)), 0),
    Case("R-6.6-3", "invalid", lambda: rich(Lie("table_bits", 13)), 0),
    Case("R-6.6-4", "invalid", lambda: rich(Lie("first_symbol", 4)), 0),
    Case("R-6.6-4", "invalid", lambda: rich(Lie("frequency", first_plus(1))), 0),
    Case("R-6.6-4", "invalid", lambda: rich(Lie("frequency", swapped_ends)), 0),
    Case("R-6.6-4", "invalid", lambda: rich(Lie("frequency", lambda f: swapped_ends(f[::-1])[::-1])), 0),
    Case("R-6.6-5", "invalid", lambda: rich(Lie("lane_state", lambda x: [x[0], 65535])), 0),
    Case("R-6.6-6", "malformed", lambda: rich(Lie("word_count", 4000)), 0),
    Case("R-7-1", "malformed", lambda: rich(Lie("lane_state", first_plus(1))), 0),
    Case("R-7-1", "malformed", lambda: rich(Lie("word_count", 4), Lie("word", lambda w: [*w, 0])), 0),
    Case("R-7-1", "malformed", lambda: rich(Lie("word_count", 2), Lie("word", lambda w: w[:-1])), 0),
    Case("R-7-1", "malformed", lambda: rich(Lie("word", first_plus(1))), 0),
    Case("R-6.7-1", "invalid", lambda: rich(index_steps(1, 0, 0)), 5),
    Case("R-6.7-1", "invalid", lambda: rich(index_steps(1, 1, 0)), 5),
    Case("R-6.7-1", "invalid", lambda: rich(index_steps(1, 1, 2000)), 5),
    Case("R-6.8-1", "invalid", lambda: overview(Lie("frame_count", 2, 1)), 3),
    Case("R-6.8-2", "invalid", lambda: overview(Lie("index_length", 0)), 3),
    Case("R-6.8-2", "invalid", lambda: overview(Lie("index_length", 1), index=False), 3),
    Case("R-8-1", "invalid", overflowing, 1),
]


def frame_count_unknown(header: bytes) -> bytes:
    return header[:19] + bytes(4) + header[23:]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.rule)
def test_fault(case: Case) -> None:
    frames = []
    data = case.stream()
    try:
        for frame in StreamReader(data):
            frames.append(frame)
    except GsvcError as fault:
        error = fault
    else:
        pytest.fail("no error")
    assert (error.kind, error.rule) == (case.kind, case.rule), str(error)
    assert len(frames) == case.complete
    assert error.bit is not None
    assert 0 <= error.bit <= 8 * len(data)


def test_without_lies_the_streams_are_legal() -> None:
    assert len(list(StreamReader(overview()))) == 3
    assert len(list(StreamReader(rich()))) == 5
    assert len(list(StreamReader(flat(300, 1.0)))) == 2
    assert len(list(StreamReader(operated(lambda chunks: chunks)))) == 3


NOT_BREAKABLE = {"R-3.3-1", "R-6.4-4"}
"""These bind a decoder; no stream can break them."""


def test_every_rule_has_a_case() -> None:
    rules = set(re.findall(r"\*\*(R-[3-8][\d.]*-\d+)\*\*", SPEC))
    assert {case.rule for case in CASES} == rules - NOT_BREAKABLE


def test_kinds_are_those_of_section_10() -> None:
    for kind in ("malformed", "limit"):
        row = next(line for line in SPEC.splitlines() if line.startswith(f"| `{kind}` |"))
        named = set(re.findall(r"R-[\d.]+-\d+", row))
        if kind == "limit":  # written as a range
            named |= {"R-5-2", "R-5-3"}
        assert {case.rule for case in CASES if case.kind == kind} == named
