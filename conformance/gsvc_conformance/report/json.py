"""A run of the suite as JSON, and back.

A line a result, so that a report that is kept in git changes where a result does. What tells nothing (empty, null, no
element wrong, the lowest level) is left out of results and their outputs.
"""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from gsvc_base.errors import UsageError
from gsvc_conformance.claim import read_claim
from gsvc_conformance.features import features_of
from gsvc_conformance.profiles import ANY
from gsvc_conformance.results import OUTCOMES, REFUSED, OutputResult, Report, Result, Summary, Table

FORMAT: Final = "gsvc-conformance-report/1"
INFINITE: Final = "infinite"
"""The texts in JSON for a ratio that is not finite."""
TYPES: Final[Mapping[type, str]] = {
    str: "a text", bool: "true or false", int: "a whole number", list: "a list", dict: "an object",
}  # fmt: skip
"""Names of the types of fields."""


def to_text(report: Report) -> str:
    """A report as the text of a JSON file."""

    def text(value: Any) -> str:
        return json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))

    def lines(value: Any) -> str:
        return "[\n" + ",\n".join(map(text, value)) + "\n]" if isinstance(value, list) and value else text(value)

    return "{\n" + ",\n".join(f"{text(name)}:{lines(value)}" for name, value in to_object(report).items()) + "\n}\n"


def read(path: Path) -> Report:
    """A report from its file.

    Raises
    ------
    UsageError
        It is no report.
    """
    try:
        return from_object(json.loads(path.read_text(encoding="utf-8")))
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{path} is no report of `run --json`: {error}") from None


def to_object(report: Report) -> dict[str, Any]:
    """A report for JSON; what can be derived from the results stands there too, for other programs."""
    return {
        "format": FORMAT,
        "passed": report.passed,
        "conclusion": report.conclusion,
        "verdict": report.verdict,
        "environment": dict(report.environment),
        "runs_on": dict(report.runs_on),
        "command": report.command,
        "selection": report.selection,
        **_filled(options=report.options),
        "notes": list(report.notes),
        **_filled(
            ended=report.ended,
            claim=str(report.claim or ""),
            whole=report.whole,
            quotes=report.quotes(),
            stale=list(report.stale),
        ),
        **({"features": report.features.to_object()} if report.features else {}),
        "classes": [_class_object(group, report) for group in report.groups()],
        "operations": [_summary_object(operation) for operation in report.operations()],
        "results": [result_object(result) for result in report.results],
    }


def _class_object(group: Summary, report: Report) -> dict[str, Any]:
    """A class with its verdict; `level` is the one that it passes, `refusals` counts those that name rule and bit."""
    refused = report.refusals().get(group.name, [])
    counts = {
        "named": len(refused),
        "rule": sum(what in REFUSED[:2] for what in refused),
        "bit": sum(what == REFUSED[0] for what in refused),
    }
    about = {"verdict": group.verdict, "reason": group.reason, "level": group.level}
    about |= _filled(profile=group.profile)
    return {**_summary_object(group), **about, **_filled(refusals=counts if refused else None)}


def _summary_object(summary: Summary) -> dict[str, Any]:
    counts: dict[str, int] = {outcome: summary.counts.get(outcome, 0) for outcome in OUTCOMES}
    return {"name": summary.name, **counts, "ratio": _to_ratio(summary.ratio), "place": summary.place}


def result_object(result: Result) -> dict[str, Any]:
    """A result for JSON."""
    outputs = [
        {"name": out.name, "check": out.check, "passed": out.passed,
         **_filled(message=out.message, ratio=_to_ratio(out.ratio),
                   place=None if out.place is None else list(out.place), wrong=out.wrong, refused=out.refused,
                   advice=out.advice)}
        for out in result.outputs
    ]  # fmt: skip
    return {
        "id": result.id, "title": result.title, "class": result.group, "outcome": result.outcome,
        **({"level": result.level} if result.level > 1 else {}),
        **({"profile": result.profile} if result.profile != ANY else {}),
        **_filled(outside=result.outside, message=result.message, outputs=outputs, causes=list(result.causes),
                  log=result.log, table=_table_object(result.table), size=result.size),
        "seconds": round(result.seconds, 3),
    }  # fmt: skip


def _table_object(table: Table | None) -> dict[str, Any] | None:
    if table is None:
        return None
    return {"title": table.title, "columns": list(table.columns), "rows": [list(row) for row in table.rows]}


def _filled(**fields: Any) -> dict[str, Any]:
    """The fields that tell anything; a ratio of 0 does, and the place of a single number."""
    return {
        name: value for name, value in fields.items() if value or (name in ("ratio", "place") and value is not None)
    }


def from_object(value: Any) -> Report:
    """A report from what `to_object` made.

    Raises
    ------
    UsageError
        It is something else.
    """
    if not isinstance(value, dict) or value.get("format") != FORMAT:
        found = value.get("format") if isinstance(value, dict) else type(value).__name__
        raise UsageError(f"its format is {found!r}, not {FORMAT!r}")
    report = _Entry(value, "the report")
    return Report(
        report.texts("environment"), report.text("command"), report.text("selection"), report.list_of_texts("notes"),
        [result_from(entry, f"result {number}") for number, entry in enumerate(report.get("results", list))],
        report.texts("runs_on", {}), report.text("ended", ""),
        read_claim(report.text("claim")) if "claim" in report else None, report.get("whole", bool, False),
        features_of(report.get("features", dict), "the report") if "features" in report else None,
        tuple(report.list_of_texts("stale", [])), report.text("options", ""),
    )  # fmt: skip


def result_from(value: Any, what: str) -> Result:
    """A result from what `result_object` made; `what` names it.

    Raises
    ------
    UsageError
        It is something else.
    """
    entry = _Entry(value, what)
    name = entry.text("id")
    if entry.get("outcome", str) not in OUTCOMES or name.count("/") != 2:
        raise UsageError(f"{name!r} has the outcome {entry.get('outcome', str)!r}; there are {', '.join(OUTCOMES)}")
    outputs = tuple(
        OutputResult(
            out.text("name"), out.text("check"), out.get("passed", bool), out.text("message", ""), _from_ratio(out),
            _from_place(out), out.get("wrong", int, 0), out.text("refused", ""),
            out.text("advice", ""),
        )
        for out in (_Entry(output, f"an output of {name}") for output in entry.get("outputs", list, []))
    )  # fmt: skip
    return Result(
        name, entry.text("title"), entry.text("class"), entry.get("outcome", str), entry.text("message", ""), outputs,
        tuple(entry.list_of_texts("causes", [])), entry.text("log", ""), entry.number("seconds"), _from_table(entry),
        entry.get("size", int, 0), entry.get("level", int, 1),
        entry.text("outside", ""), entry.text("profile", ANY),
    )  # fmt: skip


def _from_table(result: "_Entry") -> Table | None:
    value = result.get("table", dict, {})
    if not value:
        return None
    table = _Entry(value, "the table of a result")
    rows = table.get("rows", list)
    if not all(isinstance(row, list) and all(isinstance(cell, str) for cell in row) for row in rows):
        raise table.refusal("rows", "a list of lists of texts")
    return Table(table.text("title"), tuple(table.list_of_texts("columns")), tuple(tuple(row) for row in rows))


class _Entry:
    """An object of JSON whose fields must be of the types that are asked for.

    Raises
    ------
    UsageError
        It is none, or a field is missing or of another type; the message names the field.
    """

    def __init__(self, value: Any, name: str) -> None:
        self._name = name
        if not isinstance(value, dict):
            raise UsageError(f"{name} is {value!r}; it must be an object, as `run --json` wrote it")
        self._value = value

    def get(self, field: str, kind: type, default: Any = None) -> Any:
        """A field; `default`, unless it is None, stands for one that is left out."""
        found = self._value.get(field, default)
        if not isinstance(found, kind) or (isinstance(found, bool) and kind is not bool):
            raise self.refusal(field, TYPES[kind])
        return found

    def refusal(self, field: str, what: str) -> UsageError:
        """The error for a field that is something else."""
        found = repr(self._value[field]) if field in self._value else "missing"
        return UsageError(f"{field} of {self._name} is {found}; it must be {what}, as `run --json` wrote it")

    def text(self, field: str, default: str | None = None) -> str:
        """A text."""
        return str(self.get(field, str, default))

    def number(self, field: str) -> float:
        """A finite number that is not negative."""
        found = self._value.get(field)
        if isinstance(found, bool) or not isinstance(found, int | float) or not 0 <= found < math.inf:
            raise self.refusal(field, "a number")
        return float(found)

    def texts(self, field: str, default: dict[str, str] | None = None) -> dict[str, str]:
        """Texts by name."""
        found: dict[str, str] = self.get(field, dict, default)
        if not all(isinstance(text, str) for text in found.values()):
            raise self.refusal(field, "an object of texts")
        return found

    def list_of_texts(self, field: str, default: list[str] | None = None) -> list[str]:
        """Several texts."""
        found: list[str] = self.get(field, list, default)
        if not all(isinstance(text, str) for text in found):
            raise self.refusal(field, "a list of texts")
        return found

    def __contains__(self, field: str) -> bool:
        return self._value.get(field) is not None


def _to_ratio(ratio: float | None) -> float | str | None:
    return ratio if ratio is None or math.isfinite(ratio) else INFINITE


def _from_ratio(entry: _Entry) -> float | None:
    if "ratio" not in entry:
        return None
    return math.inf if entry.get("ratio", object) == INFINITE else entry.number("ratio")


def _from_place(entry: _Entry) -> tuple[int, ...] | None:
    if "place" not in entry:
        return None
    if not all(isinstance(index, int) for index in entry.get("place", list)):
        raise entry.refusal("place", "a list of whole numbers")
    return tuple(entry.get("place", list))
