"""PSNR against seconds while one frame is encoded, with each preset."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from gsvc_lab.accuracy.sources import Source
from gsvc_ref.encoder.paper import FrameEncoder
from gsvc_ref.encoder.settings import PaperSettings

MAX_POINTS: Final = 200

PHASES: Final = {"fit": "fit", "quantize": "fine-tuning with quantisation"}

OnTime = Callable[[float], None]
"""Called now and then with the seconds since the beginning."""


@dataclass(frozen=True)
class Curve:
    """The PSNR of an I-frame over the time of encoding it."""

    preset: str  # ``quick`` or ``paper``
    # Seconds since the beginning, and PSNR in dB against the source of the picture before rounding; not every iteration
    # has one
    points: tuple[tuple[float, float], ...]
    iterations: int  # number of iterations in all
    end: str  # reason for the end of the curve

    def seconds_to(self, psnr: float) -> float | None:
        """The time at which the curve first reached a PSNR; None if it never did."""
        return next((seconds for seconds, reached in self.points if reached >= psnr), None)


class _TimeIsUpError(Exception):
    """Ends an encode from within its callback."""


def encoding_curve(
    settings: PaperSettings, source: Source, limit: float, on_time: OnTime = lambda seconds: None
) -> Curve:
    """Encode the source as the first I-frame of a stream, for at most `limit` seconds.

    The time includes the start and the last check.
    """
    height, width = source.frame.shape[:2]
    encoder = FrameEncoder(settings, width, height, source.bit_depth)
    points: list[tuple[float, float]] = []
    last = ("", 0)
    begin = time.perf_counter()

    def note(phase: str, iteration: int, iterations: int, psnr: float | None) -> None:
        nonlocal last
        assert psnr is not None  # profile `paper` knows it in every phase
        seconds = time.perf_counter() - begin
        points.append((seconds, psnr))
        last = (phase, iteration)
        on_time(seconds)
        if seconds > limit:
            raise _TimeIsUpError

    try:
        frame = encoder.encode(source.frame, "I", 0, note)
    except _TimeIsUpError:
        phase, iteration = last
        end = f"stopped after {limit:.0f} s, in iteration {iteration:,} of the {PHASES[phase]}"
    else:
        points.append((time.perf_counter() - begin, frame.psnr))
        end = f"complete: the decoded frame has {frame.psnr:.2f} dB"
    return Curve(settings.preset, thinned(points), len(points), end)


def thinned(points: list[tuple[float, float]], most: int = MAX_POINTS) -> tuple[tuple[float, float], ...]:
    """At most `most` of the points, evenly spaced in the logarithm of time, with the first and the last."""
    if len(points) <= most:
        return tuple(points)
    ratio = (points[-1][0] / points[0][0]) ** (1 / (most - 2))
    kept, due = [points[0]], points[0][0] * ratio
    for point in points[1:-1]:
        if point[0] >= due and len(kept) < most - 1:
            kept.append(point)
            due = point[0] * ratio
    return (*kept, points[-1])
