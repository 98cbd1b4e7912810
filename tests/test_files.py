"""Files that stand under their name only when complete: permissions, links, leftovers, names at their limits."""

import errno
import os
import stat
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import pytest

from gsvc_base import files
from gsvc_base.files import PartialFile, complete_file, remove_leftover, write_text
from gsvc_ref.video import ColorDescription, VideoFormat, open_writer

VIDEO = VideoFormat(16, 16, Fraction(25), 8, "420", ColorDescription(1, 1, 1, False, 0))

posix = pytest.mark.skipif(os.name != "posix", reason="permissions and locks of POSIX")

KILLED = """
import os, signal, sys
from pathlib import Path
from gsvc_base.files import PartialFile
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
def test_a_leftover_of_a_killed_process_gives_way_and_a_file_in_work_stays(tmp_path):
    long = "y" * 150
    run = subprocess.run([sys.executable, "-c", KILLED, *(str(tmp_path / name) for name in ("x", "x2", long))])
    assert run.returncode == -9
    assert names(tmp_path) == [".x.0.part", ".x2.0.part", f".{'y' * 100}.0.part"]
    working = PartialFile(tmp_path / "x")
    assert working.path.read_bytes() == b""  # not the half of the other
    working.path.write_bytes(b"first")
    write(tmp_path / "x", b"second")
    assert working.path.read_bytes() == b"first"
    write(tmp_path / long)
    assert names(tmp_path) == [".x.0.part", ".x2.0.part", "x", long]
    working.commit()
    assert names(tmp_path) == [".x2.0.part", "x", long]
    assert (tmp_path / "x").read_bytes() == b"first"


@posix
def test_leftovers_of_a_folder_of_pictures_go(tmp_path):
    run = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path / "frame_000007.png"), str(tmp_path / "x")])
    assert run.returncode == -9
    (tmp_path / ".part").touch()
    open_writer(tmp_path, VIDEO)
    assert names(tmp_path) == [".part", ".x.0.part"]


@posix
def test_a_file_that_takes_the_place_of_a_leftover_is_not_one(tmp_path, monkeypatch):
    """Two processes find the same leftover, and one has put a file of its own there when the other gets its turn."""
    path = tmp_path / ".x.0.part"
    path.touch()

    def overtaken(file, lock=files.try_lock):
        monkeypatch.undo()
        path.unlink()
        path.write_bytes(b"work")
        return lock(file)

    monkeypatch.setattr(files, "try_lock", overtaken)
    remove_leftover(path)
    assert path.read_bytes() == b"work"


@posix
def test_a_pipe_or_a_link_of_a_leftovers_name_is_left_alone(tmp_path):
    os.mkfifo(tmp_path / ".x.0.part")  # which blocks who opens it as a file
    (tmp_path / "other").write_bytes(b"other")
    (tmp_path / ".x.1.part").symlink_to(tmp_path / "other")
    write(tmp_path / "x")
    assert names(tmp_path) == [".x.0.part", ".x.1.part", "other", "x"]
    assert (tmp_path / "other").read_bytes() == b"other"


@pytest.mark.parametrize("name", ["x.y4m", "x.mkv"])
def test_an_interrupt_while_a_leftover_is_removed_leaves_no_file_of_its_own(tmp_path, monkeypatch, name):
    def interrupted(*_):
        raise KeyboardInterrupt

    if name == "x.mkv":
        pytest.importorskip("av")
    monkeypatch.setattr(files, "remove_leftover", interrupted)
    with pytest.raises(KeyboardInterrupt):
        open_writer(tmp_path / name, VIDEO)
    assert list(tmp_path.iterdir()) == []


DEVICE_TEXT = "a page\n"


def made_device(path: Path) -> Path:
    """Another null device, where this user may make one."""
    try:
        os.mknod(path, stat.S_IFCHR | 0o600, os.stat("/dev/null").st_rdev)
    except (OSError, AttributeError):
        pytest.skip("only root makes devices")
    return path


@posix
def test_text_goes_to_a_device_and_leaves_it_one(tmp_path):
    """The machine's null device was replaced by a report."""
    path = made_device(tmp_path / "null")
    write_text(DEVICE_TEXT, path)
    assert stat.S_ISCHR(path.stat().st_mode)
    assert names(tmp_path) == ["null"]


@posix
def test_text_goes_through_a_pipe(tmp_path):
    path = tmp_path / "pipe"
    os.mkfifo(path)
    with subprocess.Popen(["cat", str(path)], stdout=subprocess.PIPE, text=True) as reader:
        write_text(DEVICE_TEXT, path)
        assert reader.communicate(timeout=60)[0] == DEVICE_TEXT
    assert stat.S_ISFIFO(path.stat().st_mode)


@posix
def test_text_follows_a_link_and_leaves_it_one(tmp_path):
    (tmp_path / "link").symlink_to("target")
    for text in ("first", "second"):  # the target is made, then replaced
        write_text(text, tmp_path / "link")
        assert (tmp_path / "target").read_text() == text
    assert (tmp_path / "link").is_symlink()
    assert names(tmp_path) == ["link", "target"]


@posix
def test_a_link_that_was_planted_beside_a_page_is_not_followed(tmp_path):
    precious = tmp_path / "precious"
    precious.write_text("precious")
    for name in ("page.html.part", ".page.html.0.part", ".page.html.1.part"):
        (tmp_path / name).symlink_to(precious)
    write_text(DEVICE_TEXT, tmp_path / "page.html")
    assert precious.read_text() == "precious"
    assert (tmp_path / "page.html").read_text() == DEVICE_TEXT
    assert not (tmp_path / "page.html").is_symlink()


def test_a_page_that_cannot_be_completed_leaves_the_old_one(tmp_path, monkeypatch):
    path = tmp_path / "page.html"
    write_text("old", path)
    monkeypatch.setattr("os.replace", lambda *_: (_ for _ in ()).throw(OSError(errno.EIO, "Input/output error")))
    with pytest.raises(OSError, match="Input/output"):
        write_text("new", path)
    assert path.read_text() == "old"
    assert names(tmp_path) == ["page.html"]


def test_text_that_is_no_unicode_is_written_with_escapes(tmp_path):
    write_text("a\udcffb\n", tmp_path / "page")
    assert (tmp_path / "page").read_bytes() == b"a\\udcffb\n"


WRITES = """
import sys
from gsvc_base.files import write_text
print("before")
write_text("the page\\n", sys.argv[1])
print("after")
"""


@posix
@pytest.mark.parametrize("name", ["-", "/dev/stdout", "/dev/fd/1"])
@pytest.mark.parametrize("to", ["pipe", "file"])
def test_text_for_standard_output_goes_there_in_its_turn(tmp_path, name, to):
    """With output in a file, the file was replaced by the page, and what was printed was lost."""
    with (tmp_path / "out").open("w+b") as file:
        target = file if to == "file" else subprocess.PIPE
        run = subprocess.run([sys.executable, "-c", WRITES, name], stdout=target, timeout=60, check=True)
        file.seek(0)
        assert (run.stdout or file.read()) == b"before\nthe page\nafter\n"
    assert names(tmp_path) == ["out"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is full")
def test_a_full_disk_has_the_name_of_the_file(monkeypatch):
    with pytest.raises(OSError, match="No space left on device: '/dev/full'"):
        write_text(DEVICE_TEXT, "/dev/full")
    with pytest.raises(OSError, match="No space left on device: '/dev/full'"), complete_file(Path("/dev/full")) as file:
        file.write(bytes(1 << 20))  # more than is held back
    with open("/dev/full", "w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        with pytest.raises(OSError, match="No space left on device: 'standard output'"):
            write_text(DEVICE_TEXT, "-")
        monkeypatch.undo()
        with pytest.raises(OSError, match="No space left"):
            full.close()


def test_an_error_of_the_caller_is_not_that_of_the_file(tmp_path):
    with pytest.raises(OSError, match="Broken") as caught, complete_file(tmp_path / "x"):
        raise BrokenPipeError(errno.EPIPE, "Broken pipe")
    assert caught.value.filename is None
