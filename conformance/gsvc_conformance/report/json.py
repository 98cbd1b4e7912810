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
from gsvc_base.rendering.error_models import FP32
from gsvc_conformance.claim import read_claim
from gsvc_conformance.features import features_of
from gsvc_conformance.profiles import ANY
from gsvc_conformance.reading import read_json
from gsvc_conformance.results import OUTCOMES, REFUSED, OutputResult, Result, Table
from gsvc_conformance.schema import (
    COUNT,
    COUNTS,
    FLAG,
    LIST,
    NAMED_TEXTS,
    NEEDED,
    NUMBER,
    OBJECT_OR_NOT,
    ROWS,
    TEXT,
    TEXT_OR_NOT,
    TEXTS,
    Kind,
    Schema,
    checked,
    cut,
    shown,
)
from gsvc_conformance.verdicts import Report, Summary

AS_WRITTEN: Final = ", as `run --json` wrote it"
FORMAT: Final = "gsvc-conformance-report/1"
INFINITE: Final = "infinite"
"""The texts in JSON for a ratio that is not finite."""


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
        It is not a report.
    """
    try:
        return from_object(read_json(path))
    except UsageError as error:
        raise UsageError(f"{path} is not a report of `run --json`: {error}") from None


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
        **_filled(options=report.options, model="" if report.model == FP32.name else report.model),
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
                  log=result.log, table=_table_object(result.table), size=result.size,
                  unusual=result.unusual),
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
        raise UsageError(f"its format is {shown(found)}, not {FORMAT!r}")
    report = checked(value, REPORT, "the report", AS_WRITTEN)
    results = [result_from(entry, f"result {number}") for number, entry in enumerate(report.pop("results"))]
    claim, features, stale = report.pop("claim"), report.pop("features"), tuple(report.pop("stale"))
    return Report(
        **report, results=results, stale=stale, claim=None if claim is None else read_claim(claim),
        features=None if features is None else features_of(features, "the report"),
    )  # fmt: skip


def result_from(value: Any, what: str) -> Result:
    """A result from what `result_object` made; `what` names it.

    Raises
    ------
    UsageError
        It is something else.
    """
    result = checked(value, RESULT, what, AS_WRITTEN)
    name = result["id"]
    if name.count("/") != 2:
        raise UsageError(f"id of {what} is {shown(name)}; it must be TIER/OPERATION/SLUG{AS_WRITTEN}")
    if result["outcome"] not in OUTCOMES:
        raise UsageError(f"{shown(name)} has the outcome {shown(result['outcome'])}; there are {', '.join(OUTCOMES)}")
    outputs = [checked(output, OUTPUT, f"an output of {cut(name)}", AS_WRITTEN) for output in result.pop("outputs")]
    group, causes, table = result.pop("class"), tuple(result.pop("causes")), result.pop("table")
    return Result(
        **result, group=group, causes=causes,
        outputs=tuple(
            OutputResult(**{**out, "ratio": _from_ratio(out["ratio"]), "place": _from_place(out["place"])})
            for out in outputs
        ),
        table=_table_from(checked(table, TABLE, f"the table of {cut(name)}", AS_WRITTEN)) if table else None,
    )  # fmt: skip


def _table_from(table: Mapping[str, Any]) -> Table:
    if any(len(row) != len(table["columns"]) + 1 for row in table["rows"]):
        raise UsageError(f"a table has a row without a name and one cell for each column{AS_WRITTEN}")
    return Table(table["title"], tuple(table["columns"]), tuple(map(tuple, table["rows"])))


def _is_ratio(value: Any) -> bool:
    return COUNT.holds(value) or (type(value) is float and 0 <= value < math.inf)


RATIO: Final = Kind("a number", lambda value: value in (None, INFINITE) or _is_ratio(value))
PLACE: Final = Kind(COUNTS.words, lambda value: value is None or COUNTS.holds(value))
REPORT: Final[Schema] = {
    "environment": (NAMED_TEXTS, NEEDED), "command": (TEXT, NEEDED), "selection": (TEXT, NEEDED),
    "notes": (TEXTS, NEEDED), "results": (LIST, NEEDED), "runs_on": (NAMED_TEXTS, {}), "ended": (TEXT, ""),
    "claim": (TEXT_OR_NOT, None), "whole": (FLAG, False), "features": (OBJECT_OR_NOT, None), "stale": (TEXTS, []),
    "options": (TEXT, ""), "model": (TEXT, FP32.name),
}  # fmt: skip
RESULT: Final[Schema] = {
    "id": (TEXT, NEEDED), "title": (TEXT, NEEDED), "class": (TEXT, NEEDED), "outcome": (TEXT, NEEDED),
    "message": (TEXT, ""), "outputs": (LIST, []), "causes": (TEXTS, []), "log": (TEXT, ""),
    "seconds": (NUMBER, NEEDED), "table": (OBJECT_OR_NOT, None), "size": (COUNT, 0), "level": (COUNT, 1),
    "unusual": (FLAG, False), "outside": (TEXT, ""), "profile": (TEXT, ANY),
}  # fmt: skip
OUTPUT: Final[Schema] = {
    "name": (TEXT, NEEDED), "check": (TEXT, NEEDED), "passed": (FLAG, NEEDED), "message": (TEXT, ""),
    "ratio": (RATIO, None), "place": (PLACE, None), "wrong": (COUNT, 0), "refused": (TEXT, ""), "advice": (TEXT, ""),
}  # fmt: skip
TABLE: Final[Schema] = {"title": (TEXT, NEEDED), "columns": (TEXTS, NEEDED), "rows": (ROWS, NEEDED)}
"""The fields of a report and its parts that are read: what each may be, and its default."""


def _to_ratio(ratio: float | None) -> float | str | None:
    return ratio if ratio is None or math.isfinite(ratio) else INFINITE


def _from_ratio(ratio: float | str | None) -> float | None:
    return math.inf if ratio == INFINITE else None if ratio is None else float(ratio)


def _from_place(place: list[int] | None) -> tuple[int, ...] | None:
    return None if place is None else tuple(place)
