"""The reports in docs/reports: small, whole, and the table is theirs."""

import json
from pathlib import Path

import pytest

from gsvc_conformance.commands.compare import BEGIN, END, entries
from gsvc_conformance.report.comparison import comparison, read_speeds

FOLDER = Path(__file__).parents[2] / "docs" / "reports"
SPEEDS = sorted(FOLDER.glob("speeds*.json"))
REPORTS = sorted(path for path in FOLDER.glob("*.json") if path not in SPEEDS)
MAX_BYTES_A_VECTOR, MAX_BYTES_AN_OUTPUT = 310, 30


@pytest.mark.parametrize("path", REPORTS, ids=lambda path: path.stem)
def test_a_report_has_its_page_and_both_are_small_and_name_no_folder_of_a_machine(path):
    for file in (path, path.with_suffix(".html")):
        text = file.read_text(encoding="utf-8")
        results = json.loads(path.read_text(encoding="utf-8"))["results"]
        outputs = sum(len(result.get("outputs", ())) for result in results)
        assert len(text.encode()) < MAX_BYTES_A_VECTOR * len(results) + MAX_BYTES_AN_OUTPUT * outputs
        assert not any(f"{folder}/" in text for folder in (FOLDER.parents[1], "/home", "/tmp", "/root"))


@pytest.mark.parametrize("path", REPORTS, ids=lambda path: path.stem)
def test_a_report_tells_where_it_is_from(path):
    (report,) = (entry.report for entry in entries([path], FOLDER))
    assert not report.selection
    assert report.environment["date"]
    assert report.runs_on or report.environment["implementation"] in ("gsvc_ref", "spec.md")


def test_the_table_is_that_of_the_reports():
    text = (FOLDER / "README.md").read_text(encoding="utf-8")
    made = comparison(entries(REPORTS, FOLDER), [read_speeds(path) for path in SPEEDS])
    assert text.partition(BEGIN)[2].partition(END)[0].strip() == made, "make adapters, or: gsvc-conformance compare"
