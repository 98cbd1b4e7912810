"""What must be the same on every machine calls nothing that a machine may compute in its own way.

The sources of scenes, random draws and the encoder's decisions hold no function of a mathematical library but those
that are rounded correctly, no BLAS, no LAPACK, no SciPy, no powers, and no generator of NumPy's but for what
`Generator.random` is known to give.
"""

import ast
from pathlib import Path

import numpy as np
import pytest

import gsvc_conformance
import gsvc_lab
import gsvc_ref

HOME = Path(gsvc_ref.__file__).parent
LAB = Path(gsvc_lab.__file__).parent
CASES = Path(gsvc_conformance.__file__).parent / "cases"
BY_HAND = ("gradients.py", "metrics.py", "unusual_splats.py")
"""Cases whose expectations are held against another computation, which may differ in its last bits."""

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

GENERATORS = {
    "encoder/pretraining.py", "encoder/frame.py", "encoder/quantizer_choice.py", "training/frame_quantizer.py",
    "encoder/prediction.py", "encoder/splat_coder.py", "training/block_quantizer.py", "encoder/rate.py",
    "training/fitting.py", "encoder/main_frame.py", "main_encoder/intra.py", "main_encoder/splat_number.py",
}  # fmt: skip
"""Who may name `numpy.random`: they make or hand on a `Generator`, of which only `random` is called."""

PARTS = (
    "bitstream",
    "encoder",
    "main_encoder",
    "main_profile",
    "quantization",
    "reconstruction",
    "rendering",
    "stream",
    "training",
)
SOURCES = sorted(
    str(path.relative_to(HOME.parent))
    for path in [*(path for part in PARTS for path in (HOME / part).rglob("*.py")), *HOME.glob("[dps]*.py"),
                 *(HOME / "testing").glob("[c-r]*.py"), *(LAB / "scenes").rglob("*.py")]
    if not str(path).endswith(FOR_PEOPLE)
)  # fmt: skip


def found(source: str, name: str) -> list[str]:
    """What a source does that it must not, with the line of each."""
    wrong = []
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Attribute(ast.Name("np"), attribute) if attribute in FORBIDDEN:
                if not (attribute == "random" and name.endswith(tuple(GENERATORS))):
                    wrong.append((node.lineno, f"np.{attribute}"))
            case ast.Attribute(ast.Name("math"), attribute) if attribute not in CORRECT:
                wrong.append((node.lineno, f"math.{attribute}"))
            case ast.Call(ast.Attribute(ast.Name("math"), "log"), [argument]) if not isinstance(argument, ast.Constant):
                wrong.append((node.lineno, "math.log of a variable"))
            case ast.BinOp(_, ast.MatMult(), _):
                wrong.append((node.lineno, "@"))
            case ast.BinOp(left, ast.Pow(), right) if not (of_constants(left) and of_constants(right)):
                if not (isinstance(left, ast.Constant) and left.value == 2 and type(left.value) is int):
                    wrong.append((node.lineno, "**"))
            case ast.Import([ast.alias(module), *_]) | ast.ImportFrom(str(module)) if module.startswith("scipy"):
                wrong.append((node.lineno, module))
    return [f"line {line}: {what}" for line, what in sorted(wrong)]


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
    assert found((HOME.parent / name).read_text(encoding="utf-8"), name) == []


@pytest.mark.parametrize("name", sorted(path.name for path in CASES.glob("*.py") if path.name not in BY_HAND))
def test_golden_vectors_are_made_without_functions_of_the_machine(name):
    told = found((CASES / name).read_text(encoding="utf-8"), name)
    assert [what for what in told if ": np." in what or ": math." in what] == []


@pytest.mark.parametrize(
    ("source", "told"),
    [
        ("y = np.exp(x)", ["line 1: np.exp"]),
        ("y = a @ b", ["line 1: @"]),
        ("y = math.cos(x)\nz = math.log(x) + math.log(10)", ["line 1: math.cos", "line 2: math.log of a variable"]),
        ("y = x**2 + 3**k + 2**k + 2.0**-24 + 10**3", ["line 1: **", "line 1: **"]),
        ("y = 0.5**3", ["line 1: **"]),
        ("from scipy.ndimage import zoom\nimport scipy", ["line 1: scipy.ndimage", "line 2: scipy"]),
        ("rng = np.random.default_rng(0)", ["line 1: np.random"]),
        ("y = np.sqrt(x) * math.sqrt(3) + math.ldexp(1.0, k)", []),
    ],
)
def test_what_depends_on_it_is_found(source, told):
    assert found(source, "x.py") == told


def test_random_numbers_of_numpy_are_bits_of_its_promised_stream():
    """NumPy promises the words of PCG64 for a seed, not what `Generator` makes of them: a change would show here."""
    for seed in (0, [7, 3]):
        words = np.random.PCG64(seed).random_raw(40)
        assert np.array_equal(np.random.default_rng(seed).random(40), (words >> np.uint64(11)) * 2.0**-53)
        halves = np.stack([words & np.uint64(0xFFFFFFFF), words >> np.uint64(32)], axis=1).ravel()
        expected = (halves >> np.uint64(8)).astype(np.float32) * np.float32(2.0**-24)
        assert np.array_equal(np.random.default_rng(seed).random(80, np.float32), expected)
