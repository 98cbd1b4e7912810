"""The decoder in C against gsvc_ref on random legal streams of profile `main`, and on damaged ones.

    PYTHONPATH=tests/adapters python -m c_differential 20000 --seed 0

Of each stream that many are made, most of them damaged; of each both say counts, parameters to the bit, kind, rule and
offset, in a random quality. The number of streams by rule is printed at the end. With --vectors FOLDER the streams are
those of its legal vectors in the place of random ones.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from gsvc_conformance import reference
from gsvc_conformance.adapters import c
from gsvc_conformance.operation import operations
from gsvc_conformance.server import ServerImplementation
from gsvc_ref.testing import join_chunks, random_main_stream, split_chunks

PREFIX_SIZE, PROFILE_AT = 10, 12
OTHER_PROFILE = "unsupported R-5-6 96"
DAMAGED_OF_EACH = 40
LONGEST = 20_000
EDGES = (0, 1, 2, 7, 15, 16, 63, 64, 127, 128, 191, 192, 240, 254, 255)


def damaged(data: bytes, rng: Random) -> bytes:
    """A stream with other bytes; mostly behind checksums that are right, so that a decoder gets far."""
    chunks = split_chunks(data)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        place = rng.randrange(len(chunks))
        chunk_type, payload = chunks[place]
        way = rng.randrange(12)
        if way < 7 and payload:
            chunks[place] = chunk_type, with_other_bytes(payload, rng)
        elif way == 7:
            chunks[place] = rng.choice((b"I", b"P", b"R", b"n", b"x", b"E", b"H", b"t", b"B", b"1")), payload
        elif way == 8 and len(chunks) > 1:
            del chunks[place]
        elif way == 9:
            chunks.insert(rng.randrange(len(chunks) + 1), chunks[place])
        elif way == 10 and len(chunks) > 1:
            other = rng.randrange(len(chunks))
            chunks[place], chunks[other] = chunks[other], chunks[place]
        elif way == 11:
            chunks[place] = chunk_type, with_other_bytes(payload[: rng.choice((4, 8, 12))], rng) + payload[12:]
    made = join_chunks(chunks, prefix=data[:PREFIX_SIZE])
    return with_other_bytes(made, rng) if rng.randrange(12) == 0 else made


def with_other_bytes(data: bytes, rng: Random) -> bytes:
    """Bytes of which some are set, flipped, put in, or taken out; those in front more often than others."""
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = min(int(len(changed) * rng.random() ** rng.choice((1, 4))), max(0, len(changed) - 1))
        way = rng.randrange(6)
        if way == 0:
            changed[at:at] = rng.randbytes(rng.choice((1, 1, 2, 9)))
        elif way == 1:
            del changed[at : at + rng.choice((1, 1, 2, 9))]
        elif way == 2:
            del changed[at:]
        elif changed:
            changed[at] = changed[at] ^ 1 << rng.randrange(8) if way < 5 else rng.choice(EDGES)
    return bytes(changed)


def legal_vectors(folder: Path) -> list[bytes]:
    """The small streams of profile `main` among the vectors of a folder, but for those that are made to be refused."""
    paths = [path for path in sorted(folder.glob("*/*/*/*.gsvc")) if path.parts[-4] != "faulty"]
    found = [path.read_bytes() for path in paths if path.stat().st_size <= LONGEST]
    return [data for data in found if data[PROFILE_AT] == 1]


def streams(count: int, seed: int, material: Sequence[bytes] = ()) -> Iterator[tuple[bytes, int]]:
    """So many streams, legal and damaged, each with a layer to ask for; without material they are random."""
    rng = Random(seed)
    made = 0
    while made < count:
        sizes: dict[str, Any] = {"max_count": rng.choice((4, 40, 120)), "max_pixels": 1 << 12}
        data = rng.choice(material) if material else random_main_stream(rng.randrange(1 << 30), **sizes).data
        for damage in range(min(DAMAGED_OF_EACH, count - made)):
            yield damaged(data, rng) if damage else data, rng.choice((0, 0, 1, 2, 3))
            made += 1


def compare(implementation: ServerImplementation, data: bytes, layer: int) -> str:
    """Ask both for a stream; the rule that it breaks, or `legal`."""
    name = "reconstruct_layers" if layer else "reconstruct_stream"
    inputs = {"stream": data, "layer": layer} if layer else {"stream": data}
    expected = getattr(reference, name)(**inputs)
    given = implementation.run(operations()[name], inputs)
    assert isinstance(given, dict), given
    if given["error"] == OTHER_PROFILE and data[PROFILE_AT] == 0:
        return "profile paper"
    assert given["error"] == expected["error"], f"{given['error']!r}, expected {expected['error']!r}"
    for output in ("counts", "parameters"):
        assert given[output].tobytes() == np.ascontiguousarray(expected[output]).tobytes(), f"{output} differ"
    return str(expected["error"]).split(" ")[1] if expected["error"] else "legal"


def main() -> int:
    """Compare, and print what differs; the exit code says whether something did."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--vectors", type=Path)
    options = parser.parse_args()
    material = legal_vectors(options.vectors) if options.vectors else []
    rules: Counter[str] = Counter()
    wrong = 0
    with ServerImplementation(f"{c.program(c.FAST)} --serve", 60) as implementation:
        for number, (data, layer) in enumerate(streams(options.count, options.seed, material)):
            try:
                rules[compare(implementation, data, layer)] += 1
            except AssertionError as difference:
                wrong += 1
                path = Path(f"c-differs-{number}.gsvc")
                path.write_bytes(data)
                print(f"{path} in quality {layer}: {difference}")
    print(f"{sum(rules.values())} agree, {wrong} differ: {dict(rules.most_common())}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
