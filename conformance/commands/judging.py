"""Judging as the options say, and all that is written of it: what the commands ``run`` and ``spec`` share."""

import datetime
import json
import platform
import shlex
from argparse import ArgumentParser, Namespace
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

import gsvc_ref
from conformance.commands import add_selection, add_vectors, check_writable, count, selection
from conformance.diagnosis.failures import Failure
from conformance.implementations import Implementation, checked_environment
from conformance.report.console import describe, last_line, progress_text
from conformance.report.kept import forget, keep_files
from conformance.results import FAULTS, Report, Result
from conformance.runner import Judged, run_suite
from conformance.selection import Selection, VectorFolder, matches
from conformance.stage import DTYPES
from conformance.vectors import SPEC_VERSION, VECTORS, Vector, set_hash
from gsvc_ref.cli.progress import ProgressDisplay
from gsvc_ref.cli.text import plural
from gsvc_ref.errors import UsageError

if TYPE_CHECKING:
    from conformance.report.pictures import Picture

SHOWN: Final = 10
NOTHING: Final = np.zeros(0)


def add_judging(parser: ArgumentParser) -> None:
    """The options that do not say what is judged."""
    add_vectors(parser)
    add_selection(parser)
    parser.add_argument("--skip", action="append", default=[], metavar="GLOB", help="do not run these vectors")
    parser.add_argument("--waivers", type=Path, metavar="FILE", help='a JSON file {"id": "reason"} of known failures')
    parser.add_argument("--no-diagnosis", action="store_true", help="do not look for the probable cause of failures")
    outputs = parser.add_argument_group("output", "relative paths begin in the current folder")
    outputs.add_argument(
        "--show", type=count, default=SHOWN, metavar="N", help=f"describe at most N failures ({SHOWN})"
    )
    outputs.add_argument("--json", type=Path, metavar="FILE", help="write everything as JSON")
    outputs.add_argument("--junit", type=Path, metavar="FILE", help="write JUnit XML")
    outputs.add_argument("--html", type=Path, metavar="FILE", help="write a page with pictures of the worst failures")
    outputs.add_argument(
        "--keep", type=Path, metavar="DIR", help="keep inputs, outputs and expectations of what is wrong"
    )
    outputs.add_argument("--quiet", action="store_true", help="show no progress")


def judge(arguments: Namespace, implementation: Implementation, command: list[str]) -> int:
    """Judge an implementation as the options say, and report; the exit code.

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
    runs_on = {**implementation.environment, **read_environment(getattr(arguments, "environment", []))}
    folder = VectorFolder(arguments.vectors)
    chosen, waivers, book = selection(arguments), read_waivers(arguments.waivers), PictureBook()
    names, skips = _choose(folder, chosen, tuple(arguments.skip))
    if arguments.keep:
        forget(arguments.keep, names)
    done: list[Result] = []
    causes = Causes()
    with ProgressDisplay(quiet=arguments.quiet) as display:

        def on_result(judged: Judged) -> None:
            done.append(judged.result)
            causes.add(judged)
            display.update(progress_text(judged.result.stage, done), len(done), len(names))
            if judged.result.outcome in FAULTS and arguments.keep:
                keep_files(arguments.keep, judged)
            if judged.result.outcome == "fail" and judged.outputs is not None and arguments.html:
                book.add(judged.vector, judged.outputs, judged.result)

        vectors = folder.read(names)
        run_suite(
            implementation, vectors, waivers=waivers, skips=skips, on_result=on_result,
            jobs=getattr(arguments, "jobs", 1),
        )  # fmt: skip
        display.update("looking for causes", len(names), len(names))
        results, notes = (done, []) if arguments.no_diagnosis else causes.find(done)
    notes += _waiver_notes(results, waivers, folder.names)
    again = shlex.join([*command, *_vectors_words(arguments)])
    around = environment(implementation.name, arguments.vectors)
    report = Report(around, again, str(chosen), notes, results, runs_on)
    print("\n".join(describe(report, arguments.show)))
    for line in write_files(arguments, report, book.pictures()):
        print(line)
    print(f"\n{last_line(report)}")
    return report.exit_code


def _choose(folder: VectorFolder, chosen: Selection, patterns: tuple[str, ...]) -> tuple[list[str], dict[str, str]]:
    """The vectors of a run by id, and why some of them are skipped."""
    folder.check_patterns("--skip", patterns)
    names = folder.select(chosen)
    return names, {name: "--skip" for name in names if matches(name, name.split("/")[2], patterns=patterns)}


class Causes:
    """Collects what the search for causes needs, stage by stage, and finds them."""

    def __init__(self) -> None:
        self._failures: defaultdict[str, list[Failure]] = defaultdict(list)
        self._passed: defaultdict[str, list[Vector]] = defaultdict(list)
        self._buffers: dict[tuple[str, str], NDArray[Any]] = {}

    def add(self, judged: Judged) -> None:
        """Take note of a vector."""
        name = judged.vector.stage.name
        if judged.result.outcome == "pass":
            self._passed[name].append(judged.vector)
        elif judged.result.outcome == "fail" and judged.outputs is not None and _right_types(judged):
            before = {port.name: self._buffers.get((name, port.name), NOTHING) for port in judged.vector.stage.outputs}
            self._failures[name].append(Failure(judged.vector, judged.outputs, before))
        self._write_buffers(judged)

    def _write_buffers(self, judged: Judged) -> None:
        """Keep what buffers would hold now that no vector clears: each output over the one before."""
        for name, value in (judged.outputs or {}).items():
            if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
                key, flat = (judged.vector.stage.name, name), value.ravel()
                beyond = self._buffers.get(key, NOTHING)[flat.size :]
                self._buffers[key] = np.concatenate([flat, beyond]) if beyond.size else flat

    def find(self, results: Iterable[Result]) -> tuple[list[Result], list[str]]:
        """The results with their causes, and what is to be said of the search."""
        from conformance.diagnosis import EXAMINED, bugs_for, diagnose, examined

        causes: dict[str, list[str]] = {}
        notes = []
        for stage, failures in self._failures.items():
            causes |= diagnose(failures, self._passed[stage])
            seen = [failure.vector for failure in examined(failures)]
            if open_ones := [vector for vector in seen if not causes.get(vector.id)]:
                tried = len({bug.name for vector in open_ones for bug in bugs_for(vector)})
                notes.append(
                    f"{stage}: no known bug gives exactly what {len(open_ones)} of {plural(len(seen), 'failure')} "
                    f"gave ({tried} tried)"
                )
            if len(failures) > EXAMINED:
                notes.append(
                    f"causes were looked for in {EXAMINED} of {len(failures)} failures of {stage}, of all sizes"
                )
        return [replace(result, causes=tuple(causes.get(result.id, ()))) for result in results], notes


def _right_types(judged: Judged) -> bool:
    """Whether arrays have the types that they must have; if not, that is told, and no bug is looked for behind it."""
    given = judged.outputs or {}
    mine = {port: given.get(port.name) for port in judged.vector.stage.outputs if port.type in DTYPES}
    return all(array.dtype == DTYPES[port.type] for port, array in mine.items() if isinstance(array, np.ndarray))


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


def read_environment(words: Iterable[str]) -> dict[str, str]:
    """Values by name, from words such as ``device=NVIDIA H200``; of two with one name the last.

    Raises
    ------
    UsageError
        A word has no name or no value.
    """
    pairs = [word.partition("=") for word in words]
    return checked_environment({key: value for key, _, value in pairs}, "--environment")


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


def write_files(arguments: Namespace, report: Report, pictures: "dict[str, list[Picture]]") -> Iterator[str]:
    """Write the files that were asked for, and say where each went."""
    from conformance.report.json import to_text
    from conformance.report.junit import junit_xml
    from conformance.report.page import report_html
    from gsvc_ref.report.page import write_page

    if arguments.json:
        write_page(to_text(report), arguments.json)
        yield f"JSON: {arguments.json}"
    if arguments.junit:
        write_page(junit_xml(report), arguments.junit)
        yield f"JUnit XML: {arguments.junit}"
    if arguments.html:
        write_page(report_html(report, pictures), arguments.html)
        yield f"page: {arguments.html}"
    if arguments.keep and report.faults:
        yield f"inputs, outputs and expectations of what is wrong: {arguments.keep}"
