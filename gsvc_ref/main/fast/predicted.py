"""The splats of the frame before out of the lanes of a P-frame, pass by pass (spec.md sections 15.10 and 15.11)."""

from typing import Final, NamedTuple

import numpy as np

from gsvc_base.arrays import I8
from gsvc_ref._jit import kernel
from gsvc_ref.main.codes import GROUP_ENDS, GROUPS, REMOVED
from gsvc_ref.main.fast.lanes import (
    MODES,
    MOTION,
    POSITION,
    Lanes,
    low_bits_of,
    read_low_bits,
    read_signs,
    read_symbols,
)
from gsvc_ref.main.models import ROWS, adapted, note_symbols
from gsvc_ref.main.motion import X_CLASSES, find_mode_contexts, find_motion
from gsvc_ref.main.passes import Distributions
from gsvc_ref.main.reconstruct import find_after

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
    """What is read of the N splats before, and all splats after the frame, of which n are new."""

    field: I8  # (rows, columns, 2), the vectors, in place if they are inherited
    modes: I8  # (N,)
    differences: I8  # (N, 8); before the late bits are read, the classes of their magnitudes
    after: I8  # (N + n, 8), from the start of the array on the splats that stay, then the new ones
    past: I8  # (N + n,), what was done with each that stays, likewise
    counts: I8  # (33, 24), those of the models of this frame before, and of the next one then

    @classmethod
    def of(cls, field: I8, count: int, new: int, counts: I8) -> "Outputs":
        """Room for so many splats before and new ones, and a field that is inherited or has room."""
        modes, differences = np.empty(count, np.int64), np.zeros((count, 8), np.int64)
        after, past = np.empty((count + new, 8), np.int64), np.empty(count + new, np.int64)
        return cls(field, modes, differences, after, past, counts.copy())


class Predicted(NamedTuple):
    """What is read, and what is known between passes."""

    field: I8  # the first four as in `Outputs`
    modes: I8
    differences: I8
    seen: I8  # (33, 24), how often each symbol was read in each context
    motion: I8  # (N, 2)
    changed: I8  # (3, N), the splats whose modes name each group
    many: I8  # (3,), how many these are
    rows: I8  # (N,), for a pass: contexts
    symbols: I8  # (N,), and symbols


@kernel()
def predicted_splats(out: Outputs) -> Predicted:
    """The state of reading before the first pass."""
    count, most = len(out.modes), max(len(out.modes), out.field.shape[0] * out.field.shape[1])
    seen, motion = np.zeros(out.counts.shape, np.int64), np.empty((count, 2), np.int64)
    changed, many = np.empty((3, count), np.int64), np.zeros(3, np.int64)
    rows, symbols = np.empty(most, np.int64), np.empty(most, np.int64)
    return Predicted(out.field, out.modes, out.differences, seen, motion, changed, many, rows, symbols)


@kernel()
def read_predicted_pass(lanes: Lanes, tables: Distributions, reference: Reference, at: int, out: Predicted) -> bool:
    """The part of the pass `at` that is about the splats of the frame before, and the early raw bits after it."""
    if at <= 2:
        return not reference.own or read_vectors(lanes, tables, at - 1, out)
    if at == 3:
        return read_modes(lanes, tables, reference, out)
    for group in range(3):  # noqa: SIM110  Numba knows no generators
        if not read_component(lanes, tables, group, at - 4, out):
            return False
    return True


@kernel()
def read_vectors(lanes: Lanes, tables: Distributions, axis: int, out: Predicted) -> bool:
    """X or y of the vectors of the field, each by its difference to the one to the left or above (15.10)."""
    rows, columns = out.field.shape[:2]
    contexts, symbols = out.rows[: rows * columns], out.symbols[: rows * columns]
    for cell in range(len(contexts)):
        if axis == 0:
            contexts[cell] = VECTOR_ROW
        else:  # `symbols` are still the contexts that x has said
            contexts[cell] = symbols[cell]
    if not read_symbols(lanes, MOTION, tables, contexts, symbols):
        return False
    note_symbols(contexts, symbols, out.seen)
    for cell in range(len(contexts)):
        contexts[cell] = VECTOR_ROW + 1
        for bound in X_CLASSES:
            contexts[cell] += symbols[cell] > bound
    read_low_bits(lanes, MOTION, symbols)
    read_signs(lanes, MOTION, symbols)
    for cell in range(len(contexts)):
        j, i = cell // columns, cell % columns
        before = 0
        if i > 0:
            before = out.field[j, i - 1, axis]
        elif j > 0:
            before = out.field[j - 1, 0, axis]
        out.field[j, i, axis] = ((symbols[cell] + before + 2**15) & 0xFFFF) - 2**15
        symbols[cell] = contexts[cell]
    return True


@kernel()
def read_modes(lanes: Lanes, tables: Distributions, reference: Reference, out: Predicted) -> bool:
    """The mode of each splat, and which splats each group of differences is about."""
    values, side, contexts = reference.values, reference.side, out.rows[: len(out.modes)]
    find_motion(values, out.field, side, out.motion)
    find_mode_contexts(values, out.motion, reference.past, out.field, side, reference.width, reference.height, contexts)
    for splat in range(len(values)):
        contexts[splat] += MODE_ROW
    if not read_symbols(lanes, MODES, tables, contexts, out.modes):
        return False
    note_symbols(contexts, out.modes, out.seen)
    for splat in range(len(values)):
        if out.modes[splat] != REMOVED:
            for group in range(3):
                if out.modes[splat] >> group & 1:
                    out.changed[group, out.many[group]] = splat
                    out.many[group] += 1
    return True


@kernel()
def read_component(lanes: Lanes, tables: Distributions, group: int, i: int, out: Predicted) -> bool:
    """The classes of component i of position (group 0), shape or colour, if it has so many (15.11)."""
    first, end, many = GROUP_ENDS[group], GROUP_ENDS[group + 1], out.many[group]
    if first + i >= end:
        return True
    rows, symbols, changed, q = out.rows[:many], out.symbols[:many], out.changed[group], out.differences
    for k in range(many):
        rows[k] = DIFFERENCE_ROWS[group]
        if i > 0:
            before = 0  # the sum of the magnitudes so far; a class is one, or its magnitudes are above 2
            for component in range(first, first + i):
                before += q[changed[k], component]
            rows[k] += 3 * (i - 1) + 1 + min(before, 2)
    if not read_symbols(lanes, POSITION + group, tables, rows, symbols):
        return False
    note_symbols(rows, symbols, out.seen)
    for k in range(many):
        q[changed[k], first + i] = symbols[k]
    return True


@kernel(inline=True)
def is_sure(q: I8, splat: int, group: int, component: int) -> bool:
    """Whether a component is the last one of its group and all before it are 0: it is not, and coded less 1."""
    if component != GROUP_ENDS[group + 1] - 1:
        return False
    before = 0
    for other in range(GROUP_ENDS[group], component):
        before |= q[splat, other]
    return before == 0


@kernel()
def predicted_late_count(out: Predicted) -> int:
    """How many late bits the differences have: the low bits of their magnitudes, and signs."""
    count = 0
    for group in range(3):
        for k in range(out.many[group]):
            splat = out.changed[group, k]
            for component in range(GROUP_ENDS[group], GROUP_ENDS[group + 1]):
                q = out.differences[splat, component]
                count += low_bits_of(q) + (q > 0 or is_sure(out.differences, splat, group, component))
    return count


@kernel()
def read_predicted_late(lanes: Lanes, reference: Reference, found: Predicted, out: Outputs) -> int:
    """The late bits of the differences, and what becomes of the splats; how many stay."""
    for group in range(3):
        magnitudes, changed = found.symbols[: found.many[group]], found.changed[group]
        for component in range(GROUP_ENDS[group], GROUP_ENDS[group + 1]):
            for k in range(len(magnitudes)):
                magnitudes[k] = out.differences[changed[k], component]
            read_low_bits(lanes, POSITION + group, magnitudes)
            for k in range(len(magnitudes)):
                magnitudes[k] += is_sure(out.differences, changed[k], group, component)
            read_signs(lanes, POSITION + group, magnitudes)
            for k in range(len(magnitudes)):
                out.differences[changed[k], component] = magnitudes[k]
    counts = adapted(out.counts, found.seen)
    for context in range(len(counts)):
        for s in range(counts.shape[1]):
            out.counts[context, s] = counts[context, s]
    return find_after(reference.values, found.motion, out.modes, out.differences, reference.step, out.after, out.past)
