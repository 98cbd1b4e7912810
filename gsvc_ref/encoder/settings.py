"""Everything that can be chosen about an encode, and the presets.

A stream is of profile `main` (spec.md section 15) or `paper`. `Settings` are what both have, `MainSettings` and
`PaperSettings` add what one has alone. Presets `quick` and `slow` write `main`; `paper` is what the paper did, in
profile `paper`, which `quick` can write as well.
"""

from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from numbers import Integral
from typing import Any, ClassVar, Final, Literal, Self, TypeVar

from gsvc_base.checks import check_range, check_types
from gsvc_base.errors import UsageError
from gsvc_ref.bitstream import LEVELS
from gsvc_ref.bitstream.header import MOST_LAYERS
from gsvc_ref.encoder.effects import Effects
from gsvc_ref.encoder.frame_settings import ELEMENTS, DetectionSettings, FrameSettings, QuickFit
from gsvc_ref.encoder.main.settings import InterSettings, IntraSettings
from gsvc_ref.main.tables import QUANTIZERS
from gsvc_ref.paper import RvqSettings
from gsvc_ref.rendering import Precision
from gsvc_ref.rendering.precision import check_precision
from gsvc_ref.training import (
    MAX_ITERATIONS,
    AdanSettings,
    BlockSettings,
    Cosine,
    FitSettings,
    PruningSchedule,
    Rates,
)

KeyFrames = Literal["auto"] | int | tuple[int, ...]
ProfileName = Literal["main", "paper"]

PIXELS_PER_SPLAT: Final = 40
"""The default number of splats is one for this many pixels."""

MIN_PIXELS_PER_SPLAT: Final = 6
"""Constant quality stops adding splats at one for this many pixels: they then cost more than the pixels."""

MAX_SPLATS: Final = max(level.splats for level in LEVELS.values())
"""No level allows more splats in a frame."""

LAYER_CELL_GAIN: Final = 3.0
"""By how much finer cells of the motion field are preferred in a layer: what is above it needs them too; measured."""

MAX_FRAMES: Final = 2**32 - 1
"""Maximum number of frames of a stream."""

GOALS: Final = {"bitrate": (1, 1e12), "size": (1, 2**53), "mean_psnr": (1, 100), "vmaf": (1, 100)}
"""The goals of a whole clip, each with its limits, of which an encode has one at most."""

FEW_STEPS: Final = FitSettings(
    iterations=30, schedule=Cosine(steps=30, final=0.05), learn_pixels=True, relative_steps=True,
    optimizer=AdanSettings(beta1=0.9, beta2=0.92, beta3=0.99), convergence=None, pruning=None,
)  # fmt: skip
"""A short fit by Adan with well-sized steps: preset `quick` pre-trains and fine-tunes with it."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of an encode that both profiles have; make them with `quick`, `slow` or `paper`, others with `with_`.

    Attributes
    ----------
    preset
        The preset that it came from.
    detection
        How key frames are found when `key_frames` is ``auto``.
    splats
        N, the number of splats of a frame (of profile `main`: of an I-frame, about); with `psnr` their maximum number.
        None: one for PIXELS_PER_SPLAT pixels, and with a quality or another goal up to one for MIN_PIXELS_PER_SPLAT.
    psnr
        Constant quality: the least PSNR in dB of each decoded frame; None: constant rate.
    bitrate, size
        Bits per second of the whole stream, or its bytes, which `encode` comes to within 3 % of by encoding at least
        twice (`gsvc_ref.encoder.targets`); `splats` is then the most of a frame. None: the size is what comes out.
    mean_psnr, vmaf
        The mean PSNR in dB of all frames, or their mean VMAF, which is reached with as few splats as are found to do,
        by encoding several times. None: the same.
    key_frames
        ``auto``, every k frames, or the listed frame numbers (0 always is one).
    low_latency
        Decide key frames from the past alone.
    effects
        The steps that are taken on every frame, and those only where the scene calls for them; presets and `with_` take
        a text of `Effects.parse` as well.
    decisions
        Write what was decided about each frame, and why, as an ancillary chunk, which decoders skip.
    frames
        Half-open range of source frames to encode.
    seed
        Seed of all randomness.
    threads
        Threads of the kernels; None: all. The bytes do not depend on it.
    precision
        The renderer's: ``fast``, or ``deterministic``, with which the bytes do not depend on the CPU either.
    lane_count, index, checksums
        The stream's: rANS lanes, an index for seeking, a checksum of each frame's parameters.
    paced
        Keep the limits of a second (spec.md section 5), so that a live player can promise to keep pace: an I-frame at
        least every four seconds, and an error where a second has too much.
    profile
        The coding tools of the stream: ``main`` (spec.md section 15), or ``paper``.
    """

    profile: ClassVar[ProfileName]
    PRESETS: ClassVar[tuple[str, ...]]
    ELSEWHERE: ClassVar[str]
    """What is said of a setting that only this profile has, where the stream is of the other."""
    OTHER_NAMES: ClassVar[tuple[str, ...]] = ()
    """Names that `with_` takes and that are no fields."""

    preset: str
    detection: DetectionSettings = field(default_factory=DetectionSettings)
    splats: int | None = None
    psnr: float | None = None
    bitrate: float | None = None
    size: int | None = None
    mean_psnr: float | None = None
    vmaf: float | None = None
    key_frames: KeyFrames = "auto"
    low_latency: bool = False
    effects: Effects = field(default_factory=Effects)
    decisions: bool = True
    frames: tuple[int, int | None] = (0, None)
    seed: int = 0
    threads: int | None = None
    precision: Precision = "fast"
    lane_count: int = 1
    index: bool = True
    checksums: bool = False
    paced: bool = False

    def __post_init__(self) -> None:
        check_types(self)
        check_range("splats", self.splats, 1, 1 << 22)
        check_range("psnr", self.psnr, 1, 100)
        for name, (low, high) in GOALS.items():
            check_range(name, getattr(self, name), low, high)
        check_range("threads", self.threads, 1, 1024)
        check_precision(self.precision, ("fast", "deterministic"))
        check_range("seed", self.seed, 0, 2**63 - 1)
        check_range("lane_count", self.lane_count, 1, 64)
        start, stop = self.frames
        if not 0 <= start < (MAX_FRAMES if stop is None else min(stop, MAX_FRAMES)):
            raise UsageError(f"frames is {start}:{stop}; it must be A:B with 0 <= A < B, and A below {MAX_FRAMES}")
        if isinstance(self.key_frames, int):
            check_range("key_frames", self.key_frames, 1, MAX_FRAMES)
        elif isinstance(self.key_frames, tuple) and any(number < 0 for number in self.key_frames):
            raise UsageError(f"key_frames lists {min(self.key_frames)}; frame numbers begin at 0")
        if self.goal is not None:
            first, *others = [name for name in (*GOALS, *self._qualities()) if getattr(self, name) not in (None, ())]
            if others:
                raise UsageError(f"{first} is a goal of the whole clip, and {others[0]} is another: give one of them")

    @classmethod
    def _qualities(cls) -> tuple[str, ...]:
        """The names of settings that say how good each frame is to be."""
        return ("psnr",)

    @classmethod
    def quick(cls, profile: str = "main", **overrides: Any) -> "Settings":
        """The default: profile `main`, or, with ``profile="paper"``, the paper's coding by a shorter way.

        That way is the L-BFGS of profile `main`, and a short fine-tuning with well-sized steps.
        """
        return _of_profile("quick", profile, MainSettings, PaperSettings).quick(**overrides)

    @classmethod
    def slow(cls, profile: str = "main", **overrides: Any) -> "MainSettings":
        """Profile `main`, searched for longer: fewer bits for the same quality."""
        _of_profile("slow", profile, MainSettings)
        longer: dict[str, Any] = {"intra": IntraSettings.slow(), "inter": InterSettings.slow()}
        return replace(MainSettings.quick(), preset="slow", **longer).with_(**overrides)

    @classmethod
    def paper(cls, profile: str = "paper", **overrides: Any) -> "PaperSettings":
        """The paper's settings: random start, Adan at 1e-3 for everything, 50,000 iterations or converged.

        Where the paper is silent the values of its public code are taken; the number of fine-tuning iterations, which
        neither states, is a tenth of the fit's.
        """
        _of_profile("paper", profile, PaperSettings)
        tune = FitSettings(iterations=5_000, pruning=None)
        intra = FrameSettings(FitSettings(), tune, BlockSettings())
        inter = FrameSettings(FitSettings(pruning=PruningSchedule.inter()), tune, BlockSettings())
        effects = Effects.parse("all")
        return PaperSettings(preset="paper", intra=intra, inter=inter, effects=effects).with_(**overrides)

    def with_(self, **changes: Any) -> Self:
        """A copy with other settings by name, as the presets take them.

        A name is that of a field, except `preset`. Profile `paper` has four more, which reach into both `intra` and
        `inter`, where None changes nothing. `iterations` is the number of the fit of an I-frame; all other fits of
        frames follow in proportion, but not `detection.iterations`, since losses after other numbers of iterations
        would be other statistics. `cholesky_bits`, `color_stages` and `color_codewords` are elements of the sequence
        header.
        """
        if (profile := changes.pop("profile", self.profile)) != self.profile:
            raise UsageError(
                f"the settings are of profile {self.profile}: make others, such as Settings.quick(profile={profile!r})"
            )
        names = self._names()
        for name in changes.keys() - set(names):
            elsewhere = [kind for kind in (MainSettings, PaperSettings) if name in kind._names()]
            if elsewhere and changes.pop(name) is not None:
                raise UsageError(elsewhere[0].ELSEWHERE.format(name))
        if unknown := changes.keys() - set(names):
            raise UsageError(f"unknown settings {', '.join(sorted(unknown))}; there are {', '.join(names)}")
        if isinstance(changes.get("effects"), str):
            changes["effects"] = Effects.parse(changes["effects"])
        return replace(self, **changes)

    @classmethod
    def _names(cls) -> tuple[str, ...]:
        """The names that `with_` takes."""
        return (*(one.name for one in fields(cls) if one.name != "preset"), *cls.OTHER_NAMES)

    @property
    def goal(self) -> str | None:
        """The name of the goal of GOALS that is given, if one is."""
        return next((name for name in GOALS if getattr(self, name) is not None), None)

    @property
    def has_quality(self) -> bool:
        """Whether frames have a quality that says how many splats they take."""
        return self.psnr is not None

    def with_splats(self, splats: int) -> Self:
        """A copy with N splats a frame, and nothing else that says how good it is to be."""
        nothing: dict[str, Any] = {one.name: one.default for one in fields(self) if one.name in self._qualities()}
        return replace(self, **nothing, splats=splats)

    @property
    def layer_count(self) -> int:
        """The number of layers of a frame, with the base."""
        return 1

    @property
    def inter_iterations(self) -> int:
        """The iterations of a P-frame of the profile, as far as they are known beforehand."""
        raise NotImplementedError

    def most_splats(self, width: int, height: int) -> int:
        """Maximum number of splats of a frame of this size."""
        if self.splats is None and (self.has_quality or self.goal is not None):
            return max(1, width * height // MIN_PIXELS_PER_SPLAT)
        return self.splat_count(width, height)

    def told_splats(self, width: int, height: int) -> int | None:
        """N for a frame of this size; None where it follows from a quality or another goal."""
        if self.psnr is not None or (self.splats is None and (self.has_quality or self.goal is not None)):
            return None
        return self.most_splats(width, height)

    def counted_splats(self, width: int, height: int) -> int:
        """The maximum number of splats that the level counts in a frame of this size (R-5-2)."""
        raise NotImplementedError

    def splat_count(self, width: int, height: int) -> int:
        """N for a frame of this size."""
        if self.splats is None:
            return max(1, width * height // PIXELS_PER_SPLAT)
        if self.splats > width * height:
            raise UsageError(
                f"{self.splats} splats are more than the {width * height} pixels of a frame of {width}x{height}; "
                f"give fewer (the default is one for {PIXELS_PER_SPLAT} pixels)"
            )
        return self.splats


@dataclass(frozen=True, kw_only=True)
class MainSettings(Settings):
    """The settings of an encode of profile `main`: those of `Settings`, and these."""

    profile: ClassVar[ProfileName] = "main"
    PRESETS: ClassVar[tuple[str, ...]] = ("quick", "slow")
    ELSEWHERE: ClassVar[str] = "{} is a setting of profile main; profile paper has splats and psnr for its quality"

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
        _of_profile("quick", profile, cls)
        return cls(preset="quick", detection=_quick_detection()).with_(**overrides)

    def _check_layers(self) -> None:
        for name, values, highest in (("layers", self.layers, 100), ("layer_splats", self.layer_splats, 1 << 22)):
            if not values:
                continue
            for value in values:
                check_range(name, value, 1, highest)
            if len(values) > MOST_LAYERS or any(a >= b for a, b in pairwise(values)):
                raise UsageError(f"{name} is {values}; give at most {MOST_LAYERS} values that grow")
            others = [other for other in ("splats", "psnr", "quality") if getattr(self, other) is not None]
            others += ["layers"] if name == "layer_splats" and self.layers else []
            if others:
                raise UsageError(f"{name} says how good each layer is, and so does {others[0]}; give one of them")

    @property
    def has_quality(self) -> bool:
        """Whether frames have a quality that says how many splats they take."""
        return self.psnr is not None or self.quality is not None

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


@dataclass(frozen=True, kw_only=True)
class PaperSettings(Settings):
    """The settings of an encode of profile `paper`: those of `Settings`, and these."""

    profile: ClassVar[ProfileName] = "paper"
    PRESETS: ClassVar[tuple[str, ...]] = ("quick", "paper")
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
        if (b := self.intra.quantizer.cholesky_bits) != self.inter.quantizer.cholesky_bits:
            raise UsageError(f"cholesky_bits is {b} for I-frames and another for P-frames; a stream has one for both")

    @classmethod
    def quick(cls, profile: str = "paper", **overrides: Any) -> "PaperSettings":
        """Preset `quick` of profile `paper`."""
        _of_profile("quick", profile, cls)
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
        return cls(preset="quick", intra=intra, inter=inter, detection=_quick_detection()).with_(**overrides)

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


def _quick_detection() -> DetectionSettings:
    """Preset `quick`, in both profiles: short fits of small pictures, by Adan."""
    return DetectionSettings(
        iterations=30, splats=200, longest_side=96, rule="robust", guard_ratio=1.5, start="image",
        intra_fit=FEW_STEPS.with_(rates=Rates(1.0, 0.5, 0.05), schedule=Cosine(steps=30, final=0.02)),
        inter_fit=FEW_STEPS.with_(rates=Rates(0.2, 0.08, 0.008)),
    )  # fmt: skip


SettingsT = TypeVar("SettingsT", bound=Settings)


def _of_profile(preset: str, profile: str, *kinds: type[SettingsT]) -> type[SettingsT]:
    """The settings of a profile that a preset has."""
    for kind in kinds:
        if kind.profile == profile:
            return kind
    for other in (MainSettings, PaperSettings):
        if other.profile == profile:
            raise UsageError(
                f"preset {preset} writes profile {kinds[0].profile} only; of profile {profile} are "
                f"{' and '.join(other.PRESETS)}"
            )
    raise UsageError(f"profile is {profile!r}; it must be 'main' or 'paper'")


def _whole(name: str, value: Any, low: int, high: int) -> int:
    """The value of a name that reaches into settings of frames as a Python integer."""
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise UsageError(f"{name} is {value!r}; it must be a whole number in {low}..{high}")
    check_range(name, int(value), low, high)
    return int(value)
