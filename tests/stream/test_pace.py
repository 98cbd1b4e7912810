"""Paced streams: the limits of a second, when reading, seeking, salvaging and writing (spec.md section 5)."""

import io
from dataclasses import replace

import pytest

from gsvc_base.errors import GsvcError, UsageError
from gsvc_conformance.cases.building import HEADER
from gsvc_conformance.cases.pace import BYTES, LARGEST, PAPER, group, paced, padded
from gsvc_ref.bitstream import LEVELS
from gsvc_ref.paper import FrameCodes
from gsvc_ref.stream import Gap, StreamReader, StreamWriter

EMPTY, REPEATED = FrameCodes.intra_frame(None), FrameCodes.repeated_frame()
LATE = paced([EMPTY, *[REPEATED] * 6, EMPTY, REPEATED], frame_rate_numerator=1)
"""Frames 4 to 6 break R-5-8, and are sound."""


def written(frames: list[FrameCodes], **header: object) -> StreamWriter:
    writer = StreamWriter(io.BytesIO(), replace(HEADER, paced_flag=True, **header))
    for codes in frames:
        writer.write_frame(codes)
    return writer


def test_the_flag_is_told() -> None:
    reader = StreamReader(paced([EMPTY]))
    assert reader.header.paced_flag
    assert not reader.header.parameter_checksum_flag
    assert reader.header.frames_of_second == 25


@pytest.mark.parametrize(("rate", "frames"), [((30000, 1001), 30), ((1, 7), 1), ((2**32 - 1, 1), 2**32 - 1)])
def test_a_second_has_as_many_frames_as_the_rate_rounded_up(rate: tuple[int, int], frames: int) -> None:
    header = replace(HEADER, frame_rate_numerator=rate[0], frame_rate_denominator=rate[1])
    assert header.frames_of_second == frames


def test_frames_before_the_one_that_is_too_much_are_yielded() -> None:
    reader = StreamReader(paced(group(EMPTY, 70), **LARGEST, frame_rate_numerator=70))
    numbers = []
    with pytest.raises(GsvcError, match="with frame 64, second 0 has 8519680 pixels; level 1 allows 8388608") as fault:
        numbers.extend(frame.number for frame in reader)
    assert numbers == list(range(64))
    assert (fault.value.kind, fault.value.rule) == ("limit", "R-5-7")


def test_who_seeks_checks_no_pace() -> None:
    data = paced([EMPTY, *[REPEATED] * 3, EMPTY, *[REPEATED] * 8], frame_rate_numerator=1)
    assert [frame.number for frame in StreamReader(data).frames(4)] == list(range(4, 13))
    with pytest.raises(GsvcError, match="R-5-8"):
        list(StreamReader(data))


def test_salvage_says_what_comes_too_fast_and_goes_on() -> None:
    parts = list(StreamReader(LATE).salvage())
    gaps = [part for part in parts if isinstance(part, Gap)]
    assert [part.number for part in parts if not isinstance(part, Gap)] == list(range(9))
    assert [[fault.rule for fault in gap.faults] for gap in gaps] == [["R-5-8"]]
    assert (gaps[0].missing_count, gaps[0].skipped) == (0, 0)
    assert "no frame is missing, but" in str(gaps[0])


def test_salvage_loses_no_frame_to_the_sums_of_a_second() -> None:
    data = paced([*group(EMPTY, 2), *PAPER.heavy(10)], **LARGEST, frame_rate_numerator=20)
    parts = list(StreamReader(data).salvage())
    assert [part.number for part in parts if not isinstance(part, Gap)] == list(range(12))
    assert [fault.rule for part in parts if isinstance(part, Gap) for fault in part.faults] == ["R-5-7"]


def test_behind_damage_nothing_counts() -> None:
    """A damaged ancillary chunk as long as a second may be: what was skipped belongs to no frame."""
    data = bytearray(padded(PAPER.two_seconds(), 2, (2, 3), BYTES + 1))
    data[len(data) // 2] ^= 1
    parts = list(StreamReader(bytes(data)).salvage())
    assert [part.number for part in parts if not isinstance(part, Gap)] == [0, 1, 2, 3]
    assert [fault.rule for part in parts if isinstance(part, Gap) for fault in part.faults] == ["R-6.2-2"]


def test_a_writer_refuses_a_late_frame_and_writes_nothing() -> None:
    writer = written([EMPTY, *[REPEATED] * 3], frame_rate_numerator=1)
    before = writer.offset
    with pytest.raises(UsageError, match=r"R-5-8.*write an I-frame here"):
        writer.write_frame(REPEATED)
    assert (writer.offset, writer.frame_count) == (before, 4)
    writer.write_frame(EMPTY)
    writer.finish()


@pytest.mark.parametrize(
    ("frames", "header", "what"),
    [
        (group(EMPTY, 64), {**LARGEST, "frame_rate_numerator": 65}, "pixels"),
        (group(PAPER.equal(LEVELS[1].splats), 64), {"frame_rate_numerator": 65}, "splats"),
        (PAPER.heavy(8), {**LARGEST, "frame_rate_numerator": 10}, "pairs of rendering work"),
    ],
)
def test_a_writer_refuses_what_is_too_much_for_a_second(
    frames: list[FrameCodes], header: dict[str, int], what: str
) -> None:
    writer = written(frames, **header)
    with pytest.raises(UsageError, match=f"{what}; level 1 allows .* .R-5-7.*fewer splats"):
        writer.write_frame(REPEATED)


def test_a_writer_counts_ancillary_chunks_with_the_frame_behind_them() -> None:
    writer = written([EMPTY], frame_rate_numerator=2)
    writer.write_ancillary("a", bytes(LEVELS[1].payload - 10))
    with pytest.raises(UsageError, match=r"second 0 has .* bytes"):
        writer.write_frame(REPEATED)
    writer = written([EMPTY, REPEATED], frame_rate_numerator=2)
    writer.write_ancillary("a", bytes(LEVELS[1].payload - 20))
    writer.write_frame(REPEATED)


def test_what_a_writer_accepts_a_reader_accepts() -> None:
    target = io.BytesIO()
    writer = StreamWriter(target, replace(HEADER, paced_flag=True, frame_rate_numerator=10, **LARGEST))
    for codes in [*group(EMPTY, 2), *PAPER.heavy(16)]:
        writer.write_frame(codes)
    writer.finish(("d", b"a log"))
    assert len(list(StreamReader(target.getvalue()))) == 18
