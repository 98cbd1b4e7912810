"""Seconds of `main` against `paper` at the same N, in turns, so that what else the machine does falls on both."""

import statistics
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import gsvc_ref
from gsvc_lab.bench.coders import MAIN, PAPER
from gsvc_lab.bench.planes import PlanarClip

SPLATS: Final = 600
ENCODES: Final = 3
DECODES: Final = 5
"""Turns of each."""


@dataclass(frozen=True)
class Seconds:
    """Medians over the turns."""

    clip: str  # title of the clip
    splats: int  # n of both
    encoding: tuple[float, float]  # Seconds a frame of `paper` and of `main`
    decoding: tuple[float, float]


def in_turns(clip: PlanarClip, folder: Path, threads: int | None, splats: int = SPLATS) -> Seconds:
    """Encode and decode a clip by `paper` and `main`, quick, again and again in turns."""
    frames = list(clip.frames())
    encoding: tuple[list[float], list[float]] = [], []
    decoding: tuple[list[float], list[float]] = [], []
    paths = folder / "paper.gsvc", folder / "main.gsvc"
    for _ in range(ENCODES):
        for coder, path, seconds in zip((PAPER, MAIN), paths, encoding, strict=True):
            settings = coder.settings(splats=splats, threads=threads)
            start = time.perf_counter()
            gsvc_ref.encode((iter(frames), clip.format), path, settings)
            seconds.append((time.perf_counter() - start) / len(frames))
    for _ in range(DECODES):
        for path, seconds in zip(paths, decoding, strict=True):
            start = time.perf_counter()
            for _ in gsvc_ref.decode(path, threads=threads):
                pass
            seconds.append((time.perf_counter() - start) / len(frames))
    medians = [(statistics.median(paper), statistics.median(main)) for paper, main in (encoding, decoding)]
    return Seconds(clip.title, splats, *medians)
