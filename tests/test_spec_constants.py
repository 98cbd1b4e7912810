"""One name, one value: every constant of Annex A of spec.md has its name and its value in gsvc_ref, once."""

import ast
import importlib
import re
from dataclasses import asdict, is_dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from gsvc_base.rendering.bounds import EPS, ETA
from gsvc_conformance import spec
from gsvc_ref.bitstream.chunks import END_CHUNK_SIZE
from gsvc_ref.bitstream.golomb import GOLOMB_LONGEST

ROOT = Path(__file__).parents[1]
PACKAGES = (ROOT / "gsvc_base", ROOT / "gsvc_ref")
NAMED = re.compile(r"`([A-Z][A-Z0-9_]*)`")

UNNEEDED = {
    "HEADER": "the ranges stand beside the elements in bitstream/header.py, a function that reads and writes them",
    "PAPER_HEADER": "as HEADER",
    "MAIN_HEADER": "as HEADER",
    "OTHERS_RESERVED": "the elements whose other values are reserved are tested one by one in bitstream/header.py",
    "USER_OF": "bitstream/frames.py hands the flag of the attribute to `_check_kept`",
    "CODES": "the inputs of reconstruction are the fields of `SplatBlock`",
}
"""Constants of Annex A that gsvc_ref has no need of, and why."""

OTHERS = {
    "unit of the error model": EPS,
    "loss by underflow in the error model": ETA,
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


NAMES = list(dict.fromkeys(NAMED.findall(annex_text())))


def test_the_table_is_read_whole():
    unnamed = [cells for cells in annex() if not cells[0].startswith("`")]
    assert {cells[3] for cells in unnamed} == OTHERS.keys()
    assert {"LEVELS", "REACH", "K5", "FRAMES"} | UNNEEDED.keys() <= set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_name_has_one_definition_with_the_value_of_the_spec(name):
    homes = definitions().get(name, [])
    if name in UNNEEDED:
        assert homes == []
        return
    assert len(homes) == 1, f"{name} is defined in {homes}"
    value = getattr(importlib.import_module(homes[0]), name)
    assert plain(value) == plain(spec.namespace()[name])


def test_unnamed_constants_have_the_values_of_the_table():
    for _, value, hexadecimal, meaning, _ in (cells for cells in annex() if not cells[0].startswith("`")):
        ours = OTHERS[meaning]
        if ours is not None:
            assert ours == (float.fromhex(hexadecimal.strip("`")) if hexadecimal else int(value)), meaning
