"""The type of each frame: a key frame (every k, listed, or found by DKS, paper section 3.6), predicted, repeated.

DKS pre-trains every frame twice. With `Effects.dks` at ``auto``, ours, a cheap measure comes first: the mean squared
difference d of two successive frames, reduced as for pre-training. No cut is where d is at most MIN_CHANGE of the
picture's variance, or within STANDS_OUT standard deviations of the mean of d over the window, without the frame itself
and the key frames found before it. Only a frame that stands out is pre-trained, from scratch and from the frame before;
it is a key frame if the second loss exceeds the first by the factor `guard_ratio`.
"""

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Final, Generic, NamedTuple, TypeVar

import numpy as np

from gsvc_base.arrays import F4, Frame
from gsvc_ref._jit import kernel
from gsvc_ref.encoder.key_frames import KeyFrameSelector
from gsvc_ref.encoder.log import OFF, Decision, percent
from gsvc_ref.encoder.pretraining import Pretraining
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.paper import FrameType
from gsvc_ref.training.reduction import reduced

FrameT = TypeVar("FrameT")
OnPretraining = Callable[[int], None]
"""Called with the number of each frame before it is looked at."""

MIN_CHANGE: Final = 0.01
"""A cut changes the picture by more than this fraction of its variance."""

STANDS_OUT: Final = 2.5
"""A cut changes the picture by more than the frames around it do, by this many standard deviations."""

MIN_VARIANCE: Final = 1e-4
"""Least variance, per pixel and summed over the channels, that changes are compared with: an even picture has none."""


@dataclass(frozen=True)
class TypedFrame(Generic[FrameT]):
    """A source frame, its type and why it has it, and the decisions about ``frames`` and ``dks``."""

    number: int
    frame: FrameT  # (H, W, 3) u1 or u2, or given splats
    type: FrameType
    reason: str
    decisions: tuple[Decision, ...] = ()


class _Judged(NamedTuple):
    """A frame, whether it is a key frame, and why."""

    number: int
    frame: Frame
    is_key: bool
    reason: str
    dks: Decision


def typed_frames(
    frames: Iterable[Frame], settings: Settings, peak: int, on_pretraining: OnPretraining | None = None
) -> Iterator[TypedFrame[Frame]]:
    """Give each frame its type, in order, holding back no more frames than the window of DKS needs."""
    before: Frame | None = None
    for number, frame, is_key, reason, dks in _with_key_frames(frames, settings, peak, on_pretraining):
        changed = 1.0 if before is None else _changed_pixels(before, frame) / frame[..., 0].size
        repeated = settings.effects.frames == "auto" and changed == 0
        if number == 0:
            kind: FrameType = "I"
            reason, why = "first frame", Decision("frames", True, "the first frame")
        elif is_key and settings.key_frames != "auto":  # asked for, so also where the picture repeats
            kind, why = "I", Decision("frames", True, "asked for")
        elif repeated:
            kind, reason = "R", "equal to the frame before"
            why = Decision("frames", False, reason, saved=settings.inter_iterations)
        else:
            kind, reason = ("I", reason) if is_key else ("P", "predicted")
            words = f"{percent(changed)} of the pixels differ from the frame before"
            if is_key:
                words = f"an I-frame: {reason}"
            elif settings.effects.frames == "all":
                words = "asked for"
            why = Decision("frames", True, words)
        yield TypedFrame(number, frame, kind, reason, (why, dks))
        before = frame


def with_i_frames(frames: Iterable[TypedFrame[Frame]], distance: int) -> Iterator[TypedFrame[Frame]]:
    """The frames, where an I-frame follows the one before after `distance` frames at most (R-5-8)."""
    last = 0
    for item in frames:
        frame = item
        if item.type != "I" and item.number - last >= distance:
            why = Decision("frames", True, "a paced stream needs an I-frame here")
            others = tuple(decision for decision in item.decisions if decision.effect != "frames")
            frame = replace(item, type="I", reason="paced", decisions=(why, *others))
        if frame.type == "I":
            last = frame.number
        yield frame


def _with_key_frames(
    frames: Iterable[Frame], settings: Settings, peak: int, on_pretraining: OnPretraining | None
) -> Iterator[_Judged]:
    key = settings.key_frames
    if key == "auto" and settings.effects.dks != "off":
        judge: _Everywhere | _WhereSuspected = (_Everywhere if settings.effects.dks == "all" else _WhereSuspected)(
            settings, peak
        )
        for number, frame in enumerate(frames):
            if on_pretraining:
                on_pretraining(number)
            yield from judge.push(number, frame)
        yield from judge.flush()
        return
    for number, frame in enumerate(frames):
        if isinstance(key, int):
            is_key, reason = number % key == 0, f"every {key} frames"
        else:
            is_key, reason = key != "auto" and number in key, "listed"
        dks = Decision("dks", False, "key frames are not looked for")
        if key == "auto":
            dks = Decision("dks", False, OFF, saved=_pretraining_steps(settings, number))
        yield _Judged(number, frame, is_key, reason, dks)


def _pretraining_steps(settings: Settings, number: int) -> int:
    """The iterations that pre-training every frame takes: from scratch and, but for the first, from the one before."""
    return settings.detection.iterations * (1 if number == 0 else 2)


class _Everywhere:
    """The paper's rule: every frame is pre-trained twice."""

    def __init__(self, settings: Settings, peak: int) -> None:
        self.settings, self.peak = settings, peak
        detection = settings.detection
        self.selector = KeyFrameSelector(
            window=detection.window,
            threshold=detection.threshold,
            rule=detection.rule,
            causal=settings.low_latency,
            guard_ratio=detection.guard_ratio,
        )
        self.pretraining = Pretraining(settings)
        self.waiting: deque[tuple[int, Frame, float | None, int, float]] = deque()

    def push(self, number: int, frame: Frame) -> Iterator[_Judged]:
        """Take a frame; the frames that can be decided now."""
        begin, before = time.perf_counter(), self.pretraining.iterations
        intra, inter = self.pretraining.losses(frame.astype(np.float32) / np.float32(self.peak))
        ratio = None if inter is None else _ratio(inter, intra)
        made = self.pretraining.iterations - before
        self.waiting.append((number, frame, ratio, made, time.perf_counter() - begin))
        yield from self._release(self.selector.push(intra, inter))

    def flush(self) -> Iterator[_Judged]:
        """The frames that wait, since no other follows."""
        yield from self._release(self.selector.flush())

    def _release(self, decisions: list[bool]) -> Iterator[_Judged]:
        for is_key in decisions:
            number, frame, ratio, made, seconds = self.waiting.popleft()
            why = "the first frame" if ratio is None else _verdict(is_key, ratio)
            dks = Decision("dks", True, why, iterations=made, seconds=seconds)
            yield _Judged(number, frame, is_key, "scene change", dks)


class _Seen(NamedTuple):
    """A frame, d, and the fraction of the picture's variance that d is."""

    number: int
    frame: Frame
    change: float
    share: float
    seconds: float


class _WhereSuspected:
    """Ours: only frames that a cheap measure suspects are pre-trained."""

    def __init__(self, settings: Settings, peak: int) -> None:
        self.settings, self.peak = settings, np.float32(peak)
        window = settings.detection.window
        self.look_ahead = 0 if settings.low_latency else window
        self.small: F4 | None = None
        self.before: Frame | None = None
        self.usual: deque[float | None] = deque(maxlen=window)  # d of the frames decided last; None for a key frame
        self.waiting: deque[_Seen] = deque()

    def push(self, number: int, frame: Frame) -> Iterator[_Judged]:
        """Take a frame; the one that can be decided now, if any."""
        begin = time.perf_counter()
        small = reduced(frame.astype(np.float32) / self.peak, self.settings.detection.longest_side)
        change = 0.0 if self.small is None else _mean_square(small - self.small)
        variance = _mean_square(small - small.mean(axis=(0, 1), dtype=np.float64).astype(np.float32))
        self.small = small
        share = change / max(variance, MIN_VARIANCE)
        self.waiting.append(_Seen(number, frame, change, share, time.perf_counter() - begin))
        if number == 0 or len(self.waiting) > self.look_ahead:
            yield self._decide()

    def flush(self) -> Iterator[_Judged]:
        """The frames that wait, since no other follows."""
        while self.waiting:
            yield self._decide()

    def _decide(self) -> _Judged:
        seen = self.waiting.popleft()
        begin = time.perf_counter()
        steps = _pretraining_steps(self.settings, seen.number)
        others = [change for change in self.usual if change is not None] + [later.change for later in self.waiting]
        is_key = False
        if seen.number == 0:
            is_key, dks = True, Decision("dks", False, "the first frame", saved=steps)
        elif seen.share <= MIN_CHANGE:
            why = f"no cut: the picture changes by {100 * seen.share:.1f} % of its variance"
            dks = Decision("dks", False, why, saved=steps)
        elif not _stands_out(seen.change, others):
            dks = Decision("dks", False, "no cut: the picture changes no more than around it", saved=steps)
        else:
            ratio, made = self._pretrained(seen.frame)
            is_key = ratio > self.settings.detection.guard_ratio
            dks = Decision("dks", True, _verdict(is_key, ratio), iterations=made)
        if seen.number:
            self.usual.append(None if is_key else seen.change)
        self.before = seen.frame
        dks = replace(dks, seconds=seen.seconds + time.perf_counter() - begin)
        return _Judged(seen.number, seen.frame, is_key, "scene change", dks)

    def _pretrained(self, frame: Frame) -> tuple[float, int]:
        """The loss from the frame before over that from scratch, and the iterations that both took."""
        assert self.before is not None
        pretraining = Pretraining(self.settings)
        for picture in (self.before, frame):
            intra, inter = pretraining.losses(picture.astype(np.float32) / self.peak)
        assert inter is not None
        return _ratio(inter, intra), pretraining.iterations


def _verdict(is_key: bool, ratio: float) -> str:
    return f"{'a' if is_key else 'no'} cut: predicted with {ratio:,.1f} times the loss of a fit from scratch"


def _ratio(inter: float, intra: float) -> float:
    """The quotient of both losses, at most a million, as where a black frame leaves no loss from scratch."""
    return min(inter / max(intra, 1e-12), 1e6)


def _mean_square(values: F4) -> float:
    """The mean over the pixels of the sum over the channels of squares."""
    return float(np.square(values, dtype=np.float64).sum() / (values.shape[0] * values.shape[1]))


def _stands_out(change: float, others: list[float]) -> bool:
    """Whether a change exceeds the mean of others by more than STANDS_OUT standard deviations; alone it does."""
    return not others or change > float(np.mean(others)) + STANDS_OUT * float(np.std(others))


@kernel()
def _changed_pixels(before: Frame, now: Frame) -> int:
    """The number of pixels at which two frames (H, W, 3) differ."""
    height, width, channels = now.shape
    changed = 0
    for y in range(height):
        for x in range(width):
            differs = False
            for c in range(channels):
                differs |= before[y, x, c] != now[y, x, c]
            changed += int(differs)
    return changed
