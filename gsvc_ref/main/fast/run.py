"""The run of a frame in one kernel: pass after pass of both its parts, then the late bits (spec.md section 15.6)."""

from dataclasses import replace
from typing import Final, Literal, NamedTuple

import numpy as np

from gsvc_base.arrays import I8
from gsvc_ref._jit import kernel
from gsvc_ref.bitstream.rans import LOWEST_STATE
from gsvc_ref.main.codes import SIDES, CodeArrays, IntraCodes, MainCodes
from gsvc_ref.main.fast.intra import (
    NO_TABLES,
    Tables,
    intra_late_count,
    new_splats,
    read_intra_late,
    read_intra_pass,
    tables_of,
)
from gsvc_ref.main.fast.lanes import Lanes, late_bits, raw_value
from gsvc_ref.main.fast.predicted import (
    Outputs,
    Reference,
    predicted_late_count,
    predicted_splats,
    read_predicted_late,
    read_predicted_pass,
)
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.main.models import Models, model_distributions
from gsvc_ref.main.motion import field_shape
from gsvc_ref.main.passes import PREDICTED_PASSES, Distributions
from gsvc_ref.main.tables import step_of

MISSING: Final = -1
LEFT: Final = -2
BITS: Final = -3
STATE: Final = -4
"""What is wrong at the end of a run (R-15.6-2): words, raw bits, or lanes, `STATE` - j of lane j."""


class RunError(Exception):
    """What breaks R-7-1 at the end of a run, and where."""

    def __init__(self, message: str, place: Literal["word", "lane", "raw bits"], lane: int = 0) -> None:
        super().__init__(message)
        self.message, self.place, self.lane = message, place, lane


class ReadRun(NamedTuple):
    """What a run says: the splats after the frame, and its codes."""

    values: I8  # (N, 8)
    past: I8  # (N,), what was done with each
    models: Models  # of the next frame
    codes: MainCodes


def read_run(lanes: Lanes, before: MainState, codes: MainCodes, count: int) -> ReadRun:
    """The run of a frame with `count` new splats, and `codes` in front of it, after the state `before`.

    A RunError says that it is none.
    """
    splats, step, size = len(before.values), step_of(codes.quantizer), (before.width, before.height)
    field, side = before.inherited
    if own := codes.motion_cell > 0:
        side = SIDES[codes.motion_cell]
        field = np.empty((*field_shape(*size, side), 2), np.int64)
    out, new, tables = Outputs.of(field, splats, count, before.models.counts), CodeArrays.empty(count), NO_TABLES
    if count:
        assert before.densities is not None
        tables = tables_of(before.densities, *size)
    reference = Reference(before.values, before.past, *size, side, own, step)
    status = _read_run(lanes, reference, tables, out, new)
    if status < 0:
        raise _fault(lanes, status)
    out.past[status:] = 0 if codes.type == "I" else 2
    codes = replace(
        codes, vectors=field if own else codes.vectors, modes=out.modes, differences=out.differences,
        new=IntraCodes(*new),
    )  # fmt: skip
    end = status + count
    return ReadRun(out.after[:end], out.past[:end], Models(out.counts), codes)


def _fault(lanes: Lanes, status: int) -> RunError:
    if status == MISSING:
        return RunError("the words of a group of lanes end before its symbols do", "word")
    if status == LEFT:
        return RunError("words of a group of lanes are left over", "word")
    if status == BITS:
        return RunError("the raw bits do not end at the words, or bits that are left are not 0", "raw bits")
    lane = STATE - status
    message = (
        f"lane {lane} ends in the state {lanes.states[lane]}; it must be {LOWEST_STATE}, or, with late bits, less "
    )
    return RunError(f"{message}than {2 * LOWEST_STATE}", "lane", lane)


@kernel()
def _read_run(lanes: Lanes, reference: Reference, tables: Tables, out: Outputs, codes: CodeArrays) -> int:
    """All passes and late bits, put into `out` and `codes`; how many splats stay, or what is wrong."""
    splats, count, last = len(out.modes), len(codes.cells), 0
    found, new = predicted_splats(out), new_splats(reference.step, codes)
    rows = Distributions(out.counts[0], out.counts[0])
    if splats:  # models stand still in a frame: one set of tables does for all passes
        last, rows = PREDICTED_PASSES, model_distributions(out.counts)
    if count:
        last = max(last, len(tables.alphas) + 3)
    for at in range(1, last + 1):
        lanes.place[0] = 0
        if splats and at <= PREDICTED_PASSES and not read_predicted_pass(lanes, rows, reference, at, found):
            return MISSING
        if count and not read_intra_pass(lanes, tables, at, new):
            return MISSING
    late = intra_late_count(tables, new) + predicted_late_count(found)
    status = run_status(lanes, late)
    if status < 0:
        return status
    rest = late_bits(lanes, late)
    stay = read_predicted_late(rest, reference, found, out)
    read_intra_late(rest, tables, new, out.after[stay : stay + count])
    return stay


@kernel()
def run_status(lanes: Lanes, late: int) -> int:
    """0, or what is wrong of a run that has `late` late bits after its last symbol (R-15.6-2)."""
    groups = len(lanes.taken)
    for group in range(groups - 1):
        if lanes.taken[group] != lanes.ends[group]:
            return LEFT
    carried = min(len(lanes.states), late // 16)
    for lane in range(len(lanes.states)):
        if lanes.states[lane] >> 16 != 1 or (lane >= carried and lanes.states[lane] != LOWEST_STATE):
            return STATE - lane
    used = lanes.bit[0] + late - 16 * carried
    if 2 * lanes.taken[groups - 1] + (used + 7) // 8 != lanes.size or raw_value(lanes.raw, used, -used % 8):
        return BITS
    return 0
