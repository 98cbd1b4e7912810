"""How key frames are found (DKS, paper section 3.6)."""

from dataclasses import dataclass, field
from typing import Final, Literal

from gsvc_base.checks import check_range, check_types
from gsvc_ref.encoder.key_frames import GUARD_RATIO
from gsvc_ref.training import MAX_ITERATIONS, AdanSettings, Cosine, FitSettings, Rates

FEW_STEPS: Final = FitSettings(
    iterations=30, schedule=Cosine(steps=30, final=0.05), learn_pixels=True, relative_steps=True,
    optimizer=AdanSettings(beta1=0.9, beta2=0.92, beta3=0.99), convergence=None, pruning=None,
)  # fmt: skip
"""A short fit by Adan with well-sized steps: preset `quick` pre-trains and fine-tunes with it."""


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


def quick_detection() -> DetectionSettings:
    """Preset `quick`, in both profiles: short fits of small pictures, by Adan."""
    return DetectionSettings(
        iterations=30, splats=200, longest_side=96, rule="robust", guard_ratio=1.5, start="image",
        intra_fit=FEW_STEPS.with_(rates=Rates(1.0, 0.5, 0.05), schedule=Cosine(steps=30, final=0.02)),
        inter_fit=FEW_STEPS.with_(rates=Rates(0.2, 0.08, 0.008)),
    )  # fmt: skip
