"""The settings of an encode of profile `main` (spec.md section 15), and its presets `quick` and `slow`."""

import re
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import pairwise
from typing import Any, ClassVar, Final

from gsvc_base.checks import check_range
from gsvc_base.errors import UsageError
from gsvc_ref.bitstream.header import LANE_EXPONENTS, MAX_LANE_EXPONENT, MAX_LAYERS, level_for
from gsvc_ref.encoder.main.settings import InterSettings, IntraSettings
from gsvc_ref.encoder.settings.common import MAX_SPLATS, PIXELS_PER_SPLAT, ProfileName, Settings
from gsvc_ref.encoder.settings.detection import quick_detection
from gsvc_ref.main.tables import QUANTIZERS

LAYER_CELL_GAIN: Final = 3.0
"""By how much finer cells of the motion field are preferred in a layer: what is above it needs them too; measured."""


BY_SIZE: Final = "by-size"
"""The `lane_count` with which each frame has the most lanes that cost at most LANE_SHARE of its bits."""
LANE_SHARE: Final = Fraction(1, 100)

BITS_OF_LANE: Final = 8
"""What a lane costs: how much longer its first state is, on average, than what it says."""


def lane_share(text: str) -> Fraction:
    """The share of a frame's bits that its lanes may cost, of a `lane_count` ``by-size`` or, say, ``by-size:2%``."""
    match = re.fullmatch(rf"{BY_SIZE}(?::(\d{{1,2}}(?:\.\d{{1,4}})?)%)?", text, re.ASCII)
    if match is None:
        raise UsageError(f"lane_count is {text!r}; it must be a number, by-size, or by-size:P% with P below 100")
    return LANE_SHARE if match[1] is None else Fraction(match[1]) / 100


@dataclass(frozen=True, kw_only=True)
class MainSettings(Settings):
    """The settings of an encode of profile `main`: those of `Settings`, and these."""

    profile: ClassVar[ProfileName] = "main"
    PRESETS: ClassVar[tuple[str, ...]] = ("quick", "slow")
    MOST_LANES: ClassVar[int] = 1 << MAX_LANE_EXPONENT
    ELSEWHERE: ClassVar[str] = "{} is a setting of profile main; profile paper has splats and psnr for its quality"

    lane_count: int | str = BY_SIZE
    intra: IntraSettings = field(default_factory=IntraSettings)
    inter: InterSettings = field(default_factory=InterSettings)
    # 0, the coarsest, to 79, the finest: frames have `quantizer` 79 - `quality`, and 8 more halve the step D of codes.
    # Without `splats`, a frame gets those that are worth their bits at this D. None: D follows from the splats.
    quality: int | None = None
    # PSNR in dB with the base, with layer 1, ..., rising; empty: none, or those of `layer_splats`
    layers: tuple[float, ...] = ()
    layer_splats: tuple[int, ...] = ()  # splats of a frame with the base, with layer 1, ..., rising

    def __post_init__(self) -> None:
        super().__post_init__()
        check_range("quality", self.quality, 0, QUANTIZERS - 1)
        if isinstance(self.lane_count, str):
            lane_share(self.lane_count)
        self._check_layers()
        if self.quality is not None and self.psnr is not None:
            raise UsageError(
                "quality says how fine the codes are and psnr how close the picture comes; give one of them"
            )
        self.effects.check_main()

    @classmethod
    def _qualities(cls) -> tuple[str, ...]:
        return ("psnr", "quality", "layers", "layer_splats")

    @classmethod
    def quick(cls, profile: str = "main", **overrides: Any) -> "MainSettings":
        """Preset `quick` of profile `main`."""
        return cls(preset="quick", detection=quick_detection()).with_(profile=profile, **overrides)

    @classmethod
    def slow(cls, profile: str = "main", **overrides: Any) -> "MainSettings":
        """Preset `slow`: searched for longer."""
        longer: dict[str, Any] = {"intra": IntraSettings.slow(), "inter": InterSettings.slow()}
        return replace(cls.quick(), preset="slow", **longer).with_(profile=profile, **overrides)

    def _check_layers(self) -> None:
        for name, values, highest in (("layers", self.layers, 100), ("layer_splats", self.layer_splats, 1 << 22)):
            if not values:
                continue
            for value in values:
                check_range(name, value, 1, highest)
            if len(values) > MAX_LAYERS or any(a >= b for a, b in pairwise(values)):
                raise UsageError(f"{name} is {values}; give at most {MAX_LAYERS} values that grow")
            others = [other for other in ("splats", "psnr", "quality") if getattr(self, other) is not None]
            others += ["layers"] if name == "layer_splats" and self.layers else []
            if others:
                raise UsageError(f"{name} says how good each layer is, and so does {others[0]}; give one of them")

    @property
    def has_quality(self) -> bool:
        """Whether frames have a quality that says how many splats they take."""
        return self.psnr is not None or self.quality is not None

    def max_lane_exponent(self, width: int, height: int) -> int:
        """That of the header of a stream; by size what the lowest level of such frames allows (R-5-11)."""
        if isinstance(self.lane_count, int):
            return self.lane_count.bit_length() - 1
        return LANE_EXPONENTS[level_for(width, height)]

    def lane_exponent(self, bits: int, most: int) -> int:
        """That of a frame that has so many bits with one lane, up to `most`."""
        if isinstance(self.lane_count, int):
            return most
        lanes = int(lane_share(self.lane_count) * bits / BITS_OF_LANE)
        return min(max(lanes, 1).bit_length() - 1, most)

    @property
    def layer_count(self) -> int:
        """The number of layers of a frame, with the base."""
        return max(len(self.layers), len(self.layer_splats), 1)

    def of_layers(self) -> list["MainSettings"]:
        """The settings of the base and of each layer above it, as if each were a stream."""
        inter = replace(self.inter, cell_gain=self.inter.cell_gain * LAYER_CELL_GAIN)
        alone = replace(self, layers=(), layer_splats=(), inter=inter)
        if self.layers:
            return [replace(alone, psnr=psnr) for psnr in self.layers]
        below = (0, *self.layer_splats)
        return [replace(alone, splats=total - fewer) for fewer, total in zip(below, self.layer_splats, strict=False)]

    @property
    def inter_iterations(self) -> int:
        """The evaluations of a P-frame, beside those of its motion field."""
        return self.inter.evaluations

    def most_splats(self, width: int, height: int) -> int:
        """Maximum number of splats of a frame of this size."""
        if self.layer_splats:
            return self.with_splats(self.layer_splats[-1]).splat_count(width, height)
        if self.layers:
            return replace(self, layers=(), psnr=self.layers[-1]).most_splats(width, height)
        if self.splats is None and width * height < PIXELS_PER_SPLAT:
            return width * height
        return super().most_splats(width, height)

    def splat_count(self, width: int, height: int) -> int:
        """N for a frame of this size: by default one for PIXELS_PER_SPLAT pixels, and for each where they are fewer."""
        if self.splats is None and width * height < PIXELS_PER_SPLAT:
            return width * height
        return super().splat_count(width, height)

    def told_splats(self, width: int, height: int) -> int | None:
        """N for a frame of this size; None where it follows from a quality or another goal."""
        return None if self.layers else super().told_splats(width, height)

    def counted_splats(self, width: int, height: int) -> int:
        """As `Settings.counted_splats`: a P-frame counts what it removes and what it adds, up to twice N."""
        return min(2 * self.most_splats(width, height), MAX_SPLATS)
