"""Only what changed: what is rendered and trained again in still scenes, a talking head and a cut."""

import io
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Final
from unittest.mock import patch

import numpy as np

import gsvc_ref
from gsvc_base.arrays import U1
from gsvc_lab.benchmarks.pictures import mosaic
from gsvc_lab.benchmarks.results import Section, Table
from gsvc_lab.benchmarks.timing import Spread
from gsvc_lab.clips import packaged
from gsvc_ref import Settings
from gsvc_ref.encoder import EncodeReport
from gsvc_ref.rendering import Objective, Renderer, SequenceRenderer
from gsvc_ref.video import ColorDescription, VideoFormat, open_video

FRAMES: Final = 10
WIDTH: Final = 352
HEIGHT: Final = 288

ROUNDS: Final = 25


def still() -> Iterator[U1]:
    """A photograph that does not change."""
    picture = np.rint(mosaic(np.random.default_rng(1))[:HEIGHT, :WIDTH] * 255).astype(np.uint8)
    for _ in range(FRAMES):
        yield picture


def ball() -> Iterator[U1]:
    """A ball that flies over a photograph."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    for number, frame in enumerate(still()):
        inside = np.hypot(columns - 40 - 12 * number, rows - 180 + 60 * np.sin(number / 3)) < 18
        yield np.where(inside[..., None], np.array([230, 60, 40], np.uint8), frame)


def head() -> Iterator[U1]:
    """A man who talks in a driving car."""
    with open_video(packaged("carphone_pristine")) as reader:
        for _, frame in zip(range(FRAMES), reader, strict=False):
            yield np.asarray(frame, np.uint8)


def cut() -> Iterator[U1]:
    """Two photographs, each seen by a camera that moves by a pixel a frame."""
    for number in range(FRAMES):
        picture = mosaic(np.random.default_rng(1 if number < FRAMES // 2 else 2))
        yield np.rint(picture[number : number + HEIGHT, number : number + WIDTH] * 255).astype(np.uint8)


SCENES: Final[dict[str, Callable[[], Iterator[U1]]]] = {
    "still": still,
    "still, a ball flies by": ball,
    "talking head": head,
    "pan and cut": cut,
}


@dataclass
class Encoded:
    """An encode: its bytes, its report, and the share of splats that each fine-tuning held fixed."""

    data: bytes
    report: EncodeReport
    frozen: list[float] = field(default_factory=list)

    def tuning(self) -> float:
        """Seconds of fine-tuning per frame."""
        return self.report.seconds_by_stage["quantize"] / len(self.report.frames)


def encoded(frames: list[U1], threads: int, *, freeze: bool) -> Encoded:
    """Encode with the preset `quick`; without `freeze` training evaluates all splats all the time."""
    height, width, _ = frames[0].shape
    color = ColorDescription(primaries=1, transfer=1, matrix=0, full_range=True, chroma_location=0)
    video = VideoFormat(width, height, Fraction(25), 8, "rgb", color, frame_count=len(frames))
    target, shares = io.BytesIO(), []
    whole = Objective.freeze

    def watched(self: Objective, parameters: Any, frozen: Any) -> None:
        shares.append(float(np.mean(frozen)))
        whole(self, parameters, frozen if freeze else np.zeros_like(frozen))

    with patch.object(Objective, "freeze", watched):
        report = gsvc_ref.encode((iter(frames), video), target, Settings.quick(profile="paper", threads=threads))
    return Encoded(target.getvalue(), report, shares)


def rendering(data: bytes, threads: int) -> tuple[list[float], list[float], list[float]]:
    """For every frame after the first: share of regions rendered, and seconds as a sequence and as a whole, medians."""
    with gsvc_ref.open(data) as stream:
        size = stream.header.width, stream.header.height
        frames = [(frame.type, frame.splats, frame.codes.origins) for frame in stream]
    shares: list[float] = []
    seconds = np.zeros((ROUNDS, 2, len(frames)))
    for turn in range(ROUNDS):
        sequence = SequenceRenderer(*size, precision="deterministic", threads=threads)
        whole = Renderer(*size, precision="deterministic", threads=threads)
        shares = []
        for n, (kind, splats, origins) in enumerate(frames):
            begin = time.perf_counter()
            frame = sequence.next_frame(splats, 8, np.arange(len(splats)) if kind == "R" else origins)
            middle = time.perf_counter()
            expected = whole.frame(splats, 8)
            seconds[turn, :, n] = middle - begin, time.perf_counter() - middle
            shares.append(sequence.share)
            assert np.array_equal(frame, expected)
    medians = np.median(seconds, axis=0)
    return shares[1:], medians[0, 1:].tolist(), medians[1, 1:].tolist()


def changes(threads: int) -> Section:
    """The savings on each scene."""
    section = Section("Only what changed")
    rows = []
    for name, scene in SCENES.items():
        frames = list(scene())
        every, some = (encoded(frames, threads, freeze=freeze) for freeze in (False, True))
        shares, part, whole = rendering(some.data, threads)
        frozen = np.mean(some.frozen) if some.frozen else 0.0
        kinds = "".join(frame.type for frame in some.report.frames)
        gain = Spread.of(np.array(whole) / np.array(part))
        rows.append(
            [
                name, kinds, f"{100 * np.mean(shares):.0f} %", f"{1000 * np.mean(part):.2f}",
                f"{1000 * np.mean(whole):.2f}", gain.text(2), f"{100 * frozen:.0f} %",
                f"{1000 * some.tuning():.0f}", f"{1000 * every.tuning():.0f}",
                f"{some.report.mean_psnr - every.report.mean_psnr:+.2f}",
            ]
        )  # fmt: skip
        section.numbers.append(
            {"scene": name, "types": kinds, "shares": shares, "seconds": part, "seconds of whole frames": whole,
             "frozen": some.frozen, "tuning": some.tuning(), "tuning of all": every.tuning()}
        )  # fmt: skip
    header = [
        "scene", "frames", "regions rendered", "render, ms", "whole, ms", "gain", "splats fixed", "tuning, ms",
        "tuning all, ms", "dB",
    ]  # fmt: skip
    text = (
        f"{FRAMES} frames each, preset `quick`; {WIDTH}x{HEIGHT}, the talking head 176x144. Left: frames after the "
        "first with the precision `deterministic`, rendered as a sequence against whole frames, which give the same "
        "bytes (gain: median and quartiles over the frames). Right: the share of splats that fine-tuning held fixed, "
        "its time for a frame against that with all splats free, and what that did to the PSNR."
    )
    section.tables.append(Table(text, header, rows))
    return section
