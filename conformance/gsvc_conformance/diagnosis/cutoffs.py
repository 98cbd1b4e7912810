"""Supports that end elsewhere."""

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

import numpy as np

from gsvc_conformance.diagnosis.failures import F8, Failure, Mask, Part
from gsvc_conformance.diagnosis.regions import Candidate
from gsvc_conformance.diagnosis.terms import pixel_gradients, some_splats

MOST: Final = 3_000_000
"""Pixels times splats; more are not tried."""
MAX_SPLATS: Final = 1_000
"""Maximum number of terms of a sum; more would take seconds, and smaller vectors have failed, too."""

Keeps = Callable[[F8, F8], Mask]
"""From sigma (H, W) and a colour (3,) where a splat is drawn."""


def _to_sigma(limit: float) -> Keeps:
    return lambda sigma, color: np.asarray(sigma <= limit)


def _from_alpha(least: float) -> Keeps:
    return lambda sigma, color: np.asarray((sigma <= LN_255) & (np.exp(-sigma) * abs(color).max() >= least))


LN_255: Final = math.log(255)
CUTOFFS: Final[tuple[tuple[str, Keeps], ...]] = (
    ("a support that ends where u.u, not sigma = u.u/2, exceeds ln 255", _to_sigma(LN_255 / 2)),
    ("a support that ends at 3 standard deviations (sigma 4.5)", _to_sigma(4.5)),
    ("a support that ends at 2 standard deviations (sigma 2)", _to_sigma(2.0)),
    ("a support that ends at sigma 3", _to_sigma(3.0)),
    ("a support that ends at sigma 4", _to_sigma(4.0)),
    ("a support that ends at sigma 5", _to_sigma(5.0)),
    ("a support that ends at a weight of 1/100", _to_sigma(math.log(100))),
    ("a support that ends at a weight of 1/128", _to_sigma(math.log(128))),
    ("a support that ends at 4 standard deviations (sigma 8)", _to_sigma(8.0)),
    ("a support that ends at a weight of 1/1000", _to_sigma(math.log(1000))),
    ("a support that ends at a weight of 1/10000", _to_sigma(math.log(10000))),
    (
        "pixels left out where a weight times the largest colour is below 1/255, as with an opacity",
        _from_alpha(1 / 255),
    ),
    (
        "pixels left out where a weight times the largest colour is below 1/256, as with an opacity",
        _from_alpha(1 / 256),
    ),
)
"""Where a splat may end, by what is said of it."""


def cutoff_candidates(failure: Failure, part: Part) -> Iterator[Candidate]:
    """Which other end of the support gives a wrong sum, frame or gradient."""
    inputs = failure.vector.inputs
    if (part.operation.name, part.name) not in OF_OPERATIONS or not part.right.size:
        return
    make = OF_OPERATIONS[part.operation.name, part.name]
    with np.errstate(all="ignore"):
        for sentence, keeps in CUTOFFS:
            theirs = make(inputs, part, keeps)
            if theirs is None:
                return
            chosen, values = theirs
            if chosen.agrees(values):
                yield Candidate(sentence)
                return


def _distances(splat: F8, height: int, width: int) -> F8:
    """(9-1): sigma of each pixel; infinite for a splat that is not drawn."""
    x, y, l11, l21, l22 = splat[:5]
    if not all(2.0**-126 <= factor < np.inf for factor in (l11, l22)):
        return np.full((height, width), np.inf)
    u1 = np.broadcast_to((np.arange(width)[None, :] + 0.5 - x) / l11, (height, width))
    u2 = (np.arange(height)[:, None] + 0.5 - y - l21 * u1) / l22
    return np.asarray((u1 * u1 + u2 * u2) / 2)


def _sum(inputs: Mapping[str, Any], part: Part, keeps: Keeps) -> tuple[Part, F8] | None:
    parameters, height, width = inputs["parameters"].astype(np.float64), inputs["height"], inputs["width"]
    if len(parameters) > MAX_SPLATS or len(parameters) * height * width > MOST:
        return None
    total = np.zeros((height, width, 3))
    for splat in parameters:
        sigma = _distances(splat, height, width)
        total += np.where(keeps(sigma, splat[5:]), np.exp(-sigma), 0.0)[:, :, None] * splat[5:]
    return part, _finished(total, inputs, part)


def _finished(total: F8, inputs: Mapping[str, Any], part: Part) -> F8:
    """The samples of a sum, where frames are what is wrong."""
    if part.name != "frame":
        return total
    return np.asarray(np.rint(np.clip(total, 0, 1) * (2 ** inputs["bit_depth"] - 1)))


def _gradients(inputs: Mapping[str, Any], part: Part, keeps: Keeps) -> tuple[Part, F8] | None:
    parameters, residual = inputs["parameters"].astype(np.float64), inputs["residual"].astype(np.float64)
    height, width = residual.shape[:2]
    chosen = some_splats(part, 8)
    if len(chosen) * height * width > MOST / 8:
        return None
    rows = [
        pixel_gradients(parameters[n], residual)[
            keeps(_distances(parameters[n], height, width), parameters[n, 5:]).ravel()
        ].sum(axis=0)
        for n in chosen
    ]
    return part.at(chosen), np.array(rows)


OF_OPERATIONS: Final[Mapping[tuple[str, str], Callable[..., tuple[Part, F8] | None]]] = {
    ("render_sum", "sum"): _sum,
    ("render_frame", "frame"): _sum,
    ("render_gradients", "gradients"): _gradients,
}
"""Sums that may end early, by operation and output."""
