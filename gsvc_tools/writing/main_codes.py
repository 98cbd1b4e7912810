"""Codes of profile `main` for splats as they are given.

An I-frame rounds a tenth of the splats at a time to their nearest codes, and what was rounded is held. The others, as
far as `Refit` lets them, then make up for what rounding did to the picture of the splats given: each descends by L-BFGS
on the squared error, which is linear least squares where colours alone are free.

A P-frame codes the differences of the splats that stay. A motion field takes the part of their motion that neighbours
share, and a group of differences, of position, shape or color, that is not worth its bits is left out.
"""

from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8, I8
from gsvc_base.portable import exp, log
from gsvc_ref.encoder.main.codes import INTRA_LIMITS, nearest_codes
from gsvc_ref.encoder.main.coordinates import MIN_DIAGONAL, ROOT2, to_coordinates, to_parameters
from gsvc_ref.encoder.main.descent import Walk
from gsvc_ref.encoder.main.differences import (
    GS,
    GX,
    GY,
    LOG_SIZE,
    MAX_DIFFERENCE,
    MAX_LOG,
    SHEAR,
    Anchors,
)
from gsvc_ref.encoder.main.field import LONGEST_VECTOR, UNITS, curvatures, read_field, spread
from gsvc_ref.encoder.main.fitter import MAX_SHEAR, MIN_MARGIN
from gsvc_ref.encoder.main.target import Target
from gsvc_ref.main.codes import GROUPS, IntraCodes
from gsvc_ref.main.motion import field_shape
from gsvc_ref.main.reconstruct import intra_state
from gsvc_ref.main.state import S_MOST, parameters_of

Refit = Literal["none", "colors", "all"]

PARTS: Final = 10
"""Parts of an I-frame that are rounded one after the other. With 5 of the sizes that the encoder takes, 1,000 splats of
photographs had 1 % more bits at the same loss, with 20 up to 0.7 % fewer in twice the time."""

EVALUATIONS: Final = 8
"""Of the splats that are free, after each part."""

END: Final = 2 * float(log(255.0))  # squared deviations at which a splat ends (9-4)
MAX_DIAGONAL: Final = float(exp(MAX_LOG))  # largest l11 and l22 in pixels that a state can hold
MAX_SIDES: Final = 32.0
"""Larger splats than this many sides of a frame become as large: they cover it evenly, to 1/2000 of their colour."""


WORTH: Final = 0.5
"""A group of differences is coded where that takes more than this off the error of its splat, in D^2. Splats of three
clips that were trained frame by frame took about as many bits at 45 dB with 0.2 to 0.6, and 1 to 4 % more with 1 and
2."""

STILL: Final = 0.05
"""A group stays where it was refitted if what was given has changed by a squared length of less than this, in D^2."""

MAX_CHANGE: Final = 20.0  # of ln(l11 / l22), so that exp stays within its range
SWEEPS: Final = 60  # of the search for a motion field
LITTLE_WEIGHT: Final = 1e-9  # weight at which a cell of the field stays as it is


class Codable(NamedTuple):
    """Splats within what an I-frame can hold."""

    z: F8  # (N, 8), their coordinates
    anywhere: F8  # (N, 8), those as near to them that a P-frame can hold, beyond the edges as well
    is_visible: NDArray[np.bool_]  # (N,), whether they reach the frame


def codable(parameters: F4, width: int, height: int) -> Codable:
    """The nearest splats to (N, 8) f4 that an I-frame can hold: inside of the frame, neither too large nor too slanted.

    A centre beyond an edge moves onto it. Across the edge the splat then has the value that it had there, and falls to
    1/e of it, or at the far side of the frame, where it did.
    """
    x, y, l11, l21, l22 = parameters[:, :5].astype(np.float64).T
    color = parameters[:, 5:].astype(np.float64)
    visible = np.ones(len(parameters), np.bool_)
    xx, xy, yy = l11 * l11, l11 * l21, l21 * l21 + l22 * l22
    for axis, side in enumerate((width, height)):
        position, along = (x, xx) if axis == 0 else (y, yy)
        beyond = np.maximum(np.maximum(-position, position - side), 0)
        visible &= beyond * beyond < END * along
        moves = (beyond > 0) & visible
        to = np.clip(position, MIN_MARGIN, side - MIN_MARGIN)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            fall = np.minimum(np.sqrt(beyond * beyond + 2 * along) - beyond, side)
            variance = fall * along / (fall + 2 * beyond)
            value = exp(np.where(moves, -0.5 * beyond * beyond / along, 0.0))
            shift = (to - position) / along
            change = (variance / along - 1) / along
        color = np.where(moves[:, None], color * value[:, None], color)
        x, y = (np.where(moves, one + part * shift, one) for one, part in ((x, (xx, xy)[axis]), (y, (xy, yy)[axis])))
        first, second = (xx, xy) if axis == 0 else (xy, yy)
        xx, xy, yy = (
            np.where(moves, one + change * product, one)
            for one, product in ((xx, first * first), (xy, first * second), (yy, second * second))
        )
    moved = (x != parameters[:, 0]) | (y != parameters[:, 1])
    l11 = np.where(moved, np.sqrt(xx), l11)
    l21 = np.where(moved, xy / l11, l21)
    l22 = np.where(moved, np.sqrt(np.maximum(yy - l21 * l21, 0)), l22)
    most = min(MAX_SIDES * max(width, height), MAX_DIAGONAL)
    z = to_coordinates(_limited(x, y, l11, l21, l22, color, most))
    x, y, l11, l21, l22 = parameters[:, :5].astype(np.float64).T
    anywhere = to_coordinates(_limited(x, y, l11, l21, l22, parameters[:, 5:], most))
    z[:, :2] = np.clip(z[:, :2], MIN_MARGIN, [width - MIN_MARGIN, height - MIN_MARGIN])
    return Codable(z, anywhere, visible)


def _limited(x: F8, y: F8, l11: F8, l21: F8, l22: F8, color: F8 | F4, most: float) -> F4:
    """Parameters (N, 8) within the limits of shear and size; l21 / l22 holds where a splat is too large."""
    smaller = np.clip(l22, MIN_DIAGONAL, most)
    l21 = l21 * np.minimum(1, smaller / np.maximum(l22, MIN_DIAGONAL))
    l21 = np.clip(l21, -MAX_SHEAR * most, MAX_SHEAR * most)
    wider = np.maximum(smaller, np.abs(l21) / MAX_SHEAR)
    columns = [x, y, np.clip(l11, MIN_DIAGONAL, most), l21, wider, *(color * (smaller / wider)[:, None]).T]
    return np.stack(columns, axis=1).astype(np.float32)


def rounded(
    target: Target, z: F8, step: int, refit: Refit, rng: np.random.Generator, limits: I8 = INTRA_LIMITS
) -> IntraCodes:
    """The codes of splats with the coordinates z (N, 8), in their order, close to the target's picture.

    Positions and shapes stay those nearest to the given ones unless `refit` is ``all``.
    """
    order, z = np.argsort(rng.random(len(z)), kind="stable"), z.copy()
    parts: list[IntraCodes] = []
    held: list[F4] = []
    for part in np.array_split(order, 1 if refit == "none" else PARTS):
        parts.append(nearest_codes(z[part], step, target.width, target.height, limits))
        held.append(parameters_of(intra_state(parts[-1], step)))
        free = order[sum(map(len, held)) :]
        if len(free):
            target.hold(np.concatenate(held))
            z[free] = _made_up(target, z[free], step / 16, refit)
    target.hold(np.zeros((0, 8), np.float32))
    return IntraCodes.joined(parts).take(np.argsort(order, kind="stable"))


def _made_up(target: Target, z: F8, D: float, refit: Refit) -> F8:
    """The coordinates z (N, 8) after some steps towards the picture, with what is held."""
    walk = Walk(len(z), D)
    for _ in range(EVALUATIONS):
        error, gradient = target.evaluate(to_parameters(z))
        if refit == "colors":
            gradient[:, :5] = 0
        z = walk.next(z, error, gradient)
        z[:, 0] = np.clip(z[:, 0], MIN_MARGIN, target.width - MIN_MARGIN)
        z[:, 1] = np.clip(z[:, 1], MIN_MARGIN, target.height - MIN_MARGIN)
    assert walk.best is not None
    return walk.best.z


class Differences(NamedTuple):
    """Differences of splats that stay."""

    q: I8  # (N, 8)
    error: float  # the squared error that they leave, of each splat alone, in D^2


def nearest_differences(anchors: Anchors, z: F8, refits: F8) -> Differences:
    """The differences that are worth their bits and bring splats closest to the coordinates z (N, 8).

    A group stays where it is by `refits` (N, 8) that its splat is not where it was given.

    As in `nearest_codes`, y compensates for what x lacks along the splat, and the shear is that which holds l21 / l11.
    """
    exact, whole = _differences(anchors, z)
    moved, _ = _differences(anchors, z + refits)
    error = 0.0
    for _, first, end in GROUPS:
        square, since, left = (
            np.cumsum(part[:, first:end] ** 2, axis=1)[:, -1] for part in (exact, moved, exact - whole)
        )
        is_idle = (square <= WORTH + left) | (since <= STILL)
        whole[is_idle, first:end] = 0
        error += float(np.cumsum(np.where(is_idle, square, left))[-1]) if len(z) else 0.0
    return Differences(whole.astype(np.int64), error)


def _differences(anchors: Anchors, z: F8) -> tuple[F8, F8]:
    """The differences (N, 8) to coordinates z (N, 8), and the whole ones next to them."""
    start, steps = anchors.z, anchors.steps
    exact, whole = np.zeros(z.shape), np.zeros(z.shape)

    def set_nearest(k: int, difference: F8, step: F8 | float) -> F8:
        exact[:, k] = difference / step
        whole[:, k] = np.clip(np.floor(exact[:, k] + 0.5), -MAX_DIFFERENCE, MAX_DIFFERENCE)
        return whole[:, k] * step

    lacks = start[:, 0] + set_nearest(0, z[:, 0] - start[:, 0], steps[:, GX]) - z[:, 0]
    along = z[:, 4] * exp(np.clip(-ROOT2 * z[:, 3], -MAX_CHANGE, MAX_CHANGE))  # l21 / l11
    y = z[:, 1] + along * lacks - start[:, 1] - steps[:, GS] * whole[:, 0]
    set_nearest(1, y, steps[:, GY])
    set_nearest(2, z[:, 2] - start[:, 2], steps[:, LOG_SIZE])
    turned = set_nearest(3, z[:, 3] - start[:, 3], steps[:, LOG_SIZE])
    change = np.clip(ROOT2 * (start[:, 3] + turned - z[:, 3]), -MAX_CHANGE, MAX_CHANGE)
    shear = np.clip(z[:, 4] * exp(change), -S_MOST / 1024, S_MOST / 1024)
    kept = start[:, 4] * exp(np.clip(ROOT2 * turned, -MAX_CHANGE, MAX_CHANGE))
    set_nearest(4, shear - kept, steps[:, SHEAR])
    for k in range(5, 8):
        set_nearest(k, z[:, k] - start[:, k], anchors.D)
    return exact, whole


def motion_fields(reference: F4, to: F8, cells: tuple[int, ...], width: int, height: int) -> dict[int, I8]:
    """A field of vectors (rows, columns, 2) i8 for each side of a cell, close to the motion of splats.

    `reference` (N, 8) f4 are the splats before they move, and `to` (N, 2) f8 is where they go, in pixels.
    Motions are weighed by what they cost the picture. That of the largest cells begins at rest, each other one with the
    one before, and cells in which no splat stands stay as they were.
    """
    points, weights = reference[:, :2].astype(np.float64), curvatures(reference)
    motion = UNITS * (to - points)
    fields: dict[int, I8] = {}
    if not (np.abs(motion) >= 0.5).any():
        return fields
    before: tuple[int, F8] | None = None
    for cell in cells:
        rows, columns = field_shape(width, height, cell)
        vectors = np.zeros((rows, columns, 2))
        if before is not None:
            centers = cell * (np.mgrid[:columns, :rows].T.reshape(-1, 2) + 0.5)
            vectors = read_field(before[1], before[0], centers).reshape(rows, columns, 2)
        total = spread(weights, cell, points, vectors.shape)
        for _ in range(SWEEPS):  # of weighted means of what is left
            left = motion - read_field(vectors, cell, points)
            change = spread(weights * left, cell, points, vectors.shape)
            vectors = vectors + np.where(total > LITTLE_WEIGHT, change / np.maximum(total, LITTLE_WEIGHT), 0)
        vectors = np.clip(vectors, -LONGEST_VECTOR, LONGEST_VECTOR)
        before = cell, vectors
        fields[cell] = np.floor(vectors + 0.5).astype(np.int64)
    return fields
