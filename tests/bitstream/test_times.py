"""Chunks ``t``: what is written is read, what breaks a rule is ignored, and times are sums of durations."""

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.errors import UsageError
from gsvc_ref.bitstream import times as module
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.bitstream.times import FrameTimes, read_times, write_times

RATE = Fraction(25)
runs = st.lists(st.tuples(st.integers(1, 300), st.integers(1, 2**32 - 1)), max_size=5)


def payload(*values):
    return b"".join(map(encode_uv, values))


@given(st.integers(1, 2**32 - 1), st.integers(0, 2**31), runs)
def test_what_is_written_is_read(ticks, first, found):
    assert read_times(write_times(ticks, first, found)) == (ticks, first, found)


@given(st.lists(st.tuples(st.integers(0, 3), runs), max_size=4), st.integers(1, 90000))
def test_times_are_sums_of_durations(chunks, ticks):
    times, durations = FrameTimes(RATE), []
    for gap, found in chunks:
        durations += [1 / RATE] * gap
        assert times.add(write_times(ticks, len(durations), found), len(durations))
        durations += [Fraction(length, ticks) for count, length in found for _ in range(count)]
    assert times.is_even == (not any(found for _, found in chunks))
    durations += [1 / RATE] * 2
    expected = Fraction(0)
    for number, duration in enumerate(durations):
        if number < 50 or number > len(durations) - 50:
            assert times.time_of(number) == expected
            assert times.duration_of(number) == duration
        expected += duration


FAULTS = {
    "empty": b"",
    "cut": payload(1000, 0, 2, 1, 40, 1),
    "something follows": payload(1000, 0, 1, 1, 40) + b"\0",
    "no ticks": payload(0, 0, 1, 1, 40),
    "no frames": payload(1000, 0, 1, 0, 40),
    "no time": payload(1000, 0, 1, 1, 0),
    "frame numbers": payload(1000, 7, 1, 2**32 - 6, 40),
    "a number in too many bytes": bytes([0x80 | 100, 0, 0, 1, 1, 40]),
    "a number of 33 bits": b"\xff\xff\xff\xff\xff" + payload(0, 0),
    "too many runs": payload(1000, 0, 4097, *[1, 40] * 4097),
    "more runs than bytes": payload(1000, 0, 4096, 1, 40),
    "before what was shown": payload(1000, 4, 1, 1, 40),
    "told before": payload(1000, 6, 1, 1, 40),
    "other ticks": payload(999, 9, 1, 1, 40),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_chunk_is_ignored(fault):
    times = FrameTimes(RATE)
    assert times.add(payload(1000, 0, 2, 2, 100, 5, 10), 0)
    before = [times.time_of(number) for number in range(20)]
    assert not times.add(FAULTS[fault], 5)
    assert [times.time_of(number) for number in range(20)] == before
    assert times.add(payload(1000, 7, 1, 1, 500), 6)  # as if it had not been there
    assert times.duration_of(7) == Fraction(1, 2)


def test_the_last_frame_that_there_can_be():
    times = FrameTimes(RATE)
    assert times.add(payload(1000, 1, 1, 2**32 - 1, 2**32 - 1), 0)
    assert times.time_of(2**32) == 1 / RATE + Fraction((2**32 - 1) ** 2, 1000)


def test_values_that_no_chunk_can_have_are_not_written():
    for ticks, first, found in [
        (0, 0, []),
        (1, 0, [(1, 0)]),
        (1, 0, [(0, 1)]),
        (2**32, 0, []),
        (1, 0, [(1, 1)] * 4097),
    ]:
        with pytest.raises(UsageError, match=r"R-6\.11-1"):
            write_times(ticks, first, found)


def test_a_hostile_stream_does_not_fill_the_memory(monkeypatch):
    monkeypatch.setattr(module, "MAX_TIME_RUNS_KEPT", 3)
    times = FrameTimes(RATE)
    assert [times.add(payload(1000, 2 * n, 2, 1, 7, 1, 9), 0) for n in range(4)] == [True, True, False, False]
    assert times.time_of(6) == Fraction(32, 1000) + 2 / RATE


def test_times_are_equal_if_they_say_the_same():
    first, second = FrameTimes(RATE), FrameTimes(RATE)
    assert first == second != FrameTimes(Fraction(24))
    assert first.add(payload(1000, 0, 1, 2, 30), 0)
    assert first != second
    assert second.add(payload(1000, 0, 1, 2, 30), 0)
    assert first == second
