"""Untrusted files: each is measured before it is read, and no nesting of its contents overflows the stack.

Everything that the kit reads goes through here: vectors, waivers, features, reports, and what implementations write.
"""

import io
import json
import math
import os
import re
import stat
import tomllib
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.errors import UsageError

MAX_BYTES: Final = 1 << 28
"""Bytes of a file, and of all files and arrays of a vector together; of the kit's own vectors the largest has 2^26."""
MAX_TEXT: Final = 1 << 25
"""Bytes of a text that is parsed, which takes some twenty times as much memory: a report, waivers, a manifest."""
MAX_ARCHIVE: Final = 1 << 32
"""Bytes of all files of an archive together."""
MAX_DOTS: Final = 32
"""Parts of a dotted key of TOML; the time that tomllib takes for one grows with the square of their number."""
MAX_DIMENSIONS: Final = 64
"""Dimensions of an array, as in NumPy; the product of many long numbers would take hours."""
MAX_STREAM: Final = 1 << 32
"""Bytes of a stream that is checked."""
METHODS: Final = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Methods of compression that need the same memory for every file."""

_QUIET: Final = re.compile(
    r'"""(?:[^\\"]++|\\.|"(?!""))*+(?:"{3,5}|\\?\Z)'
    r"|'''(?:[^']++|'(?!''))*+(?:'{3,5}|\Z)"
    r'|"(?:[^"\\\n]++|\\.)*+"?'
    r"|'[^'\n]*+'?|#[^\n]*+",
    re.DOTALL,
)
"""Strings and comments of TOML, also a string without its end: a search from each of its quotes would be quadratic."""
_DOTTED: Final = re.compile(rf"(?:\.[^.,=\[\]{{}}\n]*){{{MAX_DOTS}}}")
_HEADERS: Final = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}


def read_bytes(path: Path, most: int = MAX_BYTES) -> bytes:
    """The bytes of an ordinary file; anything else is refused, and a pipe without waiting for its writer.

    Raises
    ------
    OSError
        It cannot be read.
    UsageError
        It is not an ordinary file, or has more than `most` bytes.
    """
    with open(path, "rb", opener=_at_once) as file:
        status = os.fstat(file.fileno())
        _check_ordinary(path, status)
        check_size(str(path), status.st_size, most)
        return file.read(status.st_size)


def read_pipe(file: BinaryIO, most: int) -> bytes:
    """All bytes of standard input.

    Raises
    ------
    UsageError
        They are more than `most`.
    """
    parts: list[bytes] = []
    size = 0
    while data := file.read(1 << 20):
        parts.append(data)
        size += len(data)
        check_size("standard input", size, most)
    return b"".join(parts)


def read_text(path: Path) -> str:
    """The text of an ordinary file in UTF-8.

    Raises
    ------
    OSError, UsageError
        As `read_bytes`, of at most `MAX_TEXT` bytes.
    UnicodeDecodeError
        It is not UTF-8.
    """
    return read_bytes(path, MAX_TEXT).decode("utf-8-sig")


def _check_ordinary(path: Path, status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise UsageError(f"{path} is not an ordinary file; write its contents to one and give that")


def _at_once(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def check_size(name: str, size: int, most: int = MAX_BYTES) -> None:
    """Refuse what is too large to be read.

    Raises
    ------
    UsageError
        It has more than `most` bytes.
    """
    if size > most:
        raise UsageError(f"{name} has {size:,} bytes; at most {most:,} are read")


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file.

    Raises
    ------
    OSError
        It cannot be read.
    UsageError
        It is not TOML, is too large, or is nested too deep.
    """
    try:
        text = read_text(path)
        if _DOTTED.search(_QUIET.sub("", text)):
            raise UsageError(f"a key has more than {MAX_DOTS} parts")
        return tomllib.loads(text)
    except RecursionError:
        raise UsageError(f"{path} cannot be read as TOML: it is nested too deep; a list in a table is enough") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, ValueError) as error:
        raise _unless_named(error, path, "TOML") from None


def read_json(path: Path) -> Any:
    """The value of a JSON file.

    Raises
    ------
    OSError
        It cannot be read.
    UsageError
        It is not JSON, is too large, or is nested too deep.
    """
    try:
        return parse_json(read_bytes(path, MAX_TEXT))
    except ValueError as error:
        raise _unless_named(error, path, "JSON") from None


def parse_json(data: bytes) -> Any:
    """The value of a text in JSON.

    Raises
    ------
    UsageError
        It has more than `MAX_TEXT` bytes or is nested too deep.
    ValueError
        It is not JSON.
    """
    check_size("the text", len(data), MAX_TEXT)
    try:
        return json.loads(data)
    except RecursionError:
        raise UsageError("it is nested too deep") from None


def _unless_named(error: ValueError, path: Path, form: str) -> UsageError:
    """An error of a file whose message names the file."""
    if isinstance(error, UsageError) and str(path) in str(error):
        return error
    return UsageError(f"{path} cannot be read as {form}: {error}")


def parse_npy(data: bytes, name: str, *, foreign: bool = False) -> NDArray[Any]:
    """The array of an .npy file of numbers, in the byte order of the machine and in C order.

    A `foreign` file may also hold truth values, or numbers whose most significant byte comes first.

    Raises
    ------
    UsageError
        It is not such a file; the message begins with its name.
    """
    file = io.BytesIO(data)
    try:
        shape, column_order, dtype = _HEADERS[np.lib.format.read_magic(file)](file)
    except Exception as error:  # a hostile header may raise anything in Python's parser
        raise UsageError(f"{name} is not an .npy file of version 1 or 2 ({type(error).__name__})") from None
    if dtype.kind not in ("uifb" if foreign else "uif"):
        raise UsageError(f"{name} has elements of type {dtype}; they must be integers or floating-point numbers")
    size = len(data) - file.tell()
    if size != dtype.itemsize * elements_of(shape):
        raise UsageError(f"{name} has {size} bytes of data, which do not fit its type {dtype} and shape {shape}")
    if dtype.str.startswith(">") and not foreign:
        raise UsageError(f"{name} has numbers of type {dtype.str}, most significant byte first; write it last")
    flat = np.frombuffer(data, dtype, offset=file.tell())
    try:
        return np.array(native(flat.reshape(shape, order="F" if column_order else "C")), order="C")
    except (ValueError, OverflowError):  # an empty array with a length beyond any address
        raise UsageError(f"{name} has the shape {shape}, which is too large for an array") from None


def native(array: NDArray[Any]) -> NDArray[Any]:
    """An array in the byte order of the machine."""
    return array.astype(array.dtype.newbyteorder("="), copy=False)


def elements_of(shape: Any) -> int:
    """Number of elements of a shape; -1, which no file fits, for a value that is not a shape, such as (True,)."""
    if not isinstance(shape, list | tuple) or len(shape) > MAX_DIMENSIONS:
        return -1
    if any(type(length) is not int or length < 0 for length in shape):
        return -1
    return math.prod(shape)


class Folder(Mapping[str, bytes]):
    """The files of a folder of vectors by their relative names, read when they are asked for."""

    DEPTH: Final = 3
    """Folders around a file: ``<tier>/<operation>/<slug>``."""

    def __init__(self, home: Path) -> None:
        self._home = home

    def __getitem__(self, name: str) -> bytes:
        try:
            return read_bytes(self._home / name)
        except (FileNotFoundError, NotADirectoryError):
            raise KeyError(name) from None

    def size(self, name: str) -> int:
        """The bytes of a file.

        Raises
        ------
        KeyError
            There is no such file.
        """
        try:
            return (self._home / name).stat().st_size
        except (FileNotFoundError, NotADirectoryError):
            raise KeyError(name) from None

    def __iter__(self) -> Iterator[str]:
        below = [""]
        while below:
            folder = below.pop()
            with suppress(FileNotFoundError, NotADirectoryError), os.scandir(self._home / folder) as entries:
                for entry in entries:
                    name = f"{folder}{entry.name}"
                    if not entry.is_dir(follow_symlinks=False):
                        yield name
                    elif name.count("/") < self.DEPTH:
                        below.append(f"{name}/")

    def __len__(self) -> int:
        return sum(1 for _ in self)


class Archive(Mapping[str, bytes]):
    """The files of a zip by their names, read when they are asked for.

    Raises
    ------
    UsageError
        It is not a zip archive, or its files are too large together.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        status = path.stat()
        _check_ordinary(path, status)
        check_size(str(path), status.st_size)
        try:
            self._zip = zipfile.ZipFile(path)
        except OSError:
            raise
        except Exception as error:  # a damaged archive may raise anything
            raise UsageError(f"{path} is neither a folder of vectors nor an archive (zip) of one ({error})") from None
        check_size(f"all of {path} together", sum(entry.file_size for entry in self._zip.infolist()), MAX_ARCHIVE)

    def __getitem__(self, name: str) -> bytes:
        entry = self._zip.getinfo(name)
        check_size(f"{name} of {self._path}", entry.file_size)
        if entry.compress_type not in METHODS:
            raise UsageError(f"{name} of {self._path} is compressed by another method than deflate: pack it again")
        try:
            with self._zip.open(entry) as file:
                return file.read(entry.file_size)
        except Exception as error:  # as above
            raise UsageError(f"{name} of {self._path} cannot be read ({error}): pack it again") from None

    def size(self, name: str) -> int:
        """The bytes of a file.

        Raises
        ------
        KeyError
            There is no such file.
        """
        return self._zip.getinfo(name).file_size

    def __iter__(self) -> Iterator[str]:
        return iter(self._zip.namelist())

    def __len__(self) -> int:
        return len(self._zip.namelist())
