"""A factor or an offset that is the same everywhere, or in each column or channel."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np

from gsvc_conformance.diagnosis.failures import F8, Mask, Part
from gsvc_conformance.diagnosis.regions import Candidate
from gsvc_conformance.names import columns

LEAST: Final = 0.95
"""Fraction of the elements large enough to tell that must have the factor."""

FEWEST: Final = 3
"""Minimum number of elements of one column with the same factor; a single number needs a factor that has a name."""

TELLING: Final = 8.0
"""Minimum size of a number that shows a factor, as a multiple of the difference that is allowed."""

MIN_SINGLE: Final = 0.75
"""Minimum fraction of the outputs of one integer that must be off by the same number."""

NAMED: Final[Mapping[float, str]] = {
    -1.0: "the other sign", 2.0: "twice", 0.5: "half", 4.0: "4 times", 0.25: "a quarter of", 3.0: "3 times",
    1 / 3: "a third of", 255.0: "255 times", 1 / 255: "1/255 of", 256.0: "256 times", 1 / 256: "1/256 of",
    -2.0: "-2 times", -0.5: "-1/2 times", math.log2(math.e): "log2(e) times", math.log(2): "ln 2 times",
}  # fmt: skip
"""Factors that have a name whatever the sizes are."""


def ratio_candidates(part: Part, inputs: Mapping[str, Any]) -> Iterator[Candidate]:
    """A factor or an offset of everything, then of single columns."""
    sizes = _sizes(part, inputs)
    everywhere = np.ones(part.right.shape, np.bool_)
    if relation := _relation(part, everywhere, sizes):
        yield Candidate(f"{relation}, everywhere")
        return
    if part.right.size == 1 and part.given.dtype.kind in "iu":
        offset = int(part.mine.flat[0] - part.right.flat[0])
        words = f"{'larger' if offset > 0 else 'smaller'} by {abs(offset)}"
        if abs(offset) == 1:
            words = f"one {'more' if offset > 0 else 'less'} than the right ones (counted from another first number?)"
        yield Candidate(f"numbers {words}, everywhere", None, MIN_SINGLE, 0.5)
    names = columns(part.operation, part.name, part.right.shape[-1] if part.right.ndim else None)
    if part.right.ndim == 2 and part.given.dtype.kind == "f" and _row_by_row(part):
        yield Candidate("each row times a factor of its own, the same in all its columns")
    if part.right.ndim < 2 or len(names) != part.right.shape[-1]:
        return
    relations: dict[str, list[str]] = {}
    for index, name in enumerate(names):
        column = np.zeros(part.right.shape, np.bool_)
        column[..., index] = True
        if (part.wrong & column).any():
            relations.setdefault(_relation(part, column, sizes), []).append(name)
    if "" not in relations:
        yield Candidate("; ".join(f"{relation} in {', '.join(where)}" for relation, where in relations.items()))


def _row_by_row(part: Part) -> bool:
    """Whether each row has a factor, and rows have different ones."""
    slack = part.slack(part.right)
    telling = (abs(part.right) > TELLING * slack) & np.isfinite(part.mine)
    rows = (telling.sum(axis=1) >= FEWEST) & part.wrong.any(axis=1)
    if rows.sum() < FEWEST or not np.isfinite(part.mine).all():
        return False
    ratios = np.where(telling, part.mine / np.where(telling, part.right, 1), np.nan)[rows]
    factors = np.nanmedian(ratios, axis=1)
    near = abs(part.mine[rows] - factors[:, None] * part.right[rows]) <= (1 + abs(factors[:, None])) * slack[rows]
    alike = abs(factors - np.median(factors)) <= 1e-3 * abs(np.median(factors))
    return bool(near.mean() >= LEAST and alike.mean() < LEAST and (factors != 0).all())


def _relation(part: Part, where: Mask, sizes: Mapping[str, float]) -> str:
    """The factor or offset between the elements of a mask and the right ones, in words; '' if there is none."""
    right, mine, allowed = part.right[where], part.mine[where], np.minimum(part.slack(part.right)[where], 1e300)
    if not (np.isfinite(mine).all() and np.isfinite(right).all()):
        return ""
    if part.name == "frame":  # samples that are clamped or rounded tell nothing
        allowed = allowed + 1.0
    telling = (abs(right) > 8 * allowed) & (abs(right) > 0)
    if _scales(part) and telling.any() and not (right[telling] == 0).any():
        factor = float(np.median(mine[telling] / right[telling]))
        same = abs(mine - factor * right) <= (1 + abs(factor)) * allowed
        changed = abs((factor - 1) * right[telling]) > allowed[telling]
        if same.mean() >= LEAST and changed.mean() >= LEAST:
            name = factor_name(factor, sizes)
            unnamed = telling.sum() < FEWEST and name.startswith("numbers times")
            return "" if factor == 0 or unnamed else name
    with np.errstate(over="ignore", invalid="ignore"):
        offset = float(np.median(mine - right))
    if right.size >= FEWEST and offset and (abs(mine - right - offset) <= 2 * allowed).mean() >= LEAST:
        varied = (abs(right - np.median(right)) > allowed).any()
        if varied and abs(offset) > 4 * float(np.median(allowed)):
            return f"numbers {'larger' if offset > 0 else 'smaller'} by {abs(offset):.6g}"
    return ""


def _scales(part: Part) -> bool:
    """Whether a factor means anything: not of indices and codes."""
    return part.given.dtype.kind == "f" or part.name == "frame"


def factor_name(factor: float, sizes: Mapping[str, float]) -> str:
    """A factor in words: what it is in constants, or in the sizes of the inputs."""
    for value, name in NAMED.items():
        if _close(factor, value):
            return f"numbers with {name}" if value == -1 else f"{name} the right numbers"
    for name, size in sizes.items():
        for sign in (1, -1):
            if size not in (0.0, 1.0) and _close(factor, sign * size):
                return f"{'-' * (sign < 0)}{name} times the right numbers"
            if size not in (0.0, 1.0) and _close(factor, sign / size):
                return f"{'-' * (sign < 0)}1/({name}) times the right numbers"
    return f"numbers times {factor:.6g}"


def _close(a: float, b: float) -> bool:
    return abs(a - b) <= 1e-4 * abs(b)


def _sizes(part: Part, inputs: Mapping[str, Any]) -> dict[str, float]:
    """Numbers of the inputs that a factor may be, by their names."""
    sizes: dict[str, float] = {}
    scalars = {name: float(v) for name, v in inputs.items() if isinstance(v, int | float)}
    pictures = [v.shape for v in inputs.values() if isinstance(v, np.ndarray) and v.ndim == 3 and v.shape[2] == 3]
    width = scalars.get("width", float(pictures[0][1]) if pictures else 0.0)
    height = scalars.get("height", float(pictures[0][0]) if pictures else 0.0)
    rows = [len(v) for v in inputs.values() if isinstance(v, np.ndarray) and v.ndim in (1, 2)]
    if width and height:
        sizes |= {"H W": width * height, "3 H W": 3 * width * height, "W": width, "H": height, "W/2": width / 2,
                  "H/2": height / 2, "W/H": width / height, "H W / 2": width * height / 2}  # fmt: skip
    if rows:
        sizes |= {"N": float(rows[0]), "3 N": 3.0 * rows[0]}
    for name, value in scalars.items():
        sizes |= {name: value, f"1 - {name}": 1 - value}
        if name == "bits" or name == "bit_depth":
            sizes |= {f"(2^{name} - 1)": 2**value - 1, f"2^{name}": 2**value}
            if rows:
                sizes[f"sqrt(N (2^{name} - 1))"] = math.sqrt(rows[0] * (2**value - 1))
    if rows and part.right.ndim <= 1:
        sizes["sqrt(N)"] = math.sqrt(rows[0])
    return sizes


def spread(part: Part) -> F8 | None:
    """The relative errors of the elements that are large enough to have one."""
    large = (abs(part.right) > 0) & np.isfinite(part.mine) & np.isfinite(part.right)
    return abs(part.mine - part.right)[large] / abs(part.right[large]) if large.any() else None
