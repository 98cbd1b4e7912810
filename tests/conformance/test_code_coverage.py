"""What vectors reach of spec.md's code, measured on code of a few lines."""

from types import SimpleNamespace
from typing import Any, Final

import numpy as np
import pytest

from gsvc_conformance import code_coverage
from gsvc_conformance.code_coverage import Instrumented, reach

CODE: Final = '''
import numpy as np

LIMIT = max(3, 4)


class Fault(ValueError):
    """What is broken."""


class Sum:
    """A sum."""

    def add(self, values):
        for value in values:
            if value < 0:  # R-1-1
                raise Fault("R-1-1", 0)
        return sum(values)


def first(x):
    """Each of the choices."""
    y = np.minimum(np.clip(x, 0, LIMIT), np.where(x > 1, 2, x))
    return [int(value) for value in y if value != 0]


def second(x):
    while x > 2:
        x -= 2
    try:
        return Sum().add([x if x > 0 else -1, max([1, 2])])
    except Fault as fault:
        return fault.args[0]
'''


@pytest.fixture(autouse=True)
def small_code(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(code_coverage, "blocks", lambda: (CODE,))


def of(code: Instrumented, kind: str, text: str = "") -> dict[str, bool]:
    """Whether points of a kind are reached, by their sides."""
    points = zip(code.points, code.reached, strict=True)
    return {point.side: there == 1 for point, there in points if point.kind == kind and point.text.startswith(text)}


def test_the_code_does_what_it_did() -> None:
    code, plain = Instrumented(), dict[str, Any]()
    exec(CODE, plain)
    for x in (np.array([-1, 0, 1, 2, 7]), np.zeros(0)):
        assert code.names["first"](x) == plain["first"](x)
    assert code.names["second"](6) == plain["second"](6) == 4
    assert code.names["second"](0) == plain["second"](0) == "R-1-1"


def test_choices_have_all_their_sides() -> None:
    code = Instrumented()
    assert of(code, "choice", "np.clip") == {"below": False, "inside": False, "above": False}
    code.names["first"](np.array([-1, 0]))
    assert of(code, "choice", "np.clip") == {"below": True, "inside": True, "above": False}
    code.names["first"](np.array([5]))
    assert all(of(code, "choice", "np.clip").values())
    assert all(of(code, "choice", "np.where").values())


def test_equal_values_take_no_side() -> None:
    code = Instrumented()
    code.names["first"](np.array([0, 1, 2]))
    assert of(code, "choice", "np.minimum") == {"the first is less": False, "the second is less": False}
    code.names["first"](np.array([3]))
    assert of(code, "choice", "np.minimum") == {"the first is less": False, "the second is less": True}


def test_choices_outside_of_functions_are_made_when_the_code_is_loaded() -> None:
    assert of(Instrumented(), "choice", "max(3, 4)") == {"the first is less": True, "the second is less": False}


def test_max_of_a_list_is_no_choice() -> None:
    assert not of(Instrumented(), "choice", "max([1, 2])")


def test_branches_and_conditions_have_two_ways() -> None:
    code = Instrumented()
    code.names["second"](1)
    assert of(code, "branch", "while") == {"true": False, "false": True}
    assert of(code, "branch", "x if x > 0 else -1") == {"true": True, "false": False}
    assert of(code, "branch", "for value in values") == {"true": True, "false": True}
    assert of(code, "branch", "value != 0") == {"true": False, "false": False}
    code.names["first"](np.array([0, 1]))
    assert of(code, "branch", "value != 0") == {"true": True, "false": True}


def test_a_docstring_is_no_statement() -> None:
    assert not [point for point in Instrumented().points if "A sum" in point.text]


def test_vectors_that_can_reach_nothing_new_are_not_read(monkeypatch: pytest.MonkeyPatch) -> None:
    leads_to = {"first": {"first"}, "second": {"second", "Sum"}}
    monkeypatch.setattr(code_coverage, "leads_to", leads_to.__getitem__)
    inputs: dict[str, Any] = {
        "core/first/small": np.array([-1, 0, 1, 2, 7]), "core/first/large": np.array([5]), "core/second/six": 6,
        "core/second/one": 1, "faulty/second/of_another_rule": 2, "faulty/second/zero": 0,
    }  # fmt: skip
    rules = dict.fromkeys(inputs, "") | {"faulty/second/of_another_rule": "R-1-2", "faulty/second/zero": "R-1-1"}
    asked: list[str] = []

    def read(name: str) -> Any:
        asked.append(name)
        return SimpleNamespace(inputs={"x": inputs[name]})

    excuses = ("the first is less", "the second is less", "false", "return fault.args[0]")
    found = reach(rules, read, excused=lambda point: point.side in excuses or point.text in excuses)
    assert asked == ["core/first/small", "core/second/six", "faulty/second/zero"]
    by = {(point.home, point.text, point.side): name for point, name in found}
    assert by["", "LIMIT = max(3, 4)", ""] == "the module"
    assert by["first", "np.clip(x, 0, LIMIT)", "above"] == "core/first/small"
    assert by["second", "x -= 2", ""] == "core/second/six"
    assert by["Sum", "if value < 0: raise Fault('R-1-1', 0)", "true"] == "faulty/second/zero"
