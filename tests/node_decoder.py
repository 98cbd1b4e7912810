"""The decoder in JavaScript, that of the viewer, run by Node: for what is counted or measured without a browser."""

import re
import shutil
import subprocess
from pathlib import Path
from typing import Final

from gsvc_conformance import adapters

PAGE: Final = Path(adapters.__file__).with_name("web") / "operations.html"
"""The page, by its place: importing the adapter needs Playwright, which nothing here does."""
LAST: Final = "opened.js"
"""The scripts after it are about rendering and judging, or need a page."""


def missing() -> str:
    """Why nothing can be run; '' if it can."""
    return "" if shutil.which("node") else "there is no node"


def run(code: str, *paths: Path, behind: tuple[str, str] = ("", "")) -> str:
    """What some code prints after the scripts of the decoder; `paths` are its arguments, from process.argv[2] on.

    `behind` is the name of a script and other code that comes directly after it.
    """
    text = PAGE.read_text(encoding="utf-8")
    names = re.findall(r'src="([\w.]+)"', text)
    parts = []
    for name in names[: names.index(LAST) + 1]:
        parts += [PAGE.with_name(name).read_text(encoding="utf-8"), behind[1] if name == behind[0] else ""]
    command = ["node", "-", *map(str, paths)]
    done = subprocess.run(command, input="\n".join([*parts, code]), capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return done.stdout
