"""``python -m tests.gpu.golden``: what gsvc_ref makes of the splats on the CPU, as digests to pack.

The file is

    {"sums": {"1920x1080_10000": ["SHA-256 of the splats", "SHA-256 of their deterministic sum"], ...},
     "streams": {"stream_main_10000": ["SHA-256 of the stream", "SHA-256 of its deterministic frames"], ...},
     "blocks": ["SHA-256 of the deterministic sums of draws 0 to 99", ...]}
"""

import argparse
import hashlib
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from numpy.typing import NDArray

from gsvc_base.arrays import F4
from gsvc_base.files import write_text
from gsvc_lab.benchmarks.material import CACHE, stream, trained_path
from gsvc_ref import decode_stream_deterministic, render_sum_deterministic
from tests.gpu.splats import DRAWS, STREAM, TRAINED, Scene, drawn

GOLDEN: Final = CACHE / "golden.json"
BLOCK: Final = 100
"""Draws that have one digest."""

Render = Callable[[F4, int, int], F4]
"""A function from splats, width and height to the sum (9-2), (H, W, 3) f4."""


def digest(*arrays: NDArray[Any] | bytes) -> str:
    """SHA-256 of the bytes of arrays."""
    return hashlib.sha256(b"".join(bytes(array) for array in arrays)).hexdigest()


def block_sums(block: int, render: Render) -> list[F4]:
    """The sums of a block of draws."""
    return [render(*drawn(number)) for number in range(BLOCK * block, BLOCK * (block + 1))]


def made(path: Path, scenes: Sequence[Scene], streams: Sequence[Path], draws: int) -> dict[str, Any]:
    """The digests of scenes, streams and so many draws, with those that the file has already; they are kept in it."""
    known: dict[str, Any] = {"sums": {}, "streams": {}, "blocks": []}
    known |= json.loads(path.read_text()) if path.exists() else {}
    for scene in scenes:
        splats = scene.splats()
        if known["sums"].get(scene.id, [""])[0] != digest(splats):
            total = render_sum_deterministic(splats, scene.width, scene.height)
            known["sums"][scene.id] = [digest(splats), digest(total)]
    for one in streams:
        data = one.read_bytes()
        if known["streams"].get(one.stem, [""])[0] != digest(data):
            known["streams"][one.stem] = [digest(data), digest(decode_stream_deterministic(data))]
    blocks = known["blocks"]
    while BLOCK * len(blocks) < draws:
        blocks.append(digest(*block_sums(len(blocks), render_sum_deterministic)))
        if len(blocks) % 20 == 0:
            print(f"{BLOCK * len(blocks):,} of {draws:,} draws on the CPU", file=sys.stderr, flush=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(json.dumps(known, indent=1) + "\n", path)
    return known


def coded() -> Path:
    """The stream that is decoded."""
    return stream(STREAM, "main")


def material() -> list[Path]:
    """The files of splats and streams, made if they are missing."""
    for scene in TRAINED:
        scene.splats()
    return [*(trained_path(scene.width, scene.height, scene.count) for scene in TRAINED), coded()]


def main(words: Sequence[str] | None = None) -> None:
    """Make what is missing."""
    parser = argparse.ArgumentParser(prog="python -m tests.gpu.golden", description=__doc__)
    parser.add_argument("--json", type=Path, default=GOLDEN, metavar="FILE", help="where the digests go")
    parser.add_argument("--draws", type=int, default=DRAWS, metavar="N", help=f"random sets of splats ({DRAWS:,})")
    parser.add_argument("--list", action="store_true", help="name the files that this makes, and that measuring needs")
    arguments = parser.parse_args(words)
    if arguments.list:
        print(*material(), arguments.json, sep="\n")
        return
    made(arguments.json, TRAINED, [coded()], arguments.draws)


if __name__ == "__main__":
    main()
