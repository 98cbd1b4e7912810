"""Settings of profile `paper`: how frames of a type are fitted and quantised, and how key frames are found."""

from dataclasses import dataclass, replace
from typing import Any, Final, Literal, Self

from gsvc_base.checks import check_range, check_types
from gsvc_ref.encoder.key_frames import GUARD_RATIO
from gsvc_ref.training import (
    MAX_ITERATIONS,
    AnyFit,
    BlockSettings,
    DescentSettings,
    FitSettings,
    RoundingSettings,
)

SHORT_FIT: Final = 12
"""Constant quality: evaluations by L-BFGS after each change of the number of splats, at most."""

ELEMENTS: Final = {"cholesky_bits": (1, 12), "color_stages": (1, 8), "color_codewords": (1, 1024)}
"""The limits of the elements of the sequence header that describe quantisers (section 6.3)."""


@dataclass(frozen=True)
class FrameSettings:
    """How the frames of one type are fitted and quantised.

    Attributes
    ----------
    fit
        The fit in binary32, before quantisation.
    tune
        How splats are quantised after it: by quantisation-aware fine-tuning, or by rounding in stages.
    quantizer
        The quantisers.
    candidates
        I-frames: choices (b, M, B) of which the first frame takes the best by rate and quality for the whole stream;
        none: those of `quantizer`.
    start
        I-frames: ``random`` as in the paper, or ``image``: drawn from the image.
    new_fraction
        P-frames: the fraction of N that GSA adds.
    new_from_residual
        P-frames: add where the prediction is wrong, along edges, and prune as many of the least visible splats before,
        so that the count never exceeds N. False adds uniformly at random, as in the paper, and leaves pruning to GSP.
    """

    fit: AnyFit
    tune: FitSettings | RoundingSettings
    quantizer: BlockSettings
    candidates: tuple[tuple[int, int, int], ...] = ()
    start: Literal["random", "image"] = "random"
    new_fraction: float = 0.1
    new_from_residual: bool = False

    def __post_init__(self) -> None:
        check_types(self)
        check_range("new_fraction", self.new_fraction, 0, 1)
        for candidate in self.candidates:
            for (name, limits), value in zip(ELEMENTS.items(), candidate, strict=True):
                check_range(f"{name} of candidates", value, *limits)

    @property
    def short_fit(self) -> AnyFit:
        """The fit after each change of the number of splats by constant quality: fine-tuning's, if there is any."""
        if isinstance(self.tune, FitSettings):
            return self.tune
        return self.fit.with_(iterations=min(self.fit.iterations, SHORT_FIT), growth=None, pruning=None)

    def with_(self, **changes: Any) -> Self:
        """A copy with other fields by name, or with other ELEMENTS of its quantiser."""
        elements = {name: changes.pop(name) for name in ELEMENTS if name in changes}
        frame = replace(self, **changes)
        return replace(frame, quantizer=frame.quantizer.with_(**elements))

    def in_proportion(self, share: float) -> Self:
        """A copy with this share of the iterations, at least 1; L-BFGS goes on for as much less gain."""

        def stretched(part: Any) -> Any:
            changes: dict[str, Any] = {"iterations": max(1, round(part.iterations * share))}
            if isinstance(part, DescentSettings):
                changes["least_gain"] = part.least_gain / share
            return part.with_(**changes)

        return replace(self, fit=stretched(self.fit), tune=stretched(self.tune))


@dataclass(frozen=True)
class DetectionSettings:
    """Dynamic key-frame selection (paper section 3.6).

    Attributes
    ----------
    iterations
        Pre-training iterations of each frame, as I-frame and again as P-frame.
    splats
        Maximum number of splats in pre-training; None: those of the frame.
    longest_side
        Pre-train on the frame reduced to at most this many pixels on its longer side; None: as it is.
    window
        Frames on each side that the statistics are taken over.
    threshold
        A key frame exceeds the mean by this many standard deviations.
    rule
        ``paper``, or ``robust``: statistics that leave the frame itself out, and a guard against noise.
    guard_ratio
        By the robust rule, a key frame's loss as a P-frame exceeds that as an I-frame by at least this factor.
    intra_fit, inter_fit
        How frames are pre-trained, but for the number of iterations; None: as they are fitted. What tells a cut is how
        far short fits get, by Adan: after as many steps of L-BFGS most frames are about as good from either start.
    """

    iterations: int = 500
    splats: int | None = None
    longest_side: int | None = None
    window: int = 10
    threshold: float = 3.0
    rule: Literal["paper", "robust"] = "paper"
    guard_ratio: float = GUARD_RATIO
    intra_fit: FitSettings | None = None
    inter_fit: FitSettings | None = None

    def __post_init__(self) -> None:
        check_types(self)
        check_range("iterations", self.iterations, 1, MAX_ITERATIONS)
        check_range("splats", self.splats, 1, 1 << 22)
        check_range("longest_side", self.longest_side, 1, 65535)
        check_range("window", self.window, 0, 10_000)
        check_range("threshold", self.threshold, 0, 1e6)
        check_range("guard_ratio", self.guard_ratio, 0, 1e6)
