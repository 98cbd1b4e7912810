"""A stream that is written live is, at every moment, decodable up to its last complete frame."""

import io
import os
import random
from pathlib import Path

import pytest
from codec_cases import Counting, complete_frames, encoded, fast, same, video_format, waves

from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.encoder import IncompleteEncodeError, encode, source_and_target
from gsvc_ref.stream import Stream, StreamWriter, decode

SMALL = video_format(24, 16)
CLIP = waves(24, 16, 5)
SETTINGS = {
    "plain": fast(),
    "low latency": fast(key_frames="auto", low_latency=True),
    "without index": fast(index=False, checksums=True),
    "many key frames": fast(key_frames=2, lane_count=4),
}


@pytest.mark.parametrize("settings", SETTINGS.values(), ids=SETTINGS)
def test_every_copy_holds_the_frames_until_then(tmp_path, settings):
    path = tmp_path / "clip.gsvc"
    path.write_bytes(b"an older encode")
    copies = []

    def copy(progress):
        copies.append((progress.stage, progress.frame, path.read_bytes()))

    report = encode((CLIP, SMALL), path, settings, live=True, progress=copy)
    whole = path.read_bytes()
    frames = list(decode(whole))
    assert len(frames) == 5
    assert report.header.frame_count == 0
    assert report.file_bytes == len(whole)
    assert same(frames, list(decode(encoded(CLIP, settings)[1])))
    assert [path.name for path in tmp_path.iterdir()] == ["clip.gsvc"]
    counts = set()
    for stage, number, data in copies:
        if stage == "detect" and not settings.low_latency:
            continue
        done = number if stage != "detect" else max(number - 1, 0)
        if data == b"an older encode":
            assert done == 0
            continue
        assert whole.startswith(data)  # nothing is ever rewritten
        found, rule = complete_frames(data)
        assert rule == "R-6.2-4"
        assert len(found) in (number, done)
        assert same(found, frames[: len(found)])
        counts.add(len(found))
    assert counts == {1, 2, 3, 4}


def test_a_copy_in_the_middle_of_a_frame_holds_the_frames_before(tmp_path):
    _, whole = encoded(CLIP, fast(), live=True)
    with Stream(whole) as stream:
        ends = [frame.offset + frame.size for frame in stream]
    frames = list(decode(whole))
    for cut in random.Random(1).sample(range(ends[0], len(whole)), 40):
        found, rule = complete_frames(whole[:cut])
        assert rule == "R-6.2-4"
        assert same(found, frames[: sum(end <= cut for end in ends)])


def test_a_reader_follows_the_file(tmp_path):
    """As documented: open, read to the end, and go on at the next frame whenever there is more."""
    path, followed, rules = tmp_path / "clip.gsvc", [], set()
    reader: list[Stream] = []

    def follow(progress=None):
        if not reader:
            if not path.stat().st_size:
                return
            reader.append(Stream(path))
        try:
            for frame in reader[0].frames(len(followed)):
                followed.append(frame.splats)
        except GsvcError as error:
            rules.add(error.rule)
            return
        reader.append(reader[0])  # the end chunk was there

    encode((CLIP, SMALL), path, fast(key_frames=3), live=True, progress=follow)
    assert len(followed) == 4  # until the last one was in work
    assert rules == {"R-6.2-4"}
    assert len(reader) == 1
    follow()
    assert len(reader) == 2
    with reader[0] as stream:
        assert [splats.tobytes() for splats in followed] == [frame.splats.tobytes() for frame in stream]


def test_an_interrupt_and_a_fault_make_it_whole(tmp_path):
    path = tmp_path / "clip.gsvc"
    report = encode((Counting(CLIP[:3], KeyboardInterrupt()), SMALL), path, fast(), live=True)
    assert report.interrupted
    assert complete_frames(path.read_bytes())[1] is None
    with pytest.raises(IncompleteEncodeError):
        encode((Counting(CLIP[:2], GsvcError("malformed", "cut")), SMALL), path, fast(), live=True)
    assert len(list(decode(path))) == 2


@pytest.mark.parametrize("error", [KeyboardInterrupt(), GsvcError("malformed", "cut"), UsageError("no")])
@pytest.mark.parametrize("existing", [False, True])
def test_without_a_frame_the_old_file_stays(tmp_path, error, existing):
    path = tmp_path / "clip.gsvc"
    if existing:
        path.write_bytes(b"an older encode")
    with pytest.raises(type(error)):
        encode((Counting([], error), SMALL), path, fast(), live=True)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"an older encode"] * existing


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="nowhere"):
        encode((CLIP, SMALL), tmp_path / "nowhere" / "clip.gsvc", fast(), live=True)


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "clip.gsvc")
    encode((CLIP[:2], SMALL), tmp_path / "link", fast(), live=True)
    assert (tmp_path / "link").is_symlink()
    assert len(list(decode(tmp_path / "clip.gsvc"))) == 2


class Recorded(io.BytesIO):
    """Notes where each write begins."""

    def __init__(self) -> None:
        super().__init__()
        self.places: list[int] = []

    def write(self, data) -> int:
        self.places.append(self.tell())
        return super().write(data)


def test_a_file_that_could_go_back_is_not_asked_to():
    file = Recorded()
    report = encode((CLIP, SMALL), file, fast(), live=True)
    assert file.places == sorted(file.places)
    assert report.header.frame_count == 0
    file = Recorded()
    encode((CLIP, SMALL), file, fast())
    assert file.places != sorted(file.places)


def test_a_full_disk_leaves_the_complete_frames(tmp_path, monkeypatch):
    path, left = tmp_path / "clip.gsvc", [3]

    def write(self, data, original=StreamWriter._write_all):
        if data[:1] in (b"I", b"P"):  # a frame
            left[0] -= 1
        if left[0] < 0:
            original(self, data[: len(data) // 2])
            raise OSError(28, "No space left on device")
        original(self, data)

    monkeypatch.setattr(StreamWriter, "_write_all", write)
    with pytest.raises(OSError, match="No space left"):
        encode((CLIP, SMALL), path, fast(), live=True)
    monkeypatch.undo()
    found, rule = complete_frames(path.read_bytes())
    assert len(found) == 3
    assert rule == "R-6.2-4"


def test_the_writer_flushes_what_it_has_been_given(tmp_path: Path):
    """So that a killed process takes nothing along that was complete."""
    path = tmp_path / "clip.gsvc"
    sizes = []
    with path.open("wb") as file:
        encode((CLIP, SMALL), file, fast(), progress=lambda p: sizes.append((p.frame, path.stat().st_size)))
    with Stream(path) as stream:
        ends = [frame.offset + frame.size for frame in stream]
    assert {size for frame, size in sizes if frame} <= set(ends)


@pytest.mark.skipif(os.name != "posix", reason="locks of POSIX")
def test_of_two_encodes_to_one_file_the_second_is_refused(tmp_path):
    """Both ended well, and their frames stood mixed in the file."""
    path = tmp_path / "clip.gsvc"
    refused = []

    def second(progress):
        if path.exists() and not refused:
            with pytest.raises(UsageError, match=r"another encode writes to .*clip\.gsvc: wait for its end") as caught:
                encode((CLIP, SMALL), path, fast(), live=True)
            refused.append(caught.value)

    encode((CLIP, SMALL), path, fast(), live=True, progress=second)
    assert refused
    assert same(list(decode(path)), list(decode(encoded(CLIP, fast())[1])))
    encode((CLIP, SMALL), path, fast(), live=True)  # when the first has ended, the file is free


@pytest.mark.skipif(os.name != "posix", reason="locks of POSIX")
def test_a_file_that_its_encode_removes_is_made_anew(tmp_path, monkeypatch):
    """Between the opening and the lock, the encode that held the file may end without a frame, and remove it."""
    path = tmp_path / "clip.gsvc"
    tries = []

    def lock(file, try_lock=source_and_target.try_lock):
        tries.append(file)
        if len(tries) == 1:
            path.unlink()
        return try_lock(file)

    monkeypatch.setattr(source_and_target, "try_lock", lock)
    encode((CLIP, SMALL), path, fast(), live=True)
    assert len(tries) == 2
    assert len(list(decode(path))) == 5
