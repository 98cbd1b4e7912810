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

SPLATS_OF_LAYERS: Final = {2: 1.5, 3: 1.4, 4: 1.8}
"""How many splats 2, 3 and 4 layers begin with for each of a single one that ends at about their PSNR.

On five clips of 5 frames two layers then had -0.7 to 0.5 dB more in -17 to 5 % more bytes; with 1 they lost 2 to 3 dB.
"""

MIDDLE_WEIGHT: Final = 0.2
"""What the error of a layer between the base and the topmost one weighs, if the base does not weigh more."""


BY_SIZE: Final = "by-size"
"""The `lane_count` with which lanes cost at most LANE_SHARE of the bits.

A frame may also spend what frames before it, from their I-frame on, left over, and stops where each of its lanes has
LANE_SYMBOLS / share symbols or fewer. So I-frames, which have many bits for a symbol, leave lanes to P-frames.
"""
LANE_SHARE: Final = Fraction(6, 1000)
LANE_SYMBOLS: Final = 3  # 500 a lane at LANE_SHARE

BITS_OF_LANE: Final = 9
"""What a lane costs: its first state is 8 bits longer on average than what it says, and groups have counts."""


def lane_share(text: str) -> Fraction:
    """The share of the bits that lanes may cost, of a `lane_count` ``by-size`` or, say, ``by-size:2%``."""
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
    # PSNR in dB with the base, with layer 1, ..., rising; or how many layers, with N splats, with half of them without
    # the topmost one, and so on; empty: none, or those of `layer_splats`
    layers: tuple[float, ...] | int = ()
    layer_splats: tuple[int, ...] = ()  # splats of a frame with the base, with layer 1, ..., rising
    # What the error of the base weighs against that of all layers, with `layer_splats`: the more, the fewer bits the
    # base takes for its PSNR, and the more all together. None: 0.15 of two layers, 0.1 of more
    layers_base: float | None = None

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
        return ("psnr", "quality", "layers", "layer_splats", "layers_base")

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
        for name, values, highest in (("layers", self.layer_goals, 100), ("layer_splats", self.layer_splats, 1 << 22)):
            for value in values:
                check_range(name, value, 1, highest)
            if len(values) > MAX_LAYERS or any(a >= b for a, b in pairwise(values)):
                raise UsageError(f"{name} is {values}; give at most {MAX_LAYERS} values that grow")
        if isinstance(self.layers, int):
            check_range("layers", self.layers, 1, MAX_LAYERS)
        given = [
            name for name in ("layer_splats", "layers", "psnr", "quality") if getattr(self, name) not in (None, ())
        ]
        if self.splats is not None and not isinstance(self.layers, int):
            given.append("splats")
        if given and given[0] in ("layers", "layer_splats") and len(given) > 1:
            raise UsageError(f"{given[0]} says how good each layer is, and so does {given[1]}; give one of them")
        if self.layers_base is not None:
            check_range("layers_base", self.layers_base, 0, 1)
            if self.layer_count == 1 or self.layer_goals or self.layers_base == 0:
                raise UsageError(
                    f"layers_base is {self.layers_base}; give more than 0, and layers by their number or layer_splats"
                )

    @property
    def has_quality(self) -> bool:
        """Whether frames have a quality that says how many splats they take."""
        return self.psnr is not None or self.quality is not None

    def max_lane_exponent(self, width: int, height: int) -> int:
        """That of the header of a stream; by size what the lowest level of such frames allows (R-5-11)."""
        if isinstance(self.lane_count, int):
            return self.lane_count.bit_length() - 1
        return LANE_EXPONENTS[level_for(width, height)]

    def lane_exponent(self, bits: int, symbols: int, left: int, most: int) -> int:
        """That of a frame with so many bits in one lane and so many symbols, up to `most`; `left` are bits for lanes.

        These are what the frames before it, from their I-frame on, left over (`lane_bits_left`).
        """
        if isinstance(self.lane_count, int):
            return most
        exponent, weight = 0, lane_share(self.lane_count) * symbols
        while exponent < most and weight > LANE_SYMBOLS << exponent:
            if self.lane_bits_left(bits, left, exponent + 1) < 0:
                break
            exponent += 1
        return exponent

    def lane_bits_left(self, bits: int, left: int, exponent: int) -> int:
        """What a frame with so many bits in one lane leaves to the next one, in 2^exponent lanes, in bits."""
        if isinstance(self.lane_count, int):
            return 0
        return left + int(lane_share(self.lane_count) * bits) - BITS_OF_LANE * ((1 << exponent) - 1)

    @property
    def layer_count(self) -> int:
        """The number of layers of a frame, with the base."""
        return self.layers if isinstance(self.layers, int) else max(len(self.layers), len(self.layer_splats), 1)

    @property
    def layer_goals(self) -> tuple[float, ...]:
        """The PSNR in dB that each layer has to hold, if it has."""
        return () if isinstance(self.layers, int) else self.layers

    @property
    def layer_weights(self) -> tuple[float, ...]:
        """What the error of each quality of an I-frame weighs, beside 1 of the topmost one."""
        base = self.layers_base or (0.15 if self.layer_count == 2 else 0.1)
        return base, *(self.layer_count - 2) * (max(base, MIDDLE_WEIGHT),), 1.0

    def of_layers(self, width: int, height: int) -> list["MainSettings"]:
        """The settings of the base and of each layer above it, as if each were a stream."""
        inter = replace(self.inter, cell_gain=self.inter.cell_gain * LAYER_CELL_GAIN)
        alone = replace(self, layers=(), layer_splats=(), layers_base=None, inter=inter)
        if self.layer_goals:
            return [replace(alone, psnr=psnr) for psnr in self.layer_goals]
        totals, count = self.layer_splats, self.layer_count
        if not totals:
            all_splats = self.most_splats(width, height)
            totals = tuple(max(layer + 1, all_splats >> (count - 1 - layer)) for layer in range(count))
        return [replace(alone, splats=total - fewer) for fewer, total in zip((0, *totals), totals, strict=False)]

    @property
    def inter_iterations(self) -> int:
        """The evaluations of a P-frame, beside those of its motion field."""
        return self.inter.evaluations

    def most_splats(self, width: int, height: int) -> int:
        """Maximum number of splats of a frame of this size."""
        if self.layer_splats:
            return self.with_splats(self.layer_splats[-1]).splat_count(width, height)
        if self.layer_goals:
            return replace(self, layers=(), psnr=self.layer_goals[-1]).most_splats(width, height)
        if self.splats is None and width * height < PIXELS_PER_SPLAT:
            return width * height
        return round(SPLATS_OF_LAYERS.get(self.layer_count, 1) * super().most_splats(width, height))

    def splat_count(self, width: int, height: int) -> int:
        """N for a frame of this size: by default one for PIXELS_PER_SPLAT pixels, and for each where they are fewer."""
        if self.splats is None and width * height < PIXELS_PER_SPLAT:
            return width * height
        return super().splat_count(width, height)

    def told_splats(self, width: int, height: int) -> int | None:
        """N for a frame of this size; None where it follows from a quality or another goal."""
        return None if self.layer_goals else super().told_splats(width, height)

    def counted_splats(self, width: int, height: int) -> int:
        """As `Settings.counted_splats`: a P-frame counts what it removes and what it adds, up to twice N."""
        return min(2 * self.most_splats(width, height), MAX_SPLATS)
