"""The page that ``gsvc encode --report`` writes, by the package that makes pages."""

import shlex
import sys
from argparse import Namespace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol, cast

from gsvc_base.cli.errors import EXIT_INTERRUPTED, say
from gsvc_base.errors import UsageError
from gsvc_ref.cli.files import STDIO, check_output

if TYPE_CHECKING:
    from gsvc_ref.encoder import EncodeReport


class PageWriter(Protocol):
    """Writes a page about an encode."""

    def __call__(
        self,
        file: str,
        source: str | None,
        start: int,
        page: str,
        encoded: "EncodeReport",
        command: str,
        *,
        quiet: bool,
        background: tuple[int, int, int] | None,
    ) -> None:
        """Write `page` about `file`, whose frame 0 is frame `start` of the source (None: it cannot be read again).

        What is transparent in the source is shown on the background.
        """


_page_writers: Final[list[str]] = []


def set_page_writer(module: str) -> None:
    """Let ``gsvc encode --report`` write its page by the function ``after_encode`` of a module."""
    _page_writers.append(module)


def page_writer() -> PageWriter | None:
    """The function of the module that was given to `set_page_writer` last, or None."""
    return cast("PageWriter", import_module(_page_writers[-1]).after_encode) if _page_writers else None


def check_page(arguments: Namespace) -> None:
    """Refuse ``--report`` where its page could not be written, before work is done for it."""
    page = arguments.report
    if page is None:
        return
    if arguments.output == STDIO:
        raise UsageError("--report reads the file that was written, and there is none: give OUT.gsvc a name")
    if Path(page).suffix.lower() not in (".html", ".htm"):
        raise UsageError(f"--report {page} is not the name of a page; it ends in .html, such as --report page.html")
    check_output(page, arguments.input)
    if page_writer() is None:
        raise UsageError("--report needs gsvc_lab, which makes the page and comes with gsvc_ref: pip install .")


def without_page(arguments: Namespace) -> str:
    """The end of a sentence on an encode that ended early, if a page was asked for."""
    return "" if arguments.report is None else f"; {arguments.report} was not written, gsvc report makes it"


def write_page(arguments: Namespace, report: "EncodeReport") -> int:
    """Write the page, if one is asked for; 0, or 130 when that was interrupted."""
    write = page_writer() if arguments.report is not None else None
    if write is None:
        return 0
    start = arguments.frames[0] if arguments.frames is not None else 0
    command = shlex.join(["gsvc", *sys.argv[1:]]) if sys.argv[1:2] == ["encode"] else ""
    quiet = arguments.quiet or arguments.json
    is_readable = arguments.input != STDIO and getattr(arguments, "fps", None) is None  # --fps changes the numbers
    source = arguments.input if is_readable else None
    try:
        write(
            arguments.output, source, start, arguments.report, report, command, quiet=quiet,
            background=arguments.background,
        )  # fmt: skip
    except KeyboardInterrupt:
        say("gsvc encode", f"interrupted; {arguments.output} is complete{without_page(arguments)}")
        return EXIT_INTERRUPTED
    return 0
