"""The reports of a run: the console, JSON and JUnit XML."""

import json
from collections import Counter
from dataclasses import replace
from xml.etree import ElementTree as ET

import pytest
from toy_reports import RESULTS, result

from gsvc_base.errors import UsageError
from gsvc_conformance.report.console import cause_lines, describe, ends, last_line, progress_text
from gsvc_conformance.report.json import from_object, to_object, to_text
from gsvc_conformance.report.junit import junit_xml
from gsvc_conformance.report.markdown import summary_markdown
from gsvc_conformance.report.page import report_html
from gsvc_conformance.results import OutputResult


def test_verdicts(report):
    assert {group.name: group.verdict for group in report.groups()} == {
        "bitstream": "waived",
        "rendering": "incomplete",
        "training": "failed",
        "quantization": "not claimed",
    }
    assert report.verdict == "waived: bitstream; incomplete: rendering; failed: training; not claimed: quantization"
    assert not report.passed
    assert replace(report, results=RESULTS[6:]).passed
    assert not replace(report, results=RESULTS[4:]).passed
    assert not replace(report, results=RESULTS[4:6]).passed


def test_the_console(report):
    lines = describe(report, 10)
    text = "\n".join(lines)
    assert last_line(report) == "FAILED; 1 waived"
    assert "Probable cause: a factor of two (scale: 1 of 1 examined)" in lines
    assert "1 operation: unsupported (1 vector)" in lines
    assert not any(line.startswith("halve ") for line in lines)
    assert "FAIL core/scale/wrong: Shows wrong." in lines
    assert "  scaled is inf" in lines
    assert "  looks like a factor of two" in lines
    assert "  again: gsvc-conformance run --impl ./toy --case core/scale/wrong" in lines
    assert lines[-2:] == ["", f"begin with: {report.again(report.simplest_first()[0].id)}"]
    assert not any("begin with" in line for line in describe(replace(report, results=RESULTS[4:]), 10))
    assert "CRASH core/scale/dead" in text
    assert "1 waived: bug 12 (parse 1)" in lines
    assert "note: a note" in text
    row = next(line for line in lines if line.startswith("scale ")).split()
    assert row == ["scale", "4", "2", "2", "0", "0", "infinite"]


def test_the_console_describes_no_more_failures_than_it_is_told(report):
    lines = describe(report, 1)
    assert sum(line.startswith(("FAIL ", "CRASH ")) for line in lines) == 1
    assert any("1 more vector" in line for line in lines)


def test_a_selection_stands_beside_the_verdict(report):
    text = "\n".join(describe(replace(report, selection="operation parse"), 10))
    assert "of operation parse only" in text


def test_what_the_implementation_tells_of_its_environment(report):
    assert describe(report, 0)[0].startswith("operation ")
    told = replace(report, runs_on={"device": "a GPU", "driver version": "1.2"})
    assert describe(told, 0)[:3] == ["device          a GPU", "driver version  1.2", ""]
    assert "a GPU" in report_html(told)
    assert from_object(json.loads(to_text(told))) == told
    assert from_object({name: value for name, value in to_object(report).items() if name != "runs_on"}) == report
    for suite in ET.fromstring(junit_xml(told).encode()):
        assert suite[0].tag == "properties"
        properties = {entry.get("name"): entry.get("value") for entry in suite[0]}
        mine = {"implementation.device": "a GPU", "implementation.driver version": "1.2"}
        assert properties == {**told.environment, **mine}


def test_progress():
    assert progress_text("scale", Counter({"pass": 2, "fail": 1, "crash": 1})) == "scale: 2 pass, 2 wrong"
    assert progress_text("paint", Counter({"pass": 1, "unsupported": 1})) == "paint: 1 pass, 1 unsupported"


def test_json_and_back(report):
    text = json.dumps(to_object(report), allow_nan=False)
    assert to_object(from_object(json.loads(text))) == json.loads(text)
    assert from_object(json.loads(text)) == report
    value = json.loads(text)
    assert (value["passed"], value["operations"][2]["fail"]) == (False, 1)
    assert value["results"][2]["outputs"][0]["ratio"] == "infinite"


def test_json_is_a_line_a_result_and_tells_nothing_twice(report):
    text = to_text(report)
    assert json.loads(text) == to_object(report)
    lines = [json.loads(line.rstrip(",")) for line in text.splitlines() if line.startswith('{"id"')]
    assert [line["id"] for line in lines] == [result.id for result in RESULTS]
    assert lines[0] == {
        "id": "core/scale/good", "title": "Shows good.", "class": "training", "outcome": "pass", "seconds": 0.0,
        "outputs": [{"name": "scaled", "check": "bounded", "passed": True, "ratio": 0.5, "place": [2, 1]}],
    }  # fmt: skip
    single = result("single", outputs=(OutputResult("loss", "bounded", True, ratio=0.0, place=()),))
    again = from_object(json.loads(to_text(replace(report, results=[single]))))
    assert again.results == [single]


@pytest.mark.parametrize(
    "value", [[], 1, None, {}, {"format": "another/1"}, {"format": "gsvc-conformance-report/1", "results": [{}]}]
)
def test_json_of_something_else_is_refused(value):
    with pytest.raises(UsageError):
        from_object(value)


def test_the_command_of_the_whole_run_has_what_was_selected(report):
    selected = replace(report, options="--operation scale --skip '*/n*'")
    assert selected.whole_command == "gsvc-conformance run --impl ./toy --operation scale --skip '*/n*'"
    assert (report.whole_command, selected.again("a/b/c")) == (report.command, f"{report.command} --case a/b/c")
    assert from_object(json.loads(to_text(selected))) == selected


def test_the_simplest_failures_come_first(report):
    faults = [replace(result(f"n{n}", "fail"), size=size) for n, size in enumerate((9, 2, 7, 3))]
    faults += [replace(result("stream", "fail"), id="core/read_stream/tiny", size=1)]
    faults += [replace(result("plane", "fail"), id="core/decode_plane/large", size=99)]
    faults += [replace(result("stress", "fail"), id="stress/decode_plane/small", size=1)]
    names = [fault.id.split("/")[1:] for fault in replace(report, results=faults).simplest_first()]
    assert [slug for operation, slug in names if operation == "scale"] == ["n1", "n3", "n2", "n0"]
    order = [slug for operation, slug in names if operation != "scale"]
    assert order == ["large", "small", "tiny"]  # a leaf operation, core before stress, then what is made of it


def test_json_with_an_unknown_outcome_is_refused(report):
    value = to_object(report)
    value["results"][0]["outcome"] = "perfect"
    with pytest.raises(UsageError, match="perfect"):
        from_object(value)


def test_junit(report):
    root = ET.fromstring(junit_xml(report).encode())
    suites = {suite.get("name"): suite for suite in root}
    counts = {
        name: [suite.get(k) for k in ("tests", "failures", "errors", "skipped")] for name, suite in suites.items()
    }
    assert counts == {
        "parse": ["2", "0", "0", "1"],
        "paint": ["2", "0", "0", "1"],
        "scale": ["4", "1", "1", "0"],
        "halve": ["1", "0", "0", "1"],
    }
    failure = root.find(".//failure")
    assert failure.get("message") == "fail: scaled is inf"
    assert "looks like a factor of two" in failure.text
    assert root.find(".//system-out").text == r"before\x00\x1b[31m the end"
    assert suites["parse"].get("time") == "1.500"


def test_what_is_incomplete_is_no_failure(report):
    results = [
        result("good", operation="halve"),
        result("none", "unsupported", operation="halve", outputs=()),
        *(result(slug, "unsupported", outputs=()) for slug in ("a", "b")),
    ]
    partial = replace(report, results=results)
    (quantization,) = (group for group in partial.groups() if group.name == "quantization")
    assert quantization.verdict == "incomplete"
    assert quantization.reason == "1 vector pass, none is wrong; without part of halve (1 vector: core/halve/none)"
    assert (partial.conclusion, partial.exit_code, partial.passed) == ("incomplete", 0, False)
    assert last_line(partial) == "NOTHING IS WRONG; no class is complete"
    assert "failure" not in {element.tag for element in ET.fromstring(junit_xml(partial).encode()).iter()}
    page = report_html(partial)
    assert '<p class="verdict warn">Nothing is wrong; no class is complete</p>' in page
    assert '<span class="badge warn">incomplete</span>' in page
    assert "<p>1 operation: unsupported (2 vectors).</p>" in page
    more = replace(partial, results=[*results, result("eight_bits", operation="paint")])
    assert (last_line(more), more.exit_code) == ("NOTHING IS WRONG, but incomplete: quantization", 0)
    wrong = replace(partial, results=[*results, result("b", "fail", operation="paint")])
    assert (last_line(wrong), wrong.exit_code) == ("FAILED", 1)


def test_nothing_judged_is_no_success(report):
    for outcome in ("unsupported", "skipped", "waived"):
        nothing = replace(report, results=[result("a", outcome, outputs=())])
        assert (nothing.conclusion, nothing.exit_code) == ("nothing judged", 2)
        assert last_line(nothing).startswith("NOTHING WAS JUDGED")
        assert "Nothing was judged" in report_html(nothing)


def test_classes_come_in_the_order_of_the_specification(report):
    assert [group.name for group in report.groups()] == ["bitstream", "rendering", "training", "quantization"]


def test_causes_are_told_once_and_the_most_frequent_first(report):
    def wrong(slug, *causes, operation="scale"):
        return result(slug, "fail", operation=operation, causes=causes)

    results = [
        wrong("a", "one"),
        wrong("b", "two", "covered"),
        wrong("c", "two"),
        wrong("d", "two", operation="halve"),
        *(wrong(f"m{n}", "one") for n in range(4)),
        *(wrong(f"n{n}", "two") for n in range(5)),
        wrong("o", "rare"),
        *(wrong(f"p{n}") for n in range(9)),
        wrong("e", "three", operation="paint"),
        wrong("f", "errors in red alone", operation="paint"),
    ]
    assert cause_lines(replace(report, results=results)) == [
        "two (scale: 7 of 12 examined, halve: 1 of 1 examined)",
        "one (scale: 5 of 12 examined)",
        "three (paint: 1 of 2 examined; run the whole operation to be sure)",
    ]


def test_few_failures_tell_where_and_not_why(report):
    def lines(*causes, others=()):
        results = [result(f"n{n}", "fail", causes=[cause]) for n, cause in enumerate(causes)]
        found = describe(replace(report, results=[*results, *others]), 0)
        return [line for line in found if line.startswith(("where: ", "Probable cause: "))]

    sure = "; run the whole operation to be sure"
    tiles = "every second of the tiles of 32x32 are wrong (number 1 of each 2)"
    assert lines(tiles) == [f"where: {tiles} (scale: 1 of 1 examined{sure})"]
    assert lines("errors in red alone", "errors in red alone")[0].startswith("where: errors in red")
    assert lines(tiles, tiles, tiles) == [f"Probable cause: {tiles} (scale: 3 of 3 examined)"]
    assert lines("a mutant") == [f"Probable cause: a mutant (scale: 1 of 1 examined{sure})"]
    passing = [result(f"p{n}") for n in range(2)]
    assert lines("a mutant", others=passing) == ["Probable cause: a mutant (scale: 1 of 1 examined)"]
    few = replace(report, results=[result("a", "fail", causes=[tiles])])
    assert "<h2>Where the errors are</h2>" in report_html(few)
    assert "#### Where the errors are\n\n1. where: every second" in summary_markdown(few)


def test_waived_failures_are_counted_by_reason(report):
    long = "a reason " + "that goes on " * 40
    waived = [
        result(f"n{n}", "waived", message=f"{long if n else 'bug 12'} (waived fail: output is {n})") for n in range(75)
    ]
    waived.append(result("other", "waived", operation="parse", message="bug 12 (waived crash: killed)"))
    many = replace(report, results=[result("good"), *waived])
    first, second = [line for line in describe(many, 10) if " waived: " in line and not line.startswith("class")]
    assert first.startswith("74 waived: a reason that goes on")
    assert first.endswith("... (scale 74)")
    assert len(first) < 160
    assert second == "2 waived: bug 12 (scale 1, parse 1)"
    assert [line for line in describe(many, 1) if " waived" in line][:2] == [first, "2 waived for 1 more reason"]
    assert last_line(many).endswith("; 76 waived")


def test_both_ends_of_what_a_command_printed_are_shown():
    assert ends("a\n\nb") == ["a", "b"]
    assert ends("\n".join("abcdefgh")) == ["a", "b", "c", "...", "f", "g", "h"]
    (line,) = ends("x" * 10_000)
    assert len(line) < 300
