"""Work that several experiments share: encoding a clip with progress, and fitting without quantisation."""

import io
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Final

import numpy as np

from gsvc_base.arrays import Frame
from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_lab.clips import Clip
from gsvc_lab.experiments.fitting import Picture, Quality
from gsvc_ref.encoder import EncodeReport, Settings, encode
from gsvc_ref.encoder.report import Progress
from gsvc_ref.encoder.settings import PaperSettings
from gsvc_ref.encoder.settings.paper import FrameSettings
from gsvc_ref.metrics import ms_ssim
from gsvc_ref.stream import decode
from gsvc_ref.training import (
    KEPT_WEIGHT,
    NEW,
    NEW_WEIGHT,
    FitSettings,
    Population,
    Rates,
    StepDecay,
    fit,
    random_splats,
    uniform_numbers,
)

PAPER_ITERATIONS: Final = 50_000
"""Maximum number of iterations of a frame (paper, implementation details)."""

PAPER_RATE: Final = 1e-3
"""The learning rate at the start (paper, implementation details)."""

QUIET_SECONDS: Final = 8.0
"""Seconds of silence after which an encode reports its progress."""

HELD_BYTES: Final = 2**29
"""Longer clips are not kept in memory (`held`)."""

Say = Callable[[str], None]


def shortened(settings: PaperSettings, iterations: int, rate: float) -> PaperSettings:
    """Preset `paper` in fewer iterations with a higher learning rate, which makes up for some of those missing.

    The rate, that of all attributes at the start, is halved at the same fractions of the iterations as in the paper.
    Pruning comes after iterations in which as much can be learnt: ten times earlier where the rate is ten times higher.
    """
    rates, schedule = Rates(rate, rate, rate, rate), StepDecay(interval=max(1, iterations * 20_000 // PAPER_ITERATIONS))

    def earlier(iteration: int) -> int:
        return max(1, round(iteration * PAPER_RATE / rate))

    def kind(frame: FrameSettings) -> FrameSettings:
        assert isinstance(frame.fit, FitSettings)  # the paper's settings have no others
        tune = max(1, round(iterations * frame.tune.iterations / frame.fit.iterations))
        pruning = frame.fit.pruning
        assert pruning is not None
        pruning = replace(
            pruning,
            first=earlier(pruning.first),
            last=earlier(pruning.last),
            interval=earlier(pruning.interval),
        )
        return replace(
            frame,
            fit=replace(frame.fit, iterations=iterations, rates=rates, schedule=schedule, pruning=pruning),
            tune=replace(frame.tune, iterations=tune, rates=rates, schedule=schedule),
        )

    return replace(settings, intra=kind(settings.intra), inter=kind(settings.inter))


class NowAndThen:
    """Says a sentence if nothing was said for QUIET_SECONDS, so that long work is not silent."""

    def __init__(self, say: Say) -> None:
        self._say, self._said = say, time.perf_counter()

    def __call__(self, sentence: str) -> None:
        """Say it, or not yet."""
        if time.perf_counter() - self._said > QUIET_SECONDS:
            self._said = time.perf_counter()
            self._say(sentence)


@dataclass(frozen=True)
class Encoded:
    """An encode: what the encoder reports, and the stream."""

    report: EncodeReport
    stream: bytes

    @property
    def psnr(self) -> list[float]:
        """PSNR of each decoded frame in dB."""
        return [frame.psnr for frame in self.report.frames]

    @property
    def bits(self) -> list[int]:
        """Size of each frame's chunk."""
        return [sum(frame.bits.values()) for frame in self.report.frames]

    @property
    def types(self) -> str:
        """A letter for each frame."""
        return "".join(frame.type for frame in self.report.frames)

    @property
    def key_frames(self) -> tuple[int, ...]:
        """The numbers of the I-frames."""
        return tuple(frame.number for frame in self.report.frames if frame.type == "I")


def encoded(clip: Clip, settings: Settings, say: Say, what: str) -> Encoded:
    """Encode a clip; a sentence when it is done, and now and then while it lasts.

    A GsvcError says that the clip has no frames. A KeyboardInterrupt passes through.
    """
    now_and_then = NowAndThen(say)

    def progress(now: Progress) -> None:
        now_and_then(f"{what}: {now.stage}, frame {now.frame + 1} of {now.frame_count}")

    target = io.BytesIO()
    report = encode(clip.source(), target, settings, progress=progress)
    if report.interrupted:  # what there is now is a part of the clip
        raise KeyboardInterrupt
    say(f"{what}: {report.mean_psnr:.2f} dB, {report.bits_per_pixel:.3f} bits/pixel, {report.seconds:.1f} s")
    return Encoded(report, target.getvalue())


def decoded_ms_ssim(frames: Iterable[Frame], stream: bytes, threads: int | None) -> list[float]:
    """MS-SSIM of each decoded 8-bit frame."""
    return [ms_ssim(a, b, 255) for a, b in zip(frames, decode(stream, threads=threads), strict=True)]


@dataclass(frozen=True)
class Fitted:
    """A frame as splats without quantisation, and how good they are as a picture of 8 bits."""

    splats: Splats
    quality: Quality


def fitted_frames(frames: Iterable[Frame], settings: PaperSettings, keys: Collection[int]) -> Iterator[Fitted]:
    """Fit 8-bit frames one after the other with preset `paper`, each P-frame from the splats of the frame before.

    This is the paper's algorithm 1 from step 4 on, without its encoding: I-frames, those in `keys`, begin at random,
    P-frames with the splats before and those that GSA adds at random, and GSP removes some during the fit. What
    `Settings.effects` switches off is left out.
    """
    before: Splats | None = None
    intra, inter = settings.intra.fit, settings.inter.fit
    assert isinstance(intra, FitSettings)  # the paper's settings have no others
    assert isinstance(inter, FitSettings)
    for number, frame in enumerate(frames):
        height, width = frame.shape[:2]
        total, rng = settings.splat_count(width, height), np.random.default_rng([settings.seed, number])
        if before is None or number in keys:
            fit_settings = intra if settings.effects.gsp == "all" else replace(intra, pruning=None)
            weight = KEPT_WEIGHT if fit_settings.pruning is None else NEW_WEIGHT
            start = random_splats(uniform_numbers(total, rng), width, height)
            population = Population(start, weight, np.full(total, NEW, np.int64), fit_settings.optimizer)
        else:
            new = 0 if settings.effects.gsa == "off" else round(settings.inter.new_fraction * total)
            prunes = settings.effects.gsp == "all" and new > 0
            fit_settings = inter.pruning_of(new / (len(before) + new)) if prunes else replace(inter, pruning=None)
            population = Population(before, KEPT_WEIGHT, np.arange(len(before)), fit_settings.optimizer)
            population.augment(uniform_numbers(new, rng), width, height)
        picture = Picture(frame, settings.threads)
        fit(population, picture.objective, fit_settings)
        before = population.splats()
        yield Fitted(before, picture.quality(before))


def excerpt(clip: Clip, first: int, frames: int, width: int, height: int) -> Clip:
    """Some frames of a clip from a number on, or all that there are, at another size.

    They are counted by reading them: not every file says how many it holds, and some say it wrongly.

    A UsageError says that there are none.
    """
    scaled = clip.scaled(width, height)
    count = sum(1 for _ in clip.frames(first, first + frames))
    if count == 0:
        raise UsageError(f"{clip.name} has no frame {first}; give a longer clip")
    about = f"frames {first} to {first + count - 1} of {clip.about}"

    def read(start: int) -> Iterator[Frame]:
        return scaled.frames(first + start, first + count)

    return Clip(clip.name, about, replace(scaled.format, frame_count=count), read)


def held(clip: Clip) -> Clip:
    """A clip whose frames are read once and kept in memory, where HELD_BYTES suffice; else the clip itself."""
    video = clip.format
    if video.frame_count is None or 3 * video.width * video.height * video.frame_count > HELD_BYTES:
        return clip
    frames = list(clip.frames())
    return replace(clip, read=lambda start: iter(frames[start:]))


def joined(clips: Sequence[Clip], frames: int, width: int, height: int) -> tuple[Clip, list[int]]:
    """The first frames of clips one after the other at one size, and the numbers at which one follows another.

    A clip that is shorter gives all it has.
    """
    parts = [excerpt(clip, 0, frames, width, height) for clip in clips]
    counts = [part.format.frame_count or 0 for part in parts]
    seams = [sum(counts[:number]) for number in range(1, len(counts))]

    def read(start: int) -> Iterator[Frame]:
        return islice((frame for part in parts for frame in part.frames()), start, None)

    about = ", then ".join(part.about for part in parts)
    video = replace(parts[0].format, frame_count=sum(counts))
    return Clip("joined", f"{about}, at {width}x{height}", video, read), seams
