"""The tables of several reports."""

import json

import pytest
from toy_operations import INPUTS, OPERATIONS

from gsvc_conformance.__main__ import main
from gsvc_conformance.commands.compare import BEGIN, END
from gsvc_conformance.report.comparison import Entry, comparison, operation_cell
from gsvc_conformance.report.json import to_text
from gsvc_conformance.results import OutputResult, Result
from gsvc_conformance.verdicts import Report


def report_of(name, outcomes, runs_on=None, **environment) -> Report:
    """A report in which the vectors of some operations have an outcome and a ratio; the others are unsupported."""
    results = []
    for vector in INPUTS:
        operation = vector.split("/")[1]
        outcome, ratio = outcomes.get(operation, ("unsupported", None))
        outputs = () if outcome == "unsupported" else (OutputResult("x", "bounded", outcome == "pass", ratio=ratio),)
        results.append(Result(vector, "A vector.", OPERATIONS[operation].group, outcome, outputs=outputs))
    around = {
        "implementation": name,
        "vectors": "a" * 64,
        "spec.md": "1",
        "platform": "Linux",
        "date": "2026-01-31T12:00",
    }
    return Report({**around, **environment}, f"run --module {name}", "", [], results, runs_on or {})


@pytest.fixture
def entries(toys) -> list[Entry]:
    good = report_of(
        "pkg.good", {name: ("pass", 0.25 if name == "scale" else None) for name in OPERATIONS}, {"device": "a|b"}
    )
    bad = report_of("pkg.bad", {"scale": ("fail", 7.5), "halve": ("waived", float("inf")), "parse": ("pass", None)})
    return [Entry("good", good, {"page": "good.html"}), Entry("bad", bad)]


SPEEDS = {
    "form": "speeds/1",
    "date": "2026-02-01",
    "machine": {"cpu": "Some CPU", "cores": 2},
    "works": {"sum": "render_sum, 19x7", "step": "adan_step"},
    "implementations": [
        {"implementation": "ours", "settings": {}, "environment": {}, "missing": {},
         "seconds": {"sum": {"median": 0.5}, "step": {"median": 0.001}}},
        {"implementation": "pkg.good", "settings": {"X": "1"}, "environment": {"device": "other"}, "missing": {},
         "seconds": {"sum": {"median": 9.0}}},
        {"implementation": "pkg.good", "settings": {"X": "2"}, "environment": {"device": " a|b"}, "missing": {},
         "seconds": {"sum": {"median": 0.01234}}},
    ],
}  # fmt: skip


def rows(text, first):
    """The rows of the table whose head begins with a word."""
    (part,) = (part for part in text.split("\n\n") if part.startswith(f"| {first} "))
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in part.splitlines() if "---" not in line]


def test_the_tables(entries):
    text = comparison(entries)
    assert rows(text, "implementation") == [
        ["implementation", "conclusion", "on", "date", "report"],
        ["good", "passed", "device: a&#124;b<br>Linux", "2026-01-31", "[page](good.html)"],
        ["bad", "failed; 1 waived", "Linux", "2026-01-31", ""],
    ]
    assert rows(text, "class")[1:] == [
        ["bitstream", "passed, level 5", "passed, level 5"],
        ["rendering", "passed, level 5", "not claimed"],
        ["training", "passed, level 5", "failed"],
        ["quantization", "passed, level 5", "not claimed"],
    ]
    assert rows(text, "operation") == [
        ["operation", "good", "bad"],
        ["`parse`", "3/3", "3/3"],
        ["`paint`", "2/2", "–"],
        ["`scale`", "3/3 (0.25)", "0/3, **3 wrong** (7.5)"],
        ["`halve`", "1/1", "0/1, 1 waived (infinite)"],
    ]
    assert "**" not in text.replace("**3 wrong**", "")


def test_an_operation_that_an_implementation_has_in_part(entries):
    some = [Result(f"core/paint/{n}", "x", "rendering", "unsupported" if n else "pass") for n in range(3)]
    (summary,) = Report({}, "", "", [], some).operations()
    assert operation_cell(summary, None) == "1/3, 2 unsupported"
    assert operation_cell(None, None) == "–"


def test_the_ratio_of_core_vectors_stands_before_that_of_all(entries):
    def result(vector, ratio):
        return Result(
            vector, "A vector.", "training", "pass", outputs=(OutputResult("x", "bounded", True, ratio=ratio),)
        )

    ratios = {"core/scale/a": 0.0, "core/scale/b": 0.125, "stress/scale/c": 0.99999}
    report = Report({}, "", "", [], [result(vector, ratio) for vector, ratio in ratios.items()])
    assert "| `scale` | 3/3 (0.125; 1) |" in comparison([Entry("x", report)])


def test_what_cannot_be_compared_is_told(entries):
    other = report_of("pkg.late", {"parse": ("pass", None)}, vectors="b" * 64)
    partial = Report(other.environment, "", "operation parse", [], [r for r in other.results if r.operation == "parse"])
    text = comparison([*entries, Entry("late", partial)])
    assert "**Not the same vectors**: aaaaaaaaaaaaaaaa of good, bad; bbbbbbbbbbbbbbbb of late." in text
    assert "**late** was judged in part: operation parse." in text
    assert "Not the same spec.md" not in text


def test_speeds_stand_beside_by_implementation_and_environment(entries):
    text = comparison(entries, [{**SPEEDS, "rates": []}])
    assert "Milliseconds, medians, measured on 2026-02-01 (cpu: Some CPU; cores: 2):" in text
    assert rows(text, "work") == [
        ["work", "good", "ours", "good (X=1)"],
        ["on", "device:  a&#124;b", "", "device: other"],
        ["render_sum, 19x7", "12.3", "500", "9e+03"],
        ["adan_step", "–", "1", "–"],
    ]


def test_speeds_of_a_card_have_a_table_of_their_own_and_take_the_place_of_those_without(entries):
    card = {
        "form": "speeds/1", "date": "2026-02-02", "machine": {"card": "Some GPU", "driver": "1.2"},
        "works": {"picture": "a picture", "step": "a step"}, "rates": ["picture"],
        "implementations": [
            {"implementation": "pkg.good", "settings": {}, "environment": {"device": "Some GPU"},
             "seconds": {"picture": {"median": 1 / 12345}, "step": {"median": 0.002}}},
            {"implementation": "ours", "settings": {}, "environment": {}, "seconds": {"picture": {"median": 0.01}}},
        ],
    }  # fmt: skip
    text = comparison(entries, [card, {**SPEEDS, "rates": []}])
    heading = "Milliseconds, or frames per second (/s), medians, measured on 2026-02-02 (card: Some GPU; driver: 1.2):"
    gpu, cpu = text.partition(heading)[2].split("\n\n")[1::2]
    assert rows(gpu, "work") == [
        ["work", "good", "ours"],
        ["on", "device: Some GPU", ""],
        ["a picture", "12,345 /s", "100 /s"],
        ["a step", "2", "–"],
    ]
    assert rows(cpu, "work") == [["work", "ours"], ["on", ""], ["render_sum, 19x7", "500"], ["adan_step", "1"]]


def test_the_command(entries, tmp_path, capsys):
    folder = tmp_path / "reports"
    folder.mkdir()
    for entry in entries:
        (folder / f"{entry.name}.json").write_text(to_text(entry.report))
    (folder / "good.html").write_text("a page")
    (folder / "speeds.json").write_text(json.dumps(SPEEDS))
    results = [str(folder / "good.json"), str(folder / "bad.json")]
    page = folder / "README.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    words = ["compare", *results, "--speeds", str(folder / "speeds.json")]
    for _ in range(2):
        assert main([*words, "--markdown", str(page)]) == 0
        assert capsys.readouterr().out == ""
        text = page.read_text()
        assert text.startswith(f"before\n{BEGIN}\n\n| implementation |")
        assert text.endswith(f" |\n\n{END}\nafter\n")
    assert "| [page](good.html), [JSON](good.json) |" in text
    assert main(words) == 0
    assert capsys.readouterr().out.split("|")[1:6] == text.split("|")[1:6]


def test_the_command_refuses_what_is_no_report(entries, tmp_path, capsys):
    good = tmp_path / "good.json"
    good.write_text(to_text(entries[0].report))
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "good.json").write_text(good.read_text())
    other = tmp_path / "other.json"
    other.write_text('{"form": "speeds/2"}')
    page = tmp_path / "page.html"
    page.write_text("<html>")
    part = tmp_path / "part.json"
    part.write_text('{"form": "speeds/1"}')
    for words, message in (
        ([str(other)], "other.json is not a report of `run --json`: its format is None"),
        ([str(page), str(good)], "page.html is not a report of `run --json`"),
        ([str(good), "--speeds", str(part)], "has not the form speeds/1"),
        ([str(good), str(tmp_path / "b" / "good.json"), "--tables"], "two reports are called good"),
        ([str(good), "--speeds", str(other)], "has not the form speeds/1"),
        ([str(good), "--speeds", str(tmp_path / "none.json")], "none.json"),
        ([str(good), "--markdown", str(other)], "needs the line '<!-- begin: gsvc-conformance compare -->' once"),
    ):
        assert main(["compare", *words]) == 2
        assert message in capsys.readouterr().err


# Two reports of one implementation


def reports(tmp_path, before, now, **options):
    """Two reports in files: the outcomes of some vectors, `message` for what is wrong."""
    paths = []
    for name, outcomes in (("before", before), ("now", now)):
        results = [
            Result(vector, f"The vector {vector.split('/')[2]}.", OPERATIONS[vector.split("/")[1]].group, outcome,
                   "" if outcome == "pass" else f"output x is {outcome}", size=size)
            for vector, (outcome, size) in outcomes.items()
        ]  # fmt: skip
        around = {"implementation": "mine", "vectors": options.get("vectors", "a" * 64) if name == "now" else "a" * 64}
        report = Report(around, "gsvc-conformance run --module mine", "", [], results, ended=options.get("ended", ""))
        paths.append(tmp_path / f"{name}.json")
        paths[-1].write_text(to_text(report))
    return [str(path) for path in paths]


BEFORE = {
    "core/scale/by_a_third": ("pass", 0), "core/scale/by_two": ("pass", 0), "core/halve/one_to_six": ("fail", 8),
    "core/paint/odd_size": ("pass", 0), "core/parse/three_bytes": ("fail", 3), "stress/scale/nothing": ("pass", 0),
    "uncommon/parse/empty": ("unsupported", 0),
}  # fmt: skip
NOW = {
    "core/scale/by_a_third": ("fail", 56), "core/scale/by_two": ("timeout", 24), "core/halve/one_to_six": ("pass", 0),
    "core/paint/odd_size": ("unsupported", 0), "core/parse/three_bytes": ("fail", 3),
    "uncommon/parse/empty": ("error", 0), "faulty/parse/bad_letter": ("pass", 0),
}  # fmt: skip


def test_regressions_are_named_with_their_messages_the_simplest_first(toys, tmp_path, capsys):
    assert main(["compare", *reports(tmp_path, BEFORE, NOW)]) == 1
    out = capsys.readouterr().out
    lines = out.splitlines()
    named = [line for line in lines if line.startswith("REGRESSION")]
    assert sorted(named) == [
        "REGRESSION FAIL core/scale/by_a_third: The vector by_a_third.",
        "REGRESSION TIMEOUT core/scale/by_two: The vector by_two.",
        "REGRESSION UNSUPPORTED core/paint/odd_size: The vector odd_size.",
    ]
    scales = [line for line in named if "scale" in line]
    assert "by_two" in scales[0]  # the smaller inputs
    assert "  output x is timeout" in lines
    assert "  again: gsvc-conformance run --module mine --case core/scale/by_two" in lines
    assert lines[-7:-2] == [
        "fixed: core/halve/one_to_six",
        "wrong now, neither right nor wrong before: uncommon/parse/empty",
        "still wrong: core/parse/three_bytes",
        "new: faulty/parse/bad_letter (1 pass)",
        "missing: stress/scale/nothing (1 pass)",
    ]
    assert lines[-1] == "3 REGRESSIONS: 1 fixed, 1 still wrong, 1 new, 1 missing"


def test_quiet_and_show(toys, tmp_path, capsys):
    files = reports(tmp_path, BEFORE, NOW)
    assert main(["compare", "--quiet", *files]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert sorted(lines[:-1]) == ["core/paint/odd_size", "core/scale/by_a_third", "core/scale/by_two"]
    assert main(["compare", "--show", "0", *files]) == 1
    assert "REGRESSION core/scale/by_two: timeout" in capsys.readouterr().out


def test_without_a_regression(toys, tmp_path, capsys):
    assert main(["compare", *reports(tmp_path, NOW, NOW)]) == 0
    out = capsys.readouterr().out
    assert out.endswith("NO REGRESSION: 4 still wrong\n")
    better = dict.fromkeys(BEFORE, ("pass", 0))
    assert main(["compare", *reports(tmp_path, BEFORE, better)]) == 0
    assert capsys.readouterr().out.endswith("\nNO REGRESSION: 2 fixed\n")


def test_what_else_changed_is_told(toys, tmp_path, capsys):
    files = reports(tmp_path, BEFORE, BEFORE, vectors="b" * 64, ended="ended early, after 2 of 3 vectors: x")
    assert main(["compare", *files]) == 2  # what is missing may have regressed
    out = capsys.readouterr().out
    assert f"note: not the same vectors: {'a' * 40} before, {'b' * 40} now" in out
    assert "note: the second report is not whole: ended early" in out


def test_reports_with_nothing_in_common(toys, tmp_path, capsys):
    other = {"faulty/parse/bad_letter": ("pass", 0)}
    assert main(["compare", *reports(tmp_path, BEFORE, other)]) == 2
    assert "the reports have no vector in common" in capsys.readouterr().err


def test_another_implementation_is_no_regression(entries, tmp_path, capsys):
    files = reports(tmp_path, BEFORE, NOW)
    assert main(["compare", "--tables", *files]) == 0
    assert "| `scale` |" in capsys.readouterr().out
