"""Salvaging damaged streams: every frame that is sound comes out, bit for bit, and every other one is in a gap."""

import io
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from salvage_checks import Salvaged, salvage

from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.bitstream.chunks import END_CHUNK_SIZE, PREFIX_SIZE
from gsvc_ref.stream import Gap, StreamReader
from gsvc_ref.testing import (
    OVERVIEW_HEADER,
    RICH_HEADER,
    Lie,
    Stream,
    join_chunks,
    overview_frames,
    rich_frames,
    split_chunks,
    streams,
    write_stream,
)

CODES = [*rich_frames(), *rich_frames()]
TYPES = "IPRIPIPRIP"
GOOD = write_stream(RICH_HEADER, CODES, ancillary={6: ("t", b"a remark")})
FRAMES = list(StreamReader(GOOD))
TRUTH = [frame.splats for frame in FRAMES]
TOTAL = len(FRAMES)

PREFIX, CHUNKS = GOOD[:PREFIX_SIZE], split_chunks(GOOD)
KINDS = "".join(kind.decode() for kind, _ in CHUNKS)


def offsets() -> list[int]:
    """Where each chunk of `GOOD` begins, and the end of the file."""
    return [len(join_chunks(CHUNKS[:n], prefix=PREFIX)) for n in range(len(CHUNKS) + 1)]


OFFSETS = offsets()


def check(data: bytes, *, total: int | None = TOTAL) -> Salvaged:
    return salvage(data, TRUTH, total=total)


def lost_with(number: int) -> list[int]:
    """The frames that are lost with a frame: up to the next I-frame."""
    end = TYPES.find("I", number + 1)
    return list(range(number, end if end > 0 else TOTAL))


def altered(data: bytes, *places: int) -> bytes:
    changed = bytearray(data)
    for place in places:
        changed[place] ^= 0x55
    return bytes(changed)


def test_the_stream_of_the_tests() -> None:
    assert KINDS == "HIPRIPItPRIPxE"
    assert OFFSETS[-1] == len(GOOD)


@given(streams(max_count=10))
@settings(max_examples=15)
def test_a_sound_stream_has_no_gaps(stream: Stream) -> None:
    result = salvage(stream.data, stream.splats, total=len(stream.splats))
    assert result.gaps == []
    assert len(result.frames) == len(stream.splats)


@pytest.mark.parametrize("where", ["type", "length", "payload", "last byte", "checksum"])
@pytest.mark.parametrize("chunk", range(1, len(CHUNKS)))
def test_damage_of_each_chunk(chunk: int, where: str) -> None:
    """Damage of a frame loses it and those that follow up to the next I-frame; other damage loses none."""
    begin, end = OFFSETS[chunk], OFFSETS[chunk + 1]
    place = {"type": begin, "length": begin + 1, "payload": end - 5, "last byte": end - 1, "checksum": end - 4}[where]
    result = check(altered(GOOD, place))
    frame = sum(kind in "IPR" for kind in KINDS[:chunk])
    expected = lost_with(frame) if KINDS[chunk] in "IPR" else []
    assert result.missing == expected
    assert len(result.frames) == TOTAL - len(expected)
    (gap,) = result.gaps
    assert gap.fault_count == 1
    assert gap.offset == begin
    assert gap.skipped >= end - begin


def test_a_sound_chunk_that_is_no_frame_is_not_skipped() -> None:
    """The remark before frame 6 stands in the gap of frames 5 to 7."""
    (gap,) = check(altered(GOOD, FRAMES[5].offset + 50)).gaps
    assert gap.size - gap.skipped == OFFSETS[8] - OFFSETS[7]


@pytest.mark.parametrize("place", [0, 7, 8, PREFIX_SIZE, PREFIX_SIZE + 1, PREFIX_SIZE + 12, OFFSETS[1] - 1])
def test_without_a_sound_beginning_nothing_is_salvaged(place: int) -> None:
    with pytest.raises(GsvcError):
        StreamReader(altered(GOOD, place))


def test_every_truncation() -> None:
    """What is left is what plain reading finds, and the rest is missing as far as the header tells."""
    overview = write_stream(OVERVIEW_HEADER, overview_frames())
    truth = list(StreamReader(overview))
    beginning = truth[0].offset
    for size in range(beginning, len(overview), 3):
        result = salvage(overview[:size], [frame.splats for frame in truth], total=3)
        assert len(result.frames) == sum(frame.offset + frame.size <= size for frame in truth)
        assert [gap.faults[0].rule for gap in result.gaps] == ["R-6.2-4"]
        assert len(result.missing) == 3 - len(result.frames)
    for size in [*OFFSETS[1:-1], *range(OFFSETS[1], len(GOOD), 97)]:
        result = check(GOOD[:size])
        assert len(result.frames) == sum(frame.offset + frame.size <= size for frame in FRAMES)


def test_a_cut_stream_of_unknown_length_says_so() -> None:
    data = write_stream(RICH_HEADER, CODES, lies=[Lie("frame_count", 0)])
    cut = data[: FRAMES[4].offset + 3]
    (gap,) = salvage(cut, TRUTH).gaps
    assert gap.missing_count is None
    assert str(gap).startswith("frames from 4 on are missing, if there were any: the stream ends inside `payload`")
    whole_frames = data[: -END_CHUNK_SIZE - 1]
    assert [gap.missing_count for gap in salvage(whole_frames, TRUTH).gaps] == [None]


def test_a_length_that_reaches_beyond_the_end() -> None:
    """Plain reading takes that for a cut; the frames after are found all the same."""
    place = FRAMES[1].offset + 2  # the second byte of a length of two
    data = GOOD[:place] + b"\x7f" + GOOD[place + 1 :]
    result = check(data)
    assert result.gaps[0].faults[0].rule == "R-6.2-4"
    assert result.missing == lost_with(1)


def inserted(place: int, junk: bytes) -> bytes:
    return GOOD[:place] + junk + GOOD[place:]


@pytest.mark.parametrize("junk", [b"\0", b"I", b"P\0\0\0\0\0", bytes(300), b"I\xff\xff\x3f" * 100, GOOD[:40]])
def test_garbage_between_chunks_loses_nothing(junk: bytes) -> None:
    for begin in OFFSETS[1:]:
        result = check(inserted(begin, junk))
        assert result.missing == []
        assert len(result.gaps) == 1
        assert result.gaps[0].size == len(junk)


def test_garbage_inside_a_frame_loses_it() -> None:
    for frame in FRAMES:
        result = check(inserted(frame.offset + 6, b"garbage"))
        assert result.missing == lost_with(frame.number)


@pytest.mark.parametrize("count", [1, 2, 9])
def test_deleted_bytes_lose_the_frame_they_were_in(count: int) -> None:
    for frame in FRAMES:
        data = GOOD[: frame.offset + 1] + GOOD[frame.offset + 1 + count :]
        result = check(data)
        assert result.missing == lost_with(frame.number)


@pytest.mark.parametrize("size", [64, 512])
@pytest.mark.parametrize("value", [0, 0xFF])
def test_lost_blocks_of_a_disk(size: int, value: int) -> None:
    for begin in range(-(-OFFSETS[1] // size) * size, len(GOOD), size):
        end = min(begin + size, len(GOOD))
        result = check(GOOD[:begin] + bytes([value]) * (end - begin) + GOOD[end:])
        hit = [frame.number for frame in FRAMES if frame.offset < end and frame.offset + frame.size > begin]
        assert result.missing == sorted({lost for number in hit for lost in lost_with(number)})


def test_two_damaged_places_are_two_gaps() -> None:
    result = check(altered(GOOD, FRAMES[2].offset + 5, FRAMES[6].offset + 5))
    assert [(gap.first_missing, gap.missing_count) for gap in result.gaps] == [(2, 1), (6, 2)]


def test_damage_while_frames_are_skipped_belongs_to_the_same_gap() -> None:
    (gap,) = check(altered(GOOD, *(frame.offset + 5 for frame in FRAMES[5:7]))).gaps
    assert (gap.first_missing, gap.missing_count, gap.fault_count) == (5, 3, 2)
    assert "and 1 more fault;" in str(gap)


def test_all_i_frames_damaged() -> None:
    result = check(altered(GOOD, *(frame.offset + 5 for frame in FRAMES if frame.type == "I")))
    assert result.frames == []
    assert result.missing == list(range(TOTAL))


def test_all_but_the_first_frame_is_garbage() -> None:
    rng = np.random.default_rng(5)
    end = FRAMES[1].offset
    result = check(GOOD[:end] + rng.bytes(len(GOOD) - end))
    assert [frame.number for frame in result.frames] == [0]
    assert result.missing == list(range(1, TOTAL))


def rearranged(*order: int) -> bytes:
    """The chunks of `GOOD` in another order."""
    return join_chunks([CHUNKS[n] for n in order], prefix=PREFIX)


def test_frames_that_were_taken_out_without_a_trace() -> None:
    result = check(rearranged(0, 1, 2, 3, 6, 7, 8, 9, 10, 11, 13))  # frames 3 and 4, and the index
    assert result.missing == [3, 4]
    assert [(gap.size, gap.faults[0].rule) for gap in result.gaps] == [(0, "R-6.4-1"), (0, "R-6.8-2")]
    result = check(rearranged(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 13))  # the last two
    assert result.missing == [8, 9]
    assert [(gap.size, gap.faults[0].rule) for gap in result.gaps] == [(0, "R-6.8-1")]
    result = check(rearranged(0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13))  # the first
    assert result.missing == [0, 1, 2]


def test_frames_that_come_again_or_too_late_are_skipped() -> None:
    result = check(rearranged(0, 1, 2, 3, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 13))
    assert result.missing == []
    assert [frame.number for frame in result.frames] == list(range(TOTAL))
    result = check(rearranged(0, 1, 2, 3, 6, 4, 5, 8, 9, 10, 11, 13))  # frame 5 comes before 3 and 4
    assert result.missing == [3, 4]
    assert {fault.rule for gap in result.gaps for fault in gap.faults} >= {"R-6.4-1"}


def test_what_follows_the_end_is_not_decoded() -> None:
    for more in (b"\0", GOOD, GOOD[PREFIX_SIZE:], bytes(1000)):
        result = check(GOOD + more)
        assert result.missing == []
        (gap,) = result.gaps
        assert (gap.offset, gap.size, gap.skipped) == (len(GOOD), len(more), len(more))
        assert gap.faults[0].rule == "R-6.1-4"


def test_frames_of_another_stream_are_not_taken() -> None:
    """A recording that was cut, and another one after it in the same file; both have the same header."""
    other = write_stream(RICH_HEADER, [*rich_frames(30), *rich_frames(30)])
    for cut in (FRAMES[2].offset, FRAMES[4].offset + 9, FRAMES[9].offset):
        result = check(GOOD[:cut] + other)
        assert len(result.frames) == sum(frame.offset + frame.size <= cut for frame in FRAMES)
        (gap,) = result.gaps
        assert "R-6.1-3" in [fault.rule for fault in gap.faults]
    result = check(GOOD[: FRAMES[3].offset] + other + GOOD[FRAMES[3].offset :])
    assert result.missing == []
    cut_in_two = other[: len(other) // 2]  # has no end chunk of its own: the first stream's is the next
    assert check(GOOD[: FRAMES[3].offset] + cut_in_two + GOOD[FRAMES[3].offset :]).missing == list(range(3, TOTAL))


def test_a_stream_inside_of_a_damaged_chunk_is_not_taken() -> None:
    other = write_stream(RICH_HEADER, [*rich_frames(30), *rich_frames(30)])
    data = write_stream(RICH_HEADER, CODES, ancillary={4: ("t", other)})
    begin = FRAMES[4].offset
    for place in (begin, begin + 1, begin + 2, begin + 30, begin + 500):
        assert check(altered(data, place)).missing == []


@pytest.mark.parametrize(
    ("lie", "rule", "missing"),
    [
        (Lie("block_reserved", 1, 0), "R-6.5-1", [0, 1, 2]),
        (Lie("parameter_checksum", 0, 1), "R-6.4-3", [1, 2]),
        (Lie("parameter_checksum", 0, 7), "R-6.4-3", [7]),
        (Lie("frame_number", 2, 1), "R-6.4-1", [1, 2]),
        (Lie("frame_number", 0, 4), "R-6.4-1", [4]),
        (Lie("frame_number", b"\xff\xff\xff\xff\xff\xff", 4), "R-3.1-1", [4]),
        (Lie("new_splat_count", 99999, 1), "R-5-2", [4]),
        (Lie("frame_count", 9, 1), "R-6.8-1", []),
        (Lie("index_length", 9), "R-6.8-2", []),
        (Lie("entry_count", 9), "R-6.2-3", []),
        (Lie("frame_number_step", lambda steps: steps[::-1]), "R-6.7-1", []),
    ],
)
def test_faults_behind_right_checksums(lie: Lie, rule: str, missing: list[int]) -> None:
    result = check(write_stream(RICH_HEADER, CODES, lies=[lie]))
    assert [gap.faults[0].rule for gap in result.gaps] == [rule]
    assert result.missing == missing


def test_an_unknown_critical_chunk_makes_the_state_unknown() -> None:
    for after, missing in ((3, []), (4, [4]), (1, [1, 2])):  # behind frames 2, 3 and 0
        order = [*CHUNKS[: after + 1], (b"B", b"?"), *CHUNKS[after + 1 :]]
        result = check(join_chunks([chunk for chunk in order if chunk[0] != b"x"], prefix=PREFIX))
        assert result.gaps[0].faults[0].rule == "R-3.2-1"
        assert result.missing == missing


def test_ranges_are_parts_of_the_whole() -> None:
    for index in (True, False):  # found by it, or decoded from the start
        good = write_stream(RICH_HEADER, CODES, index=index)
        data = altered(good, FRAMES[1].offset + 5, FRAMES[6].offset + 5)
        whole = salvage(data, TRUTH, total=TOTAL)
        for start in range(TOTAL + 2):
            for stop in (None, start, start + 1, start + 4):
                part = list(StreamReader(data).salvage(start, stop))
                asked = range(start, TOTAL if stop is None else min(stop, TOTAL))
                found = Salvaged(part)
                assert [frame.number for frame in found.frames] == [n for n in asked if n not in whole.missing]
                assert found.missing == [n for n in asked if n in whole.missing]
                assert {gap.faults[0].bit for gap in found.gaps} <= {gap.faults[0].bit for gap in whole.gaps}


def test_sound_frames_of_a_gap_are_told_apart() -> None:
    def words(data: bytes, start: int = 0, stop: int | None = None) -> str:
        (gap,) = Salvaged(list(StreamReader(data).salvage(start, stop))).gaps
        return str(gap).split(":")[0]

    last = altered(GOOD, FRAMES[6].offset + 5)
    assert words(last) == "frames 6 to 7 are missing, 7 because predicted from missing ones"
    assert words(last, 0, 7) == "frame 6 is missing"
    assert words(last, 7, 9) == "frame 7 is missing, because predicted from missing ones"
    assert words(altered(GOOD, FRAMES[0].offset + 5)) == (
        "frames 0 to 2 are missing, 1 to 2 because predicted from missing ones"
    )
    assert words(altered(last, FRAMES[7].offset + 1)) == "frames 6 to 7 are missing"
    assert words(altered(GOOD, FRAMES[0].offset + 5, FRAMES[2].offset + 5)) == "frames 0 to 2 are missing"
    assert words(GOOD + b"more").startswith("no frame is missing, but something follows the end chunk")


def test_a_file_that_grows_while_it_is_read() -> None:
    """The account is of what was read, when that is more than there was at the beginning."""
    file = io.BytesIO()
    file.write(GOOD[: FRAMES[1].offset])
    file.seek(0)
    reader = StreamReader(file)
    file.seek(0, 2)
    file.write(GOOD[FRAMES[1].offset :])
    file.seek(FRAMES[0].offset)
    summary = reader.summary()
    assert summary.error is None
    assert summary.file_bytes == len(GOOD)
    assert sum(summary.bits.values()) == 8 * len(GOOD)
    assert summary.bits["unread"] == 0


def test_ranges_that_make_no_sense_and_pipes_are_refused() -> None:
    with pytest.raises(UsageError, match="start"):
        StreamReader(GOOD).salvage(3, 2)

    class Pipe(io.BytesIO):
        def seekable(self) -> bool:
            return False

    for use in (lambda reader: reader.salvage(), lambda reader: reader.summary(salvage=True)):
        with pytest.raises(UsageError, match="needs a file"):
            use(StreamReader(Pipe(GOOD)))


def test_the_account_of_a_damaged_stream() -> None:
    data = altered(GOOD, FRAMES[1].offset + 5, FRAMES[9].offset + 5)
    result = check(data)
    reader = StreamReader(data)
    assert [str(part) if isinstance(part, Gap) else part.offset for part in reader.salvage()] == [
        str(part) if isinstance(part, Gap) else part.offset for part in result.parts
    ]
    summary = reader.summary(salvage=True)
    assert summary.error is None
    assert [frame.number for frame in summary.frames] == [frame.number for frame in result.frames]
    assert [str(gap) for gap in summary.gaps] == [str(gap) for gap in result.gaps]
    assert sum(summary.bits.values()) == 8 * len(data)
    assert summary.bits["skipped"] == 8 * sum(gap.skipped for gap in result.gaps)
    assert reader.summary().gaps == []


def test_several_iterations_at_once() -> None:
    reader = StreamReader(altered(GOOD, FRAMES[4].offset + 5))
    pairs = list(zip(reader.salvage(), reader.salvage(), strict=True))
    assert len(pairs) == TOTAL
    assert all(str(a) == str(b) if isinstance(a, Gap) else a.offset == b.offset for a, b in pairs)


@st.composite
def damages(draw: st.DrawFn) -> bytes:
    """`GOOD`, with its beginning, after one to five accidents."""
    data = bytearray(GOOD)
    begin = OFFSETS[1]
    for _ in range(draw(st.integers(1, 5))):
        at = draw(st.one_of(st.integers(begin, len(data)), st.sampled_from([n for n in OFFSETS[1:] if n <= len(data)])))
        size = draw(st.one_of(st.integers(1, 8), st.integers(1, 600)))
        how = draw(st.sampled_from(("flip", "zero", "noise", "insert", "delete", "repeat", "move", "cut")))
        noise = np.random.default_rng(draw(st.integers(0, 999))).bytes(size)
        if how == "flip":
            data[at : at + 1] = bytes(byte ^ 1 << size % 8 for byte in data[at : at + 1])
        elif how in ("zero", "noise"):
            length = len(data[at : at + size])
            data[at : at + size] = (bytes(size) if how == "zero" else noise)[:length]
        elif how == "insert":
            data[at:at] = noise
        elif how == "delete":
            del data[at : at + size]
        elif how == "repeat":
            data[at:at] = data[begin : begin + size]
        elif how == "move":
            moved = bytes(data[at : at + size])
            del data[at : at + size]
            data += moved
        else:
            del data[max(begin, len(data) - size) :]
    return bytes(data)


@given(damages())
@settings(max_examples=60)
def test_random_damage(data: bytes) -> None:
    """Frames are those of the undamaged stream at their numbers, and nothing is lost without being in a gap."""
    salvage(data, TRUTH, total=TOTAL)


def test_long_gaps_take_little_memory() -> None:
    data = io.BytesIO(inserted(OFFSETS[5], bytes(12 << 20)))
    list(StreamReader(data).salvage())  # compiled kernels are no part of the measurement
    data.seek(0)
    tracemalloc.start()
    try:
        parts = list(StreamReader(data).salvage())
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(parts) == TOTAL + 1
    assert peak < 6 << 20  # a window of 3 MiB, and two pieces of 1 MiB on their way into it


def test_a_level_above() -> None:
    data = write_stream(replace(RICH_HEADER, level=5), CODES)
    result = salvage(altered(data, FRAMES[4].offset + 5), TRUTH, total=TOTAL)
    assert result.missing == [4]


def test_a_gap_keeps_no_frame_alive() -> None:
    """Frames of many splats whose checksum is wrong, in few bytes: what they stood for is gone when the gap is told."""
    header = replace(OVERVIEW_HEADER, parameter_checksum_flag=True)
    lies = [Lie("splat_count", 1), Lie("parameter_checksum", 0)]
    (gap, *_) = StreamReader(write_stream(header, overview_frames()[:1], lies=lies)).salvage()
    assert isinstance(gap, Gap)
    (fault,) = gap.faults
    assert fault.rule == "R-6.4-3"
    assert (fault.__traceback__, fault.__context__, fault.__cause__) == (None, None, None)
