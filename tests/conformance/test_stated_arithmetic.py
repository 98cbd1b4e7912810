"""The oracles use no operation whose bits depend on the processor, on libm or on BLAS."""

import ast
from pathlib import Path

import pytest

import gsvc_base
import gsvc_conformance
import gsvc_ref
from gsvc_conformance.operation import MODULES

KIT = Path(gsvc_conformance.__file__).parent
BASE = Path(gsvc_base.__file__).parent
CODEC = Path(gsvc_ref.__file__).parent
SOURCES = sorted(
    [
        *(KIT / "operations").glob("*.py"),
        KIT / "elementary.py",
        *(BASE / "exact").glob("*.py"),
        *(BASE / "rendering").glob("*.py"),
        *(CODEC / "rendering" / name for name in ("deterministic.py", "fast/exponential.py")),
    ]
)
UNSTATED = {
    "exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "sin", "cos", "tan", "arctan", "arctan2", "tanh", "sinh",
    "cosh", "power", "float_power", "pow", "cbrt", "hypot", "einsum", "dot", "vdot", "inner", "matmul", "tensordot",
    "linalg", "interp", "convolve", "fft", "sum", "mean", "std", "var", "average", "nansum", "trapezoid", "math",
    "radians", "degrees", "logaddexp", "cumprod", "prod", "reduce", "reduceat",
}  # fmt: skip
"""Attributes (np.exp, x.sum) that may round otherwise elsewhere: libm, BLAS, sums in an order that NumPy chooses."""
ALLOWED = {
    "deterministic.py": {"sum"},
    "selection.py": {"math", "prod"},
}
"""Attributes of these names that round nothing."""


EXACT_POWERS = {
    "peak ** 2", "o ** 2", "(Fraction(share, 100) * peak) ** 2", "Fraction(threshold) ** 2", "(other - mean) ** 2",
    "(value - mean) ** 2", "threshold ** 2",
}  # fmt: skip
"""Powers of integers and rational numbers."""


def unstated(source: str) -> set[str]:
    """The attributes of UNSTATED that a module uses, and `@` and `**` unless they are exact."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Attribute) and node.attr in UNSTATED:
            found.add(node.attr)
        elif isinstance(node, ast.ImportFrom) and node.module in ("numpy", "math"):
            found |= UNSTATED & {name.name for name in node.names}
        elif isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.MatMult):
            found.add("@")
        elif isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.Pow):
            left = node.left if isinstance(node, ast.BinOp) else node.target
            of_two = isinstance(left, ast.Constant) and left.value == 2
            if not (of_two or ast.unparse(node) in EXACT_POWERS):
                found.add("**")
    return found


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_oracles_use_stated_operations_only(path):
    assert unstated(path.read_text(encoding="utf-8")) <= ALLOWED.get(path.name, set())


def test_every_module_of_operations_is_looked_at():
    assert {path.stem for path in SOURCES} >= {*MODULES, "exact_splats", "exact_ssim", "color_map", "codebooks"}


@pytest.mark.parametrize(
    "line",
    [
        "np.exp(x)",
        "a @ b",
        "x.sum()",
        "a ** b",
        "a ** 0.5",
        "np.linalg.norm(x)",
        "x **= 3",
        "np.add.reduce(x)",
        "from numpy import exp",
    ],
)
def test_others_are_found(line):
    assert unstated(line)
