"""Encoding frame after frame in profile `main` with layers, each in its own closed loop (spec.md section 15.13).

I-frames fit all layers together (`joint`). In P-frames layer l is coded as the base is, with what is below it as a
constant background. It is predicted from itself, with a motion field of its own or the base's, so that no layer depends
on other bits than those of the base; or it is *carried*, without a chunk, where moving with the base does.

A layer of a P-frame is worth little if what is below it went elsewhere. So, where no layer has a PSNR to hold, each is
fitted to the frame with the layers above it in place, and its D is as many steps from its I-frame's as from that of the
topmost layer. Layers that have a PSNR to hold are fitted one after the other, in I-frames too.
"""

from copy import copy
from dataclasses import replace
from functools import partial
from typing import Any, cast

from gsvc_base.arrays import Frame
from gsvc_base.splats import Splats
from gsvc_ref.encoder.encoded_frame import EncodedFrame, EncodedLayer, OnStage
from gsvc_ref.encoder.main.frame import MainFrame, MainFrameEncoder
from gsvc_ref.encoder.main.joint import encode_joint, joint_evaluations
from gsvc_ref.encoder.settings import MainSettings
from gsvc_ref.encoder.stages import StageSeconds
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.paper import FrameType


class LayeredFrameEncoder:
    """Encodes frames with their layers in order."""

    def __init__(self, settings: MainSettings, width: int, height: int, bit_depth: int) -> None:
        self.settings = settings
        self.parts = [  # of the base and each layer above it; the D of P-frames is that of all layers together
            MainFrameEncoder(one, width, height, bit_depth, corrects_drift=False)
            for one in settings.of_layers(width, height)
        ]
        self.together = not settings.layer_goals  # whether a P-frame's layers are fitted with those above them
        if settings.layer_goals:  # each may need all splats that there is room for
            for part in self.parts:
                part.most, part.room = max(1, part.most // len(self.parts)), part.room // len(self.parts)

    @property
    def state(self) -> MainState:
        """The decoder's state of the base after the frames so far."""
        return self.parts[0].state

    def elements(self) -> dict[str, Any]:
        """The elements of the sequence header that the profile has."""
        return {**self.parts[0].elements(), "layer_count": len(self.parts)}

    @property
    def decides_first(self) -> bool:
        """Whether the first frame decides something for all groups of pictures."""
        return any(part.decides_first for part in self.parts)

    def decided(self) -> tuple[int, ...]:
        """The numbers of splats from which I-frames of each layer begin their search."""
        return tuple(total for part in self.parts for total in part.decided())

    def decide(self, decided: tuple[int, ...]) -> None:
        """Take what the first frame of the stream has decided, as `decided` said it."""
        for part, total in zip(self.parts, decided, strict=True):
            part.decide((total,))

    def for_group(self) -> "LayeredFrameEncoder":
        """An encoder for another group of pictures."""
        other = copy(self)
        other.parts = [part.for_group() for part in self.parts]
        return other

    def encode(self, frame: Frame, frame_type: FrameType, number: int, progress: OnStage) -> EncodedFrame:
        """Encode a frame (H, W, 3) u1 or u2 and its layers; the next one is predicted from their reconstruction."""
        below = Splats.empty()
        encoded: list[EncodedFrame] = []
        joint: list[MainCodes] = []
        for part, above in zip(self.parts, self._above(), strict=True):
            part.below, part.above, part.moves = below, above, None
            if encoded:
                base = encoded[0].codes
                part.moves = cast("MainCodes", base).field if base.type == "P" else None
                frame_type = base.type
            work = MainFrame(part, frame, number, progress)
            if joint:
                work.joint = partial(joint.__getitem__, len(encoded))
            elif self.together and not encoded:
                work.joint = partial(self._fitted, work, joint)
            encoded.append(part.encode_frame(work, frame_type))
            part.is_catching_up = False  # where the base repeats, so do the layers
            below = below.append(part.state.splats)
        if joint:
            for part in self.parts:
                part.quantizer = (part.quantizer + self.parts[-1].quantizer) // 2
        seconds = StageSeconds()
        for layer in encoded:
            seconds.add(layer.seconds)
        layers = tuple(
            EncodedLayer(number, cast("MainCodes", layer.codes), part.state, layer.psnr, layer.carried)
            for number, (layer, part) in enumerate(zip(encoded, self.parts, strict=True))
        )
        return replace(
            encoded[0], psnr=layers[-1].psnr, iterations=sum(layer.iterations for layer in encoded), seconds=seconds,
            layers=layers,
        )  # fmt: skip

    def _fitted(self, work: MainFrame, joint: list[MainCodes]) -> MainCodes:
        """The codes of the base of an I-frame; those of all layers are put into `joint`."""
        settings = self.settings
        evaluations = joint_evaluations(settings.intra, len(self.parts))
        targets = [work.new_target(evaluations) for _ in self.parts]
        splats = [part.intra_splats for part in self.parts]
        joint += encode_joint(targets, splats, settings.layer_weights, work.rng(), settings.intra)
        return joint[0]

    def _above(self) -> list[Splats]:
        """The splats of all layers above each, as they are now."""
        above = [Splats.empty()]
        for part in reversed(self.parts[1:]):
            above.append(part.state.splats.append(above[-1]) if self.together else above[-1])
        return above[::-1]
