"""A frame as it is encoded, in either profile."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from gsvc_ref.encoder.log import Decision
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.main.frames import MainState
from gsvc_ref.stream.profiles import AnyCodes, AnyState

OnStage = Callable[[str, int, int, float | None], None]
"""Called with the stage, the iteration, their number, and the PSNR in dB of the picture before rounding, if known."""


@dataclass(frozen=True)
class EncodedLayer:
    """A layer of a frame as it is encoded.

    Attributes
    ----------
    layer
        0 for the base.
    codes
        The codes to be written.
    state
        The decoder's state of this layer after the frame.
    psnr
        PSNR of the decoded frame with all layers up to this one, in dB.
    """

    layer: int
    codes: MainCodes
    state: MainState
    psnr: float


@dataclass(frozen=True)
class EncodedFrame:
    """A frame as it is encoded: by its coder, and with what `loop.described` adds.

    Attributes
    ----------
    codes
        The codes to be written.
    state
        The decoder's state after the frame, with the reconstructed splats.
    psnr
        PSNR of the decoded frame at its bit depth, with all of its layers, in dB; infinite if equal to the source.
    iterations
        The number of iterations of all fits and of quantisation together; in profile `main`, of evaluations.
    seconds
        Time by stage: start, fit, quantize, check; in profile `main` intra, inter, check.
    decisions
        The decisions of its coder; described, one about each effect.
    reason
        Why the frame is of its type, if its coder has chosen that; described, in any case.
    layers
        The base and the layers above it; none of a frame that has no layers.
    number, elapsed_s
        Described: its number, and the seconds that it took.
    """

    codes: AnyCodes
    state: AnyState
    psnr: float
    iterations: int
    seconds: dict[str, float] = field(default_factory=dict)
    decisions: tuple[Decision, ...] = ()
    reason: str | None = None
    layers: tuple[EncodedLayer, ...] = ()
    number: int = 0
    elapsed_s: float = 0.0

    def has_chunk(self, part: EncodedLayer) -> bool:
        """Whether one of its layers has its own chunk: not the base, and not one that repeats with an R-frame."""
        return part.layer > 0 and (part.codes.type, self.codes.type) != ("R", "R")


def worked_on_again(result: EncodedFrame) -> EncodedFrame:
    """An equal frame that was to become better, not repeated, with the reason for it."""
    if result.codes.type == "R":
        return result
    why = "equal to the frame before, which is not yet as good as its I-frame"
    return replace(result, reason=why, decisions=(*result.decisions, Decision("frames", True, why)))
