"""Where compiled kernels are kept, told without importing the compiler."""

import os
import stat
from hashlib import sha256
from pathlib import Path
from typing import Final

PACKAGE: Final = Path(__file__).resolve().parent

WITHOUT_KERNELS: Final = ("cli", "report", "scenes", "testing")
"""Packages that nothing compiled comes from, so that an edit there costs no compilation."""


ADVICE: Final = "set NUMBA_CACHE_DIR to a folder that only you can write to"


def kernel_folder() -> Path | None:
    """The folder of the kernels compiled from the present sources, which may not exist yet; None if there is no place.

    Numba alone looks only at the file of the function that it loads, so after an edit of a kernel in another file, or
    an update, it would go on running what that kernel was. Here the folder's name changes with any of them.
    NUMBA_CACHE_DIR, when set to a folder that can be used, is left alone.
    """
    chosen = chosen_folder()
    if chosen is not None and _can_be_used(chosen):
        return chosen
    base = _base()
    return base and base / f"{_prefix()}{_digest(*_sources())}"


def chosen_folder() -> Path | None:
    """What NUMBA_CACHE_DIR names, whether it can be used or not."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    return Path(chosen) if chosen else None


def _can_be_used(folder: Path) -> bool:
    """Whether kernels can be kept in a folder, which is made, or some are there, as in an image of a container."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return os.access(folder, os.W_OK) or any(folder.iterdir())
    except OSError:
        return False


def stale_folders() -> list[Path]:
    """Folders of kernels that this installation had with other sources; none where NUMBA_CACHE_DIR names one."""
    base, present = _base(), kernel_folder()
    if base is None or present is None or present.parent != base:
        return []
    return [folder for folder in base.glob(f"{_prefix()}*") if folder != present]


def _base() -> Path | None:
    """Beside the sources, or in the user's cache: kernels from there are run, so it must be as safe as the sources."""
    beside = PACKAGE / "__pycache__"
    place = beside if beside.is_dir() else PACKAGE
    if os.access(place, os.W_OK) and not place.stat().st_mode & stat.S_IWOTH:
        return beside
    try:
        folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gsvc_ref"
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        return folder if _is_private(folder) else None
    except (OSError, RuntimeError):  # there is no home
        return None


def _is_private(folder: Path) -> bool:
    """Whether nobody else can put files into a folder, as far as the system tells: not if another user made it."""
    found = folder.lstat()
    if not hasattr(os, "geteuid"):
        return True
    others = stat.S_IWGRP | stat.S_IWOTH
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.geteuid() and not found.st_mode & others


def _prefix() -> str:
    """Installations that share a cache folder do not remove each other's kernels."""
    return f"kernels-{_digest(str(PACKAGE))}-"


def _sources() -> list[str]:
    """Path, size and time of each source that kernels, or constants in them, may come from."""
    paths = sorted(path.relative_to(PACKAGE) for path in PACKAGE.rglob("*.py"))
    stats = [(path, (PACKAGE / path).stat()) for path in paths if path.parts[0] not in WITHOUT_KERNELS]
    return [f"{path} {found.st_size} {found.st_mtime_ns}" for path, found in stats]


def _digest(*parts: str) -> str:
    return sha256("\n".join(parts).encode()).hexdigest()[:12]
