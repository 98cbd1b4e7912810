"""Settings that both profiles have, and the way to the presets of each."""

from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, Final, Literal, Self

from gsvc_base.checks import check_range, check_types
from gsvc_base.errors import UsageError
from gsvc_ref import plugins
from gsvc_ref.bitstream import LEVELS
from gsvc_ref.encoder.effects import Effects
from gsvc_ref.encoder.settings.detection import DetectionSettings
from gsvc_ref.rendering import Precision
from gsvc_ref.rendering.evaluator import check_device
from gsvc_ref.rendering.precision import check_precision

KeyFrames = Literal["auto"] | int | tuple[int, ...]
ProfileName = Literal["main", "paper"]

PIXELS_PER_SPLAT: Final = 40
"""The default number of splats is one for this many pixels."""

MIN_PIXELS_PER_SPLAT: Final = 6
"""Constant quality stops adding splats at one for this many pixels: they then cost more than the pixels."""

MAX_SPLATS: Final = max(level.splats for level in LEVELS.values())
"""No level allows more splats in a frame."""

MAX_FRAMES: Final = 2**32 - 1
"""Maximum number of frames of a stream."""

GOALS: Final = {"bitrate": (1, 1e12), "size": (1, 2**53), "mean_psnr": (1, 100), "vmaf": (1, 100)}
"""The goals of a whole clip, each with its limits, of which an encode has one at most."""


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
    device
        What computes the losses and gradients of splats: ``cpu``, or another that is installed, such as ``cuda``. Its
        arithmetic has other last bits, so that it makes another stream of the same quality.
    lane_count
        Lanes of the entropy coder: as many as a decoder can use at once. Profile `main` has up to 4096, and
        ``by-size`` as its default: as many as cost 0.6 % of the bits; ``by-size:2%`` says another share. Profile
        `paper` has up to 64, and 1 by default.
    index, checksums
        The stream's: an index for seeking, a checksum of each frame's parameters.
    paced
        Keep the limits of a second (spec.md section 5), so that a live player can promise to keep pace: an I-frame at
        least every four seconds, and an error where a second has too much.
    profile
        The coding tools of the stream: ``main`` (spec.md section 15), or ``paper``.
    """

    BY_PROFILE: ClassVar[dict[str, "type[Settings]"]] = {}
    """The settings of each profile by its name: the classes that are derived from this one."""
    profile: ClassVar[ProfileName]
    PRESETS: ClassVar[tuple[str, ...]]
    MOST_LANES: ClassVar[int]
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
    device: str = plugins.CPU
    lane_count: int | str = 1
    index: bool = True
    checksums: bool = False
    paced: bool = False

    def __init_subclass__(cls) -> None:
        Settings.BY_PROFILE[cls.profile] = cls

    def __post_init__(self) -> None:
        check_types(self)
        check_range("splats", self.splats, 1, 1 << 22)
        check_range("psnr", self.psnr, 1, 100)
        for name, (low, high) in GOALS.items():
            check_range(name, getattr(self, name), low, high)
        check_range("threads", self.threads, 1, 1024)
        check_precision(self.precision, ("fast", "deterministic"))
        check_device(self.device, self.precision)
        check_range("seed", self.seed, 0, 2**63 - 1)
        if isinstance(self.lane_count, int):
            check_range("lane_count", self.lane_count, 1, self.MOST_LANES)
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
        return cls._of_preset("quick", profile).quick(**overrides)

    @classmethod
    def slow(cls, profile: str = "main", **overrides: Any) -> "Settings":
        """Profile `main`, searched for longer: fewer bits for the same quality."""
        return cls._of_preset("slow", profile).slow(**overrides)

    @classmethod
    def paper(cls, profile: str = "paper", **overrides: Any) -> "Settings":
        """The paper's settings: random start, Adan at 1e-3 for everything, 50,000 iterations or converged."""
        return cls._of_preset("paper", profile).paper(**overrides)

    @classmethod
    def _of_preset(cls, preset: str, profile: str) -> "type[Settings]":
        """The settings of a profile that has this preset."""
        kind = Settings.BY_PROFILE.get(profile)
        if kind is None:
            raise UsageError(f"profile is {profile!r}; it must be 'main' or 'paper'")
        if preset not in kind.PRESETS:
            (other,) = (name for name, one in Settings.BY_PROFILE.items() if preset in one.PRESETS)
            there = " and ".join(kind.PRESETS)
            raise UsageError(f"preset {preset} writes profile {other} only; of profile {profile} are {there}")
        return kind

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
            elsewhere = [kind for kind in Settings.BY_PROFILE.values() if name in kind._names()]
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
    def computing(self) -> dict[str, Any]:
        """Where and how losses and gradients are computed: arguments of `Objective` and `SampledObjective`."""
        return {"threads": self.threads, "precision": self.precision, "device": self.device}

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
