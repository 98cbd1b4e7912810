"""The body of a frame of profile `main` (spec.md sections 15.5 and 15.12).

The elements in front of the run are read and written by the same lines. The run is written, or made, by the passes of
this module, `code_intra` and `code_predicted`; the kernels of `gsvc_ref.main.fast` read it.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from gsvc_base.arrays import I8
from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_ref.bitstream.coder import ENTROPY_CODER, RUN_PARTS, Coder
from gsvc_ref.bitstream.crc import parameter_checksum
from gsvc_ref.bitstream.rans import LOWEST_STATE
from gsvc_ref.main.cells import code_cells, halving_count
from gsvc_ref.main.codes import GROUPS, NO_FIELD, REMOVED, SIDES, Field, IntraCodes, MainCodes
from gsvc_ref.main.densities import (
    ALPHAS,
    PLANES,
    SLOPED,
    Densities,
    Density,
    code_colors,
    code_windowed,
    windows_of,
)
from gsvc_ref.main.fast.intra import read_intra
from gsvc_ref.main.fast.lanes import MOTION, Lanes, MissingWordError
from gsvc_ref.main.fast.predicted import read_predicted
from gsvc_ref.main.models import Models
from gsvc_ref.main.motion import code_field, field_motion, field_shape, mode_contexts
from gsvc_ref.main.passes import LENGTH_UNIT, Run, RunWriter, magnitude_classes
from gsvc_ref.main.reconstruct import add_differences, colors_of, intra_state, place_bits
from gsvc_ref.main.state import classes, no_splats, to_splats, work_of
from gsvc_ref.main.tables import QUANTIZERS, step_of
from gsvc_ref.paper import FrameType

PARTS_IN_ORDER: Final = (*RUN_PARTS[MOTION:], *RUN_PARTS[:MOTION])
"""The parts of a run in the order of its passes."""


@dataclass(frozen=True, eq=False)
class MainState:
    """All that profile `main` carries from frame to frame."""

    width: int  # of the coded frame in pixels
    height: int
    values: I8  # (N, 8), the state of the splats of the frame before, in integers
    past: I8  # (N,), what it did with each: 0 nothing, or it was in an I-frame, 1 it changed, 2 it was new
    models: Models
    densities: Densities | None = None  # those that are kept; None: there are none since the last I-frame
    inherited: Field = NO_FIELD  # what `motion_cell` 0 stands for: in a layer, while it is coded, the field of the base

    @classmethod
    def initial(cls, width: int, height: int) -> "MainState":
        """The state before the first frame of a sequence, and the one in which every I-frame is coded (R-15.11-1)."""
        return cls(width, height, no_splats(), np.zeros(0, np.int64), Models())

    @cached_property
    def splats(self) -> Splats:
        """The splats of the frame before, in binary32 (15-5)."""
        return to_splats(self.values)

    @cached_property
    def work(self) -> int:
        """The rendering work of these splats in pairs (5-2)."""
        return work_of(self.values, self.width, self.height)

    @cached_property
    def checksum(self) -> int:
        """The `parameter_checksum` of these splats."""
        return parameter_checksum(self.splats)


@dataclass(frozen=True, eq=False)
class Body:
    """The body of a frame: its codes, the state after it, and the bits of each of `RUN_PARTS` of its run."""

    codes: MainCodes
    after: MainState
    lengths: dict[str, float]


def frame_body(
    s: Coder,
    frame_type: FrameType,
    before: MainState,
    lane_count: int,
    most_splats: int,
    given: MainCodes | None = None,
) -> Body:
    """frame_body(type) of spec.md section 15.5, of an I- or a P-frame after the state `before`.

    The level allows `most_splats`. `given` are the codes that a Writer writes; a UsageError says that no stream can
    have them after `before`.
    """
    if frame_type == "I":
        before = MainState.initial(before.width, before.height)
    if given is not None:
        _check_shapes(given, before)
    codes, count = _tools(s, frame_type, before, lane_count, most_splats, given)
    densities = codes.densities or before.densities
    state = replace(before, densities=densities)
    lengths: dict[str, float] = {}
    if count + len(before.values) > 0 and given is not None:
        run = RunWriter()
        state, codes = code_run(run, state, codes, count, given)
        _write(s, run, codes.lane_exponent)
        lengths = dict(run.lengths)
    elif count + len(before.values) > 0:
        state, codes, lengths = _read_run(s, state, codes, count)
    s.divide(ENTROPY_CODER, {part: int(length) for part, length in lengths.items()})
    if given is not None and codes != given:
        raise UsageError(
            "a decoder would find other codes than these: cells must be in their order, vectors in 16 bits, slopes 0 "
            "where a plane has none, and differences 0 where the mode has not their bit"
        )
    return Body(codes, state, lengths)


def _check_shapes(given: MainCodes, before: MainState) -> None:
    """Refuse codes of another number of splats or cells than a frame after `before` has."""
    count, intra = len(before.values), len(given.new)
    side = SIDES[given.motion_cell] if 0 <= given.motion_cell < len(SIDES) else 0
    rows, columns = field_shape(before.width, before.height, side) if side else (0, 0)
    expected = {
        "vectors": (given.vectors, (rows, columns, 2)),
        "modes": (given.modes, (count,)),
        "differences": (given.differences, (count, 8)),
        "colors": (given.new.colors, (intra, 3)),
        "shapes": (given.new.shapes, (intra, 3)),
        "places": (given.new.places, (intra, 2)),
        "cells": (given.new.cells, (intra, 2)),
    }
    for name, (array, shape) in expected.items():
        if array.shape != shape:
            raise UsageError(f"`{name}` of a frame has the shape {array.shape}; it must be {shape} here")
    if given.densities is not None:
        halvings = halving_count(before.width, before.height)
        numbers = len(given.densities.planes), len(given.densities.halving_codes)
        if numbers != (len(PLANES), halvings):
            raise UsageError(
                f"the densities have {numbers} planes and halvings; there are {len(PLANES)} and {halvings}"
            )


def _tools(
    s: Coder, frame_type: FrameType, before: MainState, lane_count: int, most_splats: int, given: MainCodes | None
) -> tuple[MainCodes, int]:
    """The elements in front of the run: the codes so far, and the count of splats or of new splats."""
    source = given or MainCodes(type=frame_type)
    with s.part("frame_header"):
        quantizer = s.le("quantizer", 1, source.quantizer)
        if quantizer >= QUANTIZERS:
            s.fail("R-3.2-1", f"`quantizer` is {quantizer}; values above {QUANTIZERS - 1} are reserved")
        lane_exponent = s.u("lane_exponent", 3, source.lane_exponent)
        if 1 << lane_exponent > lane_count:
            s.fail("R-15.5-1", f"`lane_exponent` is {lane_exponent}; the stream has {lane_count} lanes at most")
        motion_cell = s.u("motion_cell", 2, source.motion_cell)
        if motion_cell and not len(before.values):
            s.fail("R-15.5-2", "there is a motion field, and no splat of a frame before that it could move")
        present = s.u("densities_present", 1, int(source.densities is not None))
        present_bit = s.element_bit
        if (reserved := s.u("frame_reserved", 2)) != 0:
            s.fail("R-3.2-1", f"`frame_reserved` is {reserved}; it is reserved and must be 0")
        count = s.uv("splat_count" if frame_type == "I" else "new_splat_count", len(source.new))
    if count + len(before.values) > most_splats:
        s.fail("R-5-2", f"a frame may get {count + len(before.values)} splats; the level allows {most_splats}")
    if (present and not count) or (frame_type == "I" and count and not present):
        what = "no new splats that they could describe" if present else "and its splats need some"
        s.fail("R-15.5-3", f"the frame has {'' if present else 'no '}densities, {what}", bit=present_bit)
    if count and not present and before.densities is None:
        s.fail("R-15.5-4", "new splats need densities, and none are kept since the last I-frame", bit=present_bit)
    densities = _densities(s, before, source.densities) if present else None
    return MainCodes(quantizer, lane_exponent, densities, motion_cell=motion_cell, type=frame_type), count


def _densities(s: Coder, before: MainState, given: Densities | None) -> Densities:
    """densities() of spec.md section 15.7."""
    halvings = halving_count(before.width, before.height)
    source = given or Densities((Density(),) * len(PLANES), (0,) * halvings)
    planes = []
    with s.part("densities"):
        for plane, density in zip(PLANES, source.planes, strict=True):
            with s.part("densities", plane):
                family = s.u("density_family", 1, density.family)
                scale_code = s.u("scale_code", 5, density.scale_code)
                centre = s.u("centre", 10, density.centre + 512) - 512
                slope = s.u("slope", 8, density.slope + 128) - 128 if plane in SLOPED else 0
            planes.append(Density(family, scale_code, centre, slope))
        halving_codes = tuple(s.u("halving_code", 3, code) for code in source.halving_codes)
        s.align()
    return Densities(tuple(planes), halving_codes)


def _read_run(
    s: Coder, before: MainState, codes: MainCodes, count: int
) -> tuple[MainState, MainCodes, dict[str, float]]:
    """The run of a frame that has symbols: the state after it, its codes, and the code lengths of its parts."""
    lanes, size, state = _lanes(s, codes.lane_exponent), (before.width, before.height), before
    try:
        if len(before.values):
            codes, values, past, models = read_predicted(
                lanes, size, before.values, before.past, before.models, codes, before.inherited
            )
            state = replace(before, values=values, past=past, models=models)
        if count:
            assert before.densities is not None
            new, values = read_intra(lanes, size, before.densities, count, codes.quantizer)
            state, codes = _with_new(state, codes, new, values)
    except MissingWordError:
        s.fail("R-7-1", "the words of the frame end before its symbols do")
    _check_finished(s, lanes)
    return state, codes, _lengths(lanes)


def _lengths(lanes: Lanes) -> dict[str, float]:
    """The code lengths in bits of the parts of a run, in the order of its passes."""
    ends = dict(zip(RUN_PARTS, lanes.spent_after.tolist(), strict=True))
    read = [part for part in PARTS_IN_ORDER if ends[part]]
    before = [0, *(ends[part] for part in read)]
    return {part: (ends[part] - start) / LENGTH_UNIT for part, start in zip(read, before, strict=False)}


def _lanes(s: Coder, lane_exponent: int) -> Lanes:
    with s.part(ENTROPY_CODER):
        states = s.array("lane_state", 1 << lane_exponent, "u4")
        if (states < LOWEST_STATE).any():
            lane = int(np.argmax(states < LOWEST_STATE))
            bit = s.element_bit + 32 * lane
            s.fail("R-6.6-5", f"`lane_state` is {states[lane]}; it must be at least {LOWEST_STATE}", bit=bit)
        words = s.array("word", s.bytes_left // 2, "u2")
    return Lanes.begun(states, words)


def _write(s: Coder, run: RunWriter, lane_exponent: int) -> None:
    states, words = run.finish(1 << lane_exponent)
    with s.part(ENTROPY_CODER):
        s.array("lane_state", len(states), "u4", states)
        s.array("word", len(words), "u2", words)


def code_run(
    run: Run, before: MainState, codes: MainCodes, count: int, given: MainCodes | None = None
) -> tuple[MainState, MainCodes]:
    """The passes of a frame that has symbols: the state after it, and its codes.

    `before` is the state after the frame before, that of an I-frame being without splats, with the densities of this
    frame; `codes` are the elements in front of the run, `count` is `splat_count` or `new_splat_count`, and `given` are
    the codes that are written.
    """
    state, step = before, step_of(codes.quantizer)
    if len(before.values):
        state, codes = code_predicted(run, before, codes, given)
    if count:
        assert before.densities is not None
        new = code_intra(run, before, before.densities, count, step, given.new if given else None)
        state, codes = _with_new(state, codes, new, intra_state(new, step))
    return state, codes


def _with_new(state: MainState, codes: MainCodes, new: IntraCodes, values: I8) -> tuple[MainState, MainCodes]:
    """State and codes of a frame with the splats of an I-frame, or new ones, after those that stay."""
    past = np.full(len(values), 0 if codes.type == "I" else 2, np.int64)
    if len(state.values):
        values, past = np.concatenate([state.values, values]), np.concatenate([state.past, past])
    return replace(state, values=values, past=past), replace(codes, new=new)


def _check_finished(s: Coder, lanes: Lanes) -> None:
    """R-15.6-2: the words stand directly before the position, the lane states before them."""
    taken, word_bit = int(lanes.taken[0]), s.element_bit
    if taken < len(lanes.words):
        left = len(lanes.words) - taken
        s.fail("R-7-1", f"{left} words of the frame are left over", bit=word_bit + 16 * taken)
    if (lanes.states != LOWEST_STATE).any():
        lane = int(np.argmax(lanes.states != LOWEST_STATE))
        bit = word_bit - 32 * (len(lanes.states) - lane)
        s.fail("R-7-1", f"lane {lane} ends in the state {lanes.states[lane]}; it must be {LOWEST_STATE}", bit=bit)


def code_intra(
    run: Run, before: MainState, densities: Densities, count: int, step: int, given: IntraCodes | None
) -> IntraCodes:
    """The passes of the splats of an I-frame, or of new ones (spec.md section 15.9)."""
    alphas = tuple(ALPHAS[code] for code in densities.halving_codes)
    with run.part("cells"):
        cells = code_cells(run, count, before.width, before.height, alphas, given.cells if given else None)
    columns: list[I8 | None] = [None] * 3 if given is None else list(given.colors.T)
    with run.part("luma"):
        luma = code_colors(run, densities.of("luma"), np.zeros(count, np.int64), columns[0])
    context = magnitude_classes(np.abs(luma))
    with run.part("chroma"):
        chroma1 = code_colors(run, densities.of("chroma1"), context, columns[1])
        chroma2 = code_colors(run, densities.of("chroma2"), context, columns[2])
    colors = np.stack([luma, chroma1, chroma2], axis=1)
    j = classes(colors_of(colors, step), step)
    shapes = np.empty((count, 3), np.int64)
    for column, plane in enumerate(PLANES[3:]):
        with run.part(plane):
            values = None if given is None else given.shapes[:, column]
            shapes[:, column] = code_windowed(run, windows_of(plane, densities.of(plane)), j, values)
    sizes = place_bits(shapes, j)
    with run.part("place"):
        places = [run.raw_bits(sizes[:, i], None if given is None else given.places[:, i]) for i in range(2)]
    return IntraCodes(cells, colors, shapes, np.stack(places, axis=1))


def code_predicted(
    run: Run, before: MainState, codes: MainCodes, given: MainCodes | None
) -> tuple[MainState, MainCodes]:
    """The passes about the splats of the frame before (spec.md sections 15.10 and 15.11)."""
    splats, models, step = before.values, before.models, step_of(codes.quantizer)
    models = Models(models.counts)
    vectors, side = before.inherited
    if codes.motion_cell:
        side = SIDES[codes.motion_cell]
        with run.part("motion"):
            shape = field_shape(before.width, before.height, side)
            vectors = code_field(run, models, shape, None if given is None else given.vectors)
        codes = replace(codes, vectors=vectors)
    motion = field_motion(splats, vectors, side)
    with run.part("modes"):
        contexts = mode_contexts(splats, motion, before.past, vectors, side, before.width, before.height)
        modes = models.code(run, "mode", contexts, None if given is None else given.modes)
    differences = code_differences(run, models, modes, None if given is None else given.differences)
    stay = modes != REMOVED
    after = replace(
        before,
        values=add_differences(splats[stay], motion[stay], differences[stay], step),
        past=np.minimum(modes[stay], 1),
        models=models.adapted(),
    )
    return after, replace(codes, modes=modes, differences=differences)


def code_differences(run: Run, models: Models, modes: I8, given: I8 | None) -> I8:
    """The differences q (N, 8) of all groups that the modes name."""
    q = np.zeros((len(modes), 8), np.int64)
    for bit, (group, first, end) in enumerate(GROUPS):
        changed = np.flatnonzero((modes != REMOVED) & (modes >> bit & 1 == 1))
        values = None if given is None else given[changed, first:end]
        before, magnitudes = np.zeros(len(changed), np.int64), []
        with run.part(group):
            for i in range(end - first):
                contexts = 3 * (i - 1) + 1 + np.minimum(before, 2) if i > 0 else before
                sure = (before == 0).astype(np.int64) if i == end - first - 1 else 0  # the mode says that not all are 0
                rest = None if values is None else np.abs(values[:, i]) - sure
                magnitudes.append(models.code_magnitudes(run, group, contexts, rest) + sure)
                before = before + magnitudes[-1]
            for i, magnitude in enumerate(magnitudes):
                q[changed, first + i] = run.signs(magnitude, None if values is None else values[:, i])
    return q
