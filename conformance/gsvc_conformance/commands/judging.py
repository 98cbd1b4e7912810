"""Judging as the options say, and all that is written of it: what the commands ``run`` and ``spec`` share."""

import datetime
import hashlib
import math
import platform
import shlex
import sys
from argparse import ArgumentParser, Namespace
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from gsvc_base.cli.arguments import positive, whole
from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import plural, show
from gsvc_base.errors import UsageError
from gsvc_base.files import write_text
from gsvc_base.rendering.error_models import ERROR_MODELS, FP32, ErrorModel
from gsvc_conformance import __version__
from gsvc_conformance.case import FULL, OWN
from gsvc_conformance.causes import Causes
from gsvc_conformance.claim import FORM, Claim, read_claim, read_model
from gsvc_conformance.commands import add_selection, add_set, add_vectors, count, selection, times, vectors_of
from gsvc_conformance.commands.outputs import add_files, check_outputs, check_writable, write_files
from gsvc_conformance.features import Features, read_features
from gsvc_conformance.implementations import Implementation, checked_environment
from gsvc_conformance.operation import operations
from gsvc_conformance.report.console import describe, last_line, progress_text
from gsvc_conformance.report.kept import forget, keep_files
from gsvc_conformance.results import FAULTS, Outcome, Result
from gsvc_conformance.runner import Judged, run_suite
from gsvc_conformance.vector import SPEC_VERSION, VECTORS
from gsvc_conformance.vector_folder import Selection, VectorFolder, matches
from gsvc_conformance.verdicts import Report
from gsvc_conformance.waivers import Waivers, read_waivers, renewed, to_toml

if TYPE_CHECKING:
    from gsvc_conformance.report.pictures import View

SHOWN: Final = 10
MEASURED: Final = ("rendering", "gradients")
USUAL: Final = 1 / 3
"""The part of what is allowed that arithmetic in binary32 usually takes, in these classes."""
ON_A_GPU: Final = 0.16
"""The part that four implementations took on an NVIDIA H200, at most; in gradients alone 0.07."""
MAX_NEEDS: Final = 6
"""Maximum number of kinds of vectors outside of the features that a note names."""


def add_judging(parser: ArgumentParser) -> None:
    """The options that do not say what is judged."""
    add_vectors(parser)
    add_set(parser)
    add_selection(parser)
    parser.add_argument(
        "--claim", metavar="CLAIM",
        help=f"judge a claim of conformance and nothing else: {FORM}, such as bitstream+rendering,paper,2,sizes",
    )  # fmt: skip
    parser.add_argument(
        "--model", metavar="MODEL",
        help=f"the error model that bounds are derived from: {', '.join(ERROR_MODELS)} (the claim's, or {FP32.name})",
    )  # fmt: skip
    parser.add_argument(
        "--features", type=Path, metavar="FILE",
        help="a TOML file of what it is made for: all that is inside must be answered, all else right or refused",
    )  # fmt: skip
    parser.add_argument("--skip", action="append", default=[], metavar="GLOB", help="do not run these vectors")
    parser.add_argument("--waivers", type=Path, metavar="FILE", help="a TOML file of known failures")
    parser.add_argument(
        "--strict-waivers", action="store_true",
        help="fail if a waiver is stale: its vector passes, none matches, or it is over",
    )  # fmt: skip
    parser.add_argument("--no-diagnosis", action="store_true", help="do not look for the probable cause of failures")
    parser.add_argument(
        "--repeat", type=times, default=1, metavar="N",
        help="ask for each vector N times (1): answers that differ tell of a race, or of memory that is read "
        "before it is written",
    )  # fmt: skip
    parser.add_argument(
        "--order", type=whole, metavar="SEED",
        help="ask in another order, by the SHA-256 of 'SEED ID': what a module or a server keeps from vector to vector "
        "shows; a command is a new process for each vector, and keeps what it keeps in files only",
    )  # fmt: skip
    parser.add_argument(
        "--seconds", type=positive, metavar="S",
        help="ask for small vectors first, and for no more once S seconds are used: for an implementation that is slow",
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
    outputs.add_argument(
        "--write-waivers", type=Path, metavar="FILE",
        help="write waivers for all that is wrong, with those of --waivers that are still needed",
    )  # fmt: skip
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
    aside = check_outputs(arguments)
    check_writable(arguments.write_waivers)
    plan = _plan(arguments)
    runs_on = {**implementation.environment, **read_environment(getattr(arguments, "environment", []))}
    if arguments.keep:
        forget(arguments.keep, plan.names)
    found = _asked(arguments, plan, implementation)
    stale = plan.waivers.stale(found.results, plan.folder.names)
    place = {name: number for number, name in enumerate(plan.names)}
    report = Report(
        environment=environment(implementation.name, plan.folder),
        command=shlex.join(
            [*command, *_vectors_words(arguments), *_model_words(plan.model), *_features_words(arguments)]
        ),
        selection="" if plan.claim else str(plan.selection),
        notes=[*model_notes(plan.model), *_notes(arguments, found, stale)],
        results=sorted(found.results, key=lambda result: place[result.id]),
        runs_on=runs_on,
        ended=found.notes[0] if len(found.results) < len(plan.names) else "",
        claim=plan.claim,
        whole=plan.selection.whole and not any(map(_of_no_claim, plan.names)),
        features=plan.features,
        stale=tuple(stale) if arguments.strict_waivers else (),
        options=shlex.join(_options(arguments)),
        model=plan.model.name,
    )
    written, refused = write_files(arguments, report, found.pictures)
    if arguments.write_waivers:
        waivers = renewed(plan.waivers, found.results, plan.folder.names, found.examined)
        write_text(to_toml(waivers), arguments.write_waivers)
        written.append(f"waivers: {arguments.write_waivers}")
    show(*describe(report, arguments.show), *written, f"\n{last_line(report)}", file=sys.stderr if aside else None)
    for fault in (found.fault, *refused):
        if fault is not None:
            raise fault
    return report.exit_code


@dataclass(frozen=True)
class _Plan:
    """What is judged by what, and what is excused."""

    claim: Claim | None
    features: Features | None
    folder: VectorFolder
    selection: Selection
    waivers: Waivers
    names: list[str]
    skips: dict[str, str]
    model: ErrorModel


def _plan(arguments: Namespace) -> _Plan:
    """The plan that the options make.

    Raises
    ------
    UsageError
        They contradict each other, or a file that they name is wrong.
    """
    if arguments.strict_waivers and not arguments.waivers:
        raise UsageError("--strict-waivers needs --waivers FILE")
    if arguments.seconds and (arguments.claim or arguments.order is not None):
        raise UsageError(
            "--seconds runs small vectors first and leaves others out; it cannot be combined with --claim or --order"
        )
    claim = read_claim(arguments.claim) if arguments.claim else None
    model = _model(arguments.model, claim)
    features = read_features(arguments.features) if arguments.features else None
    if claim and features:
        features.check_claim(claim)
    folder = vectors_of(arguments)
    chosen, waivers = _selection(arguments, claim), read_waivers(arguments.waivers)
    names, skips = _choose(folder, chosen, tuple(arguments.skip))
    if claim:
        _check_claim(claim, names)
    return _Plan(claim, features, folder, chosen, waivers, names, skips, model)


def _model(name: str | None, claim: Claim | None) -> ErrorModel:
    """The error model of the options.

    Raises
    ------
    UsageError
        There is none of that name, or the claim names another one.
    """
    if name is None:
        return claim.model if claim else FP32
    if claim and claim.model is not read_model(name):
        raise UsageError(f"the claim {claim} is one of the error model {claim.model.name}, and --model is {name}")
    return read_model(name)


@dataclass(frozen=True)
class _Found:
    """What a run came to: its results and what is to be said of them.

    Attributes
    ----------
    results, notes, pictures
        The results, sentences about them, and pictures of what is wrong.
    fault
        What ended it early.
    examined
        The ids of the failures in which causes were looked for.
    """

    results: list[Result]
    notes: list[str]
    pictures: "Mapping[str, View]"
    fault: BaseException | None = None
    examined: frozenset[str] = frozenset()


def _asked(arguments: Namespace, plan: _Plan, implementation: Implementation) -> _Found:
    """Ask for the vectors of a plan and judge the answers; what was judged before a fault is not lost."""
    from gsvc_conformance.report.pictures import PictureBook

    done: list[Result] = []
    counts: defaultdict[str, Counter[Outcome]] = defaultdict(Counter)
    causes, book = Causes(), PictureBook()
    try:
        with ProgressDisplay(quiet=arguments.quiet) as display:

            def on_result(judged: Judged) -> None:
                done.append(judged.result)
                causes.add(judged)
                count = counts[judged.result.operation]
                count[judged.result.outcome] += 1
                display.update(progress_text(judged.result.operation, count), len(done), len(plan.names))
                if judged.result.outcome in FAULTS and arguments.keep:
                    keep_files(arguments.keep, judged)
                if judged.result.outcome == "fail" and judged.outputs is not None and arguments.html:
                    book.add(judged.vector, judged.outputs, judged.result)

            waivers = plan.waivers.reasons(plan.folder.names)
            order = _in_order(arguments, plan)
            vectors = (vector.by_model(plan.model) for vector in plan.folder.read(order))
            run_suite(
                implementation, vectors, waivers=waivers, skips=plan.skips,
                on_result=on_result, jobs=getattr(arguments, "jobs", 1), repeat=arguments.repeat,
                level=plan.claim.level if plan.claim else 1, features=plan.features,
                profile=plan.claim.profile if plan.claim else "", seconds=arguments.seconds or math.inf,
            )  # fmt: skip
            display.update("looking for causes", len(plan.names), len(plan.names))
            results, notes = (done, []) if arguments.no_diagnosis else causes.find(done)
            notes += book.faults
    except (Exception, KeyboardInterrupt) as error:
        if not done:
            raise
        return _Found(done, [_end(error, len(done), len(plan.names))], book.pictures(), error)
    return _Found(results, notes, book.pictures(), examined=frozenset(causes.examined))


def _notes(arguments: Namespace, found: _Found, stale: Iterable[str]) -> list[str]:
    """All that is to be said of a run besides its results."""
    return [
        *found.notes,
        *_difference_notes(found.results),
        *_beyond_notes(found.results),
        *_unusual_notes(found.results),
        *([] if arguments.strict_waivers else stale),
        *([_order_note(arguments.order)] if arguments.order is not None else []),
    ]


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
    return Selection(groups=claim.judged, profile=claim.profile)


def _check_claim(claim: Claim, names: Iterable[str]) -> None:
    """Refuse vectors that cannot judge a claim: those of the full set, own ones, or none of one of its classes.

    Raises
    ------
    UsageError
        They are such.
    """
    if any(map(_of_no_claim, names)):
        raise UsageError(
            f"no claim is judged by the tiers {FULL} and {OWN}: leave out --vectors, or give another folder"
        )
    there = {operations()[name.split("/")[1]].group for name in names}
    if missing := [group for group in claim.judged if group not in there]:
        which = f"profile {claim.profile} in the class {', '.join(missing)}"
        raise UsageError(f"there are no vectors of {which}; see gsvc-conformance list")


def _of_no_claim(name: str) -> bool:
    """Whether a vector is of the full set or somebody's own: no claim depends on it, and no verdict can be quoted."""
    return name.startswith((f"{FULL}/", f"{OWN}/"))


def _end(error: BaseException, count: int, total: int) -> str:
    """The reason why a run ends early, after some number of vectors."""
    why = str(error) if isinstance(error, UsageError) else f"{type(error).__name__}: {error}"
    why = "interrupted" if isinstance(error, KeyboardInterrupt) else why
    return f"ended early, after {count} of {plural(total, 'vector')}: {why}"


def _in_order(arguments: Namespace, plan: _Plan) -> list[str]:
    """The vectors in the order in which they are asked for."""
    if arguments.seconds:
        return sorted(plan.names, key=plan.folder.work)
    return plan.names if arguments.order is None else shuffled(plan.names, arguments.order)


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


def _beyond_notes(results: Iterable[Result]) -> Iterator[str]:
    """What an implementation does rightly although its features leave it out."""
    found = Counter(result.outside for result in results if result.outside and result.outcome == "pass")
    if found:
        needs = ", ".join(f"{what} ({number})" for what, number in found.most_common(MAX_NEEDS))
        more = ", ..." if len(found) > MAX_NEEDS else ""
        total = plural(found.total(), "vector")
        yield f"{total} outside of its features got right answers, which its features could claim: {needs}{more}"


def _unusual_notes(results: Iterable[Result]) -> Iterator[str]:
    """The operations that pass with errors larger than arithmetic in binary32 usually has: a note, no fault."""
    passed: dict[str, list[tuple[float, str]]] = {}
    for result in results:
        if result.outcome == "pass" and result.group in MEASURED and result.tier in ("core", "uncommon"):
            passed.setdefault(result.operation, []).append((result.ratio or 0.0, result.id))
    for operation, ratios in passed.items():
        beyond = [entry for entry in ratios if entry[0] > USUAL]
        if beyond:
            worst, name = max(beyond)
            yield (
                f"{operation}: {len(beyond)} of {plural(len(ratios), 'vector')} pass with more than a third of the "
                f"error that is allowed, {name} with {worst:.2g} of it: allowed, and unusual "
                f"(on an H200 it was at most {ON_A_GPU})"
            )


def _choose(folder: VectorFolder, chosen: Selection, patterns: tuple[str, ...]) -> tuple[list[str], dict[str, str]]:
    """The vectors of a run by id, and why some of them are skipped."""
    folder.check_patterns("--skip ", patterns)
    names = folder.select(chosen)
    return names, {name: "--skip" for name in names if matches(name, name.split("/")[2], patterns=patterns)}


def _options(arguments: Namespace) -> list[str]:
    """The options that say which vectors are judged, and what excuses them."""
    several = {
        "tier": arguments.tier, "operation": arguments.operation, "class": arguments.group, "case": arguments.case,
        "rule": arguments.rule, "equation": arguments.equation, "flag": arguments.flag, "skip": arguments.skip,
    }  # fmt: skip
    single = {
        "claim": arguments.claim,
        "waivers": arguments.waivers,
        "order": arguments.order,
        "seconds": arguments.seconds,
    }
    words = [word for name, values in several.items() for value in values for word in (f"--{name}", value)]
    words += [word for name, value in single.items() if value is not None for word in (f"--{name}", str(value))]
    return [*words, *(["--strict-waivers"] if arguments.strict_waivers else [])]


def _vectors_words(arguments: Namespace) -> list[str]:
    """The options that name the vectors and the set, unless they are the usual ones."""
    place = ["--vectors", str(arguments.vectors)] if arguments.vectors != VECTORS else []
    return [*place, *(["--set", str(arguments.set)] if arguments.set != "newest" else [])]


def model_notes(model: ErrorModel) -> list[str]:
    """What all forms of a report say of a model that is not the usual one."""
    return [f"the bounds are those of the error model {model.name}"] if model is not FP32 else []


def _model_words(model: ErrorModel) -> list[str]:
    return ["--model", model.name] if model is not FP32 else []


def _features_words(arguments: Namespace) -> list[str]:
    return ["--features", str(arguments.features)] if arguments.features else []


def read_environment(words: Iterable[str]) -> dict[str, str]:
    """Values by name, from words such as ``device=NVIDIA H200``; of two with one name the last.

    Raises
    ------
    UsageError
        A word has no name or no value.
    """
    pairs = [word.partition("=") for word in words]
    return checked_environment({key: value for key, _, value in pairs}, "--environment")


def environment(name: str, vectors: VectorFolder) -> dict[str, str]:
    """The kit, the document, the vectors, the machine and the time of a run, by name."""
    return {
        "implementation": name,
        "kit": f"gsvc-conformance {__version__}",
        "spec.md": SPEC_VERSION,
        **({"vector set": str(vectors.set.number)} if vectors.set else {}),
        "vectors": vectors.sha256,
        "platform": f"{platform.system()} {platform.machine()}",
        "Python": f"{platform.python_version()}, NumPy {np.__version__}",
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }
