"""What tells two copies of gsvc_ref apart: one may go on with what the other has encoded only if they are equal."""

from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Final

import gsvc_base
from gsvc_ref import __version__

SOURCES: Final = Path(__file__).resolve().parent
BASE: Final = Path(gsvc_base.__file__).resolve().parent

BESIDE_ENCODING: Final = ("cli", "exact", "pages", "testing")
"""Folders of gsvc_ref and gsvc_base that no encode depends on."""


@cache
def code_version() -> str:
    """The version with a digest of all sources that count, since those of a checkout change under the same number."""
    digest = sha256()
    for package in (SOURCES, BASE):
        for path in sorted(package.rglob("*.py")):
            inside = path.relative_to(package)
            if inside.parts[0] not in BESIDE_ENCODING:
                digest.update(inside.as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return f"{__version__} {digest.hexdigest()[:12]}"
