"""A page that redirects a browser to the viewer, so that no command line, which every user can read, has the token."""

import os
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

PAGE: Final = """<!doctype html>
<meta charset="utf-8">
<meta http-equiv="refresh" content="0; url={url}">
<title>GSVC viewer</title>
<p><a href="{url}">Open the viewer</a></p>
"""


class RedirectPage:
    """A file that only its owner can read, in a new folder; it exists from `write` to `close`."""

    def __init__(self) -> None:
        self._folder: TemporaryDirectory[str] | None = None

    def write(self, url: str) -> Path:
        """Write the page that redirects to an address, or raise the OSError that prevents it."""
        self._folder = TemporaryDirectory(prefix="gsvc-view-", dir=_parent(), ignore_cleanup_errors=True)  # mode 0700
        path = Path(self._folder.name) / "open.html"
        with open(path, "x", encoding="utf-8", opener=lambda name, flags: os.open(name, flags, 0o600)) as file:
            file.write(PAGE.format(url=url))
        return path

    def is_open(self) -> bool:
        """Whether the page exists."""
        return self._folder is not None

    def close(self) -> None:
        """Remove the page; harmless if it does not exist."""
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None


def _parent() -> str | None:
    """The home folder if the user has snaps, whose browsers cannot read /tmp; None: the folder for temporary files."""
    home = os.path.expanduser("~")
    return home if os.path.isdir(os.path.join(home, "snap")) else None
