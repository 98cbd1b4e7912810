"""The long checks of hostile input: ``python -m tests.hostile damage`` and ``... memory LEVEL [ENTRY...]``.

``damage`` tries every truncation and every flipped bit of every core stream, with gsvc_ref and with the decoder of
spec.md; ``memory`` measures the peak memory of every way into the decoder for streams at the limits of a level.
"""

import sys
from collections import Counter
from time import perf_counter

from tests.hostile.damage import LibraryDecoder, SpecDecoder, core_streams, damages
from tests.hostile.memory import ENTRIES, table


def try_all() -> bool:
    """Print how many damaged streams ended with which rule; whether each error is the one that spec.md demands."""
    good = True
    streams = core_streams()
    for title, decoder_of in (("gsvc_ref", LibraryDecoder), ("spec.md", SpecDecoder)):
        start, rules = perf_counter(), Counter[str]()
        for name, data in streams.items():
            decoder = decoder_of(data)
            for damage in damages(data):
                error = decoder.outcome(damage.data, damage.offset)
                rules[error.split()[1] if error else "accepted"] += 1
                if error != damage.error:
                    good = False
                    print(f"{title}: {name}, {damage.name}: {error}, must be {damage.error}")
        size = sum(len(data) for data in streams.values())
        counts = ", ".join(f"{rule} {count}" for rule, count in sorted(rules.items()))
        tried = f"{len(streams)} streams, {size} truncations and {8 * size} flips"
        print(f"{title}: {tried} in {perf_counter() - start:.0f} s: {counts}", flush=True)
    return good


def main(arguments: list[str]) -> int:
    """Run what was asked for; 1 if something is wrong."""
    if arguments == ["damage"]:
        return 0 if try_all() else 1
    if len(arguments) > 1 and arguments[0] == "memory" and set(arguments[2:]) <= set(ENTRIES):
        return 0 if table(int(arguments[1]), arguments[2:] or ENTRIES) else 1
    print(f"{__doc__}\nENTRY is one of: {', '.join(ENTRIES)}")
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
