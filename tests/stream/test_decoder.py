"""Decoding: any range, other sizes, exact rendering, and any kind of source."""

import io
import itertools
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from codec_cases import encoded, fast, video_format, waves

from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.splats import scale_parameters, scale_parameters_filtered
from gsvc_ref.bitstream.work import rendering_work
from gsvc_ref.encoder import encode
from gsvc_ref.paper import FrameCodes
from gsvc_ref.rendering import render, to_frame, to_frame_deterministic
from gsvc_ref.stream import Gap, Stream, decode, decoder, scaled_size
from gsvc_ref.testing import OVERVIEW_HEADER, overview_frames, write_stream


@pytest.fixture(scope="module")
def clip() -> list[np.ndarray]:
    """Seven frames, the last two equal: I P P I P P R with a key frame every three."""
    frames = waves(frames=6)
    return [*frames, frames[-1].copy()]


@pytest.fixture(scope="module", params=[True, False], ids=["index", "no index"])
def stream(request, clip) -> bytes:
    report, data = encoded(clip, fast(key_frames=(3,), index=request.param))
    assert "".join(frame.type for frame in report.frames) == "IPPIPPR"
    return data


class Pipe(io.RawIOBase):
    """Bytes that come once, from the first to the last."""

    def __init__(self, data: bytes) -> None:
        self.rest = data

    def readable(self) -> bool:
        return True

    def readinto(self, target) -> int:
        count = min(len(target), len(self.rest), 100)
        target[:count], self.rest = self.rest[:count], self.rest[count:]
        return count


def test_any_range_is_that_part_of_the_whole(stream):
    whole = list(decode(stream))
    for start, stop in itertools.product(range(9), [*range(9), None]):
        if stop is not None and stop < start:
            continue
        part = list(decode(stream, start=start, stop=stop))
        assert len(part) == len(whole[start:stop])
        assert all(np.array_equal(a, b) for a, b in zip(part, whole[start:stop], strict=True))


def test_a_range_of_splats_is_that_part_of_the_whole(stream):
    with Stream(stream) as opened:
        whole = list(opened)
        for start in range(7):
            part = list(opened.frames(start, 6))
            assert [frame.number for frame in part] == list(range(start, 6))
            assert all(frame.splats == whole[frame.number].splats for frame in part)


@pytest.mark.parametrize(("start", "stop"), [(3, 2), (-1, None), (-3, -1), (0, -1)])
def test_a_range_that_is_none_is_refused(stream, start, stop):
    with pytest.raises(UsageError, match="0 <= start <= stop"):
        list(decode(stream, start=start, stop=stop))


def test_every_kind_of_source_gives_the_same_frames(stream, tmp_path):
    path = tmp_path / "clip.gsvc"
    path.write_bytes(stream)
    expected = [frame.tobytes() for frame in decode(stream)]
    with path.open("rb") as file, Stream(path) as opened:
        sources = [
            path,
            str(path),
            bytearray(stream),
            memoryview(stream),
            io.BytesIO(stream),
            Pipe(stream),
            file,
            opened,
        ]
        for source in sources:
            assert [frame.tobytes() for frame in decode(source)] == expected
        assert [frame.tobytes() for frame in decode(opened, start=5)] == expected[5:]  # and stays open
    assert [frame.tobytes() for frame in decode(Pipe(stream), start=4, stop=6)] == expected[4:6]


def test_two_iterations_of_a_stream_do_not_disturb_each_other(stream):
    with Stream(stream) as opened:
        for a, b in zip(opened, opened.frames(0), strict=True):
            assert a.splats == b.splats


def test_pictures_are_those_of_the_splats(stream):
    with Stream(stream) as opened:
        for frame, picture in zip(opened, decode(opened), strict=True):
            assert np.array_equal(picture, to_frame(render(frame.splats, 32, 24), 8))


def test_frames_belong_to_the_caller(stream):
    """The repeated frame at the end is not touched by what a caller does to the one before."""
    expected = list(decode(stream))
    for number, frame in enumerate(decode(stream)):
        assert np.array_equal(frame, expected[number])
        frame[:] = 7


@pytest.mark.parametrize("scale", [2, 0.5, 1.5, 3.0, 0.01])
def test_other_sizes_show_the_same_picture(stream, scale):
    with Stream(stream) as opened:
        width, height = scaled_size(opened.header, scale)
        assert (width, height) == (max(1, round(32 * scale)), max(1, round(24 * scale)))
        splats = [scale_parameters_filtered(frame.splats, 32, 24, width, height) for frame in opened]
    pictures = list(decode(stream, scale=scale))
    for picture, scaled in zip(pictures, splats, strict=True):
        assert np.array_equal(picture, to_frame(render(scaled, width, height), 8))


def test_deterministic_pictures_are_sampled_at_every_size(stream):
    """R-9.4-3"""
    splats = [scale_parameters(frame.splats, 32, 24, 16, 12) for frame in Stream(stream)]
    for picture, scaled in zip(decode(stream, scale=0.5, precision="deterministic"), splats, strict=True):
        sums = render(scaled, 16, 12, precision="deterministic")
        assert np.array_equal(picture, to_frame_deterministic(sums, 8))


def test_at_an_odd_multiple_the_middle_pixels_are_those_of_the_coded_size(stream):
    """Pixel centres of the coded size are pixel centres again at three times the size."""
    for small, large in zip(decode(stream), decode(stream, scale=3), strict=True):
        difference = np.abs(small.astype(int) - large[1::3, 1::3].astype(int))
        assert difference.max() <= 1
        assert (difference > 0).mean() < 0.01


@pytest.mark.parametrize("scale", [0, -1, float("nan"), float("inf"), 3000])
def test_scales_out_of_range_are_refused(stream, scale):
    with pytest.raises(UsageError, match="scale"):
        next(decode(stream, scale=scale))


def test_a_scale_beyond_the_highest_level_is_refused_with_one_that_is_not(stream):
    with pytest.raises(UsageError, match=r"12800x9600 pixels.*R-9\.4-2.*at most 295\.6"):
        next(decode(stream, scale=400))
    assert scaled_size(Stream(stream).header, 295.6) == (9459, 7094)


def test_more_work_at_a_scale_than_the_highest_level_allows_is_refused(stream, monkeypatch):
    most = max(rendering_work(frame.splats, 32, 24) for frame in Stream(stream))
    monkeypatch.setattr(decoder, "HIGHEST", replace(decoder.HIGHEST, work=most))
    assert len(list(decode(stream, scale=1))) == len(list(Stream(stream)))
    with pytest.raises(GsvcError, match=r"limit: rendering frame \d+ at 64x48 takes .*smaller scale \[R-9\.4-2\]"):
        list(decode(stream, scale=2))


def test_exact_rendering_is_within_one_step_of_fast(stream):
    for fast_frame, exact in zip(decode(stream), decode(stream, precision="exact"), strict=True):
        difference = np.abs(fast_frame.astype(int) - exact.astype(int))
        assert difference.max() <= 1
        assert (difference > 0).mean() < 0.01


def test_an_unknown_precision_is_refused(stream):
    with pytest.raises(UsageError, match="precision"):
        next(decode(stream, precision="bold"))


def test_threads_do_not_change_a_decoded_frame(stream):
    for one, two in zip(decode(stream, threads=1), decode(stream, threads=2), strict=True):
        assert np.array_equal(one, two)


def test_a_cut_stream_gives_the_frames_before_the_cut(stream):
    with Stream(stream) as opened:
        ends = [frame.offset + frame.size for frame in opened]
    expected = list(decode(stream))
    for complete, end in enumerate(ends):
        frames = decode(stream[: end - 1])
        for number in range(complete):
            assert np.array_equal(next(frames), expected[number])
        with pytest.raises(GsvcError, match=r"R-6\.2-4"):
            next(frames)


def test_salvaged_frames_are_those_of_the_undamaged_stream(stream):
    """I P P I P P R with frame 1 damaged: frames 1 and 2 are missing, and on_gap is told before frame 3 comes."""
    with Stream(stream) as opened:
        place = next(itertools.islice(opened, 1, None)).offset + 9
        assert opened.has_end
    damaged = bytearray(stream)
    damaged[place] ^= 1
    expected = list(decode(stream))
    events = []
    for frame in decode(bytes(damaged), on_gap=events.append):
        events.append(frame)
    first, gap, *others = events
    assert (gap.first_missing, gap.missing_count) == (1, 2)
    assert "frames 1 to 2 are missing" in str(gap)
    assert all(np.array_equal(a, b) for a, b in zip([first, *others], [expected[0], *expected[3:]], strict=True))
    gaps = []
    part = list(decode(bytes(damaged), start=2, stop=5, on_gap=gaps.append))
    assert [(found.first_missing, found.missing_count, found.faults[0].bit) for found in gaps] == [
        (2, 1, gap.faults[0].bit)
    ]
    assert all(np.array_equal(a, b) for a, b in zip(part, expected[3:5], strict=True))
    with Stream(bytes(damaged)) as opened:
        assert [part.number for part in opened.salvage(3) if not isinstance(part, Gap)] == [3, 4, 5, 6]
        assert sum(opened.info(salvage=True).bits.values()) == 8 * len(stream)


def test_a_pipe_is_not_salvaged(stream):
    with pytest.raises(UsageError, match="needs a file"):
        next(decode(Pipe(stream), on_gap=print))


def test_format_and_account_of_a_stream(clip, stream):
    with Stream(stream) as opened:
        assert opened.format == video_format(frame_count=7)
        summary = opened.info()
        assert summary.error is None
        assert "".join(frame.type for frame in summary.frames) == "IPPIPPR"
        assert sum(summary.bits.values()) == 8 * len(stream)
        assert summary.bits["unread"] == 0


@pytest.mark.parametrize("chroma_format", ["rgb", "420", "422", "444"])
def test_the_format_of_the_source_survives(chroma_format):
    base = video_format(24, 16, 10)
    color = type(base.color)(9, 16, 0 if chroma_format in ("rgb", "444") else 9, chroma_format == "rgb", 2)
    source = type(base)(24, 16, Fraction(30000, 1001), 10, chroma_format, color, Fraction(12, 11))
    file = io.BytesIO()
    encode((waves(24, 16, 1, bit_depth=10), source), file, fast())
    with Stream(file.getvalue()) as opened:
        assert opened.format == type(base)(24, 16, Fraction(30000, 1001), 10, chroma_format, color, Fraction(12, 11), 1)


@pytest.mark.parametrize("precision", ["fast", "deterministic", "exact"])
def test_factors_beyond_binary32_at_a_scale_are_degenerate(precision):
    def frame(scale: float) -> FrameCodes:
        codes = overview_frames()[0]
        assert codes.intra is not None
        assert codes.intra.quantizer is not None
        quantizer = replace(codes.intra.quantizer, scale=np.full(3, scale, np.float32))
        return replace(codes, intra=replace(codes.intra, quantizer=quantizer))

    data = write_stream(OVERVIEW_HEADER, [frame(scale) for scale in (1, 5e36, 1)])
    assert all(frame.any() for frame in decode(data, precision=precision))
    first, beyond, last = decode(data, scale=9, precision=precision)
    assert first.any()
    assert not beyond.any()
    assert np.array_equal(first, last)
    gaps: list[Gap] = []
    assert len(list(decode(data, scale=9, precision=precision, on_gap=gaps.append))) == 3
    assert not gaps
