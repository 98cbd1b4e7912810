"""Animated WebP and other moving pictures with alpha: what is written can be read, with its times."""

import io
from contextlib import suppress
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("av")

import av
from video.test_alpha import HEIGHT, ORANGE, WIDTH, mixed, picture

from gsvc_base.errors import GsvcError
from gsvc_ref.metrics import psnr
from gsvc_ref.video import ColorDescription, VideoFormat, open_video, open_writer
from gsvc_ref.video.stream import Extras
from gsvc_tools.video.webp import MAX_CHUNKS, picture_delays

MS = Fraction(1, 1000)


def save(path, delays, **options):
    images = [Image.fromarray(picture(number)) for number in range(len(delays))]
    images[0].save(path, save_all=True, append_images=images[1:], duration=delays, lossless=True, **options)
    return path


class Times:
    ticks_per_second = 1000

    def __init__(self, times):
        self.times = times

    def time_of(self, frame):
        return self.times[frame] * MS


@pytest.mark.parametrize("rate", [Fraction(25), Fraction(30), Fraction(25, 2), Fraction(60), Fraction(24000, 1001)])
def test_what_is_written_is_read_at_the_same_rate(tmp_path, rate):
    y, x = np.mgrid[:24, :32]
    frames = [np.stack([4 * x + 5 * t, 6 * y, 90 + 0 * x], axis=-1).astype(np.uint8) for t in range(12)]
    video = VideoFormat(32, 24, rate, 8, "rgb", ColorDescription(1, 1, 0, True, 0))
    with open_writer(tmp_path / "a.webp", video) as writer:
        for frame in frames:
            writer.write(frame)
    with open_video(tmp_path / "a.webp") as reader:
        read = list(reader)
        assert (reader.format.width, reader.format.height, reader.format.frame_count) == (32, 24, 12)
        assert abs(reader.format.frame_rate - rate) < Fraction(1, 20)
        assert (reader.frame_time, reader.notes) == (None, [])
    for frame, other in zip(frames, read, strict=True):
        assert psnr(frame, other, 255) > 35


def test_uneven_times_come_back_to_the_millisecond(tmp_path):
    times = [0, 40, 47, 200, 233]
    video = VideoFormat(WIDTH, HEIGHT, Fraction(25), 8, "rgb", ColorDescription(1, 1, 0, True, 0))
    with open_writer(tmp_path / "a.webp", video, extras=Extras(times=Times(times))) as writer:
        for number in range(4):
            writer.write(np.ascontiguousarray(picture(number)[..., :3]) // 2 + np.uint8(20 * number))
    with open_video(tmp_path / "a.webp") as reader:
        found = [(reader.frame_time, reader.end_time) for _ in reader]
        assert reader.time_base == MS
        assert any("not evenly spaced in time" in note for note in reader.notes)
    assert found == [(begin * MS, end * MS) for begin, end in pairwise(times)]


@pytest.mark.parametrize("of_bytes", [False, True])
def test_transparent_pictures(tmp_path, of_bytes):
    path = save(tmp_path / "a.webp", [40, 40, 40])
    with pytest.raises(GsvcError, match=r"frame 0 of .* is transparent in places.*--background") as caught:
        next(open_video(path))
    assert caught.value.kind == "unsupported"
    with open_video(io.BytesIO(path.read_bytes()) if of_bytes else path, background=ORANGE) as reader:
        for number, frame in enumerate(reader):
            np.testing.assert_array_equal(frame, mixed(picture(number), ORANGE))
        assert number == 2
        assert [note for note in reader.notes if "show the background #ffa500" in note]


def test_a_picture_without_a_delay_lasts_a_millisecond(tmp_path):
    with open_video(save(tmp_path / "a.webp", [40, 0, 100]), background="white") as reader:
        assert [reader.frame_time for _ in reader] == [0, 40 * MS, 41 * MS]
    with open_video(save(tmp_path / "b.webp", [0, 0]), background="white") as reader:
        assert reader.format.frame_rate == 25
        assert len(list(reader)) == 2


def test_damaged_files_end_in_a_sentence(tmp_path):
    whole = save(tmp_path / "a.webp", [40] * 6).read_bytes()
    rng = np.random.default_rng(0)
    for attempt in range(60):
        data = bytearray(whole[: rng.integers(30, len(whole))] if attempt % 2 else whole)
        for place in rng.integers(21, len(data), attempt % 3):
            data[place] ^= 1 << rng.integers(8)
        (tmp_path / "b.webp").write_bytes(data)
        with suppress(GsvcError), open_video(tmp_path / "b.webp", background="white") as reader:
            assert len(list(reader)) <= 6


def test_a_file_that_would_fill_the_memory_is_refused(tmp_path):
    path = save(tmp_path / "a.webp", [40, 40])
    data = bytearray(path.read_bytes())
    data[4:8] = (1 << 31).to_bytes(4, "little")
    with path.open("wb") as file:
        file.write(data)
        file.truncate(1 << 34)
    with pytest.raises(GsvcError, match="an animated WebP has 2147483656 bytes") as caught:
        open_video(path)
    assert caught.value.kind == "limit"


def test_chunks_without_end_are_not_counted(tmp_path):
    size = 16 * MAX_CHUNKS
    with (tmp_path / "a.webp").open("wb") as file:
        file.write(b"RIFF" + (size - 8).to_bytes(4, "little") + b"WEBPVP8X" + (10).to_bytes(4, "little") + b"\2")
        file.truncate(size)  # zeros: empty chunks
    with pytest.raises(GsvcError, match="more than 1048576 chunks"):
        picture_delays(tmp_path / "a.webp")


def test_a_still_webp_is_a_video_of_one_frame(tmp_path):
    Image.fromarray(picture()).save(tmp_path / "a.webp", lossless=True)
    with open_video(tmp_path / "a.webp", background="orange") as reader:
        np.testing.assert_array_equal(next(reader), mixed(picture(), ORANGE))


@pytest.mark.parametrize(
    ("name", "codec", "pix_fmt", "options", "most"),
    [
        ("a.mov", "qtrle", "argb", {}, 0),
        ("a.mov", "prores_ks", "yuva444p10le", {"profile": "4444"}, 12),
        ("a.webm", "libvpx-vp9", "yuva420p", {"lossless": "1"}, 90),
        ("a.webm", "libvpx", "yuva420p", {"auto-alt-ref": "0"}, 110),
    ],
)
def test_alpha_through_ffmpeg(tmp_path, name, codec, pix_fmt, options, most):
    """Where chroma is subsampled, or alpha is lossy, edges are blurred; what lies far from any is close."""
    with av.open(str(tmp_path / name), "w") as container:
        stream = container.add_stream(codec, rate=25, options=options)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, pix_fmt
        if name.endswith("webm"):
            stream.metadata["alpha_mode"] = "1"
        for number in range(3):
            rgba = av.VideoFrame.from_ndarray(picture(number), format="rgba")
            container.mux(stream.encode(rgba.reformat(format=pix_fmt)))
        container.mux(stream.encode(None))
    with open_video(tmp_path / name, background="orange") as reader:
        peak, frames = reader.format.peak, list(reader)
        assert any("show the background #ffa500" in note for note in reader.notes)
        assert not any("left out" in note for note in reader.notes)
    errors = np.abs(np.stack(frames) / peak * 255 - np.stack([mixed(picture(n), ORANGE) for n in range(3)]))
    assert errors.max() <= most + 0.5
    assert errors.mean() < 6
    if name.endswith("webm"):
        with open_video(tmp_path / name) as reader:
            assert any("--background COLOR shows" in note for note in reader.notes)
            assert len(list(reader)) == 3
