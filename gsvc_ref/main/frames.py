"""The body of a frame of profile `main` (spec.md sections 15.5 and 15.12).

The elements in front of the run are read and written by the same lines. The run is written, or made, by `code_intra`
and `code_predicted` of this module; the kernels of `gsvc_ref.main.fast` read it.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from gsvc_base.arrays import I8, U2
from gsvc_base.errors import UsageError
from gsvc_ref.bitstream.bit_reader import Reader
from gsvc_ref.bitstream.coder import ENTROPY_CODER, Coder
from gsvc_ref.bitstream.header import MAX_LANE_EXPONENT
from gsvc_ref.bitstream.rans import LOWEST_STATE
from gsvc_ref.main.cells import code_cells, halving_count
from gsvc_ref.main.codes import GROUPS, REMOVED, SIDES, IntraCodes, MainCodes
from gsvc_ref.main.densities import (
    ALPHAS,
    PLANES,
    SLOPED,
    Densities,
    Density,
    code_magnitudes,
    code_windowed,
    windows_of,
)
from gsvc_ref.main.fast.lanes import Lanes
from gsvc_ref.main.fast.run import RunError, read_run
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.main.models import Models
from gsvc_ref.main.motion import code_field, field_motion, field_shape, mode_contexts
from gsvc_ref.main.passes import Run, RunWriter, group_count, magnitude_classes
from gsvc_ref.main.reconstruct import add_differences, colors_of, intra_state, place_bits
from gsvc_ref.main.state import classes
from gsvc_ref.main.tables import QUANTIZERS, step_of
from gsvc_ref.paper import FrameType

COLOR_PARTS: Final = ("luma", "chroma", "chroma")
"""The part of a run that each channel of a colour belongs to."""

MODES_PASS: Final = 3
FIRST_COMPONENTS: Final = 4
"""The passes of the modes, and of the first components of all groups of differences; the next ones follow."""


NO_CODES: Final = MainCodes(type="I")
"""The codes that a Reader, which ignores values, is given."""


@dataclass(frozen=True, eq=False)
class Body:
    """The body of a frame: its codes, the state after it, and the bits of each of `RUN_PARTS` of its run."""

    codes: MainCodes
    after: MainState
    lengths: dict[str, float]
    symbols: int = 0  # of a run that was written


def frame_body(
    s: Coder,
    frame_type: FrameType,
    before: MainState,
    max_lane_exponent: int,
    most_splats: int,
    given: MainCodes | None = None,
    own_most: int | None = None,
) -> Body:
    """frame_body(type) of spec.md section 15.5, of an I- or a P-frame after the state `before`.

    The header allows `max_lane_exponent`, the level `most_splats`, and the operating point `own_most`, if it is to be
    asked. `given` are the codes that a Writer writes; a UsageError says that no stream can have them after `before`.
    """
    if frame_type == "I":
        before = MainState.initial(before.width, before.height)
    if given is not None:
        _check_shapes(given, before)
    codes, count = _head(s, frame_type, before, max_lane_exponent, (most_splats, own_most), given)
    densities = codes.densities or before.densities
    state = replace(before, densities=densities, quantizer=codes.quantizer)
    lengths: dict[str, float] = {}
    symbols = 0
    if count + len(before.values) > 0 and given is not None:
        run = RunWriter()
        state, codes = code_run(run, state, codes, count, given)
        _write(s, run, codes.lane_exponent)
        lengths, symbols = dict(run.lengths), run.count
    elif count + len(before.values) > 0:
        state, codes, lengths = _read_run(s, state, codes, count)
    s.divide(ENTROPY_CODER, {part: int(length) for part, length in lengths.items()})
    if given is not None and codes != given:
        raise UsageError(
            "a decoder would find other codes than these: cells must be in their order, vectors in 16 bits, slopes 0 "
            "where a plane has none, differences 0 where the mode has not their bit, densities only where there are "
            "new splats, and a quantizer that is not present must be that of the frame before"
        )
    return Body(codes, state, lengths, symbols)


def symbols_of(before: MainState, codes: MainCodes) -> U2:
    """c(s), f(s), pass and lane of each symbol of an I- or P-frame after the state `before`, (S, 4)."""
    if codes.type == "I":
        before = MainState.initial(before.width, before.height)
    if len(codes.new) + len(before.values) == 0:
        return np.zeros((0, 4), np.uint16)
    run = RunWriter()
    code_run(run, replace(before, densities=codes.densities or before.densities), codes, len(codes.new), codes)
    return np.stack(run.in_order(codes.lane_exponent), axis=1).astype(np.uint16)


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


def _head(
    s: Coder,
    frame_type: FrameType,
    before: MainState,
    max_lane_exponent: int,
    most: tuple[int, int | None],
    given: MainCodes | None,
) -> tuple[MainCodes, int]:
    """The elements in front of the run: the codes so far, and the count of splats or of new splats."""
    source, count, present = given or NO_CODES, 0, 0
    with s.part("frame_header"):
        lane_exponent = s.u("lane_exponent", 4, source.lane_exponent)
        if lane_exponent > MAX_LANE_EXPONENT:
            s.fail("R-3.2-1", f"`lane_exponent` is {lane_exponent}; values above {MAX_LANE_EXPONENT} are reserved")
        if lane_exponent > max_lane_exponent:
            s.fail("R-15.5-1", f"`lane_exponent` is {lane_exponent}; the stream has {max_lane_exponent} at most")
        motion_cell = s.u("motion_cell", 2, source.motion_cell)
        if motion_cell and not len(before.values):
            s.fail("R-15.5-2", "there is a motion field, and no splat of a frame before that it could move")
        quantizer_present = s.u("quantizer_present", 1, source.quantizer_present)
        if frame_type == "I" and not quantizer_present:
            s.fail("R-15.5-5", "an I-frame has no `quantizer`, and none is kept from the frames before it")
        new_present = s.u("new_present", 1, len(source.new) > 0)
        quantizer = before.quantizer
        if quantizer_present:
            quantizer = s.le("quantizer", 1, source.quantizer)
            if quantizer >= QUANTIZERS:
                s.fail("R-3.2-1", f"`quantizer` is {quantizer}; values above {QUANTIZERS - 1} are reserved")
        if new_present:
            number = s.uv("splat_number", 2 * (len(source.new) - 1) + (source.densities is not None))
            count, present = number // 2 + 1, number % 2
    for rule, allowed, by in zip(("R-5-2", "R-5-9"), most, ("level", "operating point of the quality"), strict=True):
        if allowed is not None and (splats := count + len(before.values)) > allowed:
            s.fail(rule, f"a frame may get {splats} splats; the {by} allows {allowed}")
    if frame_type == "I" and count and not present:
        s.fail("R-15.5-3", "an I-frame has no densities, and its splats need some")
    if count and not present and before.densities is None:
        s.fail("R-15.5-4", "new splats need densities, and none are kept since the last I-frame")
    densities = _densities(s, before, source.densities) if present else None
    codes = MainCodes(
        type=frame_type,
        quantizer=quantizer,
        quantizer_present=bool(quantizer_present),
        lane_exponent=lane_exponent,
        densities=densities,
        motion_cell=motion_cell,
    )
    return codes, count


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
    assert isinstance(s, Reader)
    with s.part(ENTROPY_CODER):
        states = s.array("lane_state", 1 << codes.lane_exponent, "u4")
        if (states < LOWEST_STATE).any():
            lane = int(np.argmax(states < LOWEST_STATE))
            bit = s.element_bit + 32 * lane
            s.fail("R-6.6-5", f"`lane_state` is {states[lane]}; it must be at least {LOWEST_STATE}", bit=bit)
        lane_bit, counts, words = s.element_bit, [], 0
        for _ in range(group_count(codes.lane_exponent) - 1):
            counts.append(s.uv("word_count"))
            words += counts[-1]
            if 2 * words > s.bytes_left:
                s.fail("R-15.6-5", f"the groups so far have {words} words; {s.bytes_left} bytes are left")
        first_bit, end_bit = s.position, s.position + 8 * s.bytes_left
        lanes = Lanes.begun(states, counts, s.rest)
        try:
            values, past, models, codes = read_run(lanes, before, codes, count)
        except RunError as fault:
            s.array("word", s.bytes_left // 2, "u2")
            offsets = {"word": first_bit, "lane": lane_bit + 32 * fault.lane, "raw bits": end_bit - 8}
            s.fail("R-7-1", fault.message, bit=offsets[fault.place])
        s.array("word", int(lanes.words_taken), "u2")
        s.raw("raw_byte", s.bytes_left)
    return replace(before, values=values, past=past, models=models), codes, lanes.lengths_of_parts


def _write(s: Coder, run: RunWriter, lane_exponent: int) -> None:
    states, counts, words, tail = run.finish(lane_exponent)
    with s.part(ENTROPY_CODER):
        s.array("lane_state", len(states), "u4", states)
        for count in counts[:-1]:
            s.uv("word_count", int(count))
        s.array("word", len(words), "u2", words)
        s.raw("raw_byte", len(tail), tail.tobytes())


def code_run(
    run: Run, before: MainState, codes: MainCodes, count: int, given: MainCodes | None = None
) -> tuple[MainState, MainCodes]:
    """The passes of a frame that has symbols: the state after it, and its codes.

    `before` is the state after the frame before, that of an I-frame being without splats, with the densities of this
    frame; `codes` are the elements in front of the run, `count` that of the splats or of the new ones, and `given` are
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


def code_intra(
    run: Run, before: MainState, densities: Densities, count: int, step: int, given: IntraCodes | None
) -> IntraCodes:
    """The passes of the splats of an I-frame, or of new ones (spec.md section 15.9)."""
    alphas = tuple(ALPHAS[code] for code in densities.halving_codes)
    with run.part("cells"):
        cells = code_cells(run, count, before.width, before.height, alphas, given.cells if given else None)
    at, context, colors = len(alphas), np.zeros(count, np.int64), np.empty((count, 3), np.int64)
    for column, plane in enumerate(PLANES[:3]):
        with run.part(COLOR_PARTS[column]):
            values = None if given is None else given.colors[:, column]
            colors[:, column] = code_magnitudes(run, at + min(1 + column, 2), densities.of(plane), context, values)
        if plane == "luma":
            context = magnitude_classes(colors[:, 0])
    for column, part in enumerate(COLOR_PARTS):
        with run.part(part):
            values = None if given is None else given.colors[:, column]
            colors[:, column] = run.signs(None, colors[:, column], values)
    j = classes(colors_of(colors, step), step)
    shapes = np.empty((count, 3), np.int64)
    for column, plane in enumerate(PLANES[3:]):
        with run.part(plane):
            values = None if given is None else given.shapes[:, column]
            windows, late = windows_of(plane, densities.of(plane)), plane == "shear"  # no place depends on shear
            shapes[:, column] = code_windowed(run, at + 3, windows, j, values, late=late)
    sizes = place_bits(shapes, j)
    with run.part("place"):
        places = [run.raw_bits(None, sizes[:, i], None if given is None else given.places[:, i]) for i in range(2)]
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
        modes = models.code(run, MODES_PASS, "mode", contexts, None if given is None else given.modes)
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
        before = np.zeros(len(changed), np.int64)
        with run.part(group):
            for i in range(end - first):
                contexts = 3 * (i - 1) + 1 + np.minimum(before, 2) if i > 0 else before
                sure = (before == 0).astype(np.int64) if i == end - first - 1 else 0  # the mode says that not all are 0
                column = None if values is None else values[:, i]
                rest = None if column is None else np.abs(column) - sure
                at = FIRST_COMPONENTS + i
                magnitudes = models.code_magnitudes(run, at, group, contexts, rest, late=True) + sure
                before = before + magnitudes
                q[changed, first + i] = run.signs(None, magnitudes, column)
    return q
