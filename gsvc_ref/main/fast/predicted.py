"""The splats of the frame before out of the lanes of a P-frame, in one kernel (spec.md sections 15.10 and 15.11)."""

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from gsvc_base.arrays import I8
from gsvc_ref._jit import kernel
from gsvc_ref.main.codes import GROUP_ENDS, GROUPS, NO_FIELD, REMOVED, SIDES, Field, MainCodes
from gsvc_ref.main.fast.lanes import (
    MODES,
    MOTION,
    POSITION,
    Lanes,
    MissingWordError,
    magnitude_class,
    read_low_bits,
    read_signs,
    read_symbols,
)
from gsvc_ref.main.models import ROWS, Models, adapted, model_distributions, note_symbols
from gsvc_ref.main.motion import X_CLASSES, field_shape, find_mode_contexts, find_motion
from gsvc_ref.main.passes import Distributions
from gsvc_ref.main.reconstruct import find_after
from gsvc_ref.main.tables import step_of

VECTOR_ROW: Final = ROWS["vector"].first
MODE_ROW: Final = ROWS["mode"].first
DIFFERENCE_ROWS: Final = tuple(ROWS[name].first for name, _, _ in GROUPS)
"""The rows of the first contexts of vectors, of modes and of each group of differences among those of all models."""


class Reference(NamedTuple):
    """What a P-frame is predicted from, and how it is coded."""

    values: I8  # (N, 8), the splats of the frame before
    past: I8  # (N,), what that frame did with each
    width: int  # of the frame in pixels
    height: int
    side: int  # of a motion cell in pixels, 0: no field
    own: bool  # whether the field is read, not inherited
    step: int  # D in 1/16


class Outputs(NamedTuple):
    """What is read."""

    field: I8  # (rows, columns, 2), the vectors
    modes: I8  # (N,)
    differences: I8  # (N, 8)
    after: I8  # (N, 8), the splats that stay, at the start of the array
    past: I8  # (N,), what was done with each, likewise
    counts: I8  # (33, 24), those of the models of this frame before, and of the next one then


class ReadPredicted(NamedTuple):
    """What a P-frame says of the splats of the frame before."""

    codes: MainCodes  # with the field, the modes and the differences
    values: I8  # (N, 8), the splats that stay
    past: I8  # (N,), what was done with each
    models: Models  # of the next frame


def read_predicted(
    lanes: Lanes,
    size: tuple[int, int],
    values: I8,
    past: I8,
    models: Models,
    codes: MainCodes,
    inherited: Field = NO_FIELD,
) -> ReadPredicted:
    """The passes about the splats of the frame before (spec.md sections 15.10 and 15.11).

    `values`, `past`, `models` and `inherited` are those of the `MainState` before, and `codes` the elements in front of
    the run. A MissingWordError says that the words end before the symbols do.
    """
    count, own = len(values), codes.motion_cell > 0
    field, side = inherited
    if own:
        side = SIDES[codes.motion_cell]
        field = np.empty((*field_shape(*size, side), 2), np.int64)
    modes, differences = np.empty(count, np.int64), np.zeros((count, 8), np.int64)
    after, past_after = np.empty((count, 8), np.int64), np.empty(count, np.int64)
    out = Outputs(field, modes, differences, after, past_after, models.counts.copy())
    stay = _read_predicted(lanes, Reference(values, past, *size, side, own, step_of(codes.quantizer)), out)
    if stay < 0:
        raise MissingWordError
    read = replace(codes, vectors=field if own else codes.vectors, modes=modes, differences=differences)
    return ReadPredicted(read, after[:stay], past_after[:stay], Models(out.counts))


@kernel()
def _read_predicted(lanes: Lanes, reference: Reference, out: Outputs) -> int:
    """All passes, put into `out`; how many splats stay, or -1 if a word is missing."""
    values, side = reference.values, reference.side
    # Models stand still in a frame: one set of tables does for all passes, and what they have seen counts afterwards.
    tables, seen = model_distributions(out.counts), np.zeros(out.counts.shape, np.int64)
    if reference.own and not read_field(lanes, tables, seen, out.field):
        return -1
    lanes.spent_after[MOTION] = lanes.spent[0]
    motion, contexts = np.empty((len(values), 2), np.int64), np.empty(len(values), np.int64)
    find_motion(values, out.field, side, motion)
    find_mode_contexts(values, motion, reference.past, out.field, side, reference.width, reference.height, contexts)
    for splat in range(len(values)):
        contexts[splat] += MODE_ROW
    if not read_symbols(lanes, tables, contexts, out.modes):
        return -1
    note_symbols(contexts, out.modes, seen)
    lanes.spent_after[MODES] = lanes.spent[0]
    for group in range(3):
        if not read_differences(lanes, group, tables, seen, out.modes, out.differences):
            return -1
        lanes.spent_after[POSITION + group] = lanes.spent[0]
    counts = adapted(out.counts, seen)
    for context in range(len(counts)):
        for s in range(counts.shape[1]):
            out.counts[context, s] = counts[context, s]
    return find_after(values, motion, out.modes, out.differences, reference.step, out.after, out.past)


@kernel()
def read_field(lanes: Lanes, tables: Distributions, seen: I8, field: I8) -> bool:
    """The vectors of the field (rows, columns, 2), each by its difference to the one to the left or above (15.10)."""
    rows, columns = field.shape[:2]
    contexts = np.empty(rows * columns, np.int64)
    x, y = np.empty(rows * columns, np.int64), np.empty(rows * columns, np.int64)
    for cell in range(len(x)):
        contexts[cell] = VECTOR_ROW
    if not read_magnitudes(lanes, tables, contexts, seen, x):
        return False
    for cell in range(len(x)):
        contexts[cell] = VECTOR_ROW + 1
        for bound in X_CLASSES:
            contexts[cell] += magnitude_class(x[cell]) > bound
    if not read_magnitudes(lanes, tables, contexts, seen, y):
        return False
    if not (read_signs(lanes, x) and read_signs(lanes, y)):
        return False
    for cell in range(len(x)):
        j, i = cell // columns, cell % columns
        left, above = (j, i - 1), (j - 1, 0)
        before_x, before_y = 0, 0
        if cell > 0:
            j1, i1 = left if i > 0 else above
            before_x, before_y = field[j1, i1, 0], field[j1, i1, 1]
        field[j, i, 0] = ((x[cell] + before_x + 2**15) & 0xFFFF) - 2**15
        field[j, i, 1] = ((y[cell] + before_y + 2**15) & 0xFFFF) - 2**15
    return True


@kernel()
def read_differences(lanes: Lanes, group: int, tables: Distributions, seen: I8, modes: I8, differences: I8) -> bool:
    """The differences of position (group 0), shape or colour of the splats whose modes name them (15.11)."""
    first, components = GROUP_ENDS[group], GROUP_ENDS[group + 1] - GROUP_ENDS[group]
    many, changed = 0, np.empty(len(modes), np.int64)
    for splat in range(len(modes)):
        if modes[splat] != REMOVED and modes[splat] >> group & 1:
            changed[many] = splat
            many += 1
    rows, before = np.empty(many, np.int64), np.zeros(many, np.int64)  # before: the sum of a splat's magnitudes so far
    magnitudes = np.empty((components, many), np.int64)
    for i in range(components):
        for k in range(many):
            rows[k] = DIFFERENCE_ROWS[group] + (3 * (i - 1) + 1 + min(before[k], 2) if i > 0 else 0)
        if not read_magnitudes(lanes, tables, rows, seen, magnitudes[i]):
            return False
        for k in range(many):
            if i == components - 1 and before[k] == 0:  # the mode says that not all are 0
                magnitudes[i, k] += 1
            before[k] += magnitudes[i, k]
    for i in range(components):
        if not read_signs(lanes, magnitudes[i]):
            return False
        for k in range(many):
            differences[changed[k], first + i] = magnitudes[i, k]
    return True


@kernel()
def read_magnitudes(lanes: Lanes, tables: Distributions, rows: I8, seen: I8, magnitudes: I8) -> bool:
    """Passes of classes of magnitudes, by the rows of models, and of low bits."""
    if not read_symbols(lanes, tables, rows, magnitudes):
        return False
    note_symbols(rows, magnitudes, seen)
    return read_low_bits(lanes, magnitudes)
