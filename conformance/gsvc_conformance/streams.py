"""Random legal streams with what must come of them, for soak tests: `gsvc-conformance streams`.

They are those of gsvc_ref's Hypothesis strategies `streams` and `main_streams`, made from seeds.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from gsvc_base.errors import UsageError
from gsvc_conformance.element_values import used
from gsvc_conformance.operation import operations
from gsvc_conformance.profiles import PROFILES
from gsvc_conformance.vector import npy
from gsvc_ref.stream import decode_stream_deterministic, reconstruct_layers, reconstruct_stream
from gsvc_ref.testing.choices import SeededChoices
from gsvc_ref.testing.random_main_streams import random_main_stream
from gsvc_ref.testing.random_streams import ANYTHING, Stream, Wishes, random_stream

MAX_PIXELS: Final = 4096
"""Maximum number of pixels of a frame, of any shape from 4096x1 to 1x4096: sixty streams take a few megabytes."""

PICTURES: Final = ("frames", "lowest", "highest")
PARTS: Final = ("counts", "parameters", *PICTURES)
"""Files of each stream, besides the stream."""


def stream_of(seed: int, number: int, wishes: Wishes = ANYTHING, profiles: Sequence[str] = PROFILES) -> Stream:
    """Stream `number` of a seed that has what is wished, of one of the profiles in turn; the same for any count."""
    own = seed << 32 | number
    if profiles[number % len(profiles)] == "paper":
        return random_stream(own, max_pixels=MAX_PIXELS, wishes=wishes)
    choices, elements = SeededChoices(own), dict(wishes.elements)
    if (lanes := elements.pop("lane_count", None)) is not None:
        elements["max_lane_exponent"] = lanes.bit_length() - 1
    ancillary, paced = choices.boolean(), choices.boolean()
    ancillary = ancillary if wishes.ancillary is None else wishes.ancillary
    wishes = replace(wishes, elements=elements, ancillary=ancillary)
    if paced and wishes.paced is None:
        with suppress(UsageError):  # it does not keep the limits of a second
            return random_main_stream(own, max_pixels=MAX_PIXELS, wishes=replace(wishes, paced=True))
    return random_main_stream(own, max_pixels=MAX_PIXELS, wishes=wishes)


def write_streams(
    seed: int,
    count: int,
    folder: Path,
    on_stream: Callable[[int], object] = id,
    *,
    wishes: Wishes = ANYTHING,
    profiles: Sequence[str] = PROFILES,
    pictures: bool = True,
    executor: Executor | None = None,
) -> None:
    """Write `count` streams of a seed, and index.json.

    Of each there are NAME.gsvc; NAME.counts.npy and NAME.parameters.npy as reconstruct_stream has them;
    NAME.frames.npy as decode_stream_deterministic has them; and NAME.lowest.npy and NAME.highest.npy, between which
    the frames of decode_stream must lie. Of a stream with layers these are those of the base, and for each layer L
    there are NAME.layer_L.counts.npy and NAME.layer_L.parameters.npy as reconstruct_layers has them. index.json lists
    for each its name, the SHA-256 of the stream, its header, and how often each syntax element occurs in its base.

    Parameters
    ----------
    seed, count
        The streams.
    folder
        Where they are written to; made if it is not there.
    on_stream
        Is called before each stream with its number.
    wishes
        What each stream has to have.
    profiles
        Their profiles, in turn.
    pictures
        Whether the files of frames are written, which take nearly all of the time.
    executor
        Makes the streams, all asked for at once; None: they are made here. The files are the same.

    Raises
    ------
    UsageError
        No legal stream has what is wished, or the folder is not empty.
    """
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder} is a file; give a folder to write streams to")
    folder.mkdir(parents=True, exist_ok=True)
    if any(folder.iterdir()):  # index.json would not list what an earlier call wrote
        raise UsageError(f"{folder} is not empty: give a new folder, or remove this one first")
    entries: list[dict[str, Any]] = []
    make = partial(files_of, seed, wishes=wishes, profiles=profiles, pictures=pictures)
    made: Iterable[Made] = map(make, range(count)) if executor is None else executor.map(make, range(count))
    streams = iter(made)
    for number in range(count):
        on_stream(number)
        files, entry = next(streams)
        for name, data in files.items():
            (folder / name).write_bytes(data)
        entries.append(entry)
    (folder / "index.json").write_text(json.dumps(entries, indent=1) + "\n", encoding="utf-8")


Made = tuple[dict[str, bytes], dict[str, Any]]
"""The files of a stream by their names, and what index.json says of it."""


def files_of(
    seed: int,
    number: int,
    *,
    wishes: Wishes = ANYTHING,
    profiles: Sequence[str] = PROFILES,
    pictures: bool = True,
) -> Made:
    """Make a stream of a seed; this is what a worker is asked to do."""
    stream = stream_of(seed, number, wishes, profiles)
    name = f"stream-{seed}-{number:04}"
    expected = {**reconstruct_stream(stream.data)._asdict(), **(_pictures(stream.data) if pictures else {})}
    files = {f"{name}.{part}.npy": npy(np.asarray(expected[part])) for part in PARTS if part in expected}
    for layer in range(1, stream.header.layer_count):
        shown = reconstruct_layers(stream.data, layer)
        files |= {f"{name}.layer_{layer}.{part}.npy": npy(getattr(shown, part)) for part in PARTS[:2]}
    entry = {
        "name": name,
        "sha256": hashlib.sha256(stream.data).hexdigest(),
        "header": stream.header.arguments,
        "elements": {element: times for element, (_, _, times) in used(stream.data).items()},
    }
    return {f"{name}.gsvc": stream.data, **files}, entry


def _pictures(stream: bytes) -> dict[str, Any]:
    """The frames of deterministic rendering, and the ends between which those of bounded rendering must lie."""
    interval = operations()["decode_stream"].oracle(stream=stream)["frames"]
    return {"frames": decode_stream_deterministic(stream), **{end: getattr(interval, end) for end in PICTURES[1:]}}
