"""The record of an experiment on disk: ``NAME.json`` with its numbers beside the claim and the verdict."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, get_args

from gsvc_base.cli.text import to_json
from gsvc_base.errors import UsageError
from gsvc_base.files import write_text
from gsvc_base.processors import processors
from gsvc_lab.experiments.experiment import Experiment, Holds, Result, Run
from gsvc_lab.machine import environment

FORMAT: Final = 1
"""Version of the JSON."""

KEYS: Final[dict[str, type]] = {
    "format": int,
    "name": str,
    "title": str,
    "claim": str,
    "setting": str,
    "verdict": dict,
    "tables": list,
    "figures": dict,
    "numbers": dict,
    "command": str,
    "full": bool,
    "seconds": float,
    "environment": dict,
}
"""The keys of a record, and their types."""


def record(experiment: Experiment, result: Result, run: Run, seconds: float) -> dict[str, Any]:
    """The record of a result, as JSON knows it.

    A UsageError says that it is not as `check` wants it.
    """
    made: dict[str, Any] = to_json(
        {
            "format": FORMAT,
            "name": experiment.name,
            "title": experiment.title,
            "claim": experiment.claim,
            "setting": result.setting,
            "verdict": result.verdict,
            "tables": result.tables,
            "figures": result.figures,
            "numbers": result.numbers,
            "command": command_line(experiment, run),
            "full": run.full,
            "seconds": round(float(seconds), 1),
            "environment": environment(run.threads or processors()),
        }
    )
    check(made, experiment.name)
    return made


def command_line(experiment: Experiment, run: Run) -> str:
    """The command that makes the result again; folders and files of the user are called DIR and FILE."""
    words = ["python -m gsvc_lab.experiments", experiment.name, *(["--full"] if run.full else [])]
    words += ["--clip FILE" for _ in run.clips] + (["--uvg DIR"] if run.uvg is not None else [])
    if run.threads != experiment.threads(None, full=run.full):
        words.append(f"--threads {run.threads}")
    return " ".join(words)


def check(made: Any, where: str) -> None:
    """Refuse what is no record.

    A UsageError says that a key is missing or of another type, a verdict is not one, or a row of a table has not
    one cell for each column.
    """
    if not isinstance(made, dict) or made.get("format") != FORMAT:
        raise UsageError(f"{where} is not a result of format {FORMAT}; run the experiment again")
    for key, kind in KEYS.items():
        if not isinstance(made.get(key), kind):
            raise UsageError(f"{where}: {key} must be a {kind.__name__}, not {made.get(key)!r}; run it again")
    if set(made) != set(KEYS):
        raise UsageError(f"{where}: {', '.join(sorted(set(made) - set(KEYS)))} is unknown; run it again")
    verdict = made["verdict"]
    if verdict.get("holds") not in get_args(Holds) or not isinstance(verdict.get("sentence"), str):
        raise UsageError(f"{where}: a verdict is one of {', '.join(get_args(Holds))} and a sentence, not {verdict}")
    for table in made["tables"]:
        if any(len(row) != len(table["columns"]) for row in table["rows"]):
            raise UsageError(f"{where}: a row of the table {table['title']!r} has not one cell for each column")


def write(made: dict[str, Any], folder: Path) -> Path:
    """Write a record as ``NAME.json``; returns the path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{made['name']}.json"
    write_text(json.dumps(made, allow_nan=False, ensure_ascii=False, indent=1) + "\n", path)
    return path


def read_all(folder: Path, names: Sequence[str]) -> list[dict[str, Any]]:
    """The records that a folder has, in the order of the names.

    A UsageError says that a file is not a record.
    """
    found = []
    for name in names:
        path = folder / f"{name}.json"
        if path.is_file():
            try:
                made = json.loads(path.read_text(encoding="utf-8"))
            except ValueError as error:
                raise UsageError(f"{path} is no JSON ({error}); run the experiment again") from None
            check(made, str(path))
            found.append(made)
    return found


def text_columns(table: dict[str, Any]) -> list[bool]:
    """Whether each column of a table is text, to stand at the left: most of its cells begin with no number."""
    columns = zip(*table["rows"], strict=True) if table["rows"] else ((),) * len(table["columns"])
    return [2 * sum(not _is_number(cell) for cell in cells) > len(cells) for cells in columns]


def _is_number(cell: str) -> bool:
    return cell.lstrip("+-−±<> ")[:1].isdigit() or cell in ("", "–", "-")
