"""The page of a run, its pictures and its tables of elements."""

import base64
import hashlib
import io
import math
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image
from toy_operations import OPERATIONS, REFERENCE, paint
from toy_reports import result

from gsvc_conformance.expectations import Bounded, Decision, Exact, Interval
from gsvc_conformance.implementations import ModuleImplementation
from gsvc_conformance.operation import operations
from gsvc_conformance.report import failures
from gsvc_conformance.report.element_tables import MAX_ROWS, element_table
from gsvc_conformance.report.failures import MAX_FAULTS
from gsvc_conformance.report.measures import NOT_FINITE, error_ratios, ramp
from gsvc_conformance.report.page import report_html
from gsvc_conformance.report.pictures import SIMPLEST, WINDOW, PictureBook, view_of
from gsvc_conformance.report.png import png
from gsvc_conformance.runner import judge_vector
from gsvc_conformance.vector import Vector
from gsvc_conformance.vector_folder import Selection, VectorFolder

EVIL = '<script>alert("&")</script>'


class Page(HTMLParser):
    """The contents of a page; fails where tags do not match."""

    VOID = ("meta", "img", "br", "link", "input")

    def __init__(self, text) -> None:
        super().__init__()
        self.tags, self.open, self.sources, self.links, self.names, self.texts = [], [], [], [], [], []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs) -> None:
        self.tags.append(tag)
        self.sources += [value for name, value in attrs if name in ("src", "srcset")]
        self.links += [value for name, value in attrs if name == "href"]
        self.names += [value for name, value in attrs if name == "id"]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data) -> None:
        self.texts.append(data)


def test_the_page_is_whole_and_needs_nothing(report, failing):
    text = report_html(report, {"core/scale/wrong": view_of(*failing)})
    page = Page(text)
    assert len(page.sources) == 1 + 3  # the legend, and three pictures
    assert all(source.startswith("data:image/png;base64,") for source in page.sources)
    assert not re.findall(r"(?:https?:)?//(?! )|@import|url\(", "".join(re.split(r"base64,[^\"]*", text)))
    shown = " ".join(page.texts)
    for part in (
        "Failed",
        "Probable cause",
        "(scale: 1 of 1 examined)",
        "core/scale/wrong",
        "looks like a factor of two",
        "killed by SIGSEGV",
        "gsvc-conformance run --impl ./toy --operation scale",
        "gsvc-conformance run --impl ./toy --case core/scale/dead",
        "bug 12",
        "a note",
    ):
        assert part in shown
    assert "prefers-color-scheme: dark" in text
    assert 'name="viewport"' in text


def test_every_link_of_the_page_leads_somewhere(report):
    page = Page(report_html(report))
    assert {"#operation-scale", "#core/scale/wrong", "#core/scale/dead", "#cause-1"} == set(page.links)
    assert {link[1:] for link in page.links} <= set(page.names)
    assert len(set(page.names)) == len(page.names)


def test_the_browser_may_run_the_script_of_the_page_and_no_other(report):
    text = report_html(report)
    (script,) = re.findall("<script>(.*?)</script>", text, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'" in text


def test_the_page_escapes_what_others_wrote(report):
    evil = [result("a", "fail", message=EVIL, title=EVIL, causes=(EVIL,), log=EVIL)]
    texts = {EVIL: EVIL}
    shown = replace(report, results=evil, environment=texts, runs_on=texts, notes=[EVIL], command=EVIL, options=EVIL)
    page = Page(report_html(shown))
    assert page.tags.count("script") == 1
    assert EVIL in page.texts


def test_the_page_of_many_failures_is_not_endless(report, failing, monkeypatch):
    many = [result(f"n{n}", "fail", message="is wrong") for n in range(MAX_FAULTS + 5)]
    text = report_html(replace(report, results=many))
    assert text.count('class="fault"') == MAX_FAULTS
    assert "5 more stand in the table" in text
    view = view_of(*failing)
    monkeypatch.setattr(failures, "MAX_VIEW_BYTES", 5 * len(failures._view(view)))
    drawn = report_html(replace(report, results=many[:9]), {f"core/scale/n{n}": view for n in range(9)})
    assert drawn.count("<figure><div") == 5 * 3
    assert "The pictures of 4 failures are left out" in drawn


def test_what_is_open_is_the_simplest_failure(report):
    faults = [result(f"n{n}", "fail", size=size) for n, size in enumerate((9, 2, 7))]
    faults += [result("simple", "fail", operation="halve", size=1)]
    shown = replace(report, results=faults)
    text = report_html(shown)
    simplest = shown.simplest_first()[0].id
    assert re.findall(r'<details class="fault" id="([^"]+)"[^>]* open>', text) == [simplest]
    assert re.findall(r'<details class="group" id="([^"]+)" open>', text) == [f"operation-{simplest.split('/')[1]}"]
    assert re.findall(r'class="fault" id="core/scale/(\w+)"', text) == ["n1", "n2", "n0"]


# Pictures


def vector_of(expectation, name="frame", operation=None, **inputs) -> Vector:
    known = OPERATIONS["paint"] if operation is None else operation
    return Vector(f"core/{known.name}/x", {"title": "x"}, known, inputs, {name: expectation})


def judged(expectation, actual, name="frame", operation=None, **inputs):
    vector = vector_of(expectation, name, operation, **inputs)
    implementation = ModuleImplementation("", {vector.operation.name: lambda **_: {name: actual}})
    return vector, {name: actual}, judge_vector(implementation, vector).result


@pytest.fixture
def failing():
    frame = paint(7, 5, 8)["frame"]
    return judged(Interval(frame, frame, frame), 255 - frame, bit_depth=8)


def pixels(picture):
    data = base64.b64decode(picture.uri.removeprefix("data:image/png;base64,"))
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


@pytest.mark.parametrize("shape", [(1, 1, 3), (5, 7, 3), (40, 30, 3)])
def test_png_is_exact(shape):
    picture = np.random.default_rng(1).integers(0, 256, shape, np.uint8)  # the largest has too many for a palette
    for expected in (picture, picture & 128):
        image = Image.open(io.BytesIO(png(expected)))
        assert np.array_equal(np.asarray(image.convert("RGB")), expected)
        assert image.mode == ("P" if len(np.unique(expected.reshape(-1, 3), axis=0)) <= 256 else "RGB")


def test_pictures_of_a_frame(failing):
    expected, actual, error = view_of(*failing)
    frame = paint(7, 5, 8)["frame"]
    assert np.array_equal(pixels(expected), frame)
    assert np.array_equal(pixels(actual), 255 - frame)
    assert pixels(error).shape == (5, 7, 3)
    assert (expected.caption, actual.caption) == ("frame, expected", "frame, actual")
    assert {(picture.width, picture.height, picture.mark) for picture in (expected, actual, error)} == {
        (7, 5, error.mark)
    }


def test_pictures_of_deep_frames_fill_the_scale():
    frame = paint(4, 3, 10)["frame"]
    frame[0, 0] = 1023
    expected, *_ = view_of(*judged(Exact(frame), frame // 2, bit_depth=10))
    assert pixels(expected)[0, 0].tolist() == [255, 255, 255]


def test_pictures_of_a_sequence_are_of_the_worst_frame():
    decode = operations()["decode_stream"]
    frames = np.stack([paint(4, 3, 8)["frame"]] * 3)
    wrong = frames.copy()
    wrong[2, 1, 1] = 200
    _, actual, error = view_of(*judged(Exact(frames), wrong, "frames", decode))
    assert "(frame 2)" in actual.caption
    assert error.mark == (1, 1)
    steps = 1 + abs(200 - int(frames[2, 1, 1].min()))
    assert tuple(pixels(error)[1, 1]) == tuple(ramp(np.array([float(steps)]))[0])
    assert tuple(pixels(error)[0, 0]) == tuple(ramp(np.zeros(1))[0])


def test_a_large_picture_is_shown_around_its_worst_pixel():
    picture = np.zeros((3, 1000, 3), "<f4")
    wrong = picture.copy()
    wrong[1, 900] = 1
    _, actual, error = view_of(*judged(Exact(picture), wrong))
    assert (actual.width, actual.height) == (WINDOW, 3)
    assert f"columns {900 - WINDOW // 2} to {899 + WINDOW // 2} of 1,000" in actual.caption
    assert error.mark == (WINDOW // 2, 1)
    assert pixels(actual)[error.mark[1], error.mark[0]].tolist() == [255, 255, 255]


def test_small_and_negative_values_are_painted_so_that_they_are_seen():
    residual = np.full((2, 2, 3), 1e-4, "<f4")
    expected, *_ = view_of(*judged(Exact(residual), residual * 0))
    assert pixels(expected)[0, 0, 0] == 255
    assert expected.caption.endswith("white is 0.0001")
    residual[0] *= -1
    expected, actual, _ = view_of(*judged(Exact(residual), residual * 0))
    assert (pixels(expected)[0, 0, 0], pixels(expected)[1, 0, 0], pixels(actual)[0, 0, 0]) == (0, 255, 128)
    assert "grey is 0" in expected.caption


def test_what_cannot_be_shown_has_no_pictures():
    frame = paint(4, 3, 8)["frame"]
    for actual in (frame[:2], frame.astype("<u2"), None, np.float32(3)):
        assert view_of(*judged(Exact(frame), actual)) is None
    assert view_of(*judged(Exact(np.asarray(3)), np.asarray(4))) is None


def test_pictures_name_the_worst_pixel(failing):
    assert re.fullmatch(r"1 \+ error in steps, the worst in row \d, column \d", view_of(*failing)[2].caption)
    picture = np.linspace(0, 1, 36, dtype="<f4").reshape(4, 3, 3)
    wrong = picture.copy()
    wrong[2, 1, 0] += np.float32(0.25)
    caption = view_of(*judged(Exact(picture), wrong))[2].caption
    assert caption == "error in units in the last place, the worst in row 2, column 1"


def test_the_book_keeps_the_simplest_of_each_operation_and_the_worst(folder):
    book, vectors = PictureBook(), VectorFolder(folder)
    (vector,) = vectors.read(vectors.select(Selection(patterns=("by_a_third",))))
    for step, size in ((1, 40), (5, 30), (3, 10), (99, 60), (2, 20)):
        wrong = ModuleImplementation(
            "", {**REFERENCE, "scale": lambda values, factor, step=step: {"scaled": values * step}}
        )
        judgement = judge_vector(wrong, replace(vector, id=f"core/scale/step_{step}"))
        book.add(judgement.vector, judgement.outputs, replace(judgement.result, size=size))
    assert SIMPLEST == 3
    assert set(book.pictures()) == {f"core/scale/step_{step}" for step in (3, 2, 5, 99)}


# Errors


def test_error_ratios():
    five = np.array([5.0, 5.0, 5.0])
    bounded = Bounded(five, np.array([0.5, 0.0, 0.0]))
    assert error_ratios(bounded, np.array([5.25, 5, 6], "<f4")).tolist() == [0.5, 0, math.inf]
    assert error_ratios(bounded, np.array([np.nan, np.inf, 5], "<f4")).tolist() == [math.inf, math.inf, 0]
    endless = Bounded(np.array([np.inf, -np.inf]), np.zeros(2))
    assert error_ratios(endless, np.array([np.inf, np.inf], "<f4")).tolist() == [0, math.inf]
    low, high = np.array([3, 3, 3], "|u1"), np.array([4, 4, 4], "|u1")
    assert error_ratios(Interval(low, low, high), np.array([0, 4, 6], "|u1")).tolist() == [4, 0, 3]
    assert error_ratios(Decision(low, high), np.array([3, 4, 6], "|u1")).tolist() == [0, 0, 3]
    assert error_ratios(Exact(low), high).tolist() == [2] * 3


def test_errors_of_exact_numbers_are_in_units_in_the_last_place():
    one, up = np.float32(1), np.nextafter(np.float32(1), np.float32(2))
    expected = np.array([one, one, 0, -0.0, -(2.0**-149), np.inf, np.nan, 1], "<f4")
    actual = np.array([one, up, -0.0, -0.0, 2.0**-149, np.inf, np.nan, np.nan], "<f4")
    assert error_ratios(Exact(expected), actual).tolist() == [0, 1, 1, 0, 2, 0, 0, math.inf]
    wide = expected.astype("<f8")
    assert error_ratios(Exact(wide), np.nextafter(wide, 2))[0] == 1


def test_the_ramp_is_logarithmic_and_tells_allowed_from_not():
    inside, outside = ramp(np.array([0.0, 0.01, 0.1, 1.0])), ramp(np.array([1.001, 10.0, 100.0, 1e4, 1e6, 1e9]))
    assert np.all(inside[:, 1].astype(int) > inside[:, 0])  # green
    assert np.all(outside[:, 0].astype(int) > outside[:, 1])  # yellow to red
    assert np.all(np.diff(outside[:, 1].astype(int)) <= 0)
    even = np.diff(ramp(np.array([1e-3, 1e-2, 1e-1, 1.0]))[:, 1].astype(int))
    assert np.ptp(even) <= 1  # a power of ten is a step
    assert tuple(ramp(np.array([math.inf]))[0]) == NOT_FINITE


# Tables


GRADIENTS = operations()["render_gradients"]


def gradients(count=30):
    expected = np.linspace(-1, 1, 8 * count).reshape(count, 8)
    return Bounded(expected, np.full(expected.shape, 1e-6)), expected.astype("<f4")


def test_a_table_has_the_worst_splats_first_with_what_is_expected_and_given():
    expectation, given = gradients()
    given[7, 3], given[9, 2], given[4, 0] = np.nan, 5, given[4, 0] + np.float32(1e-5)
    table = view_of(*judged(expectation, given, "gradients", GRADIENTS))
    assert [name for name, _ in table.rows] == ["splat 7", "splat 9", "splat 4"]
    assert table.columns == ("x", "y", "l11", "l21", "l22", "red", "green", "blue")
    wrong = {(name, table.columns[k]): cell for name, cells in table.rows for k, cell in enumerate(cells) if cell.color}
    assert set(wrong) == {("splat 7", "l21"), ("splat 9", "l11"), ("splat 4", "x")}
    cell = wrong["splat 9", "l11"]
    expected = expectation.value[9, 2]
    assert (cell.given, cell.expected, cell.ratio) == ("5", f"{expected:.6g}", f"× {5 / expected:.4g}")
    assert wrong["splat 7", "l21"].given == "nan"
    assert wrong["splat 7", "l21"].color[0] == "#ff00c8"
    assert table.title == "gradients: 3 wrong rows; 27 rows right. The colour is error/bound."


def test_a_table_says_how_many_rows_it_leaves_out():
    expectation, given = gradients()
    table = element_table(GRADIENTS, "gradients", expectation, given * 0)
    assert len(table.rows) == MAX_ROWS
    assert f"the {MAX_ROWS} worst of 30 wrong rows, {30 - MAX_ROWS} left out" in table.title


def test_a_table_of_what_is_wrong_as_a_whole_only():
    expectation, given = gradients()
    table = element_table(GRADIENTS, "gradients", expectation, given)
    assert table.title.startswith("gradients: no row is wrong by itself, but all together are; the 1 row with")


def test_elements_of_what_is_no_matrix():
    symbols = np.arange(20, dtype="<u2")
    wrong = symbols.copy()
    wrong[[3, 5]] = 9
    table = view_of(*judged(Exact(symbols), wrong, "symbols", operations()["decode_plane"]))
    assert [(name, cells[0].given, cells[0].expected, cells[0].ratio) for name, cells in table.rows] == [
        ("symbol 3", "9", "3", "+6"), ("symbol 5", "9", "5", "+4")
    ]  # fmt: skip
    assert table.columns == ("",)


def test_a_matrix_of_one_column_is_shown_by_elements():
    codes = np.arange(6, dtype="<u2").reshape(6, 1)
    table = view_of(*judged(Exact(codes), codes * 2, "codes", operations()["lsq_quantize"]))
    assert table.columns == ("",)
    assert [name for name, _ in table.rows] == [f"splat {n}, column 0" for n in (5, 4, 3, 2, 1)]
    assert "5 wrong elements; 1 element right. The colour is 1 + error in steps." in table.title


def test_a_table_on_the_page(report):
    expectation, given = gradients()
    given[2, 0] = np.nan
    view = view_of(*judged(expectation, given, "gradients", GRADIENTS))
    text = report_html(report, {"core/scale/wrong": view})
    Page(text)
    assert '<td style="background:#ff00c8;color:#fff"><b>nan</b><span>not -0.866109</span></td>' in text
