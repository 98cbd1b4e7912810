"""Folders that a command adopts: whose they must be, what is read, written and removed in them, and what is not."""

import os
import stat
import sys
from concurrent.futures import ThreadPoolExecutor
from errno import ENOSPC
from pathlib import Path

import pytest
from adopted import KINDS, NOBODY, as_nobody, in_the_way, only_root, posix

from gsvc_base import folders
from gsvc_base.errors import UsageError
from gsvc_base.folders import OwnFolder, UnusableFileError, read_regular


@pytest.fixture(params=["relative", "by path"])
def ways(request, monkeypatch):
    """Both ways to reach a file: in an opened folder, and by its path, as on systems without that."""
    if request.param == "by path":
        monkeypatch.setattr(folders, "RELATIVE", False)
    elif not folders.RELATIVE:
        pytest.skip("this system has no names relative to a folder")


def test_files_are_written_read_and_removed_by_name(ways, tmp_path):
    with OwnFolder(tmp_path / "own", "record") as own:
        own.write("a", b"1", durable=True)
        own.write("a", b"22")
        own.write("b/c/d", b"3")
        assert (own.read("a", 2), own.read("b/c/d", 9)) == (b"22", b"3")
        with pytest.raises(UnusableFileError, match="has 2 bytes; at most 1 are read"):
            own.read("a", 1)
        with pytest.raises(FileNotFoundError):
            own.read("x/y", 1)
        assert sorted(own.names()) == ["a", "b"]
        own.remove("a")
        own.remove("x/y")
        own.remove_folder()
    assert [path.name for path in (tmp_path / "own").iterdir()] == ["b"]
    if os.name == "posix":
        assert {stat.S_IMODE(path.stat().st_mode) for path in (tmp_path / "own", tmp_path / "own/b/c")} == {0o700}


@posix
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_not_a_regular_file_is_neither_read_nor_written_through(ways, tmp_path, kind):
    """A FIFO was waited for, and a file was written through a link."""
    victim = tmp_path / "victim"
    victim.write_bytes(b"precious")
    with OwnFolder(tmp_path / "own") as own:
        for name in ("a", ".a.0.part"):
            in_the_way(kind, own.path / name, victim)
        with pytest.raises(UnusableFileError, match="own/a is not a regular file: remove it"):
            own.read("a", 100)
        with pytest.raises(UnusableFileError, match="not a regular file"):
            read_regular(own.path / "a", 100)
        if kind == "folder":
            with pytest.raises(UnusableFileError, match="own/a is a folder: remove it"):
                own.write("a", b"new")
            with pytest.raises(OSError, match=r"irectory|permitted"):
                own.remove("a")
            assert (own.path / "a").is_dir()
        else:
            own.write("a", b"new")
            assert own.read("a", 3) == b"new"
            assert own.names() == ["a"]
    assert victim.read_bytes() == b"precious"


@posix
def test_no_folder_is_reached_through_a_link(ways, tmp_path):
    (tmp_path / "victim").mkdir()
    (tmp_path / "victim" / "a").write_bytes(b"precious")
    (tmp_path / "link").symlink_to("victim")
    with pytest.raises(UsageError, match="link is a link, where a folder of yours must be: remove the link"):
        OwnFolder(tmp_path / "link")
    with OwnFolder(tmp_path / "own") as own:
        (own.path / "b").symlink_to(tmp_path / "victim")
        for attempt in (lambda: own.read("b/a", 9), lambda: own.write("b/a", b""), lambda: own.remove("b/a")):
            with pytest.raises(UsageError, match="own/b is a link"):
                attempt()
        own.remove_others("c")
    with pytest.raises((UsageError, OSError)):
        read_regular(tmp_path / "link" / "a", 9)
    assert (tmp_path / "victim" / "a").read_bytes() == b"precious"


@posix
def test_a_folder_that_others_can_write_to_is_refused(tmp_path):
    for mode in (0o770, 0o757):
        (tmp_path / f"{mode}").mkdir()
        (tmp_path / f"{mode}").chmod(mode)
        with pytest.raises(UsageError, match="others can write to"):
            OwnFolder(tmp_path / f"{mode}")
    OwnFolder(tmp_path / f"{0o770}", group=True).close()
    with pytest.raises(UsageError, match="others can write to"):
        OwnFolder(tmp_path / f"{0o757}", group=True)
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match="file is a file, where a folder of yours must be"):
        OwnFolder(tmp_path / "file")


def test_a_folder_that_holds_something_else_is_refused_and_stays(ways, tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "2024.gsvc").touch()
    with pytest.raises(UsageError, match=r"holds '2024.gsvc' but no about.json, so this command did not make it"):
        OwnFolder(tmp_path / "a", "about.json", lock="lock")
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["2024.gsvc"]
    (tmp_path / "b").mkdir()
    for left in ("lock", ".about.json.0.part"):  # by a process that was killed
        (tmp_path / "b" / left).touch()
    OwnFolder(tmp_path / "b", "about.json", lock="lock").close()


def test_a_locked_folder_is_refused_until_it_is_closed(tmp_path):
    pytest.importorskip("fcntl")
    with OwnFolder(tmp_path / "a", "record", lock="lock"):
        with pytest.raises(BlockingIOError):
            OwnFolder(tmp_path / "a", "record", lock="lock")
        assert [path.name for path in (tmp_path / "a").iterdir()] == ["lock"]
    assert list((tmp_path / "a").iterdir()) == []


@posix
def test_a_folder_that_goes_while_it_is_being_locked_is_made_again(monkeypatch, tmp_path):
    """The process that had it removes it: the lock of a file without a name would keep nobody out."""
    calls = []

    def gone(file, lock=folders.try_lock):
        if not calls:
            calls.append(file)
            os.unlink(tmp_path / "a" / "lock")
            os.rmdir(tmp_path / "a")
        return lock(file)

    monkeypatch.setattr(folders, "try_lock", gone)
    with OwnFolder(tmp_path / "a", "record", lock="lock") as own:
        own.write("x", b"")
        assert sorted(path.name for path in (tmp_path / "a").iterdir()) == ["lock", "x"]


@posix
@pytest.mark.parametrize("kind", KINDS)
def test_a_lock_that_is_not_a_file_is_refused(tmp_path, kind):
    (tmp_path / "a").mkdir()
    in_the_way(kind, tmp_path / "a" / "lock", tmp_path / "victim")
    with pytest.raises(UsageError, match="lock is not a regular file: remove it"):
        OwnFolder(tmp_path / "a", "record", lock="lock")
    assert not (tmp_path / "victim").exists()


@posix
def test_two_that_write_the_same_name_are_in_nobody_s_way(tmp_path):
    data = [bytes([letter]) * 4096 for letter in b"ab"]
    with OwnFolder(tmp_path / "a") as own, ThreadPoolExecutor(len(data)) as pool:
        for written in [pool.submit(own.write, "x", data[i % 2]) for i in range(300)]:
            written.result()
            assert own.read("x", 4096) in data
        pool.shutdown()
        assert own.names() == ["x"]


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_full_disk_leaves_the_old_file_alone(ways, monkeypatch, tmp_path, call):
    def full(*arguments, **options):
        raise OSError(ENOSPC, "No space left on device")

    with OwnFolder(tmp_path / "a") as own:
        own.write("x", b"old")
        monkeypatch.setattr(os, call, full)
        with pytest.raises(OSError, match="No space") as caught:
            own.write("x", b"new", durable=True)
        assert caught.value.filename.startswith(str(own.path))
        assert (own.read("x", 3), own.names()) == (b"old", ["x"])


def test_records_have_a_digest_and_list_what_is_removed(ways, tmp_path):
    with OwnFolder(tmp_path / "a") as own:
        own.write_listed("v/kept.json", {"in/x": b"1", "in/y": b"2", "z": b"3"})
        assert own.record("v/kept.json") == ({"files": ["in/x", "in/y", "z"]}, True)
        (own.path / "v/in/mine").write_text("of the user")
        own.write_listed("v/kept.json", {"in/x": b"4"})
        assert sorted(path.name for path in own.path.rglob("*")) == ["in", "kept.json", "mine", "v", "x"]
        own.remove_listed("v/kept.json")
        own.remove_listed("v/kept.json")
        assert [path.name for path in own.path.rglob("*")] == ["v", "in", "mine"]
        with pytest.raises(UsageError, match=r"holds .in. but no kept\.json"):
            own.write_listed("v/kept.json", {})
        (own.path / "v/in/mine").unlink()
        own.remove_folder("v/in")
        own.write_listed("v/kept.json", {"x": b""})
        own.remove_listed("v/kept.json")
        assert own.names() == []


@pytest.mark.parametrize(
    "files", [["../x"], ["/x"], ["a/../x"], ["a\\x"], ["c:x"], [""], [1], "x", None, ["\ud800"]], ids=repr
)
def test_a_record_that_leads_elsewhere_removes_nothing(tmp_path, files):
    (tmp_path / "x").touch()
    with OwnFolder(tmp_path / "a") as own:
        own.write_record("kept.json", {"files": files})
        with pytest.raises(UsageError, match=r"kept.json is damaged"):
            own.remove_listed("kept.json")
        for attempt in (lambda: own.read("../x", 1), lambda: own.write("../x", b""), lambda: own.remove("../x")):
            with pytest.raises(UnusableFileError, match=r"'\.\./x' is not the name of a file in a folder"):
                attempt()
    assert (tmp_path / "x").exists()


@pytest.mark.parametrize(
    "data", [b"", b"[]", b"5", b"{", b"[" * 100_000, b'{"files": []}', b'{"sha256": 5}', b"\xff"], ids=len
)
def test_what_is_not_a_record_is_not_intact(tmp_path, data):
    with OwnFolder(tmp_path / "a") as own:
        own.write("r", data)
        assert not own.record("r").is_intact


def test_a_record_nested_as_deep_as_json_reads_is_not_intact(tmp_path):
    with OwnFolder(tmp_path / "a") as own:
        for depth in range(sys.getrecursionlimit() - 300, sys.getrecursionlimit()):  # one of them cannot be written
            own.write("r", b'{"a":' + b"[" * depth + b"]" * depth + b"}")
            assert not own.record("r").is_intact


@only_root
def test_a_folder_of_another_user_is_refused(tmp_path):
    (tmp_path / "theirs").mkdir()
    os.chown(tmp_path / "theirs", NOBODY, NOBODY)
    with pytest.raises(UsageError, match="theirs belongs to another user, who can change what is in it"):
        OwnFolder(tmp_path / "theirs")


@only_root
def test_another_user_can_do_nothing_in_a_folder(monkeypatch, tmp_path):
    with OwnFolder(tmp_path / "a", lock="lock") as own:
        own.write("x", b"secret")
        monkeypatch.chdir(tmp_path)  # whose parents the other need not be able to walk
        tmp_path.chmod(0o777)

        def attempt():
            for work in (
                Path("a/x").read_bytes, Path("a/y").touch, lambda: os.symlink("/etc/passwd", "a/z"), Path("a/x").unlink,
                lambda: os.mkfifo("a/f"), lambda: os.listdir("a"), Path("a/lock").read_bytes,
                lambda: OwnFolder(Path("a")),
            ):  # fmt: skip
                with pytest.raises((PermissionError, UsageError)):
                    work()

        as_nobody(attempt)
