"""Which frames are key frames: every k, listed, or found by pre-training frames twice (DKS, paper section 3.6).

The paper pre-trains every frame. With `Effects.dks` at ``auto``, ours, a cheap measure comes first: the mean squared
difference d of two successive frames, reduced as for pre-training. No cut is where d is at most MIN_CHANGE of the
picture's variance, or within STANDS_OUT standard deviations of the mean of d over the window, without the frame itself
and the key frames found before it. Only a frame that stands out is pre-trained, from scratch and from the frame before;
it is a key frame if the second loss exceeds the first by the factor `guard_ratio`.
"""

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gsvc_ref._jit import kernel
from gsvc_ref.encoder.decisions import Decision, decision
from gsvc_ref.encoder.key_frames import KeyFrameSelector
from gsvc_ref.encoder.settings import FrameSettings, Settings
from gsvc_ref.reconstruction import FrameType
from gsvc_ref.rendering import Objective
from gsvc_ref.splats import F4, Splats
from gsvc_ref.training import KEPT_WEIGHT, NEW, Population, fit, image_start, random_splats, uniform_numbers

Frame = NDArray[np.unsignedinteger[Any]]
OnPretraining = Callable[[int], None]
"""Called with the number of each frame before it is looked at."""

MIN_CHANGE: Final = 0.01
"""A cut changes the picture by more than this fraction of its variance."""

STANDS_OUT: Final = 2.5
"""A cut changes the picture by more than the frames around it do, by this many standard deviations."""

MIN_VARIANCE: Final = 1e-4
"""Of a picture, per pixel and summed over the channels: an even one has none that changes could be compared with."""


@dataclass(frozen=True)
class TypedFrame:
    """A source frame (H, W, 3) u1 or u2 with its number, its type, the reason for it, and what was decided on the way.

    The decisions are those about ``dks`` and, for frames that are repeated, ``frames``.
    """

    number: int
    frame: Frame
    type: FrameType
    reason: str
    decisions: tuple[Decision, ...] = ()


class _Judged(NamedTuple):
    """A frame, whether it is a key frame, and why."""

    number: int
    frame: Frame
    is_key: bool
    reason: str
    decision: Decision


def typed_frames(
    frames: Iterable[Frame], settings: Settings, peak: int, on_pretraining: OnPretraining | None = None
) -> Iterator[TypedFrame]:
    """Give each frame its type, in order, holding back no more frames than the window of DKS needs."""
    before: Frame | None = None
    for number, frame, is_key, reason, dks in _with_key_frames(frames, settings, peak, on_pretraining):
        changed = 1.0 if before is None else float((frame != before).any(axis=2).mean())
        repeated = settings.effects.frames == "auto" and changed == 0
        if number == 0:
            kind: FrameType = "I"
            reason, why = "first frame", decision("frames", "first", done=True)
        elif is_key and settings.key_frames != "auto":  # asked for, so there whatever the picture
            kind, why = "I", decision("frames", "asked", done=True)
        elif repeated:
            steps = sum(part.iterations for part in (settings.inter.fit, settings.inter.tune))
            kind, reason = "R", "equal to the frame before"
            why = decision("frames", "equal", done=False, saved=steps)
        else:
            kind, reason = ("I", reason) if is_key else ("P", "predicted")
            number_of = None if settings.effects.frames == "all" else max(1, 100 * changed)
            why = decision("frames", "asked" if number_of is None else "differs", number_of, done=True)
        yield TypedFrame(number, frame, kind, reason, (why, dks))
        before = frame


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
        cause, saved = ("off", _pretraining_steps(settings, number)) if key == "auto" else ("every", 0)
        yield _Judged(number, frame, is_key, reason, decision("dks", cause, done=False, saved=saved))


def _pretraining_steps(settings: Settings, number: int) -> int:
    """The iterations that pre-training every frame takes: from scratch and, but for the first, from the one before."""
    return settings.detection.iterations * (1 if number == 0 else 2)


class _Everywhere:
    """The paper's way: every frame is pre-trained twice."""

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
        """Take a frame; those that can be decided now."""
        begin, before = time.perf_counter(), self.pretraining.iterations
        intra, inter = self.pretraining.losses(frame.astype(np.float32) / np.float32(self.peak))
        ratio = None if inter is None else _ratio(inter, intra)
        made = self.pretraining.iterations - before
        self.waiting.append((number, frame, ratio, made, time.perf_counter() - begin))
        yield from self._release(self.selector.push(intra, inter))

    def flush(self) -> Iterator[_Judged]:
        """No frame follows: those that wait."""
        yield from self._release(self.selector.flush())

    def _release(self, decisions: list[bool]) -> Iterator[_Judged]:
        for is_key in decisions:
            number, frame, ratio, made, seconds = self.waiting.popleft()
            cause = "first" if ratio is None else "cut" if is_key else "no cut"
            why = decision("dks", cause, ratio, done=True, iterations=made, seconds=seconds)
            yield _Judged(number, frame, is_key, "scene change", why)


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
        """No frame follows: those that wait."""
        while self.waiting:
            yield self._decide()

    def _decide(self) -> _Judged:
        seen = self.waiting.popleft()
        begin = time.perf_counter()
        steps = _pretraining_steps(self.settings, seen.number)
        others = [change for change in self.usual if change is not None] + [later.change for later in self.waiting]
        is_key = False
        if seen.number == 0:
            is_key, why = True, decision("dks", "first", done=False, saved=steps)
        elif seen.share <= MIN_CHANGE:
            why = decision("dks", "smooth", 100 * seen.share, done=False, saved=steps)
        elif not _stands_out(seen.change, others):
            why = decision("dks", "usual", done=False, saved=steps)
        else:
            ratio, made = self._pretrained(seen.frame)
            is_key = ratio > self.settings.detection.guard_ratio
            why = decision("dks", "cut" if is_key else "no cut", ratio, done=True, iterations=made)
        if seen.number:
            self.usual.append(None if is_key else seen.change)
        self.before = seen.frame
        why = replace(why, seconds=seen.seconds + time.perf_counter() - begin)
        return _Judged(seen.number, seen.frame, is_key, "scene change", why)

    def _pretrained(self, frame: Frame) -> tuple[float, int]:
        """How many times worse a frame is pre-trained from the frame before than from scratch, and the iterations."""
        assert self.before is not None
        pretraining = Pretraining(self.settings)
        for picture in (self.before, frame):
            intra, inter = pretraining.losses(picture.astype(np.float32) / self.peak)
        assert inter is not None
        return _ratio(inter, intra), pretraining.iterations


def _ratio(inter: float, intra: float) -> float:
    """How many times worse a prediction is; at most a million, as where a black frame leaves no loss from scratch."""
    return min(inter / max(intra, 1e-12), 1e6)


def _mean_square(values: F4) -> float:
    """The mean over the pixels of the sum over the channels of squares."""
    return float(np.square(values, dtype=np.float64).sum() / (values.shape[0] * values.shape[1]))


def _stands_out(change: float, others: list[float]) -> bool:
    """Whether a change exceeds the mean of others by more than STANDS_OUT standard deviations; alone it does."""
    return not others or change > float(np.mean(others)) + STANDS_OUT * float(np.std(others))


class Pretraining:
    """Pre-trains frame after frame, from scratch and from the frame before (paper, algorithm 1, steps 1 and 2).

    Attributes
    ----------
    iterations
        Made so far.
    """

    def __init__(self, settings: Settings) -> None:
        self.settings, self.detection = settings, settings.detection
        self.rng = np.random.default_rng([settings.seed, 0x444B53])
        self.before: Splats | None = None
        self.iterations = 0

    def losses(self, picture: F4) -> tuple[float, float | None]:
        """The losses of a picture (H, W, 3) f4 as an I-frame and as a P-frame; the first frame has no second one."""
        small = reduced(picture, self.detection.longest_side)
        objective = Objective(small, self.settings.threads, precision=self.settings.precision)
        height, width = small.shape[:2]
        count = min(
            self.settings.splat_count(picture.shape[1], picture.shape[0]), self.detection.splats or width * height
        )
        start = image_start(small, count, self.rng) if self.settings.intra.start == "image" else None
        intra_loss, splats = self._fit(
            start or random_splats(uniform_numbers(count, self.rng), width, height), objective, self.settings.intra
        )
        inter_loss = None
        if self.before is not None:
            inter_loss, _ = self._fit(self.before, objective, self.settings.inter)
        self.before = splats
        return intra_loss, inter_loss

    def _fit(self, start: Splats, objective: Objective, frame: FrameSettings) -> tuple[float, Splats]:
        """A short fit without growth and pruning: its loss and splats."""
        settings = frame.fit.with_(iterations=self.detection.iterations, growth=None, pruning=None)
        population = Population(start, KEPT_WEIGHT, np.full(len(start), NEW, np.int64), settings)
        loss, made = fit(population, objective, settings, self.rng)
        self.iterations += made
        return loss, population.splats()


def reduced(picture: F4, longest_side: int | None) -> F4:
    """The picture (H, W, 3) f4 with its longer side brought to at most this many pixels by averaging blocks."""
    step = 1 if longest_side is None else -(-max(picture.shape[:2]) // longest_side)
    if step == 1:
        return picture
    height, width = (-(-side // step) for side in picture.shape[:2])
    means = np.empty((height, width, 3), np.float32)
    _block_means(np.ascontiguousarray(picture), step, means)
    return means


def block_means_plain(picture: F4, step: int) -> F4:
    """The definition of `_block_means`."""
    places = [np.arange(0, side, step) for side in picture.shape[:2]]
    rows = [[picture[y : y + step, x : x + step].mean((0, 1), np.float64) for x in places[1]] for y in places[0]]
    return np.array(rows, np.float32)


@kernel()
def _block_means(picture: F4, step: int, means: F4) -> None:
    """The mean of each block of step by step pixels, fewer at the right and lower edge, in binary64."""
    sums = np.empty((means.shape[1], 3))
    for row in range(means.shape[0]):
        sums[:] = 0
        top, bottom = row * step, min((row + 1) * step, picture.shape[0])
        for y in range(top, bottom):
            for column in range(means.shape[1]):
                red, green, blue = 0.0, 0.0, 0.0
                for x in range(column * step, min((column + 1) * step, picture.shape[1])):
                    red += np.float64(picture[y, x, 0])
                    green += np.float64(picture[y, x, 1])
                    blue += np.float64(picture[y, x, 2])
                sums[column, 0] += red
                sums[column, 1] += green
                sums[column, 2] += blue
        for column in range(means.shape[1]):
            pixels = (bottom - top) * (min((column + 1) * step, picture.shape[1]) - column * step)
            for c in range(3):
                means[row, column, c] = sums[column, c] / pixels
