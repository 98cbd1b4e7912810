"""A run of the suite as JSON, and back.

A line a result, so that a report that is kept in git changes where a result does. What tells nothing (empty, null, no
element wrong) is left out of results and their outputs.
"""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from conformance.results import OUTCOMES, OutputResult, Report, Result, Summary, Table
from gsvc_ref.errors import UsageError

FORMAT: Final = "gsvc-conformance-report/1"
INFINITE: Final = "infinite"
"""How JSON has a ratio that is not finite."""


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
    except ValueError as error:
        raise UsageError(f"{path}: {error}") from None


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
        "notes": list(report.notes),
        "classes": [
            {**_summary_object(group), "verdict": group.verdict, "reason": group.reason} for group in report.groups()
        ],
        "stages": [_summary_object(stage) for stage in report.stages()],
        "results": [_result_object(result) for result in report.results],
    }


def _summary_object(summary: Summary) -> dict[str, Any]:
    counts: dict[str, int] = {outcome: summary.counts.get(outcome, 0) for outcome in OUTCOMES}
    return {"name": summary.name, **counts, "ratio": _to_ratio(summary.ratio), "place": summary.place}


def _result_object(result: Result) -> dict[str, Any]:
    outputs = [
        {"name": out.name, "check": out.check, "passed": out.passed,
         **_filled(message=out.message, ratio=_to_ratio(out.ratio),
                   place=None if out.place is None else list(out.place), wrong=out.wrong, refused=out.refused)}
        for out in result.outputs
    ]  # fmt: skip
    return {
        "id": result.id, "title": result.title, "class": result.group, "outcome": result.outcome,
        **_filled(message=result.message, outputs=outputs, causes=list(result.causes), log=result.log,
                  table=_table_object(result.table), size=result.size),
        "seconds": round(result.seconds, 3),
    }  # fmt: skip


def _table_object(table: Table | None) -> dict[str, Any] | None:
    if table is None:
        return None
    return {"title": table.title, "columns": list(table.columns), "rows": [list(row) for row in table.rows]}


def _from_table(entry: Mapping[str, Any] | None) -> Table | None:
    if entry is None:
        return None
    return Table(entry["title"], tuple(entry["columns"]), tuple(tuple(row) for row in entry["rows"]))


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
    try:
        if value["format"] != FORMAT:
            raise UsageError(f"the format is {value['format']!r}, not {FORMAT!r}")
        results = [_from_result(entry) for entry in value["results"]]
        fields = (value["environment"], value["command"], value["selection"], value["notes"])
        return Report(*fields, results, value.get("runs_on", {}))
    except (KeyError, TypeError, AttributeError) as error:
        raise UsageError(f"this is not a report that `run --json` wrote ({type(error).__name__}: {error})") from None


def _from_result(entry: Mapping[str, Any]) -> Result:
    if entry["outcome"] not in OUTCOMES or entry["id"].count("/") != 2:
        raise UsageError(f"{entry['id']!r} has the outcome {entry['outcome']!r}; there are {', '.join(OUTCOMES)}")
    outputs = tuple(
        OutputResult(
            out["name"], out["check"], out["passed"], out.get("message", ""), _from_ratio(out.get("ratio")),
            None if out.get("place") is None else tuple(out["place"]), out.get("wrong", 0),
            out.get("refused", ""),
        )
        for out in entry.get("outputs", ())
    )  # fmt: skip
    return Result(
        entry["id"], entry["title"], entry["class"], entry["outcome"], entry.get("message", ""), outputs,
        tuple(entry.get("causes", ())), entry.get("log", ""), entry["seconds"],
        _from_table(entry.get("table")), entry.get("size", 0),
    )  # fmt: skip


def _to_ratio(ratio: float | None) -> float | str | None:
    return ratio if ratio is None or math.isfinite(ratio) else INFINITE


def _from_ratio(value: Any) -> float | None:
    return math.inf if value == INFINITE else value
