"""The operations of profile `main` by the names and arguments of spec.md section 4.3, from arrays to arrays."""

from operator import index
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gsvc_base.arrays import F4, I8
from gsvc_base.checks import door
from gsvc_base.errors import UsageError
from gsvc_ref.main import cells as halves
from gsvc_ref.main import models, reconstruct
from gsvc_ref.main import motion as fields
from gsvc_ref.main import state as states
from gsvc_ref.main.codes import SIDES, IntraCodes
from gsvc_ref.main.densities import ALPHAS, MAGNITUDE_CLASSES, cumulative, windows_at
from gsvc_ref.main.passes import magnitudes_of, signed
from gsvc_ref.main.tables import step_of

ANY: Final = None
"""A side of an array that may have any length."""


# twin of spec.density_frequencies
@door
def density_frequencies(edges: ArrayLike, centre: int, density_family: int, scale_code: int, unit_bits: int) -> I8:
    """Cumulative frequencies of the bins of a density (15-6).

    Parameters
    ----------
    edges
        (K,) i8, the inner edges of K + 1 bins, doubled, growing.
    centre
        The centre, in the unit of the edges before doubling.
    density_family
        0 logistic, 1 Laplace.
    scale_code
        0..63: the scale is 2^(scale_code / 4) times 2^unit_bits units.
    unit_bits
        0..4.

    Returns
    -------
    (K + 2,) i8, from 0 to 2^14.

    Raises
    ------
    UsageError
        An argument is of another type or shape, or there is no such family.
    """
    if density_family not in (0, 1):
        raise UsageError(f"density_family is {density_family!r}; it must be 0 or 1")
    return cumulative(_integers("edges", edges, ANY), centre, density_family, scale_code, unit_bits)


class WindowFrequencies(NamedTuple):
    """The distribution of a code of size, aspect or shear over its window."""

    cumulative: I8
    """(M,) i8, from 0 to 2^14: the cumulative frequencies of its upper bits, less `first`."""
    first: int
    """The upper bits of the lowest code."""
    low_bits: int
    """How many of its low bits are raw."""


# twin of spec.window_frequencies
@door
def window_frequencies(centre: int, step: int, density_family: int, scale_code: int) -> WindowFrequencies:
    """The distribution of a code of size, aspect or shear over its window (15-7).

    Parameters
    ----------
    centre
        m, in 1/1024 octave or of S.
    step
        h, what a code stands for in that unit, 1..2048.
    density_family
        0 logistic, 1 Laplace.
    scale_code
        0..31: the scale is 2^(scale_code / 4) sixteenths of an octave or of S.

    Returns
    -------
    WindowFrequencies
        `cumulative`, `first` and `low_bits`.

    Raises
    ------
    UsageError
        The family is unknown, or the step is below 1.
    """
    if density_family not in (0, 1) or step < 1:
        raise UsageError(f"density_family is {density_family!r} and step {step}; they must be 0 or 1, and at least 1")
    windows = windows_at(np.array([centre]), np.array([step]), density_family, scale_code)
    return WindowFrequencies(windows.distributions.cumulative, int(windows.first[0]), int(windows.low_bits[0]))


class HalfFrequencies(NamedTuple):
    """The distribution of the number of splats in the first half of a part."""

    cumulative: I8
    """(M,) i8, from 0 to 2^14: the cumulative frequencies of its upper bits."""
    low_bits: int
    """How many of its low bits are raw."""


# twin of spec.half_frequencies
@door
def half_frequencies(count: int, first_half: int, second_half: int, alpha: int) -> HalfFrequencies:
    """The distribution of how many of a part's splats are in its first half (15-8), (15-9).

    Parameters
    ----------
    count
        The splats of the part, at least 1.
    first_half, second_half
        p and q, the cells of both halves inside of the frame along the side that is halved; 1 <= q <= p.
    alpha
        The shape, one of 1, 2, 3, 4, 6, 10, 20 and 100.

    Returns
    -------
    HalfFrequencies
        `cumulative` and `low_bits`.

    Raises
    ------
    UsageError
        An argument is not a whole number or is below 1, or there is no such shape.
    """
    if min(count, first_half, second_half) < 1:
        raise UsageError("count, first_half and second_half must be at least 1")
    if alpha not in ALPHAS:
        raise UsageError(f"alpha is {alpha!r}; it must be one of {', '.join(map(str, ALPHAS))}")
    return HalfFrequencies(*halves.half_distribution(count, first_half, second_half, alpha))


# twin of spec.codes_of_classes
@door
def codes_of_classes(classes: ArrayLike, low: ArrayLike, negative: ArrayLike) -> I8:
    """The codes that classes of magnitudes, low bits and signs stand for (spec.md section 15.7).

    Parameters
    ----------
    classes
        (N,) i8, 0..39.
    low
        (N,) i8, the low bits of the magnitude.
    negative
        (N,) i8, 1 where the code is negative, else 0.

    Returns
    -------
    (N,) i8.

    Raises
    ------
    UsageError
        An argument is of another type or shape, or there is no such class.
    """
    rows = _integers("classes", classes, ANY)
    if np.any((rows < 0) | (rows >= MAGNITUDE_CLASSES)):
        raise UsageError(f"classes must be 0 to {MAGNITUDE_CLASSES - 1}")
    magnitudes = magnitudes_of(rows, _integers("low", low, len(rows)))
    return signed(magnitudes, _integers("negative", negative, len(rows)))


# twin of spec.cells_of_halves
@door
def cells_of_halves(width: int, height: int, count: int, first_halves: ArrayLike) -> I8:
    """The cells of splats, by how many are in the first half of each part (spec.md section 15.8).

    Parameters
    ----------
    width, height
        The size of the frame in pixels.
    count
        The number of splats, at least 1.
    first_halves
        (K,) i8, at least 0: for each halving the number of each part that has splats.

    Returns
    -------
    (count, 2) i8, column and row.

    Raises
    ------
    UsageError
        An argument is of another type or shape or too small, or there are more or fewer numbers than parts.
    """
    numbers = _integers("first_halves", first_halves, ANY)
    if min(width, height, count) < 1 or np.any(numbers < 0):
        raise UsageError("width, height and count must be at least 1, and first_halves at least 0")
    return halves.cells_of_halves(numbers, index(count), index(width), index(height))


# twin of spec.field_vectors
@door
def field_vectors(differences: ArrayLike) -> I8:
    """The vectors of a motion field, by the differences that are coded (spec.md section 15.10).

    Parameters
    ----------
    differences
        (r, c, 2) i8, each to the vector to the left, in the first column to the one above.

    Returns
    -------
    (r, c, 2) i8, -2^15..2^15 - 1, in quarter pixels.

    Raises
    ------
    UsageError
        The differences are no integers of that shape, or there are none.
    """
    coded = _integers("differences", differences, ANY, ANY, 2)
    if coded.size == 0:
        raise UsageError("differences must have at least one row and one column")
    return fields.field_vectors(coded)


# twin of spec.model_frequencies
@door
def model_frequencies(counts: ArrayLike) -> I8:
    """Cumulative frequencies of each context of a model (15-14).

    Parameters
    ----------
    counts
        (C, K) i8, at least 0, and one of each row above 0; each row adds up to less than 2^32.

    Returns
    -------
    (C, K + 1) i8, each row from 0 to 2^14.

    Raises
    ------
    UsageError
        The counts are no integers of that shape.
    """
    rows = _integers("counts", counts, ANY, ANY)
    return models.distributions(rows).cumulative.reshape(len(rows), -1)


# twin of spec.adapt_model
@door
def adapt_model(counts: ArrayLike, seen: ArrayLike) -> I8:
    """The counts of a model after a P-frame (15-11).

    Parameters
    ----------
    counts
        (C, K) i8, as in `model_frequencies`.
    seen
        (C, K) i8, how often each symbol was decoded in each context.

    Returns
    -------
    (C, K) i8, those of the next frame.

    Raises
    ------
    UsageError
        The arguments are no integers of these shapes.
    """
    rows = _integers("counts", counts, ANY, ANY)
    return models.adapted(rows, _integers("seen", seen, *rows.shape))


# twin of spec.mode_contexts
@door
def mode_contexts(
    width: int, height: int, state: ArrayLike, past: ArrayLike, motion: ArrayLike, vectors: ArrayLike, motion_cell: int
) -> I8:
    """The context of the mode of each splat of a P-frame (spec.md section 15.11).

    Parameters
    ----------
    width, height
        The size of the frame in pixels.
    state
        (N, 8) i8, the splats of the frame before.
    past
        (N,) i8, what that frame did with each: 0 nothing, 1 it changed, 2 it was new.
    motion
        (N, 2) i8, by how much each moves with the field, in 1/256 pixel.
    vectors
        (r, c, 2) i8, the field in quarter pixels; none where `motion_cell` is 0.
    motion_cell
        0..3.

    Returns
    -------
    (N,) i8, 0..9.

    Raises
    ------
    UsageError
        An argument is of another type or shape, or there is no such `motion_cell`.
    """
    values = _integers("state", state, ANY, 8)
    moved = _integers("motion", motion, len(values), 2)
    before = _integers("past", past, len(values))
    field, side = _integers("vectors", vectors, ANY, ANY, 2), _side(motion_cell, 0)
    return fields.mode_contexts(values, moved, before, field, side, width, height)


# twin of spec.splat_classes
@door
def splat_classes(state: ArrayLike, quantizer: int) -> I8:
    """The class of each splat (15-4).

    Parameters
    ----------
    state
        (N, 8) i8.
    quantizer
        0..79.

    Returns
    -------
    (N,) i8, 0..10.

    Raises
    ------
    UsageError
        The state is of another type or shape, or there is no such quantiser.
    """
    return states.classes(_integers("state", state, ANY, 8)[:, 5:], step_of(quantizer))


# twin of spec.main_intra
@door
def main_intra(quantizer: int, cells: ArrayLike, colors: ArrayLike, shapes: ArrayLike, places: ArrayLike) -> I8:
    """The state that the codes of an I-frame, or of new splats, stand for (15-10), clipped (R-15.4-1).

    Parameters
    ----------
    quantizer
        0..79.
    cells
        (N, 2) i8, column and row of each splat's cell.
    colors
        (N, 3) i8, k0, k1 and k2.
    shapes
        (N, 3) i8, the codes of size, aspect and shear.
    places
        (N, 2) i8, the place in the cell.

    Returns
    -------
    (N, 8) i8.

    Raises
    ------
    UsageError
        An argument is of another type or shape, or there is no such quantiser.
    """
    where = _integers("cells", cells, ANY, 2)
    codes = IntraCodes(
        cells=where,
        colors=_integers("colors", colors, len(where), 3),
        shapes=_integers("shapes", shapes, len(where), 3),
        places=_integers("places", places, len(where), 2),
    )
    return reconstruct.intra_state(codes, step_of(quantizer))


# twin of spec.motion_of_splats
@door
def motion_of_splats(state: ArrayLike, vectors: ArrayLike, motion_cell: int) -> I8:
    """By how much each splat moves with the motion field (15-12).

    Parameters
    ----------
    state
        (N, 8) i8, the splats of the frame before.
    vectors
        (r, c, 2) i8, the field in quarter pixels, at least one vector.
    motion_cell
        1..3: cells of 64, 32 or 16 pixels.

    Returns
    -------
    (N, 2) i8, in 1/256 pixel.

    Raises
    ------
    UsageError
        An argument is of another type or shape, or there is no such `motion_cell`.
    """
    values, field = _integers("state", state, ANY, 8), _integers("vectors", vectors, ANY, ANY, 2)
    return fields.field_motion(values, field, _side(motion_cell, 1))


# twin of spec.main_inter
@door
def main_inter(quantizer: int, state: ArrayLike, motion: ArrayLike, differences: ArrayLike) -> I8:
    """The state of the splats that stay, after motion and differences (R-15.11-2), (15-13).

    Parameters
    ----------
    quantizer
        0..79.
    state
        (N, 8) i8, the reference.
    motion
        (N, 2) i8, in 1/256 pixel.
    differences
        (N, 8) i8, q.

    Returns
    -------
    (N, 8) i8.

    Raises
    ------
    UsageError
        An argument is of another type or shape, or there is no such quantiser.
    """
    values = _integers("state", state, ANY, 8)
    moved, added = _integers("motion", motion, len(values), 2), _integers("differences", differences, len(values), 8)
    return reconstruct.add_differences(values, moved, added, step_of(quantizer))


# twin of spec.state_parameters
@door
def state_parameters(state: ArrayLike) -> F4:
    """The parameters of splats, bit for bit those of every decoder (R-15.4-2), (15-5).

    Parameters
    ----------
    state
        (N, 8) i8, within the ranges of section 15.4.

    Returns
    -------
    (N, 8) f4, in the columns of `Splats.to_array`.

    Raises
    ------
    UsageError
        The state is of another type or shape.
    """
    return states.parameters_of(_integers("state", state, ANY, 8))


# twin of spec.main_work
@door
def main_work(state: ArrayLike, width: int, height: int, halvings: int = 0) -> int:
    """The number of (splat, pixel) pairs in the splats' boxes on a frame, by their states (5-2): see `rendering_work`.

    Parameters
    ----------
    state
        (N, 8) i8, within the ranges of section 15.4.
    width, height
        The size of the frame in pixels.
    halvings
        0..3: how often both sides are halved before the frame is rendered, with the filter of (9-9).

    Returns
    -------
    int
        The work, which a level limits for no halvings (R-5-4).

    Raises
    ------
    UsageError
        The state is of another type or shape, or there is no such number of halvings.
    """
    if halvings not in range(len(states.HALVED_REACH)):
        raise UsageError(f"halvings is {halvings!r}; it must be in 0..{len(states.HALVED_REACH) - 1}")
    return states.work_of(_integers("state", state, ANY, 8), index(width), index(height), halvings)


def _side(motion_cell: int, least: int) -> int:
    """Side of a motion cell in pixels."""
    if motion_cell not in range(least, len(SIDES)):
        raise UsageError(f"motion_cell is {motion_cell!r}; it must be in {least}..{len(SIDES) - 1}")
    return SIDES[motion_cell]


def _integers(name: str, value: Any, *shape: int | None) -> I8:
    """An array of integers of a shape, as i8.

    Raises
    ------
    UsageError
        It is none.
    """
    array = np.asarray(value)
    if array.dtype.kind not in "iu" and array.size:
        raise UsageError(f"{name} must be an array of integers; it is of {array.dtype}")
    if array.ndim != len(shape) or any(
        side is not ANY and side != length for side, length in zip(shape, array.shape, strict=True)
    ):
        wanted = ", ".join("any" if side is ANY else str(side) for side in shape)
        raise UsageError(f"{name} has the shape {array.shape}; it must be ({wanted})")
    return np.ascontiguousarray(array, np.int64)
