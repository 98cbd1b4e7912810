"""The settings of an encode of profile `paper`, with how frames of a type are fitted and quantised, and its presets."""

from dataclasses import dataclass, replace
from numbers import Integral
from typing import Any, ClassVar, Final, Self

from gsvc_base.checks import check_range, check_types
from gsvc_base.errors import UsageError
from gsvc_ref.encoder.effects import Effects
from gsvc_ref.encoder.settings.common import MAX_SPLATS, ProfileName, Settings
from gsvc_ref.encoder.settings.detection import FEW_STEPS, quick_detection
from gsvc_ref.paper import RvqSettings
from gsvc_ref.training import MAX_ITERATIONS, BlockSettings, FitSettings, PruningSchedule, Rates

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


@dataclass(frozen=True, kw_only=True)
class PaperSettings(Settings):
    """The settings of an encode of profile `paper`: those of `Settings`, and these."""

    profile: ClassVar[ProfileName] = "paper"
    PRESETS: ClassVar[tuple[str, ...]] = ("quick", "paper")
    MOST_LANES: ClassVar[int] = 64
    ELSEWHERE: ClassVar[str] = (
        "{} is a setting of profile paper, and the stream is of profile main: choose profile paper, or leave it out; "
        "main has the presets quick and slow"
    )
    OTHER_NAMES: ClassVar[tuple[str, ...]] = ("iterations", *ELEMENTS)

    intra: FrameSettings
    inter: FrameSettings
    entropy_precision: int = 14  # bits of the frequencies of rANS

    def __post_init__(self) -> None:
        super().__post_init__()
        check_range("entropy_precision", self.entropy_precision, 12, 16)
        if isinstance(self.lane_count, str):
            raise UsageError(f"lane_count is {self.lane_count!r}; in profile paper it is a number, 1 to 64")
        if (b := self.intra.quantizer.cholesky_bits) != self.inter.quantizer.cholesky_bits:
            raise UsageError(f"cholesky_bits is {b} for I-frames and another for P-frames; a stream has one for both")

    @classmethod
    def quick(cls, profile: str = "paper", **overrides: Any) -> "PaperSettings":
        """Preset `quick` of profile `paper`."""
        tune = FEW_STEPS.with_(rates=Rates(0.01, 0.005, 0.001))
        intra = FrameSettings(
            fit=QuickFit(80),
            tune=tune.with_(iterations=45),
            quantizer=BlockSettings(
                position_step=0.07,
                cholesky_bits=9,
                colors=RvqSettings(codewords=(32, 32, 32)),
                weigh_by_area=True,
                weigh_factors=True,
                quantizer_rate=0.01,
            ),
        )
        inter = FrameSettings(
            fit=QuickFit(12),
            tune=tune.with_(iterations=15),
            quantizer=BlockSettings(
                position_step=0.2,
                cholesky_bits=9,
                cholesky_step=0.14,
                colors=RvqSettings(codewords=(8, 8), zero_codeword=True),
                weigh_by_area=True,
                quantizer_rate=0.0,
                static_threshold=0.4,
            ),
            new_fraction=0.03,
        )
        quick = cls(preset="quick", intra=intra, inter=inter, detection=quick_detection())
        return quick.with_(profile=profile, **overrides)

    @classmethod
    def paper(cls, profile: str = "paper", **overrides: Any) -> "PaperSettings":
        """Preset `paper`.

        Where the paper is silent the values of its public code are taken; the number of fine-tuning iterations, which
        neither states, is a tenth of the fit's.
        """
        tune = FitSettings(iterations=5_000, pruning=None)
        intra = FrameSettings(FitSettings(), tune, BlockSettings())
        inter = FrameSettings(FitSettings(pruning=PruningSchedule.inter()), tune, BlockSettings())
        effects = Effects.parse("all")
        paper = cls(preset="paper", intra=intra, inter=inter, effects=effects)
        return paper.with_(profile=profile, **overrides)

    def with_(self, **changes: Any) -> Self:
        """As `Settings.with_`; `iterations` and the ELEMENTS of quantisers reach into `intra` and `inter`."""
        limits = {"iterations": (1, MAX_ITERATIONS), **ELEMENTS}
        reaching = {name: changes.pop(name, None) for name in limits}
        settings = super().with_(**changes)
        given = {name: _whole(name, value, *limits[name]) for name, value in reaching.items() if value is not None}
        intra, inter = settings.intra, settings.inter
        if "iterations" in given:
            share = given.pop("iterations") / intra.fit.iterations
            intra, inter = intra.in_proportion(share), inter.in_proportion(share)
        if given:
            intra, inter = intra.with_(**given), inter.with_(**given)
        return replace(settings, intra=intra, inter=inter)

    @property
    def inter_iterations(self) -> int:
        """The iterations of a P-frame."""
        return self.inter.iterations

    def counted_splats(self, width: int, height: int) -> int:
        """As `Settings.counted_splats`: P-frames may pass N while they add before they prune."""
        most = self.most_splats(width, height)
        return min(most + most // 4, MAX_SPLATS)

    def quantizer_elements(self) -> dict[str, Any]:
        """The elements of the sequence header that describe the quantisers and entropy coding."""
        books = [kind.quantizer.colors.codewords for kind in (self.intra, self.inter)]
        return {
            "cholesky_bits": self.intra.quantizer.cholesky_bits,
            "color_stages": max(map(len, books)),
            "color_codewords": max(map(max, books)),
            "entropy_precision": self.entropy_precision,
            "lane_count": self.lane_count,
        }


def _whole(name: str, value: Any, low: int, high: int) -> int:
    """The value of a name that reaches into settings of frames as a Python integer."""
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise UsageError(f"{name} is {value!r}; it must be a whole number in {low}..{high}")
    check_range(name, int(value), low, high)
    return int(value)
