"""``compare``: several reports beside each other."""

import os
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from gsvc_conformance.report.comparison import Entry, comparison, read_speeds
from gsvc_conformance.report.json import read
from gsvc_lab.pages.markers import put_between
from gsvc_ref.cli.text import show
from gsvc_ref.errors import UsageError

BEGIN: Final = "<!-- begin: gsvc-conformance compare -->"
END: Final = "<!-- end -->"


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.epilog = (
        "A column is named as its file. The cell of an operation says how many of its vectors pass, what became of the "
        "others, and in parentheses the worst error as a multiple of its bound, in core vectors and, if that is "
        "another, in all. Links lead to the files, and to RESULT.html if that stands beside RESULT.json."
    )
    parser.add_argument("results", type=Path, nargs="+", metavar="RESULT.json", help="what `run --json` wrote")
    parser.add_argument(
        "--speeds", type=Path, metavar="FILE", help="what `python -m gsvc_lab.benchmarks.adapters` wrote"
    )
    parser.add_argument(
        "--markdown",
        type=Path,
        metavar="FILE",
        help="put the tables between the markers of this file, do not print them",
    )


def run(arguments: Namespace) -> int:
    """Show the tables or put them into the file; 0, whatever the reports say."""
    home = arguments.markdown.parent if arguments.markdown else Path()
    speeds = read_speeds(arguments.speeds) if arguments.speeds else None
    text = comparison(entries(arguments.results, home), speeds)
    if arguments.markdown:
        put_between(arguments.markdown, BEGIN, END, text)
    else:
        show(text)
    return 0


def entries(paths: Sequence[Path], home: Path) -> list[Entry]:
    """The reports; links to them begin in the folder `home`."""
    names = [path.stem for path in paths]
    if twice := {name for name in names if names.count(name) > 1}:
        raise UsageError(f"two reports are called {', '.join(sorted(twice))}; columns are named as their files")
    return [Entry(path.stem, read(path), _links(path, home)) for path in paths]


def _links(path: Path, home: Path) -> dict[str, str]:
    files = {"page": path.with_suffix(".html"), "JSON": path}
    return {text: Path(os.path.relpath(file, home)).as_posix() for text, file in files.items() if file.is_file()}
