"""Reading through PyAV, and viewing copies, on clips that the tests write themselves."""

import builtins
import io
import re
from contextlib import closing
from fractions import Fraction

import numpy as np
import pytest

from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.video import ColorDescription, VideoFormat, open_video, open_writer, to_rgb

av = pytest.importorskip("av")

SITING = "PyAV does not tell the chroma siting, so assumed: left"


def random_planes(shapes, peak, seed):
    rng = np.random.default_rng(seed)
    dtype = np.uint8 if peak == 255 else np.uint16
    return [rng.integers(0, peak + 1, shape, dtype=dtype) for shape in shapes]


def fill(picture, planes):
    for plane, samples in zip(picture.planes, planes, strict=True):
        lines = np.frombuffer(memoryview(plane), np.uint8).reshape(-1, plane.line_size).view(samples.dtype)
        lines[: samples.shape[0], : samples.shape[1]] = samples
    return picture


def write_clip(path, codec, pictures, *, rate=25, format=None, tags=None, rotation=0):
    """Encode pictures as they are; `tags` are attributes of the codec context."""
    with closing(av.open(str(path), "w", format=format)) as container:
        stream = container.add_stream(codec, rate=rate)
        stream.width, stream.height = pictures[0].width, pictures[0].height
        stream.pix_fmt = pictures[0].format.name
        if rotation:
            stream.set_display_rotation(rotation)
        for name, value in (tags or {}).items():
            setattr(stream.codec_context, name, value)
        for number, picture in enumerate(pictures):
            picture.pts, picture.time_base = number, 1 / Fraction(rate)
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))


def annex_b(frames, **tags):
    """Frames as an H.264 byte stream in which each frame stands for itself."""
    file = io.BytesIO()
    with closing(av.open(file, "w", format="h264")) as container:
        stream = container.add_stream("libx264", rate=25, options={"g": "1", "bf": "0"})
        stream.height, stream.width, _ = frames[0].shape
        stream.pix_fmt = "yuv420p"
        for name, value in tags.items():
            setattr(stream.codec_context, name, value)
        for frame in frames:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame)))
        container.mux(stream.encode(None))
    return file.getvalue()


def noise(width, height, count):
    return list(np.random.default_rng(0).integers(0, 256, (count, height, width, 3), np.uint8))


def smooth_frames(width, height, count, dtype=np.uint8, gain=1):
    y, x = np.mgrid[:height, :width]
    return [
        (np.stack([60 + x + i, 120 + y - i, 200 - x], axis=-1) * gain).astype(dtype) for i in range(count)
    ]  # (H, W, 3)


@pytest.mark.parametrize("chroma", ["420", "422", "444"])
@pytest.mark.parametrize("bit_depth", [8, 10])
@pytest.mark.parametrize("full", [False, True])
def test_lossless_yuv_is_converted_by_its_tags(tmp_path, chroma, bit_depth, full):
    color = ColorDescription(9, 16, 9, full, 0)
    video = VideoFormat(37, 23, Fraction(30000, 1001), bit_depth, chroma, color)
    name = f"yuv{chroma}p" + ("10le" if bit_depth == 10 else "")
    planes = [random_planes(video.plane_shapes, video.peak, seed) for seed in range(3)]
    pictures = [fill(av.VideoFrame(37, 23, name), samples) for samples in planes]
    tags = {"color_primaries": 9, "color_trc": 16, "colorspace": 9, "color_range": 2 if full else 1}
    write_clip(tmp_path / "clip.mkv", "ffv1", pictures, rate=Fraction(30000, 1001), tags=tags)
    with open_video(tmp_path / "clip.mkv") as reader:
        assert reader.format == video
        frames = list(reader)
        assert reader.notes == ([] if chroma == "444" else [SITING])
    assert len(frames) == 3
    for frame, samples in zip(frames, planes, strict=True):
        np.testing.assert_array_equal(frame, to_rgb(samples, video))


def test_unknown_colour_is_stated(tmp_path):
    path = tmp_path / "clip.mkv"
    write_clip(path, "ffv1", [av.VideoFrame(16, 16, "yuv420p")])
    with open_video(path) as reader:
        assert reader.notes == [
            SITING,
            f"colour not stated by {path}, so assumed: matrix BT.601 (at most 576 rows), limited range",
        ]
        assert reader.format.color == ColorDescription(2, 2, 6, False, 0)


@pytest.mark.parametrize(
    ("codec", "name", "suffix"), [("qtrle", "rgb24", "mov"), ("ffv1", "bgr0", "mkv"), ("rawvideo", "bgr24", "avi")]
)
def test_rgb_is_taken_as_it_is(tmp_path, codec, name, suffix):
    frames = smooth_frames(32, 20, 2)
    pictures = [av.VideoFrame.from_ndarray(frame, format="rgb24").reformat(format=name) for frame in frames]
    path = tmp_path / f"clip.{suffix}"
    write_clip(path, codec, pictures)
    with open_video(path) as reader:
        assert reader.format.chroma_format == "rgb"
        for frame, expected in zip(reader, frames, strict=True):
            np.testing.assert_array_equal(frame, expected)


def test_lines_stored_bottom_up(tmp_path):
    """An AVI file with a positive height: the muxer wrote a negative one, for top-down."""
    frames = smooth_frames(32, 20, 2)
    path = tmp_path / "clip.avi"
    write_clip(path, "rawvideo", [av.VideoFrame.from_ndarray(frame).reformat(format="bgr24") for frame in frames])
    data = bytearray(path.read_bytes())
    height = data.index(b"strf") + 16
    assert data[height : height + 4] == (-20).to_bytes(4, "little", signed=True)
    data[height : height + 4] = (20).to_bytes(4, "little")
    path.write_bytes(data)
    with open_video(path) as reader:
        for frame, expected in zip(reader, frames, strict=True):
            np.testing.assert_array_equal(frame, expected[::-1])


def test_grey(tmp_path):
    samples = random_planes([(9, 12)], 255, 0)
    write_clip(tmp_path / "clip.mkv", "ffv1", [fill(av.VideoFrame(12, 9, "gray"), samples)], tags={"color_range": 2})
    with open_video(tmp_path / "clip.mkv") as reader:
        (frame,) = reader
        assert reader.notes == []
    np.testing.assert_array_equal(frame, np.repeat(samples[0][..., None], 3, axis=-1))


def test_a_format_without_a_plain_layout_goes_through_libswscale(tmp_path):
    picture = av.VideoFrame(32, 32, "yuv411p")
    fill(picture, [np.full((32, 32), 126, np.uint8), np.full((32, 8), 128, np.uint8), np.full((32, 8), 128, np.uint8)])
    write_clip(tmp_path / "clip.mkv", "ffv1", [picture], tags={"colorspace": 1, "color_range": 2})
    with open_video(tmp_path / "clip.mkv") as reader:
        (frame,) = reader
        assert reader.notes == ["pixel format yuv411p is read through libswscale as yuv444p"]
    np.testing.assert_array_equal(frame, np.full((32, 32, 3), 126))


def test_alpha_must_be_opaque(tmp_path):
    frame = np.dstack([smooth_frames(32, 20, 1)[0], np.full((20, 32), 255, np.uint8)])
    clear = frame.copy()
    clear[3, 4, 3] = 0
    for name, frames in (("opaque", [frame, frame]), ("clear", [frame, clear])):
        pictures = [av.VideoFrame.from_ndarray(rgba, format="rgba").reformat(format="argb") for rgba in frames]
        write_clip(tmp_path / f"{name}.mov", "qtrle", pictures)
    with open_video(tmp_path / "opaque.mov") as reader:
        np.testing.assert_array_equal(list(reader)[1], frame[..., :3])
        (note,) = reader.notes
        assert re.search("the alpha channel of .*opaque.mov is left out", note)
    with open_video(tmp_path / "clear.mov") as reader:
        next(reader)
        with pytest.raises(GsvcError, match=r"frame 1 of .*clear\.mov is transparent in places") as caught:
            next(reader)
    assert caught.value.kind == "unsupported"


def test_a_matrix_beyond_us(tmp_path):
    write_clip(tmp_path / "clip.mkv", "ffv1", [av.VideoFrame(16, 16, "yuv420p")], tags={"colorspace": 10})
    with pytest.raises(GsvcError, match="colour matrix 10") as caught:
        open_video(tmp_path / "clip.mkv")
    assert caught.value.kind == "unsupported"


def test_damage_from_the_start(tmp_path):
    path = tmp_path / "clip.mp4"
    with closing(av.open(str(path), "w", options={"movflags": "faststart"})) as container:
        stream = container.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 16, 16, "yuv420p"
        container.mux(stream.encode(av.VideoFrame(16, 16, "yuv420p")))
        container.mux(stream.encode(None))
    data = path.read_bytes()
    start = data.index(b"mdat") + 4
    path.write_bytes(data[:start] + b"\xff" * (len(data) - start))
    with pytest.raises(GsvcError, match="not a video that FFmpeg can read") as caught:
        open_video(path)
    assert caught.value.kind == "malformed"


def test_files_without_a_frame(tmp_path):
    path = tmp_path / "clip.mp4"
    with closing(av.open(str(path), "w", options={"movflags": "frag_keyframe+empty_moov"})) as container:
        stream = container.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 16, 16, "yuv420p"
        container.mux(stream.encode(av.VideoFrame(16, 16, "yuv420p")))
        container.mux(stream.encode(None))
    data = path.read_bytes()
    path.write_bytes(data[: data.index(b"moof") - 4])
    with pytest.raises(GsvcError, match="holds no frame") as caught:
        open_video(path)
    assert caught.value.kind == "malformed"


def test_only_the_first_video_stream_is_read(tmp_path):
    path = tmp_path / "two.mkv"
    with closing(av.open(str(path), "w")) as container:
        for _ in range(2):
            stream = container.add_stream("ffv1", rate=25)
            stream.width, stream.height, stream.pix_fmt = 16, 16, "bgr0"
        for stream, count in zip(container.streams.video, (2, 3), strict=True):
            for number in range(count):
                picture = av.VideoFrame(16, 16, "bgr0")
                picture.pts, picture.time_base = number, Fraction(1, 25)
                container.mux(stream.encode(picture))
            container.mux(stream.encode(None))
    with open_video(path) as reader:
        assert reader.notes == [f"{path} holds 2 video streams; the first one is read"]
        assert len(list(reader)) == 2


def test_metadata_in_another_encoding(tmp_path):
    path = tmp_path / "clip.mkv"
    with closing(av.open(str(path), "w")) as container:
        container.metadata["title"] = "Cafe"
        stream = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 16, 16, "bgr0"
        container.mux(stream.encode(av.VideoFrame(16, 16, "bgr0")))
        container.mux(stream.encode(None))
    data = path.read_bytes()
    assert b"Cafe" in data
    path.write_bytes(data.replace(b"Cafe", b"Caf\xe9"))
    with open_video(path) as reader:
        assert len(list(reader)) == 1


def test_colour_tags_that_change_are_stated(tmp_path):
    (frame,) = noise(32, 32, 1)
    (tmp_path / "clip.h264").write_bytes(annex_b([frame], colorspace=1) + annex_b([frame], colorspace=6))
    with open_video(tmp_path / "clip.h264") as reader:
        first, second = reader
        assert reader.format.color.matrix == 1
        assert f"{tmp_path / 'clip.h264'} changes its colour tags at frame 1; each frame is converted by its own" in (
            reader.notes
        )
    assert np.abs(first.astype(int) - second).mean() > 2


def test_interlacing_is_stated(tmp_path):
    path = tmp_path / "clip.mpg"
    with closing(av.open(str(path), "w")) as container:
        stream = container.add_stream("mpeg2video", rate=25, options={"flags": "+ildct+ilme"})
        stream.width, stream.height, stream.pix_fmt = 32, 32, "yuv420p"
        container.mux(stream.encode(av.VideoFrame(32, 32, "yuv420p")))
        container.mux(stream.encode(None))
    with open_video(path) as reader:
        assert len(list(reader)) == 1
        assert f"{path} is interlaced; its frames are read as if progressive" in reader.notes


def test_uneven_frames_are_stated(tmp_path):
    for name, times in (("even.mkv", [0, 40, 80, 120]), ("uneven.mkv", [0, 40, 80, 400])):
        with closing(av.open(str(tmp_path / name), "w")) as container:
            stream = container.add_stream("ffv1", rate=25)
            stream.width, stream.height, stream.pix_fmt = 16, 16, "bgr0"
            stream.codec_context.time_base = Fraction(1, 1000)
            for time in times:
                picture = av.VideoFrame(16, 16, "bgr0")
                picture.pts, picture.time_base = time, Fraction(1, 1000)
                container.mux(stream.encode(picture))
            container.mux(stream.encode(None))
        with open_video(tmp_path / name) as reader:
            assert len(list(reader)) == 4
            assert any("not evenly spaced" in note for note in reader.notes) == (name == "uneven.mkv")


def test_an_unknown_frame_rate_is_stated(tmp_path, monkeypatch):
    path = tmp_path / "clip.mkv"
    write_clip(path, "ffv1", [av.VideoFrame(16, 16, "bgr0")], rate=50)
    monkeypatch.setattr("gsvc_tools.video.libav._fair_ratio", lambda ratio: None)
    with open_video(path) as reader:
        assert reader.format.frame_rate == 25
        assert reader.notes == [f"frame rate not stated by {path}, so assumed: 25 per second"]


def test_motion_jpeg_states_everything(tmp_path):
    write_clip(tmp_path / "clip.avi", "mjpeg", [av.VideoFrame(16, 16, "yuvj420p")])
    with open_video(tmp_path / "clip.avi") as reader:
        assert reader.format.color == ColorDescription(2, 2, 5, True, 1)
        assert reader.notes == []


def test_limited_range_rgb_is_expanded(tmp_path):
    frame = np.full((16, 16, 3), 235, np.uint8)
    frame[:, 8:] = [16, 126, 235]
    picture = av.VideoFrame.from_ndarray(frame, format="rgb24").reformat(format="bgr0")
    write_clip(tmp_path / "clip.mkv", "ffv1", [picture], tags={"color_range": 1})
    with open_video(tmp_path / "clip.mkv") as reader:
        assert reader.format.color == ColorDescription(2, 2, 0, False, 0)
        (read,) = reader
    assert read[0, 0].tolist() == [255, 255, 255]
    assert read[0, 15].tolist() == [0, 128, 255]


def test_an_impossible_matrix_tag_counts_as_unspecified(tmp_path):
    write_clip(tmp_path / "clip.mkv", "ffv1", [av.VideoFrame(16, 16, "yuv420p")], tags={"colorspace": 0})
    with open_video(tmp_path / "clip.mkv") as reader:
        assert reader.format.color.matrix == 6
        assert "matrix BT.601" in reader.notes[1]


def test_frames_that_change_size(tmp_path):
    (tmp_path / "clip.h264").write_bytes(annex_b(noise(32, 32, 3)) + annex_b(noise(48, 32, 2)))
    with open_video(tmp_path / "clip.h264") as reader:
        assert [next(reader).shape for _ in range(3)] == [(32, 32, 3)] * 3
        with pytest.raises(
            GsvcError, match=r"frame 3 of .* is 48x32 with 8 bits, the frames before are 32x32"
        ) as caught:
            next(reader)
    assert caught.value.kind == "invalid"


def test_a_damaged_frame_is_named(tmp_path):
    frames = [annex_b([frame]) for frame in noise(64, 64, 8)]
    frames[4] = frames[4][: len(frames[4]) // 2]
    (tmp_path / "clip.h264").write_bytes(b"".join(frames))
    with open_video(tmp_path / "clip.h264") as reader:
        for _ in range(4):
            next(reader)
        with pytest.raises(GsvcError, match=r"frame 4 of .*clip\.h264 is damaged") as caught:
            next(reader)
    assert caught.value.kind == "malformed"


def test_a_file_that_is_cut_off_gives_the_frames_before(tmp_path):
    path = tmp_path / "clip.mp4"
    with closing(av.open(str(path), "w", options={"movflags": "faststart"})) as container:
        stream = container.add_stream("libx264", rate=25, options={"g": "1", "bf": "0"})
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for frame in noise(64, 48, 10):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame)))
        container.mux(stream.encode(None))
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 6 // 10])
    delivered = []

    def read():
        with open_video(path) as reader:
            delivered.extend(reader)

    with pytest.raises(GsvcError, match=r"is damaged") as caught:
        read()
    assert caught.value.kind == "malformed"
    assert len(delivered) == 5


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("notes.txt", b"a line of text\n" * 50, "text file"),
        ("clip.mp4", b"a line of text\n" * 50, "not a video that FFmpeg can read"),
        ("clip.bin", b"\xfe" * 5000, "not a video that FFmpeg can read"),
        ("sub.srt", b"1\n00:00:00,000 --> 00:00:01,000\nhello\n", "holds no video"),
        ("list.m3u8", b"#EXTM3U\n#EXTINF:1,\nhttp://127.0.0.1:9/a.ts\n", "not a video that FFmpeg can read"),
    ],
)
def test_files_that_are_no_video(tmp_path, capfd, name, data, message):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(GsvcError, match=message) as caught:
        open_video(tmp_path / name)
    assert caught.value.kind == "malformed"
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("suffix", [".mp4", ".mkv", ".mov", ".webm"])
@pytest.mark.parametrize(("width", "height"), [(64, 48), (33, 17)])
@pytest.mark.parametrize("bit_depth", [8, 10])
def test_viewing_copies_look_like_the_frames(tmp_path, capfd, suffix, width, height, bit_depth):
    color = ColorDescription(1, 13, 0, True, 0)
    dtype, gain = (np.uint8, 1) if bit_depth == 8 else (np.uint16, 4)
    video = VideoFormat(width, height, Fraction(24000, 1001), bit_depth, "rgb", color)
    frames = smooth_frames(width, height, 4, dtype, gain)
    path = tmp_path / f"copy{suffix}"
    with open_writer(path, video) as writer:
        for frame in frames:
            writer.write(frame)
        kept = 8 if suffix == ".webm" else bit_depth
        encoder = "libvpx-vp9" if suffix == ".webm" else "libx264"
        assert writer.notes == [
            f"copy{suffix} is a lossy copy for viewing ({kept} bits, {encoder}); y4m and PNG hold the frames exactly"
        ]
        assert not path.exists()
    assert list(tmp_path.iterdir()) == [path]
    with open_video(path) as reader:
        assert (reader.format.width, reader.format.height) == (width, height)
        assert reader.format.frame_rate == Fraction(24000, 1001)
        assert reader.format.color == ColorDescription(1, 13, 6, False, 0)
        for frame, expected in zip(reader, frames, strict=True):
            fine = 2 ** (kept - 8)
            assert np.abs(frame / fine - expected / gain).mean() < 2
    assert capfd.readouterr().err == ""


def test_a_viewing_copy_keeps_the_pixel_shape(tmp_path):
    video = VideoFormat(32, 32, Fraction(25), 8, "420", ColorDescription(1, 1, 1, False, 0), Fraction(128, 117))
    for name in ("copy.mp4", "copy.webm"):
        with open_writer(tmp_path / name, video) as writer:
            writer.write(smooth_frames(32, 32, 1)[0])
    assert writer.notes[1:] == ["copy.webm does not carry the pixel shape 128/117"]
    with open_video(tmp_path / "copy.mp4") as reader:
        assert reader.format.sample_aspect_ratio == Fraction(128, 117)


def test_viewing_copies_that_cannot_be_written_leave_nothing(tmp_path):
    video = VideoFormat(65535, 1, Fraction(25), 8, "rgb", ColorDescription(1, 1, 0, True, 0))
    with pytest.raises(UsageError, match="does not take 65535x1"):
        open_writer(tmp_path / "copy.mp4", video)
    small = VideoFormat(16, 16, Fraction(25), 8, "rgb", ColorDescription(1, 1, 0, True, 0))
    with pytest.raises(UsageError, match="no frame to write"), open_writer(tmp_path / "copy.mp4", small):
        pass
    writer = open_writer(tmp_path / "copy.mp4", small)
    writer.write(np.zeros((16, 16, 3), np.uint8))
    writer.abort()
    assert list(tmp_path.iterdir()) == []


def test_without_pyav_the_message_says_what_to_install(tmp_path, monkeypatch):
    real_import = builtins.__import__

    def refuse(name, *arguments, **options):
        if name == "av":
            raise ImportError(name)
        return real_import(name, *arguments, **options)

    (tmp_path / "clip.mp4").write_bytes(b"anything")
    monkeypatch.setattr(builtins, "__import__", refuse)
    video = VideoFormat(16, 16, Fraction(25), 8, "rgb", ColorDescription(1, 1, 0, True, 0))
    for attempt in (lambda: open_video(tmp_path / "clip.mp4"), lambda: open_writer(tmp_path / "copy.mp4", video)):
        with pytest.raises(UsageError, match=r"pip install 'gsvc_ref\[video\]'"):
            attempt()
    assert [path.name for path in tmp_path.iterdir()] == ["clip.mp4"]
