"""Profile `main` in integers to the end: 32 bits suffice, parameters are exact, and boxes not smaller than (5-1)'s."""

from fractions import Fraction
from typing import Any, Final

import numpy as np
import pytest

import gsvc_ref
from gsvc_base.arrays import F4, I8
from gsvc_ref import spec

SIZES: Final = [(352, 288, h) for h in range(4)] + [(65535, 65535, h) for h in range(4)] + [(1, 1, 3)]
"""Sizes of frames, and how often they are halved."""
MOST: Final = (spec.X_MOST, spec.X_MOST, spec.A_MOST, spec.A_MOST, spec.S_MOST, *[spec.N_MOST] * 3)
LEAST: Final = (-spec.X_MOST, -spec.X_MOST, spec.A_LEAST, spec.A_LEAST, -spec.S_MOST, *[-spec.N_MOST] * 3)


class Word(np.ndarray[Any, Any]):
    """Integers each of which has 32 bits, with a sign or without; what is computed from them as well."""

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        plain = [np.asarray(value) if isinstance(value, Word) else value for value in inputs]
        found = getattr(ufunc, method)(*plain, **options)
        if isinstance(found, np.ndarray | np.generic) and found.dtype.kind == "i":
            in_words(found)
            return np.asarray(found).view(Word)
        return found


class Whole(int):
    """The same for a number of Python."""

    def __new__(cls, value: int) -> "Whole":
        in_words(np.array(value))
        return super().__new__(cls, value)


for name in ("add", "sub", "mul", "floordiv", "mod", "lshift", "rshift", "and"):
    for method in (f"__{name}__", f"__r{name}__"):
        setattr(Whole, method, lambda one, other, method=method: Whole(getattr(int, method)(one, other)))


def in_words(values: np.ndarray[Any, Any] | np.generic) -> None:
    assert np.size(values) == 0 or (np.min(values) >= -(2**31) and np.max(values) < 2**32)


@pytest.fixture
def words(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tables of spec.md as words, so that what is computed from them is watched."""
    for table in ("EXP2", "LOGISTIC", "LAPLACE"):
        monkeypatch.setattr(spec, table, getattr(spec, table).view(Word))


def states(count: int, seed: int) -> I8:
    """States all over their ranges, of all magnitudes, and all corners of them."""
    rng = np.random.default_rng(seed)
    where = rng.integers(-(2**24), 2**24 + 1, (count, 2)) >> rng.integers(0, 20, (count, 1))
    sizes = rng.integers(spec.A_LEAST, spec.A_MOST + 1, (count, 2))
    shear = rng.integers(-spec.S_MOST, spec.S_MOST + 1, (count, 1)) >> rng.integers(0, 15, (count, 1))
    colors = rng.integers(-(2**28), 2**28 + 1, (count, 3)) >> rng.integers(0, 28, (count, 3))
    ends = np.array(np.meshgrid(*zip(LEAST, MOST, strict=True), indexing="ij")).reshape(8, -1).T
    thirds = rng.choice([-(2**28), 2**28, 2**14 - 1, 1 - 2**14, 0], (64, 3))
    rows = np.concatenate([where, sizes, shear, colors], axis=1)
    rows[:64, 5:] = thirds[: len(rows)]
    return np.concatenate([rows, ends, np.zeros((1, 8), np.int64)]).astype(np.int64)


@pytest.mark.usefixtures("words")
def test_parameters_and_work_take_32_bits() -> None:
    rows = states(20000, 0).view(Word)
    assert np.isfinite(spec.state_parameters(rows)["parameters"]).all()
    for row in rows[:: len(rows) // 200]:  # the sum alone may have more bits
        for width, height, halvings in SIZES:
            spec.main_work(row[None], width, height, halvings)


@pytest.mark.usefixtures("words")
@pytest.mark.parametrize("scale_code", range(64))
def test_densities_take_32_bits(scale_code: int) -> None:
    rng = np.random.default_rng(scale_code)
    for unit_bits, family in ((0, 0), (2, 1), (4, 0)):
        for centre in (0, 65535, -65535, int(rng.integers(-(2**15), 2**15))):
            edges = 2 * centre + np.unique([-(2**16), 2**16, *rng.integers(-(2**15), 2**15, 200) * 2])
            spec.density_frequencies(edges.view(Word), centre, family, scale_code, unit_bits)


@pytest.mark.parametrize("alpha", spec.ALPHAS)
def test_halves_take_32_bits(alpha: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """By (15-9), and by the table of (15-8) for up to 15 splats, whose formula alone has more."""
    monkeypatch.setattr(spec, "density", lambda edges, *_: edges)
    for n in (1, 2, 15, 16, 511, 512, 1023, 2**16 - 1, 2**22 - 1):
        for p in (1, 2, 2**7, 2**13):
            for q in {1, (p + 1) // 2, p}:
                spec.halves(Whole(n), Whole(p), Whole(q), Whole(alpha))
    assert all(0 < C < 2**14 for C in spec.HALVES.tolist())


@pytest.mark.usefixtures("words")
@pytest.mark.parametrize("quantizer", [0, 24, 79])
def test_prediction_takes_32_bits(quantizer: int) -> None:
    rows = states(2000, 7)
    rng = np.random.default_rng(quantizer)
    motion, differences = rng.choice([-(2**21), 2**21], (len(rows), 2)), rng.choice([-4096, 4096], (len(rows), 8))
    found = spec.main_inter(quantizer, rows.view(Word), motion.view(Word), differences.view(Word))["state"]
    assert (found >= LEAST).all()
    assert (found <= MOST).all()


def test_counts_take_32_bits() -> None:
    """The largest that a context can have: all splats of the highest level, in each of many frames."""
    counts = np.full((1, 9), 2**20).view(Word)
    for _ in range(200):
        counts = spec.adapt_model(counts, np.array([[2**22, *[0] * 8]]))["counts"].view(Word)
    assert counts[0, 0] < 2**32


def exactly(row: list[int]) -> list[Fraction]:
    """(15-5) by its definition, in integers of any size."""
    X, Y, A, B, S, *n = row
    exp2 = spec.EXP2.tolist()

    def nearest(value: int, exponent: int) -> Fraction:
        e = max(0, abs(value).bit_length() - 24)
        return round(Fraction(value, 2**e)) * Fraction(2) ** (e + exponent)

    s = max(0, max(map(abs, n)).bit_length() - 14)
    a, b, c = (value * k >> s for value, k in zip(n, spec.MAIN_K, strict=True))
    v = -(A + B) >> 1
    colors = [
        nearest((abs(T) * exp2[v % 1024] >> 15) * (-1 if T < 0 else 1), s + (v >> 10) - 29)
        for T in (a + b + c, a - 2 * c, a - b + c)
    ]
    l11, l22 = (exp2[v % 1024] * Fraction(2) ** ((v >> 10) - 15) for v in (A, B))
    return [Fraction(X, 256), Fraction(Y, 256), l11, nearest(S * exp2[B % 1024], (B >> 10) - 25), l22, *colors]


def test_parameters_are_exact_and_never_minus_zero_or_subnormal() -> None:
    rows = states(2000, 1)
    found = gsvc_ref.state_parameters(rows)
    assert [[Fraction(value) for value in row] for row in found.tolist()] == [exactly(row) for row in rows.tolist()]
    assert (found[found == 0].view(np.uint32) == 0).all()
    assert (abs(found[found != 0]) >= 2.0**-42).all()
    assert found.tobytes() == spec.state_parameters(rows)["parameters"].tobytes()


def of_draft_1(rows: I8) -> F4:
    """The parameters by the operations of binary32 that draft 1 had."""
    f4 = np.float32
    X, Y, A, B, S, n0, n1, n2 = rows.T
    l11, l22, g = (np.ldexp(spec.EXP2[v & 1023].astype(f4), (v >> 10) - 15) for v in (A, B, -(A + B) >> 1))
    a, b, c = (n.astype(f4) * f4(1 / np.sqrt(i * np.pi) / (16 * 255)) for n, i in ((n0, 3), (n1, 2), (n2, 6)))
    columns = [X.astype(f4) / f4(256), Y.astype(f4) / f4(256), l11, S.astype(f4) / f4(1024) * l22, l22]
    return np.stack([*columns, ((a + b) + c) * g, (a - f4(2) * c) * g, ((a - b) + c) * g], axis=1)


def test_parameters_are_nearly_those_of_draft_1() -> None:
    rows = states(100_000, 2)
    ours, before = gsvc_ref.state_parameters(rows), of_draft_1(rows)
    assert ours[:, :5].tobytes() == before[:, :5].tobytes()
    most = abs(before[:, 5:]).max(axis=1, keepdims=True)
    assert (abs(ours[:, 5:].astype(np.float64) - before[:, 5:]) <= 1.8e-5 * most).all()


@pytest.mark.parametrize("size", [(352, 288), (65535, 65535)])
def test_no_box_is_smaller_than_that_of_the_parameters(size: tuple[int, int]) -> None:
    rows = states(20000, 3)
    rows[::2, :2] = np.random.default_rng(4).integers(0, 256 * np.array(size), (len(rows[::2]), 2))
    left, right, top, bottom = spec.boxes(gsvc_ref.state_parameters(rows), *size, spec.REACH).T
    for axis, (begin, end), reach in (
        (0, (left, right), spec.main_reach(rows[:, 2])),
        (1, (top, bottom), height_of(rows)),
    ):
        sides = spec.main_side(rows[:, axis], reach, size[axis], 0)
        assert (sides >= end - begin).all()
        assert (sides <= end - begin + 2 + (end - begin >> 13)).all()


def height_of(rows: I8) -> I8:
    """E_y of (5-2), of any size."""
    return (spec.main_reach(rows[:, 3]) * (1024 + abs(rows[:, 4])) >> 10) + 1


@pytest.mark.parametrize(("width", "height", "halvings"), SIZES)
def test_the_work_of_states(width: int, height: int, halvings: int) -> None:
    rows = states(3000, 5)
    rows[::2, :2] = np.random.default_rng(6).integers(0, (256 * width, 256 * height), (len(rows[::2]), 2))
    found = gsvc_ref.main_work(rows, width, height, halvings)
    assert found == spec.main_work(rows, width, height, halvings)["work"]
    W, H = -(-width // 2**halvings), -(-height // 2**halvings)
    if halvings:  # the box of the filtered splat on the smaller frame
        spread = (4**halvings - 1) / 12
        x, y, l11, l21, l22 = gsvc_ref.state_parameters(rows)[:, :5].astype(np.float64).T
        e_x, e_y = (spec.REACH * np.sqrt(v + spread) for v in (l11**2, l21**2 + l22**2))
        columns = np.clip(np.ceil((x + e_x) / 2**halvings), 0, W) - np.clip(np.floor((x - e_x) / 2**halvings), 0, W)
        rows_ = np.clip(np.ceil((y + e_y) / 2**halvings), 0, H) - np.clip(np.floor((y - e_y) / 2**halvings), 0, H)
        assert found >= np.sum(columns * rows_)


def test_work_is_refused_for_other_numbers_of_halvings() -> None:
    with pytest.raises(gsvc_ref.UsageError, match=r"halvings is 4; it must be in 0\.\.3"):
        gsvc_ref.main_work(np.zeros((1, 8), np.int64), 8, 8, 4)
