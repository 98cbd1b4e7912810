"""Ctrl-C keeps what is done; everything else that goes wrong leaves nothing behind, and says what it was."""

import io
import os
import signal
from pathlib import Path

import numpy as np
import pytest
from codec_cases import Counting, encoded, fast, flat, video_format, waves

from gsvc_ref.codec import decode, encode
from gsvc_ref.errors import GsvcError, UsageError
from gsvc_ref.metrics import psnr
from gsvc_ref.video import PartialFile, VideoReader

SMALL = video_format(24, 16)
CLIP = waves(24, 16, 5)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


class Broken(io.BytesIO):
    """A file whose write number `last` + 1 fails."""

    def __init__(self, last: int) -> None:
        super().__init__()
        self.left = last

    def write(self, data) -> int:
        if self.left == 0:
            raise OSError(28, "No space left on device")
        self.left -= 1
        return super().write(data)


@pytest.mark.parametrize("done", [1, 2, 4])
@pytest.mark.parametrize("existing", [False, True])
def test_an_interrupt_keeps_the_frames_done(tmp_path, done, existing):
    path = tmp_path / "clip.gsvc"
    if existing:
        path.write_bytes(b"something else")
    source = Counting(CLIP[:done], KeyboardInterrupt())
    report = encode((source, SMALL), path, fast())
    assert report.interrupted
    assert [frame.number for frame in report.frames] == list(range(done))
    assert report.file_bytes == path.stat().st_size
    assert names(tmp_path) == ["clip.gsvc"]
    assert path.read_bytes() == encoded(CLIP[:done], fast())[1]  # a whole stream, header and end included
    assert len(list(decode(path))) == done


@pytest.mark.parametrize("stage", ["fit", "quantize"])
def test_an_interrupt_within_a_frame_drops_that_frame(tmp_path, stage):
    def interrupt(progress):
        if (progress.frame, progress.stage) == (2, stage):
            raise KeyboardInterrupt

    report = encode((CLIP, SMALL), tmp_path / "a.gsvc", fast(), progress=interrupt)
    assert report.interrupted
    assert (tmp_path / "a.gsvc").read_bytes() == encoded(CLIP[:2], fast())[1]


@pytest.fixture
def _ctrl_c_as_usual():
    """Python's own handling of SIGINT, which a shell's background jobs do not have."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("_ctrl_c_as_usual")
def test_an_interrupt_while_a_frame_is_written_keeps_that_frame():
    """A chunk is written whole: Ctrl-C waits for the few microseconds that this takes."""

    class Interrupting(io.BytesIO):
        writes = 0

        def write(self, data) -> int:
            self.writes += 1
            if self.writes == 5:  # the opening, the header, then frames 0, 1 and 2
                signal.raise_signal(signal.SIGINT)
            return super().write(data)

    file = Interrupting()
    report = encode((CLIP, SMALL), file, fast(index=False))
    assert report.interrupted
    assert len(report.frames) == 3
    assert file.getvalue() == encoded(CLIP[:3], fast(index=False))[1]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_interrupt_while_key_frames_are_looked_for_keeps_what_is_decided(tmp_path):
    source = Counting(CLIP, KeyboardInterrupt())
    report = encode((source, SMALL), tmp_path / "a.gsvc", fast(key_frames="auto"))
    assert report.interrupted
    assert [frame.type for frame in report.frames] == ["I"]  # nine more frames would decide on the next
    assert len(list(decode(tmp_path / "a.gsvc"))) == 1


@pytest.mark.parametrize(
    "error", [KeyboardInterrupt(), OSError("gone"), GsvcError("malformed", "cut"), ValueError("x")]
)
def test_without_a_frame_nothing_is_left(tmp_path, error):
    with pytest.raises(type(error)):
        encode((Counting([], error), SMALL), tmp_path / "clip.gsvc", fast())
    assert names(tmp_path) == []

    def interrupt(progress):
        raise error

    with pytest.raises(type(error)):
        encode((CLIP, SMALL), tmp_path / "clip.gsvc", fast(), progress=interrupt)
    assert names(tmp_path) == []


@pytest.mark.parametrize("error", [OSError("gone"), GsvcError("malformed", "cut"), RuntimeError("bug"), SystemExit(3)])
@pytest.mark.parametrize("key_frames", [(), "auto"])
def test_another_failure_of_the_source_leaves_nothing(tmp_path, error, key_frames):
    path = tmp_path / "clip.gsvc"
    with pytest.raises(type(error)):
        encode((Counting(CLIP[:3], error), SMALL), path, fast(key_frames=key_frames))
    assert names(tmp_path) == []
    path.write_bytes(b"an older encode")
    with pytest.raises(type(error)):
        encode((Counting(CLIP[:3], error), SMALL), path, fast(key_frames=key_frames))
    assert names(tmp_path) == ["clip.gsvc"]
    assert path.read_bytes() == b"an older encode"


def test_an_existing_file_is_replaced_at_the_end_only(tmp_path):
    path = tmp_path / "clip.gsvc"
    path.write_bytes(b"an older encode")
    seen = []
    encode((CLIP[:2], SMALL), path, fast(), progress=lambda _: seen.append(path.read_bytes()))
    assert set(seen) == {b"an older encode"}
    assert path.read_bytes() == encoded(CLIP[:2], fast())[1]
    assert names(tmp_path) == ["clip.gsvc"]


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "real").mkdir()
    target, link = tmp_path / "real" / "clip.gsvc", tmp_path / "link.gsvc"
    link.symlink_to(target)
    encode((CLIP[:1], SMALL), link, fast())
    assert link.is_symlink()
    assert target.read_bytes() == encoded(CLIP[:1], fast())[1]


@pytest.mark.parametrize("frames", [[], iter([])])
def test_no_frames_make_no_stream(tmp_path, frames):
    with pytest.raises(GsvcError, match="no frames") as caught:
        encode((frames, SMALL), tmp_path / "clip.gsvc", fast())
    assert caught.value.kind == "malformed"
    assert names(tmp_path) == []


def test_a_range_past_the_end_makes_no_stream(tmp_path):
    with pytest.raises(GsvcError, match="no frames"):
        encode((CLIP, SMALL), tmp_path / "clip.gsvc", fast(frames=(5, 9)))
    assert names(tmp_path) == []


WRONG_FRAMES = {
    "larger": waves(25, 16, 1)[0],
    "turned": waves(16, 24, 1)[0],
    "grey": CLIP[0][:, :, 0],
    "alpha": np.concatenate([CLIP[0], CLIP[0][:, :, :1]], axis=2),
    "16 bits": CLIP[0].astype(np.uint16),
    "signed": CLIP[0].astype(np.int8),
    "float": CLIP[0] / 255,
    "NaN": np.full((16, 24, 3), np.nan, np.float32),
    "empty": np.empty((0, 24, 3), np.uint8),
    "nothing": None,
}


@pytest.mark.parametrize("wrong", WRONG_FRAMES.values(), ids=WRONG_FRAMES)
@pytest.mark.parametrize("number", [0, 2])
def test_a_frame_that_is_none_is_refused_with_its_number(tmp_path, wrong, number):
    frames = [*CLIP[:number], wrong, *CLIP[number:]]
    with pytest.raises(UsageError, match=rf"frame {number}: .*\(16, 24, 3\)"):
        encode((frames, SMALL), tmp_path / "clip.gsvc", fast())
    assert names(tmp_path) == []


def test_samples_above_the_peak_are_refused():
    frames = flat(1024, 24, 16, dtype=np.uint16)
    with pytest.raises(UsageError, match=r"frame 0: .*1024.*1023"):
        encode((frames, video_format(24, 16, 10)), io.BytesIO(), fast())


@pytest.mark.parametrize("source", [None, 5, CLIP, (CLIP, 24), (CLIP, SMALL, 3), CLIP[0]])
def test_what_is_no_source_is_refused(source, tmp_path):
    with pytest.raises(UsageError, match="source"):
        encode(source, tmp_path / "clip.gsvc", fast())
    assert names(tmp_path) == []


@pytest.mark.parametrize("target", [None, 5, b"clip.gsvc", io.StringIO()])
def test_what_is_no_target_is_refused(target):
    source = Counting(CLIP)
    with pytest.raises(UsageError, match="target"):
        encode((source, SMALL), target, fast())
    assert source.taken == 0


def test_a_folder_is_no_target(tmp_path):
    with pytest.raises(UsageError, match="is a folder"):
        encode((CLIP, SMALL), tmp_path, fast())
    assert names(tmp_path) == []


def test_a_missing_folder_is_named(tmp_path):
    source = Counting(CLIP)
    with pytest.raises(FileNotFoundError, match="nowhere"):
        encode((source, SMALL), tmp_path / "nowhere" / "clip.gsvc", fast())
    assert source.taken == 0


def test_a_folder_that_cannot_be_written_is_an_os_error(tmp_path, monkeypatch):
    def refuse(self):  # a closed folder would not stop root
        raise PermissionError("closed")

    monkeypatch.setattr(PartialFile, "_create", refuse)
    source = Counting(CLIP)
    with pytest.raises(PermissionError):
        encode((source, SMALL), tmp_path / "clip.gsvc", fast())
    assert source.taken == 0


@pytest.mark.parametrize("writes", [0, 1, 2, 4])
def test_a_file_that_fails_is_an_os_error(writes):
    with pytest.raises(OSError, match="No space left"):
        encode((CLIP, SMALL), Broken(writes), fast())


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has a device that is always full")
def test_a_full_disk_is_an_os_error():
    with pytest.raises(OSError, match="No space left"):
        encode((CLIP, SMALL), "/dev/full", fast())
    assert Path("/dev/full").is_char_device()


@pytest.mark.skipif(not Path("/dev/null").is_char_device(), reason="there is no null device")
def test_the_null_device_takes_everything():
    report = encode((CLIP[:2], SMALL), "/dev/null", fast())
    assert report.file_bytes == len(encoded(CLIP[:2], fast())[1])
    assert Path("/dev/null").is_char_device()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes")
def test_a_pipe_gets_a_stream_of_unknown_length(tmp_path):
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb") as reader:
        with os.fdopen(writing, "wb") as writer:
            report = encode((CLIP[:2], SMALL), writer, fast())
        data = reader.read()
    assert len(data) == report.file_bytes
    assert report.header.frame_count == 0
    for frame, picture, told in zip(CLIP, decode(data), report.frames, strict=False):
        assert psnr(frame, picture, 255) == told.psnr


class Noting(VideoReader):
    """A reader with notes that counts how often it is closed."""

    def __init__(self, frames) -> None:
        super().__init__()
        self.format, self.frames, self.closed = SMALL, frames, 0
        self.note("the colour is a guess")

    def _read(self):
        yield from self.frames

    def close(self) -> None:
        self.closed += 1
        super().close()


def test_an_open_reader_stays_open_and_its_notes_are_told():
    reader = Noting(CLIP)
    report = encode(reader, io.BytesIO(), fast(frames=(0, 2)))
    assert report.notes == ["the colour is a guess"]
    assert reader.closed == 0
    assert np.array_equal(next(reader), CLIP[2])


def test_a_frame_that_no_level_allows_is_refused_before_any_work():
    source = Counting(CLIP)
    with pytest.raises(UsageError, match="no level allows 16384x8192"):
        encode((source, video_format(16384, 8192)), io.BytesIO(), fast())
    assert source.taken == 0


def test_a_goal_that_was_missed_is_noted():
    clip = [np.random.default_rng(0).integers(0, 256, (16, 24, 3), np.uint8)]
    report, _ = encoded(clip, fast(psnr=60.0, splats=9))
    assert any("60 dB" in note for note in report.notes)
    assert encoded(clip, fast(psnr=5.0, splats=9))[0].notes == []


def test_the_source_is_not_replaced_by_the_stream(tmp_path):
    path = tmp_path / "clip.y4m"
    path.write_bytes(b"YUV4MPEG2 W4 H4 F25:1 C444\nFRAME\n" + bytes(48))
    before = path.read_bytes()
    with pytest.raises(UsageError, match="is the source itself"):
        encode(path, tmp_path / "." / "clip.y4m", fast())
    assert path.read_bytes() == before
