"""``compare``: what passed in one report and not in a later one, or several reports beside each other in tables."""

import os
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from gsvc_base.cli.text import show
from gsvc_base.errors import UsageError
from gsvc_base.pages.markers import put_between
from gsvc_conformance.commands import count
from gsvc_conformance.report.comparison import Entry, comparison, read_speeds
from gsvc_conformance.report.json import read
from gsvc_conformance.report.regressions import changes, conclusion_of, describe_changes
from gsvc_conformance.verdicts import Report

BEGIN: Final = "<!-- begin: gsvc-conformance compare -->"
END: Final = "<!-- end -->"
SHOWN: Final = 10


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.epilog = (
        "Of two reports, the first is the earlier one: what passed there and does not pass in the second is named "
        "(exit code 1). With --tables, --markdown, --speeds or another number of reports, they are shown beside each "
        "other, an operation a row (exit code 0: another implementation is not a regression). "
        "In tables, a column is named as its file. The cell of an operation says how many of its vectors pass, what "
        "became of the others, and in parentheses the worst error as a multiple of its bound, in core vectors and, if "
        "that is another, in all. Links lead to the files, and to RESULT.html if that stands beside RESULT.json."
    )
    parser.add_argument("results", type=Path, nargs="+", metavar="RESULT.json", help="what `run --json` wrote")
    parser.add_argument("--show", type=count, default=SHOWN, metavar="N", help=f"describe N regressions ({SHOWN})")
    parser.add_argument("--quiet", action="store_true", help="name regressions only")
    parser.add_argument("--tables", action="store_true", help="show two reports in tables, too, as more than two")
    parser.add_argument(
        "--speeds",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="what `python -m gsvc_lab.benchmarks.adapters` wrote, or was measured on a GPU; may be repeated",
    )
    parser.add_argument(
        "--markdown",
        type=Path,
        metavar="FILE",
        help="put the tables between the markers of this file, do not print them",
    )


def run(arguments: Namespace) -> int:
    """Name what regressed, 1 if anything did; or show the tables, and 0 whatever they say."""
    if len(arguments.results) == 2 and not (arguments.tables or arguments.markdown or arguments.speeds):
        return _regressions(read(arguments.results[0]), read(arguments.results[1]), arguments)
    home = arguments.markdown.parent if arguments.markdown else Path()
    speeds = [read_speeds(path) for path in arguments.speeds]
    text = comparison(entries(arguments.results, home), speeds)
    if arguments.markdown:
        put_between(arguments.markdown, BEGIN, END, text)
    else:
        show(text)
    return 0


def _regressions(base: Report, now: Report, arguments: Namespace) -> int:
    """Name what regressed; 1 if anything did, 2 if the later report is not whole."""
    found = changes(base, now)
    if arguments.quiet:
        lines = [result.id for result in found.regressions]
    else:
        lines = describe_changes(base, now, found, arguments.show)
    show(*lines, *[""] * bool(lines and not arguments.quiet), conclusion_of(found))
    return 1 if found.regressions else 2 if now.ended else 0


def entries(paths: Sequence[Path], home: Path) -> list[Entry]:
    """The reports; links to them begin in the folder `home`."""
    names = [path.stem for path in paths]
    if twice := {name for name in names if names.count(name) > 1}:
        raise UsageError(f"two reports are called {', '.join(sorted(twice))}; columns are named as their files")
    return [Entry(path.stem, read(path), _links(path, home)) for path in paths]


def _links(path: Path, home: Path) -> dict[str, str]:
    files = {"page": path.with_suffix(".html"), "JSON": path}
    return {text: Path(os.path.relpath(file, home)).as_posix() for text, file in files.items() if file.is_file()}
