"""``python -m tests.gpu.codec``: whole ways by CUDA, from a stream to pictures and back.

The clock on the wall measures, since both ways need the processor, too. Pictures stay on the device. The result has the
form of the file that `gsvc_lab.benchmarks.adapters` writes.
"""

import argparse
import sys
import time
from collections.abc import Sequence
from fractions import Fraction
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import Any, Final

import numpy as np

import gsvc_ref
from gsvc_lab.benchmarks.material import PAN, SEED, picture, stream
from gsvc_lab.benchmarks.timing import Spread
from gsvc_ref import Settings
from gsvc_ref.video import ColorDescription, VideoFormat
from tests.gpu.outcome import Record
from tests.gpu.speeds import noting
from tests.gpu.splats import SMALL, STREAM, TRAINED, Scene

MODULE: Final = "gsvc_conformance.adapters.cuda"
COPIES: Final = 16
"""The stream that is decoded is so often the same four frames, I P P P."""
PASSES: Final = 5
FRAMES: Final = 4
"""Frames that are encoded, the first of them an I-frame."""

Seconds = dict[str, float]


def spread(seconds: Sequence[float]) -> Seconds:
    """As `speeds.measured` has it."""
    found = Spread.of(seconds)
    return {"median": found.median, "low": found.low, "high": found.high, "calls": len(seconds)}


def decoded(data: bytes, exact: bool, passes: int) -> Seconds:
    """Seconds of a frame, from the bytes in main memory to samples on the device."""
    from gsvc_conformance.adapters.cuda.decoder import Decoder

    seconds = []
    for _ in range(1 + passes):
        begin = time.perf_counter()
        count = sum(1 for _ in Decoder(data, exact=exact).pictures())
        seconds.append((time.perf_counter() - begin) / count)
    return spread(seconds[1:])


def encoded(scene: Scene, count: int, device: str) -> dict[str, list[float]]:
    """Seconds of each frame of an encode, by its type; the encode before it, of two frames, compiles what it needs."""
    color = ColorDescription(primaries=1, transfer=1, matrix=0, full_range=True, chroma_location=0)
    settings = Settings.quick(splats=scene.count, key_frames=(0,), seed=SEED, profile="main", device=device)
    frames = [
        np.rint(picture(scene.width, scene.height, PAN[0] * k, PAN[1] * k) * 255).astype(np.uint8) for k in range(count)
    ]
    for number in (2, count):
        video = VideoFormat(scene.width, scene.height, Fraction(25), 8, "rgb", color, frame_count=number)
        report = gsvc_ref.encode((islice(frames, number), video), BytesIO(), settings)
    return {kind: [one.seconds for one in report.frames if one.type == kind] for kind in "IP"}


def measure(scene: Scene, data: bytes, passes: int, record: Record) -> bool:
    """Measure all ways, and say whether that was possible; what is known is always in the record."""
    from gsvc_conformance.adapters.cuda import environment

    what = f"frame of profile main, {scene.name}"
    works = {
        "decode": f"{what}: from bytes to 8 bits on the device, bounded",
        "exact_decode": f"{what}: from bytes to 8 bits on the device, deterministic",
        "encode_I": f"{what}: encode an I-frame, preset quick",
        "encode_P": f"{what}: encode a P-frame, preset quick",
    }
    cuda: dict[str, Any] = {"implementation": MODULE, "settings": {}, "environment": environment()}
    ours: dict[str, Any] = {"implementation": "gsvc_ref", "settings": {}, "environment": {}}
    for entry in (cuda, ours):
        entry |= {"seconds": {}, "missing": {}}
    record.keep(works=works, rates=["decode", "exact_decode"], implementations=[cuda, ours])
    for work, exact in (("decode", False), ("exact_decode", True)):
        with noting(cuda["missing"], work):
            cuda["seconds"][work] = decoded(data, exact, passes)
        record.keep()
    for entry, device in ((cuda, "cuda"), (ours, "cpu")):
        with noting(entry["missing"], "encode"):
            found = encoded(scene, FRAMES, device)
            entry["seconds"] |= {f"encode_{kind}": spread(seconds) for kind, seconds in found.items()}
        record.keep()
    record.end()
    return not cuda["missing"]


def main(words: Sequence[str] | None = None) -> None:
    """Measure and keep the numbers."""
    from gsvc_tools.editing import concat

    parser = argparse.ArgumentParser(prog="python -m tests.gpu.codec", description=__doc__)
    parser.add_argument("--small", action="store_true", help="a small picture and stream")
    parser.add_argument("--processor", action="store_true", help="do no more than encode on the processor")
    parser.add_argument("--json", type=Path, required=True, metavar="FILE", help="where the numbers go")
    arguments = parser.parse_args(words)
    scene = SMALL[0] if arguments.small else next(one for one in TRAINED if one.count == STREAM)
    if arguments.processor:
        Record(arguments.json).end(seconds=encoded(scene, FRAMES, "cpu"))
        return
    data = BytesIO()
    if arguments.small:
        video = [np.rint(255 * picture(scene.width, scene.height)).astype(np.uint8)] * 2
        gsvc_ref.encode(video, data, Settings.quick(splats=scene.count, profile="main"))
    else:
        concat([stream(STREAM, "main")] * COPIES, data)
    if not measure(scene, data.getvalue(), 1 if arguments.small else PASSES, Record(arguments.json)):
        sys.exit(2)


if __name__ == "__main__":
    main()
