"""The parts of the command: what each runs, for how long at most, and how its result is read."""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from gsvc_base.cli.text import plural
from gsvc_base.errors import UsageError
from gsvc_conformance.report.json import read
from gsvc_conformance.verdicts import Report
from tests.gpu.outcome import State
from tests.gpu.sanitized import CASES
from tests.gpu.survey import PATIENCE, Adapter, Survey, tool

Told = tuple[State, str]
"""What became of a part, and a sentence about it."""
Read = Callable[[Path, dict[str, Any]], Told]
"""A function from the file of a result and its values to what they tell."""

SHORT_PATIENCE: Final = 50
LONG_PATIENCE: Final = 150
"""Seconds for a part, beside `survey.PATIENCE`: what measures time, and what is slow."""

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
    of = f"{len(values.get('pictures', ()))} pictures and streams and {values.get('draws', 0):,} random draws"
    return state, f"{sum(differing.values()):,} bytes differ{first}, of {of}"


def sanitizer_told(path: Path, values: dict[str, Any]) -> Told:
    """The number of reports of compute-sanitizer."""
    return ("wrong" if values.get("wrong") else "right"), plural(int(values.get("reports", 0)), "report")


def speeds_told(path: Path, values: dict[str, Any]) -> Told:
    """How many works were measured."""
    measured = list(values.get("implementations", ()))
    count = sum(len(one["seconds"]) for one in measured)
    missing = [
        f"{one['implementation'].rpartition('.')[2]}, {work}: {reason}"
        for one in measured
        for work, reason in one.get("missing", {}).items()
    ]
    state: State = "measured" if values.get("whole", True) and count else "failed"
    return state, "; ".join([plural(count, "work"), *missing[:2]])


def compiled_told(path: Path, values: dict[str, Any]) -> Told:
    """Nothing but that it ended: what it measured is of no use, since others ran beside it."""
    return "right", "compiled"


@dataclass(frozen=True)
class Plan:
    """The parts for what runs on a machine.

    `folder` is where the kit's pages go, and digests that this run makes itself; with `cpu` processors play the GPU, on
    little.
    """

    survey: Survey
    folder: Path
    cpu: bool

    def parts(self) -> list[Part]:
        """All parts, in the order of their start."""
        runs = self.survey.runs
        judging = [part for adapter in runs for part in (self.kit(adapter), self.repeated_kit(adapter))]
        judging += [self.sums(adapter) for adapter in runs if adapter.draws]
        judging += [self.sanitizer("racecheck"), self.sanitizer("memcheck"), self.sanitizer("racecheck", planted=True)]
        judging += [] if self.cpu else self.compiling()
        timing = [self.speeds(adapter) for adapter in runs]
        if any(adapter.name == "cuda" for adapter in runs):
            timing.insert(1, self.codec())
        return [*sorted(judging, key=lambda part: -part.limit), *timing, self.operations()]  # the slowest first

    def settings(self, *adapters: Adapter) -> dict[str, str]:
        """The environment variables of adapters."""
        own = [adapter.on_processor if self.cpu else adapter.settings for adapter in adapters]
        return {**self.survey.variables, **{name: value for settings in own for name, value in settings.items()}}

    def kit(self, adapter: Adapter, *further: str, name: str = "", what: str = "kit", told: Read = kit_told) -> Part:
        """A run of the kit."""
        words = ["-m", "gsvc_conformance", "run", "--module", adapter.module, "--quiet", "--show", "3"]
        words += ["--waivers", str(WAIVERS)] if adapter.name == "gsplat_cuda" else []
        words += [word for case in FEW_CASES for word in ("--case", case)] if self.cpu else []
        words += further or ["--html", str(self.folder / f"{adapter.name}.html")]
        limit = adapter.patience
        return Part(
            name or adapter.name, f"{what}, {adapter.name}", (*words, "--json"), limit, told, self.settings(adapter)
        )

    def repeated_kit(self, adapter: Adapter) -> Part:
        """The kit three times on operations whose answers a race may change."""
        words = ["--no-diagnosis", "--repeat", "3"]
        words += [word for operation in REPEATED for word in ("--operation", operation)]
        return self.kit(adapter, *words, name=f"repeat-{adapter.name}", what="kit three times", told=repeat_told)

    def sums(self, adapter: Adapter) -> Part:
        """The comparison of deterministic sums."""
        words = ["-m", "tests.gpu.sums", adapter.module]
        if self.cpu:
            words += ["--small", "--draws", "100", "--golden", str(self.folder / "golden.json")]
        else:
            words += ["--draws", str(adapter.draws), "--jobs", str(min(4, self.survey.width))]
        what, limit = f"bytes of deterministic sums, {adapter.name}", adapter.patience
        return Part(f"sums-{adapter.name}", what, (*words, "--json"), limit, sums_told, self.settings(adapter))

    def sanitizer(self, name: str, *, planted: bool = False) -> Part:
        """The kernels under a tool of compute-sanitizer."""
        words = ("-m", "tests.gpu.sanitized", name, *(("--planted",) if planted else ()), "--json")
        missing = "" if tool("compute-sanitizer") else "compute-sanitizer is not there: install the CUDA toolkit"
        if "compute_capability" not in self.survey.answers.get("cuda", {}):
            missing = "the CUDA adapter does not run on a GPU here"
        what = f"compute-sanitizer, {name}{', a planted race' if planted else ''}, {plural(len(CASES), 'vector')}"
        name = f"{'planted-' if planted else ''}{name}"
        return Part(name, what, words, PATIENCE, sanitizer_told, self.survey.variables, missing=missing)

    def compiling(self) -> list[Part]:
        """What gsvc_ref compiles once and keeps, so that no part that measures time has to wait for it."""
        works = ("-m", "gsvc_lab.benchmarks.adapters", "gsvc_ref", "--seconds", "0", "--json")
        ways = ("-m", "tests.gpu.codec", "--small", "--processor", "--json")
        return [
            Part("compile-operations", "operations of gsvc_ref, compiled", works, LONG_PATIENCE, compiled_told),
            Part("compile-codec", "encoder of gsvc_ref, compiled", ways, LONG_PATIENCE, compiled_told),
        ]

    def speeds(self, adapter: Adapter) -> Part:
        """Pictures and evaluations on the device."""
        words = ("-m", "tests.gpu.speeds", adapter.name, *(("--small",) if self.cpu else ()), "--json")
        return self._timed(f"speeds-{adapter.name}", f"speeds on the device, {adapter.name}", words, adapter)

    def codec(self) -> Part:
        """Whole ways by CUDA."""
        words = ("-m", "tests.gpu.codec", *(("--small",) if self.cpu else ()), "--json")
        return self._timed("codec", "speeds from a stream to pictures and back", words, *self.survey.runs)

    def operations(self) -> Part:
        """The operations as the kit calls them, of all that runs and of gsvc_ref."""
        words = ["-m", "gsvc_lab.benchmarks.adapters", "gsvc_ref", *(adapter.module for adapter in self.survey.runs)]
        words += ["--work", "adan_step", "--work", "decode_stream_small"] if self.cpu else []
        words += ["--seconds", "0" if self.cpu else "0.1", "--json"]
        return self._timed("operations", "speeds of operations, with copies", tuple(words), *self.survey.runs)

    def _timed(self, name: str, what: str, words: tuple[str, ...], *adapters: Adapter) -> Part:
        limit = LONG_PATIENCE if self.cpu else SHORT_PATIENCE  # gsvc_ref may have to be compiled
        return Part(name, what, words, limit, speeds_told, self.settings(*adapters), alone=True)
