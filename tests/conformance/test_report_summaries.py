"""The summary of a run in Markdown, and its badge."""

import json
import re
from dataclasses import replace

import pytest
from toy_reports import RESULTS, result

from gsvc_conformance.__main__ import main
from gsvc_conformance.claim import read_claim
from gsvc_conformance.report.badge import badge_json
from gsvc_conformance.report.markdown import FIRST, MAX_BYTES, MORE, summary_markdown

EVIL = "</details> [x](javascript:y) <script> ``` | $a$ **b** # c"


def test_the_summary(report):
    text = summary_markdown(report)
    assert text.startswith(
        "### GSVC conformance: ./toy\n\n**Failed; 1 waived** (9 vectors: 4 pass, 2 wrong, 2 unsupported, 1 w"
    )
    assert "| training | **failed** | 2 of 4 vectors are wrong |" in text
    assert "| quantization | not claimed |  |" in text
    assert "| operation | vectors | pass | wrong | excused | worst error/bound |" in text
    assert "| parse | 2 | 1 | 0 | 1 |" in text
    assert "1. a factor of two (scale: 1 of 1 examined)" in text
    assert "#### The simplest of 2 failures" in text
    assert "```sh\ngsvc-conformance run --impl ./toy --case core/scale/wrong\n```" in text
    assert "killed by SIGSEGV" in text
    assert text.count("<details>") == text.count("</details>") == 4
    passing = summary_markdown(replace(report, results=RESULTS[6:]))
    assert "**Passed; 1 waived**" in passing
    assert "failure" not in passing


def test_the_simplest_failures_come_first_and_the_rest_is_counted(report):
    many = [result(f"n{n:03}", "fail", message="is wrong", size=n) for n in range(FIRST + MORE + 7)]
    text = summary_markdown(replace(report, results=many[::-1]))
    assert re.findall(r"<summary>fail core/scale/(\w+)", text) == [f"n{n:03}" for n in range(FIRST)]
    assert re.findall(r"- `core/scale/(\w+)`", text) == [f"n{n:03}" for n in range(FIRST, FIRST + MORE)]
    assert "- 7 more: see the page or the JSON" in text


def test_the_summary_is_never_too_large(report):
    long = [result(f"n{n}", "fail", message="w" * 10_000, log="l" * 100_000, title="t" * 10_000) for n in range(200)]
    assert 10_000 < len(summary_markdown(replace(report, results=long)).encode()) <= 65_536
    assert len(summary_markdown(replace(report, results=long, notes=["n" * 10**6])).encode()) <= 65_536
    assert len(summary_markdown(replace(report, environment={"implementation": "é" * 10**6})).encode()) <= 65_536
    assert MAX_BYTES < 65_536


def test_texts_of_others_mean_nothing_in_the_summary(report):
    evil = [result("a", "fail", message=EVIL, title=EVIL, causes=(EVIL,), log=EVIL)]
    text = summary_markdown(replace(report, results=evil, environment={"implementation": EVIL}, runs_on={EVIL: EVIL}))
    assert f"\n````text\n{EVIL}\n````\n" in text
    prose = re.sub(r"````text\n.*?\n````\n", "", text, flags=re.DOTALL)
    assert prose.count("\n</details>") == prose.count("</details>") == prose.count("<details>") == 3
    assert not re.search(r"(?<!\\)[\[$]|(?<!\\)<script|\*\*b", prose)
    rows = [line for line in prose.splitlines() if line.startswith("| ")]
    assert {line.count("|") - line.count(r"\|") for line in rows} == {3, 4, 7}


@pytest.mark.parametrize(
    ("results", "message", "color"),
    [
        (RESULTS, "3 classes 4/8", "red"),
        (RESULTS[:2], "training 2/2", "brightgreen"),
        ([RESULTS[0], RESULTS[4], RESULTS[5], RESULTS[6]], "rendering, training 2/3", "yellowgreen"),
        (RESULTS[4:5], "nothing judged", "lightgrey"),
    ],
)
def test_the_badge(report, results, message, color):
    badge = json.loads(badge_json(replace(report, results=results)))
    assert badge == {"schemaVersion": 1, "label": "GSVC conformance", "message": message, "color": color}


def test_the_badge_of_a_claim(report):
    claim = read_claim("training,paper,2")
    held = json.loads(badge_json(replace(report, results=RESULTS[:2], claim=claim)))
    assert (held["message"], held["color"]) == ("training level 2", "brightgreen")
    excused = [RESULTS[0], replace(RESULTS[1], outcome="waived")]
    waived = json.loads(badge_json(replace(report, results=excused, claim=claim)))
    assert waived["message"] == "training level 2 (1 waived)"
    fails = json.loads(badge_json(replace(report, results=RESULTS[:3], claim=claim)))
    assert (fails["message"], fails["color"]) == ("training level 2: not held", "red")
    ended = json.loads(badge_json(replace(report, results=RESULTS[:2], ended="ended early")))
    assert (ended["message"], ended["color"]) == ("ended early", "lightgrey")


def test_files_of_a_run_and_of_a_report(folder, toy_module, tmp_path, monkeypatch, capsys):
    summary, badge, kept = tmp_path / "summary.md", tmp_path / "badge.json", tmp_path / "run.json"
    words = ["run", "--vectors", str(folder), "--quiet", "--module", toy_module(), "--operation", "halve"]
    words += ["--markdown", str(summary), "--badge", str(badge), "--json", str(kept)]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert f"Markdown: {summary}\nbadge: {badge}\n" in out
    text = summary.read_text()
    assert text.startswith("### GSVC conformance: toy\\_implementation\n\n**Passed**")
    assert f"run --module toy_implementation --vectors {folder} --operation halve\n" in text
    assert json.loads(badge.read_text())["message"] == "halve 1/1"
    assert main(words) == 0
    text = summary.read_text()  # of the run that is kept; seconds may have passed
    assert text.count("###") == 1  # anew
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(summary))
    assert main(["report", str(kept), "--markdown", str(summary), "--badge", str(badge)]) == 0
    assert summary.read_text().count("###") == 2  # appended
    capsys.readouterr()
    assert main(["report", str(kept), "--markdown", "-"]) == 0
    assert capsys.readouterr().out == text
