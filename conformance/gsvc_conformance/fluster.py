"""Test suites for fluster, the framework in which video decoders are compared: https://github.com/fluendo/fluster.

There is a suite of the streams of `decode_stream_deterministic` for each profile, and one of the streams of
`decode_layers`, whose test vectors name the layer up to which a decoder shows them. The result of each is the MD5 of
its frames, rendered deterministically, as raw video. A frame is three planes, G, B and R, each row by row; a sample has
one byte where the bit depth is 8, else two, the least significant first. Which is fluster's `gbrp` and its kin. As a
program this module writes such a file, by the decoder inside spec.md: ``python -m gsvc_conformance.fluster IN.gsvc
OUT.raw``, and for a stream with layers ``IN.gsvc OUT.raw LAYER``.
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

OPERATIONS: Final = ("decode_stream_deterministic", "decode_layers")
LAYERS: Final = "GSVC-layers"
SUITES: Final = ("GSVC-paper", "GSVC-main", LAYERS)
CODEC: Final = "None"
"""Fluster has a closed list of codecs, without GSVC in version 0.8.0; the decoder class says the same."""
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
    """Write suites, streams and decoder class to a folder; returns the number of test vectors.

    There come ``test_suites/SUITE.json``, ``resources/SUITE/NAME/NAME.gsvc`` and ``decoders/gsvc.py``.

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
    tests: dict[str, list[dict[str, Any]]] = {suite: [] for suite in SUITES}
    for vector in read.read(read.select(Selection(operations=OPERATIONS))):
        test = _test(vector)
        (folder / test["source"]).parent.mkdir(parents=True)
        (folder / test["source"]).write_bytes(vector.inputs["stream"])
        tests[suite_of(vector)].append(test)
    of_set = quoted(str(read.set.number) if read.set else "", read.sha256)
    files = {"decoders/gsvc.py": DECODER.read_text(encoding="utf-8")}
    for name in SUITES:
        suite = {
            "name": name,
            "codec": CODEC,
            "description": f"{of_set}: {'streams with layers' if name == LAYERS else 'class deterministic: streams'}",
            "test_method": "md5",
            "test_vectors": tests[name],
        }
        files[f"test_suites/{name}.json"] = json.dumps(suite, indent=4) + "\n"
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(data, encoding="utf-8")
    return sum(map(len, tests.values()))


def suite_of(vector: Vector) -> str:
    """The suite that a vector belongs to."""
    return LAYERS if "layer" in vector.inputs else f"GSVC-{vector.manifest['profile']}"


def _test(vector: Vector) -> dict[str, Any]:
    """A vector as fluster's test vector."""
    tier, _, slug = vector.id.split("/")
    name = f"{tier}-{slug}"
    stream, layer = vector.inputs["stream"], vector.inputs.get("layer")
    depth = Decoding(stream).header["bit_depth"]
    frames = vector.expected["frames"].value if layer is None else decoded(stream, layer)
    return {
        "name": name,
        "source": f"resources/{suite_of(vector)}/{name}/{name}.gsvc",
        "source_checksum": _md5(stream),
        "input_file": f"{name}.gsvc",
        "output_format": FORMATS.get(depth, OTHER_FORMAT),
        "result": _md5(raw_video(np.asarray(frames))),
        **({} if layer is None else {"optional_params": {"layer": layer}}),
    }


def decoded(stream: bytes, layer: int) -> NDArray[Any]:
    """The frames of a stream in the quality of a layer, rendered deterministically by the decoder inside spec.md.

    Raises
    ------
    UsageError
        The stream has a fault; the message is its kind, rule and bit.
    """
    decoding = Decoding(stream, quality=layer)
    frames = [rendered(frame, decoding.header) for frame in decoding.frames()]
    if decoding.fault:
        raise UsageError(str(decoding.fault))
    return np.stack(frames)


def _md5(data: bytes) -> str:
    return hashlib.md5(data, usedforsecurity=False).hexdigest()


def lines(folder: Path, count: int) -> Iterable[str]:
    """What to do with the suite."""
    yield f"{folder}: {count} test vectors for fluster. Put the decoder class into fluster, and run a suite:"
    yield f"  cp {folder}/decoders/gsvc.py FLUSTER/fluster/decoders/"
    for suite in SUITES:
        yield (f'  GSVC_DECODER="CMD" fluster -tsd {folder}/test_suites -r {folder}/resources run -ts {suite} -d GSVC')


def main(words: list[str], say: Callable[[str], object] = lambda text: print(text, file=sys.stderr)) -> int:
    """Decode a stream to raw video by the decoder inside spec.md."""
    if len(words) not in (2, 3) or words[2:] not in ([], *([str(layer)] for layer in range(4))):
        say("give two names, and perhaps a layer, 0 to 3: python -m gsvc_conformance.fluster IN.gsvc OUT.raw LAYER")
        return 2
    source, target = map(Path, words[:2])
    try:
        frames = decoded(source.read_bytes(), int(words[2]) if words[2:] else 0)
    except UsageError as fault:
        say(f"{source}: {fault}")
        return EXIT_REFUSED
    target.write_bytes(raw_video(frames))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
