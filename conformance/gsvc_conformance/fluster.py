"""A test suite for fluster, the framework in which video decoders are compared: https://github.com/fluendo/fluster.

The suite has the streams of `decode_stream_deterministic`; the result of each is the MD5 of its frames as raw video. A
frame is three planes, G, B and R, each row by row; a sample has one byte where the bit depth is 8, else two, the least
significant first. Which is fluster's `gbrp` and its kin. As a program this module writes such a file, by the decoder
inside spec.md: ``python -m gsvc_conformance.fluster IN.gsvc OUT.raw``.
"""

import hashlib
import json
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.errors import UsageError
from gsvc_conformance.encoding import Decoding, rendered
from gsvc_conformance.sets import quoted
from gsvc_conformance.vector import Vector
from gsvc_conformance.vector_folder import Selection, VectorFolder

SUITE: Final = "GSVC"
CODEC: Final = "None"
"""Fluster has a closed list of codecs, without GSVC in version 0.8.0; the decoder class says the same."""
OPERATION: Final = "decode_stream_deterministic"
FORMATS: Final = {8: "gbrp", 10: "gbrp10le", 12: "gbrp12le", 14: "gbrp14le"}
"""Names that fluster has for the layout, by bit depth."""
OTHER_FORMAT: Final = "Unknown"
"""The name for the same layout at a bit depth for which fluster has none."""
DECODER: Final = Path(__file__).with_name("fluster_decoder.py")

EXIT_REFUSED: Final = 1


def raw_video(frames: NDArray[Any]) -> bytes:
    """Frames (T, H, W, 3) u1 or u2 as raw video: of each frame the planes G, B and R."""
    planes = np.moveaxis(frames[..., [1, 2, 0]], -1, 1)
    return np.ascontiguousarray(planes, planes.dtype.newbyteorder("<")).tobytes()


def export(vectors: Path, folder: Path) -> int:
    """Write suite, streams and decoder class to a folder; returns the number of test vectors.

    There come ``test_suites/GSVC.json``, ``resources/GSVC/NAME/NAME.gsvc`` and ``decoders/gsvc.py``.

    Parameters
    ----------
    vectors
        The golden vectors.
    folder
        Where to; it must be empty or not exist.

    Raises
    ------
    UsageError
        The folder has something in it, or there are no vectors.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UsageError(f"{folder} is not empty; give the name of a new folder")
    read = VectorFolder(vectors, "newest")
    tests = []
    for vector in read.read(read.select(Selection(operations=(OPERATION,)))):
        test = _test(vector)
        home = folder / "resources" / SUITE / test["name"]
        home.mkdir(parents=True)
        (home / test["input_file"]).write_bytes(vector.inputs["stream"])
        tests.append(test)
    suite = {
        "name": SUITE,
        "codec": CODEC,
        "description": f"{quoted(str(read.set.number) if read.set else '', read.sha256)}, class deterministic: streams",
        "test_method": "md5",
        "test_vectors": tests,
    }
    for name, data in (
        ("test_suites/GSVC.json", json.dumps(suite, indent=4) + "\n"),
        ("decoders/gsvc.py", DECODER.read_text(encoding="utf-8")),
    ):
        (folder / name).parent.mkdir(parents=True)
        (folder / name).write_text(data, encoding="utf-8")
    return len(tests)


def _test(vector: Vector) -> dict[str, Any]:
    """A vector as fluster's test vector."""
    tier, _, slug = vector.id.split("/")
    name = f"{tier}-{slug}"
    stream = vector.inputs["stream"]
    depth = Decoding(stream).header["bit_depth"]
    return {
        "name": name,
        "source": f"resources/{SUITE}/{name}/{name}.gsvc",
        "source_checksum": _md5(stream),
        "input_file": f"{name}.gsvc",
        "output_format": FORMATS.get(depth, OTHER_FORMAT),
        "result": _md5(raw_video(np.asarray(vector.expected["frames"].value))),
    }


def _md5(data: bytes) -> str:
    return hashlib.md5(data, usedforsecurity=False).hexdigest()


def lines(folder: Path, count: int) -> Iterable[str]:
    """What to do with the suite."""
    yield f"{folder}: {count} test vectors for fluster. Put the decoder class into fluster, and run it:"
    yield f"  cp {folder}/decoders/gsvc.py FLUSTER/fluster/decoders/"
    yield (f'  GSVC_DECODER="CMD" fluster -tsd {folder}/test_suites -r {folder}/resources run -ts {SUITE} -d GSVC')


def main(words: list[str], say: Callable[[str], object] = lambda text: print(text, file=sys.stderr)) -> int:
    """Decode a stream to raw video by the decoder inside spec.md."""
    if len(words) != 2:
        say("give two names: python -m gsvc_conformance.fluster IN.gsvc OUT.raw")
        return 2
    source, target = map(Path, words)
    decoding = Decoding(source.read_bytes())
    frames = [rendered(frame, decoding.header) for frame in decoding.frames()]
    if decoding.fault:
        say(f"{source}: {decoding.fault}")
        return EXIT_REFUSED
    target.write_bytes(raw_video(np.stack(frames)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
