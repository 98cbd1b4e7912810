"""The files of a report: each is written whole or reported missing; one that is standard output moves the text."""

import os
import sys
from argparse import Namespace
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol

from gsvc_base.errors import UsageError
from gsvc_base.files import standard_stream, write_text
from gsvc_conformance.verdicts import Report

if TYPE_CHECKING:
    from gsvc_conformance.report.pictures import View

STEP_SUMMARY: Final = "GITHUB_STEP_SUMMARY"
"""The variable by which GitHub Actions names the file for summaries, to which each command of a step appends."""
KINDS: Final = ("json", "junit", "html", "markdown", "badge")
"""The options that name files of a report."""


class _Options(Protocol):
    """What takes options: a parser, or a group of one."""

    def add_argument(self, *names: str, **settings: Any) -> Any:
        """Add an option."""
        ...


def add_files(parser: _Options) -> None:
    """The options of files that `run` and `report` write."""
    helps = {
        "junit": "write JUnit XML",
        "html": "write a page with a filter, and with pictures and tables of failures",
        "markdown": f"write a summary in Markdown; it is appended to the file that {STEP_SUMMARY} names",
        "badge": "write a badge: JSON for an endpoint of shields.io",
    }
    for kind, sentence in helps.items():
        parser.add_argument(f"--{kind}", type=Path, metavar="FILE", help=sentence)


def check_writable(path: Path | None) -> None:
    """Refuse a file that cannot be written, before work is done for it.

    Raises
    ------
    UsageError
        It is a folder, or its folder does not exist.
    """
    if path is not None and (path.is_dir() or not path.parent.is_dir()):
        raise UsageError(f"{path} cannot be written: give a file name in a folder that exists")


def check_outputs(arguments: Namespace) -> bool:
    """Refuse files of a report that cannot be written, before work is done; whether one goes to standard output.

    Raises
    ------
    UsageError
        One cannot, or two go to standard output.
    """
    paths = [path for kind in KINDS if (path := getattr(arguments, kind, None)) is not None]
    for path in paths:
        check_writable(path)
    taken = [path for path in paths if standard_stream(path) is sys.stdout]
    if len(taken) > 1:
        raise UsageError(f"both {taken[0]} and {taken[1]} go to standard output; give a file for one of them")
    return bool(taken)


def write_files(
    arguments: Namespace, report: Report, pictures: "Mapping[str, View] | None"
) -> tuple[list[str], list[Exception]]:
    """Write the files that were asked for; where each went, and what could not be written."""
    from gsvc_conformance.report.badge import badge_json
    from gsvc_conformance.report.json import to_text
    from gsvc_conformance.report.junit import junit_xml
    from gsvc_conformance.report.markdown import summary_markdown
    from gsvc_conformance.report.page import report_html

    texts: dict[str, tuple[str, Callable[[], str]]] = {
        "json": ("JSON", lambda: to_text(report)),
        "junit": ("JUnit XML", lambda: junit_xml(report)),
        "html": ("page", lambda: report_html(report, pictures)),
        "markdown": ("Markdown", lambda: summary_markdown(report)),
        "badge": ("badge", lambda: badge_json(report)),
    }
    lines: list[str] = []
    refused: list[Exception] = []
    for kind, (what, text) in texts.items():
        if (path := getattr(arguments, kind, None)) is not None:
            try:
                _write(text(), path)
            except Exception as error:  # the other files are written all the same
                refused.append(error)
            else:
                lines.append(f"{what}: {path}")
    if arguments.keep and report.faults:
        lines.append(f"inputs, outputs and expectations of what is wrong: {arguments.keep}")
    return lines, refused


def _write(text: str, path: Path) -> None:
    """Write a file, or append to the one in which GitHub Actions collects summaries."""
    summary = os.environ.get(STEP_SUMMARY)
    if summary and path.is_file() and path.samefile(summary):
        with path.open("a", encoding="utf-8", errors="backslashreplace") as file:
            file.write(text)
    else:
        write_text(text, path)
