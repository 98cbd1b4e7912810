"""Several reports beside each other, in Markdown: what was judged where, classes, operations, and speeds."""

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, get_args

from gsvc_base.errors import UsageError
from gsvc_conformance.operation import Group, operations
from gsvc_conformance.profiles import PROFILES
from gsvc_conformance.reading import read_json
from gsvc_conformance.report.console import conclusion, ratio_text
from gsvc_conformance.schema import (
    LIST,
    NAMED_TEXTS,
    NEEDED,
    NUMBER,
    OBJECT,
    TEXT,
    TEXTS,
    Kind,
    Schema,
    checked,
    cut,
)
from gsvc_conformance.verdicts import Report, Summary

SPEEDS: Final = "speeds/1"
"""The form of the file that ``python -m gsvc_lab.benchmarks.adapters`` writes."""
SPEEDS_FIELDS: Final[Schema] = {
    "form": (Kind(SPEEDS, lambda value: value == SPEEDS), NEEDED),
    "date": (TEXT, NEEDED), "machine": (OBJECT, NEEDED), "works": (NAMED_TEXTS, NEEDED),
    "implementations": (LIST, NEEDED), "rates": (TEXTS, []),
}  # fmt: skip
MEASURED: Final[Schema] = {
    "implementation": (TEXT, NEEDED), "settings": (OBJECT, NEEDED), "environment": (NAMED_TEXTS, NEEDED),
    "seconds": (OBJECT, NEEDED),
}  # fmt: skip
"""The fields of that file that are read, and those of each implementation in it."""
ALIKE: Final = ("vectors", "spec.md", "kit")
"""Entries of the environment that all reports of a comparison should share."""
CARD: Final = "card"
"""What the machine of speeds names that were measured on a GPU."""
NOTHING, NOT_CLAIMED = "–", "not claimed"


@dataclass(frozen=True)
class Entry:
    """A report that is compared with others.

    Attributes
    ----------
    name
        The name of its column.
    report
        The report.
    links
        Links to its files, by their text.
    """

    name: str
    report: Report
    links: Mapping[str, str] = field(default_factory=dict)


def comparison(entries: Sequence[Entry], speeds: Sequence[Mapping[str, Any]] = ()) -> str:
    """The tables, an implementation a column.

    Parameters
    ----------
    entries
        In the order of the columns.
    speeds
        Results of `read_speeds`, each of which makes a table. What one with a card has of an implementation that names
        a device stands in no table without a card.
    """
    parts = [_implementations(entries), *_notes(entries), _classes(entries), _operations(entries)]
    on_cards = {
        one["implementation"]
        for machine in speeds
        for one in machine["implementations"]
        if CARD in machine["machine"] and "device" in one["environment"]
    }
    for machine in speeds:
        parts += _speeds(entries, machine, set() if CARD in machine["machine"] else on_cards)
    return "\n\n".join(parts)


def read_speeds(path: Path) -> dict[str, Any]:
    """The file of ``python -m gsvc_lab.benchmarks.adapters``.

    Raises
    ------
    UsageError
        It is something else.
    """
    value = read_json(path)
    try:
        found = checked(value, SPEEDS_FIELDS, "the file")
        found["implementations"] = [checked(one, MEASURED, "an implementation") for one in found["implementations"]]
        for one in found["implementations"]:
            for work, times in one["seconds"].items():
                one["seconds"][work] = checked(times, {"median": (NUMBER, NEEDED)}, cut(work))
    except UsageError as error:
        writes = "that `python -m gsvc_lab.benchmarks.adapters` writes"
        raise UsageError(f"{path} has not the form {SPEEDS} {writes}: {error}") from None
    return found


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', '&#124;') for cell in line)} |" for line in lines)


def _implementations(entries: Sequence[Entry]) -> str:
    rows = []
    for entry in entries:
        where = [
            *(f"{name}: {value}" for name, value in entry.report.runs_on.items()),
            entry.report.environment.get("platform", ""),
        ]
        links = ", ".join(f"[{text}]({target})" for text, target in entry.links.items())
        date = entry.report.environment.get("date", "").partition("T")[0]
        rows.append([entry.name, "".join(conclusion(entry.report)), "<br>".join(filter(None, where)), date, links])
    return table(["implementation", "conclusion", "on", "date", "report"], rows)


def _notes(entries: Sequence[Entry]) -> Iterable[str]:
    """The differences that keep the reports from being compared."""
    for name in ALIKE:
        values: dict[str, list[str]] = {}
        for entry in entries:
            values.setdefault(entry.report.environment.get(name, "unknown"), []).append(entry.name)
        if len(values) > 1:
            parts = (f"{value[:16]} of {', '.join(names)}" for value, names in values.items())
            yield f"**Not the same {name}**: {'; '.join(parts)}."
    for entry in entries:
        if entry.report.selection:
            yield f"**{entry.name}** was judged in part: {entry.report.selection}."
        if entry.report.claim:
            yield f"**{entry.name}** was judged by its claim: {entry.report.claim}."


def _classes(entries: Sequence[Entry]) -> str:
    verdicts = [{group.title: _verdict(group) for group in entry.report.groups()} for entry in entries]
    names: list[str] = []
    for name in get_args(Group):
        titles = [f"{name}, profile {profile}" for profile in PROFILES]
        split = [title for title in titles if any(title in verdict for verdict in verdicts)]
        for verdict in verdicts:
            if split and verdict.get(name) == NOT_CLAIMED:  # neither in one profile nor in the other
                del verdict[name]
                verdict.update(dict.fromkeys(split, NOT_CLAIMED))
        names += [title for title in (name, *split) if any(title in verdict for verdict in verdicts)]
    rows = [[name, *(verdict.get(name, NOTHING) for verdict in verdicts)] for name in names]
    return table(["class", *(entry.name for entry in entries)], rows)


def _verdict(group: Summary) -> str:
    """The verdict of a class, and the level that it passes at."""
    return f"{group.verdict}, level {group.level}" if group.level else str(group.verdict)


def _operations(entries: Sequence[Entry]) -> str:
    summaries = [{summary.name: summary for summary in entry.report.operations()} for entry in entries]
    ratios = [core_ratios(entry.report) for entry in entries]
    names = [name for name in operations() if any(name in summary for summary in summaries)]
    columns = list(zip(summaries, ratios, strict=True))
    rows = [
        [f"`{name}`", *(operation_cell(summary.get(name), core.get(name)) for summary, core in columns)]
        for name in names
    ]
    return table(["operation", *(entry.name for entry in entries)], rows)


def core_ratios(report: Report) -> dict[str, float]:
    """The worst error/bound ratio of the core vectors of each operation that has any."""
    worst: dict[str, float] = {}
    for result in report.results:
        if result.tier == "core" and result.ratio is not None:
            worst[result.operation] = max(result.ratio, worst.get(result.operation, 0.0))
    return worst


def operation_cell(summary: Summary | None, core: float | None) -> str:
    """``82/82 (0.113; 1)``: what passes of how many vectors, what becomes of the others, the worst error/bound ratios.

    The first ratio is that of core vectors, the second that of all, if it is another: where a stress vector has a pixel
    on the very edge of a splat, both decisions are right and one of them has a ratio of nearly 1.
    """
    if summary is None or summary.counts.get("unsupported", 0) == summary.total:
        return NOTHING
    parts = [f"{summary.counts.get('pass', 0)}/{summary.total}"]
    parts += [f"**{summary.faults} wrong**"] * bool(summary.faults)
    parts += [
        f"{count} {name}" for name in ("waived", "skipped", "unsupported") if (count := summary.counts.get(name, 0))
    ]
    ratios = dict.fromkeys(ratio_text(ratio) for ratio in (core, summary.ratio) if ratio is not None)
    return ", ".join(parts) + (f" ({'; '.join(ratios)})" if ratios else "")


def _speeds(entries: Sequence[Entry], speeds: Mapping[str, Any], elsewhere: Container[str]) -> Iterable[str]:
    """The medians of what was measured, but of those `elsewhere`; columns of reports come first and in their order."""
    measured = [one for one in speeds["implementations"] if one["implementation"] not in elsewhere]
    columns = []
    for entry in entries:
        if (found := _measured(entry.report, measured)) is not None:
            measured.remove(found)
            columns.append((entry.name, found))
    columns += [(_name(other), other) for other in measured]
    machine = "; ".join(f"{name}: {value}" for name, value in speeds["machine"].items())
    unit = "Milliseconds, or frames per second (/s)" if speeds["rates"] else "Milliseconds"
    yield f"{unit}, medians, measured on {speeds['date']} ({machine}):"
    rows = [
        [sentence, *(_time_text(found, work, work in speeds["rates"]) for _, found in columns)]
        for work, sentence in speeds["works"].items()
    ]
    on = ["<br>".join(f"{key}: {text}" for key, text in found["environment"].items()) for _, found in columns]
    yield table(["work", *(name for name, _ in columns)], [["on", *on], *rows])


def _measured(report: Report, measured: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """The speeds of a report's implementation; of several settings those with the same environment."""
    same = [other for other in measured if other["implementation"] == report.environment.get("implementation")]
    if len(same) > 1:
        same = [other for other in same if _on_one_line(other["environment"]).items() <= report.runs_on.items()]
    return same[0] if len(same) == 1 else None


def _on_one_line(entries: Mapping[str, str]) -> dict[str, str]:
    return {" ".join(name.split()): " ".join(value.split()) for name, value in entries.items()}


def _name(measured: Mapping[str, Any]) -> str:
    name = str(measured["implementation"]).rpartition(".")[2]
    settings = ", ".join(f"{key}={value}" for key, value in measured["settings"].items())
    return f"{name} ({settings})" if settings else name


def _time_text(measured: Mapping[str, Any], work: str, as_rate: bool) -> str:
    if work not in measured["seconds"]:
        return NOTHING
    median = measured["seconds"][work]["median"]
    return f"{1 / median:,.0f} /s" if as_rate and median else f"{1000 * median:.3g}"
