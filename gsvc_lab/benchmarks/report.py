"""``python -m gsvc_lab.benchmarks.report``: write the measured tables into docs/performance.md, between its markers.

What `python -m gsvc_lab.benchmarks` kept is all that this reads, so the sections may come from several runs.
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any, Final

from gsvc_base.files import write_text
from gsvc_base.pages.markers import replaced
from gsvc_lab.benchmarks.__main__ import RESULTS, SECTIONS, describe
from gsvc_lab.benchmarks.results import Goal, Table, goal_table

DOCUMENT: Final = Path(__file__).parents[2] / "docs" / "performance.md"


def parts(results: dict[str, Any]) -> dict[str, str]:
    """The text for each marker: a section's tables, `machine` and `goals`."""
    missing = [name for name in SECTIONS if name not in results]
    if missing:
        sys.exit(f"{', '.join(missing)} not measured yet: run python -m gsvc_lab.benchmarks {' '.join(missing)}")
    texts = {
        name: "\n\n".join(Table(**table).markdown() for table in section["tables"]) for name, section in results.items()
    }
    machines = {describe(section["environment"]) for section in results.values()}
    limits = {section["limit"] for section in results.values() if section["limit"]}
    texts["machine"] = "\n".join([*sorted(machines), *(f"`limit` stands for {name}." for name in sorted(limits))])
    texts["goals"] = goal_table([Goal(**goal) for name in SECTIONS for goal in results[name]["goals"]]).markdown()
    return texts


def filled(document: str, texts: dict[str, str]) -> str:
    """The document with each text between its markers.

    A UsageError says that the document lacks the markers of a text.
    """
    for name, text in texts.items():
        document = replaced(document, f"<!-- measured: {name} -->", "<!-- end -->", text)
    return document


def main() -> None:
    """Fill in the document."""
    parser = argparse.ArgumentParser(prog="python -m gsvc_lab.benchmarks.report", description=__doc__)
    parser.add_argument(
        "--json", type=Path, default=RESULTS, metavar="FILE", help="what python -m gsvc_lab.benchmarks kept"
    )
    arguments = parser.parse_args()
    if not arguments.json.exists():
        sys.exit(f"{arguments.json} does not exist: run python -m gsvc_lab.benchmarks first")
    texts = parts(json.loads(arguments.json.read_text()))
    write_text(filled(DOCUMENT.read_text(encoding="utf-8"), texts), DOCUMENT)


if __name__ == "__main__":
    main()
