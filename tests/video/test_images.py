"""Folders and single files of pictures as video."""

import io
from fractions import Fraction

import numpy as np
import pytest
from PIL import Image

from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.video import ColorDescription, VideoFormat, encode_png, open_video, open_writer
from gsvc_ref.video.images import decode_image, missing_numbers, natural_key
from gsvc_ref.video.png import PNG_SIGNATURE

RGB = ColorDescription(1, 13, 0, True, 0)
RATE_NOTE = "pictures state no frame rate, so assumed: 25 per second"


def make_format(width=5, height=4, bit_depth=8):
    return VideoFormat(width, height, Fraction(25), bit_depth, "rgb", RGB)


def random_frames(video, count):
    rng = np.random.default_rng(count)
    shape = (video.height, video.width, 3)
    return [rng.integers(0, video.peak + 1, shape, dtype=video.dtype) for _ in range(count)]


def jpeg(frame, **options):
    file = io.BytesIO()
    picture = frame if isinstance(frame, Image.Image) else Image.fromarray(frame)
    picture.save(file, "JPEG", quality=95, **options)
    return file.getvalue()


@pytest.mark.parametrize("bit_depth", [8, 10, 12, 16])
def test_folder_round_trip(tmp_path, bit_depth):
    video = make_format(bit_depth=bit_depth)
    frames = random_frames(video, 12)
    with open_writer(tmp_path / "out", video) as writer:
        for frame in frames:
            writer.write(frame)
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert names == [f"frame_{i:06d}.png" for i in range(12)]
    with open_video(tmp_path / "out") as reader:
        assert reader.format == VideoFormat(5, 4, Fraction(25), bit_depth, "rgb", RGB, frame_count=12)
        assert reader.notes == [RATE_NOTE]
        for frame, original in zip(reader, frames, strict=True):
            assert frame.dtype == video.dtype
            np.testing.assert_array_equal(frame, original)


def test_natural_order():
    names = ["b1", "a10.png", "a9.png", "a09.png", "a1b2", "a1b10", "10", "9"]
    assert sorted(names, key=natural_key) == ["9", "10", "a1b2", "a1b10", "a09.png", "a9.png", "a10.png", "b1"]


def test_a_folder_of_mixed_pictures(tmp_path):
    grey = np.full((4, 5, 3), 77, np.uint8)
    frames = random_frames(make_format(), 2)
    Image.fromarray(grey[..., 0]).save(tmp_path / "shot10.png")
    (tmp_path / "shot2.PNG").write_bytes(encode_png(frames[0]))
    (tmp_path / "shot1.jpg").write_bytes(jpeg(grey))
    (tmp_path / ".hidden.png").write_bytes(b"no picture")
    (tmp_path / "readme.txt").write_text("no picture")
    (tmp_path / "folder.png").mkdir()
    read = list(open_video(tmp_path))
    assert len(read) == 3
    np.testing.assert_array_equal(read[0], grey)
    np.testing.assert_array_equal(read[1], frames[0])
    np.testing.assert_array_equal(read[2], grey)


@pytest.mark.parametrize("kind", ["path", "file"])
def test_a_single_picture_is_a_video_of_one_frame(tmp_path, kind):
    (frame,) = random_frames(make_format(), 1)
    with open_writer(tmp_path / "one.png", make_format()) as writer:
        writer.write(frame)
    assert [path.name for path in tmp_path.iterdir()] == ["one.png"]
    source = tmp_path / "one.png" if kind == "path" else io.BytesIO((tmp_path / "one.png").read_bytes())
    with open_video(source) as reader:
        assert reader.format.frame_count == 1
        np.testing.assert_array_equal(next(reader), frame)
        assert list(reader) == []


def test_jpeg(tmp_path):
    y, x = np.mgrid[:40, :50]
    frame = np.stack([100 + x, 150 - y, 60 + x + y], axis=-1).astype(np.uint8)
    exif = Image.Exif()
    exif[0x0112] = 6
    (tmp_path / "one.jpeg").write_bytes(jpeg(frame, exif=exif))
    with open_video(tmp_path / "one.jpeg") as reader:
        (read,) = reader
        assert reader.notes == ["a JPEG is turned as its EXIF orientation says"]
    assert np.abs(read.astype(int) - np.rot90(frame, -1)).max() <= 6


@pytest.mark.parametrize(
    ("data", "name", "kind", "message"),
    [
        (jpeg(np.zeros((40, 40, 3), np.uint8))[:200], "x.jpg", "malformed", "not a valid JPEG"),
        (jpeg(Image.new("CMYK", (4, 4))), "x.jpg", "unsupported", "CMYK"),
        (b"some text", "x.png", "unsupported", "neither a PNG nor a JPEG"),
        (b"", "x.png", "malformed", "empty"),
    ],
)
def test_damaged_pictures(tmp_path, data, name, kind, message):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(GsvcError, match=message) as caught:
        open_video(tmp_path / name)
    assert caught.value.kind == kind


def test_a_jpeg_bomb_is_refused(tmp_path):
    data = bytearray(jpeg(np.zeros((4, 4, 3), np.uint8)))
    start = data.index(b"\xff\xc0")
    data[start + 5 : start + 9] = b"\xff\xff\xff\xff"
    (tmp_path / "x.jpg").write_bytes(data)
    with pytest.raises(GsvcError, match=r"65535x65535.*scale the video down") as caught:
        open_video(tmp_path / "x.jpg")
    assert caught.value.kind == "limit"


def test_a_file_of_2_gib_is_not_read(tmp_path):
    """Nearly all of it is a hole."""
    with (tmp_path / "a.png").open("wb") as file:
        file.write(PNG_SIGNATURE)
        file.truncate(1 << 31)
    with pytest.raises(GsvcError, match="2147483648 bytes; a picture takes at most 1073741824"):
        open_video(tmp_path / "a.png")


def test_pictures_that_differ_are_named(tmp_path):
    (tmp_path / "a1.png").write_bytes(encode_png(np.zeros((4, 5, 3), np.uint8)))
    (tmp_path / "a2.png").write_bytes(encode_png(np.zeros((5, 5, 3), np.uint8)))
    reader = open_video(tmp_path)
    next(reader)
    with pytest.raises(GsvcError, match=r"a1\.png is 5x4 with 8 bits, .*a2\.png is 5x5 with 8") as caught:
        next(reader)
    assert caught.value.kind == "invalid"
    (tmp_path / "a2.png").write_bytes(encode_png(np.zeros((4, 5, 3), np.uint16), 12))
    with pytest.raises(GsvcError, match="5x4 with 12"):
        list(open_video(tmp_path))


def test_a_folder_without_pictures(tmp_path):
    with pytest.raises(GsvcError, match=r"holds no \.png") as caught:
        open_video(tmp_path)
    assert caught.value.kind == "invalid"


def test_a_folder_with_pictures_is_not_written_into(tmp_path):
    (tmp_path / "mine.png").write_bytes(encode_png(np.zeros((4, 5, 3), np.uint8)))
    with pytest.raises(UsageError, match="holds pictures already"):
        open_writer(tmp_path, make_format())


def test_aborting_a_folder_removes_what_was_written(tmp_path):
    (frame,) = random_frames(make_format(), 1)
    for name in ("new", "old"):
        writer = open_writer(tmp_path / name if name == "new" else tmp_path, make_format())
        writer.write(frame)
        writer.abort()
        writer.abort()
        writer.close()
        assert list(tmp_path.iterdir()) == []


def test_aborting_keeps_a_folder_that_others_use(tmp_path):
    writer = open_writer(tmp_path / "new", make_format())
    writer.write(random_frames(make_format(), 1)[0])
    (tmp_path / "new" / "notes.txt").write_text("mine")
    writer.abort()
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["notes.txt"]


@pytest.mark.parametrize("count", [0, 2])
def test_a_png_file_holds_one_frame(tmp_path, count):
    def write_all():
        with open_writer(tmp_path / "x.png", make_format()) as writer:
            for frame in random_frames(make_format(), count):
                writer.write(frame)

    with pytest.raises(UsageError, match=r"holds one frame|no frame"):
        write_all()
    assert list(tmp_path.iterdir()) == []


def test_a_warning_about_a_jpeg_that_the_process_takes_for_an_error():
    data = jpeg(np.zeros((4, 4, 3), np.uint8))
    exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x05"  # five entries, none there
    with pytest.raises(GsvcError, match="not a valid JPEG"):  # pytest takes warnings for errors
        decode_image(data[:2] + b"\xff\xe1" + (2 + len(exif)).to_bytes(2, "big") + exif + data[2:], "x.jpg")


@pytest.mark.parametrize(
    ("numbers", "told"),
    [
        ([0, 1, 2], None),
        ([3, 4], None),
        ([0, 1, 6, 8], "2-5, 7"),
        ([0, 2, 4, 6, 8, 10], "1, 3, 5, 7, ..."),
    ],
)
def test_gaps_in_the_numbers_are_told(tmp_path, numbers, told):
    for number in numbers:
        Image.fromarray(np.zeros((4, 5, 3), np.uint8)).save(tmp_path / f"frame_{number:03}.png")
    with open_video(tmp_path) as reader:
        notes = [f"the numbers in {tmp_path} have gaps ({told}); frames are counted without them"] if told else []
        assert reader.notes == [RATE_NOTE, *notes]
        assert len(list(reader)) == len(numbers)


@pytest.mark.parametrize("names", [["a1", "b7"], ["a1", "b"], ["1a", "9a"], ["5"], ["01", "1", "2"]])
def test_other_names_have_no_gaps(names):
    assert missing_numbers(names) == []
