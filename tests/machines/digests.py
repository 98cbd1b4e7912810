"""What this machine makes, as SHA-256: ``python -m tests.machines.digests [PART ...]``; kept in digests.sha256.

``--write`` puts the digests of this machine into that file, for whoever changes on purpose what is made. Any machine is
compared with it, and through it with all others. The golden vectors need no line there: their hash is that of
vectors/SHA256SUMS.
"""

import hashlib
import json
import sys
from argparse import ArgumentParser
from collections.abc import Callable, Iterator
from fractions import Fraction
from io import BytesIO
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

KEPT = Path(__file__).with_name("digests.sha256")
KILLS_STEP = 20  # one in so many vectors that are not large is made again with what it kills


def hashed(parts: Iterator[bytes]) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.hexdigest()


def in_files(array: Any) -> bytes:
    """An array's type, shape and numbers as a little-endian machine has them."""
    little = np.asarray(array)
    little = little.astype(little.dtype.newbyteorder("<"))
    return f"{little.dtype.str} {little.shape} ".encode() + little.tobytes()


def vectors() -> str:
    """The golden vectors, made again by their cases; what they kill is taken as it is stored."""
    from gsvc_conformance import generate
    from gsvc_conformance.vector import VECTORS, sums_of

    made = generate.make(jobs=1, kills_in=VECTORS)
    return hashed(iter([sums_of({**made, **generate.kept(VECTORS, made)})]))


def some_names(step: int = 7) -> list[str]:
    """One in `step` vectors that are not large: the large ones take two thirds of the time of all."""
    from gsvc_conformance.case import TIERS, cases
    from gsvc_conformance.cases import CAPACITY

    return [name for name, case in cases().items() if case.tier in TIERS and CAPACITY not in case.flags][::step]


def some_vectors(*, kills: bool = False) -> str:
    """As `vectors`, but some of them, for the slowest machines; or fewer, with what they kill found again."""
    from gsvc_conformance.generate import vector_files
    from gsvc_conformance.vector import VECTORS, sums_of

    names = some_names(KILLS_STEP) if kills else some_names()
    return hashed(iter([sums_of(dict(vector_files(name, None if kills else VECTORS) for name in names))]))


def scenes() -> str:
    """Two small frames of every built-in scene, and what is known of the second."""
    from gsvc_lab.scenes import Scene, frames, scene_names, truth

    def parts() -> Iterator[bytes]:
        for name in scene_names():
            scene = Scene.named(name).resized(width=64, height=48, frames=2)
            yield from map(in_files, frames(scene))
            for key, value in sorted(truth(scene, 1).items()):
                yield key.encode() + in_files(value)

    return hashed(parts())


def random_streams() -> str:
    """The streams of twenty seeds."""
    from gsvc_ref.testing import random_stream

    return hashed(random_stream(seed).data for seed in range(20))


def random_main_streams() -> str:
    """The streams of profile `main` of twenty seeds, and the splats of their frames."""
    from gsvc_ref.stream import StreamReader
    from gsvc_ref.testing import random_main_stream

    def parts() -> Iterator[bytes]:
        for seed in range(20):
            data = random_main_stream(seed).data
            yield data
            yield from (in_files(frame.splats.to_array()) for frame in StreamReader(data))

    return hashed(parts())


def decoding(precision: str, *, main: bool = False) -> str:
    """The frames of small streams."""
    from gsvc_ref.stream import decode
    from gsvc_ref.testing import random_main_stream, random_stream

    make = random_main_stream if main else random_stream
    streams = (make(seed, max_frames=3, max_count=40, max_pixels=600).data for seed in range(40, 52))
    return hashed(in_files(frame) for stream in streams for frame in decode(stream, precision=precision))


def encoding_of_main() -> str:
    """An encode of profile `main` with few evaluations."""
    from gsvc_ref.encoder.main.settings import InterSettings, IntraSettings

    intra = IntraSettings(initialization=4, refinement=3, rounding=1)
    inter = InterSettings(motion_steps=1, motion_rounds=1, iterations=3, rounded_iterations=2)
    return encoding((12, 9), splats=6, profile="main", intra=intra, inter=inter)


def encoding(size: tuple[int, int], **settings: Any) -> str:
    """An encode of a moving picture in the precision deterministic, and its frames."""
    from gsvc_lab.scenes import Scene, frames
    from gsvc_ref.encoder import Settings, encode
    from gsvc_ref.stream import decode
    from gsvc_ref.video import ColorDescription, VideoFormat

    color = ColorDescription(primaries=1, transfer=13, matrix=0, full_range=True, chroma_location=0)
    form = VideoFormat(*size, Fraction(25), 8, "rgb", color, frame_count=None)
    water = {"kind": "water", "strength": 0.02}
    noise = {"kind": "noise"}
    scene = {"title": "t", "size": size, "frames": 3, "base": {"checker": {"size": 0.3}}, "effects": [water, noise]}
    clip = list(frames(Scene.from_dict(scene)))
    file = BytesIO()
    encode((clip, form), file, Settings.quick(**{"profile": "paper"} | settings, threads=1, precision="deterministic"))
    decoded = decode(file.getvalue(), precision="deterministic")
    return hashed(iter([file.getvalue(), *map(in_files, decoded)]))


PARTS: dict[str, Callable[[], str]] = {
    "vectors": vectors,
    "some-vectors": some_vectors,
    "kills": lambda: some_vectors(kills=True),
    "scenes": scenes,
    "streams": random_streams,
    "streams-main": random_main_streams,
    "decode": lambda: decoding("deterministic"),
    "decode-main": lambda: decoding("deterministic", main=True),
    "decode-exact": lambda: decoding("exact"),
    "decode-fast": lambda: decoding("fast"),
    "encode-small": lambda: encoding((12, 9), splats=6, iterations=2),
    "encode": lambda: encoding((48, 40), splats=60, iterations=20),
    "encode-main": encoding_of_main,
}
"""By name."""

PROMISED = [name for name in PARTS if name != "decode-fast"]
"""What must be the same everywhere; what the fast renderer decodes is looked at, no more."""


SET = ("vectors", "some-vectors", "kills")
"""Parts whose digests are those of vectors/SHA256SUMS or of some of its lines."""


def kept() -> dict[str, str]:
    """The digest that each part must have, by name."""
    from gsvc_conformance.vector import SUMS, VECTORS, set_hash

    sums = (VECTORS / SUMS).read_bytes().splitlines(keepends=True)
    some, kills = (
        hashed(line for line in sums if line.split()[1].decode().rpartition("/")[0] in names)
        for names in ({*some_names()}, {*some_names(KILLS_STEP)})
    )
    lines = (line.split() for line in KEPT.read_text(encoding="utf-8").splitlines())
    whole = set_hash(VECTORS)
    return {"vectors": whole, "some-vectors": some, "kills": kills} | {name: digest for digest, name in lines}


OTHER_BYTES = 3
"""The exit code where what is promised has other bytes; Python itself ends with 1 where something goes wrong."""


def main() -> int:
    parser = ArgumentParser(prog="python -m tests.machines.digests", description=__doc__.partition("\n")[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)} (default: all)")
    parser.add_argument("--write", action="store_true", help=f"write {KEPT.name} again")
    parser.add_argument("--json", action="store_true", help="print a line of JSON for each part")
    arguments = parser.parse_args()
    if unknown := set(arguments.parts) - PARTS.keys():
        parser.error(f"there is no part {unknown.pop()!r}; there are {', '.join(PARTS)}")
    found = {}
    for name in arguments.parts or PARTS:
        start = perf_counter()
        found[name] = PARTS[name]()
        seconds = perf_counter() - start
        line = json.dumps({"part": name, "sha256": found[name], "seconds": round(seconds, 1)})
        print(line if arguments.json else f"{found[name]}  {name}  {seconds:.1f} s", flush=True)
    if arguments.write:
        written = {**kept(), **found} if KEPT.exists() else found
        KEPT.write_text("".join(f"{written[name]}  {name}\n" for name in PARTS if name not in SET and name in written))
        return 0
    wanted = kept()
    return 0 if all(found[name] == wanted.get(name) for name in found if name in PROMISED) else OTHER_BYTES


if __name__ == "__main__":
    sys.exit(main())
