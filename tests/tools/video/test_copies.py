"""Copies to look at: their time stamps, their bits, the sound of another file, and animations."""

from contextlib import closing
from fractions import Fraction

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("av")

import av
from tools.video.odd_clips import write_clip

from gsvc_base.errors import UsageError
from gsvc_ref.bitstream.times import FrameTimes, write_times
from gsvc_ref.video import ColorDescription, VideoFormat, open_video, open_writer
from gsvc_ref.video.stream import Extras
from gsvc_tools.video.libav_audio import first_picture

COLOR = ColorDescription(1, 1, 1, False, 0)
UNEVEN = [0, 40, 80, 200, 240, 500]
"""Milliseconds; the last frame is shown for 300."""


def video_format(bit_depth=8):
    return VideoFormat(32, 24, Fraction(25), bit_depth, "420", COLOR)


def frames(count, bit_depth=8):
    y, x = np.mgrid[:24, :32]
    dtype = np.uint8 if bit_depth == 8 else np.uint16
    return [
        (np.stack([40 + 5 * x, 60 + 6 * y, 90 + 9 * n + 0 * x], axis=-1) << (bit_depth - 8)).astype(dtype)
        for n in range(count)
    ]


def uneven():
    times = FrameTimes(Fraction(25))
    runs = [(2, 40), (1, 120), (1, 40), (1, 260), (1, 300)]
    assert times.add(write_times(1000, 0, runs), 0)
    return times


def write(path, count=6, bit_depth=8, **extras):
    with open_writer(path, video_format(bit_depth), extras=Extras(**extras)) as writer:
        for frame in frames(count, bit_depth):
            writer.write(frame)
    return writer


def shown(path):
    """The times of the frames of a file in milliseconds from the first, and its length."""
    with closing(av.open(str(path))) as container:
        times = [1000 * picture.pts * picture.time_base for picture in container.decode(video=0)]
        return [round(time - times[0]) for time in times], container.duration / 1000


def packets(path):
    """For each audio track its packets, and when they are played, in seconds from the first picture."""
    start = float(first_picture(av, path))
    with closing(av.open(str(path))) as container:
        found = [[] for _ in container.streams.audio]
        for packet in container.demux(container.streams.audio):
            if packet.size:
                time = float(packet.pts * packet.time_base) - start
                found[container.streams.audio.index(packet.stream)].append((bytes(packet), time))
        return found


@pytest.mark.parametrize("suffix", [".mp4", ".mkv", ".mov", ".webm"])
def test_time_stamps_are_restored(tmp_path, suffix):
    writer = write(tmp_path / f"a{suffix}", times=uneven())
    assert writer.carries_times
    times, length = shown(tmp_path / f"a{suffix}")
    assert times == UNEVEN
    assert length == pytest.approx(800, abs=2)


def test_time_stamps_of_a_part(tmp_path):
    write(tmp_path / "a.mkv", count=3, times=uneven(), first_frame=2)
    assert shown(tmp_path / "a.mkv")[0] == [0, 120, 160]


def test_a_missing_frame_leaves_its_time_to_the_one_before(tmp_path):
    with open_writer(tmp_path / "a.mp4", video_format(), extras=Extras(times=uneven())) as writer:
        for number, frame in enumerate(frames(5)):
            if number == 2:
                writer.skip(1)
            writer.write(frame)
    assert shown(tmp_path / "a.mp4")[0] == [0, 40, 200, 240, 500]


@pytest.mark.parametrize(("suffix", "bits"), [(".mp4", 10), (".mkv", 10), (".webm", 8)])
def test_ten_bits_stay_where_the_encoder_has_them(tmp_path, suffix, bits):
    name = f"a{suffix}"
    writer = write(tmp_path / name, bit_depth=12)
    assert writer.written_depth == bits
    assert f"{name} is a lossy copy for viewing ({bits} bits, " in writer.notes[0]
    with open_video(tmp_path / name) as reader:
        assert reader.format.bit_depth == bits
        for read, expected in zip(reader, frames(6, bits), strict=True):
            assert np.abs(read.astype(int) - expected).mean() < 2 * 2 ** (bits - 8)


@pytest.mark.parametrize("suffix", [".mp4", ".mkv", ".mov"])
def test_sound_is_copied_packet_by_packet(tmp_path, suffix):
    write_clip(tmp_path / "source.mp4", sound=["aac", "aac"], seconds=0.8)
    writer = write(tmp_path / f"a{suffix}", times=uneven(), audio_from=tmp_path / "source.mp4")
    assert any("not encoded again (aac, aac)" in note for note in writer.notes)
    assert shown(tmp_path / f"a{suffix}")[0] == UNEVEN
    copied, source = packets(tmp_path / f"a{suffix}"), packets(tmp_path / "source.mp4")
    assert len(copied) == len(source) == 2
    for there, here in zip(copied, source, strict=True):
        assert [data for data, _ in there] == [data for data, _ in here][: len(there)]
        assert len(there) >= len(here) - 2  # what is played from the end of the pictures on is left out
        for (_, time), (_, expected) in zip(there, here, strict=False):
            assert time == pytest.approx(expected, abs=0.002)


def test_sound_of_a_part_begins_with_its_first_frame(tmp_path):
    write_clip(tmp_path / "source.mp4", sound=["aac"], seconds=0.8)
    write(tmp_path / "a.mkv", count=3, times=uneven(), first_frame=3, audio_from=tmp_path / "source.mp4")
    (copied,), (source,) = packets(tmp_path / "a.mkv"), packets(tmp_path / "source.mp4")
    begin, end = 0.2, 0.8
    expected = [(data, time - begin) for data, time in source if begin <= time < end]
    assert len(expected) > 20
    assert [data for data, _ in copied] == [data for data, _ in expected]
    assert [time for _, time in copied] == pytest.approx([time for _, time in expected], abs=0.002)


def test_sound_that_a_container_cannot_hold(tmp_path):
    write_clip(tmp_path / "source.mkv", sound=["aac", "libopus"])
    for name in ("a.webm", "a.mov"):
        with pytest.raises(UsageError, match=rf"{name} cannot hold the sound of .*\(aac, opus\); write \.mkv"):
            write(tmp_path / name, audio_from=tmp_path / "source.mkv")
    with pytest.raises(UsageError, match=r"a\.gif has no place for sound"):
        write(tmp_path / "a.gif", audio_from=tmp_path / "source.mkv")
    write_clip(tmp_path / "silent.mp4")
    with pytest.raises(UsageError, match=r"silent\.mp4 has no sound"):
        write(tmp_path / "a.mp4", audio_from=tmp_path / "silent.mp4")
    (tmp_path / "text.txt").write_text("no sound" * 99)
    with pytest.raises(UsageError, match="no sound"):
        write(tmp_path / "a.mp4", audio_from=tmp_path / "text.txt")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["silent.mp4", "source.mkv", "text.txt"]


@pytest.mark.parametrize("suffix", [".gif", ".webp"])
def test_animations(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    writer = write(path, bit_depth=10, times=uneven())
    assert "lossy copy" in writer.notes[0]
    with Image.open(path) as picture:
        assert picture.n_frames == 6
        delays, seen = [], []
        for number in range(6):
            picture.seek(number)
            seen.append(np.asarray(picture.convert("RGB")).astype(int))
            delays.append(picture.info["duration"])
        assert picture.info["loop"] == 0
    assert delays == [40, 40, 120, 40, 260, 300]
    for read, expected in zip(seen, frames(6), strict=True):
        assert np.abs(read - expected).mean() < 8


def test_delays_of_a_gif_do_not_drift(tmp_path):
    video = VideoFormat(32, 24, Fraction(30000, 1001), 8, "420", COLOR)
    with open_writer(tmp_path / "a.gif", video) as writer:
        for frame in frames(15):
            writer.write(frame)
    with Image.open(tmp_path / "a.gif") as picture:
        delays = []
        for number in range(picture.n_frames):
            picture.seek(number)
            delays.append(picture.info["duration"])
    assert {*delays} == {30, 40}
    assert sum(delays) == pytest.approx(15 * 1001 / 30, abs=5)


def test_a_gif_of_many_frames_a_second_is_slower(tmp_path):
    video = VideoFormat(32, 24, Fraction(120), 8, "420", COLOR)
    with open_writer(tmp_path / "a.gif", video) as writer:
        for frame in frames(4):
            writer.write(frame)
    assert sum("so it is slower" in note for note in writer.notes) == 1


def test_animations_that_cannot_be_written(tmp_path, monkeypatch):
    with pytest.raises(UsageError, match="no frame"), open_writer(tmp_path / "a.gif", video_format()):
        pass
    monkeypatch.setattr("gsvc_tools.video.animation.MAX_HELD", 32 * 24 * 3 * 2)
    with pytest.raises(UsageError, match="memory"):
        write(tmp_path / "a.webp", count=3)
    wide = VideoFormat(16384, 1, Fraction(25), 8, "444", COLOR)
    with pytest.raises(UsageError, match="16383"):
        open_writer(tmp_path / "a.webp", wide)
    assert list(tmp_path.iterdir()) == []
