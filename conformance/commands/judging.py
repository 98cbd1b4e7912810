"""Judging as the options say, and all that is written of it: what the commands ``run`` and ``spec`` share."""

import datetime
import json
import platform
import shlex
from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

import gsvc_ref
from conformance.commands import add_selection, add_vectors, check_writable, selection
from conformance.expectations import Refusal
from conformance.implementations import Implementation
from conformance.process import write_inputs
from conformance.report.console import describe, progress_text
from conformance.results import FAULTS, Report, Result
from conformance.runner import Judged, run_suite
from conformance.selection import VectorFolder, matches
from conformance.stage import Values
from conformance.vectors import SPEC_VERSION, VECTORS, Vector, set_hash
from gsvc_ref.cli.arguments import whole
from gsvc_ref.cli.progress import ProgressDisplay
from gsvc_ref.errors import UsageError

if TYPE_CHECKING:
    from conformance.report.pictures import Picture

SHOWN: Final = 10
DIAGNOSED: Final = 4
"""Failures of a stage whose cause is looked for: every plausible bug is tried, which takes its time."""


def add_judging(parser: ArgumentParser) -> None:
    """The options that do not say what is judged."""
    add_vectors(parser)
    add_selection(parser)
    parser.add_argument("--skip", action="append", default=[], metavar="GLOB", help="do not run these vectors")
    parser.add_argument("--waivers", type=Path, metavar="FILE", help='a JSON file {"id": "reason"} of known failures')
    parser.add_argument("--no-diagnosis", action="store_true", help="do not look for the probable cause of failures")
    outputs = parser.add_argument_group("output")
    outputs.add_argument(
        "--show", type=whole, default=SHOWN, metavar="N", help=f"describe at most N failures ({SHOWN})"
    )
    outputs.add_argument("--json", type=Path, metavar="FILE", help="write everything as JSON")
    outputs.add_argument("--junit", type=Path, metavar="FILE", help="write JUnit XML")
    outputs.add_argument("--html", type=Path, metavar="FILE", help="write a page with pictures of the worst failures")
    outputs.add_argument("--keep", type=Path, metavar="DIR", help="keep inputs and outputs of what is wrong")
    outputs.add_argument("--quiet", action="store_true", help="show no progress")


def judge(arguments: Namespace, implementation: Implementation, command: list[str]) -> int:
    """Judge an implementation as the options say, and report; 0 if a class passed and none failed, else 1.

    Parameters
    ----------
    arguments
        Those of `add_judging`.
    implementation
        What is judged.
    command
        The words that judge it again, without a selection.
    """
    from conformance.report.pictures import PictureBook

    for path in (arguments.json, arguments.junit, arguments.html):
        check_writable(path)
    folder = VectorFolder(arguments.vectors)
    chosen, waivers, book = selection(arguments), read_waivers(arguments.waivers), PictureBook()
    names = folder.select(chosen)
    skips = {name: "--skip" for name in names if matches(name, name.split("/")[2], patterns=tuple(arguments.skip))}
    done: list[Result] = []
    with ProgressDisplay(quiet=arguments.quiet) as display:

        def on_result(judged: Judged) -> None:
            done.append(judged.result)
            display.update(progress_text(judged.result.stage, done), len(done), len(names))
            if judged.result.outcome in FAULTS and arguments.keep:
                keep_files(arguments.keep, judged)
            if judged.result.outcome == "fail" and judged.outputs is not None and arguments.html:
                book.add(judged.vector, judged.outputs, judged.result)

        diagnose = None if arguments.no_diagnosis else Diagnosis()
        vectors = folder.read(names)
        run_suite(
            implementation, vectors, waivers=waivers, skips=skips, diagnose=diagnose, on_result=on_result,
            jobs=getattr(arguments, "jobs", 1),
        )  # fmt: skip
    notes = list(_waiver_notes(done, waivers, folder.names))
    again = shlex.join([*command, *_vectors_words(arguments)])
    report = Report(environment(implementation.name, arguments.vectors), again, str(chosen), notes, done)
    print("\n".join(describe(report, arguments.show)))
    write_files(arguments, report, book.pictures())
    return 0 if report.passed else 1


class Diagnosis:
    """Looks for the cause of the first few failures of each stage among the plausible bugs."""

    def __init__(self) -> None:
        self._asked: Counter[str] = Counter()

    def __call__(self, vector: Vector, outputs: Values) -> list[str]:
        """What wrong outputs look like."""
        from conformance.mutants import diagnose

        self._asked[vector.stage.name] += 1
        return diagnose(vector, outputs) if self._asked[vector.stage.name] <= DIAGNOSED else []


def _vectors_words(arguments: Namespace) -> list[str]:
    """The option that names the vectors, unless they are the usual ones."""
    return ["--vectors", str(arguments.vectors)] if arguments.vectors != VECTORS else []


def read_waivers(path: Path | None) -> dict[str, str]:
    """Reasons by id, from a JSON file.

    Raises
    ------
    UsageError
        It is none, or a reason is empty.
    """
    if path is None:
        return {}
    try:
        waivers = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise UsageError(f"{path} is no JSON: {error}") from None
    if not isinstance(waivers, dict) or not all(isinstance(r, str) and r.strip() for r in waivers.values()):
        raise UsageError(f'{path} must hold {{"id of a vector": "reason", ...}} with a reason for each')
    return waivers


def _waiver_notes(results: Iterable[Result], waivers: Mapping[str, str], names: list[str]) -> Iterable[str]:
    yield from (f"{r.id} passes and needs no waiver" for r in results if r.outcome == "pass" and r.id in waivers)
    yield from (f"there is a waiver for {name}, which is no vector" for name in waivers if name not in names)


def environment(name: str, vectors: Path) -> dict[str, str]:
    """What was judged by what, where and when."""
    return {
        "implementation": name,
        "kit": f"gsvc_ref {gsvc_ref.__version__}",
        "spec.md": SPEC_VERSION,
        "vectors": set_hash(vectors),
        "platform": f"{platform.system()} {platform.machine()}",
        "Python": f"{platform.python_version()}, NumPy {np.__version__}",
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }


def keep_files(folder: Path, judged: Judged) -> None:
    """Keep what was asked, what was answered and what was expected, as files of the process protocol."""
    home = folder / judged.vector.id
    expected = {
        name if not part else f"{name}.{part}": array
        for name, expectation in judged.vector.expected.items()
        if not isinstance(expectation, Refusal)
        for part, array in expectation.parts().items()
    }
    texts = {name: value for name, value in (judged.outputs or {}).items() if isinstance(value, str)}
    given = {name: value for name, value in (judged.outputs or {}).items() if isinstance(value, np.ndarray)}
    arrays = {name: value for name, value in given.items() if value.dtype.kind in "biuf"}
    for part, values in (("in", judged.vector.inputs), ("expected", expected), ("out", arrays)):
        (home / part).mkdir(parents=True, exist_ok=True)
        write_inputs(home / part, values)
    for name, text in texts.items():
        (home / "out" / f"{name}.txt").write_text(text, encoding="utf-8")


def write_files(arguments: Namespace, report: Report, pictures: "dict[str, list[Picture]]") -> None:
    """Write the files that were asked for."""
    from conformance.report.json import to_object
    from conformance.report.junit import junit_xml
    from conformance.report.page import report_html
    from gsvc_ref.report.page import write_page

    if arguments.json:
        write_page(json.dumps(to_object(report), indent=1, ensure_ascii=False, allow_nan=False) + "\n", arguments.json)
    if arguments.junit:
        write_page(junit_xml(report), arguments.junit)
    if arguments.html:
        write_page(report_html(report, pictures), arguments.html)
