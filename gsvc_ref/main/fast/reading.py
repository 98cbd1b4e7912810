"""Frames of profile `main` out of their lanes, in two kernels (spec.md sections 15.9 to 15.11).

The passes of `gsvc_ref.main.frames`, which write and make frames, are their plain form.
"""

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from gsvc_base.arrays import I8
from gsvc_ref._jit import kernel
from gsvc_ref.main.cells import cell_counts, read_cells
from gsvc_ref.main.codes import GROUPS, REMOVED, SIDES, IntraCodes, MainCodes
from gsvc_ref.main.densities import (
    ALPHAS,
    PLANES,
    Densities,
    Plane,
    Windows,
    magnitude_distributions,
    read_codes,
    read_windowed,
    windows_of,
)
from gsvc_ref.main.fast.lanes import (
    CELLS,
    CHROMA,
    LUMA,
    MODES,
    MOTION,
    PLACE,
    POSITION,
    SIZE,
    Lanes,
    magnitude_class,
    read_raw,
    read_signs,
    read_symbols,
)
from gsvc_ref.main.models import ROWS, Models, adapted, model_distributions, note_symbols, read_magnitudes
from gsvc_ref.main.motion import field_shape, find_mode_contexts, find_motion, read_field
from gsvc_ref.main.passes import Distributions
from gsvc_ref.main.reconstruct import find_after, find_intra_state, log_size, place_unit
from gsvc_ref.main.state import N_MOST, class_of
from gsvc_ref.main.tables import step_of

MODE_ROW: Final = ROWS["mode"].first
GROUP_ROWS: Final = tuple(ROWS[name].first for name, _, _ in GROUPS)
GROUP_ENDS: Final = (0, *(end for _, _, end in GROUPS))
"""The rows of the first contexts of modes and of each group of differences, and where its components end."""


SHAPES: Final[tuple[Plane, ...]] = PLANES[3:]
"""The planes with windows."""


class MissingWordError(Exception):
    """A word is missing (R-7-1); whoever knows where the words stand says where."""


class ReadIntra(NamedTuple):
    """The codes of the splats of an I-frame, or of new ones, and their state (N, 8)."""

    codes: IntraCodes
    state: I8


def read_intra(lanes: Lanes, size: tuple[int, int], densities: Densities, count: int, quantizer: int) -> ReadIntra:
    """The passes of the splats of an I-frame, or of new ones (spec.md section 15.9).

    Parameters
    ----------
    lanes
        The lanes of the frame.
    size
        Width and height of the frame in pixels.
    densities
        Those of the frame.
    count
        The number of splats, at least 1.
    quantizer
        That of the frame.

    Raises
    ------
    MissingWordError
        The words end before the symbols do.
    """
    codes = IntraCodes(*(np.empty((count, columns), np.int64) for columns in (2, 3, 3, 2)))
    state = np.empty((count, 8), np.int64)
    alphas = np.array([ALPHAS[code] for code in densities.halving_codes], np.int64)
    luma, chroma1, chroma2 = (magnitude_distributions(plane) for plane in densities.planes[:3])
    size_windows, aspect_windows, shear_windows = (windows_of(plane, densities.of(plane)) for plane in SHAPES)
    windows = size_windows, aspect_windows, shear_windows
    outputs = codes.cells, codes.colors, codes.shapes, codes.places, state
    step, inside = step_of(quantizer), cell_counts(*size)
    if not _read_intra(lanes, inside, alphas, (luma, chroma1, chroma2), windows, step, *outputs):
        raise MissingWordError
    return ReadIntra(codes, state)


@kernel()
def _read_intra(
    lanes: Lanes,
    inside: tuple[int, int],
    alphas: I8,
    magnitudes: tuple[Distributions, Distributions, Distributions],
    windows: tuple[Windows, Windows, Windows],
    step: int,
    cells: I8,
    colors: I8,
    shapes: I8,
    places: I8,
    state: I8,
) -> bool:
    count = len(cells)
    if not read_cells(lanes, inside, alphas, cells):
        return False
    lanes.spent_behind[CELLS] = lanes.spent[0]
    context, codes = np.zeros(count, np.int64), np.empty(count, np.int64)
    for plane in range(3):
        if not read_codes(lanes, magnitudes[plane], context, codes):
            return False
        for splat in range(count):
            colors[splat, plane] = codes[splat]
            if plane == 0:
                context[splat] = magnitude_class(abs(codes[splat]))
        lanes.spent_behind[CHROMA if plane else LUMA] = lanes.spent[0]
    most, j, color = N_MOST // step, np.empty(count, np.int64), np.empty(3, np.int64)
    for splat in range(count):
        for axis in range(3):
            color[axis] = min(max(colors[splat, axis], -most), most) * step
        j[splat] = class_of(color, step)
    for plane in range(3):
        if not read_windowed(lanes, windows[plane], j, codes):
            return False
        for splat in range(count):
            shapes[splat, plane] = codes[splat]
        lanes.spent_behind[SIZE + plane] = lanes.spent[0]
    bits = context
    for axis in range(2):
        for splat in range(count):
            bits[splat] = 2 - place_unit(log_size(shapes[splat, 0], shapes[splat, 1], j[splat], axis), j[splat])
        if not read_raw(lanes, bits, codes):
            return False
        for splat in range(count):
            places[splat, axis] = codes[splat]
    lanes.spent_behind[PLACE] = lanes.spent[0]
    find_intra_state(cells, colors, shapes, places, step, state)
    return True


class ReadPredicted(NamedTuple):
    """What a P-frame says of the splats of the frame before.

    Attributes
    ----------
    codes
        The codes, with the field, the modes and the differences.
    values, past
        The splats that stay (N, 8), and what was done with each (N,).
    models
        The models of the next frame.
    """

    codes: MainCodes
    values: I8
    past: I8
    models: Models


def read_predicted(
    lanes: Lanes, size: tuple[int, int], values: I8, past: I8, models: Models, codes: MainCodes
) -> ReadPredicted:
    """The passes about the splats of the frame before (spec.md sections 15.10 and 15.11).

    Parameters
    ----------
    lanes
        The lanes of the frame.
    size
        Width and height of the frame in pixels.
    values, past, models
        Those of the `MainState` before.
    codes
        The elements in front of the run.

    Raises
    ------
    MissingWordError
        The words end before the symbols do.
    """
    count, side = len(values), SIDES[codes.motion_cell]
    field = np.empty((*(field_shape(*size, side) if side else (0, 0)), 2), np.int64)
    modes, differences = np.empty(count, np.int64), np.zeros((count, 8), np.int64)
    after, past_after, counts = np.empty((count, 8), np.int64), np.empty(count, np.int64), models.counts.copy()
    outputs = field, modes, differences, after, past_after, counts
    stay = _read_predicted(lanes, size, side, values, past, step_of(codes.quantizer), *outputs)
    if stay < 0:
        raise MissingWordError
    told = replace(codes, vectors=field, modes=modes, differences=differences)
    return ReadPredicted(told, after[:stay], past_after[:stay], Models(counts))


@kernel()
def _read_predicted(
    lanes: Lanes,
    size: tuple[int, int],
    side: int,
    values: I8,
    past: I8,
    step: int,
    field: I8,
    modes: I8,
    differences: I8,
    after: I8,
    past_after: I8,
    counts: I8,
) -> int:
    """How many splats stay, or -1 if a word is missing; `counts` are those of the models before and behind."""
    tables, seen = model_distributions(counts), np.zeros(counts.shape, np.int64)
    if side and not read_field(lanes, tables, seen, field):
        return -1
    lanes.spent_behind[MOTION] = lanes.spent[0]
    motion, contexts = np.empty((len(values), 2), np.int64), np.empty(len(values), np.int64)
    find_motion(values, field, side, motion)
    find_mode_contexts(values, motion, past, field, side, size[0], size[1], contexts)
    for splat in range(len(values)):
        contexts[splat] += MODE_ROW
    if not read_symbols(lanes, tables, contexts, modes):
        return -1
    note_symbols(contexts, modes, seen)
    lanes.spent_behind[MODES] = lanes.spent[0]
    for group in range(3):
        if not _read_group(lanes, group, tables, seen, modes, differences):
            return -1
        lanes.spent_behind[POSITION + group] = lanes.spent[0]
    after_frame = adapted(counts, seen)
    for context in range(counts.shape[0]):
        for s in range(counts.shape[1]):
            counts[context, s] = after_frame[context, s]
    return find_after(values, motion, modes, differences, step, after, past_after)


@kernel()
def _read_group(lanes: Lanes, group: int, tables: Distributions, seen: I8, modes: I8, differences: I8) -> bool:
    """The differences of position (group 0), shape or colour of the splats whose modes name them."""
    first, components = GROUP_ENDS[group], GROUP_ENDS[group + 1] - GROUP_ENDS[group]
    many, changed = 0, np.empty(len(modes), np.int64)
    for splat in range(len(modes)):
        if modes[splat] != REMOVED and modes[splat] >> group & 1:
            changed[many] = splat
            many += 1
    rows, before = np.empty(many, np.int64), np.zeros(many, np.int64)
    magnitudes = np.empty((components, many), np.int64)
    for i in range(components):
        for k in range(many):
            rows[k] = GROUP_ROWS[group] + (3 * (i - 1) + 1 + min(before[k], 2) if i > 0 else 0)
        if not read_magnitudes(lanes, tables, rows, seen, magnitudes[i]):
            return False
        for k in range(many):
            if i == components - 1 and before[k] == 0:  # the last one cannot be 0
                magnitudes[i, k] += 1
            before[k] += magnitudes[i, k]
    for i in range(components):
        if not read_signs(lanes, magnitudes[i]):
            return False
        for k in range(many):
            differences[changed[k], first + i] = magnitudes[i, k]
    return True
