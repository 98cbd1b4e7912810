"""The tools that make faulty streams change what they are told to change, and nothing else."""

from dataclasses import replace

import pytest

from gsvc_base.errors import UsageError
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.stream import StreamReader
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


def test_a_lie_changes_its_element_and_the_checksum() -> None:
    truth = write_stream(OVERVIEW_HEADER, overview_frames())
    lie = write_stream(OVERVIEW_HEADER, overview_frames(), lies=[Lie("matrix_coefficients", 9)])
    assert [at for at, (a, b) in enumerate(zip(truth, lie, strict=True)) if a != b] == [39, *range(48, 52)]
    assert StreamReader(lie).header == replace(OVERVIEW_HEADER, matrix_coefficients=9, frame_count=3)


@pytest.mark.parametrize("value", [16, b"\x10", "00010000", lambda truth: truth + 16])
def test_forms_of_a_value(value: object) -> None:
    lie = Lie("position_low[y].symbol", value)
    data = write_stream(OVERVIEW_HEADER, overview_frames(), lies=[lie])
    frame = next(iter(StreamReader(data)))
    assert frame.codes.intra is not None
    assert frame.codes.intra.positions is not None
    assert frame.codes.intra.positions[0, 1] & 0xFF == 16


def test_a_lie_that_is_never_told_is_an_error() -> None:
    for lie in (Lie("no_such_element", 0), Lie("width", 9, occurrence=1)):
        with pytest.raises(UsageError, match="never written"):
            write_stream(OVERVIEW_HEADER, overview_frames(), lies=[lie])


def test_chunks_come_apart_and_together() -> None:
    data = write_stream(RICH_HEADER, rich_frames())
    chunks = split_chunks(data)
    assert [chunk_type for chunk_type, _ in chunks] == [b"H", b"I", b"P", b"R", b"I", b"P", b"x", b"E"]
    assert join_chunks(chunks, prefix=data[:PREFIX_SIZE]) == data
