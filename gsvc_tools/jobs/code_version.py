"""What tells two copies of gsvc_ref apart: one may go on with what the other has encoded only if they are equal."""

from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Final

import gsvc_base
import gsvc_ref
import gsvc_tools

PACKAGES: Final = tuple(Path(str(package.__file__)).resolve().parent for package in (gsvc_base, gsvc_ref, gsvc_tools))

NOT_OF_ENCODING: Final = ("cli", "editing", "exact", "pages", "splat_files", "testing", "viewing")
"""Folders of these packages that no encode depends on."""


@cache
def code_version() -> str:
    """The version with a digest of all sources that count, since those of a checkout change under the same number."""
    digest = sha256()
    for package in PACKAGES:
        for path in sorted(package.rglob("*.py")):
            inside = path.relative_to(package)
            if inside.parts[0] not in NOT_OF_ENCODING:
                digest.update(inside.as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return f"{gsvc_ref.__version__} {digest.hexdigest()[:12]}"
