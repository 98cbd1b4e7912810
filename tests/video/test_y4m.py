"""y4m: round trips, what ffmpeg writes, and everything that can be wrong with a header."""

import io
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.video import (
    ColorDescription,
    VideoFormat,
    open_video,
    open_writer,
    to_planes,
    to_rgb,
)
from gsvc_ref.video.y4m_header import parse_header

PLAIN = b"YUV4MPEG2 W4 H2 F25:1 Ip A1:1 C420mpeg2 XCOLORRANGE=LIMITED\n"
FRAME = b"FRAME\n" + bytes(range(12))


class Pipe(io.RawIOBase):
    """Hands out and takes a few bytes at a time and cannot seek."""

    def __init__(self, data=b""):
        self.data = data
        self.taken = bytearray()

    def readable(self):
        return True

    def readinto(self, buffer):
        count = min(len(buffer), 7, len(self.data))
        buffer[:count] = self.data[:count]
        self.data = self.data[count:]
        return count

    def write(self, data):
        part = bytes(data[:1000])
        self.taken += part
        return len(part)


@st.composite
def formats(draw):
    chroma = draw(st.sampled_from(("420", "422", "444")))
    color = ColorDescription(
        draw(st.sampled_from((1, 2, 9))),
        draw(st.sampled_from((1, 2, 13, 16))),
        draw(st.sampled_from((1, 4, 5, 6, 7, 8, 9) + ((0,) if chroma == "444" else ()))),
        draw(st.booleans()),
        draw(st.integers(0, 5)),
    )
    return VideoFormat(
        draw(st.integers(1, 40)),
        draw(st.integers(1, 40)),
        Fraction(draw(st.integers(1, 2**31 - 1)), draw(st.integers(1, 2**31 - 1))),
        draw(st.integers(8, 16)),
        chroma,
        color,
        Fraction(draw(st.integers(1, 9999)), draw(st.integers(1, 9999))),
    )


def random_frames(video, count, seed=0):
    rng = np.random.default_rng(seed)
    shape = (video.height, video.width, 3)
    return [rng.integers(0, video.peak + 1, shape, dtype=video.dtype) for _ in range(count)]


def written(video, frames):
    target = io.BytesIO()
    with open_writer(target, video) as writer:
        for frame in frames:
            writer.write(frame)
    return target.getvalue()


@settings(max_examples=60, deadline=None)
@given(formats(), st.integers(0, 3), st.integers(0, 2**32))
def test_round_trip(video, count, seed):
    frames = random_frames(video, count, seed)
    with open_video(io.BytesIO(written(video, frames))) as reader:
        assert reader.format == video
        assert reader.notes == []
        read = list(reader)
    assert len(read) == count
    for frame, original in zip(read, frames, strict=True):
        assert frame.dtype == video.dtype
        np.testing.assert_array_equal(frame, to_rgb(to_planes(original, video), video))


def test_a_file_knows_its_number_of_frames(tmp_path):
    color = ColorDescription(1, 1, 1, False, 0)
    video = VideoFormat(5, 3, Fraction(30000, 1001), 10, "420", color, Fraction(128, 117))
    path = tmp_path / "clip.y4m"
    with open_writer(path, video) as writer:
        for frame in random_frames(video, 4):
            writer.write(frame)
    with open_video(path) as reader:
        assert reader.format == replace(video, frame_count=4)
    with path.open("ab") as file:
        file.write(b"FRAME\n")
    with open_video(path) as reader:
        assert reader.format.frame_count is None


def test_pipes_that_deliver_little_at_a_time():
    color = ColorDescription(1, 1, 1, False, 0)
    video = VideoFormat(40, 30, Fraction(24), 8, "422", color)
    frames = random_frames(video, 3)
    target = Pipe()
    with open_writer(target, video) as writer:
        for frame in frames:
            writer.write(frame)
    assert bytes(target.taken) == written(video, frames)
    source = Pipe(bytes(target.taken))
    with open_video(source) as reader:
        assert len(list(reader)) == 3
        assert reader.format.frame_count is None
    assert not source.closed


@pytest.mark.parametrize(("height", "matrix"), [(6, 6), (577, 1)])
def test_rgb_is_written_as_444_in_what_others_assume(height, matrix):
    video = VideoFormat(8, height, Fraction(25), 8, "rgb", ColorDescription(1, 13, 0, True, 0))
    frames = random_frames(video, 1)
    target = io.BytesIO()
    with open_writer(target, video) as writer:
        writer.write(frames[0])
        assert writer.notes == ["y4m holds no R'G'B': written as 4:4:4 in limited range, exact to a few steps"]
    with open_video(io.BytesIO(target.getvalue())) as reader:
        assert reader.format.chroma_format == "444"
        assert reader.format.color == ColorDescription(1, 13, matrix, False, 0)
        (frame,) = reader
    assert np.abs(frame.astype(int) - frames[0]).max() <= 3


def test_unspecified_matrix_is_written_as_the_assumed_one():
    video = VideoFormat(8, 6, Fraction(25), 8, "420", ColorDescription(2, 2, 2, False, 0))
    with open_video(io.BytesIO(written(video, random_frames(video, 1)))) as reader:
        assert reader.format.color.matrix == 6


@pytest.mark.parametrize(
    ("tags", "chroma", "depth", "full", "location", "assumed"),
    [
        (b"", "420", 8, False, 1, "matrix BT.601 (at most 576 rows), limited range"),
        (b" C420jpeg XCOLORRANGE=FULL", "420", 8, True, 1, "matrix BT.601 (at most 576 rows)"),
        (b" C420mpeg2 XYSCSS=420MPEG2", "420", 8, False, 0, "matrix BT.601 (at most 576 rows), limited range"),
        (b" C420paldv XCOLORRANGE=LIMITED", "420", 8, False, 2, "matrix BT.601 (at most 576 rows)"),
        (
            b" C420p10 XYSCSS=420P10",
            "420",
            10,
            False,
            0,
            "matrix BT.601 (at most 576 rows), limited range, chroma siting left",
        ),
        (b" C422 XCOLORRANGE=FULL", "422", 8, True, 0, "matrix BT.601 (at most 576 rows), chroma siting left"),
        (b" C444p12 XCOLORRANGE=LIMITED", "444", 12, False, 0, "matrix BT.601 (at most 576 rows)"),
        (b" C444 XCOLORRANGE=WHATEVER", "444", 8, False, 0, "matrix BT.601 (at most 576 rows), limited range"),
    ],
)
def test_what_other_programs_write(tags, chroma, depth, full, location, assumed):
    header = parse_header(b"YUV4MPEG2 W6 H4 F30000:1001 Ip A0:0" + tags, "clip")
    assert header.format == VideoFormat(
        6, 4, Fraction(30000, 1001), depth, chroma, ColorDescription(2, 2, 6, full, location)
    )
    assert header.notes == [f"colour not stated by clip, so assumed: {assumed}"]


@pytest.mark.parametrize(("tag", "depth"), [(b"Cmono", 8), (b"Cmono10", 10), (b"Cmono16", 16)])
def test_mono_reads_as_grey(tag, depth):
    size = 1 if depth == 8 else 2
    samples = np.array([16, 235, 126, 100, 0, 255], np.uint16) << (depth - 8)
    data = b"YUV4MPEG2 W3 H2 F25:1 Ip " + tag + b" XCOLORRANGE=LIMITED\nFRAME\n" + samples.astype(f"<u{size}").tobytes()
    reader = open_video(io.BytesIO(data))
    (frame,) = reader
    peak = (1 << depth) - 1
    expected = np.rint(np.clip((samples - float(16 << (depth - 8))) * peak / (219 << (depth - 8)), 0, peak))
    np.testing.assert_array_equal(frame, np.repeat(expected.reshape(2, 3, 1), 3, axis=-1))
    assert reader.notes == ["the input is monochrome; its frames are read as grey"]


def test_assumptions_about_time_and_fields_are_stated():
    header = parse_header(b"YUV4MPEG2 H2 W4 F0:0 It C444 XCOLORRANGE=FULL XGSVC_COLOR=1:1:1:1:0", "clip")
    assert header.format.frame_rate == 25
    assert header.notes == [
        "clip is interlaced (top field first); its frames are read as if progressive",
        "frame rate not stated by clip, so assumed: 25 per second",
    ]


def test_frame_headers_may_have_parameters():
    data = PLAIN + FRAME.replace(b"FRAME", b"FRAME Ip XANY=thing") + FRAME
    assert len(list(open_video(io.BytesIO(data)))) == 2


def test_no_frames():
    reader = open_video(io.BytesIO(PLAIN))
    assert reader.format.width == 4
    assert list(reader) == []


@pytest.mark.parametrize(
    ("data", "kind", "message"),
    [
        (b"YUV4MPEG2", "malformed", "cut off"),
        (b"YUV4MPEG2 W4 H2", "malformed", "cut off"),
        (b"YUV4MPEG2 W4 H2 " + b"X" * 5000 + b"\n", "malformed", "longer than 4096"),
        (b"YUV4MPEG20 W4 H2\n", "malformed", "does not begin with YUV4MPEG2"),
        (b"YUV4MPEG2\n", "malformed", "must state the size"),
        (b"YUV4MPEG2 W4\n", "malformed", "must state the size"),
        (b"YUV4MPEG2 W4 H-2\n", "malformed", "must state the size"),
        (b"YUV4MPEG2 W4 H2.5\n", "malformed", "must state the size"),
        (b"YUV4MPEG2 W4 H\xc2\xb2\n", "malformed", "must state the size"),
        (b"YUV4MPEG2 W4 W5 H2\n", "malformed", "stands twice"),
        (b"YUV4MPEG2 W0 H2\n", "malformed", "at least 1"),
        (b"YUV4MPEG2 W65536 H2\n", "limit", "65535 on a side"),
        (b"YUV4MPEG2 W999999999 H999999999\n", "limit", "65535 on a side"),
        (b"YUV4MPEG2 W65535 H65535\n", "limit", "268435456 pixels"),
        (b"YUV4MPEG2 W4 H2 F25\n", "malformed", "not a ratio"),
        (b"YUV4MPEG2 W4 H2 F25:0\n", "malformed", "must be 1 to"),
        (b"YUV4MPEG2 W4 H2 F9999999999:1\n", "malformed", "must be 1 to"),
        (b"YUV4MPEG2 W4 H2 F-1:1\n", "malformed", "not a ratio"),
        (b"YUV4MPEG2 W4 H2 A1:0\n", "malformed", "must be 1 to"),
        (b"YUV4MPEG2 W4 H2 Ix\n", "malformed", "Ip, It"),
        (b"YUV4MPEG2 W4 H2 C411\n", "unsupported", "colour space C411"),
        (b"YUV4MPEG2 W4 H2 C444alpha\n", "unsupported", "colour space C444alpha"),
        (b"YUV4MPEG2 W4 H2 C420p7\n", "unsupported", "colour space"),
        (b"YUV4MPEG2 W4 H2 C420p99999999999999\n", "unsupported", "colour space"),
        (b"YUV4MPEG2 W4 H2 C422jpeg\n", "unsupported", "colour space"),
        (b"YUV4MPEG2 W4 H2 XGSVC_COLOR=1:1\n", "malformed", "XGSVC_COLOR"),
        (b"YUV4MPEG2 W4 H2 XGSVC_COLOR=1:1:999:0:0\n", "malformed", "XGSVC_COLOR"),
        (b"YUV4MPEG2 W4 H2 XGSVC_COLOR=1:1:10:0:0\n", "unsupported", "colour matrix 10"),
        (b"YUV4MPEG2 W4 H2 XGSVC_COLOR=1:1:0:0:0\n", "invalid", "identity matrix"),
    ],
)
def test_hostile_headers(data, kind, message):
    with pytest.raises(GsvcError, match=message) as caught:
        open_video(io.BytesIO(data))
    assert caught.value.kind == kind


@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=60), st.booleans())
def test_any_header_is_read_or_refused(rest, tail):
    data = b"YUV4MPEG2 W4 H2 " + rest + (b"\n" if tail else b"") + FRAME
    with suppress(GsvcError):
        for frame in open_video(io.BytesIO(data)):
            assert frame.shape[2] == 3


def test_a_header_of_a_frame_that_is_too_long_is_told_as_that():
    reader = open_video(io.BytesIO(PLAIN + b"FRAME " + b"x" * 5000 + b"\n" + FRAME))
    with pytest.raises(GsvcError, match="frame 0 has a header of more than 4096 bytes"):
        list(reader)


@pytest.mark.parametrize("cut", range(1, len(FRAME)))
def test_a_cut_frame_comes_after_the_complete_ones(cut):
    reader = open_video(io.BytesIO(PLAIN + 2 * FRAME + FRAME[:cut]))
    assert len([next(reader), next(reader)]) == 2
    with pytest.raises(GsvcError, match="frame 2") as caught:
        next(reader)
    assert caught.value.kind == "malformed"
    with pytest.raises(StopIteration):
        next(reader)


def test_a_huge_size_without_data_fails_at_once():
    reader = open_video(io.BytesIO(b"YUV4MPEG2 W16384 H16384 C444p16\nFRAME\nabc"))
    with pytest.raises(GsvcError, match="1610612733 of its 1610612736 bytes are missing"):
        next(reader)


def test_a_closed_reader_ends():
    reader = open_video(io.BytesIO(PLAIN + FRAME))
    reader.close()
    reader.close()
    assert list(reader) == []


def test_the_writer_checks_frames_and_matrix():
    video = VideoFormat(4, 2, Fraction(25), 8, "420", ColorDescription(1, 1, 1, False, 0))
    with open_writer(io.BytesIO(), video) as writer, pytest.raises(UsageError, match=r"of shape \(2, 3, 3\)"):
        writer.write(np.zeros((2, 3, 3), np.uint8))
    with pytest.raises(UsageError, match="closed"):
        writer.write(np.zeros((2, 4, 3), np.uint8))
    with pytest.raises(UsageError, match="colour matrix 10"):
        open_writer(io.BytesIO(), replace(video, color=replace(video.color, matrix=10)))
