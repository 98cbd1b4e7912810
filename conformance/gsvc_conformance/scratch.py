"""Folders in which programs of others write: how much is in them, and their removal, however deep they nest."""

import itertools
import os
import secrets
from contextlib import suppress
from pathlib import Path
from typing import Final

MAX_DEPTH: Final = 64
"""Folders inside each other; deeper ones count as too much."""
MIN_FILE: Final = 4096
"""Bytes on the disk that any file takes at least."""
PASSES: Final = 3
"""Number of times that a folder is emptied in which files still appear."""


class TooMuchError(Exception):
    """A program fills the disk."""


def held_bytes(folder: Path, most: int) -> int:
    """The bytes on the disk of all that stands in a folder; more than `most` are not counted to the end.

    Raises
    ------
    TooMuchError
        Folders in it cannot be measured: they nest too deep, or are closed.
    """
    held, folders = 0, [(str(folder), 0)]
    while folders and held <= most:
        place, depth = folders.pop()
        if depth > MAX_DEPTH:
            raise TooMuchError(f"it made more than {MAX_DEPTH} folders inside each other")
        try:
            with os.scandir(place) as entries:
                for entry in entries:
                    with suppress(FileNotFoundError):  # what is there may go at any time
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
    """Remove a folder and all that is in it; links are not followed, and what cannot be removed stays.

    Folders inside of its folders are moved up first. So no name gets longer than the system takes, and nothing here
    calls itself, as `shutil.rmtree` does.
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
