"""The page judges outputs as the kit does: the same verdicts and ratios."""

import base64
import hashlib

import numpy as np
import pytest

pytest.importorskip("playwright", reason="Playwright is one of the extra adapters")

from gsvc_conformance.adapters.web import browser
from gsvc_conformance.expectations import Bounded, Decision, Exact, Interval, Refusal
from gsvc_conformance.runs import pack
from gsvc_conformance.vector import npy


@pytest.fixture(scope="module")
def local_page():
    try:
        page = browser.opened(browser.PAGE.as_uri())
    except FileNotFoundError as error:
        pytest.skip(str(error))
    yield page
    browser.wait(page.close())


def entry_of(expectation):
    """What a manifest says of an output, and its arrays as messages."""
    if isinstance(expectation, Refusal):
        return {"check": "refusal", "value": expectation.value}, {}
    parts = {name or "expected": array for name, array in expectation.parts().items()}
    expected = parts["expected"]
    entry = {"check": expectation.check, "expected": {"dtype": expected.dtype.str, "shape": list(expected.shape)}}
    if isinstance(expectation, Bounded):
        entry |= {"dtype": expectation.dtype, "groups": [list(group) for group in expectation.groups]}
    return entry, {name: browser.as_message(array) for name, array in parts.items()}


def judged_by_page(page, expectation, actual):
    script = """
    ([entry, parts, actual]) => {
      const bytes = (base64) => Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
      const array = ({ dtype, shape, base64 }) => ({ dtype, shape, data: new GSVC.TYPES[dtype](bytes(base64).buffer) });
      const arrays = Object.fromEntries(Object.entries(parts).map(([name, part]) => [name, array(part)]));
      const { passed, ratio } = GSVC.judge(entry, arrays, typeof actual === "string" ? actual : array(actual));
      return { passed, ratio: ratio === Infinity ? "infinite" : ratio };
    }
    """
    return browser.wait(page.evaluate(script, [*entry_of(expectation), browser.as_message(actual)]))


def f4(*values):
    return np.array(values, "<f4")


VALUE = np.array([[1.0, -2.0], [0.0, 1e30]])
BOUND = np.array([[0.25, 0.5], [0.0, np.inf]])
INTEGERS = np.array([3, 4, 5], "|u1")
MANY = np.linspace(1, 2, 40).reshape(20, 2)
LOOSE = np.full((20, 2), 0.01)
OUTPUTS = [
    (Exact(f4(0.0, 1.0, np.inf)), f4(0.0, 1.0, np.inf)),
    (Exact(f4(0.0, 1.0, np.inf)), f4(-0.0, 1.0, np.inf)),
    (Exact(f4(np.nan)), f4(np.nan)),
    (Exact(f4(np.nan)), f4(-np.nan)),
    (Exact(np.array(7, "<i8")), np.array(7, "<i8")),
    (Exact(np.array(2**62, "<i8")), np.array(2**62 + 1, "<i8")),
    (Exact(INTEGERS), INTEGERS.astype("<u2")),
    (Exact(INTEGERS), INTEGERS[:2]),
    (Exact(np.zeros((0, 8), "<f4")), np.zeros((0, 8), "<f4")),
    (Decision(INTEGERS, np.array([3, 5, 5], "|u1")), np.array([3, 5, 5], "|u1")),
    (Decision(INTEGERS, np.array([3, 5, 5], "|u1")), np.array([3, 6, 5], "|u1")),
    (Decision(INTEGERS), INTEGERS),
    (Interval(INTEGERS, INTEGERS - 1, INTEGERS + 1), INTEGERS + 1),
    (Interval(INTEGERS, INTEGERS - 1, INTEGERS + 1), INTEGERS + 2),
    (Interval(INTEGERS, INTEGERS - 1, INTEGERS + 1), INTEGERS - 2),
    (Bounded(VALUE, BOUND), (VALUE + np.array([[0.25, -0.125], [0, 1e29]])).astype("<f4")),
    (Bounded(VALUE, BOUND), (VALUE + np.array([[0.3, 0], [0, 0]])).astype("<f4")),
    (Bounded(VALUE, BOUND), (VALUE + np.array([[0, 0], [1e-30, 0]])).astype("<f4")),
    (Bounded(VALUE, BOUND), (VALUE * [[1, 1], [1, np.nan]]).astype("<f4")),
    (Bounded(VALUE, BOUND), (VALUE * [[1, 1], [1, np.inf]]).astype("<f4")),
    (Bounded(np.array([np.inf]), np.array([0.0])), f4(np.inf)),
    (Bounded(np.array([np.inf]), np.array([0.0])), f4(-np.inf)),
    (Bounded(np.array([np.inf]), np.array([np.inf])), f4(1)),
    (Bounded(MANY, LOOSE, groups=((0, 1),)), (MANY + np.array([1e-9, 1e-3])).astype("<f4")),
    (Bounded(MANY, LOOSE, groups=((0, 2),)), (MANY + np.array([1e-9, 1e-3])).astype("<f4")),
    (Bounded(MANY, LOOSE, groups=((0, 2),)), (MANY * (1 + 5e-6)).astype("<f4")),
    (Refusal("malformed R-6.2-2 412"), "malformed R-6.2-4 8"),
    (Refusal("malformed R-6.2-2 412"), "invalid R-6.2-2 412"),
    (Refusal("malformed R-6.2-2 412"), ""),
    (Refusal(""), ""),
    (Refusal(""), "limit R-5-1 0"),
]


@pytest.mark.parametrize(("expectation", "actual"), OUTPUTS, ids=[f"{i}-{e.check}" for i, (e, _) in enumerate(OUTPUTS)])
def test_the_page_judges_as_the_kit(local_page, expectation, actual):
    verdict = expectation.judge(actual)
    page = judged_by_page(local_page, expectation, actual)
    assert page["passed"] == verdict.passed
    if page["ratio"] is not None and verdict.passed:
        assert page["ratio"] == pytest.approx(verdict.ratio, rel=1e-6)


EXPAND = """
async ([stored, entry]) => {
  const bytes = Uint8Array.from(atob(stored), (character) => character.charCodeAt(0));
  const { data, shape, dtype } = GSVC.expandRuns(GSVC.readNpy(bytes), entry);
  const digest = await crypto.subtle.digest("SHA-256", data);
  const hex = Array.from(new Uint8Array(digest), (byte) => byte.toString(16).padStart(2, "0"));
  return { shape, dtype, sha256: hex.join("") };
}
"""
REPEATING = [
    np.resize(np.arange(251 * 3, dtype="<f4"), (9001, 3)),
    np.flatnonzero(np.resize(np.arange(251) % 10 > 0, 70_001)).astype("<i8"),
    np.full((300, 401), 7, "<u2"),
]


@pytest.mark.parametrize("array", REPEATING, ids=["f4", "i8_by_differences", "u2"])
def test_the_page_expands_runs_as_the_kit(local_page, array):
    packed = pack(array)
    entry = {"shape": list(array.shape), **packed.entry}
    stored = base64.b64encode(npy(packed.elements)).decode()
    page = browser.wait(local_page.evaluate(EXPAND, [stored, entry]))
    assert page["shape"] == list(array.shape)
    assert page["dtype"] == array.dtype.str
    assert page["sha256"] == hashlib.sha256(array.tobytes()).hexdigest()
