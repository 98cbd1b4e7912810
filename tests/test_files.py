"""Files that stand under their name only when complete: permissions, links, leftovers, names at their limits."""

import errno
import os
import stat
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import pytest

from gsvc_ref.files import PartialFile, remove_leftovers
from gsvc_ref.video import ColorDescription, VideoFormat, libav_writer, open_writer, y4m

VIDEO = VideoFormat(16, 16, Fraction(25), 8, "420", ColorDescription(1, 1, 1, False, 0))

posix = pytest.mark.skipif(os.name != "posix", reason="permissions and locks of POSIX")

KILLED = """
import os, signal, sys
from pathlib import Path
from gsvc_ref.files import PartialFile
for name in sys.argv[1:]:
    part = PartialFile(Path(name))
    part.path.write_bytes(b"half")
os.kill(os.getpid(), signal.SIGKILL)
"""


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def write(target: Path, data: bytes = b"new", *, durable: bool = False) -> None:
    part = PartialFile(target)
    part.path.write_bytes(data)
    part.commit(durable=durable)


@posix
@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
def test_a_new_file_has_the_permissions_of_a_plain_one(tmp_path, mask):
    before = os.umask(mask)
    try:
        (tmp_path / "plain").write_bytes(b"")
        write(tmp_path / "new")
    finally:
        os.umask(before)
    assert (tmp_path / "new").stat().st_mode == (tmp_path / "plain").stat().st_mode


@posix
@pytest.mark.parametrize("mode", [0o600, 0o640, 0o666, 0o755])
def test_a_replaced_file_keeps_its_permissions_and_owner(tmp_path, mode):
    path = tmp_path / "x"
    path.write_bytes(b"old")
    if os.geteuid() == 0:
        os.chown(path, 12345, 54321)
    path.chmod(mode)
    before = path.stat()
    write(path, durable=True)
    after = path.stat()
    assert path.read_bytes() == b"new"
    assert stat.S_IMODE(after.st_mode) == mode
    assert (after.st_uid, after.st_gid) == (before.st_uid, before.st_gid)


@posix
def test_a_read_only_file_is_not_replaced(tmp_path, monkeypatch):
    path = tmp_path / "x"
    path.write_bytes(b"old")
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK)  # root may write to anything
    with pytest.raises(PermissionError) as caught:
        PartialFile(path)
    assert (caught.value.errno, caught.value.filename) == (errno.EACCES, str(path))
    assert names(tmp_path) == ["x"]


def test_a_closed_folder_is_told_with_the_name_of_the_target(tmp_path, monkeypatch):
    def refuse(self, mode):  # a closed folder would not stop root
        raise PermissionError(errno.EACCES, "Permission denied", str(self))

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(PermissionError) as caught:
        PartialFile(tmp_path / "x")
    assert caught.value.filename == str(tmp_path / "x")


@pytest.mark.parametrize("length", [100, 200, 255])
def test_a_name_may_be_as_long_as_the_system_allows(tmp_path, length):
    path = tmp_path / ("é" * (length // 2) + "x" * (length % 2))
    assert len(os.fsencode(path.name)) == length
    write(path)
    assert names(tmp_path) == [path.name]


def test_a_name_that_is_too_long_is_refused_at_once(tmp_path):
    with pytest.raises(OSError, match="too long") as caught:
        PartialFile(tmp_path / ("x" * 256))
    assert caught.value.errno == errno.ENAMETOOLONG
    assert names(tmp_path) == []


def test_links_stay_links_and_may_lead_to_nothing(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real" / "x")
    for data in (b"first", b"second"):
        write(tmp_path / "link", data)
        assert (tmp_path / "link").is_symlink()
        assert (tmp_path / "real" / "x").read_bytes() == data
    assert names(tmp_path / "real") == ["x"]


def test_a_circle_of_links_is_refused(tmp_path):
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    with pytest.raises(OSError, match="symbolic links"):
        PartialFile(tmp_path / "a")


@posix
def test_who_reads_the_old_file_goes_on_reading_it(tmp_path):
    path = tmp_path / "x"
    path.write_bytes(b"old")
    with path.open("rb") as file:
        write(path)
        assert file.read() == b"old"
    assert path.read_bytes() == b"new"


@posix
def test_leftovers_of_killed_processes_go_and_files_in_work_stay(tmp_path):
    long = "y" * 150
    run = subprocess.run([sys.executable, "-c", KILLED, *(str(tmp_path / name) for name in ("x", "x2", long))])
    assert run.returncode == -9
    left = names(tmp_path)
    assert len(left) == 3
    assert all(name.startswith(".") and name.endswith("-0.part") for name in left)
    working = PartialFile(tmp_path / "x")
    for name in (".x.part", ".x.1-2.part.txt", "x.1-2.part", ".x.a-2.part"):  # somebody else's
        (tmp_path / name).touch()
    others = {".x.part", ".x.1-2.part.txt", "x.1-2.part", ".x.a-2.part"}
    remove_leftovers(tmp_path, "x")
    assert set(names(tmp_path)) == {working.path.name, *(name for name in left if not name.startswith(".x."))} | others
    remove_leftovers(tmp_path, long)
    assert set(names(tmp_path)) == {working.path.name, *(name for name in left if name.startswith(".x2."))} | others
    remove_leftovers(tmp_path)
    assert set(names(tmp_path)) == {working.path.name} | others
    working.commit()
    assert set(names(tmp_path)) == {"x"} | others


@posix
def test_a_pipe_or_a_link_of_a_leftovers_name_is_left_alone(tmp_path):
    os.mkfifo(tmp_path / ".x.1-0.part")  # which blocks who opens it as a file
    (tmp_path / "other").write_bytes(b"other")
    (tmp_path / ".x.1-1.part").symlink_to(tmp_path / "other")
    remove_leftovers(tmp_path, "x")
    assert names(tmp_path) == [".x.1-0.part", ".x.1-1.part", "other"]


def test_a_folder_that_cannot_be_listed_is_written_to(tmp_path, monkeypatch):
    def closed(folder: Path):
        raise PermissionError(errno.EACCES, "closed", str(folder))

    with monkeypatch.context() as patched:
        patched.setattr(Path, "iterdir", closed)
        remove_leftovers(tmp_path)
        write(tmp_path / "x")
    assert names(tmp_path) == ["x"]


@pytest.mark.parametrize("module", [y4m, libav_writer])
def test_an_interrupt_while_leftovers_are_removed_leaves_no_file_of_its_own(tmp_path, monkeypatch, module):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(module, "remove_leftovers", interrupted)
    with pytest.raises(KeyboardInterrupt):
        open_writer(tmp_path / ("x.y4m" if module is y4m else "x.mkv"), VIDEO)
    assert list(tmp_path.iterdir()) == []
