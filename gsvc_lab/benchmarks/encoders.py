"""``python -m gsvc_lab.benchmarks.encoders``: seconds, bytes, PSNR and level quality of both profiles' preset `quick`.

With ``--against CHECKOUT`` an older checkout encodes the same, in turns with this one (A B A B ...), and each number is
told before and after. Every encode goes through `gsvc_ref.encode`, so what it tells is what a user gets.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from gsvc_base.pages.tables import Table
from gsvc_base.processors import processors
from gsvc_lab.machine import cpu_model, machine_text

CHECKOUT: Final = Path(__file__).resolve().parents[2]
SCRIPT: Final = Path(__file__).with_name("encode_case.py")

PROFILES: Final = ("main", "paper")

LEVEL_FRAMES: Final = 30
"""Frames of a GOP whose last third is held against its first."""

TABLES: Final = "frames,clips,levels,jobs"

JOBS: Final = (1, 2)
"""Numbers of jobs; one job has all threads."""

JOBS_SCENE, JOBS_FRAMES, JOBS_GROUP = "water", 50, 10
"""The scene, its frames, and the frames of a GOP."""


@dataclass(frozen=True)
class Case:
    """What is encoded."""

    material: str  # as in `encode_case.material`
    count: int  # frames, of which the first is the only I-frame
    width: int  # The frame size in pixels, and N
    height: int
    splats: int

    def request(self, profile: str, threads: int) -> str:
        """The line that a worker gets."""
        return json.dumps(
            {
                "material": self.material, "count": self.count, "size": [self.width, self.height],
                "splats": self.splats, "profile": profile, "key_frames": self.count, "threads": threads,
            }
        )  # fmt: skip

    @property
    def name(self) -> str:
        """For a row of a table."""
        name = self.material.partition(":")[2].replace("@0", "").replace("@", " from frame ")
        return f"{name} {self.width}x{self.height}, N = {self.splats:,}"


FRAMES: Final = (
    Case("photograph:astronaut", 2, 352, 288, 2000),
    Case("photograph:coffee", 2, 352, 288, 2000),
    Case("photograph:chelsea", 2, 352, 288, 2000),
    Case("photograph:astronaut", 2, 1920, 1080, 10_000),
)
"""An I-frame and a P-frame."""

CLIPS: Final = (
    Case("clip:carphone_pristine@0", 16, 176, 144, 1000),
    Case("clip:bikes@0", 16, 256, 176, 1000),
    Case("clip:bikes@100", 16, 256, 176, 1000),
    Case("scene:pan", 16, 176, 144, 1000),
    Case("scene:talking-head", 16, 160, 128, 600),
    Case("scene:grain", 16, 176, 144, 1000),
)
"""A GOP of each clip that experiments code, at one N."""

LEVELS: Final = (
    Case("clip:carphone_pristine@0", LEVEL_FRAMES, 176, 144, 1000),
    Case("clip:bikes@0", LEVEL_FRAMES, 256, 176, 1000),
    Case("scene:talking-head", LEVEL_FRAMES, 160, 128, 600),
    Case("scene:pan", LEVEL_FRAMES, 176, 144, 1000),
    Case("demo:demo", 22, 192, 112, 537),  # up to its cut
)
"""Long GOPs."""


class Worker:
    """A process that encodes with the sources of one checkout; a context manager."""

    def __init__(self, checkout: Path) -> None:
        path = os.pathsep.join([str(checkout), *filter(None, [os.environ.get("PYTHONPATH")])])
        self._process = subprocess.Popen(
            [sys.executable, str(SCRIPT)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=checkout,
            env={**os.environ, "PYTHONPATH": path},
        )  # fmt: skip

    def __enter__(self) -> "Worker":
        """Itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the process."""
        self._process.kill()
        self._process.communicate()

    def encoded(self, request: str) -> dict[str, Any]:
        """What one encode gave."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(request + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"the encode of {request} ended without an answer; its message stands above")
        answer: dict[str, Any] = json.loads(line)
        return answer


def measured(
    workers: Sequence[Worker], cases: Sequence[Case], profile: str, threads: int, rounds: int
) -> list[list[list[dict[str, Any]]]]:
    """For each case and worker the answers of all rounds, in turns, after one that does not count."""
    found: list[list[list[dict[str, Any]]]] = []
    for case in cases:
        print(f"{profile}: {case.name}, {case.count} frames", file=sys.stderr, flush=True)
        answers: list[list[dict[str, Any]]] = [[] for _ in workers]
        for number in range(rounds + 1):
            for worker, own in zip(workers, answers, strict=True):
                answer = worker.encoded(case.request(profile, threads))
                if number > 0:
                    own.append(answer)
        found.append(answers)
    return found


def seconds(answers: Sequence[dict[str, Any]], kind: str) -> float:
    """The median over the rounds of the mean seconds of the frames of a type."""
    return float(
        np.median([np.mean([one["seconds"] for one in answer["frames"] if one["type"] == kind]) for answer in answers])
    )


def mean_psnr(answer: dict[str, Any]) -> float:
    """The mean of the frames' PSNRs in dB."""
    return float(np.mean([one["psnr"] for one in answer["frames"]]))


def fall(answer: dict[str, Any]) -> float:
    """By how many dB the mean PSNR of the last third of the frames is above that of the first third."""
    values = [one["psnr"] for one in answer["frames"]]
    third = len(values) // 3
    return float(np.mean(values[-third:]) - np.mean(values[:third]))


def _sides(values: Sequence[float], digits: int) -> str:
    """``before → after``, or the one value that there is."""
    return " → ".join(f"{value:,.{digits}f}" for value in values)


def frame_table(workers: Sequence[Worker], threads: int, rounds: int) -> Table:
    """Seconds, bytes and PSNR of an I-frame and the P-frame after it."""
    rows = []
    for profile in PROFILES:
        for case, sides in zip(FRAMES, measured(workers, FRAMES, profile, threads, rounds), strict=True):
            for number, kind in enumerate("IP"):
                frames = [answers[0]["frames"][number] for answers in sides]
                spent = [seconds(answers, kind) for answers in sides]
                rows.append(
                    [
                        profile, case.name, kind, _sides(spent, 3), f"{spent[0] / spent[-1]:.1f}",
                        _sides([frame["psnr"] for frame in frames], 2),
                        _sides([frame["bits"] / 8 for frame in frames], 0),
                        _sides([frame["evaluations"] for frame in frames], 0),
                    ]
                )  # fmt: skip
    text = f"A frame of `gsvc_ref.encode`, preset `quick`, {threads} threads: medians of {rounds} encodes in turns."
    header = ["profile", "picture", "frame", "seconds", "times faster", "PSNR, dB", "bytes", "evaluations"]
    return Table(text, header, rows)


def clip_table(workers: Sequence[Worker], threads: int, rounds: int) -> Table:
    """The closed loop: bytes, mean PSNR and seconds a frame of whole clips."""
    rows = []
    for profile in PROFILES:
        for case, sides in zip(CLIPS, measured(workers, CLIPS, profile, threads, rounds), strict=True):
            sizes = [answers[0]["bytes"] for answers in sides]
            quality = [mean_psnr(answers[0]) for answers in sides]
            spent = [float(np.median([one["seconds"] for one in answers])) / case.count for answers in sides]
            rows.append(
                [
                    profile, case.name, _sides(sizes, 0), f"{sizes[-1] / sizes[0] - 1:+.1%}", _sides(quality, 2),
                    f"{quality[-1] - quality[0]:+.2f}", _sides(spent, 3),
                ]
            )  # fmt: skip
    text = f"{CLIPS[0].count} frames of each clip, one I-frame, preset `quick`, {threads} threads."
    header = ["profile", "clip", "bytes", "change", "mean PSNR, dB", "change", "seconds a frame"]
    return Table(text, header, rows)


def level_table(workers: Sequence[Worker], threads: int) -> Table:
    """Level quality at constant N."""
    rows = []
    for profile in PROFILES:
        for case, sides in zip(LEVELS, measured(workers, LEVELS, profile, threads, 1), strict=True):
            rows.append(
                [
                    profile, case.name, _sides([fall(answers[0]) for answers in sides], 2),
                    _sides([mean_psnr(answers[0]) for answers in sides], 2),
                    _sides([answers[0]["bytes"] for answers in sides], 0),
                ]
            )  # fmt: skip
    text = "GOPs of 30 frames, of the demo 22, at constant N: the mean PSNR of the last third less that of the first."
    return Table(text, ["profile", "clip", "last third - first, dB", "mean PSNR, dB", "bytes"], rows)


def job_table(rounds: int) -> Table:
    """Wall seconds a frame of a whole `gsvc encode`, by the number of jobs."""
    rows = []
    with TemporaryDirectory() as folder:
        clip, stream = Path(folder) / "clip.y4m", Path(folder) / "clip.gsvc"
        scene = [sys.executable, "-m", "gsvc_ref", "scene", JOBS_SCENE, str(clip), "--frames", str(JOBS_FRAMES)]
        subprocess.run([*scene, "--size", "352x288", "--quiet"], check=True)
        for profile in PROFILES:
            print(f"{profile}: {JOBS_SCENE}, jobs", file=sys.stderr, flush=True)
            spent: dict[int, list[float]] = {jobs: [] for jobs in JOBS}
            streams = set()
            for _ in range(rounds + 1):
                for jobs, own in spent.items():
                    command = [sys.executable, "-m", "gsvc_ref", "encode", str(clip), str(stream), "--quiet"]
                    command += ["--profile", profile, "--splats", "2000", "--key-frames", str(JOBS_GROUP)]
                    begin = time.perf_counter()
                    subprocess.run([*command, "--jobs", str(jobs)], check=True)
                    own.append((time.perf_counter() - begin) / JOBS_FRAMES)
                    streams.add(stream.read_bytes())
            if len(streams) != 1:
                raise RuntimeError(f"{profile}: the bytes depend on the number of jobs")
            medians = [float(np.median(own[1:])) for own in spent.values()]
            rows.append([profile, *(f"{one:.3f}" for one in medians), f"{medians[0] / medians[-1]:.2f}"])
    text = (
        f"Wall seconds a frame of `gsvc encode`: {JOBS_FRAMES} frames of the scene {JOBS_SCENE}, 352x288, N = 2,000, "
        f"an I-frame each {JOBS_GROUP}; medians of {rounds} in turns."
    )
    return Table(text, ["profile", *(f"--jobs {jobs}" for jobs in JOBS), "times faster"], rows)


def main() -> None:
    """Measure, and print the tables."""
    parser = argparse.ArgumentParser(prog="python -m gsvc_lab.benchmarks.encoders", description=__doc__)
    parser.add_argument("--against", type=Path, metavar="CHECKOUT", help="an older checkout, measured in turns")
    parser.add_argument("--threads", type=int, default=min(2, processors()), help="of each encode (default 2, if any)")
    parser.add_argument("--rounds", type=int, default=3, help="encodes of each side that are timed (default 3)")
    parser.add_argument("--tables", default=TABLES, help=f"which (default: {TABLES})")
    arguments = parser.parse_args()
    checkouts = [*([arguments.against.resolve()] if arguments.against else []), CHECKOUT]
    with ExitStack() as stack:
        workers = [stack.enter_context(Worker(checkout)) for checkout in checkouts]
        for name in arguments.tables.split(","):
            if name == "jobs":
                table = job_table(arguments.rounds)
            elif name == "levels":
                table = level_table(workers, arguments.threads)
            else:
                make = {"frames": frame_table, "clips": clip_table}[name]
                table = make(workers, arguments.threads, arguments.rounds)
            print(table.markdown(), end="\n\n", flush=True)
    print(f"{cpu_model()}, {machine_text()}.")


if __name__ == "__main__":
    main()
