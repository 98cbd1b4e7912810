"""``report``: the page, the summary, the badge and JUnit XML again, from the JSON of a run."""

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path

from gsvc_base.cli.text import show
from gsvc_base.errors import UsageError
from gsvc_conformance.commands import add_vectors, count
from gsvc_conformance.commands.outputs import add_files, check_outputs, write_files
from gsvc_conformance.process import read_output
from gsvc_conformance.report.console import describe, last_line
from gsvc_conformance.report.failures import NO_PICTURES
from gsvc_conformance.report.json import read
from gsvc_conformance.report.pictures import PictureBook
from gsvc_conformance.vector_folder import VectorFolder
from gsvc_conformance.verdicts import Report


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.epilog = "Pictures need the files that `run --keep DIR` left, and the vectors."
    parser.add_argument("result", type=Path, metavar="RESULT.json", help="what `run --json` wrote")
    add_files(parser)
    parser.add_argument("--keep", type=Path, metavar="DIR", help="where `run --keep` left the outputs of failures")
    parser.add_argument("--show", type=count, default=10, metavar="N", help="describe at most N failures (10)")
    add_vectors(parser)


def run(arguments: Namespace) -> int:
    """Write the files and show the report; the exit code of the run that it is about."""
    aside = check_outputs(arguments)
    report = read(arguments.result)
    drawn = arguments.keep and arguments.html
    pictures = _pictures(report, arguments.keep, arguments.vectors).pictures() if drawn else None
    _, refused = write_files(arguments, report, pictures)
    note = [f"note: {NO_PICTURES}"] if arguments.html and not drawn and report.faults else []
    show(*describe(report, arguments.show), *note, "", last_line(report), file=sys.stderr if aside else None)
    for fault in refused:
        raise fault
    return report.exit_code


def _pictures(report: Report, kept: Path, vectors: Path) -> PictureBook:
    """The pictures of the failures whose outputs were kept."""
    if not kept.is_dir():
        raise UsageError(f"there is no folder {kept}; `run --keep {kept}` makes it")
    results = {result.id: result for result in report.faults if (kept / result.id / "out").is_dir() and result.outputs}
    book = PictureBook()
    for vector in VectorFolder(vectors).read(list(results)):
        try:
            outputs = {port.name: read_output(kept / vector.id / "out", port) for port in vector.operation.outputs}
        except ValueError as error:
            raise UsageError(f"{kept / vector.id / 'out'}: {error}; keep the outputs again") from None
        book.add(vector, outputs, results[vector.id])
    return book
