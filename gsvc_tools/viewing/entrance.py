"""The way of a browser to the page: a file that its owner alone can read, as command lines are there for everybody."""

import os
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

ENTRANCE: Final = """<!doctype html>
<meta charset="utf-8">
<meta http-equiv="refresh" content="0; url={url}">
<title>GSVC viewer</title>
<p><a href="{url}">to the viewer</a></p>
"""


class Entrance:
    """A page in a new folder, both for their owner alone, which is there from `lead_to` to `close`."""

    def __init__(self) -> None:
        self._folder: TemporaryDirectory[str] | None = None

    def lead_to(self, url: str) -> Path:
        """Write the page that leads to an address; an OSError says that this cannot be done."""
        self._folder = TemporaryDirectory(prefix="gsvc-view-", dir=_place(), ignore_cleanup_errors=True)  # mode 0700
        path = Path(self._folder.name) / "open.html"
        with open(path, "x", encoding="utf-8", opener=lambda name, flags: os.open(name, flags, 0o600)) as file:
            file.write(ENTRANCE.format(url=url))
        return path

    def is_open(self) -> bool:
        """Whether it is there."""
        return self._folder is not None

    def close(self) -> None:
        """Remove it, if it is there."""
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None


def _place() -> str | None:
    """The home folder of whoever uses snaps, as browsers in them see no temporary folder; None: the usual one."""
    home = os.path.expanduser("~")
    return home if os.path.isdir(os.path.join(home, "snap")) else None
