"""The reports of a run: the console, JSON, JUnit XML, the page and its pictures."""

import base64
import io
import json
import math
import re
from dataclasses import replace
from html.parser import HTMLParser
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from PIL import Image
from toy_operations import OPERATIONS, REFERENCE, paint

from gsvc_conformance.expectations import Bounded, Decision, Exact, Interval
from gsvc_conformance.implementations import ModuleImplementation
from gsvc_conformance.report.console import cause_lines, describe, ends, last_line, progress_text
from gsvc_conformance.report.json import from_object, to_object, to_text
from gsvc_conformance.report.junit import junit_xml
from gsvc_conformance.report.page import MAX_FAULTS, report_html
from gsvc_conformance.report.pictures import (
    NOT_FINITE,
    WORST_OF_OPERATION,
    PictureBook,
    error_ratios,
    pictures_of,
    ramp,
)
from gsvc_conformance.results import OutputResult, Report, Result
from gsvc_conformance.runner import judge_vector
from gsvc_conformance.vector_folder import Selection, VectorFolder
from gsvc_conformance.vectors import Vector
from gsvc_ref.errors import UsageError

EVIL = '<script>alert("&")</script>'


def result(slug, outcome="pass", operation="scale", tier="core", ratio=0.5, **changes) -> Result:
    output = OutputResult("scaled", "bounded", outcome == "pass", "", ratio, (2, 1))
    group = OPERATIONS[operation].group
    return replace(Result(f"{tier}/{operation}/{slug}", f"Shows {slug}.", group, outcome, "", (output,)), **changes)


RESULTS = [
    result("good"),
    result("also_good", ratio=0.75),
    result("wrong", "fail", ratio=math.inf, message="scaled is inf", causes=("a factor of two",)),
    result("dead", "crash", message="killed by SIGSEGV", log="before\x00\x1b[31m the end", outputs=()),
    result("none", "unsupported", operation="halve", outputs=()),
    result("ten_bits", "unsupported", operation="paint", tier="uncommon", outputs=()),
    result("eight_bits", operation="paint", ratio=None),
    result("known", "waived", operation="parse", message="bug 12 (waived fail: is 1)"),
    result("fine", operation="parse", ratio=None, seconds=1.5),
]
ENVIRONMENT = {"implementation": "./toy", "vectors": "0" * 64}


@pytest.fixture
def report(toys) -> Report:
    return Report(ENVIRONMENT, "gsvc-conformance run --impl ./toy", "", ["a note"], RESULTS)


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
    assert last_line(report) == "FAILED"
    assert "Probable cause: a factor of two (scale: 1 of 1 examined)" in lines
    assert "1 operation: unsupported (1 vector)" in lines
    assert not any(line.startswith("halve ") for line in lines)
    assert "FAIL core/scale/wrong: Shows wrong." in lines
    assert "  scaled is inf" in lines
    assert "  looks like a factor of two" in lines
    assert "  again: gsvc-conformance run --impl ./toy --case core/scale/wrong" in lines
    assert "CRASH core/scale/dead" in text
    assert "waived: core/parse/known: bug 12" in text
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
    assert progress_text("scale", RESULTS) == "scale: 2 pass, 2 wrong"
    assert progress_text("paint", RESULTS) == "paint: 1 pass, 1 unsupported"


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
    assert quantization.reason == "1 vector pass, none is wrong; without part of halve (1 vector)"
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
        "three (paint: 1 of 2 examined)",
    ]


def test_both_ends_of_what_a_command_printed_are_shown():
    assert ends("a\n\nb") == ["a", "b"]
    assert ends("\n".join("abcdefgh")) == ["a", "b", "c", "...", "f", "g", "h"]
    (line,) = ends("x" * 10_000)
    assert len(line) < 300


class Page(HTMLParser):
    """The contents of a page; fails where tags do not match."""

    VOID = ("meta", "img", "br", "link")

    def __init__(self, text) -> None:
        super().__init__()
        self.tags, self.open, self.sources, self.texts = [], [], [], []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs) -> None:
        self.tags.append(tag)
        self.sources += [value for name, value in attrs if name in ("src", "href", "srcset")]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data) -> None:
        self.texts.append(data)


def test_the_page_is_whole_and_needs_nothing(report, failing):
    text = report_html(report, {"core/scale/wrong": pictures_of(*failing)})
    page = Page(text)
    assert "script" not in page.tags
    assert len(page.sources) == 3
    assert all(source.startswith("data:image/png;base64,") for source in page.sources)
    assert not re.findall(r"(?:https?:)?//|@import|url\(", "".join(re.split(r"base64,[^\"]*", text)))
    shown = " ".join(page.texts)
    for part in (
        "Failed",
        "Probable cause",
        "a factor of two (scale: 1 of 1 examined)",
        "core/scale/wrong",
        "looks like a factor of two",
        "killed by SIGSEGV",
        "bug 12",
        "a note",
    ):
        assert part in shown
    assert "prefers-color-scheme: dark" in text
    assert 'name="viewport"' in text


def test_the_page_escapes_what_others_wrote(report):
    evil = [result("a", "fail", message=EVIL, title=EVIL, causes=(EVIL,), log=EVIL)]
    page = Page(
        report_html(
            replace(report, results=evil, environment={EVIL: EVIL}, runs_on={EVIL: EVIL}, notes=[EVIL], command=EVIL)
        )
    )
    assert "script" not in page.tags
    assert EVIL in page.texts


def test_the_page_of_many_failures_is_not_endless(report):
    many = [result(f"n{n}", "fail", message="is wrong") for n in range(MAX_FAULTS + 5)]
    text = report_html(replace(report, results=many))
    assert text.count('class="fault"') == MAX_FAULTS
    assert "5 more" in text


# Pictures


def vector_of(expectation, name="frame", **inputs) -> Vector:
    return Vector("core/paint/x", {"title": "x"}, OPERATIONS["paint"], inputs, {name: expectation})


def judged(expectation, actual, **inputs):
    vector = vector_of(expectation, **inputs)
    implementation = ModuleImplementation("", {"paint": lambda **_: {"frame": actual}})
    return vector, {"frame": actual}, judge_vector(implementation, vector).result


@pytest.fixture
def failing():
    frame = paint(7, 5, 8)["frame"]
    return judged(Interval(frame, frame, frame), 255 - frame, bit_depth=8)


def pixels(picture):
    data = base64.b64decode(picture.uri.removeprefix("data:image/png;base64,"))
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


def test_pictures_of_a_frame(failing):
    expected, actual, error = pictures_of(*failing)
    frame = paint(7, 5, 8)["frame"]
    assert np.array_equal(pixels(expected), frame)
    assert np.array_equal(pixels(actual), 255 - frame)
    assert pixels(error).shape == (5, 7, 3)
    assert (expected.caption, actual.caption) == ("frame, expected", "frame, actual")


def test_pictures_of_deep_frames_fill_the_scale():
    frame = paint(4, 3, 10)["frame"]
    frame[0, 0] = 1023
    expected, *_ = pictures_of(*judged(Exact(frame), frame // 2, bit_depth=10))
    assert pixels(expected)[0, 0].tolist() == [255, 255, 255]


def test_pictures_of_a_sequence_are_of_the_worst_frame():
    frames = np.stack([paint(4, 3, 8)["frame"]] * 3)
    wrong = frames.copy()
    wrong[2, 1, 1] = 200
    _, actual, error = pictures_of(*judged(Exact(frames), wrong))
    assert "(frame 2)" in actual.caption
    assert tuple(pixels(error)[1, 1]) == NOT_FINITE
    assert tuple(pixels(error)[0, 0]) == tuple(ramp(np.zeros(1))[0])


def test_pictures_of_a_table_are_its_transpose_around_the_worst_row():
    table = np.linspace(-1, 1, 4000).reshape(1000, 4)
    wrong = table.astype("<f4")
    wrong[900, 3] = np.nan
    expected, actual, error = pictures_of(*judged(Bounded(table, np.full(table.shape, 1e-6)), wrong))
    assert "rows 744 to 999" in expected.caption
    assert pixels(actual).shape[1] == 256
    assert tuple(pixels(actual)[-1, 900 - 744]) == NOT_FINITE
    assert tuple(pixels(error)[-1, 900 - 744]) == NOT_FINITE


def test_what_cannot_be_shown_has_no_pictures():
    frame = paint(4, 3, 8)["frame"]
    for actual in (frame[:2], frame.astype("<u2"), None, np.float32(3)):
        assert pictures_of(*judged(Exact(frame), actual)) == []
    assert pictures_of(*judged(Exact(np.asarray(3)), np.asarray(4))) == []


def test_error_ratios():
    five = np.array([5.0, 5.0, 5.0])
    bounded = Bounded(five, np.array([0.5, 0.0, 0.0]))
    assert error_ratios(bounded, np.array([5.25, 5, 6], "<f4")).tolist() == [0.5, 0, math.inf]
    assert error_ratios(bounded, np.array([np.nan, np.inf, 5], "<f4")).tolist() == [math.inf, math.inf, 0]
    low, high = np.array([3, 3, 3], "|u1"), np.array([4, 4, 4], "|u1")
    assert error_ratios(Interval(low, low, high), np.array([0, 4, 6], "|u1")).tolist() == [4, 0, 3]
    assert error_ratios(Decision(low, high), np.array([3, 4, 5], "|u1")).tolist() == [0, 0, math.inf]
    assert error_ratios(Exact(low), high).tolist() == [math.inf] * 3


def test_errors_of_exact_numbers_are_in_units_in_the_last_place():
    one, up = np.float32(1), np.nextafter(np.float32(1), np.float32(2))
    expected = np.array([one, one, 0, -0.0, -(2.0**-149), np.inf, np.nan, 1], "<f4")
    actual = np.array([one, up, -0.0, -0.0, 2.0**-149, np.inf, np.nan, np.nan], "<f4")
    assert error_ratios(Exact(expected), actual).tolist() == [0, 1, 1, 0, 2, 0, 0, math.inf]
    wide = expected.astype("<f8")
    assert error_ratios(Exact(wide), np.nextafter(wide, 2))[0] == 1


def test_pictures_name_the_worst_pixel(failing):
    assert re.fullmatch(r"error/bound, the worst in row \d, column \d", pictures_of(*failing)[2].caption)
    picture = np.linspace(0, 1, 36, dtype="<f4").reshape(4, 3, 3)
    wrong = picture.copy()
    wrong[2, 1, 0] += np.float32(0.25)
    caption = pictures_of(*judged(Exact(picture), wrong))[2].caption
    assert caption == "error in units in the last place, the worst in row 2, column 1"


def test_the_simplest_failures_come_first(report, failing):
    faults = [replace(result(f"n{n}", "fail"), size=size) for n, size in enumerate((9, 2, 7, 3))]
    faults += [replace(result("stream", "fail"), id="core/read_stream/tiny", size=1)]
    faults += [replace(result("plane", "fail"), id="core/decode_plane/large", size=99)]
    faults += [replace(result("stress", "fail"), id="stress/decode_plane/small", size=1)]
    shown = replace(report, results=faults)
    names = [fault.id.split("/")[1:] for fault in shown.simplest_first()]
    assert [slug for operation, slug in names if operation == "scale"] == ["n1", "n3", "n2", "n0"]
    order = [slug for operation, slug in names if operation != "scale"]
    assert order == ["large", "small", "tiny"]  # a leaf operation, core before stress, then what is made of it
    text = report_html(shown).split("What is wrong")[1]
    assert re.findall(r"</span> \w+/\w+/(\w+)</h3>", text) == [
        fault.id.split("/")[2] for fault in shown.simplest_first()
    ]


def test_the_ramp_tells_allowed_from_not():
    inside, outside = ramp(np.array([0.0, 0.5, 1.0])), ramp(np.array([1.001, 10.0, 1e4, 1e9]))
    assert np.all(inside[:, 1].astype(int) > inside[:, 0])  # green
    assert np.all(outside[:, 0].astype(int) > outside[:, 1])  # yellow to red
    assert np.all(np.diff(outside[:, 1].astype(int)) <= 0)


def test_the_book_keeps_the_worst_of_each_operation(folder):
    book, vectors = PictureBook(), VectorFolder(folder)
    (vector,) = vectors.read(vectors.select(Selection(patterns=("by_a_third",))))
    for step in (1, 5, 3, 9, 2):
        wrong = ModuleImplementation(
            "", {**REFERENCE, "scale": lambda values, factor, step=step: {"scaled": values * step}}
        )
        renamed = replace(vector, id=f"core/scale/step_{step}")
        judgement = judge_vector(wrong, renamed)
        book.add(renamed, judgement.outputs, judgement.result)
    assert len(book.pictures()) == WORST_OF_OPERATION
    assert set(book.pictures()) == {"core/scale/step_3", "core/scale/step_5", "core/scale/step_9"}
