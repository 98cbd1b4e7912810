"""The parts of the command: what each runs, for how long at most, and how its result is read."""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from gsvc_base.cli.text import plural
from gsvc_base.errors import UsageError
from gsvc_conformance.report.json import read
from gsvc_conformance.results import Report
from gsvc_lab.benchmarks.gpu.outcome import State
from gsvc_lab.benchmarks.gpu.sanitized import CASES
from gsvc_lab.benchmarks.gpu.splats import DRAWS
from gsvc_lab.benchmarks.gpu.survey import Adapter, Survey, tool

Told = tuple[State, str]
"""What became of a part, and a sentence about it."""
Read = Callable[[Path, dict[str, Any]], Told]
"""A function from the file of a result and its values to what they tell."""

REPEATED: Final = ("render_sum", "render_sum_deterministic", "render_gradients")
WAIVERS: Final = Path("conformance/gsvc_conformance/adapters/gsplat_cuda/expected_failures.toml")
FEW_CASES: Final = ("core/render_sum/plain_1*", "core/render_sum_deterministic/size_1*", "core/to_frame/*")
"""Vectors for a processor that plays a GPU."""


@dataclass(frozen=True)
class Part:
    """Something to run in a process of its own."""

    name: str  # of its files
    what: str  # what it is about, in words
    words: tuple[str, ...]  # what Python is started with; the file of the result follows
    limit: float  # seconds
    told: Read
    settings: Mapping[str, str] = field(default_factory=dict)  # environment variables to start it with
    alone: bool = False  # whether nothing may run beside it, since it measures time
    missing: str = ""  # why it is skipped

    @property
    def command(self) -> list[str]:
        """The words of its command, without the file of the result."""
        return [sys.executable, *self.words]


def kit_told(path: Path, values: dict[str, Any]) -> Told:
    """The conclusion of a run of the kit."""
    report = _report(path)
    if report is None:
        return "failed", ""
    counts = {
        name: sum(result.outcome == name for result in report.results) for name in ("pass", "waived", "unsupported")
    }
    parts = [f"{len(report.faults)} wrong", *(f"{count} {name}" for name, count in counts.items() if count)]
    if report.ended:
        parts.append(report.ended)
    state: State = "wrong" if report.faults else "stopped" if report.ended else "right"
    return state, ", ".join(parts)


def repeat_told(path: Path, values: dict[str, Any]) -> Told:
    """How many vectors were answered differently, by a run of the kit with --repeat."""
    state, told = kit_told(path, values)
    report = _report(path)
    if report is None:
        return state, told
    several = sum("different answers" in result.message for result in report.results if result.outcome == "pass")
    return state, f"{told}; {plural(several, 'vector')} within bounds but with other bytes another time"


def _report(path: Path) -> Report | None:
    try:
        return read(path)
    except (UsageError, OSError):
        return None


def sums_told(path: Path, values: dict[str, Any]) -> Told:
    """How many bytes of how many deterministic sums differ from those of the CPU."""
    differing = values.get("differing", {})
    state: State = "wrong" if differing else "right" if values.get("whole") else "stopped"
    first = f", first in {next(iter(differing))}" if differing else ""
    of = f"{plural(len(values.get('pictures', ())), 'picture or stream')} and {values.get('draws', 0):,} random draws"
    return state, f"{sum(differing.values()):,} bytes differ{first}, of {of}"


def sanitizer_told(path: Path, values: dict[str, Any]) -> Told:
    """The number of reports of compute-sanitizer."""
    return ("wrong" if values.get("wrong") else "right"), plural(int(values.get("reports", 0)), "report")


def speeds_told(path: Path, values: dict[str, Any]) -> Told:
    """How many works were measured."""
    measured = list(values.get("implementations", ()))
    count = sum(len(one["seconds"]) for one in measured)
    missing = [f"{name}: {reason}" for one in measured for name, reason in one.get("missing", {}).items()]
    state: State = "measured" if values.get("whole", True) and count else "failed"
    return state, "; ".join([plural(count, "work"), *missing[:2]])


def parts(survey: Survey, folder: Path, *, cpu: bool) -> list[Part]:
    """All parts, in the order of their start.

    Parameters
    ----------
    survey
        What runs here.
    folder
        Where the kit's pages go, and digests that this run makes itself.
    cpu
        Whether processors play the GPU, on little.
    """
    jobs = 1 if cpu else min(4, survey.width)
    made = [part for adapter in survey.runs for part in _judging(adapter, survey, folder, cpu, jobs)]
    made += [
        _sanitizer(survey, name, planted)
        for name, planted in (("racecheck", False), ("memcheck", False), ("racecheck", True))
    ]
    made.sort(key=lambda part: -part.limit)  # longest first
    made += [part for adapter in survey.runs for part in _timing(adapter, survey, cpu)]
    made.append(_operations(survey, cpu))
    return made


def _settings(adapter: Adapter, survey: Survey, cpu: bool) -> dict[str, str]:
    return {**survey.variables, **(adapter.on_processor if cpu else adapter.settings)}


def _judging(adapter: Adapter, survey: Survey, folder: Path, cpu: bool, jobs: int) -> list[Part]:
    """The kit's run, the same with --repeat, and the comparison of deterministic sums."""
    settings = _settings(adapter, survey, cpu)
    kit = ("-m", "gsvc_conformance", "run", "--module", adapter.module, "--quiet", "--show", "3")
    waivers = ("--waivers", str(WAIVERS)) if adapter.name == "gsplat_cuda" else ()
    few = tuple(word for case in FEW_CASES for word in ("--case", case)) if cpu else ()
    page = ("--html", str(folder / f"{adapter.name}.html"))
    again = tuple(word for operation in REPEATED for word in ("--operation", operation))
    draws = (
        ("--small", "--draws", "100", "--golden", str(folder / "golden.json"))
        if cpu
        else ("--draws", str(adapter.draws))
    )
    limit = 100 if adapter.draws == DRAWS else 150  # of what is slow, with which to begin
    found = [
        Part(adapter.name, f"kit, {adapter.name}", (*kit, *waivers, *few, *page, "--json"), limit, kit_told, settings),
        Part(
            f"repeat-{adapter.name}", f"kit three times, {adapter.name}",
            (*kit, *waivers, *few, "--no-diagnosis", "--repeat", "3", *again, "--json"), limit, repeat_told, settings,
        ),
    ]  # fmt: skip
    if adapter.name != "gsplat_cuda":  # which has no deterministic sums
        words = ("-m", "gsvc_lab.benchmarks.gpu.sums", adapter.module, "--jobs", str(jobs), *draws, "--json")
        found.append(
            Part(
                f"sums-{adapter.name}", f"bytes of deterministic sums, {adapter.name}", words, 120, sums_told, settings
            )
        )
    return found


def _sanitizer(survey: Survey, name: str, planted: bool) -> Part:
    words = ("-m", "gsvc_lab.benchmarks.gpu.sanitized", name, *(("--planted",) if planted else ()), "--json")
    cuda = survey.answers.get("cuda", {})
    missing = "" if "compute_capability" in cuda else "the CUDA adapter does not run on a GPU here"
    if not missing and tool("compute-sanitizer") is None:
        missing = "compute-sanitizer is not there: install the CUDA toolkit"
    what = f"compute-sanitizer, {name}{', a planted race' if planted else ''}, {plural(len(CASES), 'vector')}"
    return Part(
        f"{'planted-' if planted else ''}{name}", what, words, 120, sanitizer_told, survey.variables, missing=missing
    )


def _timing(adapter: Adapter, survey: Survey, cpu: bool) -> list[Part]:
    found = [_speeds(adapter, survey, cpu)]
    return [*found, _codec(adapter, survey, cpu)] if adapter.name == "cuda" else found


def _speeds(adapter: Adapter, survey: Survey, cpu: bool) -> Part:
    words = ("-m", "gsvc_lab.benchmarks.gpu.speeds", adapter.name, *(("--small",) if cpu else ()), "--json")
    settings = _settings(adapter, survey, cpu)
    return Part(
        f"speeds-{adapter.name}", f"speeds on the device, {adapter.name}", words, 45, speeds_told, settings, alone=True
    )


def _codec(adapter: Adapter, survey: Survey, cpu: bool) -> Part:
    words = ("-m", "gsvc_lab.benchmarks.gpu.codec", *(("--small",) if cpu else ()), "--json")
    settings = _settings(adapter, survey, cpu)
    return Part("codec", "speeds from a stream to pictures and back", words, 45, speeds_told, settings, alone=True)


def _operations(survey: Survey, cpu: bool) -> Part:
    """The operations as the kit calls them, of all that runs and of gsvc_ref."""
    modules = ["gsvc_ref", *(adapter.module for adapter in survey.runs)]
    few = ("--work", "adan_step", "--work", "decode_stream_small") if cpu else ()
    words = ("-m", "gsvc_lab.benchmarks.adapters", *modules, *few, "--seconds", "0" if cpu else "0.3", "--json")
    settings = {name: value for adapter in survey.runs for name, value in _settings(adapter, survey, cpu).items()}
    return Part("operations", "speeds of operations, with copies", words, 60, speeds_told, settings, alone=True)
