"""Judging as the options say, and all that is written of it: what the commands ``run`` and ``spec`` share."""

import datetime
import hashlib
import json
import platform
import shlex
import sys
from argparse import ArgumentParser, Namespace
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

import gsvc_ref
from gsvc_conformance.case import FULL
from gsvc_conformance.claim import FORM, Claim, read_claim
from gsvc_conformance.commands import add_selection, add_vectors, count, selection, times
from gsvc_conformance.commands.outputs import add_files, check_outputs, write_files
from gsvc_conformance.diagnosis.failures import Failure
from gsvc_conformance.implementations import Implementation, checked_environment
from gsvc_conformance.operation import DTYPES, operations
from gsvc_conformance.report.console import describe, last_line, progress_text
from gsvc_conformance.report.kept import forget, keep_files
from gsvc_conformance.results import FAULTS, Report, Result
from gsvc_conformance.runner import Judged, run_suite
from gsvc_conformance.vector_folder import Selection, VectorFolder, matches
from gsvc_conformance.vectors import SPEC_VERSION, VECTORS, VECTORS_VERSION, Vector, set_hash
from gsvc_ref.cli.arguments import whole
from gsvc_ref.cli.progress import ProgressDisplay
from gsvc_ref.cli.text import plural, show
from gsvc_ref.errors import UsageError

SHOWN: Final = 10
NOTHING: Final = np.zeros(0)


def add_judging(parser: ArgumentParser) -> None:
    """The options that do not say what is judged."""
    add_vectors(parser)
    add_selection(parser)
    parser.add_argument(
        "--claim", metavar="CLAIM",
        help=f"judge a claim of conformance and nothing else: {FORM}, such as bitstream+rendering,paper,2,sizes",
    )  # fmt: skip
    parser.add_argument("--skip", action="append", default=[], metavar="GLOB", help="do not run these vectors")
    parser.add_argument("--waivers", type=Path, metavar="FILE", help='a JSON file {"id": "reason"} of known failures')
    parser.add_argument("--no-diagnosis", action="store_true", help="do not look for the probable cause of failures")
    parser.add_argument(
        "--repeat", type=times, default=1, metavar="N",
        help="ask for each vector N times (1): answers that differ tell of a race, or of memory that is read "
        "before it is written",
    )  # fmt: skip
    parser.add_argument(
        "--order", type=whole, metavar="SEED",
        help="ask in another order, by the SHA-256 of 'SEED ID': what a module keeps from the vector before shows; a "
        "command is a new process for each vector, and keeps what it keeps in files only",
    )  # fmt: skip
    outputs = parser.add_argument_group("output", "relative paths begin in the current folder")
    outputs.add_argument(
        "--show", type=count, default=SHOWN, metavar="N", help=f"describe at most N failures ({SHOWN})"
    )
    outputs.add_argument("--json", type=Path, metavar="FILE", help="write everything as JSON")
    add_files(outputs)
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
        The implementation that is judged.
    command
        The words that judge it again, without a selection.
    """
    from gsvc_conformance.report.pictures import PictureBook

    aside = check_outputs(arguments)
    runs_on = {**implementation.environment, **read_environment(getattr(arguments, "environment", []))}
    claim = read_claim(arguments.claim) if arguments.claim else None
    folder = VectorFolder(arguments.vectors)
    chosen, waivers, book = _selection(arguments, claim), read_waivers(arguments.waivers), PictureBook()
    names, skips = _choose(folder, chosen, tuple(arguments.skip))
    if claim:
        _check_claim(claim, names)
    if arguments.keep:
        forget(arguments.keep, names)
    done: list[Result] = []
    causes = Causes()
    ended: BaseException | None = None
    try:
        with ProgressDisplay(quiet=arguments.quiet) as display:

            def on_result(judged: Judged) -> None:
                done.append(judged.result)
                causes.add(judged)
                display.update(progress_text(judged.result.operation, done), len(done), len(names))
                if judged.result.outcome in FAULTS and arguments.keep:
                    keep_files(arguments.keep, judged)
                if judged.result.outcome == "fail" and judged.outputs is not None and arguments.html:
                    book.add(judged.vector, judged.outputs, judged.result)

            vectors = folder.read(names if arguments.order is None else shuffled(names, arguments.order))
            run_suite(
                implementation, vectors, waivers=waivers, skips=skips, on_result=on_result,
                jobs=getattr(arguments, "jobs", 1), repeat=arguments.repeat, level=claim.level if claim else 1,
            )  # fmt: skip
            display.update("looking for causes", len(names), len(names))
            results, notes = (done, []) if arguments.no_diagnosis else causes.find(done)
    except (Exception, KeyboardInterrupt) as error:  # what was judged must not be lost
        if not done:
            raise
        results, notes, ended = done, [_end(error, len(done), len(names))], error
    notes += [*_difference_notes(results), *_waiver_notes(results, waivers, folder.names)]
    notes += [_order_note(arguments.order)] if arguments.order is not None else []
    again = shlex.join([*command, *_vectors_words(arguments)])
    around = environment(implementation.name, arguments.vectors)
    place = {name: number for number, name in enumerate(names)}
    results = sorted(results, key=lambda result: place[result.id])
    report = Report(
        around, again, "" if claim else str(chosen), notes, results, runs_on,
        notes[0] if len(done) < len(names) else "", claim, chosen.whole and not any(map(_is_full, names)),
        options=shlex.join(_options(arguments)),
    )  # fmt: skip
    written, refused = write_files(arguments, report, book.pictures())
    show(*describe(report, arguments.show), *written, f"\n{last_line(report)}", file=sys.stderr if aside else None)
    for fault in (ended, *refused):
        if fault is not None:
            raise fault
    return report.exit_code


def _selection(arguments: Namespace, claim: Claim | None) -> Selection:
    """The selection of the options, or that of a claim, which leaves no other choice.

    Raises
    ------
    UsageError
        There is a claim and another choice.
    """
    chosen = selection(arguments)
    if claim is None:
        return chosen
    if str(chosen) or arguments.skip:
        raise UsageError("--claim says which vectors are judged: leave out --skip and what selects others")
    return Selection(groups=claim.judged)


def _check_claim(claim: Claim, names: Iterable[str]) -> None:
    """Refuse vectors that cannot judge a claim: those of the full set, or none of one of its classes.

    Raises
    ------
    UsageError
        They are such.
    """
    if any(map(_is_full, names)):
        raise UsageError(f"no claim is judged by the tier {FULL}: give the folder of the other tiers as --vectors")
    there = {operations()[name.split("/")[1]].group for name in names}
    if missing := [group for group in claim.judged if group not in there]:
        raise UsageError(f"there are no vectors of the class {', '.join(missing)}; see gsvc-conformance list")


def _is_full(name: str) -> bool:
    """Whether a vector is of the full set, on which no verdict depends."""
    return name.startswith(f"{FULL}/")


def _end(error: BaseException, count: int, total: int) -> str:
    """The reason why a run ends early, after some number of vectors."""
    why = "interrupted" if isinstance(error, KeyboardInterrupt) else f"{type(error).__name__}: {error}"
    return f"ended early, after {count} of {plural(total, 'vector')}: {why}"


def shuffled(names: Iterable[str], seed: int) -> list[str]:
    """Vectors in the order of the SHA-256 of ``SEED ID``: the same everywhere, whatever else is selected."""
    return sorted(names, key=lambda name: hashlib.sha256(f"{seed} {name}".encode()).digest())


def _order_note(seed: int) -> str:
    return (
        f"the vectors ran in the order of --order {seed}; what is wrong in one order only keeps something from the "
        f"vector before"
    )


def _difference_notes(results: Iterable[Result]) -> Iterator[str]:
    """The operations of which vectors pass with answers that differ."""
    found = Counter(result.operation for result in results if result.outcome == "pass" and result.message)
    for operation, number in found.items():
        yield (
            f"{operation}: {plural(number, 'vector')} gave different answers when asked again, each within what is "
            f"allowed: an order of summation that changes from run to run does that"
        )


def _choose(folder: VectorFolder, chosen: Selection, patterns: tuple[str, ...]) -> tuple[list[str], dict[str, str]]:
    """The vectors of a run by id, and why some of them are skipped."""
    folder.check_patterns("--skip", patterns)
    names = folder.select(chosen)
    return names, {name: "--skip" for name in names if matches(name, name.split("/")[2], patterns=patterns)}


class Causes:
    """Collects what the search for causes needs, operation by operation, and finds them."""

    def __init__(self) -> None:
        self._failures: defaultdict[str, list[Failure]] = defaultdict(list)
        self._passed: defaultdict[str, list[Vector]] = defaultdict(list)
        self._errors: defaultdict[str, list[Vector]] = defaultdict(list)
        self._buffers: dict[tuple[str, str], NDArray[Any]] = {}

    def add(self, judged: Judged) -> None:
        """Take note of a vector."""
        name = judged.vector.operation.name
        if judged.result.outcome == "pass":
            self._passed[name].append(judged.vector)
        elif judged.result.outcome == "fail" and judged.outputs is not None and _right_types(judged):
            before = {
                port.name: self._buffers.get((name, port.name), NOTHING) for port in judged.vector.operation.outputs
            }
            self._failures[name].append(Failure(judged.vector, judged.outputs, before))
        elif judged.result.outcome in ("error", "crash"):
            self._errors[name].append(judged.vector)
        self._write_buffers(judged)

    def _write_buffers(self, judged: Judged) -> None:
        """Keep what buffers would hold now that no vector clears: each output over the one before."""
        for name, value in (judged.outputs or {}).items():
            if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
                key, flat = (judged.vector.operation.name, name), value.ravel()
                beyond = self._buffers.get(key, NOTHING)[flat.size :]
                self._buffers[key] = np.concatenate([flat, beyond]) if beyond.size else flat

    def find(self, results: Iterable[Result]) -> tuple[list[Result], list[str]]:
        """The results with their causes, and what is to be said of the search."""
        from gsvc_conformance.diagnosis import EXAMINED, diagnose, examined, mutants_for

        causes: dict[str, list[str]] = {}
        notes = []
        for operation in dict.fromkeys([*self._failures, *self._errors]):
            failures = self._failures[operation]
            causes |= diagnose(failures, self._passed[operation], self._errors[operation])
            seen = [failure.vector for failure in examined(failures)]
            if open_ones := [vector for vector in seen if not causes.get(vector.id)]:
                tried = len({mutant.name for vector in open_ones for mutant in mutants_for(vector)})
                notes.append(
                    f"{operation}: no mutant gives exactly what {len(open_ones)} of {plural(len(seen), 'failure')} "
                    f"gave ({tried} tried)"
                )
            if len(failures) > EXAMINED:
                notes.append(
                    f"causes were looked for in {EXAMINED} of {len(failures)} failures of {operation}, of all sizes"
                )
        return [replace(result, causes=tuple(causes.get(result.id, ()))) for result in results], notes


def _right_types(judged: Judged) -> bool:
    """Whether arrays have the types that they must have; if not, the report says so and looks for no other cause."""
    given = judged.outputs or {}
    mine = {port: given.get(port.name) for port in judged.vector.operation.outputs if port.type in DTYPES}
    return all(array.dtype == port.type for port, array in mine.items() if isinstance(array, np.ndarray))


def _options(arguments: Namespace) -> list[str]:
    """The options that say which vectors are judged, and what excuses them."""
    several = {
        "tier": arguments.tier, "operation": arguments.operation, "class": arguments.group, "case": arguments.case,
        "rule": arguments.rule, "equation": arguments.equation, "flag": arguments.flag, "skip": arguments.skip,
    }  # fmt: skip
    single = {"claim": arguments.claim, "waivers": arguments.waivers, "order": arguments.order}
    words = [word for name, values in several.items() for value in values for word in (f"--{name}", value)]
    return words + [word for name, value in single.items() if value is not None for word in (f"--{name}", str(value))]


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
    """The kit, the document, the vectors, the machine and the time of a run, by name."""
    return {
        "implementation": name,
        "kit": f"gsvc_ref {gsvc_ref.__version__}",
        "spec.md": SPEC_VERSION,
        "vectors version": str(VECTORS_VERSION),
        "vectors": set_hash(vectors),
        "platform": f"{platform.system()} {platform.machine()}",
        "Python": f"{platform.python_version()}, NumPy {np.__version__}",
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }
