"""``python -m gsvc_lab.benchmarks.effects``: what `--effects auto` saves against `all` at the same PSNR.

Each scene is encoded with `all` at one N, and with `auto` at one N after another, each between those that were better
and worse, until the PSNRs are equal within 0.1 dB. Bits are those of the two encodes. Seconds are medians of rounds in
which both take turns.
"""

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from io import BytesIO
from itertools import islice, pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np

import gsvc_ref
from gsvc_base.arrays import U1
from gsvc_base.pages.markers import put_between
from gsvc_base.pages.tables import markdown_table
from gsvc_lab.clips import packaged
from gsvc_lab.machine import machine_text
from gsvc_ref import Settings
from gsvc_ref.encoder import EncodeReport
from gsvc_ref.video import ColorDescription, VideoFormat, open_video

SCENES: Final = ("static", "talking-head", "pan", "cut", "noise")

WIDTH, HEIGHT = 176, 144

SPLATS: Final = 600
"""N of `all`."""

FIRST: Final = (0.5, 1.0)
"""The first N of `auto`, as fractions of that of `all`."""

BEYOND: Final = 1.4
"""The factor to the next N where all that were tried are too good, or too bad."""

EQUAL: Final = 0.1
"""Two PSNRs in dB that differ by at most this are equal."""

MAX_TRIES: Final = 10
"""Encodes to find an N of equal PSNR."""

BEGIN, END = "<!-- measured -->", "<!-- end -->"


@dataclass(frozen=True)
class Measured:
    """One encode."""

    splats: int
    bits: int
    psnr: float
    seconds: float
    iterations: int


def scene(name: str, count: int) -> list[U1]:
    """Frames from the middle of a built-in scene, where a cut is, or the first ones of the clip `carphone`."""
    if name == "carphone":
        with open_video(packaged("carphone_pristine")) as reader:
            return [np.asarray(frame, np.uint8) for frame in islice(reader, count)]
    from gsvc_lab.scenes import Scene, frames

    described = Scene.named(name).resized(width=WIDTH, height=HEIGHT)
    start = max(0, (described.frames - count) // 2)
    return list(islice(frames(described), start, start + count))


def encoded(pictures: Sequence[U1], splats: int, effects: str, threads: int | None) -> Measured:
    """One encode with the preset `quick`; identical frames count as 100 dB."""
    height, width, _ = pictures[0].shape
    color = ColorDescription(primaries=1, transfer=1, matrix=0, full_range=True, chroma_location=0)
    video = VideoFormat(width, height, Fraction(25), 8, "rgb", color, frame_count=len(pictures))
    target = BytesIO()
    begin = time.perf_counter()
    report: EncodeReport = gsvc_ref.encode(
        (iter(pictures), video),
        target,
        Settings.quick(profile="paper", splats=splats, effects=effects, threads=threads),
    )
    seconds = time.perf_counter() - begin
    steps = sum(one.iterations for frame in report.frames for one in frame.decisions)
    quality = float(np.mean([min(frame.psnr, 100.0) for frame in report.frames]))
    return Measured(splats, 8 * report.file_bytes, quality, seconds, steps)


def next_count(points: Sequence[Measured], psnr: float) -> int:
    """The N to try next for a PSNR: on the line between the two points around it, or beyond the last one."""
    ordered = sorted(points, key=lambda point: point.psnr)
    for low, high in pairwise(ordered):
        if low.psnr <= psnr <= high.psnr:
            t = (psnr - low.psnr) / max(high.psnr - low.psnr, 1e-9)
            return round(low.splats + t * (high.splats - low.splats))
    return round(ordered[-1].splats * BEYOND) if psnr > ordered[-1].psnr else round(ordered[0].splats / BEYOND)


def as_good(pictures: Sequence[U1], psnr: float, threads: int | None) -> Measured:
    """An encode with `auto` whose PSNR is within EQUAL of the one given, or the nearest of MAX_TRIES."""
    points = [encoded(pictures, round(SPLATS * share), "auto", threads) for share in FIRST]
    while True:
        best = min(points, key=lambda point: abs(point.psnr - psnr))
        count = next_count(points, psnr)
        if abs(best.psnr - psnr) <= EQUAL or len(points) >= MAX_TRIES or count in {one.splats for one in points}:
            return best
        points.append(encoded(pictures, count, "auto", threads))


def compared(name: str, count: int, rounds: int, threads: int | None) -> dict[str, Any]:
    """A scene with `all`, and with as many splats of `auto` as give its PSNR."""
    pictures = scene(name, count)
    every = encoded(pictures, SPLATS, "all", threads)
    some = as_good(pictures, every.psnr, threads)
    seconds: dict[str, list[float]] = {"all": [], "auto": []}
    for _ in range(rounds):
        seconds["all"].append(encoded(pictures, SPLATS, "all", threads).seconds)
        seconds["auto"].append(encoded(pictures, some.splats, "auto", threads).seconds)
    return {
        "scene": name, "frames": len(pictures), "all": every, "auto": some,
        "seconds": {side: float(np.median(spent)) for side, spent in seconds.items()},
    }  # fmt: skip


HEADER: Final = (
    "scene", "frames", "N `all`, `auto`", "PSNR `all`, `auto`, dB", "bits `all`", "bits `auto`", "bits",
    "iterations `all`, `auto`", "s `all`", "s `auto`", "seconds",
)  # fmt: skip


def cells(row: dict[str, Any]) -> list[str]:
    """The cells of a scene, under HEADER."""
    every, some, seconds = row["all"], row["auto"], row["seconds"]
    unequal = "" if abs(some.psnr - every.psnr) <= EQUAL else " (not equal)"
    return [
        row["scene"], str(row["frames"]), f"{every.splats}, {some.splats}",
        f"{every.psnr:.2f}, {some.psnr:.2f}{unequal}", f"{every.bits:,}", f"{some.bits:,}",
        f"{some.bits / every.bits - 1:+.0%}", f"{every.iterations:,}, {some.iterations:,}", f"{seconds['all']:.2f}",
        f"{seconds['auto']:.2f}", f"{seconds['auto'] / seconds['all'] - 1:+.0%}",
    ]  # fmt: skip


def main() -> None:
    """Measure, print the table, and put it into a document."""
    parser = argparse.ArgumentParser(prog="python -m gsvc_lab.benchmarks.effects", description=__doc__)
    parser.add_argument("scenes", nargs="*", default=[*SCENES, "carphone"], help="which (default: all)")
    parser.add_argument("--frames", type=int, default=16, help="of each scene (default 16)")
    parser.add_argument("--rounds", type=int, default=3, help="encodes of each side that are timed (default 3)")
    parser.add_argument("--threads", type=int, help="threads to compute with")
    parser.add_argument("--markdown", type=Path, metavar="FILE", help="put the table between this file's markers")
    arguments = parser.parse_args()
    encoded(scene("carphone", 2), 50, "auto", arguments.threads)  # so that nothing waits for the compiler
    rows = []
    for name in arguments.scenes:
        print(f"{name} …", file=sys.stderr, flush=True)
        rows.append(compared(name, arguments.frames, arguments.rounds, arguments.threads))
    text = f"{markdown_table(HEADER, [cells(row) for row in rows])}\n\n{machine_text()}.\n"
    print(text)
    if arguments.markdown:
        put_between(arguments.markdown, BEGIN, END, text)


if __name__ == "__main__":
    main()
