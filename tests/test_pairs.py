"""Every operation of spec.md and what gsvc_ref has for it: the same name and arguments, and the same answers."""

import ast
import inspect
import re
from functools import cache
from pathlib import Path
from pkgutil import resolve_name

import numpy as np
import pytest

import gsvc_ref
from gsvc_conformance.expectations import Exact
from gsvc_conformance.mutants import judge
from gsvc_conformance.operation import input_size, operations
from gsvc_conformance.pairs import INSTEAD, PAIRS, Free, Other, Twin, twin
from gsvc_conformance.vector import VECTORS, read
from gsvc_ref import spec

ROOT = Path(__file__).parents[1]
SOURCES = sorted(path for home in ROOT.glob("gsvc_*") for path in home.rglob("*.py"))
VECTORS_EACH = 5

TWINS = [name for name, pair in PAIRS.items() if isinstance(pair, Twin)]
PLAIN = [name for name, pair in PAIRS.items() if not isinstance(pair, Free)]
OTHERS = [name for name, pair in PAIRS.items() if isinstance(pair, Other)]


@cache
def core_vectors(name):
    """The smallest and the largest vectors of an operation's core tier, or of the uncommon one if it has no core."""
    homes = next(filter(None, (sorted((VECTORS / tier / name).iterdir()) for tier in ("core", "uncommon"))))
    by_size = sorted((read(home) for home in homes), key=lambda vector: input_size(vector.inputs))
    return list({vector.id: vector for vector in [*by_size[: VECTORS_EACH - 1], by_size[-1]]}.values())


def answers(function, vector):
    with np.errstate(all="ignore"):
        return function(**{name: np.copy(v) if isinstance(v, np.ndarray) else v for name, v in vector.inputs.items()})


def parameters_of(function):
    return list(inspect.signature(function).parameters.values())


def names_of_inputs(name):
    return [port.name for port in operations()[name].inputs]


def test_every_operation_is_paired_or_listed_with_a_reason():
    assert list(PAIRS) == list(operations())
    assert {name for name in PAIRS if not hasattr(spec, name)} == set(PAIRS) - set(PLAIN)
    assert set(INSTEAD) <= set(operations())


@pytest.mark.parametrize("name", PLAIN)
def test_the_plain_form_has_the_arguments_of_the_operation(name):
    assert [parameter.name for parameter in parameters_of(getattr(spec, name))] == names_of_inputs(name)


@pytest.mark.parametrize("name", TWINS)
def test_a_twin_has_the_name_and_arguments_of_its_plain_form(name):
    wanted = names_of_inputs(name)
    function = twin(name)
    assert name in gsvc_ref.__all__
    assert function.__doc__
    parameters = parameters_of(function)
    assert function.__name__ == name
    assert [parameter.name for parameter in parameters[: len(wanted)]] == wanted
    assert all(parameter.default is not inspect.Parameter.empty for parameter in parameters[len(wanted) :])


def defined(path):
    """The functions of a module by the line above them, which is above their decorators."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef):
            yield min(part.lineno for part in (node, *node.decorator_list)) - 1, node.name


def test_the_line_above_a_twin_names_its_plain_form():
    marks = [
        (path, number, mark[1])
        for path in SOURCES
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if (mark := re.search(r"# twin of (.*)", line))
    ]
    wanted = []
    for name in TWINS:
        path = Path(inspect.getsourcefile(inspect.unwrap(twin(name))))
        wanted += [(path, line, f"spec.{name}") for line, function in defined(path) if function == name]
    assert sorted(wanted) == sorted(marks)
    assert len(wanted) == len(TWINS)


@pytest.mark.parametrize("name", OTHERS)
def test_what_stands_in_the_place_of_a_twin_exists_and_has_a_reason(name):
    assert callable(resolve_name(PAIRS[name].name))
    assert len(PAIRS[name].reason.split()) > 3


@pytest.mark.parametrize("name", PLAIN)
def test_both_sides_give_the_same_answers(name):
    """To the bit where an output is exact; else both are within the bound, which the kit judges."""
    for vector in core_vectors(name):
        ours, plain = answers(operations()[name].reference, vector), answers(getattr(spec, name), vector)
        assert list(ours) == list(plain) == list(vector.expected)
        for output, expected in vector.expected.items():
            if isinstance(expected, Exact):
                pair = np.asarray(ours[output]), np.asarray(plain[output])
                assert len({(part.dtype, part.shape, part.tobytes()) for part in pair}) == 1, (vector.id, output)
        for side in (ours, plain):
            assert all(judgement.passed for judgement in judge(vector.expected, side)), vector.id
