"""What gets lost of a file is told before its frames are read; time stamps and display matrices are used."""

import io
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("av")

from tools.video.odd_clips import SIZE, write_clip

from gsvc_base.errors import GsvcError
from gsvc_ref.video import open_video
from gsvc_tools.video.libav_probe import Orientation, is_even

PQ = {"color_primaries": 9, "color_trc": 16, "colorspace": 9}
MASTERING = "master-display=G(13250,34500)B(7500,3000)R(34000,16000)WP(15635,16450)L(10000000,50):max-cll=1000,400"


def notes_at_opening(path):
    """The notes before the first frame; reading all frames must not add any."""
    with open_video(path) as reader:
        notes = list(reader.notes)
        assert list(reader)
        assert reader.notes == notes
    return "\n".join(notes)


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("a.mp4", {"sound": ["aac"]}, ["sound (1 track: aac)", "--audio-from"]),
        (
            "a.mkv",
            {"sound": ["aac", "libopus"], "subtitles": True, "chapters": True},
            ["sound (2 tracks: aac, opus)", "subtitles (1 track", "1 chapter mark"],
        ),
        ("a.webm", {"codec": "libvpx-vp9", "pix_fmt": "yuva420p"}, ["a track of transparency"]),
        ("a.mov", {"codec": "qtrle", "pix_fmt": "argb"}, ["the alpha channel of", "is left out"]),
        (
            "a.mp4",
            {
                "codec": "libx265", "pix_fmt": "yuv420p10le", "tags": PQ,
                "options": {"x265-params": f"log-level=none:{MASTERING}:hdr10=1"},
            },
            ["left out: mastering display, content light level"],
        ),
        ("a.mp4", {"options": {"x264-params": "tff=1"}}, ["is interlaced"]),
        ("a.mp4", {"times": [0, 40, 80, 200]}, ["not evenly spaced in time", "per second on average"]),
    ],
)  # fmt: skip
def test_what_is_lost_is_told_at_opening(tmp_path, name, options, said):
    write_clip(tmp_path / name, **options)
    notes = notes_at_opening(tmp_path / name)
    assert all(sentence in notes for sentence in said), notes


def test_a_plain_clip_has_nothing_to_lose(tmp_path):
    write_clip(tmp_path / "a.mp4", tags={"color_range": 1, "colorspace": 1})
    assert notes_at_opening(tmp_path / "a.mp4") == "PyAV does not tell the chroma siting, so assumed: left"


def test_a_transparent_frame_is_refused_at_opening(tmp_path):
    from tools.video.test_libav import av
    from tools.video.test_libav import write_clip as write_pictures

    clear = av.VideoFrame.from_ndarray(np.zeros((24, 32, 4), np.uint8), format="rgba").reformat(format="argb")
    write_pictures(tmp_path / "a.mov", "qtrle", [clear])
    with pytest.raises(GsvcError, match=r"frame 0 of .* is transparent"):
        open_video(tmp_path / "a.mov")


def corner(frame):
    """Where the bright corner of a frame is, as (top or bottom, left or right) by 0 and 1."""
    bright = frame[..., 2] < 60
    rows, columns = np.nonzero(bright)
    return int(rows.mean() > frame.shape[0] / 2), int(columns.mean() > frame.shape[1] / 2)


@pytest.mark.parametrize(
    ("degrees", "place", "said"),
    [
        (90, (1, 0), "rotated by 90 degrees counterclockwise"),
        (-90, (0, 1), "rotated by 90 degrees clockwise"),
        (180, (1, 1), "rotated by 180 degrees"),
    ],
)
def test_a_display_matrix_is_applied(tmp_path, degrees, place, said):
    """PyAV counts degrees counterclockwise, as FFmpeg's av_display_rotation_get does."""
    write_clip(tmp_path / "a.mp4", rotation=degrees, times=[0], tags={"sample_aspect_ratio": Fraction(4, 3)})
    with open_video(tmp_path / "a.mp4") as reader:
        (frame,) = reader
        turned = degrees != 180
        assert (reader.format.width, reader.format.height) == (SIZE[::-1] if turned else SIZE)
        assert frame.shape[:2] == (reader.format.height, reader.format.width)
        assert reader.format.sample_aspect_ratio == (Fraction(3, 4) if turned else Fraction(4, 3))
        assert f"{tmp_path / 'a.mp4'} is {said}, as its display matrix says" in reader.notes
    assert corner(frame) == place


def test_a_mirrored_picture(tmp_path):
    """The matrix in the track header of an MP4 file, patched: x' = -x, as front cameras write it."""
    path = tmp_path / "a.mp4"
    write_clip(path, times=[0])
    data = bytearray(path.read_bytes())
    matrix = data.index(b"tkhd") + 44
    assert data[matrix : matrix + 4] == bytes([0, 1, 0, 0])  # 1 as 16.16
    data[matrix : matrix + 4] = bytes([255, 255, 0, 0])
    path.write_bytes(data)
    with open_video(path) as reader:
        (frame,) = reader
        assert any("mirrored left to right" in note for note in reader.notes)
    assert corner(frame) == (0, 1)


def test_orientations():
    frame = np.arange(6, dtype=np.uint8).reshape(2, 3, 1).repeat(3, axis=2)
    clockwise = Orientation(swapped=True, mirrored=True).apply(frame)
    np.testing.assert_array_equal(clockwise, np.rot90(frame, -1))
    np.testing.assert_array_equal(Orientation(swapped=True, flipped=True).apply(frame), np.rot90(frame))
    np.testing.assert_array_equal(Orientation(mirrored=True, flipped=True).apply(frame), np.rot90(frame, 2))


def test_times_of_uneven_frames(tmp_path):
    times = [0, 40, 80, 200, 240, 500, 540]
    write_clip(tmp_path / "a.mp4", times=times)  # with B-frames, whose packets stand in another order
    with open_video(tmp_path / "a.mp4") as reader:
        found = [reader.frame_time for _ in reader]
        assert found == [Fraction(time, 1000) for time in times]
        assert reader.end_time > found[-1]
        assert all(time % reader.time_base == 0 for time in found)
    data = (tmp_path / "a.mp4").read_bytes()
    with io.BytesIO(b"before" + data) as file:
        file.seek(len(b"before"))
        file = io.BytesIO(file.read())  # a file object is read twice from where it stands
        with open_video(file) as reader:
            assert [reader.frame_time for _ in reader] == found


@pytest.mark.parametrize(
    ("unit", "rate"), [(Fraction(1, 1000), Fraction(30)), (Fraction(1, 600), Fraction(30000, 1001))]
)
def test_rounded_times_are_even(unit, rate):
    times = np.rint(np.arange(300) / float(rate * unit)).astype(np.int64)
    assert is_even(times, unit, rate)
    times[200:] += int(0.5 / (rate * unit))
    assert not is_even(times, unit, rate)


def test_a_frame_left_out_is_uneven():
    """AVI counts time in frames: its unit is as long as a frame."""
    assert not is_even(np.array([0, 1, 2, 4, 5]), Fraction(1, 25), Fraction(25))


def test_even_frames_have_no_times(tmp_path):
    write_clip(tmp_path / "a.mkv", times=[0, 33, 67, 100, 133, 167], rate=30)
    with open_video(tmp_path / "a.mkv") as reader:
        assert [reader.frame_time for _ in reader] == [None] * 6
        assert reader.format.frame_rate == 30


def test_exif_orientation_is_applied(tmp_path: Path):
    from PIL import Image

    picture = Image.new("RGB", SIZE, (60, 90, 200))
    picture.paste((250, 240, 20), (0, 0, SIZE[0] // 3, SIZE[1] // 3))
    exif = Image.Exif()
    exif[0x0112] = 6  # to be rotated clockwise
    picture.save(tmp_path / "a.jpg", exif=exif, quality=95)
    with open_video(tmp_path / "a.jpg") as reader:
        (frame,) = reader
        assert any("EXIF orientation" in note for note in reader.notes)
    assert frame.shape == (SIZE[0], SIZE[1], 3)
    assert corner(frame) == (0, 1)
