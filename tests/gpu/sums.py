"""``python -m tests.gpu.sums MODULE``: hold deterministic sums against those of the CPU, to the byte.

The implementation renders the scenes, decodes a stream, and renders the draws in blocks; the digests have to be those
that gsvc_ref had.
Where one is not, gsvc_ref renders the same here, and the bytes that differ are counted. If none does, it is the two
processors that differ, which is wrong, too.
"""

import argparse
import multiprocessing
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4
from gsvc_ref import decode_stream_deterministic, render_sum_deterministic
from tests.gpu.golden import BLOCK, GOLDEN, Render, block_sums, coded, digest, made
from tests.gpu.outcome import Record
from tests.gpu.splats import DRAWS, SMALL, TRAINED, Scene
from tests.gpu.survey import ROOT

VECTOR: Final = ROOT / "vectors/core/decode_stream_deterministic/main_pictures_of_a_group/stream.gsvc"
"""A small stream."""


@cache
def renderer(module: str) -> Render:
    """An implementation's function, as the kit calls it."""
    function = import_module(module).render_sum_deterministic

    def render(splats: F4, width: int, height: int) -> F4:
        with np.errstate(all="ignore"):
            total: F4 = function(splats, width, height)["sum"]
        return total

    return render


def differing_bytes(ours: NDArray[Any], theirs: NDArray[Any]) -> int:
    """The number of bytes that differ; all of them if the shape or the type does."""
    if ours.shape != theirs.shape or ours.dtype != theirs.dtype:
        return ours.nbytes
    return int(np.count_nonzero(np.frombuffer(ours.tobytes(), np.uint8) != np.frombuffer(theirs.tobytes(), np.uint8)))


def wrong_in_scene(module: str, scene: Scene, golden: str) -> dict[str, int]:
    """The number of differing bytes of a scene's sum by its name, if it is wrong."""
    splats = scene.splats()
    theirs = renderer(module)(splats, scene.width, scene.height)
    if digest(theirs) == golden:
        return {}
    return {scene.name: differing_bytes(render_sum_deterministic(splats, scene.width, scene.height), theirs)}


def wrong_in_stream(module: str, stream: Path, golden: str) -> dict[str, int]:
    """The number of differing bytes of a stream's frames by its name, if they are wrong."""
    data = stream.read_bytes()
    with np.errstate(all="ignore"):
        theirs = import_module(module).decode_stream_deterministic(data)["frames"]
    if digest(theirs) == golden:
        return {}
    return {stream.stem: differing_bytes(decode_stream_deterministic(data), theirs)}


def wrong_in_block(module: str, block: int, golden: str) -> dict[str, int]:
    """The number of differing bytes of each draw of a block that is wrong, by its name."""
    theirs = block_sums(block, renderer(module))
    if digest(*theirs) == golden:
        return {}
    pairs = zip(block_sums(block, render_sum_deterministic), theirs, strict=True)
    counts = {f"draw {BLOCK * block + k}": differing_bytes(*pair) for k, pair in enumerate(pairs)}
    return {name: count for name, count in counts.items() if count} or {f"draws from {BLOCK * block}": 0}


def compared(
    module: str,
    scenes: Sequence[Scene],
    streams: Sequence[Path],
    draws: int,
    golden: dict[str, Any],
    jobs: int,
    record: Record,
) -> None:
    """Compare everything; what is known so far is always in the record."""
    wrong: dict[str, int] = {}
    record.keep(pictures=[], draws=0, differing={})
    for scene in scenes:
        wrong |= wrong_in_scene(module, scene, golden["sums"][scene.id][1])
        record.keep(pictures=[*record.values["pictures"], scene.name], differing=wrong)
    for stream in streams:
        wrong |= wrong_in_stream(module, stream, golden["streams"][stream.stem][1])
        record.keep(pictures=[*record.values["pictures"], stream.stem], differing=wrong)
    blocks = range(draws // BLOCK)
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        found = pool.map(wrong_in_block, [module] * len(blocks), blocks, golden["blocks"][: len(blocks)])
        for block, counts in enumerate(found):
            wrong |= counts
            record.keep(draws=BLOCK * (block + 1), differing=wrong)
    record.end(wrong=bool(wrong))


def main(words: Sequence[str] | None = None) -> None:
    """Compare and keep what was found."""
    parser = argparse.ArgumentParser(prog="python -m tests.gpu.sums", description=__doc__)
    parser.add_argument("module", help="as for `gsvc-conformance run --module`")
    parser.add_argument("--json", type=Path, required=True, metavar="FILE", help="where the result goes")
    parser.add_argument("--golden", type=Path, default=GOLDEN, metavar="FILE", help="digests of the CPU")
    parser.add_argument("--draws", type=int, default=DRAWS, metavar="N", help=f"random sets of splats ({DRAWS:,})")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes for the draws (1)")
    parser.add_argument("--small", action="store_true", help="a small scene instead of the trained ones")
    arguments = parser.parse_args(words)
    scenes = SMALL if arguments.small else TRAINED
    streams = [VECTOR] if arguments.small else [coded()]
    golden = made(arguments.golden, scenes, streams, arguments.draws)
    compared(arguments.module, scenes, streams, arguments.draws, golden, arguments.jobs, Record(arguments.json))


if __name__ == "__main__":
    main()
