"""The time stamps of a source come out of the stream, however it is encoded; pictures do not depend on them."""

import io
import random
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from itertools import accumulate

import numpy as np
import pytest
from codec_cases import fast, same, video_format, waves

from gsvc_base.errors import GsvcError
from gsvc_ref.bitstream.times import write_times
from gsvc_ref.encoder import IncompleteEncodeError, encode, times
from gsvc_ref.encoder.times import SourceTimes
from gsvc_ref.stream import Stream, decode
from gsvc_ref.testing import join_chunks, split_chunks
from gsvc_ref.video import VideoReader
from gsvc_tools.editing import concat, cut

SMALL = video_format(24, 16)
CLIP = waves(24, 16, 7)
DURATIONS = [40, 40, 120, 40, 7, 260, 300]
"""Milliseconds for which the frames of the clip are shown, at 25 frames a second."""
SETTINGS = fast(key_frames=3, splats=4)


class UnevenReader(VideoReader):
    """Frames with time stamps; `fails_at` is the number of one that cannot be read."""

    def __init__(self, frames=CLIP, durations=DURATIONS, *, fails_at=None, knows_end=True, time_base=Fraction(1, 1000)):
        super().__init__()
        self.format, self.time_base = SMALL, time_base
        self._pictures, self._durations = frames, durations
        self._fails_at, self._knows_end = fails_at, knows_end
        self.read = 0

    def _read(self):
        ends = [0, *accumulate(self._durations)]
        for number, frame in enumerate(self._pictures):
            if number == self._fails_at:
                raise GsvcError("malformed", f"frame {number} is damaged")
            self.read += 1
            self.frame_time = Fraction(ends[number], 1000)
            self.end_time = Fraction(ends[number + 1], 1000) if self._knows_end else None
            yield frame


def durations(data, count):
    found = Stream(data).times()
    assert [found.time_of(n) + found.duration_of(n) for n in range(count)] == [
        found.time_of(n) for n in range(1, count + 1)
    ]
    return [1000 * found.duration_of(n) for n in range(count)]


def encoded(reader, settings=SETTINGS, **options):
    file = io.BytesIO()
    report = encode(reader, file, settings, **options)
    return report, file.getvalue()


@pytest.fixture(scope="module")
def stream():
    return encoded(UnevenReader())[1]


def test_time_stamps_come_out_again(stream):
    assert durations(stream, 7) == DURATIONS
    assert [kind for kind, _ in split_chunks(stream)].count(b"t") == 1
    plain = io.BytesIO()
    encode((CLIP, SMALL), plain, SETTINGS)
    assert [part for part in split_chunks(stream) if part[0] in b"IP"] == [
        part for part in split_chunks(plain.getvalue()) if part[0] in b"IP"
    ]


def test_even_sources_have_no_chunk():
    data = encoded(UnevenReader(durations=[40] * 7))[1]
    assert b"t" not in [kind for kind, _ in split_chunks(data)]
    assert Stream(data).times().is_even


def test_bytes_do_not_depend_on_jobs(stream):
    with ThreadPoolExecutor(2) as executor:
        assert encoded(UnevenReader(), jobs=2, executor=executor)[1] == stream


@pytest.mark.parametrize(("start", "stop"), [(0, 4), (2, 5), (2, None), (5, 100)])
def test_a_range_of_frames(start, stop):
    data = encoded(UnevenReader(), SETTINGS.with_(frames=(start, stop)))[1]
    expected = DURATIONS[start:stop]
    assert durations(data, len(expected)) == expected


def test_live_a_chunk_stands_before_each_frame():
    reader = UnevenReader()
    data = encoded(reader, SETTINGS, live=True)[1]
    kinds = b"".join(kind for kind, _ in split_chunks(data))
    assert kinds.replace(b"R", b"P").startswith(b"HIPtPIt")  # the first two are shown as long as the header says
    assert durations(data, 7) == DURATIONS


def test_a_pipe_knows_the_time_of_a_frame_when_it_comes():
    class Pipe(io.BytesIO):
        def seekable(self):
            return False

    data = encoded(UnevenReader(), SETTINGS, live=True)[1]
    with Stream(Pipe(data)) as stream:
        for number, _ in enumerate(stream):
            assert stream.times().duration_of(number) == Fraction(DURATIONS[number], 1000)


def test_without_the_end_of_the_last_frame_it_is_shown_as_usual():
    data = encoded(UnevenReader(knows_end=False))[1]
    assert durations(data, 7) == [*DURATIONS[:-1], 40]


@pytest.mark.parametrize("live", [False, True])
def test_a_source_that_is_damaged(live):
    file = io.BytesIO()
    with pytest.raises(IncompleteEncodeError, match="5 complete frames"):
        encode(UnevenReader(fails_at=5), file, SETTINGS, live=live)
    assert durations(file.getvalue(), 4) == DURATIONS[:4]
    assert len(list(decode(file.getvalue()))) == 5


def test_an_interrupt_leaves_the_times_of_the_frames_that_are_there():
    file = io.BytesIO()

    def stop(progress):
        if progress.frame == 4:
            raise KeyboardInterrupt

    report = encode(UnevenReader(), file, SETTINGS, progress=stop)
    assert report.interrupted
    assert durations(file.getvalue(), 7) == DURATIONS  # also of those that are not
    assert len(list(decode(file.getvalue()))) == len(report.frames) < 7


@pytest.mark.parametrize("ahead", [1, 2, 3, 64])
def test_frames_read_ahead_are_few_and_in_order(monkeypatch, ahead):
    monkeypatch.setattr(times, "MAX_AHEAD", ahead)
    reader = UnevenReader()
    source = SourceTimes(reader, 0, None, least_delay=False)
    for number, frame in enumerate(source.frames()):
        assert np.array_equal(frame, CLIP[number])
        assert reader.read <= number + 1 + ahead
        assert (source.before(number) is not None) == (number % ahead == 0 and {*DURATIONS[number:][:ahead]} != {40})
    assert number == 6


def test_other_units_are_rounded_without_drift():
    rng = random.Random(3)
    spans = [rng.randint(1, 90) for _ in range(60)]
    reader = UnevenReader([CLIP[0]] * 60, spans, time_base=None)
    source = SourceTimes(reader, 0, None, least_delay=False)
    list(source.frames())
    payload = source.before(0)
    found = Stream(encoded(UnevenReader(durations=[40] * 7))[1]).times()
    assert found.add(payload, 0)
    assert abs(found.time_of(60) - Fraction(sum(spans), 1000)) <= Fraction(1, 90_000)


def test_faulty_time_stamps_change_no_picture(stream):
    chunks = split_chunks(stream)
    pictures = list(decode(stream))
    for payload in (b"", b"\0\0\0", b"\xff" * 9, write_times(1, 0, [(2**32 - 1, 9)]) + b"x"):
        data = join_chunks([(kind, payload if kind == b"t" else old) for kind, old in chunks], prefix=stream[:10])
        assert same(list(decode(data)), pictures)
        assert Stream(data).times().is_even


def joined(*parts):
    out = io.BytesIO()
    return concat([*parts], out), out.getvalue()


def test_joined_streams_keep_their_times(stream):
    report, data = joined(stream, stream)
    assert "t" not in report.left_out
    assert durations(data, 14) == DURATIONS * 2


def test_times_of_frames_that_a_part_does_not_have_are_not_those_of_the_next(stream):
    chunks = split_chunks(stream)
    said = write_times(1000, 0, [(5, 50), (20, 70)])
    long = join_chunks([(kind, said if kind == b"t" else old) for kind, old in chunks], prefix=stream[:10])
    even = io.BytesIO()
    encode((CLIP, SMALL), even, SETTINGS)
    assert durations(joined(long, even.getvalue())[1], 14) == [50] * 5 + [70] * 2 + [40] * 7
    assert durations(joined(long, stream)[1], 14) == [50] * 5 + [70] * 2 + DURATIONS


def test_parts_with_other_ticks_are_evenly_spaced(stream):
    other = encoded(UnevenReader(time_base=Fraction(1, 2000)))[1]
    report, data = joined(stream, other)
    assert report.left_out["t"] == 1
    assert durations(data, 14) == [*DURATIONS, *[40] * 7]


def test_a_live_part_from_a_pipe_may_have_times_of_more_frames(stream):
    class Pipe(io.BytesIO):
        def seekable(self):
            return False

    live = encoded(UnevenReader(), SETTINGS, live=True)[1]
    report, data = joined(Pipe(live), stream)
    assert report.left_out["t"] == 4  # frames that are shown as usual have none
    assert durations(data, 14) == [*[40] * 7, *DURATIONS]
    assert durations(joined(stream, Pipe(live))[1], 14) == DURATIONS * 2
    assert durations(joined(live, stream)[1], 14) == DURATIONS * 2


@pytest.mark.parametrize(("start", "stop"), [(0, None), (3, None), (3, 5), (0, 4), (6, 7)])
def test_a_cut_keeps_the_times_of_its_frames(stream, start, stop):
    out = io.BytesIO()
    report = cut(stream, out, start=start, stop=stop)
    assert "t" not in report.left_out
    expected = DURATIONS[start:stop]
    assert durations(out.getvalue(), len(expected)) == expected
    assert Stream(out.getvalue()).times().duration_of(len(expected)) == Fraction(1, 25)
