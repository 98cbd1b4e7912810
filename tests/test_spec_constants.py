"""One name, one value: a constant has one home, and one of Annex A of spec.md its name and its value there."""

import ast
import importlib
import re
from dataclasses import asdict, is_dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from gsvc_base.rendering.error_models import EPS, ETA, LOCAL
from gsvc_conformance import spec
from gsvc_ref.bitstream.chunks import END_CHUNK_SIZE
from gsvc_ref.bitstream.golomb import GOLOMB_LONGEST

ROOT = Path(__file__).parents[1]
PACKAGES = (ROOT / "gsvc_base", ROOT / "gsvc_ref")
NAMED = re.compile(r"`([A-Z][A-Z0-9_]*)`")

OTHERS = {
    "unit of the error model": EPS,
    "loss by underflow in the error model": ETA,
    "pixels between a pixel and the place that stored positions are relative to": LOCAL,
    "maximum number of leading zeros of an `eg(k)`": GOLOMB_LONGEST,
    "size of the end chunk in bytes": END_CHUNK_SIZE,
    "maximum relative L2 error and bias of a group of gradients": None,  # only the kit judges groups
}
"""What the rows mean whose constant has no name in the code of spec.md, and its value in gsvc_ref."""


def annex_text():
    text = spec.SPEC.read_text(encoding="utf-8")
    return text[text.index("\n## Annex A") : text.index("\n## Annex B")]


def annex():
    """The rows of the table of Annex A: the cells constant, value, hexadecimal, meaning and section."""
    table = annex_text().split("|---|", 1)[1].split("\n\n", 1)[0]
    return [[cell.strip() for cell in row.split("|")[1:-1]] for row in table.splitlines()[1:]]


def defined(tree):
    """The names that a module gives a value to, anywhere in it, and those that it imports under another name."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id
        elif isinstance(node, ast.alias) and node.asname not in (None, node.name):
            yield node.asname


@cache
def definitions():
    """The modules of gsvc_base and gsvc_ref that define each name, leading underscores left out."""
    homes = {}
    for path in (path for package in PACKAGES for path in package.rglob("*.py")):
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for name in defined(ast.parse(path.read_text(encoding="utf-8"))):
            homes.setdefault(name.lstrip("_"), []).append(module)
    return homes


def plain(value):
    """A value as numbers, lists and dictionaries, so that an array and a list of the same numbers are equal."""
    if is_dataclass(value):
        return plain(asdict(value))
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, str | frozenset):  # chunk types: letters or their codes, in any order
        return sorted(ord(item) if isinstance(item, str) else item for item in value)
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [item if isinstance(item, str) else plain(item) for item in value]
    return value


TEXT, _, OF_SYNTAX = annex_text().partition("Tables of the names of elements")
NAMES = list(dict.fromkeys(NAMED.findall(TEXT)))
SYNTAX = NAMED.findall(OF_SYNTAX)
"""Tables by which spec.md's code reads elements; gsvc_ref has functions of the syntax in their place."""


def test_the_table_is_read_whole():
    unnamed = [cells for cells in annex() if not cells[0].startswith("`")]
    assert {cells[3] for cells in unnamed} == OTHERS.keys()
    assert {"LEVELS", "REACH", "K5", "FRAMES"} <= set(NAMES)
    assert "HEADER" in SYNTAX


@pytest.mark.parametrize("name", NAMES)
def test_a_name_has_one_definition_with_the_value_of_the_spec(name):
    homes = definitions().get(name, [])
    assert len(homes) == 1, f"{name} is defined in {homes}"
    value = getattr(importlib.import_module(homes[0]), name)
    assert plain(value) == plain(spec.namespace()[name])


@pytest.mark.parametrize("name", SYNTAX)
def test_a_table_of_syntax_is_one_of_names_and_gsvc_ref_has_none(name):
    table = spec.namespace()[name]
    assert all(isinstance(row if isinstance(row, str) else row[0], str) for row in table)
    assert name not in definitions()


def constants(tree):
    """The constants that a module defines: upper-case names that are given a value, but for variables of types."""
    for node in tree.body:
        match node:
            case ast.Assign(targets, value) if not is_type_variable(value):
                yield from (name.id for target in targets for name in ast.walk(target) if is_constant(name))
            case ast.AnnAssign(ast.Name(name), _, ast.expr()) if is_constant(node.target):
                yield name


def is_constant(node):
    return isinstance(node, ast.Name) and node.id.strip("_").isupper()


def is_type_variable(value):
    return isinstance(value, ast.Call) and ast.unparse(value.func) in ("TypeVar", "ParamSpec")


def test_a_constant_has_one_home():
    homes = {}
    for path in (path for package in PACKAGES for path in package.rglob("*.py")):
        for name in constants(ast.parse(path.read_text(encoding="utf-8"))):
            homes.setdefault(name.lstrip("_"), []).append(str(path.relative_to(ROOT)))
    assert len(homes) > 400
    assert {name: found for name, found in homes.items() if len(found) > 1} == {}


def test_constants_are_found():
    source = "A, B = 1, 2\n_A: Final = 3\nT = TypeVar('T')\na = A\ndef f():\n    C = 1\nD: int"
    assert list(constants(ast.parse(source))) == ["A", "B", "_A"]


def test_unnamed_constants_have_the_values_of_the_table():
    for _, value, hexadecimal, meaning, _ in (cells for cells in annex() if not cells[0].startswith("`")):
        ours = OTHERS[meaning]
        if ours is not None:
            assert ours == (float.fromhex(hexadecimal.strip("`")) if hexadecimal else int(value)), meaning


def test_the_copy_in_an_adapter_that_takes_nothing_from_us_is_equal():
    path = ROOT / "conformance" / "gsvc_conformance" / "adapters" / "pytorch" / "color.py"
    (table,) = (
        node.value
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.AnnAssign) and node.target.id == "LUMA_WEIGHTS"
    )
    assert ast.literal_eval(table) == spec.namespace()["LUMA_WEIGHTS"]
