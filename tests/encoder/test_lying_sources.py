"""Sources that say how many frames they have and are wrong, and sources that break off."""

import io
import struct
import zlib

import numpy as np
import pytest
from codec_cases import Counting, complete_frames, encoded, fast, same, video_format, waves

from gsvc_base.errors import UsageError
from gsvc_ref.encoder import IncompleteEncodeError, encode
from gsvc_ref.stream import decode
from gsvc_ref.video import encode_png, open_video

CLIP = waves(24, 16, 4)
Y4M = b"YUV4MPEG2 W24 H16 F25:1 C444\n"


@pytest.mark.parametrize("settings", [fast(), fast(key_frames="auto"), fast(frames=(1, None)), fast(frames=(0, 3))])
@pytest.mark.parametrize("said", [None, 0, 1, 3, 4, 5, 1000, 2**40])
def test_the_header_and_the_progress_tell_the_truth(said, settings):
    seen, file = [], io.BytesIO()
    report = encode((CLIP, video_format(24, 16, frame_count=said)), file, settings, progress=seen.append)
    start, stop = settings.frames
    count = len(CLIP[start:stop])
    assert report.header.frame_count == len(report.frames) == len(list(decode(file.getvalue()))) == count
    assert file.getvalue() == encoded(CLIP, settings)[1]
    assert all(told.frame_count is None or told.frame < told.frame_count for told in seen)
    if said == 4:
        assert {told.frame_count for told in seen} == {count}


def test_a_negative_number_of_frames_is_refused():
    with pytest.raises(UsageError, match="frame_count is -1; it must be None"):
        video_format(frame_count=-1)


def test_a_y4m_file_whose_size_fits_other_frame_lines(tmp_path):
    """The number of frames follows from the size of the file; parameters in the frame lines make it wrong."""
    size = 24 * 16 * 3
    step = len(b"FRAME\n") + size
    line = b"FRAME" + b" Ip" * (step // 3)
    data = Y4M + b"".join(line[: 6 + step // 4].rstrip() + b"\n" + frame.tobytes() for frame in CLIP)
    path = tmp_path / "clip.y4m"
    path.write_bytes(data + bytes((len(Y4M) - len(data)) % step))
    with open_video(path) as reader:
        assert reader.format.frame_count not in (None, 4)
        file = io.BytesIO()
        with pytest.raises(IncompleteEncodeError, match=r"frame 4 must begin with FRAME.*saved: 4 complete frames"):
            encode(reader, file, fast())
    assert complete_frames(file.getvalue())[1] is None


@pytest.mark.parametrize("cut", [1, 700, 1151, 1152, 1157])
def test_a_y4m_file_that_was_cut_keeps_its_complete_frames(tmp_path, cut):
    path, target = tmp_path / "clip.y4m", tmp_path / "clip.gsvc"
    path.write_bytes((Y4M + b"".join(b"FRAME\n" + frame.tobytes() for frame in CLIP))[:-cut])
    with pytest.raises(IncompleteEncodeError) as caught:
        encode(path, target, fast(key_frames="auto"))
    assert caught.value.kind == "malformed"
    assert len(caught.value.report.frames) == 3
    assert len(list(decode(target))) == 3
    assert sorted(file.name for file in tmp_path.iterdir()) == ["clip.gsvc", "clip.y4m"]


def broken_png(data: bytes) -> bytes:
    """One bit of the pixels is wrong, and the checksums are right."""
    start = data.index(b"IDAT")
    length = struct.unpack(">I", data[start - 4 : start])[0]
    body = bytearray(data[start : start + 4 + length])
    body[len(body) // 2] ^= 4
    return data[:start] + bytes(body) + struct.pack(">I", zlib.crc32(body)) + data[start + 4 + length + 4 :]


BREAKS = {
    "damaged": lambda path: path.write_bytes(broken_png(path.read_bytes())),
    "cut": lambda path: path.write_bytes(path.read_bytes()[:60]),
    "empty": lambda path: path.write_bytes(b""),
    "gone": lambda path: path.unlink(),
    "a folder": lambda path: (path.unlink(), path.mkdir()),
    "another size": lambda path: path.write_bytes(encode_png(np.zeros((5, 4, 3), np.uint8))),
}


@pytest.mark.parametrize("breaks", BREAKS.values(), ids=BREAKS)
@pytest.mark.parametrize("key_frames", [(), "auto"])
def test_a_picture_that_cannot_be_read_ends_the_stream_before_it(tmp_path, breaks, key_frames):
    folder, target = tmp_path / "frames", tmp_path / "clip.gsvc"
    folder.mkdir()
    for number, frame in enumerate(CLIP):
        (folder / f"{number}.png").write_bytes(encode_png(frame))
    settings = fast(key_frames=key_frames)
    with open_video(folder) as reader:
        breaks(folder / "2.png")  # after the folder was listed, as a disk or a network does it
        with pytest.raises(IncompleteEncodeError, match="2 complete frames") as caught:
            encode(reader, target, settings)
    assert "2.png" in str(caught.value) or "frame 2" in str(caught.value)
    with open_video(folder / "0.png") as reader:
        color = reader.format.color
    assert color.matrix == 0
    expected = list(decode(encoded(CLIP[:2], settings)[1]))
    assert same(list(decode(target)), expected)


def test_a_stream_that_is_cut_can_be_encoded_again_up_to_there():
    _, data = encoded(CLIP, fast())
    with pytest.raises(IncompleteEncodeError, match=r"R-6\.2-4"):
        encode((decode(data[:-20]), video_format(24, 16)), io.BytesIO(), fast())


def test_a_video_that_libav_cannot_decode_to_its_end(tmp_path):
    av = pytest.importorskip("av")
    path = tmp_path / "clip.avi"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mjpeg", rate=25)
        stream.width, stream.height, stream.pix_fmt = 24, 16, "yuvj420p"
        for frame in waves(24, 16, 6):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24").reformat(format="yuvj420p")))
        container.mux(stream.encode(None))
    data = bytearray(path.read_bytes())
    places = [i for i in range(len(data)) if data[i : i + 3] == b"\xff\xd8\xff"]
    assert len(places) == 6
    data[places[4] : places[5] - 8] = bytes(places[5] - 8 - places[4])
    path.write_bytes(data)
    target = tmp_path / "clip.gsvc"
    with pytest.raises(IncompleteEncodeError, match="saved: 4 complete frames"):
        encode(path, target, fast(key_frames="auto"))
    assert len(list(decode(target))) == 4


def test_frames_that_never_end_stop_at_the_range():
    def endless():
        while True:
            yield CLIP[0]

    source = Counting(endless())
    report = encode((source, video_format(24, 16)), io.BytesIO(), fast(frames=(2, 5)))
    assert len(report.frames) == 3
    assert source.taken == 5
