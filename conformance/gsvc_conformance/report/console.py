"""A run of the suite in lines of text."""

import math
import re
import textwrap
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from gsvc_base.cli.text import plural, table
from gsvc_conformance.causes import MEND, looks_like
from gsvc_conformance.diagnosis import EXAMINED, MAYBE, VAGUE, is_place
from gsvc_conformance.results import FAULTS, REFUSED, Outcome, Result, Table
from gsvc_conformance.spec import complexity
from gsvc_conformance.verdicts import Conclusion, Report, Summary

INDENT: Final = "  "
END_LINES: Final = 3
"""Number of lines of a command's output that are shown from the beginning, and from the end."""
LONGEST: Final = 240
"""Characters of such a line."""
MAX_CAUSES: Final = 3
"""Maximum number of causes that are told of, where there is no room for all."""
FEW: Final = 2
"""Number of examined failures up to which they tell no cause by where they are wrong."""
WAIVED: Final = re.compile(r" \(waived (?:fail|error|crash|timeout): ")
"""What stands after the reason of a waiver in the message of a result."""
MAX_REASON: Final = 120
"""Maximum length of the reason of a waiver."""
RARE: Final = 0.3
"""Minimum fraction of the examined failures of its operations that look like a probable cause."""
MANY: Final = 0.4
"""The same of a cause that is told without a hedge."""
SOME: Final = 3
"""Minimum number of failures that look like a cause that is told, hedged, because there is no other."""
WHERE: Final = "where: "
SURE: Final = "run the whole operation to be sure"
CONCLUSIONS: Final[Mapping[Conclusion, tuple[str, str]]] = {
    "passed": ("passed", ""),
    "failed": ("failed", ""),
    "ended early": ("ended early", ", before all vectors were judged"),
    "nothing judged": ("nothing was judged", ": no vector passed, and none is wrong"),
}


@dataclass(frozen=True)
class Cause:
    """Something that failures look like.

    Attributes
    ----------
    sentence
        What it is.
    results
        The failures, in the order of the report.
    places
        How many of the failures that were examined look like it, by operation: ``loss: 3 of 5 examined``.
    only_where
        Whether it says no more than where errors are: a place, of few failures.
    """

    sentence: str
    results: tuple[Result, ...]
    places: tuple[str, ...]
    only_where: bool = False

    @property
    def text(self) -> str:
        """The sentence, which says of a mere place that it is one."""
        return f"{WHERE}{self.sentence}" if self.only_where else self.sentence


def describe(report: Report, most: int) -> list[str]:
    """The report: tables, a number of failures, their causes, the verdicts of the classes, and where to begin.

    Parameters
    ----------
    report
        The report.
    most
        Maximum number of failures to describe.
    """
    lines = [*runs_on_lines(report), *feature_lines(report), *operation_table(report), ""]
    faults = report.simplest_first()
    for result in faults[:most]:
        lines += [*describe_fault(result, report.again(result.id)), ""]
    if len(faults) > most:
        lines += [f"... and {plural(len(faults) - most, 'more vector')} (--show N, --html FILE, --json FILE)", ""]
    lines += headed(cause_lines(report))
    lines += waived_lines(report, most)
    lines += [f"stale: {sentence}" for sentence in report.stale]
    lines += [f"note: {note}" for note in report.notes]
    lines += refusal_lines(report, most)
    return [*lines, *class_table(report), *begin_lines(report)]


def waived_lines(report: Report, most: int) -> list[str]:
    """How many failures are waived for each reason, and of which operations, at most some number of lines."""
    groups: dict[str, Counter[str]] = {}
    for result in report.results:
        if result.outcome == "waived":
            groups.setdefault(WAIVED.split(result.message, 1)[0], Counter())[result.operation] += 1
    ranked = sorted(groups.items(), key=lambda entry: -entry[1].total())
    lines = [
        f"{counts.total():,} waived: {textwrap.shorten(reason, MAX_REASON, placeholder='...')} "
        f"({', '.join(f'{operation} {count:,}' for operation, count in counts.items())})"
        for reason, counts in ranked[:most]
    ]
    left = sum(counts.total() for _, counts in ranked[most:])
    return [*lines, *[f"{left:,} waived for {plural(len(ranked) - most, 'more reason')}"] * bool(left)]


def begin_lines(report: Report) -> list[str]:
    """An empty line and the command for the simplest failure; nothing if nothing is wrong."""
    return ["", f"begin with: {report.again(first.id)}"] if (first := next(iter(report.simplest_first()), None)) else []


def runs_on_lines(report: Report) -> list[str]:
    """The environment of the implementation, and an empty line; nothing if it does not say."""
    width = max(map(len, report.runs_on), default=0)
    return [*(f"{name.ljust(width)}  {value}" for name, value in report.runs_on.items()), *[""] * bool(report.runs_on)]


def feature_lines(report: Report) -> list[str]:
    """The features that it was judged by, and an empty line; nothing if there are none."""
    return [f"features: {report.features}; {feature_counts(report)}", ""] if report.features else []


def feature_counts(report: Report) -> str:
    """The vectors inside and outside of the features, in words."""
    outside = [result for result in report.results if result.outside]
    inside = len(report.results) - len(outside)
    refused = sum(result.outcome == "unsupported" for result in outside)
    return f"{plural(inside, 'vector')} inside; {len(outside):,} outside, of which {refused:,} unsupported"


def last_line(report: Report) -> str:
    """The conclusion, for those who read nothing else."""
    words, rest = conclusion(report)
    return words.upper() + rest


def conclusion(report: Report) -> tuple[str, str]:
    """The conclusion, and what restricts it, the numbers of waived failures and of vectors not asked too."""
    words, rest = _conclusion(report)
    waived = sum(result.outcome == "waived" for result in report.results)
    rest += f"; {waived:,} waived" if waived else ""
    return words, f"{rest}; {plural(report.not_asked, 'vector')} not asked" if report.not_asked else rest


def _conclusion(report: Report) -> tuple[str, str]:
    if report.claim and report.conclusion != "ended early":
        return f"the claim {'holds' if report.passed else 'does not hold'}", f": {report.claim}"
    if report.stale and not report.faults:
        return "failed", f": {plural(len(report.stale), 'stale waiver')}, take them out"
    if report.conclusion != "incomplete":
        return CONCLUSIONS[report.conclusion]
    words = "its features hold" if report.features_hold else "nothing is wrong"
    verdicts = {group.title: group.verdict for group in report.groups()}
    incomplete = ", ".join(name for name, verdict in verdicts.items() if verdict == "incomplete")
    complete = not {"passed", "waived"}.isdisjoint(verdicts.values())
    return words, f", but incomplete: {incomplete}" if complete else "; no class is complete"


def cause_lines(report: Report, looked: Mapping[str, int] | None = None) -> list[str]:
    """The few causes that most failures look like, the most frequent first, and where; `looked` as below."""
    return [f"{cause.text} ({', '.join(cause.places)})" for cause in probable_causes(report, looked)[:MAX_CAUSES]]


def headed(causes: Iterable[str]) -> list[str]:
    """Lines about causes as the console shows them."""
    return [cause if cause.startswith(WHERE) else f"Probable cause: {cause}" for cause in causes]


def probable_causes(report: Report, looked: Mapping[str, int] | None = None) -> list[Cause]:
    """The causes that many failures look like, the most frequent first; none that others cover; if none, one of few.

    Parameters
    ----------
    report
        The report.
    looked
        The number of failures by operation in which causes were looked for; None: those of one run.
    """
    looked = examined_of(report.results) if looked is None else looked
    like: dict[str, list[Result]] = {}
    for result in report.faults:
        for cause in result.causes:
            like.setdefault(cause, []).append(result)
    explained: set[str] = set()
    causes: list[Cause] = []
    ranked = sorted(like.items(), key=_by_weight)
    ranked.sort(key=lambda entry: is_place(entry[0]) and _few(entry[1], looked))
    for sentence, results in ranked:
        if not _rare(results, looked) and not explained.issuperset(result.id for result in results):
            explained.update(result.id for result in results)
            causes.append(_cause(sentence, results, report, looked))
    if causes:
        return causes
    told = [entry for entry in ranked if len(entry[1]) >= SOME and not is_place(entry[0].removeprefix(MAYBE))]
    return [_cause(sentence, results, report, looked) for sentence, results in told[:1]]


def _cause(sentence: str, results: Sequence[Result], report: Report, looked: Mapping[str, int]) -> Cause:
    counts = Counter(result.operation for result in results)
    examined = sum(looked[operation] for operation in counts)
    few = examined <= FEW
    if _few(results, looked) and not is_place(sentence) and not sentence.endswith(MEND):
        sentence = f"{MAYBE}{sentence}"
    places = tuple(f"{operation}: {count} of {looked[operation]} examined" for operation, count in counts.items())
    if few and not report.whole and sum(result.operation in counts for result in report.results) <= FEW:
        places = (*places[:-1], f"{places[-1]}; {SURE}")
    return Cause(sentence, tuple(results), places, only_where=few and is_place(sentence))


def _few(results: Sequence[Result], looked: Mapping[str, int]) -> bool:
    """Whether few of the examined failures of their operations look like a cause."""
    return len(results) < MANY * sum(looked[name] for name in {result.operation for result in results})


def examined_of(results: Iterable[Result]) -> Counter[str]:
    """The number of failures by operation in which one run looks for causes."""
    faults = [result for result in results if result.outcome in FAULTS]
    failures = Counter(result.operation for result in faults if result.outcome == "fail")
    errors = Counter(result.operation for result in faults if result.outcome != "fail" and result.causes)
    return Counter({name: min(failures[name], EXAMINED) + errors[name] for name in {*failures, *errors}})


def refusal_lines(report: Report, most: int) -> list[str]:
    """Rules and bits that refusals name, by class, and the wrong rules: advice only, since the kind alone is judged.

    Parameters
    ----------
    report
        The report.
    most
        Maximum number of vectors whose rule is wrong to list.
    """
    counts = [f"refusals, class {name}: {rule_counts(refused)} (only the kind is judged)"
              for name, refused in report.refusals().items()]  # fmt: skip
    named = report.advice()
    lines = [f"advice: {result.id} {output.name} {output.advice}" for result, output in named[:most]]
    left = [f"advice: {plural(len(named) - most, 'more vector')} with a wrong rule"] if len(named) > most else []
    return [*counts, *lines, *left]


def rule_counts(refused: Sequence[str]) -> str:
    """The number of refusals whose rule and whose bit are right, in words."""
    rule = sum(what in REFUSED[:2] for what in refused)
    bit = sum(what == REFUSED[0] for what in refused)
    return f"rule right in {rule} of {len(refused)}, bit in {bit} of {len(refused)}"


def _by_weight(entry: tuple[str, list[Result]]) -> tuple[int, int, int]:
    """The rank of a cause: by the number of failures that look like it.

    Sentences about other operations come after causes, and those about mere places last.
    """
    cause, results = entry
    kind = 2 if cause.startswith(VAGUE) else 1 if cause.endswith(MEND) else 0
    return kind, -len(results), min(complexity(result.operation) for result in results)


def _rare(results: Sequence[Result], looked: Mapping[str, int]) -> bool:
    """Whether too few of the examined failures look like this for a probable cause."""
    examined = sum(looked[operation] for operation in {result.operation for result in results})
    return len(results) < RARE * examined or len(results) < min(2, examined - 1)


def operation_table(report: Report) -> list[str]:
    """Counts and the worst ratio of each operation."""
    answered, unsupported = folded(report.operations())
    rows = [_cells(summary) for summary in answered]
    lines = (
        table(["operation", "vectors", "pass", "wrong", "unsupported", "excused", "worst error/bound"], rows)
        if rows
        else []
    )
    return [*lines, unsupported] if unsupported else lines


def folded(operations: Sequence[Summary]) -> tuple[list[Summary], str]:
    """The operations of which anything is not unsupported, and a line about the others."""
    answered = [operation for operation in operations if operation.counts.get("unsupported", 0) < operation.total]
    others = [operation for operation in operations if operation not in answered]
    vectors = plural(sum(operation.total for operation in others), "vector")
    return answered, f"{plural(len(others), 'operation')}: unsupported ({vectors})" if others else ""


def class_table(report: Report) -> list[str]:
    """The verdict of each class."""
    groups = report.groups()
    width = max((len(group.title) for group in groups), default=0)
    lines = [f"class {group.title.ljust(width)}  {group.verdict}: {group.reason}" for group in groups]
    quotes = report.quotes()
    return [
        *lines, *[f"of {report.selection} only"] * bool(report.selection), *[""] * bool(quotes), *quotes
    ]  # fmt: skip


def _cells(summary: Summary) -> list[str]:
    count = summary.counts
    numbers = (summary.total, count.get("pass", 0), summary.faults, count.get("unsupported", 0), summary.excused)
    return [summary.name, *(str(number) for number in numbers), ratio_text(summary.ratio)]


def describe_fault(result: Result, command: str) -> list[str]:
    """One wrong vector: its errors, what they look like, and the command that runs it again."""
    return [*result_lines(result), f"{INDENT}again: {command}"]


def result_lines(result: Result) -> list[str]:
    """One wrong vector: its errors, and what they look like."""
    lines = [f"{result.outcome.upper()} {result.id}: {result.title}", f"{INDENT}{result.message}"]
    return [*lines, *(f"{INDENT}{looks_like(cause)}" for cause in result.causes), *detail_lines(result)]


def detail_lines(result: Result) -> list[str]:
    """The table of a wrong vector, and what a process printed."""
    lines = [f"{INDENT}{line}" for line in table_lines(result.table)]
    return [*lines, *(f"{INDENT}| {line}" for line in ends(result.log))]


def table_lines(shown: Table | None) -> list[str]:
    """A table of ratios; nothing if there is none."""
    if shown is None:
        return []
    return [f"{shown.title}:", *table(["", *shown.columns], [list(row) for row in shown.rows])]


def ends(log: str) -> list[str]:
    """The first and the last lines of what a command printed, none of them endless."""
    lines = [line if len(line) <= LONGEST else f"{line[:LONGEST]}..." for line in log.splitlines() if line.strip()]
    return lines if len(lines) <= 2 * END_LINES else [*lines[:END_LINES], "...", *lines[-END_LINES:]]


def ratio_text(ratio: float | None) -> str:
    """An error/bound ratio in three digits."""
    if ratio is None:
        return ""
    return f"{ratio:.3g}" if math.isfinite(ratio) else "infinite"


def progress_text(operation: str, count: Counter[Outcome]) -> str:
    """The progress line's words about the operation that runs, from its vectors by outcome."""
    wrong = sum(count[outcome] for outcome in FAULTS)
    parts = [f"{count['pass']} pass", f"{wrong} wrong" if wrong else "", plural_unsupported(count["unsupported"])]
    return f"{operation}: {', '.join(part for part in parts if part)}"


def plural_unsupported(count: int) -> str:
    """The number of unsupported vectors in words, or nothing."""
    return f"{count} unsupported" if count else ""
