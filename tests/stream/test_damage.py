"""Damaged streams: only GsvcError comes out, in the order of the checks (cuts, flipped bits: `tests/hostile`)."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gsvc_base.errors import GsvcError
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.stream import DecodedFrame, StreamReader
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

OVERVIEW = write_stream(replace(OVERVIEW_HEADER, parameter_checksum_flag=True), overview_frames())
RICH = write_stream(RICH_HEADER, rich_frames())


def decode(data: bytes) -> tuple[list[DecodedFrame], GsvcError | None]:
    frames = []
    try:
        for frame in StreamReader(data):
            frames.append(frame)
    except GsvcError as error:
        return frames, error
    return frames, None


@given(st.data())
@settings(max_examples=80)
def test_mutated_payloads_with_right_checksums(data: st.DataObject) -> None:
    """After the checksum, anything may stand: an error or splats come out, nothing else."""
    chunks = split_chunks(RICH)
    number = data.draw(st.integers(0, len(chunks) - 1))
    payload = bytearray(chunks[number][1])
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(payload)))
        how = data.draw(st.sampled_from(("flip", "set", "insert", "delete", "copy")))
        if how == "insert":
            payload[at:at] = data.draw(st.binary(max_size=6))
        elif how == "delete":
            del payload[at : at + data.draw(st.integers(1, 6))]
        elif how == "copy":
            payload[at:at] = payload[: data.draw(st.integers(0, 20))]
        elif at < len(payload):
            payload[at] = payload[at] ^ 1 << data.draw(st.integers(0, 7)) if how == "flip" else data.draw(BYTES)
    chunks[number] = chunks[number][0], bytes(payload)
    frames, error = decode(join_chunks(chunks, prefix=RICH[:PREFIX_SIZE]))
    assert error is None or error.bit is not None
    for frame in frames:
        assert np.isfinite(frame.splats.to_array()).all()


BYTES = st.sampled_from((0, 1, 0x7F, 0x80, 0xFF))


@given(st.lists(st.tuples(st.sampled_from([bytes([c]) for c in b"HIPREx"]), st.binary(max_size=60)), max_size=4))
@settings(max_examples=150)
def test_random_payloads(chunks: list[tuple[bytes, bytes]]) -> None:
    header = split_chunks(RICH)[0]
    decode(join_chunks([header, *chunks], prefix=RICH[:PREFIX_SIZE]))


@given(st.binary(max_size=80))
def test_random_bytes(data: bytes) -> None:
    for stream in (data, RICH[:10] + data, RICH + data + b"\0"):
        _, error = decode(stream)
        assert error is not None


def test_order_of_the_checks_of_a_chunk() -> None:
    """Section 10: of several faults of a chunk, the first in the stated order is reported."""
    data = bytearray(OVERVIEW)
    offset = decode(OVERVIEW)[0][1].offset
    crc_end = decode(OVERVIEW)[0][2].offset
    expected = []

    def report(rule: str, *edits: tuple[int, int], cut: int | None = None) -> None:
        broken = bytearray(data)
        for at, value in edits:
            broken[at] = value
        _, error = decode(bytes(broken[:cut]))
        assert error is not None
        expected.append((error.rule, rule))

    too_long = [(offset + 1, 0xFF), (offset + 2, 0xFF), (offset + 3, 0x7F)]
    report("R-6.2-1", (offset, ord("1")), *too_long, cut=offset + 10)
    report("R-5-3", (offset, ord("B")), *too_long, cut=offset + 10)
    report("R-6.2-4", (offset, ord("B")), cut=crc_end - 1)
    report("R-6.2-2", (offset, ord("B")))
    report("R-6.2-2", (offset, ord("H")))
    assert all(found == rule for found, rule in expected), expected


@pytest.mark.parametrize(
    ("lies", "rule"),
    [
        ([Lie("frame_number", 3, 1), Lie("new_splat_count", 99999)], "R-6.4-1"),
        ([Lie("new_splat_count", 99999), Lie("plane_mode", 3, 8)], "R-5-2"),
        ([Lie("cholesky_offset", [3e38], 1), Lie("parameter_checksum", 0)], "R-6.4-3"),
        ([Lie("frame_count", 2, 1), Lie("index_length", 0)], "R-6.8-1"),
        ([Lie("frame_count", 2, 0), Lie("frame_count", 4, 1)], "R-6.8-1"),
    ],
)
def test_order_of_the_elements(lies: list[Lie], rule: str) -> None:
    header = replace(OVERVIEW_HEADER, parameter_checksum_flag=True)
    _, error = decode(write_stream(header, overview_frames(), lies=lies))
    assert error is not None
    assert error.rule == rule


def test_a_damaged_file_is_accounted_for() -> None:
    cut = RICH[:1000]
    summary = StreamReader(cut).summary()
    assert summary.error is not None
    assert [frame.type for frame in summary.frames] == ["I", "P", "R"]
    end = summary.frames[-1].offset + summary.frames[-1].size
    assert summary.bits["unread"] == 8 * (1000 - end)
    assert sum(summary.bits.values()) == 8000 == 8 * summary.file_bytes
