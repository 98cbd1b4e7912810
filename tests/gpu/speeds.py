"""``python -m tests.gpu.speeds NAME``: pictures and evaluations of one implementation, nothing copied.

Splats, pictures and gradients stay on the device. Where there is CUDA its events measure, elsewhere the clock on the
wall, from the first of several calls to the end of the last. The result has the form of the file that
`gsvc_lab.benchmarks.adapters` writes.
"""

import argparse
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Final
from unittest.mock import patch

import numpy as np

from gsvc_lab.benchmarks.timing import Spread
from tests.gpu.outcome import Record
from tests.gpu.splats import SMALL, STREAM, TRAINED, Scene

KINDS: Final = {
    "picture": "picture, f4 sums, bounded",
    "exact_picture": "picture, f4 sums, deterministic",
    "frame": "picture, 8 bits, bounded",
    "exact_frame": "picture, 8 bits, deterministic",
    "evaluation": "loss and gradients",
}
"""Works by the beginning of their ids."""

WARM_UP: Final = 3
ROUNDS: Final = 7
ROUND: Final = 0.02
"""Seconds of calls between two looks at the clock, about."""
MOST: Final = 50
"""Calls between them at most."""

Call = Callable[[], object]
Work = Callable[[], None]
Timer = Callable[[Call, int], float]
"""A function from a call and how often to make it to the seconds of all these calls."""


@dataclass(frozen=True)
class Bench:
    """What an implementation does with a scene, by kind, and what tells the time on its device."""

    timer: Timer
    calls: Mapping[str, Call]


def cuda(scene: Scene) -> Bench:
    """The CUDA adapter, whose launches are recorded once (a CUDA graph) and started again."""
    from gsvc_conformance.adapters.cuda import device

    works = {kind: device.replay(work) for kind, work in cuda_works(scene).items()}
    return Bench(cupy_timer() if device.machine().__name__.endswith("gpu") else wall(device.synchronize), works)


def cuda_works(scene: Scene) -> dict[str, Work]:
    """What the CUDA adapter launches for each kind."""
    from gsvc_conformance.adapters.cuda import device, rendering
    from gsvc_conformance.adapters.cuda.evaluation import Evaluation

    count, size, parameters = scene.count, (scene.width, scene.height), device.upload(scene.splats(), "f4")

    def drawing(exact: bool, samples: int) -> Work:
        there = rendering.Scene(*size, count, exact=exact)
        into = device.storage(scene.width * scene.height * samples)

        def work() -> None:
            there.fill(parameters, count)
            if samples == 3:
                there.frame(into, 8)
            else:
                there.sum(into)

        return work

    evaluation = Evaluation(device.upload(scene.target(), "f4"), *size, count)
    evaluation.evaluate(parameters, count)  # which makes room

    return {
        "picture": drawing(False, 12), "exact_picture": drawing(True, 12),
        "frame": drawing(False, 3), "exact_frame": drawing(True, 3),
        "evaluation": lambda: evaluation.start(parameters, count),
    }  # fmt: skip


def timeline(work: Work) -> list[tuple[str, float, float]]:
    """Each kernel that the CUDA adapter launches for some work, with its begin and end in milliseconds.

    They run one after the other with events between, so that gaps are a little longer than without.
    """
    import cupy

    from gsvc_conformance.adapters.cuda.device import Launch

    start, marks = Launch.__call__, list[tuple[str, Any, Any]]()
    first = cupy.cuda.Event()

    def watched(launch: Launch) -> None:
        before, after = cupy.cuda.Event(), cupy.cuda.Event()
        before.record()
        start(launch)
        after.record()
        marks.append((launch.kernel, before, after))

    work()
    with patch.object(Launch, "__call__", watched):
        first.record()
        work()
    cupy.cuda.get_current_stream().synchronize()
    elapsed = cupy.cuda.get_elapsed_time
    return [(kernel, *(round(elapsed(first, mark), 4) for mark in (before, after))) for kernel, before, after in marks]


def cupy_timer() -> Timer:
    """CuPy's events of CUDA."""
    import cupy

    def seconds(call: Call, count: int) -> float:
        first, last = cupy.cuda.Event(), cupy.cuda.Event()
        first.record()
        for _ in range(count):
            call()
        last.record()
        last.synchronize()
        return float(cupy.cuda.get_elapsed_time(first, last)) / 1000

    return seconds


def opencl(scene: Scene) -> Bench:
    """The OpenCL adapter, whose splats are copied to the device, too."""
    from gsvc_conformance.adapters.opencl import device, rendering

    splats, size = scene.splats(), (scene.width, scene.height)
    return Bench(
        wall(lambda: device.queue().finish()),
        {
            "picture": lambda: rendering.device_sum(splats, *size, exact=False),
            "exact_picture": lambda: rendering.device_sum(splats, *size, exact=True),
        },
    )


def webgpu(scene: Scene) -> Bench:
    """The WebGPU adapter, whose splats are copied to the device, too; reading 4 bytes of a picture waits for it."""
    from gsvc_conformance.adapters.webgpu import gpu, rendering

    splats, size = scene.splats(), (scene.width, scene.height)
    last: list[Any] = []

    def draw(exact: bool) -> None:
        last[:] = list(rendering.rendered(splats, *size, exact=exact))[-1:]

    return Bench(
        wall(lambda: gpu.device().queue.read_buffer(last[0].sums, size=4)),
        {"picture": lambda: draw(False), "exact_picture": lambda: draw(True)},
    )


def pytorch(scene: Scene) -> Bench:
    """The PyTorch adapter."""
    import torch

    from gsvc_conformance.adapters.pytorch.deterministic import render_deterministic
    from gsvc_conformance.adapters.pytorch.device import tensor
    from gsvc_conformance.adapters.pytorch.rendering import render

    splats, size = tensor(scene.splats()), (scene.width, scene.height)
    leaf, target = splats.clone().requires_grad_(), tensor(scene.target())

    def evaluate() -> None:
        torch.autograd.grad(((render(leaf, *size).clamp(0, 1) - target) ** 2).mean(), leaf)

    return Bench(
        torch_timer(splats.device.type),
        {
            "picture": torch.no_grad()(lambda: render(splats, *size)),
            "exact_picture": torch.no_grad()(lambda: render_deterministic(splats, *size)),
            "evaluation": evaluate,
        },
    )


def gsplat_cuda(scene: Scene) -> Bench:
    """The rasteriser of the paper's authors, without what its adapter does for degenerate splats."""
    import torch
    from gsplat.project_gaussians_2d import project_gaussians_2d
    from gsplat.rasterize_sum import rasterize_gaussians_sum

    from gsvc_conformance.adapters.gsplat_cuda import TILE, normalized, on_device

    splats, (width, height) = on_device(scene.splats()), (scene.width, scene.height)
    tiles = (-(-width // TILE), -(-height // TILE), 1)
    ones, black = torch.ones_like(splats[:, :1]), torch.zeros_like(splats[0, 5:])
    centers, factors, colors = normalized(splats[:, :2], width, height), splats[:, 2:5], splats[:, 5:]
    leaves = [part.clone().requires_grad_() for part in (centers, factors, colors)]
    target = on_device(scene.target())

    def picture(centers: Any, factors: Any, colors: Any) -> Any:
        projected = project_gaussians_2d(centers.contiguous(), factors.contiguous(), height, width, tiles)
        return rasterize_gaussians_sum(*projected, colors, ones, height, width, TILE, TILE, background=black)

    def evaluate() -> None:
        torch.autograd.grad(((picture(*leaves).clamp(0, 1) - target) ** 2).mean(), leaves)

    draw = torch.no_grad()(lambda: picture(centers, factors, colors.contiguous()))
    return Bench(torch_timer("cuda"), {"picture": draw, "evaluation": evaluate})


BENCHES: Final[dict[str, Callable[[Scene], Bench]]] = {
    "cuda": cuda, "opencl": opencl, "webgpu": webgpu, "pytorch": pytorch, "gsplat_cuda": gsplat_cuda,
}  # fmt: skip


def wall(finish: Call) -> Timer:
    """The clock on the wall; `finish` waits for what was called."""

    def seconds(call: Call, count: int) -> float:
        begin = time.perf_counter()
        for _ in range(count):
            call()
        finish()
        return time.perf_counter() - begin

    return seconds


def torch_timer(device: str) -> Timer:
    """PyTorch's events of CUDA, or the wall's clock on a processor."""
    import torch

    if device != "cuda":
        return wall(lambda: None)

    event: Any = torch.cuda.Event

    def seconds(call: Call, count: int) -> float:
        first, last = (event(enable_timing=True) for _ in range(2))
        first.record()
        for _ in range(count):
            call()
        last.record()
        last.synchronize()
        return float(first.elapsed_time(last)) / 1000

    return seconds


@contextmanager
def noting(missing: dict[str, str], what: str) -> Iterator[None]:
    """Note why something could not be measured, whatever a driver meets: other things may be possible."""
    try:
        yield
    except Exception as error:
        traceback.print_exc()
        missing[what] = f"{type(error).__name__}: {error}"


def measured(call: Call, timer: Timer) -> dict[str, float]:
    """Seconds of one call: the median and the quartiles of several rounds of calls."""
    for _ in range(WARM_UP):
        call()
    count = int(np.clip(ROUND / max(timer(call, 1), 1e-9), 1, MOST))
    spread = Spread.of([timer(call, count) / count for _ in range(ROUNDS)])
    return {"median": spread.median, "low": spread.low, "high": spread.high, "calls": ROUNDS * count}


def measure(name: str, scenes: Sequence[Scene], record: Record) -> bool:
    """Measure all kinds on all scenes, and say whether that was possible; what is known is always in the record."""
    module = f"gsvc_conformance.adapters.{name}"
    works = {f"{kind}_{scene.id}": f"{what}, {scene.name}" for kind, what in KINDS.items() for scene in scenes}
    seconds: dict[str, dict[str, float]] = {}
    missing: dict[str, str] = {}
    entry = {
        "implementation": module, "settings": {}, "environment": import_module(module).environment(),
        "seconds": seconds, "missing": missing,
    }  # fmt: skip
    rates = [work for work in works if not work.startswith("evaluation")]
    record.keep(works=works, rates=rates, implementations=[entry])
    for scene in scenes:
        with noting(missing, scene.id):
            bench = BENCHES[name](scene)
            for kind, call in bench.calls.items():
                seconds[f"{kind}_{scene.id}"] = measured(call, bench.timer)
                record.keep()
    if name == "cuda" and "compute_capability" in entry["environment"]:
        works_of_scene = cuda_works(next(scene for scene in scenes if scene.count == STREAM))
        record.keep(timeline={f"{KINDS[kind]}": timeline(work) for kind, work in works_of_scene.items()})
    record.end()
    return not missing


def main(words: Sequence[str] | None = None) -> None:
    """Measure one implementation."""
    parser = argparse.ArgumentParser(prog="python -m tests.gpu.speeds", description=__doc__)
    parser.add_argument("name", choices=BENCHES)
    parser.add_argument("--small", action="store_true", help="a small scene instead of the trained ones")
    parser.add_argument("--json", type=Path, required=True, metavar="FILE", help="where the numbers go")
    arguments = parser.parse_args(words)
    if not measure(arguments.name, SMALL if arguments.small else TRAINED, Record(arguments.json)):
        sys.exit(2)


if __name__ == "__main__":
    main()
