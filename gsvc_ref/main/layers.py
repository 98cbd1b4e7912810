"""The layers of a stream of profile `main` (spec.md section 15.13): further splats for each frame, in chunks `n`.

A layer is predicted from itself, and may take the motion field of the base. So what a decoder carries is a state of
each layer, beside that of the base.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from gsvc_base.arrays import I8
from gsvc_base.splats import Splats
from gsvc_ref._jit import kernel
from gsvc_ref.bitstream.coder import Coder
from gsvc_ref.bitstream.header import SequenceHeader
from gsvc_ref.main.codes import NO_FIELD, Field, MainCodes
from gsvc_ref.main.frames import Body, frame_body
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.main.motion import find_motion
from gsvc_ref.main.state import X_MOST
from gsvc_ref.paper import FrameType

LAYER_TYPES: Final[tuple[FrameType, ...]] = ("I", "P", "R")
"""The types of layers, by `layer_type`."""


@dataclass(frozen=True, eq=False)
class Layers:
    """The layers of the frame decoded last, up to the highest that is wanted."""

    highest: int  # the highest layer that is wanted, at least 1
    base: MainState | None = None  # the state of the base after the frame; None before the first frame
    number: int = 0  # of the frame
    named: tuple[int, ...] = ()  # the layers of which `layer_mask` says that a chunk follows, in their order
    moves: Field = NO_FIELD  # the motion field of the base in the frame
    there: Mapping[int, MainState] = field(default_factory=dict)  # the layers that the frame shows so far, after it
    before: Mapping[int, MainState] = field(default_factory=dict)  # what those named are predicted from
    last: int = 0  # the layer of the last chunk after the frame, skipped ones included; 0: there was none
    # For salvage: layers that damage has taken, whose chunks are skipped up to an `I`; and whether a part of the stream
    # after the frame was skipped, so that a chunk which does not fit may be of a frame that is lost.
    lost: frozenset[int] = frozenset()
    damaged: bool = False

    def after(
        self,
        frame_type: FrameType,
        base: MainState,
        named: Iterable[int] = (),
        moves: Field = NO_FIELD,
        number: int = 0,
    ) -> "Layers":
        """The layers directly after a frame of the base, whose state then is `base` (R-15.13-2).

        Layers that are there and not `named` are carried: repeated after an R-frame, moved after a P-frame.
        """
        named = tuple(sorted(named))
        lost = frozenset[int]() if frame_type == "I" else self.lost | {*self.due}
        before = {} if frame_type == "I" else self.there
        there = {layer: carried(state, moves) if frame_type == "P" else state for layer, state in before.items()
                 if layer not in named}  # fmt: skip
        return Layers(self.highest, base, number, named, moves, there, before, lost=lost)

    def interrupted(self) -> "Layers":
        """The layers after a damaged part of the stream, which may have held chunks of the frame."""
        return replace(self, damaged=True)

    def passed(self, layer: int) -> "Layers":
        """After the chunk of a layer that is skipped; what should have stood before it is lost."""
        return replace(self, last=layer, lost=self.lost | {due for due in self.due if due < layer})

    def with_layer(self, layer: int, state: MainState) -> "Layers":
        """With the state of a layer after its chunk."""
        passed = self.passed(layer)
        there = dict(sorted([*((n, s) for n, s in self.there.items() if n != layer), (layer, state)]))
        return replace(passed, there=there, lost=passed.lost - {layer})

    @property
    def due(self) -> tuple[int, ...]:
        """The layers that are wanted and whose chunks have yet to come; without one a frame is complete (R-15.13-5)."""
        return tuple(layer for layer in self.named if self.last < layer <= self.highest)

    @property
    def lacking(self) -> tuple[int, ...]:
        """The layers that the frame should have, and that are not there so far."""
        return tuple(sorted(self.lost | {*self.due}))

    def missing(self, layer: int) -> str | None:
        """What is wrong where a chunk of `layer`, or above all layers of another frame, stands here (R-15.13-6)."""
        absent = [due for due in self.due if due < layer and due not in self.lost]
        if self.damaged or not absent:
            return None
        return f"`layer_mask` of frame {self.number} names layer {absent[0]}, and its chunk is missing"

    @property
    def parts(self) -> tuple[MainState, ...]:
        """The states whose splats the frame shows: that of the base, then those of the layers in their order."""
        assert self.base is not None
        return self.base, *self.there.values()

    @property
    def splats(self) -> Splats:
        """The splats of the frame, joined on each access."""
        return Splats.joined([state.splats for state in self.parts])

    def work(self, halvings: int = 0) -> int:
        """The rendering work of the frame, halved so often; each state knows its own at full size."""
        return sum(state.work_at(halvings) for state in self.parts)

    @property
    def count(self) -> int:
        """The number of splats of the frame."""
        return sum(len(state.values) for state in self.parts)

    def others(self, layer: int) -> int:
        """The number of splats of the base and of all layers that are there but one."""
        return self.count - (len(self.there[layer].values) if layer in self.there else 0)

    def start_of(self, layer: int, header: SequenceHeader) -> MainState:
        """The state that a layer is predicted from, with the field that it may take from the base."""
        start = self.before.get(layer)
        return MainState.initial(header.width, header.height) if start is None else replace(start, inherited=self.moves)


def carried(state: MainState, moves: Field) -> MainState:
    """The state of a layer after a P-frame of the base that has no chunk of it, and that moves by a field."""
    if moves.side == 0 and state.rests:
        return state
    values = np.empty_like(state.values)
    _carry(state.values, *moves, values)
    return replace(state, values=values, past=state.past if state.rests else np.zeros_like(state.past))


@kernel()
def _carry(state: I8, field: I8, side: int, after: I8) -> None:
    """Move splats (N, 8) by a field, and keep all else, in one go: a frame of a few bytes may carry all of a level."""
    find_motion(state, field, side, after)  # into the first two columns
    for splat in range(len(state)):
        for axis in range(2):
            after[splat, axis] = min(max(state[splat, axis] + after[splat, axis], -X_MOST), X_MOST)
        for column in range(2, 8):
            after[splat, column] = state[splat, column]


def layer_number(s: Coder, layers: Layers, given: int = 0) -> int | None:  # noqa: RET503
    """`layer` (R-15.13-1); None in a damaged stream where it does not fit the frame."""
    with s.part("frame_header"):
        layer = s.u("layer", 2, given)
    if layer == 0:
        s.fail("R-3.2-1", "`layer` is 0, which is reserved; the base stands in a frame's own chunk")
    if layer in layers.named and layer > layers.last:
        return layer
    if layers.damaged:
        return None  # a chunk of a frame that is lost
    left = [str(named) for named in layers.named if named > layers.last]
    what = f"{' or '.join(left)} must come here" if left else "`layer_mask` names none that may come here"
    s.fail("R-15.13-1", f"`layer` is {layer}; {what}")


def layer_head(
    s: Coder, header: SequenceHeader, layers: Layers, layer: int, given: FrameType = "I"
) -> tuple[FrameType | None, Layers]:
    """`layer_type` and `frame_low`, with R-5-2 of a layer that has no body: the type, and `layers`.

    In a damaged stream the type is None of a chunk that is skipped: it belongs to another frame, or its layer is lost,
    which the layers then have passed.
    """
    with s.part("frame_header"):
        code = s.u("layer_type", 2, LAYER_TYPES.index(given))
        type_bit = s.element_bit
        if code >= len(LAYER_TYPES):
            s.fail("R-3.2-1", f"`layer_type` is {code}, which is reserved")
        layer_type = LAYER_TYPES[code]
        strange = layer_type != "I" and layer not in layers.before
        if strange and layer not in layers.lost:
            s.fail("R-15.13-2", f"layer {layer} goes on with {layer_type}, and it is not there: it must begin with I")
        low = s.u("frame_low", 4, layers.number & 15)
    if low != layers.number & 15:
        if layers.damaged:
            return None, layers
        message = f"`frame_low` is {low}; it must be {layers.number & 15}, that of frame {layers.number} before it"
        s.fail("R-15.13-4", f"{message}: the layer is of another frame")
    if strange:
        return None, layers.passed(layer)
    if layer_type == "R":
        count = len(layers.before[layer].values) + layers.others(layer)
        if (fault := header.limits_of(layers.highest).fault("splats", "R-5-2", count)) is not None:  # R-15.13-3
            s.fail(fault[0], f"with layer {layer} repeated the frame has {count} splats; {fault[1]}", bit=type_bit)
    return layer_type, layers


def layer_checksum(s: Coder, header: SequenceHeader, given: int = 0) -> tuple[int | None, int]:
    """`parameter_checksum` of a layer, None if the stream has none, and where it stands."""
    if not header.parameter_checksum_flag:
        return None, 0
    with s.part("checksums"):
        return s.le("parameter_checksum", 4, given), s.element_bit


def layer_body(
    s: Coder, header: SequenceHeader, layers: Layers, layer: int, layer_type: FrameType, given: MainCodes | None = None
) -> Body:
    """The body of a layer; one that is repeated has none."""
    if layer_type == "R":
        return Body(MainCodes.repeated_frame(), layers.before[layer], {})
    limits, others = header.limits_of(layers.highest), layers.others(layer)  # R-15.13-3
    own = None if limits.own is None else limits.own.splats - others
    before = layers.start_of(layer, header)
    body = frame_body(s, layer_type, before, header.max_lane_exponent, limits.frame.splats - others, given, own)
    return replace(body, after=replace(body.after, inherited=NO_FIELD))


def joined_origins(
    base: MainCodes, chunks: Mapping[int, MainCodes], layers: Layers, before: Layers | None
) -> I8 | None:
    """For each splat of a frame with layers the index of the one before that it continues, or -1: (N,); or None.

    `chunks` are the codes of the layers that have a chunk after it; `layers` and `before` stand after this frame and
    after the one before.
    """
    if before is None or before.base is None or layers.base is None or base.type == "I":
        return None
    repeated = MainCodes.repeated_frame()
    found, offset = [_origins_of(base, len(layers.base.values), 0)], len(before.base.values)
    offsets = {}
    for layer, state in before.there.items():
        offsets[layer], offset = offset, offset + len(state.values)
    for layer, state in layers.there.items():
        codes = chunks.get(layer, repeated)
        found.append(_origins_of(codes, len(state.values), offsets.get(layer, 0)))
    return np.concatenate(found)


def _origins_of(codes: MainCodes, count: int, offset: int) -> I8:
    """The origins of the splats of a part, whose splats began at `offset` in the frame before."""
    if codes.type == "I":
        return np.full(count, -1, np.int64)
    if codes.type == "R":
        return np.arange(offset, offset + count)
    origins = codes.origins
    assert origins is not None
    return np.where(origins >= 0, origins + offset, -1)
