"""Where compiled kernels are kept, told without importing the compiler."""

import os
from hashlib import sha256
from pathlib import Path
from typing import Final

PACKAGE: Final = Path(__file__).resolve().parent

WITHOUT_KERNELS: Final = ("cli", "report", "scenes", "testing")
"""Packages that nothing compiled comes from, so that an edit there costs no compilation."""


def kernel_folder() -> Path:
    """The folder of the kernels compiled from the present sources, which may not exist yet.

    Numba alone looks only at the file of the function that it loads, so after an edit of a kernel in another file, or
    an update, it would go on running what that kernel was. Here the folder's name changes with any of them.
    NUMBA_CACHE_DIR, when set, is left alone.
    """
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(chosen)
    return _base() / f"{_prefix()}{_digest(*_sources())}"


def stale_folders() -> list[Path]:
    """Folders of kernels that this installation had with other sources."""
    return [folder for folder in _base().glob(f"{_prefix()}*") if folder != kernel_folder()]


def _base() -> Path:
    cache = PACKAGE / "__pycache__"
    if os.access(cache if cache.is_dir() else PACKAGE, os.W_OK):
        return cache
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gsvc_ref"


def _prefix() -> str:
    """Installations that share a cache folder do not remove each other's kernels."""
    return f"kernels-{_digest(str(PACKAGE))}-"


def _sources() -> list[str]:
    """Path, size and time of each source that kernels, or constants in them, may come from."""
    paths = sorted(path.relative_to(PACKAGE) for path in PACKAGE.rglob("*.py"))
    stats = [(path, (PACKAGE / path).stat()) for path in paths if path.parts[0] not in WITHOUT_KERNELS]
    return [f"{path} {stat.st_size} {stat.st_mtime_ns}" for path, stat in stats]


def _digest(*parts: str) -> str:
    return sha256("\n".join(parts).encode()).hexdigest()[:12]
