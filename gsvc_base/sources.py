"""Digests of source files, which distinguish the results of one version from those of another."""

import os
from collections.abc import Collection, Iterator
from glob import glob
from hashlib import sha256
from pathlib import Path


def digests(main: Path, left_out: Collection[str] = ()) -> Iterator[str]:
    """Name and SHA-256 of a module, or of each module of a package, given its ``__init__.py``, but for some folders."""
    names = sorted(glob("**/*.py", root_dir=main.parent, recursive=True)) if main.name == "__init__.py" else [main.name]
    for name in names:
        if name.split(os.sep)[0] not in left_out:
            yield f"{name.replace(os.sep, '/')} {sha256((main.parent / name).read_bytes()).hexdigest()}"


def digest(*parts: str) -> str:
    """A short SHA-256 of texts."""
    return sha256("\n".join(parts).encode()).hexdigest()[:12]
