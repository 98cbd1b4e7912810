"""Folders that a command adopts: finished groups of ``--resume``, what the kit keeps, own vectors, caches, the site.

Their names can be guessed, and what they hold is read, replaced and removed. So such a folder must belong to the user,
nobody else may write to it, and a record in it shows that this program made it. It is opened once; everything in it is
reached from there, by name and through no link. A file is read only if it is a regular one, and written under a new
name that is then given the final one. Files are removed by name: none goes because its name looks like ours.
"""

import errno
import json
import os
import shutil
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any, BinaryIO, Final, Literal, NamedTuple, Self

from gsvc_base.errors import UsageError
from gsvc_base.files import open_at_once, try_lock

FOLDER: Final = getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_NOFOLLOW", 0)

RELATIVE: Final = bool(FOLDER) and {os.open, os.stat, os.unlink, os.rename, os.mkdir, os.rmdir} <= os.supports_dir_fd
"""Whether names can be looked up in an opened folder. Elsewhere, as on Windows, its path is checked and then used."""

TRIES: Final = 3
"""How many temporary names are tried; something that cannot be removed may have the first ones."""

DIGEST: Final = "sha256"
"""The member of a record that is the digest of the others."""

MAX_RECORD: Final = 1 << 24
"""Maximum number of bytes of a record."""


class UnusableFileError(OSError):
    """What has the name is not a regular file, or is too large."""


class Record(NamedTuple):
    """The members of a record without the digest, and whether the digest fits."""

    fields: dict[str, Any]
    is_intact: bool


class OwnFolder:
    """A folder that belongs to the user and that nobody else can write to; as a context manager it is closed.

    Names of files in it may have folders before them, with ``/`` on every system; these are made if needed.

    Parameters
    ----------
    path
        It is made if it does not exist; the folder that contains it must exist.
    record
        Name of the record that shows that this program made the folder; without it the folder has to be empty. None:
        the folder may hold anything, since `write_listed` asks for a record in each part of it.
    lock
        Name of a file that is locked until the folder is closed, and then removed; None: nothing is locked.
    mode
        Permissions of the folders that are made.
    group
        Whether the group of the folder may write to it, as to those that the umask 002 makes.
    parents
        Whether folders that contain it are made, too.

    Raises
    ------
    UsageError
        It is a link or a file, belongs to another user, others can write to it, it holds something else, or the lock is
        not a regular file.
    BlockingIOError
        Somebody else holds the lock.
    OSError
        The system refuses it.
    """

    def __init__(
        self, path: Path, record: str | None = None, *, lock: str | None = None, mode: int = 0o700, group: bool = False,
        parents: bool = False,
    ) -> None:  # fmt: skip
        self.path, self._lock_name, self._mode = path, lock, mode
        self._others = stat.S_IWOTH if group else stat.S_IWGRP | stat.S_IWOTH
        self._lock: BinaryIO | None = None
        if parents:
            path.parent.mkdir(parents=True, exist_ok=True)
        while True:
            with suppress(FileExistsError):
                path.mkdir(mode)
            with suppress(FileNotFoundError):  # another process has removed it just now, so it is made again
                self._here = _Opened(path, self._others)
                try:
                    if record is not None:
                        self._check_contents("", record)
                    if lock is None or self._is_locked(lock):
                        return
                except BaseException:
                    self._leave()
                    raise
                self._leave()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the lock; harmless if the folder is closed already."""
        if self._lock is not None and self._lock_name is not None:
            if not RELATIVE:  # Windows removes no file that is open, and has locked none
                self._lock.close()
            with suppress(OSError):
                self._here.unlink(self._lock_name)
        self._leave()

    def _leave(self) -> None:
        if self._lock is not None:
            self._lock.close()
            self._lock = None
        self._here.close()

    def _is_locked(self, name: str) -> bool:
        """Lock the file of a name; False if another process has removed it, or the folder, just now."""
        try:
            with suppress(FileNotFoundError):
                self._here.check_regular(name, self._here.status(name))
            self._lock = self._here.open(name, "ab")
            found = os.fstat(self._lock.fileno())
            self._here.check_regular(name, found)
        except UnusableFileError as error:
            raise UsageError(str(error)) from None
        if try_lock(self._lock) is False:
            raise BlockingIOError(errno.EWOULDBLOCK, "another process uses it", str(self.path))
        return os.path.samestat(found, self._here.status(name)) and os.path.samestat(found, os.lstat(self.path / name))

    def _check_contents(self, home: str, record: str) -> None:
        """Refuse a folder inside of this one, or itself (``""``), that holds something but no record."""
        with suppress(FileNotFoundError), self._opened(home) as here:
            names = set(here.names())
            if record not in names and (foreign := names - {self._lock_name, *_parts_of(record)}):
                raise UsageError(
                    f"{here.path} holds {min(foreign)!r} but no {record}, so this command did not make it: remove the "
                    "folder, or choose another name"
                )

    def names(self) -> list[str]:
        """The names of everything in the folder."""
        return self._here.names()

    def read(self, name: str, most: int) -> bytes:
        """The contents of a regular file of at most `most` bytes.

        Raises
        ------
        FileNotFoundError
            Nothing has the name.
        UnusableFileError
            It is a link, folder, device or FIFO, or larger.
        OSError
            It cannot be read.
        """
        folder, last = _split(name)
        with self._opened(folder) as here:
            return here.read(last, most)

    def write(self, name: str, data: bytes, *, durable: bool = False) -> None:
        """Write a complete file in place of what had its name; if `durable`, it survives a power cut from here on.

        Raises
        ------
        UnusableFileError
            A folder has the name.
        OSError
            It cannot be written, as on a full disk. Nothing is left of it.
        """
        folder, last = _split(name)
        with self._opened(folder, mode=self._mode) as here:
            here.write(last, data, durable=durable)

    def remove(self, name: str) -> None:
        """Remove a file of this name, and what a write that was killed left of it; harmless if there is none.

        Raises
        ------
        OSError
            It cannot be removed: it is a folder.
        """
        folder, last = _split(name)
        with suppress(FileNotFoundError), self._opened(folder) as here:
            here.remove(last)

    def remove_folder(self, name: str = "") -> None:
        """Remove a folder inside of this one, or close this one and remove it; it stays if something is in it."""
        folder, _, last = name.rpartition("/")
        with suppress(OSError):
            if last:
                with self._opened(folder) as here:
                    here.rmdir(last)
            else:
                self.close()
                os.rmdir(self.path)

    def remove_others(self, name: str) -> None:
        """Remove everything except one name from a folder that holds nothing of anybody else."""
        for other in set(self.names()) - {name}:
            if self._here.handle is None:
                shutil.rmtree(self.path / other, ignore_errors=True)
            else:
                shutil.rmtree(other, ignore_errors=True, dir_fd=self._here.handle)

    def record(self, name: str) -> Record:
        """A record; empty and not intact if the file does not hold one.

        Raises
        ------
        FileNotFoundError, UnusableFileError, OSError
            As from `read`.
        """
        data = self.read(name, MAX_RECORD)
        try:
            fields = json.loads(data)
            stated = fields.pop(DIGEST, None)
            return Record(fields, is_intact=stated == _digest(fields))
        except (ValueError, AttributeError, TypeError, RecursionError):  # also of one nested too deep to write again
            return Record({}, is_intact=False)

    def write_record(self, name: str, fields: Mapping[str, Any], *, durable: bool = False) -> None:
        """Write a record, whose members must be values that JSON has."""
        complete = {**fields, DIGEST: _digest(fields)}
        self.write(name, json.dumps(complete, indent=1).encode(), durable=durable)

    def write_listed(self, record: str, files: Mapping[str, bytes]) -> None:
        """Write files beside a record that lists them, in place of those that the same record lists.

        Raises
        ------
        UsageError
            The folder of the record holds something, but no such record.
        OSError
            As from `write`.
        """
        home, _, last = record.rpartition("/")
        self._check_contents(home, last)
        self.remove_listed(record)
        self.write_record(record, {"files": sorted(files)})
        for name, data in files.items():
            self.write(f"{home}/{name}" if home else name, data)

    def remove_listed(self, record: str) -> None:
        """Remove the files that a record lists, each of their folders that is empty then, and the record.

        Raises
        ------
        UsageError
            The record is damaged.
        """
        home = record.rpartition("/")[0]
        try:
            fields, is_intact = self.record(record)
        except FileNotFoundError:
            return
        files = fields.get("files")
        if not is_intact or not isinstance(files, list) or not all(map(_is_name, files)):
            raise UsageError(f"{self.path / record} is damaged: remove {self.path / home}, or choose another name")
        names = [*(f"{home}/{name}" if home else name for name in files), record]
        folders = {name[:at] for name in names for at, letter in enumerate(name) if letter == "/" and at >= len(home)}
        for name in names:
            with suppress(OSError):  # a folder has the name now, which is not ours
                self.remove(name)
        for folder in sorted(folders, key=len, reverse=True):
            self.remove_folder(folder)

    @contextmanager
    def _opened(self, name: str, *, mode: int | None = None) -> Iterator["_Opened"]:
        """A folder inside of this one, or itself (``""``), made if need be with the permissions of a mode."""
        here = self._here
        if name:
            folder, _, last = name.rpartition("/")
            with self._opened(folder, mode=mode) as outside:
                if mode is not None:
                    outside.mkdir(last, mode)
                here = _Opened(self.path / name, self._others, outside)
        try:
            yield here
        except OSError as error:  # the system knows a name in a folder, or none; the user needs the path
            if error.errno is not None and (here.handle is not None or error.filename is None):
                error.filename = str(here.path / (error.filename or ""))
            raise
        finally:
            if name:
                here.close()


def prepare_folder(path: Path, record: str, files: Iterable[str]) -> None:
    """Prepare a folder for files written elsewhere: remove those that its record lists, and list these instead."""
    with OwnFolder(path, mode=0o755, group=True) as own:
        own.remove_listed(record)
        own.write_record(record, {"files": sorted(files)})


def read_regular(path: Path, most: int) -> bytes:
    """The contents of a file as `OwnFolder.read` gives them, from any user's folder that is not a link."""
    here = _Opened(path.parent, None)
    try:
        return here.read(path.name, most)
    finally:
        here.close()


class _Opened:
    """A folder that is checked and opened, and what can be done with names in it.

    `others` are the permissions that it must not have; None: it may be of another user, too.
    """

    def __init__(self, path: Path, others: int | None, outside: "_Opened | None" = None) -> None:
        at = None if outside is None else outside.handle
        place = path if at is None else path.name
        self.path = path
        self.handle: int | None = None
        _check_folder(os.stat(place, dir_fd=at, follow_symlinks=False), path, others)
        if RELATIVE:
            self.handle = os.open(place, os.O_RDONLY | FOLDER, dir_fd=at)
            try:
                _check_folder(os.fstat(self.handle), path, others)
            except BaseException:
                self.close()
                raise

    def close(self) -> None:
        if self.handle is not None:
            os.close(self.handle)
            self.handle = None

    def _at(self, name: str) -> str:
        return str(self.path / name) if self.handle is None else name

    def names(self) -> list[str]:
        return os.listdir(self.path if self.handle is None else self.handle)

    def status(self, name: str) -> os.stat_result:
        return os.stat(self._at(name), dir_fd=self.handle, follow_symlinks=False)

    def check_regular(self, name: str, status: os.stat_result) -> None:
        if not stat.S_ISREG(status.st_mode):
            raise UnusableFileError(f"{self.path / name} is not a regular file: remove it")

    def open(self, name: str, mode: Literal["rb", "xb", "ab"]) -> BinaryIO:
        return open(self._at(name), mode, opener=partial(open_at_once, dir_fd=self.handle))

    def mkdir(self, name: str, mode: int) -> None:
        with suppress(FileExistsError):
            os.mkdir(self._at(name), mode, dir_fd=self.handle)

    def rmdir(self, name: str) -> None:
        os.rmdir(self._at(name), dir_fd=self.handle)

    def unlink(self, name: str) -> None:
        os.unlink(self._at(name), dir_fd=self.handle)

    def read(self, name: str, most: int) -> bytes:
        self.check_regular(name, self.status(name))  # a device may act as soon as it is opened
        with self.open(name, "rb") as file:
            status = os.fstat(file.fileno())
            self.check_regular(name, status)
            if status.st_size > most or len(data := file.read(status.st_size + 1)) > most:
                raise UnusableFileError(f"{self.path / name} has {status.st_size} bytes; at most {most} are read")
        return data

    def write(self, name: str, data: bytes, *, durable: bool) -> None:
        part, file = self._new(name)
        try:
            with file:
                file.write(data)
                file.flush()
                if durable:
                    os.fsync(file.fileno())
                if os.name == "nt":
                    file.close()  # Windows renames no open file
                os.replace(self._at(part), self._at(name), src_dir_fd=self.handle, dst_dir_fd=self.handle)
        except BaseException as error:
            with suppress(OSError):
                self.unlink(part)
            with suppress(FileNotFoundError):
                if isinstance(error, OSError) and stat.S_ISDIR(self.status(name).st_mode):
                    raise UnusableFileError(f"{self.path / name} is a folder: remove it") from None
            raise
        if durable and self.handle is not None:
            with suppress(OSError):  # not every system can do this to a folder
                os.fsync(self.handle)

    def _new(self, name: str) -> tuple[str, BinaryIO]:
        """A new file under one of its temporary names, locked until it is closed."""
        for part in _parts_of(name):
            self._remove_leftover(part)
            with suppress(FileExistsError):
                file = self.open(part, "xb")
                if self._is_locked(file, part):
                    return part, file
                file.close()
        raise UnusableFileError(f"{self.path / part} is not a file of this command: remove it")

    def _is_locked(self, file: BinaryIO, part: str) -> bool:
        """Lock a file; False if another process has the lock, or has renamed or removed the file before."""
        with suppress(FileNotFoundError):
            return try_lock(file) is not False and os.path.samestat(os.fstat(file.fileno()), self.status(part))
        return False

    def _remove_leftover(self, part: str) -> None:
        """Remove a temporary name unless another process writes the file, or it is a folder."""
        with suppress(OSError):
            if not stat.S_ISREG(self.status(part).st_mode):
                self.unlink(part)
                return
            with self.open(part, "ab") as file:
                if self._is_locked(file, part):
                    if os.name == "nt":
                        file.close()  # Windows removes no open file
                    self.unlink(part)

    def remove(self, name: str) -> None:
        for part in _parts_of(name):
            self._remove_leftover(part)
        self.unlink(name)


def _parts_of(name: str) -> list[str]:
    return [f".{name}.{number}.part" for number in range(TRIES)]


def _check_folder(status: os.stat_result, path: Path, others: int | None) -> None:
    if stat.S_ISLNK(status.st_mode):
        raise UsageError(f"{path} is a link, where a folder of yours must be: remove the link, or choose another name")
    if not stat.S_ISDIR(status.st_mode):
        raise UsageError(f"{path} is a file, where a folder of yours must be: remove it, or choose another name")
    if hasattr(os, "geteuid") and others is not None:
        if status.st_uid != os.geteuid():
            raise UsageError(f"{path} belongs to another user, who can change what is in it: choose another name")
        if status.st_mode & others:
            raise UsageError(
                f"others can write to {path}: remove it, or chmod go-w if all in it is yours, or choose another name"
            )


def _split(name: str) -> tuple[str, str]:
    """The folder of a name, and its last part; a name that leads elsewhere is refused."""
    if not _is_name(name):
        raise UnusableFileError(f"{name!r} is not the name of a file in a folder")
    folder, _, last = name.rpartition("/")
    return folder, last


def _is_name(value: object) -> bool:
    """Whether a name of a record leads to a place in its folder."""
    return (
        isinstance(value, str)
        and value.isprintable()
        and not set(value.split("/")) & {"", ".", ".."}
        and not (set(value) & set("\\:"))
    )


def _digest(fields: Mapping[str, Any]) -> str:
    return sha256(json.dumps(fields, sort_keys=True).encode()).hexdigest()
