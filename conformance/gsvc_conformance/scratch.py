"""Folders in which untrusted programs write: their size, and their removal, however deep they nest."""

import itertools
import os
import secrets
from contextlib import suppress
from pathlib import Path
from typing import Final

MAX_DEPTH: Final = 64
"""Folders inside each other; deeper ones count as too much."""
MIN_FILE: Final = 4096
"""Minimum number of bytes on the disk that a file counts as."""
PASSES: Final = 3
"""Number of times that a folder is emptied while files still appear in it."""


class TooMuchError(Exception):
    """A program fills the disk."""


def held_bytes(folder: Path, most: int) -> int:
    """The bytes on the disk of everything in a folder; counting ends above `most`.

    Raises
    ------
    TooMuchError
        Folders in it cannot be measured: they nest too deep, or may not be read.
    """
    held, folders = 0, [(str(folder), 0)]
    while folders and held <= most:
        place, depth = folders.pop()
        if depth > MAX_DEPTH:
            raise TooMuchError(f"it made more than {MAX_DEPTH} folders inside each other")
        try:
            with os.scandir(place) as entries:
                for entry in entries:
                    with suppress(FileNotFoundError):  # it may be removed at any time
                        status = entry.stat(follow_symlinks=False)
                        held += max(getattr(status, "st_blocks", 0) * 512, MIN_FILE)
                        if entry.is_dir(follow_symlinks=False):
                            folders.append((entry.path, depth + 1))
                    if held > most:
                        break
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError as error:
            raise TooMuchError(f"it made a folder that cannot be measured ({error.strerror})") from None
    return held


def remove(folder: Path) -> None:
    """Remove a folder and everything in it; links are not followed, and what cannot be removed stays.

    Nested folders are moved up first. So no path gets longer than the system allows, and there is no recursion as in
    `shutil.rmtree`.
    """
    mark, numbers = secrets.token_hex(8), itertools.count()
    if folder.is_symlink():
        return
    for _ in range(PASSES):
        folders = _emptied(str(folder))
        while folders:
            inner = folders.pop()
            for below in _emptied(inner):
                higher = f"{folder}{os.sep}{mark}-{next(numbers)}"
                with suppress(OSError):
                    os.chmod(below, 0o700)  # to be moved, it must be open
                    os.rename(below, higher)
                    folders.append(higher)
            with suppress(OSError):
                os.rmdir(inner)
        with suppress(OSError):
            os.rmdir(folder)
        if not os.path.lexists(folder):
            return


def _emptied(folder: str) -> list[str]:
    """Remove the files of a folder; the folders in it."""
    found = []
    with suppress(OSError):
        os.chmod(folder, 0o700)
        with os.scandir(folder) as entries:
            for entry in list(entries):
                with suppress(OSError):
                    if entry.is_dir(follow_symlinks=False):
                        found.append(entry.path)
                    else:
                        os.unlink(entry.path)
    return found
