"""The terms of each sum that spec.md defines: pictures of splats, gradients of pixels, squares of rows.

An output that is a sum is the same sum with other weights where terms were left out or taken twice; `sums` tries
which ones.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from gsvc_conformance import spec
from gsvc_conformance.diagnosis.failures import F8, Array, Failure, Part

MAX_NUMBERS: Final = 6_000_000
"""Numbers in a table of terms; larger ones are not made, or for fewer elements of the output."""

MAX_SPLATS: Final = 2048
"""Splats that are drawn alone."""

MAX_ELEMENTS: Final = 2400
"""Elements of an output for which terms are compared."""


@dataclass(frozen=True, eq=False)
class Terms:
    """An output as a sum.

    Attributes
    ----------
    noun
        The name of the terms: ``splats`` or ``pixels``.
    base
        (m,) f8, what is not summed.
    terms
        (n, m) f8; of pixels n is H W.
    chosen
        Flat indices of the m elements of the output.
    size
        (H, W) of pixels, or None.
    finish
        The function that the sum goes through, such as the rounding to samples.
    """

    noun: str
    base: F8
    terms: F8
    chosen: Array
    size: tuple[int, int] | None = None
    finish: Callable[[F8], F8] = lambda total: total


def terms_of(failure: Failure, part: Part) -> Terms | None:
    """The terms of a wrong output; None where it is no sum, or too large a one."""
    make = TERMS.get((part.operation.name, part.name))
    with np.errstate(all="ignore"):
        return make(failure.vector.inputs, part) if make else None


def some(part: Part, most: int) -> Array:
    """Flat indices of at most a given number of elements, two thirds of them wrong ones, spread evenly."""
    wrong, right = np.flatnonzero(part.wrong), np.flatnonzero(~part.wrong)
    return np.sort(np.concatenate([_spread(wrong, most * 2 // 3), _spread(right, most // 3)]))


def some_splats(part: Part, most: int) -> Array:
    """At most a given number of rows of a table, three quarters of them wrong ones, spread evenly."""
    bad = part.wrong.any(axis=1)
    return np.concatenate([_spread(np.flatnonzero(bad), most * 3 // 4), _spread(np.flatnonzero(~bad), most // 4)])


def _spread(places: Array, most: int) -> Array:
    if len(places) <= most:
        return places
    return places[np.linspace(0, len(places) - 1, most).astype(np.int64)]


def _pictures(inputs: Mapping[str, Any], part: Part) -> Terms | None:
    """(9-2): the picture of each splat alone."""
    parameters, height, width = inputs["parameters"], inputs["height"], inputs["width"]
    count = len(parameters)
    if not 0 < count <= MAX_SPLATS or count * height * width > 40 * MAX_NUMBERS:
        return None
    chosen = some(part, min(MAX_ELEMENTS, MAX_NUMBERS // count))
    draw = spec.namespace()["render_sum"]
    own = [draw(splat[None], width, height)["sum"].ravel()[chosen] for splat in parameters]
    return Terms("splats", np.zeros(len(chosen)), np.array(own, np.float64), chosen, None, _finish(inputs, part))


def _finish(inputs: Mapping[str, Any], part: Part) -> Callable[[F8], F8]:
    if part.name != "frame":
        return lambda total: total
    peak = 2 ** inputs["bit_depth"] - 1
    return lambda total: np.rint(np.clip(total, 0, 1) * peak)


def _gradients(inputs: Mapping[str, Any], part: Part) -> Terms | None:
    """(10-3) to (10-9), pixel by pixel, of some of the splats."""
    parameters, residual = inputs["parameters"].astype(np.float64), inputs["residual"].astype(np.float64)
    height, width = residual.shape[:2]
    most = min(24, MAX_NUMBERS // max(1, 8 * height * width))
    if most < 2:
        return None
    splats = some_splats(part, most)
    terms = np.concatenate([pixel_gradients(parameters[n], residual) for n in splats], axis=1)
    if not np.isfinite(terms).all():
        return None
    chosen = (splats[:, None] * 8 + np.arange(8)).ravel()
    return Terms("pixels", np.zeros(len(chosen)), terms, chosen, (height, width))


def pixel_gradients(splat: F8, residual: F8) -> F8:
    """(H W, 8) f8: what each pixel adds to the gradient of a splat; zeros for one that is not drawn."""
    x, y, l11, l21, l22 = splat[:5]
    height, width = residual.shape[:2]
    if not all(2.0**-126 <= factor < np.inf for factor in (l11, l22)):
        return np.zeros((height * width, 8))
    u1 = np.broadcast_to((np.arange(width)[None, :] + 0.5 - x) / l11, (height, width))
    u2 = (np.arange(height)[:, None] + 0.5 - y - l21 * u1) / l22
    sigma = (u1 * u1 + u2 * u2) / 2
    g = np.where(sigma <= spec.namespace()["LN_255"], np.exp(-sigma), 0.0)
    q = g * (residual @ splat[5:])
    v2 = u2 / l22
    v1 = (u1 - l21 * v2) / l11
    columns = [q * v1, q * v2, q * v1 * u1, q * v2 * u1, q * v2 * u2, *np.moveaxis(g[:, :, None] * residual, 2, 0)]
    return np.stack([np.where(g > 0, column, 0.0) for column in columns], axis=-1).reshape(-1, 8)


def _loss(inputs: Mapping[str, Any], part: Part) -> Terms:
    """(10-1), pixel by pixel."""
    picture, target = (inputs[name].astype(np.float64) for name in ("picture", "target"))
    squares = ((np.clip(picture, 0, 1) - target) ** 2).sum(axis=2)
    terms = squares.reshape(-1, 1) / squares.size
    return Terms("pixels", np.zeros(1), terms, np.zeros(1, np.int64), (picture.shape[0], picture.shape[1]))


def _mse(inputs: Mapping[str, Any], part: Part) -> Terms:
    """(11-5), pixel by pixel."""
    squares = ((inputs["a"].astype(np.float64) - inputs["b"]) ** 2).sum(axis=2)
    terms = squares.reshape(-1, 1) / (3 * squares.size)
    return Terms("pixels", np.zeros(1), terms, np.zeros(1, np.int64), (squares.shape[0], squares.shape[1]))


def _lsq(inputs: Mapping[str, Any], part: Part) -> Terms | None:
    """dL/ds and dL/dbeta, row by row: the gradients of each row alone."""
    rows = inputs["x"]
    if not 0 < rows.size <= MAX_NUMBERS // 8:
        return None
    one = spec.namespace()["lsq_ratio"]
    largest = 2 ** inputs["bits"] - 1
    t = one(rows, inputs["scale"], inputs["offset"]).astype(np.float64)
    inside = (t >= 0) & (t <= largest)
    if part.name == "grad_scale":
        by = np.where(inside, np.rint(np.clip(t, 0, largest)) - t, np.where(t > largest, largest, 0.0))
    else:
        by = np.where(inside, 0.0, 1.0)
    terms = inputs["grad_output"].astype(np.float64) * by
    return Terms("splats", np.zeros(rows.shape[1]), terms, np.arange(rows.shape[1]))


def _users(inputs: Mapping[str, Any], part: Part) -> Terms | None:
    """(10-22), row by row: what each vector adds to the count and the sum of its codewords."""
    x, indices, sizes = inputs["x"], inputs["indices"].astype(np.int64), inputs["codebook_sizes"]
    if not 0 < len(x) * part.right.size <= MAX_NUMBERS:
        return None
    namespace = spec.namespace()
    r = namespace["rvq_residuals"](x, indices, namespace["codebooks_by_stage"](sizes, inputs["codebooks"]))
    share, width = 1 - inputs["decay"], 3 if part.name == "sums" else 1
    terms = np.zeros((len(x), int(sizes.sum()), width))
    first = 0
    for k, size in enumerate(sizes):
        added = r[k].astype(np.float64) if width == 3 else np.ones((len(x), 1))
        terms[np.arange(len(x)), first + indices[:, k]] += share * added
        first += int(size)
    base = inputs["decay"] * inputs[part.name].reshape(-1)
    return Terms("splats", base, terms.reshape(len(x), -1), np.arange(part.right.size))


def _commitment(inputs: Mapping[str, Any], part: Part) -> Terms | None:
    """(10-20), row by row."""
    x = inputs["x"]
    namespace = spec.namespace()
    books = namespace["codebooks_by_stage"](inputs["codebook_sizes"], inputs["codebooks"])
    r = namespace["rvq_residuals"](x, inputs["indices"], books)
    squares = sum((error.astype(np.float64) ** 2).sum(axis=1) for error in r[1:])
    if not len(x):
        return None
    return Terms("splats", np.zeros(1), np.reshape(squares, (-1, 1)) / (3 * len(x)), np.zeros(1, np.int64))


def _work(inputs: Mapping[str, Any], part: Part) -> Terms | None:
    """(5-1), splat by splat."""
    namespace = spec.namespace()
    reach = namespace["boxes"](inputs["parameters"], inputs["width"], inputs["height"], namespace["REACH"])
    left, right, top, bottom = np.asarray(reach, np.float64).reshape(-1, 4).T
    terms = ((right - left) * (bottom - top)).reshape(-1, 1)
    return Terms("splats", np.zeros(1), terms, np.zeros(1, np.int64)) if len(terms) else None


TERMS: Final[Mapping[tuple[str, str], Callable[[Mapping[str, Any], Part], Terms | None]]] = {
    ("render_sum", "sum"): _pictures,
    ("render_sum_deterministic", "sum"): _pictures,
    ("render_frame", "frame"): _pictures,
    ("render_gradients", "gradients"): _gradients,
    ("loss", "loss"): _loss,
    ("metrics", "mse"): _mse,
    ("lsq_gradients", "grad_scale"): _lsq,
    ("lsq_gradients", "grad_offset"): _lsq,
    ("rvq_update", "counts"): _users,
    ("rvq_update", "sums"): _users,
    ("commitment", "loss"): _commitment,
    ("rendering_work", "work"): _work,
}
"""Terms of sums, by operation and output."""


def names_of(noun: str, weights: F8) -> Iterator[str]:
    """Sentences about the terms whose weight is not 1: left out, or taken several times."""
    for weight in sorted({int(w) for w in weights} - {1}):
        places = np.flatnonzero(weights == weight)
        listed = ", ".join(str(place) for place in places[:6]) + (", ..." if len(places) > 6 else "")
        times = {0: "left out", 2: "taken twice"}.get(weight, f"taken {weight} times")
        yield f"{noun} {listed} {times}"
