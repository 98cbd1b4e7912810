"""Encodes that are gone on with: the same bytes and reports, what is refused, what is believed, what is left."""

import io
import json
import os
import shutil
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from errno import ENOSPC
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from adopted import KINDS, as_nobody, in_the_way, only_root, posix
from codec_cases import encoded, fast, paper_fast, paper_quick, video_format, waves
from hostile.resume import kills
from tools.jobs.test_killed import in_child
from tools.jobs.test_side_by_side import Here, without_times

from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.folders import OwnFolder
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.encoder import IncompleteEncodeError, encode, recording
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.stream import StreamWriter, decode
from gsvc_ref.testing.faults import join_chunks, split_chunks
from gsvc_tools.jobs import resume
from gsvc_tools.jobs.code_version import code_version
from gsvc_tools.jobs.groups import encode_segment
from gsvc_tools.jobs.kept_group import OURS, KeptGroup

SMALL = video_format(24, 16)
CLIP = waves(24, 16, 9, cut=5)
PLAIN = fast(key_frames=3)
WAIT_S = 120

SETTINGS = {
    "main": fast(key_frames=4),
    "main, psnr, checksums, lanes": fast(key_frames=4, psnr=24.0, checksums=True, lane_count=4),
    "main, quality": fast(key_frames=4, quality=20),
    "main, layers": fast(key_frames=4, layers=(20.0, 24.0)),
    "main, layers of splats": fast(key_frames=4, layer_splats=(5, 9)),
    "main, paced, key frames found": fast(key_frames="auto", paced=True),
    "paper": paper_fast(key_frames=4),
    "paper, quantisers chosen": paper_quick(iterations=3, key_frames=4, threads=1),
}

LIKE_OTHERS = ("main, quality", "main, layers of splats", "paper")
"""Settings that take the ways that others take as well."""

PARAMETERS = [
    pytest.param(settings, id=name, marks=[pytest.mark.exhaustive] if name in LIKE_OTHERS else [])
    for name, settings in SETTINGS.items()
]


class EndedError(Exception):
    """What ends an encode, like a fault of its source."""


def until(count, clip=CLIP):
    """The first frames of a clip, and an exception."""
    yield from clip[:count]
    raise EndedError


def begun(folder, settings=PLAIN, count=8, **options) -> None:
    """Encode until a fault after so many frames."""
    with pytest.raises(EndedError):
        encode((until(count), SMALL), io.BytesIO(), settings, resume=folder, **options)


def gone_on(folder, settings=PLAIN, clip=CLIP, **options):
    file = io.BytesIO()
    report = encode((clip, SMALL), file, settings, resume=folder, **options)
    return report, file.getvalue()


@pytest.fixture(scope="module")
def whole() -> bytes:
    return encoded(CLIP, PLAIN)[1]


@pytest.fixture(scope="module")
def first_groups(tmp_path_factory):
    """A folder with the groups of the frames 0 to 2 and 3 to 5."""
    folder = tmp_path_factory.mktemp("first") / "kept"
    begun(folder)
    return folder


@pytest.fixture
def kept(first_groups, tmp_path):
    return shutil.copytree(first_groups, tmp_path / "kept")


@pytest.mark.parametrize("settings", PARAMETERS)
def test_the_same_bytes_and_report(settings, tmp_path):
    """Whether groups are encoded one after the other or side by side, before and after."""
    folder = tmp_path / "kept"
    report, data = encoded(CLIP, settings)
    begun(folder, settings)
    both = [folder, shutil.copytree(folder, tmp_path / "other")]
    for place, options in zip(both, ({}, {"jobs": 2, "executor": Here()}), strict=True):
        again, same = gone_on(place, settings, **options)
        assert same == data
        note, *notes = again.notes
        assert note in (f"{n} frames in 1 group of pictures were taken from {place}" for n in (4, 5))
        assert without_times(replace(again, notes=notes)) == without_times(report)
        assert not place.exists()


def test_groups_that_are_done_out_of_order_are_kept(tmp_path, whole):
    """Also those after one whose fault ends the encode."""
    folder, later = tmp_path / "kept", ["00000003.gsvc", "00000006.gsvc"]

    def names() -> list[str]:
        return sorted(path.name for path in folder.glob("0*.gsvc"))

    def run(coder, frames):
        end = time.monotonic() + WAIT_S
        while frames[0][2] in (1, 2):
            assert time.monotonic() < end
            if names() == later:
                raise EndedError
            time.sleep(0.01)
        return encode_segment(coder, frames)

    class FirstFails(ThreadPoolExecutor):
        def submit(self, function, /, *arguments, **options):
            return super().submit(run, *arguments, **options)

    with FirstFails(3) as threads, pytest.raises(EndedError):
        encode((CLIP, SMALL), io.BytesIO(), PLAIN, resume=folder, jobs=3, executor=threads)
    assert names() == later
    report, data = gone_on(folder)
    assert data == whole
    assert report.notes == [f"6 frames in 2 groups of pictures were taken from {folder}"]


def test_each_group_is_a_stream_of_its_own(first_groups):
    paths = sorted(first_groups.glob("*.gsvc"))
    assert [path.name for path in paths] == ["00000000.gsvc", "00000003.gsvc"]
    frames = list(decode(encoded(CLIP, PLAIN)[1]))
    for number, path in enumerate(paths):
        assert np.array_equal(list(decode(path)), frames[3 * number : 3 * number + 3])


def test_what_is_kept_is_on_the_disk_before_it_has_its_name(monkeypatch, tmp_path):
    asked = []

    def noting(self, name, data, *, durable=False, write=OwnFolder.write):
        asked.append((name, durable))
        write(self, name, data, durable=durable)

    monkeypatch.setattr(OwnFolder, "write", noting)
    begun(tmp_path / "kept")
    assert asked == [("encode.json", True), ("00000000.gsvc", True), ("00000003.gsvc", True)]


@pytest.mark.parametrize("options", [{}, {"jobs": 2, "executor": Here()}], ids=["plain", "side by side"])
@pytest.mark.parametrize("number", [0, 4])
def test_a_source_that_has_changed_is_refused(kept, tmp_path, options, number):
    """And what stood under the name of the target still does."""
    target, clip = tmp_path / "out.gsvc", [frame.copy() for frame in CLIP]
    target.write_bytes(b"an older encode")
    clip[number][3, 5, 1] ^= 1
    said = f"frame {number} of the source is not the one that was encoded before: give the source as it was"
    with pytest.raises(UsageError, match=said):
        encode((clip, SMALL), target, PLAIN, resume=kept, **options)
    assert target.read_bytes() == b"an older encode"
    assert len(list(kept.glob("*.gsvc"))) == 2


def test_a_source_that_ends_early_is_refused(kept):
    with pytest.raises(UsageError, match="frame 5 of the source is not the one"):
        gone_on(kept, clip=CLIP[:5])


def test_a_source_that_has_become_longer_is_refused(monkeypatch, tmp_path):
    """After the last group, which was taken for whole by an encode that was ended as it completed its file."""

    def ended(frames):
        raise EndedError

    folder = tmp_path / "kept"
    with monkeypatch.context() as patch:
        patch.setattr(recording, "write_log", ended)
        with pytest.raises(EndedError):
            encode((CLIP[:8], SMALL), io.BytesIO(), PLAIN, resume=folder)
    with pytest.raises(UsageError, match="frame 8 of the source"):
        gone_on(folder)


@pytest.mark.parametrize(
    ("settings", "video", "said"),
    [
        (fast(key_frames=3, seed=5), SMALL, "setting seed was 0, is 5"),
        (fast(key_frames=(0, 3)), SMALL, "setting key_frames was 3, is [0, 3]"),
        (fast(key_frames=tuple(range(30))), SMALL, "setting key_frames is another"),
        (PLAIN, replace(SMALL, bit_depth=10), "source bit_depth was 8, is 10"),
    ],
)
def test_another_encode_is_refused(kept, settings, video, said):
    with pytest.raises(UsageError) as caught:
        encode((CLIP, video), io.BytesIO(), settings, resume=kept)
    assert str(caught.value) == (
        f"{kept} is of another encode ({said}): encode as before, or remove the folder to begin anew"
    )


def test_the_number_of_threads_is_no_other_encode(kept, whole):
    assert gone_on(kept, PLAIN.with_(threads=2))[1] == whole


@pytest.mark.parametrize("options", [{}, {"jobs": 2, "executor": Here()}], ids=["one after the other", "side by side"])
def test_the_progress_tells_frames_that_were_kept(kept, options):
    told = []
    gone_on(kept, progress=told.append, **options)
    counts = [progress.kept for progress in told if progress.stage != "detect"]
    assert list(dict.fromkeys(counts)) == [1, 2, 3, 4, 5, 6]
    assert counts == sorted(counts)
    assert counts.count(6) > 1  # those that are encoded


@pytest.mark.parametrize("about", [b"", b"{", b"[]", b'{"code": 1}', b"[" * 100_000], ids=len)
def test_a_folder_of_something_else_is_refused(kept, about):
    (kept / "encode.json").write_bytes(about)
    with pytest.raises(UsageError, match="of another encode"):
        gone_on(kept)


def test_other_code_is_refused(kept):
    about = json.loads((kept / "encode.json").read_text())
    (kept / "encode.json").write_text(json.dumps(about | {"code": "0.1 abc"}))
    with pytest.raises(UsageError, match=f"made by gsvc_ref 0.1 abc, this is {code_version()}"):
        gone_on(kept)


def test_a_folder_in_use_is_refused(kept):
    def frames():
        with pytest.raises(UsageError, match="another encode keeps its groups in"):
            gone_on(kept)
        yield from CLIP

    gone_on(kept, clip=frames())


def changed_files(data: bytes) -> dict[str, bytes]:
    """A kept group as damage or malice may leave it."""
    half = len(data) // 2
    record = data.index(b'"digest"')
    return {
        "empty": b"",
        "cut": data[:half],
        "flipped": data[:half] + bytes([data[half] ^ 1]) + data[half + 1 :],
        "record": data[:record] + b'"Digest"' + data[record + 8 :],
        "another stream": encoded(CLIP, PLAIN)[1],
        "something else": b"\x80\x04." + bytes(1000),
    }


@pytest.mark.parametrize("how", ["empty", "cut", "flipped", "record", "another stream", "something else"])
def test_a_damaged_group_is_encoded_again(kept, whole, how):
    path = kept / "00000003.gsvc"
    path.write_bytes(changed_files(path.read_bytes())[how])
    report, data = gone_on(kept)
    assert data == whole
    assert report.notes[0] == f"3 frames in 1 group of pictures were taken from {kept}"
    assert report.notes[1].startswith(f"{path} cannot be read, so its frames were encoded again: ")


def test_a_group_of_another_stream_is_encoded_again(kept, whole, tmp_path):
    begun(tmp_path / "other", fast(key_frames=3, checksums=True))
    shutil.copy(tmp_path / "other" / "00000003.gsvc", kept)
    report, data = gone_on(kept)
    assert data == whole
    assert "is of another stream" in report.notes[1]


def others_of(kept, tmp_path) -> dict[str, bytes]:
    """Groups that are sound, and not the second group of a folder."""
    clip = [255 - frame for frame in CLIP]
    with pytest.raises(EndedError):
        encode((until(8, clip), SMALL), io.BytesIO(), PLAIN, resume=tmp_path / "other")
    first, second = (split_chunks((kept / f"{number:08}.gsvc").read_bytes()) for number in (0, 3))
    frames = [b"I", b"P", b"R"]
    theirs = iter([chunk for chunk in first if chunk[0] in frames])
    mixed = [next(theirs) if chunk[0] in frames else chunk for chunk in second]
    prefix = (kept / "00000000.gsvc").read_bytes()[:PREFIX_SIZE]
    return {
        "the first group": (kept / "00000000.gsvc").read_bytes(),
        "of another folder": (tmp_path / "other" / "00000003.gsvc").read_bytes(),
        "frames of the first group": join_chunks(mixed, prefix=prefix),
        "too few records": join_chunks([c for c in second if c[0] != b"p"], prefix=prefix),
    }


@pytest.mark.parametrize(
    "which", ["the first group", "of another folder", "frames of the first group", "too few records"]
)
def test_a_sound_group_in_the_wrong_place_is_encoded_again(kept, whole, tmp_path, which):
    """It ended the encode, as if the source had changed, or frames and records of two groups came together."""
    (kept / "00000003.gsvc").write_bytes(others_of(kept, tmp_path)[which])
    report, data = gone_on(kept)
    assert data == whole
    assert report.notes[0] == f"3 frames in 1 group of pictures were taken from {kept}"
    assert report.notes[1].startswith(f"{kept / '00000003.gsvc'} ")
    assert "so its frames were encoded again" in report.notes[1]
    assert not kept.exists()


@posix
@pytest.mark.parametrize("kinds", [("link", "FIFO"), ("dangling link", "device"), ("folder", "link")], ids=" and ".join)
def test_what_is_not_a_file_is_encoded_again(kept, whole, tmp_path, kinds):
    """A FIFO was waited for, what a link led to was overwritten, and after a folder nothing was kept or removed."""
    victim = tmp_path / "victim"
    victim.write_bytes(b"precious")
    paths = [kept / "00000000.gsvc", kept / "00000003.gsvc"]
    for kind, path in zip(kinds, paths, strict=True):
        in_the_way(kind, path, victim)
    report, data = gone_on(kept)
    assert data == whole
    assert victim.read_bytes() == b"precious"
    assert not (tmp_path / "nowhere").exists()
    again = [
        f"{path} cannot be read, so its frames were encoded again: {path} is not a regular file: remove it"
        for path in paths
    ]
    assert set(report.notes) >= set(again)
    if "folder" in kinds:
        assert f"the group from frame 0 on could not be kept: {paths[0]} is a folder: remove it" in report.notes
        assert list(kept.iterdir()) == [paths[0]]
    else:
        assert not kept.exists()


@posix
@pytest.mark.parametrize("name", ["encode.json", "lock"])
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_not_a_file_is_refused_in_place_of_a_record_or_lock(kept, tmp_path, kind, name):
    in_the_way(kind, kept / name, tmp_path / "victim")
    said = (
        rf"{name} cannot be read\): encode as before"
        if name == "encode.json"
        else "lock is not a regular file: remove it"
    )
    with pytest.raises(UsageError, match=said):
        gone_on(kept)
    assert not (tmp_path / "victim").exists()
    assert len(list(kept.glob("*.gsvc"))) == 2


@posix
def test_a_folder_that_no_encode_made_is_refused_and_stays(tmp_path):
    """All files of digits were removed from it, and links in it were written through."""
    clips, link = tmp_path / "clips", tmp_path / "out.gsvc.resume"
    clips.mkdir()
    (clips / "2024.gsvc").write_bytes(b"precious")
    link.symlink_to("clips")
    for folder, said in ((clips, "so this command did not make it"), (link, "is a link")):
        with pytest.raises(UsageError, match=said):
            gone_on(folder)
    assert (clips / "2024.gsvc").read_bytes() == b"precious"
    assert len(list(clips.iterdir())) == 1


def test_a_file_of_a_group_that_this_encode_does_not_have_stays(kept):
    (kept / "00002024.gsvc").write_bytes(b"precious")
    gone_on(kept)
    assert [path.name for path in kept.iterdir()] == ["00002024.gsvc"]


def test_a_record_that_was_changed_is_refused(kept):
    about = json.loads((kept / "encode.json").read_text())
    (kept / "encode.json").write_text(json.dumps(about | {"mark": "mine"}))
    with pytest.raises(UsageError, match=r"encode\.json cannot be read"):
        gone_on(kept)


def test_a_disk_that_is_full_from_the_start_leaves_nothing(monkeypatch, tmp_path):
    def full(self, name, data, **options):
        raise OSError(ENOSPC, "No space left on device")

    monkeypatch.setattr(OwnFolder, "write", full)
    with pytest.raises(OSError, match="No space"):
        gone_on(tmp_path / "kept")
    assert list(tmp_path.iterdir()) == []


@only_root
def test_another_user_cannot_prepare_or_use_the_folder(monkeypatch, tmp_path):
    """In a folder where everybody may write, as many have: a folder with a link that leads to a file of ours."""
    monkeypatch.chdir(tmp_path)
    tmp_path.chmod(0o777)
    victim = tmp_path / "victim"
    victim.write_bytes(b"precious")
    victim.chmod(0o600)
    folder = Path("out.gsvc.resume")

    def prepare():
        folder.mkdir(0o777)
        (folder / "00000000.gsvc").symlink_to("../victim")
        folder.chmod(0o777)

    as_nobody(prepare)
    with pytest.raises(UsageError, match="belongs to another user"):
        gone_on(folder)
    as_nobody(lambda: (folder / "00000000.gsvc").unlink())
    as_nobody(folder.rmdir)
    as_nobody(lambda: folder.symlink_to(tmp_path))
    with pytest.raises(UsageError, match="is a link"):
        gone_on(folder)
    as_nobody(folder.unlink)
    begun(folder)

    def attack():
        for work in (
            lambda: os.listdir(folder), (folder / "00000000.gsvc").read_bytes, (folder / "00000000.gsvc").unlink,
            lambda: (folder / "00000003.gsvc").symlink_to("../victim"), lambda: os.mkfifo(folder / "lock"),
            lambda: gone_on(folder),
        ):  # fmt: skip
            with pytest.raises((PermissionError, UsageError)):
                work()

    as_nobody(attack)
    assert gone_on(folder)[0].notes == [f"6 frames in 2 groups of pictures were taken from {folder}"]
    assert victim.read_bytes() == b"precious"


@pytest.mark.parametrize(
    "change",
    [
        {"digest": 5}, {"seconds": "1"}, {"seconds": -1}, {"seconds": None}, {"psnr": True}, {"iterations": 1.5},
        {"stages": []}, {"decisions": [[]]}, {"decisions": [["gsa", True, "", 0, 0, 0, 0]]}, {"reason": 5},
        {"decisions": [["none", True, "x", 0, 0, 0.0]]}, {"layers": ["x"]}, {"layers": None}, {"reason": "\x1b"},
        {"seconds": 10**400}, {"psnr": -(10**400)},
    ],
    ids=str,
)  # fmt: skip
def test_records_are_believed_only_with_their_types(change):
    record = {
        "digest": "", "seconds": 1, "psnr": None, "iterations": 1, "stages": {}, "decisions": [], "reason": None,
        "layers": [],
    }  # fmt: skip
    assert KeptGroup(stream_with(record)).next_frame()[0].psnr == np.inf
    with pytest.raises(GsvcError, match="not a group of pictures that an encode has kept"):
        KeptGroup(stream_with(record | change))


def stream_with(record) -> bytes:
    """A kept group of one frame without splats, whose record is given."""
    file = io.BytesIO()
    header = SequenceHeader(level=1, width=24, height=16, profile=1, lane_count=1)
    writer = StreamWriter(file, header, index=False)
    begin = writer.offset
    writer.write_frame(MainCodes(type="I"))
    writer.write_ancillary("p", OURS + json.dumps(record).encode())
    whole = {"decided": [], "mark": "", "first": 0, "chunks": sha256(file.getvalue()[begin:]).hexdigest()}
    writer.finish(("q", OURS + json.dumps(whole).encode()))
    return file.getvalue()


def test_a_disk_that_is_full_ends_only_the_keeping(monkeypatch, tmp_path, whole):
    def full(self, name, data, *, durable=False, write=OwnFolder.write):
        if name == "00000003.gsvc":
            raise OSError(ENOSPC, "No space left on device")
        write(self, name, data, durable=durable)

    monkeypatch.setattr(OwnFolder, "write", full)
    report, data = gone_on(tmp_path / "kept")
    assert data == whole
    assert report.notes == [
        f"groups from frame 3 on could not be kept in {tmp_path / 'kept'} (No space left on device): if this encode is "
        "ended, they are encoded again"
    ]
    assert not (tmp_path / "kept").exists()


def test_nothing_is_left_where_nothing_was_kept(tmp_path):
    begun(tmp_path / "kept", count=2)
    assert list(tmp_path.iterdir()) == []


def test_what_the_user_has_in_the_folder_stays(kept):
    (kept / "notes.txt").write_text("mine")
    gone_on(kept)
    assert [path.name for path in kept.iterdir()] == ["notes.txt"]


def test_a_frame_beyond_the_level_is_not_kept(monkeypatch, tmp_path):
    def refuse(self, codes, state=None, layers=None, *, write=StreamWriter.write_frame):
        if codes.type == "P":
            raise UsageError("rendering frame 1 takes too many pairs (R-5-4)")
        return write(self, codes, state, layers)

    monkeypatch.setattr(StreamWriter, "write_frame", refuse)
    with pytest.raises(IncompleteEncodeError, match="saved: 1 complete frame"):
        gone_on(tmp_path / "kept")
    assert not (tmp_path / "kept").exists()


@pytest.mark.skipif(os.name != "posix", reason="kills itself")
@pytest.mark.parametrize(
    "moments", [[5], pytest.param(range(10), marks=pytest.mark.exhaustive)], ids=["one moment", "ten moments"]
)
def test_killed_at_any_moment(tmp_path, whole, moments):
    """With SIGKILL as a frame is taken from the source: nothing is lost but the group at hand."""
    for moment in moments:
        target, folder = tmp_path / f"{moment}.gsvc", tmp_path / f"{moment}.resume"

        def frames(moment=moment):
            yield from CLIP[:moment]
            os.kill(os.getpid(), signal.SIGKILL)

        status = in_child(lambda target=target, folder=folder: encode((frames(), SMALL), target, PLAIN, resume=folder))
        assert os.WTERMSIG(status) == signal.SIGKILL
        assert not target.exists()
        report = encode((CLIP, SMALL), target, PLAIN, resume=folder)
        assert target.read_bytes() == whole
        groups = max(0, moment - 1) // 3  # a frame is typed when the next is there
        taken = report.notes[0] if report.notes else "0 frames"
        assert taken.startswith(f"{3 * groups} frames")
        assert not folder.exists()


@posix
@pytest.mark.exhaustive
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_fifty_kills_and_what_may_happen_between_them(tmp_path):
    assert kills(50, 1, tmp_path)


def test_digests_are_of_shape_type_and_samples():
    frame = CLIP[0]
    assert resume.digest_of(frame) == resume.digest_of(frame[::-1].copy()[::-1])
    others = [frame[::-1], frame.reshape(24, 16, 3), frame.astype(np.uint16)]
    assert len({resume.digest_of(one) for one in (frame, *others)}) == 4
