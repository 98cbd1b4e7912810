"""Kernels of profile `main` have few parameters: what belongs together is a NamedTuple."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
ROOMS = ("gsvc_ref/main", "gsvc_ref/encoder/main")
MAX_PARAMETERS = 8


def kernels(path):
    """The functions of a file that Numba compiles."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef) and any(ast.unparse(d).startswith("kernel(") for d in node.decorator_list):
            yield node


@pytest.mark.parametrize("room", ROOMS)
def test_no_kernel_has_more_than_eight_parameters(room):
    found = [(path.name, node) for path in (ROOT / room).rglob("*.py") for node in kernels(path)]
    assert found
    assert [(name, node.name) for name, node in found if len(node.args.args) > MAX_PARAMETERS] == []
