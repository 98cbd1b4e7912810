"""The files of a report: each is written whole or reported missing; one that is standard output moves the text."""

import sys
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gsvc_conformance.results import Report
from gsvc_ref.errors import UsageError
from gsvc_ref.files import standard_stream, write_text

if TYPE_CHECKING:
    from gsvc_conformance.report.pictures import Picture


def check_writable(path: Path | None) -> None:
    """Refuse a file that cannot be written, before work is done for it.

    Raises
    ------
    UsageError
        It is a folder, or its folder does not exist.
    """
    if path is not None and (path.is_dir() or not path.parent.is_dir()):
        raise UsageError(f"{path} cannot be written: give a file name in a folder that exists")


def check_outputs(*paths: Path | None) -> bool:
    """Refuse outputs that cannot be written, before work is done; whether one goes to standard output.

    Raises
    ------
    UsageError
        One cannot, or two go to standard output.
    """
    for path in paths:
        check_writable(path)
    taken = [path for path in paths if path is not None and standard_stream(path) is sys.stdout]
    if len(taken) > 1:
        raise UsageError(f"both {taken[0]} and {taken[1]} go to standard output; give a file for one of them")
    return bool(taken)


def write_files(
    arguments: Namespace, report: Report, pictures: "Mapping[str, Sequence[Picture]]"
) -> tuple[list[str], list[OSError]]:
    """Write the files that were asked for; where each went, and what could not be written."""
    from gsvc_conformance.report.json import to_text
    from gsvc_conformance.report.junit import junit_xml
    from gsvc_conformance.report.page import report_html

    files: list[tuple[str, Path | None, Callable[[], str]]] = [
        ("JSON", arguments.json, lambda: to_text(report)),
        ("JUnit XML", arguments.junit, lambda: junit_xml(report)),
        ("page", arguments.html, lambda: report_html(report, pictures)),
    ]
    lines, refused = [], []
    for what, path, text in files:
        if path is not None:
            try:
                write_text(text(), path)
            except OSError as error:
                refused.append(error)
            else:
                lines.append(f"{what}: {path}")
    if arguments.keep and report.faults:
        lines.append(f"inputs, outputs and expectations of what is wrong: {arguments.keep}")
    return lines, refused
