"""The files of the viewer: in a wheel inside of the package, in a checkout beside it."""

import re
from pathlib import Path
from typing import Final

from gsvc_base.errors import UsageError

PAGES_PACKAGE: Final = Path(__file__).parents[1]
ROOTS: Final = (PAGES_PACKAGE / "web", PAGES_PACKAGE.parent)
"""Folders that may hold ``viewer`` and, where its page looks for them, the scripts of the decoder."""
PAGE: Final = "viewer/index.html"
MEDIA_TYPES: Final = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
}


def viewer_files() -> dict[str, Path]:
    """The page and all that it loads: the path in an address, such as ``viewer/style.css``, and the file."""
    for root in ROOTS:
        page = root / PAGE
        if not page.is_file():
            continue
        loaded = re.findall(r'(?:src|href)="((?:\.\./)?[\w/-]+(?:\.\w+)+)"', page.read_text(encoding="utf-8"))
        paths = [PAGE, *(path.removeprefix("../") if path.startswith("../") else f"viewer/{path}" for path in loaded)]
        files = {path: root / path for path in paths}
        if all(file.is_file() for file in files.values()):
            return files
    raise UsageError("the files of the viewer are missing here: pip install --force-reinstall gsvc_ref")
