"""Whatever ends an encode early keeps the frames that are done; only a target that fails leaves nothing behind."""

import errno
import gzip
import io
import os
import pickle
from pathlib import Path

import numpy as np
import pytest
from codec_cases import Counting, encoded, fast, flat, paper_fast, video_format, waves

from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.files import PartialFile
from gsvc_ref.encoder import IncompleteEncodeError, encode
from gsvc_ref.metrics import psnr
from gsvc_ref.stream import StreamWriter, decode
from gsvc_ref.video import VideoReader

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


@pytest.mark.parametrize(("settings", "stage"), [(fast(), "encode"), (paper_fast(), "fit"), (paper_fast(), "quantize")])
def test_an_interrupt_within_a_frame_drops_that_frame(tmp_path, settings, stage):
    def interrupt(progress):
        if (progress.frame, progress.stage) == (2, stage):
            raise KeyboardInterrupt

    report = encode((CLIP, SMALL), tmp_path / "a.gsvc", settings, progress=interrupt)
    assert report.interrupted
    assert (tmp_path / "a.gsvc").read_bytes() == encoded(CLIP[:2], settings)[1]


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


FAULTS = [GsvcError("limit", "cut"), UsageError("no"), OSError("gone"), RuntimeError("bug"), SystemExit(3)]


@pytest.mark.parametrize("error", FAULTS, ids=repr)
def test_a_fault_of_the_source_keeps_the_frames_before(tmp_path, error):
    path = tmp_path / "clip.gsvc"
    path.write_bytes(b"an older encode")
    with pytest.raises(BaseException) as caught:  # noqa: PT011  (each is looked at below)
        encode((Counting(CLIP[:3], error), SMALL), path, fast())
    assert path.read_bytes() == encoded(CLIP[:3], fast())[1]
    assert names(tmp_path) == ["clip.gsvc"]
    if isinstance(error, GsvcError | UsageError):
        assert type(caught.value) is IncompleteEncodeError
        assert caught.value.__cause__ is error
        assert caught.value.kind == getattr(error, "kind", "invalid")
        assert str(caught.value).endswith("; saved: 3 complete frames, as a valid stream")
        assert caught.value.report.fault == str(error)
        assert [frame.number for frame in caught.value.report.frames] == [0, 1, 2]
        assert caught.value.report.file_bytes == path.stat().st_size
        again = pickle.loads(pickle.dumps(caught.value))
        assert (str(again), again.report.fault) == (str(caught.value), str(error))
    else:
        assert caught.value is error
        assert error.__notes__[-1] == "gsvc_ref.encode saved: 3 complete frames, as a valid stream"


@pytest.mark.parametrize("low_latency", [False, True])
def test_frames_that_were_read_ahead_of_a_fault_are_encoded(low_latency):
    settings = fast(key_frames="auto", low_latency=low_latency)
    file = io.BytesIO()
    with pytest.raises(IncompleteEncodeError, match="malformed: cut; saved: 5 complete frames"):
        encode((Counting(CLIP, GsvcError("malformed", "cut")), SMALL), file, settings)
    assert file.getvalue() == encoded(CLIP, settings)[1]


def test_a_fault_at_the_first_frame_is_itself():
    with pytest.raises(GsvcError, match="cut") as caught:
        encode((Counting([], GsvcError("malformed", "cut")), SMALL), io.BytesIO(), fast())
    assert type(caught.value) is GsvcError


def test_a_fault_of_the_progress_keeps_the_frames_before(tmp_path):
    def fail(progress):
        if (progress.frame, progress.stage) == (2, "encode"):
            raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine") as caught:
        encode((CLIP, SMALL), tmp_path / "a.gsvc", fast(), progress=fail)
    assert "2 complete frames" in caught.value.__notes__[-1]
    assert (tmp_path / "a.gsvc").read_bytes() == encoded(CLIP[:2], fast())[1]


def test_a_frame_beyond_the_level_keeps_the_frames_before(tmp_path, monkeypatch):
    def refuse(self, codes, state=None, layers=None, *, write=StreamWriter.write_frame):
        if self.frame_count == 3:
            raise UsageError("rendering frame 3 takes too many pairs (R-5-4)")
        return write(self, codes, state, layers)

    monkeypatch.setattr(StreamWriter, "write_frame", refuse)
    with pytest.raises(IncompleteEncodeError, match=r"invalid: rendering frame 3 .* saved: 3 complete frames"):
        encode((CLIP, SMALL), tmp_path / "a.gsvc", fast())
    monkeypatch.undo()
    assert (tmp_path / "a.gsvc").read_bytes() == encoded(CLIP[:3], fast())[1]


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
    with pytest.raises(GsvcError, match="the source ends before frame 5"):
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
    with pytest.raises(IncompleteEncodeError if number else UsageError, match=rf"frame {number}: .*\(16, 24, 3\)"):
        encode((frames, SMALL), tmp_path / "clip.gsvc", fast())
    assert names(tmp_path) == ["clip.gsvc"] * (number > 0)


def test_samples_above_the_peak_are_refused():
    frames = flat(1024, 24, 16, dtype=np.uint16)
    with pytest.raises(UsageError, match=r"frame 0: .*1024.*1023"):
        encode((frames, video_format(24, 16, 10)), io.BytesIO(), fast())


@pytest.mark.parametrize("source", [None, 5, (CLIP, 24), (CLIP, SMALL, 3), CLIP[0]])
def test_what_is_no_source_is_refused(source, tmp_path):
    with pytest.raises(UsageError, match=r"is not a source|a frame is \(H, W, 3\)|a video is \(T, H, W, 3\)"):
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
        raise PermissionError(errno.EACCES, "closed")

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


def test_an_open_null_device_takes_everything():
    with open(os.devnull, "wb") as file:
        report = encode((CLIP[:2], SMALL), file, fast())
    assert report.header.frame_count == 0


def test_a_compressed_file_cannot_go_back_and_gets_a_stream_of_unknown_length(tmp_path):
    path = tmp_path / "clip.gsvc.gz"
    with gzip.open(path, "wb") as file:
        report = encode((CLIP[:2], SMALL), file, fast())
    assert report.header.frame_count == 0
    with gzip.open(path) as file:
        assert len(list(decode(file))) == 2


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
