"""The layers of a stream of profile `main` (spec.md section 15.13): further splats for each frame, in chunks `n`.

A layer is predicted from itself alone. So what a decoder carries is a state of each layer, beside that of the base.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final, cast

import numpy as np

from gsvc_base.arrays import I8
from gsvc_base.splats import Splats
from gsvc_ref.bitstream.coder import Coder
from gsvc_ref.bitstream.header import SequenceHeader
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.main.frames import Body, MainState, frame_body
from gsvc_ref.paper import FrameType

LAYER_TYPES: Final = (*b"IPR",)
"""The values of `layer_type`."""


@dataclass(frozen=True)
class LayerHead:
    """The elements of a chunk `n` in front of its body."""

    layer: int  # 1 to `layer_count` - 1
    type: FrameType | None  # None of a layer that is skipped
    checksum: int | None = None  # `parameter_checksum`, if the stream has some
    checksum_bit: int = 0  # the offset of that element in bits from the start of the stream


@dataclass(frozen=True, eq=False)
class Layers:
    """The layers of the frame decoded last, up to the highest that is wanted."""

    highest: int  # the highest layer that is wanted, at least 1
    base: MainState | None = None  # the state of the base after the frame; None before the first frame
    there: Mapping[int, MainState] = field(default_factory=dict)  # the layers that the frame shows, after it
    before: Mapping[int, MainState] = field(default_factory=dict)  # what they are predicted from
    last: int = 0  # the layer of the last chunk after the frame, skipped ones included; 0: there was none
    # For salvage: layers that damage has taken, whose chunks are skipped up to an `I`; and whether chunks after the
    # frame are skipped, since they may belong to a frame that is lost.
    lost: frozenset[int] = frozenset()
    closed: bool = False

    def after(self, frame_type: FrameType, base: MainState) -> "Layers":
        """The layers directly after a frame of the base, whose state then is `base` (R-15.13-2)."""
        before = {} if frame_type == "I" else self.there
        there = before if frame_type == "R" else {}
        lost = frozenset[int]() if frame_type == "I" else self.lost
        return Layers(self.highest, base, there, before, lost=lost)

    def interrupted(self) -> "Layers":
        """The layers after a damaged part of the stream: those that the frame had before it stay, the others are lost.

        Which frame a chunk after the damage belongs to is unknown until there is one.
        """
        own = {layer: state for layer, state in self.there.items() if layer <= self.last}
        lost = frozenset(layer for layer in range(1, self.highest + 1) if layer not in own)
        return replace(self, there=own, before={}, lost=lost, closed=True)

    def with_layer(self, layer: int, state: MainState) -> "Layers":
        """With the state of a layer after its chunk."""
        there = dict(sorted([*((n, s) for n, s in self.there.items() if n != layer), (layer, state)]))
        return replace(self, there=there, last=layer, lost=self.lost - {layer})

    @property
    def takes_chunks(self) -> bool:
        """Whether a chunk `n` that stands here belongs to a frame."""
        return self.base is not None and not self.closed

    @property
    def parts(self) -> tuple[MainState, ...]:
        """The states whose splats the frame shows: that of the base, then those of the layers in their order."""
        assert self.base is not None
        return self.base, *self.there.values()

    @property
    def splats(self) -> Splats:
        """The splats of the frame, joined on each access."""
        return Splats.joined([state.splats for state in self.parts])

    @property
    def work(self) -> int:
        """The rendering work of the frame; each state knows its own, so that a layer that repeats costs nothing."""
        return sum(state.work for state in self.parts)

    def others(self, layer: int) -> int:
        """The number of splats of the base and of all layers but one."""
        assert self.base is not None
        return len(self.base.values) + sum(len(state.values) for n, state in self.there.items() if n != layer)

    def start_of(self, layer: int, header: SequenceHeader) -> MainState:
        """The state that a layer is predicted from."""
        return self.before.get(layer, MainState.initial(header.width, header.height))


def layer_head(s: Coder, header: SequenceHeader, layers: Layers, given: LayerHead | None = None) -> LayerHead:
    """The elements of layer() in front of its body (R-15.13-1, R-15.13-2), with R-5-2 of a layer that has no body.

    A Writer writes those that are given.
    """
    head, limits = given or LayerHead(0, "I"), header.limits
    with s.part("frame_header"):
        layer = s.le("layer", 1, head.layer)
        if not layers.last < layer < header.layer_count:
            s.fail(
                "R-15.13-1",
                f"`layer` is {layer}; it must be {layers.last + 1} to {header.layer_count - 1} here",
            )
        if layer > layers.highest:
            return LayerHead(layer, None)
        code = s.le("layer_type", 1, ord(head.type or "R"))
        if code not in LAYER_TYPES:
            s.fail("R-3.2-1", f"`layer_type` is {code}; it must be one of I, P and R in ASCII")
        layer_type = cast(FrameType, chr(code))
        if layer_type != "I" and layer not in layers.before:
            if layer in layers.lost:
                return LayerHead(layer, None)
            s.fail("R-15.13-2", f"layer {layer} goes on with {layer_type}, and it is not there: it must begin with I")
        if layer_type == "R" and (count := len(layers.before[layer].values) + layers.others(layer)) > limits.splats:
            message = f"with layer {layer} repeated the frame has {count} splats"
            s.fail("R-5-2", f"{message}; level {header.level} allows {limits.splats}")  # R-15.13-3
    if not header.parameter_checksum_flag:
        return LayerHead(layer, layer_type)
    with s.part("checksums"):
        checksum = s.le("parameter_checksum", 4, head.checksum or 0)
    return LayerHead(layer, layer_type, checksum, s.element_bit)


def layer_body(
    s: Coder, header: SequenceHeader, layers: Layers, layer: int, layer_type: FrameType, given: MainCodes | None = None
) -> Body:
    """The body of a layer; one that is repeated has none."""
    before = layers.start_of(layer, header)
    if layer_type == "R":
        return Body(MainCodes.repeated_frame(), before, {})
    room = header.limits.splats - layers.others(layer)  # R-15.13-3
    return frame_body(s, layer_type, before, header.max_lane_exponent, room, given)


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
