"""Points of GSVC as tasks for an executor, such as a cluster's: each worker gets the planes and returns a point."""

from collections.abc import Sequence
from concurrent.futures import Executor, Future
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from gsvc_base.cli.text import plural
from gsvc_lab.bench.coders import Coder
from gsvc_lab.bench.measure import Point, gsvc_point, warm_up
from gsvc_lab.bench.planes import PlanarClip
from gsvc_ref.encoder import Settings

MadePoint = tuple[Point, Sequence[str]]
"""A point, and what a reader must know of it."""


def submit_point(executor: Executor, clip: PlanarClip, coder: Coder, settings: Settings) -> "Future[MadePoint]":
    """Ask for a point of a coder; its clip travels with it."""
    return executor.submit(point_here, clip, clip.path.read_bytes(), coder, settings)


def point_here(clip: PlanarClip, planes: bytes, coder: Coder, settings: Settings) -> MadePoint:
    """Measure a point in a folder that goes again; this is what a worker is asked to do."""
    with TemporaryDirectory(prefix="gsvc-bench-") as name:
        folder = Path(name)
        warm_up([coder], folder)
        path = folder / "clip.yuv"
        path.write_bytes(planes)
        made, notes = gsvc_point(replace(clip, path=path), settings, folder)
    threads = "all threads" if settings.threads is None else plural(settings.threads, "thread")
    return made, (*notes, f"encoded and decoded on workers of a cluster with {threads} each, whose seconds these are")
