"""Golden vectors as tests of pytest: an item each, waivers as strict xfail, causes and verdicts in the summary.

Where pytest-xdist shares the vectors among processes, each process looks for causes among the vectors that it ran, and
sends them with its results when it ends.
"""

import json
import math
import shlex
import time
from collections import Counter
from collections.abc import Generator, Iterable
from pathlib import Path
from typing import Any, Final, NamedTuple, get_args

import pytest

from gsvc_base.cli.errors import describe_os_error
from gsvc_base.cli.text import plural
from gsvc_base.errors import UsageError
from gsvc_base.rendering.error_models import FP32
from gsvc_conformance.causes import Causes, Search, added
from gsvc_conformance.claim import read_model
from gsvc_conformance.commands import wanted_set
from gsvc_conformance.commands.judging import environment, model_notes
from gsvc_conformance.features import read_features
from gsvc_conformance.implementations import Implementation, load_module
from gsvc_conformance.operation import Group, checked_operations, operations
from gsvc_conformance.process import ProcessImplementation
from gsvc_conformance.pytest_plugin import JUDGED, NODE, is_vector
from gsvc_conformance.report.console import INDENT, cause_lines, detail_lines, examined_of, headed
from gsvc_conformance.report.json import result_from, result_object
from gsvc_conformance.results import FAULTS, NOT_ASKED, OUTCOMES, Result, difficulty
from gsvc_conformance.runner import excused, judge_vector
from gsvc_conformance.server import ServerImplementation
from gsvc_conformance.spelling import question
from gsvc_conformance.vector import VECTORS
from gsvc_conformance.vector_folder import ALL_TIERS, Selection, VectorFolder
from gsvc_conformance.verdicts import Report
from gsvc_conformance.waivers import read_waivers

SUITE: Final = NODE.rstrip(":")
TIMEOUT: Final = 60.0
SENT: Final = "gsvc"
"""The name of what a process of pytest-xdist sends when it ends."""
NOT_CLAIMED: Final = "not claimed"
NO_FUNCTION: Final = "has no function"
HOW: Final = ("timeout", "features", "model", "set", "vectors")
"""The options that say how a vector is judged, whichever it is."""
MARKER: Final = "gsvc: golden vectors of GSVC (--gsvc-module, --gsvc-impl, --gsvc-serve)"


def configure(config: pytest.Config) -> None:
    """Add the vectors to a session, unless its command line names other tests only.

    An option on a command line without paths asks for the vectors alone: no other test is collected.

    Raises
    ------
    pytest.UsageError
        Options are missing or wrong.
    """
    wanted = [argument.partition(NODE)[2] for argument in config.args if is_vector(argument)]
    typed = any(str(word).startswith("--gsvc-") for word in config.invocation_params.args)
    named = config.args_source == pytest.Config.ArgsSource.ARGS
    if named and not wanted and not typed:  # options of the configuration file give way to paths
        return
    others = [argument for argument in config.args if not is_vector(argument)]
    config.args = others if named or not typed else []
    try:
        run = Run(config, tuple(filter(None, wanted)))
    except UsageError as error:
        raise pytest.UsageError(str(error)) from None
    except OSError as error:
        raise pytest.UsageError(describe_os_error(error)) from None
    config.addinivalue_line("markers", MARKER)
    config.pluginmanager.register(Session(run), "gsvc-vectors")


class Run:
    """The vectors of a session and what became of them in this process.

    Parameters
    ----------
    config
        With the options.
    wanted
        Ids or globs of vectors that are named as tests are; they take the place of other selections.

    Raises
    ------
    UsageError
        Options are missing or wrong.
    """

    def __init__(self, config: pytest.Config, wanted: tuple[str, ...]) -> None:
        def option(name: str) -> Any:
            return config.getoption(f"--gsvc-{name}")

        self._folder = VectorFolder(Path(option("vectors") or VECTORS), wanted_set(option("set") or "newest"))
        self.selection = _selection(option, wanted)
        self._folder.check_patterns("--gsvc-case " if not wanted else NODE, self.selection.patterns)
        self._seconds = _seconds(option, "seconds", math.inf)
        self._end: float | None = None
        chosen = self._folder.select(self.selection)
        limited = math.isfinite(self._seconds)
        self.names = sorted(chosen, key=self._folder.work) if limited else simplest_vectors_first(self._folder, chosen)
        self._file = option("waivers")
        self._waivers = read_waivers(Path(self._file) if self._file else None)
        if unmatched := self._waivers.unmatched(self._folder.names):
            raise UsageError(f"{self._file}: {unmatched[0]}")
        self._waived = self._waivers.among(self._folder.names).counting
        self._model = read_model(option("model") or FP32.name)
        self._features = read_features(Path(option("features"))) if option("features") else None
        self.implementation = _implementation(option, config.rootpath)
        # In one word each: pytest takes a word that is a file or folder for a path to tests.
        self._words = [f"--gsvc-{name}={option(name)}" for name in (*JUDGED, *HOW) if option(name)]
        self.results: dict[str, Result] = {}
        self._causes = Causes()

    def end(self) -> None:
        """End what was started for all vectors."""
        if isinstance(self.implementation, ServerImplementation):
            self.implementation.__exit__(None, None, None)

    def unanswered(self, name: str) -> str:
        """The reason why a vector needs not be read: its operation has no function, or the time is used; else empty."""
        self._end = self._end or time.monotonic() + self._seconds
        if time.monotonic() >= self._end:
            return NOT_ASKED
        functions = getattr(self.implementation, "functions", None)
        operation = name.split("/")[1]
        if self._features or functions is None or callable(functions.get(operation)):
            return ""
        return f"{self.implementation.name} {NO_FUNCTION} {operation}"

    def judged(self, name: str) -> Result:
        """Ask for a vector's outputs and judge them; with its waiver, if one counts."""
        (vector,) = self._folder.read([name])
        judged = judge_vector(self.implementation, vector.by_model(self._model), self._features)
        if (waiver := self._waived.get(name)) and judged.result.outcome in FAULTS:
            judged = excused(judged, waiver.excuse)
        self._causes.add(judged)
        self.results[name] = judged.result
        return judged.result

    def skipped(self, name: str, reason: str) -> None:
        """Note a vector that is not asked for."""
        group = operations()[name.split("/")[1]].group
        self.results[name] = Result(name, "", group, "skipped" if reason == NOT_ASKED else "unsupported", reason)

    def stale(self, name: str) -> str:
        """A sentence about a waiver that is not needed: its vector passes; else empty."""
        waiver = self._waived.get(name)
        return f"it passes, so take it out of {waiver} in {self._file}" if waiver else ""

    def ended(self, name: str) -> str:
        """A sentence about a vector's waiver that counts no more; else empty."""
        return self._waivers.ended(name)

    def again(self, name: str) -> str:
        """The command that runs one vector alone."""
        waivers = [f"--gsvc-waivers={self._file}"] if self._file else []
        return shlex.join(["pytest", *self._words, *waivers, f"{NODE}{name}"])

    def pictures(self) -> str:
        """The command of the kit that writes a page about the same vectors."""
        words = [f"--{word.removeprefix('--gsvc-')}" for word in self._words]
        chosen = {
            "operation": self.selection.operations,
            "class": self.selection.groups,
            "case": self.selection.patterns,
        }
        words += [f"--{name}={value}" for name, values in chosen.items() for value in values]
        return shlex.join(["gsvc-conformance", "run", *words, "--html", "page.html"])

    def found(self) -> "Found":
        """What this process found."""
        results, _ = self._causes.find(self.results.values())
        return Found(results, self._causes.searches, self._causes.faults)

    def report(self, results: Iterable[Result], notes: list[str]) -> Report:
        """The report of a session."""
        by_id = {result.id: result for result in results}
        there = [by_id[name] for name in self.names if name in by_id]
        return Report(
            environment(self.implementation.name, self._folder), "", str(self.selection),
            [*model_notes(self._model), *notes], there,
            self.implementation.environment, whole=self.selection.whole and len(there) == len(self.names),
            features=self._features, model=self._model.name,
        )  # fmt: skip


class Found(NamedTuple):
    """What one process found: results with their causes, how the searches went, and sentences about failed ones."""

    results: list[Result]
    searches: list[Search]
    faults: list[str]

    def to_text(self) -> str:
        """It as JSON."""
        results = [result_object(result) for result in self.results]
        return json.dumps({"results": results, "searches": self.searches, "faults": self.faults})


def found_from(text: str, sender: str) -> Found:
    """What `Found.to_text` made in a process."""
    value = json.loads(text)
    results = [result_from(result, f"a result of {sender}") for result in value["results"]]
    return Found(results, [Search(*search) for search in value["searches"]], value["faults"])


def simplest_vectors_first(folder: VectorFolder, names: Iterable[str]) -> list[str]:
    """Vectors from the simple to the hard: leaf operations first, core tiers, small inputs; operations stay together.

    With ``-x`` the first failure is then the one to begin with.
    """
    place = {operation: number for number, operation in enumerate(operations())}

    def rank(name: str) -> tuple[object, ...]:
        tier, operation, _ = name.split("/")
        return difficulty(operation), place[operation], ALL_TIERS.index(tier), folder.input_size(name), name

    return sorted(names, key=rank)


def _selection(option: Any, wanted: tuple[str, ...]) -> Selection:
    """The vectors that the options choose, or those that are named as tests."""
    for name in option("class") or ():
        if name not in get_args(Group):
            near = question(name, get_args(Group)) or f"; the classes are {', '.join(get_args(Group))}"
            raise UsageError(f"there is no class {name!r}{near}")
    chosen = checked_operations(option("operation") or ())
    if wanted:
        return Selection(patterns=wanted)
    return Selection(operations=chosen, groups=tuple(option("class") or ()), patterns=tuple(option("case") or ()))


def _implementation(option: Any, home: Path) -> Implementation:
    given = [name for name in JUDGED if option(name)]
    if len(given) != 1:
        what = " or ".join(f"--gsvc-{name}" for name in JUDGED)
        raise UsageError(f"say what golden vectors judge: {'only one of ' if given else ''}{what}")
    if option("impl"):
        return ProcessImplementation(option("impl"), _seconds(option, "timeout", TIMEOUT))
    if option("serve"):
        return ServerImplementation(option("serve"), _seconds(option, "timeout", TIMEOUT))
    if option("timeout"):
        raise UsageError("--gsvc-timeout needs --gsvc-impl or --gsvc-serve: a module cannot be stopped")
    return load_module(option("module"), home)


def _seconds(option: Any, name: str, default: float) -> float:
    if (text := option(name)) is None:
        return default
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    if not 0 < seconds < math.inf:
        raise UsageError(f"--gsvc-{name} takes a number of seconds, not {text}")
    return seconds


class WrongVector(Exception):  # noqa: N818
    """A vector is wrong, or its waiver is not needed.

    Attributes
    ----------
    lines
        What is shown.
    message
        The same in a line.
    """

    def __init__(self, lines: list[str], message: str) -> None:
        super().__init__(message)
        self.lines = lines
        self.message = message


class VectorItem(pytest.Item):
    """A vector as a test."""

    def __init__(self, *, run: Run, **given: Any) -> None:
        super().__init__(**given)
        self._run = run
        self.add_marker(SUITE)

    def runtest(self) -> None:
        """Judge the vector.

        Raises
        ------
        WrongVector
            It is wrong, or passes although it is waived.
        """
        if reason := self._run.unanswered(self.name):
            self._run.skipped(self.name, reason)
            pytest.skip(reason)
        result = self._run.judged(self.name)
        if result.outcome == "unsupported":
            pytest.skip(result.message)
        if result.outcome == "waived":
            pytest.xfail(result.message)
        again = f"{INDENT}again: {self._run.again(self.name)}"
        if result.passed and (stale := self._run.stale(self.name)):
            raise WrongVector([result.title, f"{INDENT}{stale}", again], stale)
        if not result.passed:
            ended = self._run.ended(self.name)
            kind = "" if result.outcome == "fail" else f"{result.outcome}: "
            lines = [result.title, f"{INDENT}{kind}{result.message}", *detail_lines(result)]
            raise WrongVector([*lines, *[f"{INDENT}{ended}"] * bool(ended), again], f"{kind}{result.message}")

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """The kit's own message in the place of a traceback."""
        error = excinfo.value
        if not isinstance(error, WrongVector | UsageError):
            return super().repr_failure(excinfo, style)
        lines, message = (error.lines, error.message) if isinstance(error, WrongVector) else ([str(error)], str(error))
        text = "\n".join(lines) + "\n"
        if self.config.getoption("fulltrace"):
            return text
        shown: Any = super().repr_failure(excinfo, "native")  # its form is kept, so that pytest-xdist can send it
        shown.reprtraceback.reprentries[0].lines = [text]
        shown.reprcrash.message = message
        return shown

    def reportinfo(self) -> tuple[Path, int, str]:
        """Where reports say that the test is: in no file."""
        return self.config.rootpath / SUITE, 0, self.name


class VectorSuite(pytest.Collector):
    """All vectors of a session."""

    def __init__(self, *, run: Run, **given: Any) -> None:
        super().__init__(**given)
        self._run = run

    def collect(self) -> Iterable[VectorItem]:
        """A test for each vector."""
        return [VectorItem.from_parent(self, name=name, run=self._run) for name in self._run.names]


class Session:
    """The hooks of a session with vectors."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self._sent: list[Found] = []
        self._lost = False

    def pytest_report_header(self) -> str:
        """What is judged, by which vectors, and on what."""
        run = self._run
        runs_on = (f"{name}: {value}" for name, value in run.implementation.environment.items())
        chosen = plural(len(run.names), "vector") + (f" ({run.selection})" if str(run.selection) else "")
        return ", ".join([f"gsvc: {run.implementation.name} by {chosen}", *runs_on])

    @pytest.hookimpl(wrapper=True)
    def pytest_make_collect_report(
        self, collector: pytest.Collector
    ) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
        """Collect the vectors after all else."""
        report = yield
        if isinstance(collector, pytest.Session) and report.passed:
            suite = VectorSuite.from_parent(collector, name=SUITE, nodeid=SUITE, run=self._run)
            report.result = [*report.result, suite]
        return report

    def pytest_report_teststatus(self, report: pytest.TestReport) -> tuple[str, str, str] | None:
        """Count what is not asked for as skipped, without filling the screen with its letters."""
        reason = report.longrepr[2] if report.skipped and isinstance(report.longrepr, tuple) else ""
        silent = report.nodeid.startswith(NODE) and (NO_FUNCTION in reason or NOT_ASKED in reason)
        return ("skipped", "", "SKIPPED") if silent else None

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """End a server, and send the results, in a process of pytest-xdist."""
        self._run.end()
        sent = getattr(session.config, "workeroutput", None)
        if sent is not None:
            sent[SENT] = self._run.found().to_text()

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        """Receive the results of a process."""
        text = getattr(node, "workeroutput", {}).get(SENT)
        if text is None:
            self._lost = True
        else:
            self._sent.append(found_from(text, node.gateway.id))

    def pytest_terminal_summary(self, terminalreporter: "pytest.TerminalReporter") -> None:
        """Probable causes and verdicts."""
        parts = [*self._sent, self._run.found()]
        results = [result for part in parts for result in part.results]
        if not results:
            return
        notes = [note for search in added(s for part in parts for s in part.searches) for note in search.notes()]
        notes += dict.fromkeys(fault for part in parts for fault in part.faults)
        if self._lost:
            notes.append("a process crashed, and what it found is missing here")
        report = self._run.report(results, notes)
        looked: Counter[str] = sum((examined_of(part.results) for part in parts), Counter())
        terminalreporter.section(f"{report.vectors}: {self._run.implementation.name}")
        for line in _summary(report, looked, self._run):
            terminalreporter.write_line(line)


def _summary(report: Report, looked: Counter[str], run: Run) -> list[str]:
    """The lines of the summary: where to begin, causes, verdicts."""
    lines = headed(cause_lines(report, looked))
    lines += [f"note: {note}" for note in report.notes]
    stale = sum(result.passed and bool(run.stale(result.id)) for result in report.results)
    with_stale = f"with a stale waiver: take {'it' if stale == 1 else 'them'} out"
    if report.whole and not report.not_asked:
        lines += _verdicts(report)
        passing = "vector passes" if stale == 1 else "vectors pass"
        lines += [f"{stale:,} {passing} {with_stale}"] * bool(stale)
    else:
        counts = Counter(result.outcome for result in report.results)
        words = {outcome: f"{counts[outcome]} {outcome}" for outcome in OUTCOMES if counts[outcome]}
        if stale:
            words["pass"] += f" ({stale:,} of them {with_stale})"
        said, ran = ", ".join(words.values()), len(report.results) - report.not_asked
        lines.append(f"{ran:,} of {plural(len(run.names), 'vector')} ran: {said}; a verdict needs all "
                     "vectors of a class")  # fmt: skip
    if len(report.faults) > 1:
        lines.append(f"Begin with the simplest: {run.again(report.simplest_first()[0].id)}")
    if any(result.outcome == "fail" for result in report.faults):
        lines.append(f"Pictures and tables: {run.pictures()}")
    return lines


def _verdicts(report: Report) -> list[str]:
    """The verdict of each class of which anything was answered, and the words that can be quoted."""
    groups = report.groups()
    lines = [f"class {group.title} {group.verdict}: {group.reason}" for group in groups if group.verdict != NOT_CLAIMED]
    silent = [group.title for group in groups if group.verdict == NOT_CLAIMED]
    lines += [f"{NOT_CLAIMED}: {', '.join(silent)}"] * bool(silent)
    return [*lines, *report.quotes()]
