"""What must be the same on every machine calls nothing that a machine may compute in its own way.

The sources of scenes, random draws and the encoder's decisions hold no function of a mathematical library but those
that are rounded correctly, no BLAS, no LAPACK, no SciPy, no powers, and no generator of NumPy's but for what
`Generator.random` is known to give.
"""

import ast
from pathlib import Path

import numpy as np
import pytest

import gsvc_base
import gsvc_base.draws
import gsvc_conformance
import gsvc_lab
import gsvc_ref
import gsvc_tools

BASE = Path(gsvc_base.__file__).parent
HOME = Path(gsvc_ref.__file__).parent
LAB = Path(gsvc_lab.__file__).parent
TOOLS = Path(gsvc_tools.__file__).parent
KIT = Path(gsvc_conformance.__file__).parent
MAKING = sorted(
    [*(KIT / "cases").glob("*.py"), *(KIT / "operations").rglob("*.py"), KIT / "elementary.py", KIT / "streams.py",
     BASE / "exact" / "running_error.py", BASE / "exact" / "training_bounds.py"]
)  # fmt: skip
"""What makes the inputs, the expected numbers and the bounds of golden vectors."""

BESIDE = {
    "adan.py": {"np.float32(inputs[b]) ** k"},
    "elementary.py": {"2.0 ** (-53 * x.most - 2)", "2.0 ** (-4 * terms)", "2.0 ** (12 - CONSTANT_BITS)"},
    "gradients.py": {"np.linalg", "-u @ u", "np.exp"},
    "hard_training.py": {"b ** k"},
    "large_rows.py": {"np.arange(PERIOD) ** 3"},
    "metrics.py": {"np.log10"},
    "rvq.py": {"3 ** k", "x @ book.T"},
}
"""There: powers of whole numbers and of two, which are exact, and what only an assertion compares with, by file."""

CORRECT = {
    "sqrt", "floor", "ceil", "frexp", "ldexp", "fsum", "isfinite", "isinf", "isnan", "copysign", "prod", "radians",
    "factorial", "inf", "nan", "pi", "log", "isclose", "gcd", "isqrt",
}  # fmt: skip
"""Of `math`: exact, correctly rounded, or a single product; `log` of constants only."""

FORBIDDEN = {
    "arccos", "arcsin", "arcsinh", "arctan", "arctan2", "cbrt", "convolve", "correlate", "cos", "cosh", "dot", "einsum",
    "exp", "exp2", "expm1", "fft", "float_power", "hypot", "inner", "interp", "linalg", "log", "log10", "log1p", "log2",
    "logaddexp", "matmul", "polyfit", "pow", "power", "random", "sin", "sinc", "sinh", "tan", "tanh", "tensordot",
    "vdot", "vecdot",
}  # fmt: skip
"""Of NumPy."""

FOR_PEOPLE = ("scenes/gallery.py", "scenes/gallery_pictures.py", "encoder/report.py")
"""What only makes pages and reports."""

OF_RANDOM = {"Generator", "default_rng"}
"""Of `numpy.random`: the generator of a seed and its type, of which only `random` and `spawn` are called."""

DRAWS = gsvc_base.draws.__name__
"""In a file that imports it a name that ends in ``rng`` is a `Draws`, elsewhere a `Generator`."""

PARTS = (
    "bitstream",
    "encoder",
    "main",
    "paper",
    "rendering",
    "stream",
    "training",
)

SOURCES = sorted(
    str(path.relative_to(HOME.parent))
    for path in [*(path for part in PARTS for path in (HOME / part).rglob("*.py")), *HOME.glob("p*.py"),
                 *BASE.glob("[dps]*.py"), *(BASE / "rendering").glob("*.py"), *(BASE / "exact").glob("[der]*.py"),
                 *(HOME / "testing").glob("[c-r]*.py"), *(LAB / "scenes").rglob("*.py"),
                 *(part for room in ("jobs", "targets") for part in (TOOLS / room).rglob("*.py")),
                 HOME / "metrics" / "squared_error.py"]
    if not str(path).endswith(FOR_PEOPLE)
)  # fmt: skip


def found(source: str) -> list[str]:
    """What a source does that it must not, with the line of each."""
    return [f"line {line}: {what}" for line, what, _ in sorted(findings(ast.parse(source)))]


def findings(tree: ast.AST) -> list[tuple[int, str, str]]:
    """The line of each, what it is, and the expression."""
    wrong = []
    allowed = {
        id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Attribute) and node.attr in OF_RANDOM
    }  # the `np.random` in `np.random.Generator`
    draws = any(isinstance(node, ast.ImportFrom) and node.module == DRAWS for node in ast.walk(tree))
    for node in ast.walk(tree):
        match node:
            case ast.Attribute(ast.Name("np"), attribute) if attribute in FORBIDDEN:
                if not (attribute == "random" and id(node) in allowed):
                    wrong.append((node, f"np.{attribute}"))
            case ast.arg(variable, annotation) | ast.AnnAssign(ast.Name(variable), annotation):
                if annotation is not None and is_generator(annotation) and not variable.endswith("rng"):
                    wrong.append((node, f"a Generator that is called {variable}"))
            case ast.Assign([ast.Name(variable) | ast.Attribute(_, variable)], ast.Call(made)):
                if is_generator(made) and not variable.endswith("rng"):
                    wrong.append((node, f"a Generator that is called {variable}"))
            case ast.Attribute(ast.Name("math"), attribute) if attribute not in CORRECT:
                wrong.append((node, f"math.{attribute}"))
            case ast.Attribute(ast.Name(owner) | ast.Attribute(_, owner), attribute) if owner.endswith("rng"):
                if attribute not in ("random", "spawn") and not draws:
                    wrong.append((node, f"rng.{attribute}"))
            case ast.Call(ast.Attribute(ast.Name("math"), "log"), [argument]) if not isinstance(argument, ast.Constant):
                wrong.append((node, "math.log of a variable"))
            case ast.BinOp(_, ast.MatMult(), _):
                wrong.append((node, "@"))
            case ast.BinOp(left, ast.Pow(), right) if not (of_constants(left) and of_constants(right)):
                if not (isinstance(left, ast.Constant) and left.value == 2 and type(left.value) is int):
                    wrong.append((node, "**"))
            case ast.Import([ast.alias(module), *_]) | ast.ImportFrom(str(module)) if module.startswith("scipy"):
                wrong.append((node, module))
    return [(node.lineno, what, ast.unparse(node)) for node, what in wrong]


def is_generator(node: ast.expr) -> bool:
    """Whether it is `np.random.Generator` or `np.random.default_rng`."""
    match node:
        case ast.Attribute(ast.Attribute(ast.Name("np"), "random"), attribute):
            return attribute in OF_RANDOM
    return False


def asserted(tree: ast.AST) -> set[tuple[int, str, str]]:
    """The findings inside of assertions, which reach no vector."""
    return {one for node in ast.walk(tree) if isinstance(node, ast.Assert) for one in findings(node)}


def of_constants(node: ast.expr) -> bool:
    """Whole numbers, and 2.0: powers of these are exact."""
    match node:
        case ast.Constant(int()) | ast.Constant(2.0):
            return True
        case ast.UnaryOp(ast.USub(), operand):
            return of_constants(operand)
    return False


@pytest.mark.parametrize("name", SOURCES)
def test_nothing_here_depends_on_the_machine(name):
    assert found((HOME.parent / name).read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("path", MAKING, ids=lambda path: path.name)
def test_golden_vectors_are_made_without_functions_of_the_machine(path):
    """Squares are left out: NumPy multiplies."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    told = {one for one in findings(tree) if not one[2].endswith("** 2")} - asserted(tree)
    beside = BESIDE.get(path.name, set())
    assert [(what, text) for _, what, text in sorted(told) if not {what, text} & beside] == []


def test_nothing_that_is_let_pass_has_gone():
    """Else a line of that name could come back unseen."""
    for name, texts in BESIDE.items():
        (path,) = (path for path in MAKING if path.name == name and "operations" not in path.parts)
        told = findings(ast.parse(path.read_text(encoding="utf-8")))
        assert texts <= {what for _, what, _ in told} | {text for _, _, text in told}, name


@pytest.mark.parametrize(
    ("source", "told"),
    [
        ("y = np.exp(x)", ["line 1: np.exp"]),
        ("y = a @ b", ["line 1: @"]),
        ("y = math.cos(x)\nz = math.log(x) + math.log(10)", ["line 1: math.cos", "line 2: math.log of a variable"]),
        ("y = x**2 + 3**k + 2**k + 2.0**-24 + 10**3", ["line 1: **", "line 1: **"]),
        ("y = 0.5**3", ["line 1: **"]),
        ("from scipy.ndimage import zoom\nimport scipy", ["line 1: scipy.ndimage", "line 2: scipy"]),
        ("a = np.random.normal(3)", ["line 1: np.random"]),
        ("rng = np.random.default_rng(0)\nself.tries_rng = np.random.default_rng(1)", []),
        ("drawn = np.random.default_rng(0)", ["line 1: a Generator that is called drawn"]),
        ("def f(g: np.random.Generator): pass", ["line 1: a Generator that is called g"]),
        ("a = self._rng.permutation(3) + rng.random() + rng.spawn(2)", ["line 1: rng.permutation"]),
        ("from gsvc_base.draws import Draws\na = rng.integers(3)", []),
        ("y = np.sqrt(x) * math.sqrt(3) + math.ldexp(1.0, k)", []),
    ],
)
def test_what_depends_on_it_is_found(source, told):
    assert found(source) == told


def test_random_numbers_of_numpy_are_bits_of_its_promised_stream():
    """NumPy promises the words of PCG64 for a seed, not what `Generator` makes of them: a change would show here."""
    for seed in (0, [7, 3]):
        words = np.random.PCG64(seed).random_raw(40)
        assert np.array_equal(np.random.default_rng(seed).random(40), (words >> np.uint64(11)) * 2.0**-53)
        halves = np.stack([words & np.uint64(0xFFFFFFFF), words >> np.uint64(32)], axis=1).ravel()
        expected = (halves >> np.uint64(8)).astype(np.float32) * np.float32(2.0**-24)
        assert np.array_equal(np.random.default_rng(seed).random(80, np.float32), expected)
