"""A frame as it is encoded, in either profile."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from gsvc_ref.encoder.log import Decision
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.stream.profiles import AnyCodes, AnyState

OnStage = Callable[[str, int, int, float | None], None]
"""Called with the stage, the iteration, their number, and the PSNR in dB of the picture before rounding, if known."""


@dataclass(frozen=True)
class EncodedLayer:
    """A layer of a frame as it is encoded."""

    layer: int  # 0 for the base
    codes: MainCodes
    state: MainState  # the decoder's, after the frame
    psnr: float  # in dB, with all layers up to this one
    carried: bool = False  # by the field of the base, without a chunk; its codes then are those of an R-frame


@dataclass(frozen=True)
class EncodedFrame:
    """A frame as it is encoded: by its coder, and with what `loop.described` adds to it."""

    codes: AnyCodes
    state: AnyState  # the decoder's, after the frame
    # PSNR of the decoded frame at its bit depth, with all of its layers, in dB; infinite if equal to the source
    psnr: float
    # of all fits and of quantisation; in profile `main` the number of evaluations
    iterations: int
    # by stage: start, fit, quantize, check; in profile `main` intra, inter, check
    seconds: dict[str, float] = field(default_factory=dict)
    decisions: tuple[Decision, ...] = ()  # those of its coder; `described` makes them one for each effect
    reason: str | None = None  # why it is of its type, where its coder chose that; else `described` says it
    carried: bool = False  # of a layer that moves with the base, without a chunk; its codes are those of an R-frame
    layers: tuple[EncodedLayer, ...] = ()  # the base and those above it; empty without layers
    # `described` sets both; the time is that of the whole frame
    number: int = 0
    elapsed_s: float = 0.0

    @property
    def chunks(self) -> dict[int, MainCodes]:
        """The codes of each layer above the base that has its own chunk: not of one that is carried."""
        return {part.layer: part.codes for part in self.layers if part.layer > 0 and not self.carries(part)}

    def carries(self, part: EncodedLayer) -> bool:
        """Whether one of its layers is carried: it moves with the field of the base, or repeats with an R-frame."""
        return part.carried or (part.codes.type, self.codes.type) == ("R", "R")


def worked_on_again(result: EncodedFrame) -> EncodedFrame:
    """An equal frame that was to become better, not repeated, with the reason for it."""
    if result.codes.type == "R":
        return result
    why = "equal to the frame before, which is not yet as good as its I-frame"
    return replace(result, reason=why, decisions=(*result.decisions, Decision("frames", True, why)))
