"""Random legal streams with what must come of them, for soak tests: `gsvc-conformance streams`.

They are those of gsvc_ref's Hypothesis strategy `streams`, made from seeds.
"""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from gsvc_conformance.element_values import used
from gsvc_conformance.operation import operations
from gsvc_conformance.vectors import npy
from gsvc_ref.stream import decode_stream_deterministic, reconstruct_stream
from gsvc_ref.testing.random_streams import Stream, random_stream

MAX_PIXELS: Final = 4096
"""Maximum number of pixels of a frame, of any shape from 4096x1 to 1x4096: sixty streams take a few megabytes."""

PARTS: Final = ("counts", "parameters", "frames", "lowest", "highest")
"""Files of each stream, besides the stream."""


def stream_of(seed: int, number: int) -> Stream:
    """Stream `number` of a seed, the same for any count."""
    return random_stream(seed << 32 | number, max_pixels=MAX_PIXELS)


def write_streams(seed: int, count: int, folder: Path, on_stream: Callable[[int], object] = id) -> None:
    """Write `count` streams of a seed, and index.json.

    Of each there are NAME.gsvc; NAME.counts.npy and NAME.parameters.npy as reconstruct_stream has them;
    NAME.frames.npy as decode_stream_deterministic has them; and NAME.lowest.npy and NAME.highest.npy, between which
    the frames of decode_stream must lie. index.json lists for each its name, the SHA-256 of the stream, its header,
    and how often each syntax element occurs in it.

    Parameters
    ----------
    seed, count, folder
        The streams and the folder that they are written to.
    on_stream
        Is called before each stream with its number.
    """
    folder.mkdir(parents=True, exist_ok=True)
    entries: list[dict[str, Any]] = []
    for number in range(count):
        on_stream(number)
        stream = stream_of(seed, number)
        name = f"stream-{seed}-{number:04}"
        expected = {**reconstruct_stream(stream.data)._asdict(), "frames": decode_stream_deterministic(stream.data)}
        interval = operations()["decode_stream"].oracle(stream=stream.data)["frames"]
        expected |= {end: getattr(interval, end) for end in ("lowest", "highest")}
        (folder / f"{name}.gsvc").write_bytes(stream.data)
        for part in PARTS:
            (folder / f"{name}.{part}.npy").write_bytes(npy(np.asarray(expected[part])))
        entries.append(
            {
                "name": name,
                "sha256": hashlib.sha256(stream.data).hexdigest(),
                "header": vars(stream.header),
                "elements": {element: times for element, (_, _, times) in used(stream.data).items()},
            }
        )
    (folder / "index.json").write_text(json.dumps(entries, indent=1) + "\n", encoding="utf-8")
