"""Settings of profile `paper`: how frames of a type are fitted and quantised, and how key frames are found."""

from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal, Self

from gsvc_base.checks import check_range, check_types
from gsvc_ref.encoder.key_frames import GUARD_RATIO
from gsvc_ref.training import MAX_ITERATIONS, BlockSettings, FitSettings

ELEMENTS: Final = {"cholesky_bits": (1, 12), "color_stages": (1, 8), "color_codewords": (1, 1024)}
"""The limits of the elements of the sequence header that describe quantisers (section 6.3)."""


@dataclass(frozen=True)
class QuickFit:
    """A fit by L-BFGS of about `iterations` evaluations."""

    iterations: int

    def __post_init__(self) -> None:
        check_types(self)
        check_range("iterations", self.iterations, 0, MAX_ITERATIONS)

    def with_(self, iterations: int) -> Self:
        """A copy with other iterations."""
        return replace(self, iterations=iterations)


@dataclass(frozen=True)
class FrameSettings:
    """How the frames of one type are fitted and quantised."""

    # The fit in binary32, before quantisation: by Adan from a random start as in the paper, or by L-BFGS from splats
    # drawn from the picture
    fit: FitSettings | QuickFit
    tune: FitSettings
    quantizer: BlockSettings
    # P-frames: the fraction of N that GSA adds; at random places as in the paper, with L-BFGS where the prediction is
    # wrong
    new_fraction: float = 0.1

    def __post_init__(self) -> None:
        check_types(self)
        check_range("new_fraction", self.new_fraction, 0, 1)

    @property
    def iterations(self) -> int:
        """The iterations of fit and fine-tuning."""
        return self.fit.iterations + self.tune.iterations

    def with_(self, **changes: Any) -> Self:
        """A copy with other fields by name, or with other ELEMENTS of its quantiser."""
        elements = {name: changes.pop(name) for name in ELEMENTS if name in changes}
        frame = replace(self, **changes)
        return replace(frame, quantizer=frame.quantizer.with_(**elements))

    def in_proportion(self, share: float) -> Self:
        """A copy with this share of the iterations, at least 1."""
        fit, tune = (max(1, round(part.iterations * share)) for part in (self.fit, self.tune))
        return replace(self, fit=self.fit.with_(iterations=fit), tune=self.tune.with_(iterations=tune))


@dataclass(frozen=True)
class DetectionSettings:
    """How key frames are found (DKS, paper section 3.6)."""

    iterations: int = 500  # Pre-training iterations of each frame, as I-frame and again as P-frame
    splats: int | None = None  # Maximum number of splats in pre-training; None: those of the frame
    # Pre-train on the frame reduced to at most this many pixels on its longer side; None: as it is
    longest_side: int | None = None
    window: int = 10  # Frames on each side that the statistics are taken over
    threshold: float = 3.0  # A key frame exceeds the mean by this many standard deviations
    # ``paper``, or ``robust``: statistics that leave the frame itself out, and a guard against noise
    rule: Literal["paper", "robust"] = "paper"
    # By the robust rule, a key frame's loss as a P-frame exceeds that as an I-frame by at least this factor
    guard_ratio: float = GUARD_RATIO
    # Pre-train from ``random`` splats as in the paper, or from splats drawn from the ``image``
    start: Literal["random", "image"] = "random"
    # intra_fit, inter_fit: How frames are pre-trained, but for the number of iterations and GSP. What tells a cut is
    # how far short fits get, by Adan: after as many steps of L-BFGS most frames are about as good from either start.
    intra_fit: FitSettings = field(default_factory=FitSettings)
    inter_fit: FitSettings = field(default_factory=FitSettings)

    def __post_init__(self) -> None:
        check_types(self)
        check_range("iterations", self.iterations, 1, MAX_ITERATIONS)
        check_range("splats", self.splats, 1, 1 << 22)
        check_range("longest_side", self.longest_side, 1, 65535)
        check_range("window", self.window, 0, 10_000)
        check_range("threshold", self.threshold, 0, 1e6)
        check_range("guard_ratio", self.guard_ratio, 0, 1e6)
