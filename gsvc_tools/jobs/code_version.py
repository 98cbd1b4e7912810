"""What tells two copies of gsvc_ref apart: one may go on with what the other has encoded only if they are equal."""

from functools import cache
from pathlib import Path
from typing import Final

import gsvc_base
import gsvc_ref
import gsvc_tools
from gsvc_base.sources import digest, digests

PACKAGES: Final = tuple(Path(str(package.__file__)).resolve() for package in (gsvc_base, gsvc_ref, gsvc_tools))

NOT_OF_ENCODING: Final = ("cli", "editing", "exact", "pages", "splat_files", "testing", "viewing")
"""Folders of these packages that no encode depends on."""


@cache
def code_version() -> str:
    """The version with a digest of all sources that count, since those of a checkout change under the same number."""
    sources = (source for package in PACKAGES for source in digests(package, NOT_OF_ENCODING))
    return f"{gsvc_ref.__version__} {digest(*sources)}"
