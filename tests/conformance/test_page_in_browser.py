"""The page of a run in a browser, from a disk: its filter, its links, its size."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("playwright", reason="Playwright is one of the extra adapters")

import web_pages
from toy_reports import result

from gsvc_conformance.expectations import Bounded
from gsvc_conformance.operation import operations
from gsvc_conformance.report.element_tables import element_table
from gsvc_conformance.report.page import report_html
from gsvc_conformance.report.pictures import view_of
from gsvc_conformance.results import OutputResult, Result
from gsvc_conformance.vector import Vector
from gsvc_conformance.verdicts import Report

MANY = 1500
MAX_BYTES, MAX_FOLDED, SCREEN = 4_000_000, 115, 800  # the second: pixels for each operation
HIDDEN = "els => els.filter(e => e.checkVisibility()).map(e => e.id)"


@pytest.fixture(scope="module")
def open_page():
    with web_pages.pages() as opened:
        yield opened


@pytest.fixture
def page(report, tmp_path, open_page):
    """The page of the toy report with one failure more, opened."""
    report = Report(
        report.environment, report.command, "", (), [*report.results, result("nan", "fail", "halve", "uncommon")]
    )
    return opened(open_page(width=1280, height=SCREEN), report, tmp_path)


def opened(page, report, folder, views=None):
    file = folder / "page.html"
    file.write_text(report_html(report, views), encoding="utf-8")
    page.goto(file.as_uri())
    return page


def shown(page, selector="details.fault"):
    page.click("button[name=open]")
    return page.eval_on_selector_all(selector, HIDDEN)


def test_the_filter(page):
    assert shown(page) == ["core/scale/dead", "core/scale/wrong", "uncommon/halve/nan"]
    for box, value, left in (
        ("outcome", "crash", ["core/scale/dead"]),
        ("operation", "halve", ["uncommon/halve/nan"]),
        ("tier", "core", ["core/scale/dead", "core/scale/wrong"]),
    ):
        page.select_option(f"select[name={box}]", value)
        assert shown(page) == left
        assert page.text("output").startswith(f"{len(left)} of 3 failures, ")
        page.select_option(f"select[name={box}]", "")
    page.fill("input[name=text]", "FACTOR two")
    assert shown(page) == ["core/scale/wrong"]
    assert page.text("output") == "1 of 3 failures, 0 of 10 vectors"
    assert shown(page, "details.group") == ["operation-scale", "cause-1", "cause-none"]
    page.fill("input[name=text]", "unicorn")
    assert shown(page) == []


def test_causes_are_whole_on_a_narrow_screen(report, tmp_path, open_page):
    long = "a cause of many words " * 12
    page = opened(
        open_page(width=390, height=SCREEN), replace(report, results=[result("a", "fail", causes=(long,))]), tmp_path
    )
    cut = "els => els.map(e => e.scrollHeight > e.clientHeight)"
    assert page.eval_on_selector_all("ol.causes li", cut) == [False]


def test_the_table_of_vectors_is_filtered_too(page):
    page.select_option("select[name=outcome]", "waived")
    rows = page.eval_on_selector_all("#vectors tbody tr", "els => els.filter(e => !e.hidden).map(e => e.textContent)")
    assert len(rows) == 1
    assert "core/parse/known" in rows[0]


def test_a_link_opens_what_it_leads_to_and_ends_a_filter(page):
    page.click("button[name=close]")
    page.select_option("select[name=tier]", "core")
    page.evaluate("location.hash = '#uncommon/halve/nan'")
    page.wait_for_function("document.getElementById('uncommon/halve/nan').checkVisibility()")
    assert page.evaluate("document.getElementById('uncommon/halve/nan').open")
    assert page.evaluate("document.querySelector('select[name=tier]').value") == ""


def test_a_command_is_copied(page):
    page.evaluate(
        "Object.defineProperty(navigator, 'clipboard', {value: {writeText: async (t) => { window.got = t; }}})"
    )
    page.click("button[name=open]")
    page.click("[id='core/scale/wrong'] button.copy")
    page.wait_for_function("window.got")
    assert page.evaluate("window.got") == "gsvc-conformance run --impl ./toy --case core/scale/wrong"


def many_failures():
    """A report in which all vectors of all operations are wrong, and a table and pictures for all of them."""
    names, gradients = list(operations()), operations()["render_gradients"]
    outputs = (OutputResult("sum", "bounded", False, "is wrong", 1e6, (1, 2, 0)),)
    results = [
        Result(
            f"core/{name}/vector_{n:04}", "A vector of which something is shown.", operations()[name].group, "fail",
            "output sum is 0.0 at pixel (x 10, y 9), red, expected 0.75: the error is 0.75, 1.4e+06 times the bound.",
            outputs, ("an output that nothing was written to: every element is 0",), size=n,
        )
        for n in range(MANY) for name in [names[n % len(names)]]
    ]  # fmt: skip
    noise = np.random.default_rng(1).random((200, 200, 3))
    picture = Vector("core/render_sum/x", {}, operations()["render_sum"], {}, {"sum": Bounded(noise, noise * 1e-6)})
    seen = view_of(picture, {"sum": noise[::-1].astype("<f4")}, results[0])
    matrix = Bounded(noise[:40, :8, 0], noise[:40, :8, 0] * 1e-6)
    table = element_table(gradients, "gradients", matrix, np.zeros((40, 8), "<f4"))
    return Report({"implementation": "all_wrong"}, "gsvc-conformance run --module all_wrong", "", (), results), {
        r.id: seen if n % 2 else table for n, r in enumerate(results)
    }


@pytest.mark.parametrize(
    ("width", "scheme"), [(1280, "light"), pytest.param(390, "dark", marks=pytest.mark.exhaustive)]
)
def test_a_page_on_which_everything_fails_is_small_and_its_overview_fits_a_screen(open_page, tmp_path, width, scheme):
    report, views = many_failures()
    page = opened(open_page(width=width, height=SCREEN, color_scheme=scheme), report, tmp_path, views)
    assert (tmp_path / "page.html").stat().st_size < MAX_BYTES
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    if width == 1280:
        end = page.evaluate("document.querySelector('.chips').getBoundingClientRect().bottom")
        assert end <= SCREEN
    page.click("button[name=close]")
    assert page.evaluate("document.documentElement.scrollHeight") <= MAX_FOLDED * len(operations())
    page.click("button[name=open]")
    assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_a_page_without_failures(open_page, report, tmp_path):
    good = Report(report.environment, report.command, "", (), report.results[6:])
    page = opened(open_page(width=390, height=SCREEN), good, tmp_path)
    page.select_option("select[name=outcome]", "pass")
    assert page.text("output") == "2 of 3 vectors"
    assert page.text(".verdict") == "Passed; 1 waived"
