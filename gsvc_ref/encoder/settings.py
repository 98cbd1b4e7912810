"""Everything that can be chosen about an encode, and the presets.

A stream is of profile `main` (spec.md section 15) or `paper`, and each has settings that the other has not. Presets
`quick` and `slow` write `main`; `paper` is what the paper did, in profile `paper`, which `quick` can write as well.
"""

from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from numbers import Integral
from typing import Any, Final, Literal, Self

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

REACHING: Final = {"iterations": (1, MAX_ITERATIONS), **ELEMENTS}
"""The limits of the names of `Settings.with_` that are no fields: they reach into `intra` and `inter`."""

GOALS: Final = {"bitrate": (1, 1e12), "size": (1, 2**53), "mean_psnr": (1, 100), "vmaf": (1, 100)}
"""The goals of a whole clip, each with its limits, of which an encode has one at most."""

OF_ONE_PROFILE: Final[dict[str, ProfileName]] = {
    **dict.fromkeys((*REACHING, "entropy_precision"), "paper"),
    **dict.fromkeys(("quality", "layers", "layer_splats", "main_intra", "main_inter"), "main"),
}
"""Settings that mean something in one profile alone."""

PROFILES_OF: Final[dict[str, tuple[ProfileName, ...]]] = {
    "quick": ("main", "paper"), "slow": ("main",), "paper": ("paper",),
}  # fmt: skip
"""The profiles of each preset, that which it writes by default first."""


@dataclass(frozen=True)
class Settings:
    """All settings of an encode; make them with `quick`, `slow` or `paper`, and others with `with_`.

    Attributes
    ----------
    preset
        The preset that it came from.
    intra, inter
        How I- and P-frames of profile `paper` are made. In profile `main` only `detection` uses their fits.
    main_intra, main_inter
        How I- and P-frames of profile `main` are made.
    detection
        How key frames are found when `key_frames` is ``auto``.
    splats
        N, the number of splats of a frame (of profile `main`: of an I-frame, about); with `psnr` their maximum number.
        None: one for PIXELS_PER_SPLAT pixels, and with `psnr` or `quality` up to one for MIN_PIXELS_PER_SPLAT.
    psnr
        Constant quality: the least PSNR in dB of each decoded frame; None: constant rate.
    bitrate, size
        Bits per second of the whole stream, or its bytes, which `encode` comes to within 3 % of by encoding at least
        twice (`gsvc_tools.targets.targets`); `splats` is then the most of a frame. None: the size is what comes out.
    mean_psnr, vmaf
        The mean PSNR in dB of all frames, or their mean VMAF, which is reached with as few splats as are found to do,
        by encoding several times. None: the same.
    quality
        Profile `main`: the step D of all codes, from 0, the coarsest, to 79, the finest; 8 more halve D. Frames have
        `quantizer` 79 - `quality`. Without `splats`, as many splats go with it as are worth their bits at this D.
        None: D follows from the number of splats.
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
    lane_count, entropy_precision, index, checksums
        The stream's: rANS lanes, bits of its frequencies, an index for seeking, a checksum of each frame's parameters.
    paced
        Keep the limits of a second (spec.md section 5), so that a live player can promise to keep pace: an I-frame at
        least every four seconds, and an error where a second has too much.
    profile
        The coding tools of the stream: ``main`` (spec.md section 15), or ``paper``.
    layers
        Profile `main`: the PSNR in dB with the base, with layer 1, ..., growing. Empty: no layers, unless
        `layer_splats` says some.
    layer_splats
        Profile `main`: the number of splats of a frame with the base, with layer 1, ..., growing.
    """

    preset: str
    intra: FrameSettings
    inter: FrameSettings
    detection: DetectionSettings = field(default_factory=DetectionSettings)
    main_intra: IntraSettings = field(default_factory=IntraSettings)
    main_inter: InterSettings = field(default_factory=InterSettings)
    splats: int | None = None
    psnr: float | None = None
    bitrate: float | None = None
    size: int | None = None
    mean_psnr: float | None = None
    vmaf: float | None = None
    quality: int | None = None
    key_frames: KeyFrames = "auto"
    low_latency: bool = False
    effects: Effects = field(default_factory=Effects)
    decisions: bool = True
    frames: tuple[int, int | None] = (0, None)
    seed: int = 0
    threads: int | None = None
    precision: Precision = "fast"
    lane_count: int = 1
    entropy_precision: int = 14
    index: bool = True
    checksums: bool = False
    paced: bool = False
    profile: ProfileName = "main"
    layers: tuple[float, ...] = ()
    layer_splats: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        check_types(self)
        check_range("splats", self.splats, 1, 1 << 22)
        check_range("psnr", self.psnr, 1, 100)
        check_range("quality", self.quality, 0, QUANTIZERS - 1)
        self._check_goals()
        check_range("threads", self.threads, 1, 1024)
        check_precision(self.precision, ("fast", "deterministic"))
        check_range("seed", self.seed, 0, 2**63 - 1)
        check_range("lane_count", self.lane_count, 1, 64)
        check_range("entropy_precision", self.entropy_precision, 12, 16)
        if (b := self.intra.quantizer.cholesky_bits) != self.inter.quantizer.cholesky_bits:
            raise UsageError(f"cholesky_bits is {b} for I-frames and another for P-frames; a stream has one for both")
        self._check_layers()
        start, stop = self.frames
        if not 0 <= start < (MAX_FRAMES if stop is None else min(stop, MAX_FRAMES)):
            raise UsageError(f"frames is {start}:{stop}; it must be A:B with 0 <= A < B, and A below {MAX_FRAMES}")
        if isinstance(self.key_frames, int):
            check_range("key_frames", self.key_frames, 1, MAX_FRAMES)
        elif isinstance(self.key_frames, tuple) and any(number < 0 for number in self.key_frames):
            raise UsageError(f"key_frames lists {min(self.key_frames)}; frame numbers begin at 0")
        self._check_profile()

    def _check_profile(self) -> None:
        """Refuse what the profile does not have."""
        profiles = PROFILES_OF.get(self.preset, (self.profile,))
        if self.profile not in profiles:
            presets = " and ".join(name for name, those in PROFILES_OF.items() if self.profile in those)
            raise UsageError(
                f"preset {self.preset} writes profile {profiles[0]} only; of profile {self.profile} are {presets}"
            )
        for name in ("quality", "layers", "layer_splats"):
            if getattr(self, name) not in (None, ()) and self.profile != "main":
                raise _of_other_profile(name)
        if self.quality is not None and self.psnr is not None:
            raise UsageError(
                "quality says how fine the codes are and psnr how close the picture comes; give one of them"
            )
        if self.profile == "main":
            self.effects.check_main()

    @classmethod
    def paper(cls, **overrides: Any) -> Self:
        """The paper's settings: random start, Adan at 1e-3 for everything, 50,000 iterations or converged.

        Where the paper is silent the values of its public code are taken; the number of fine-tuning iterations, which
        neither states, is a tenth of the fit's.
        """
        tune = FitSettings(iterations=5_000, pruning=None)
        intra = FrameSettings(FitSettings(), tune, BlockSettings())
        inter = FrameSettings(FitSettings(pruning=PruningSchedule.inter()), tune, BlockSettings())
        return cls("paper", intra, inter, effects=Effects.parse("all"), profile="paper").with_(**overrides)

    @classmethod
    def quick(cls, **overrides: Any) -> Self:
        """The default: profile `main`, or, with ``profile="paper"``, the paper's coding by a shorter way.

        That way is the L-BFGS of profile `main`, and a short fine-tuning with well-sized steps.
        """
        few = FitSettings(
            iterations=30, schedule=Cosine(steps=30, final=0.05), learn_pixels=True, relative_steps=True,
            optimizer=AdanSettings(beta1=0.9, beta2=0.92, beta3=0.99), convergence=None, pruning=None,
        )  # fmt: skip
        tune = few.with_(rates=Rates(0.01, 0.005, 0.001))
        intra = FrameSettings(
            fit=QuickFit(80),
            tune=tune,
            quantizer=BlockSettings(
                position_step=0.05,
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
        detection = DetectionSettings(
            iterations=30, splats=200, longest_side=96, rule="robust", guard_ratio=1.5, start="image",
            intra_fit=few.with_(rates=Rates(1.0, 0.5, 0.05), schedule=Cosine(steps=30, final=0.02)),
            inter_fit=few.with_(rates=Rates(0.2, 0.08, 0.008)),
        )  # fmt: skip
        return cls("quick", intra, inter, detection).with_(**overrides)

    @classmethod
    def slow(cls, **overrides: Any) -> Self:
        """Profile `main`, searched for longer: fewer bits for the same quality."""
        longer: dict[str, Any] = {"main_intra": IntraSettings.slow(), "main_inter": InterSettings.slow()}
        return replace(cls.quick(), preset="slow", **longer).with_(**overrides)

    def with_(self, **changes: Any) -> Self:
        """A copy with other settings by name, as the presets take them.

        A name is that of a field, except `preset`, or one of four that reach into both `intra` and `inter`, where None
        changes nothing. `iterations` is the number of the fit of an I-frame; all other fits of frames follow in
        proportion, but not `detection.iterations`, since losses after other numbers of iterations would be other
        statistics. `cholesky_bits`, `color_stages` and `color_codewords` are elements of the sequence header.
        All four are of profile `paper`.

        Raises
        ------
        UsageError
            A name is unknown, of the other profile, or a value out of its range.
        """
        profile = changes.get("profile", self.profile)
        for name, owner in OF_ONE_PROFILE.items():
            if changes.get(name) is not None and profile != owner:
                raise _of_other_profile(name)
        reaching = {name: changes.pop(name) for name in REACHING if name in changes}
        names = [field.name for field in fields(self) if field.name != "preset"]
        if unknown := changes.keys() - set(names):
            known = ", ".join((*names, *REACHING))
            raise UsageError(f"unknown settings {', '.join(sorted(unknown))}; there are {known}")
        if isinstance(changes.get("effects"), str):
            changes["effects"] = Effects.parse(changes["effects"])
        settings = replace(self, **changes)
        given = {name: _whole(name, value) for name, value in reaching.items() if value is not None}
        intra, inter = settings.intra, settings.inter
        if "iterations" in given:
            share = given.pop("iterations") / intra.fit.iterations
            intra, inter = intra.in_proportion(share), inter.in_proportion(share)
        if given:
            intra, inter = intra.with_(**given), inter.with_(**given)
        return replace(settings, intra=intra, inter=inter)

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

    def _check_goals(self) -> None:
        """Refuse more than one of the goals of a whole clip, or one beside another."""
        for name, (low, high) in GOALS.items():
            check_range(name, getattr(self, name), low, high)
        if self.goal is not None:
            names = (*GOALS, "psnr", "quality", "layers", "layer_splats")
            first, *others = [name for name in names if getattr(self, name) not in (None, ())]
            if others:
                raise UsageError(f"{first} is a goal of the whole clip, and {others[0]} is another: give one of them")

    @property
    def goal(self) -> str | None:
        """The name of the goal of GOALS that is given, if one is."""
        return next((name for name in GOALS if getattr(self, name) is not None), None)

    @property
    def layer_count(self) -> int:
        """The number of layers of a frame, with the base."""
        return max(len(self.layers), len(self.layer_splats), 1)

    def of_layers(self) -> list["Settings"]:
        """The settings of the base and of each layer above it, as of streams of their own."""
        inter = replace(self.main_inter, cell_gain=self.main_inter.cell_gain * LAYER_CELL_GAIN)
        alone = replace(self, layers=(), layer_splats=(), main_inter=inter)
        if self.layers:
            return [replace(alone, psnr=psnr) for psnr in self.layers]
        below = (0, *self.layer_splats)
        return [replace(alone, splats=total - fewer) for fewer, total in zip(below, self.layer_splats, strict=False)]

    @property
    def inter_iterations(self) -> int:
        """The iterations of a P-frame of the profile, as far as they are known beforehand."""
        return self.main_inter.evaluations if self.profile == "main" else self.inter.iterations

    def quantizer_elements(self) -> dict[str, Any]:
        """The elements of the sequence header that describe the quantisers and entropy coding of profile `paper`."""
        books = [kind.quantizer.colors.codewords for kind in (self.intra, self.inter)]
        return {
            "cholesky_bits": self.intra.quantizer.cholesky_bits,
            "color_stages": max(map(len, books)),
            "color_codewords": max(map(max, books)),
            "entropy_precision": self.entropy_precision,
            "lane_count": self.lane_count,
        }

    def most_splats(self, width: int, height: int) -> int:
        """Maximum number of splats of a frame of this size."""
        holds_quality = self.psnr is not None or self.quality is not None or self.layers or self.goal is not None
        if self.splats is None and holds_quality:
            return max(1, width * height // MIN_PIXELS_PER_SPLAT)
        if self.layer_splats:
            return replace(self, layer_splats=(), splats=self.layer_splats[-1]).splat_count(width, height)
        return self.splat_count(width, height)

    def told_splats(self, width: int, height: int) -> int | None:
        """N for a frame of this size; None where it follows from a quality or another goal."""
        if self.splats is None and (self.quality is not None or self.goal is not None):
            return None
        return None if self.psnr is not None or self.layers else self.most_splats(width, height)

    def counted_splats(self, width: int, height: int) -> int:
        """The maximum number of splats that the level counts in a frame of this size (R-5-2).

        P-frames of profile `paper` may pass N while they add before they prune. Those of `main` count what they remove
        and what they add, up to twice N.
        """
        most = self.most_splats(width, height)
        return min(most + (most if self.profile == "main" else most // 4), MAX_SPLATS)

    def splat_count(self, width: int, height: int) -> int:
        """N for a frame of this size.

        Raises
        ------
        UsageError
            More splats are asked for than the frame has pixels.
        """
        if self.splats is None:
            return max(1, width * height // PIXELS_PER_SPLAT)
        if self.splats > width * height:
            raise UsageError(
                f"{self.splats} splats are more than the {width * height} pixels of a frame of {width}x{height}; "
                f"give fewer (the default is one for {PIXELS_PER_SPLAT} pixels)"
            )
        return self.splats


def _of_other_profile(name: str) -> UsageError:
    """What is said of a setting that the profile chosen does not have."""
    if OF_ONE_PROFILE[name] == "main":
        return UsageError(f"{name} is a setting of profile main; profile paper has splats and psnr for its quality")
    return UsageError(
        f"{name} is a setting of profile paper, and the stream is of profile main: choose profile paper, or leave it "
        "out; main has the presets quick and slow"
    )


def _whole(name: str, value: Any) -> int:
    """The value of a name of REACHING as a Python integer."""
    low, high = REACHING[name]
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise UsageError(f"{name} is {value!r}; it must be a whole number in {low}..{high}")
    check_range(name, int(value), low, high)
    return int(value)
