"""Which frames are key frames: every k, listed, or found by pre-training each frame twice (DKS, paper section 3.6)."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gsvc_ref._jit import kernel
from gsvc_ref.codec.settings import FrameSettings, Settings, scaled
from gsvc_ref.reconstruction import FrameType
from gsvc_ref.rendering import Objective
from gsvc_ref.splats import F4, Splats
from gsvc_ref.training.augmentation import KEPT_WEIGHT, image_start, random_splats
from gsvc_ref.training.fit import NEW, Population, fit
from gsvc_ref.training.keyframes import KeyFrameSelector

Frame = NDArray[np.unsignedinteger[Any]]
OnPretraining = Callable[[int], None]
"""Called with the number of each frame before it is pre-trained."""


@dataclass(frozen=True)
class TypedFrame:
    """A source frame (H, W, 3) u1 or u2 with its number, its type, and the reason for it."""

    number: int
    frame: Frame
    type: FrameType
    reason: str


def typed_frames(
    frames: Iterable[Frame], settings: Settings, peak: int, on_pretraining: OnPretraining | None = None
) -> Iterator[TypedFrame]:
    """Give each frame its type, in order, holding back no more frames than the window of DKS needs."""
    before: Frame | None = None
    for number, frame, is_key, reason in _with_key_frames(frames, settings, peak, on_pretraining):
        if number == 0:
            yield TypedFrame(number, frame, "I", "first frame")
        elif is_key and settings.key_frames != "auto":  # asked for, so there whatever the picture
            yield TypedFrame(number, frame, "I", reason)
        elif settings.repeat_frames and before is not None and np.array_equal(frame, before):
            yield TypedFrame(number, frame, "R", "equal to the frame before")
        else:
            yield TypedFrame(number, frame, "I" if is_key else "P", reason if is_key else "predicted")
        before = frame


def _with_key_frames(
    frames: Iterable[Frame], settings: Settings, peak: int, on_pretraining: OnPretraining | None
) -> Iterator[tuple[int, Frame, bool, str]]:
    """Number, frame, whether it is a key frame, and why."""
    key = settings.key_frames
    if key == "auto":
        yield from _detected(frames, settings, peak, on_pretraining)
        return
    for number, frame in enumerate(frames):
        if isinstance(key, int):
            yield number, frame, number % key == 0, f"every {key} frames"
        else:
            yield number, frame, number in key, "listed"


def _detected(
    frames: Iterable[Frame], settings: Settings, peak: int, on_pretraining: OnPretraining | None
) -> Iterator[tuple[int, Frame, bool, str]]:
    detection = settings.detection
    selector = KeyFrameSelector(
        window=detection.window,
        threshold=detection.threshold,
        rule=detection.rule,
        causal=settings.low_latency,
        guard_ratio=detection.guard_ratio,
    )
    pretraining = Pretraining(settings)
    waiting: deque[tuple[int, Frame]] = deque()

    def release(decisions: Iterable[bool]) -> Iterator[tuple[int, Frame, bool, str]]:
        for decision in decisions:
            number, frame = waiting.popleft()
            yield number, frame, decision, "scene change"

    for number, frame in enumerate(frames):
        if on_pretraining:
            on_pretraining(number)
        waiting.append((number, frame))
        yield from release(selector.push(*pretraining.losses(frame.astype(np.float32) / np.float32(peak))))
    yield from release(selector.flush())


class Pretraining:
    """Pre-trains frame after frame, from scratch and from the frame before (paper, algorithm 1, steps 1 and 2)."""

    def __init__(self, settings: Settings) -> None:
        self.settings, self.detection = settings, settings.detection
        self.rng = np.random.default_rng([settings.seed, 0x444B53])
        self.before: Splats | None = None

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
            start or random_splats(count, width, height, self.rng), objective, self.settings.intra
        )
        inter_loss = None
        if self.before is not None:
            inter_loss, _ = self._fit(self.before, objective, self.settings.inter)
        self.before = splats
        return intra_loss, inter_loss

    def _fit(self, start: Splats, objective: Objective, frame: FrameSettings) -> tuple[float, Splats]:
        """A short fit without growth and pruning: its loss and splats."""
        settings = replace(scaled(frame.fit, self.detection.iterations), growth=None, pruning=None)
        population = Population(start, KEPT_WEIGHT, np.full(len(start), NEW, np.int64), settings)
        loss, _ = fit(population, objective, settings, self.rng)
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
