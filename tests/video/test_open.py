"""Choosing a reader or writer, and what stands on the disk when things go wrong."""

import errno
import io
import os
import sys
import threading
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.files import PartialFile
from gsvc_ref.video import ColorDescription, VideoFormat, VideoReader, encode_png, open_video, open_writer

VIDEO = VideoFormat(6, 4, Fraction(25), 8, "444", ColorDescription(1, 1, 1, False, 0))
FRAME = np.full((4, 6, 3), 90, np.uint8)


def y4m_bytes(count=1):
    target = io.BytesIO()
    with open_writer(target, VIDEO) as writer:
        for _ in range(count):
            writer.write(FRAME)
    return target.getvalue()


class Standard:
    """Stands in for sys.stdin or sys.stdout."""

    def __init__(self, buffer):
        self.buffer = buffer


@pytest.mark.parametrize("name", ["clip.y4m", "clip.mp4", "clip.png", "clip"])
def test_content_decides_not_the_name(tmp_path, name):
    (tmp_path / name).write_bytes(y4m_bytes(2))
    with open_video(str(tmp_path / name)) as reader:
        assert reader.format == replace(VIDEO, frame_count=2)
        assert len(list(reader)) == 2
    (tmp_path / "picture.bin").write_bytes(encode_png(FRAME))
    with open_video(tmp_path / "picture.bin") as reader:
        assert reader.format.chroma_format == "rgb"


def test_open_files(tmp_path):
    pytest.importorskip("av")
    with open_writer(tmp_path / "clip.mkv", VIDEO) as writer:
        writer.write(FRAME)
    for data, chroma in (
        (y4m_bytes(), "444"),
        (encode_png(FRAME), "rgb"),
        ((tmp_path / "clip.mkv").read_bytes(), "420"),
    ):
        file = io.BytesIO(data)
        with open_video(file) as reader:
            assert reader.format.chroma_format == chroma
            assert len(list(reader)) == 1
        assert not file.closed
    with pytest.raises(GsvcError, match="is empty"):
        open_video(io.BytesIO())


def test_standard_input_and_output(monkeypatch):
    output = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", Standard(output))
    with open_writer("-", VIDEO) as writer:
        writer.write(FRAME)
    assert output.getvalue() == y4m_bytes()
    monkeypatch.setattr(sys, "stdin", Standard(io.BytesIO(output.getvalue())))
    with open_video("-") as reader:
        assert len(list(reader)) == 1
    monkeypatch.setattr(sys, "stdin", Standard(io.BytesIO(b"RIFF....")))
    with pytest.raises(GsvcError, match="standard input is not a valid y4m"):
        open_video("-")
    monkeypatch.setattr(sys, "stdin", Standard(io.BytesIO()))
    with pytest.raises(GsvcError, match="it is empty"):
        open_video("-")


def test_inputs_that_cannot_be(tmp_path):
    with pytest.raises(FileNotFoundError, match="there is no file"):
        open_video(tmp_path / "none.y4m")
    (tmp_path / "coded.GSVC").write_bytes(b"anything")
    with pytest.raises(UsageError, match="gsvc decode"):
        open_video(tmp_path / "coded.GSVC")
    (tmp_path / "empty.mp4").write_bytes(b"")
    with pytest.raises(GsvcError, match="is empty") as caught:
        open_video(tmp_path / "empty.mp4")
    assert caught.value.kind == "malformed"


@pytest.mark.parametrize("name", ["out.gsvc", "out.avi", "out.jpg"])
def test_unknown_suffixes_are_refused(tmp_path, name):
    with pytest.raises(UsageError, match=r"\.y4m, \.png, \.mp4"):
        open_writer(tmp_path / name, VIDEO)


def test_a_file_in_the_place_of_a_folder_is_kept(tmp_path):
    (tmp_path / "out").write_text("mine")
    with pytest.raises(UsageError, match="cannot tell what to write"):
        open_writer(tmp_path / "out", VIDEO)
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.parametrize("name", ["out.y4m", "out.png", "out.mp4", "out"])
def test_the_folder_of_a_target_must_exist(tmp_path, name):
    if name.endswith("mp4"):
        pytest.importorskip("av")
    with pytest.raises(FileNotFoundError, match="create it first"):
        open_writer(tmp_path / "missing" / name, VIDEO)


def test_a_file_appears_when_it_is_complete(tmp_path):
    target = tmp_path / "out.y4m"
    target.write_text("old")
    with open_writer(target, VIDEO) as writer:
        writer.write(FRAME)
        assert target.read_text() == "old"
    assert target.read_bytes() == y4m_bytes()
    assert list(tmp_path.iterdir()) == [target]
    assert target.stat().st_mode & 0o777 == 0o666 & ~current_umask()


def current_umask():
    mask = os.umask(0)
    os.umask(mask)
    return mask


def test_an_exception_leaves_the_old_file(tmp_path):
    target = tmp_path / "out.y4m"
    target.write_text("old")

    def fail():
        with open_writer(target, VIDEO) as writer:
            writer.write(FRAME)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_links_stay_links(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "out.y4m").symlink_to(tmp_path / "folder" / "real.y4m")
    with open_writer(tmp_path / "out.y4m", VIDEO) as writer:
        writer.write(FRAME)
    assert (tmp_path / "out.y4m").is_symlink()
    assert (tmp_path / "folder" / "real.y4m").read_bytes() == y4m_bytes()


def test_a_full_disk_passes_up_and_leaves_nothing(tmp_path, monkeypatch):
    def full(self, *arguments):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("gsvc_ref.video.y4m.Y4mWriter._finish", full)
    monkeypatch.setattr(Path, "write_bytes", full)
    for name in ("out.y4m", "out.png"):
        writer = open_writer(tmp_path / name, VIDEO)
        writer.write(FRAME)
        with pytest.raises(OSError, match="No space left"):
            writer.close()
    folder_writer = open_writer(tmp_path / "out", VIDEO)
    with pytest.raises(OSError, match="No space left"):
        folder_writer.write(FRAME)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_devices_are_written_to_not_replaced():
    large = replace(VIDEO, width=128, height=64)
    writer = open_writer("/dev/full", large)
    with pytest.raises(OSError, match="No space left"):
        writer.write(np.zeros((64, 128, 3), np.uint8))
    assert not Path("/dev/full").is_file()


def test_named_pipes(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)

    def write():
        with open_writer(pipe, VIDEO) as writer:
            for _ in range(3):
                writer.write(FRAME)

    thread = threading.Thread(target=write)
    thread.start()
    with open_video(pipe) as reader:
        assert len(list(reader)) == 3
    thread.join(10)
    assert pipe.is_fifo()


def test_a_broken_pipe_passes_up():
    read_end, write_end = os.pipe()
    os.close(read_end)
    with os.fdopen(write_end, "wb", buffering=0) as pipe, pytest.raises(BrokenPipeError):
        open_writer(pipe, VIDEO)


def test_temporary_names_do_not_collide(tmp_path):
    first, second = PartialFile(tmp_path / "x"), PartialFile(tmp_path / "x")
    assert first.path != second.path
    first.commit()
    second.discard()
    second.discard()
    assert [path.name for path in tmp_path.iterdir()] == ["x"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 0}, "1 to 65535"),
        ({"height": 65536}, "1 to 65535"),
        ({"bit_depth": 7}, "8 to 16"),
        ({"chroma_format": "411"}, "one of"),
        ({"frame_rate": Fraction(0)}, "positive"),
        ({"sample_aspect_ratio": Fraction(2**31, 3)}, "terms up to"),
        ({"chroma_format": "420", "color": ColorDescription(1, 1, 0, True, 0)}, "no chroma to subsample"),
    ],
)
def test_formats_are_checked(change, message):
    with pytest.raises(UsageError, match=message):
        replace(VIDEO, **change)


@pytest.mark.parametrize("codes", [(256, 1, 1, True, 0), (1, -1, 1, True, 0), (1, 1, 1, True, 6)])
def test_colour_code_points_are_checked(codes):
    with pytest.raises(UsageError, match=r"H\.273"):
        ColorDescription(*codes)


def test_the_next_frame_can_be_looked_at_before_it_comes():
    """Also twice; its time is told with it, a fault comes in its place, and after the end there is none."""

    class Counting(VideoReader):
        def _read(self):
            for number in range(2):
                self.frame_time = Fraction(number)
                yield np.full((1, 1, 3), number, np.uint8)
            raise GsvcError("malformed", "broken")

    reader = Counting()
    for number in range(2):
        assert reader.peek()[0, 0, 0] == reader.peek()[0, 0, 0] == number
        assert reader.frame_time == number
        assert next(reader)[0, 0, 0] == number
    assert reader.peek() is None
    with pytest.raises(GsvcError, match="broken"):
        next(reader)
    assert reader.peek() is None
    assert list(reader) == []
