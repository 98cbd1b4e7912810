"""Random legal streams of profile `main`, from any `Choices`; nothing here needs Hypothesis.

Every symbol of a pass can be decoded, so a random frame is what a run gives whose symbols are random.
"""

from dataclasses import replace
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import I8
from gsvc_base.draws import Draws
from gsvc_base.splats import Splats
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.header import LANE_EXPONENTS, MAIN, MAX_LAYERS, Quality, header_elements
from gsvc_ref.main.cells import halving_count
from gsvc_ref.main.codes import NO_FIELD, REMOVED, SIDES, MainCodes
from gsvc_ref.main.densities import ALPHAS, PLANES, SLOPED, Densities, Density
from gsvc_ref.main.frames import code_run
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.main.layers import Layers
from gsvc_ref.main.passes import TOTAL, Distributions, Run
from gsvc_ref.main.tables import QUANTIZERS
from gsvc_ref.paper import FrameType
from gsvc_ref.testing.choices import Choices, SeededChoices
from gsvc_ref.testing.random_streams import (
    ANY_SIZE_SPLATS,
    ANYTHING,
    FEW_SPLATS,
    LEVEL1_PIXELS,
    Stream,
    Wishes,
    granted,
    make_header,
    paced_stream,
    written,
)

Kind = Literal["likely", "any", "first", "last"]
MAIN_SYMBOL_KINDS: Final[tuple[Kind, ...]] = ("likely", "any", "first", "last")
"""Symbols as their frequencies make them likely, each as likely as another, the first, or the last of each pass."""


class RandomRun(Run):
    """A run whose symbols are random, but for which splats are `removed`, (N,), where that is given."""

    def __init__(self, rng: Draws, kind: Kind, removed: NDArray[np.bool_] | None = None) -> None:
        super().__init__()
        self._rng, self._kind, self._removed = rng, kind, removed

    def symbols(self, at: int, tables: Distributions, which: I8, symbols: I8 | None = None) -> I8:
        """A part of the pass `at`: symbol i has the distribution `which[i]`."""
        drawn = self._drawn(tables, which)
        if self._part != "modes" or self._removed is None:
            return drawn
        return np.where(self._removed, REMOVED, np.where(drawn == REMOVED, 0, drawn))

    def _drawn(self, tables: Distributions, which: I8) -> I8:
        first, last = tables.first[which], tables.first[which + 1] - 2
        if self._kind == "likely":
            slots = self._rng.integers(0, TOTAL, (len(which),))
            found = [
                np.searchsorted(tables.cumulative[low : high + 1], slot, side="right") - 1
                for low, high, slot in zip(first, last, slots, strict=True)
            ]
            return np.array(found, np.int64)
        return self._values(last - first + 1)

    def raw_bits(self, at: int | None, sizes: I8, values: I8 | None = None) -> I8:
        """Values of the given numbers of raw bits, at most 28."""
        return self._values(np.int64(1) << sizes)

    def _values(self, ends: I8) -> I8:
        """A number from 0 to below each end."""
        if self._kind == "first":
            return np.zeros(len(ends), np.int64)
        if self._kind == "last" or len(ends) == 0:
            return ends - 1
        return self._rng.integers(np.zeros(len(ends), np.int64), ends)


def random_main_stream(
    seed: int,
    *,
    max_frames: int = 5,
    max_count: int = 120,
    max_pixels: int = LEVEL1_PIXELS,
    wishes: Wishes = ANYTHING,
) -> Stream:
    """The legal stream of profile `main` of a seed: what the strategy `main_streams` draws, without Hypothesis.

    The limits are those of `random_stream`.
    """
    choices = SeededChoices(seed)
    return make_main_stream(choices, max_frames=max_frames, max_count=max_count, max_pixels=max_pixels, wishes=wishes)


def make_main_stream(
    choices: Choices, *, max_frames: int, max_count: int, max_pixels: int, wishes: Wishes = ANYTHING
) -> Stream:
    """A legal stream of profile `main` with any mix of frame types, quantisers, lanes, motion cells and densities.

    Where `layer_count` allows it, frames have layers; a chunk of each follows most frames, and carries it over others.
    Of `wishes`, the types and the number of splats are about the base, and only those that are wished have ancillary
    chunks or are paced. A UsageError says that no legal stream has what is wished.
    """
    header = _granted(make_main_header(choices, max_pixels=max_pixels), wishes)
    state = MainState.initial(header.width, header.height)
    codes: list[MainCodes] = []
    splats: list[Splats] = []
    layers: dict[int, list[tuple[int, MainCodes]]] = {}
    layers_now = Layers(header.layer_count - 1)
    drawn = choices.integer(1, max_frames)
    for number in range(wishes.frames or drawn):
        types = wishes.types if number else "I"
        frame, state = make_main_frame(choices, header, state, types=types, max_count=max_count, total=wishes.splats)
        codes.append(frame)
        splats.append(state.splats)
        layers[number] = []
        named = [layer for layer in range(1, header.layer_count) if choices.integer(0, 3) > 0]
        layers_now = layers_now.after(frame.type, state, named, frame.field if frame.type == "P" else NO_FIELD, number)
        for layer in named:
            layer_codes, layers_now = make_layer(
                choices, header, layers_now, layer, max_count=max_count, wished=wishes.splats or 0
            )
            layers[number].append((layer, layer_codes))
    header = replace(header, frame_count=len(codes))
    index = choices.boolean()
    parts: dict[str, Any] = {"index": index if wishes.index is None else wishes.index, "layers": layers}
    if wishes.ancillary:
        parts["ancillary"] = {choices.integer(0, len(codes) - 1): (choices.pick("abz"), choices.binary(9))}
    if wishes.paced:
        return paced_stream(header, codes, splats, parts, wishes)
    return written(header, codes, splats, parts)


def _granted(header: SequenceHeader, wishes: Wishes) -> SequenceHeader:
    """A drawn header with the elements that are wished; operating points stay where nothing is that limits them."""
    limiting = {"width", "height", "level", "layer_count"} & wishes.elements.keys()
    if limiting or wishes.splats is not None:
        header = replace(header, qualities=())
    layered = wishes.elements.get("layer_count", header.layer_count) > 1
    return granted(header, wishes, ANY_SIZE_SPLATS if layered else 0)


def make_layer(
    choices: Choices, header: SequenceHeader, layers: Layers, layer: int, *, max_count: int = 120, wished: int = 0
) -> tuple[MainCodes, Layers]:
    """A layer that may follow, with at most `max_count` new splats, and the layers after it.

    The level allows `wished` splats more than what it allows of any size.
    """
    types = "IPR" if layer in layers.before else "I"
    before, taken = layers.start_of(layer, header), layers.others(layer) - wished
    codes, state = make_main_frame(choices, header, before, types=types, max_count=max_count, taken=taken)
    return codes, layers.with_layer(layer, replace(state, inherited=NO_FIELD))


def make_main_header(choices: Choices, *, max_pixels: int) -> SequenceHeader:
    """A legal sequence header of profile `main`; all elements but the size take their whole range."""
    paper = make_header(choices, max_pixels=max_pixels)
    common = {
        name: value for name, value in paper.elements.items() if name in header_elements(MAIN) and name != "flags"
    }
    layer_count = choices.integer(1, MAX_LAYERS)
    own: dict[str, Any] = {
        "profile": MAIN,
        "max_lane_exponent": choices.integer(0, choices.pick((1, LANE_EXPONENTS[paper.level]))),
        "layer_count": layer_count,
        "parameter_checksum_flag": paper.parameter_checksum_flag,
    }
    if layer_count > 1 and choices.boolean():
        greatest = choices.integer(0, layer_count - 1)
        levels = [paper.level if at == greatest else choices.integer(1, paper.level) for at in range(layer_count)]
        own["qualities"] = tuple(Quality(level, choices.integer(0, 3)) for level in levels)
    return SequenceHeader(**common | own)


def make_main_frame(
    choices: Choices,
    header: SequenceHeader,
    state: MainState,
    *,
    types: str = "IPR",
    max_count: int = 120,
    count: int | None = None,
    kind: Kind | None = None,
    taken: int = 0,
    total: int | None = None,
) -> tuple[MainCodes, MainState]:
    """A frame that may follow `state`, one of `types`, with at most `max_count` new splats; and the state after it.

    `count` is the number of new splats, `total` that of all, and `kind` that of all symbols, where they are given;
    `state` must have no more than `total`. Of the splats that a frame may have, `taken` are those of other layers.
    """
    letters: tuple[FrameType, ...] = ("I", "P", "R")
    frame_type = choices.pick([letter for letter in letters for _ in range(types.count(letter))])
    if frame_type == "R":
        return MainCodes.repeated_frame(), state
    before = MainState.initial(header.width, header.height) if frame_type == "I" else state
    room = max(0, min(max_count, ANY_SIZE_SPLATS - taken - len(before.values)))
    drawn = choices.integer(0, choices.pick((min(room, FEW_SPLATS), room)))
    count = drawn if count is None else count
    removed = None
    if total is not None:
        removed = choices.generator().random(len(before.values)) < choices.pick((0.0, 0.1, 0.5, 1.0))
        count = total - int(np.count_nonzero(~removed))
    own = count > 0 and (frame_type == "I" or before.densities is None or choices.boolean())
    present = frame_type == "I" or choices.boolean()
    codes = MainCodes(
        type=frame_type,
        quantizer=choices.integer(0, choices.pick((QUANTIZERS - 1, 40))) if present else before.quantizer,
        quantizer_present=present,
        lane_exponent=choices.integer(0, header.max_lane_exponent),
        densities=make_densities(choices, header) if own else None,
        motion_cell=choices.integer(0, len(SIDES) - 1) if len(before.values) else 0,
    )
    before = replace(before, densities=codes.densities or before.densities, quantizer=codes.quantizer)
    if count + len(before.values) == 0:
        return codes, before
    symbols: Kind = choices.pick(MAIN_SYMBOL_KINDS) if kind is None else kind
    run = RandomRun(choices.generator(), symbols, removed)
    after, codes = code_run(run, before, codes, count)
    return codes, after


def make_densities(choices: Choices, header: SequenceHeader) -> Densities:
    """Densities with any elements: plausible ones, or extremes."""
    if choices.boolean():
        ends = choices.pick((0, 1)), choices.pick((0, 31)), choices.pick((-512, 511)), choices.pick((-128, 127))
        planes = [Density(*ends[:3], ends[3] if plane in SLOPED else 0) for plane in PLANES]
    else:
        planes = [
            Density(
                choices.integer(0, 1),
                choices.integer(0, 31),
                choices.integer(-512, 511),
                choices.integer(-128, 127) if plane in SLOPED else 0,
            )
            for plane in PLANES
        ]
    shape = choices.integer(0, len(ALPHAS) - 1)
    return Densities(tuple(planes), (shape,) * halving_count(header.width, header.height))
