"""Files that stand under their final name only when they are complete, and the writing of text to any target."""

import os
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import Any, BinaryIO, Final, Literal, TextIO, cast

from gsvc_base.errors import UsageError, naming

STREAM_SUFFIX: Final = ".gsvc"
"""The end of the name of a file that holds a stream (R-1.1-1)."""

MAX_NAME_BYTES: Final = 100
"""Maximum length of the target's name inside the temporary one, which has to fit the system's limit as well."""


class PartialFile:
    """A file under a temporary name beside its target, which it replaces on `commit`.

    At every moment the target is the old file or the new one, complete. What stood there before keeps its permissions,
    and its owner where that is allowed. A target that cannot be replaced is refused at once: it is read-only, its name
    too long, its folder closed or missing.
    """

    def __init__(self, target: Path) -> None:
        self.target = Path(os.path.realpath(target))  # links are followed, so that a link stays one
        check_parent(self.target)
        before = _status(self.target)
        if before is not None and not os.access(self.target, os.W_OK):  # a rename would not mind
            raise PermissionError(13, os.strerror(13), str(self.target))
        self._lock: BinaryIO | None = None
        try:
            # ``.NAME.NUMBER.part`` in the same folder, empty. If the process is killed, the next one takes it over:
            # nobody holds its lock.
            self.path = self._create()
        except OSError as error:  # the user does not know the temporary file, which it names
            raise OSError(error.errno, error.strerror or str(error), str(self.target)) from None
        if before is not None:
            self._take_over(before)

    def _create(self) -> Path:
        for number in count():
            path = self.target.with_name(f".{_short(self.target.name)}.{number}.part")
            remove_leftover(path)
            try:
                file = path.open("xb")
            except FileExistsError:
                continue
            locked = try_lock(file)
            if locked and still_named(file, path):  # another process may have removed it just before
                self._lock = file
                return path
            file.close()
            if locked is None:
                return path
        raise AssertionError("there is always another number")

    def _take_over(self, before: os.stat_result) -> None:
        """Give the new file the owner and the permissions of the old one."""
        if hasattr(os, "chown"):
            with suppress(OSError):  # only root may give a file away
                os.chown(self.path, before.st_uid, before.st_gid)
        os.chmod(self.path, stat.S_IMODE(before.st_mode))

    def commit(self, *, durable: bool = False) -> None:
        """Give the file its final name, replacing what stood there.

        A process that is killed does no harm; if `durable`, neither does a power cut from here on.
        """
        if durable:
            _sync(self.path)
        os.replace(self.path, self.target)
        self._unlock()
        if durable:
            with suppress(OSError):  # not every system can do this to a folder
                _sync(self.target.parent)

    def discard(self) -> None:
        """Remove the file; harmless when it is gone already."""
        self.path.unlink(missing_ok=True)
        self._unlock()

    def _unlock(self) -> None:
        if self._lock is not None:
            self._lock.close()
            self._lock = None


@contextmanager
def complete_file(path: Path, *, durable: bool = False) -> Iterator[BinaryIO]:
    """A file to write, which takes its name when the block ends well; a pipe or device is written to at once."""
    if path.exists() and not path.is_file():  # it has no name to take at the end, and must not be replaced
        with _named(path, path, "wb") as device:
            yield device
        return
    part = PartialFile(path)
    try:
        with _named(part.path, path, "w+b") as file:
            yield file
        part.commit(durable=durable)
    except BaseException:
        part.discard()
        raise


@contextmanager
def opened_output(target: str | Path | BinaryIO) -> Iterator[BinaryIO]:
    """The file that a stream goes to: a path as by `complete_file`, ``-`` for standard output, or an open file."""
    if not isinstance(target, str | Path):
        if not hasattr(target, "write") or hasattr(target, "encoding"):
            raise UsageError(f"a {type(target).__name__} is not a target; give a path or a file opened in mode 'wb'")
        yield target
        return
    if str(target) == "-":
        output = NamingWriter(sys.stdout.buffer, "standard output")
        yield cast(BinaryIO, output)
        output.flush()
        return
    path = Path(target)
    if path.is_dir():
        raise UsageError(f"{path} is a folder; name the file to write, for instance {path / 'video.gsvc'}")
    with complete_file(path, durable=True) as file:
        yield file


def write_text(text: str, path: str | Path) -> None:
    r"""Write a page, a report, any text as UTF-8: to a complete file, a device, a pipe, or a standard stream.

    What is no Unicode, as in names of files, is written as an escape such as ``\udcff``.
    """
    data = text.encode("utf-8", "backslashreplace")
    if (stream := standard_stream(path)) is not None:
        with naming("standard output"):
            stream.flush()
            stream.buffer.write(data)
            stream.buffer.flush()
    else:
        with complete_file(Path(path)) as file:
            file.write(data)


def standard_stream(path: str | Path) -> TextIO | None:
    """Standard output or standard error, if a path means it: ``-``, ``/dev/stdout``, or the file that it goes to."""
    if str(path) == "-":
        return sys.stdout
    found = _status(Path(path))
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):  # closed, or of a test
            if found is not None and os.path.samestat(os.fstat(stream.fileno()), found):
                return stream
    return None


class NamingWriter:
    """A binary file to write whose errors name it, and only these: not what the caller does meanwhile."""

    def __init__(self, file: BinaryIO, name: str) -> None:
        self._file, self._name = file, name

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def write(self, data: Any) -> int:
        """Write."""
        with naming(self._name):
            return self._file.write(data)

    def flush(self) -> None:
        """Write what is held back."""
        with naming(self._name):
            self._file.flush()


@contextmanager
def _named(path: Path, name: Path, mode: Literal["wb", "w+b"]) -> Iterator[BinaryIO]:
    """An open file whose errors, those of the last flush too, have a name that the user knows."""
    file = path.open(mode)
    try:
        yield cast(BinaryIO, NamingWriter(file, str(name)))
    finally:
        with naming(str(name)):
            file.close()


def remove_leftover(path: Path) -> None:
    """Remove a partial file whose process is gone, so that nobody holds its lock; leave anything else."""
    with suppress(OSError), open(path, "rb", opener=open_at_once) as file:
        if stat.S_ISREG(os.fstat(file.fileno()).st_mode) and try_lock(file) and still_named(file, path):
            path.unlink()


def remove_leftovers(folder: Path, names: str) -> None:
    """Remove partial files of targets with such names, given as for `Path.glob`, whose processes are gone."""
    for path in folder.glob(f".{names}.*.part"):
        remove_leftover(path)


def open_at_once(path: str, flags: int, dir_fd: int | None = None) -> int:
    """Open a path that may be anything: a pipe would be waited for, a link may lead anywhere."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOFOLLOW", 0), 0o666, dir_fd=dir_fd)


def check_parent(target: Path) -> None:
    """Refuse a target whose folder does not exist, and say to create it."""
    if not target.parent.is_dir():
        raise FileNotFoundError(f"the folder {target.parent} does not exist; create it first to write {target.name}")


def _status(path: Path) -> os.stat_result | None:
    try:
        return path.stat()
    except FileNotFoundError:
        return None


def _short(name: str) -> str:
    while len(os.fsencode(name)) > MAX_NAME_BYTES:
        name = name[:-1]
    return name


def still_named(file: BinaryIO, path: Path) -> bool:
    """Whether an open file still has its name."""
    found = _status(path)
    return found is not None and os.path.samestat(os.fstat(file.fileno()), found)


def try_lock(file: BinaryIO) -> bool | None:
    """Lock a file until it is closed: False if another holds the lock, None where files cannot be locked."""
    try:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except (ImportError, OSError):
        return None
    return True


def _sync(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
