"""The long checks of hostile input: ``python -m tests.hostile CHECK``, of which ``--help`` has a list.

``damage`` tries every truncation and every flipped bit of every core stream, with gsvc_ref and with the decoder of
spec.md; ``memory`` measures the peak memory of every way into the decoder for streams at the limits of a level;
``resume`` kills encodes and changes what they had kept before it goes on; ``viewer`` measures what a frame at the
limits costs the viewer's decoder, in Node, beside gsvc_ref.
"""

import sys
from argparse import ArgumentParser, ArgumentTypeError, RawDescriptionHelpFormatter
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from gsvc_ref.bitstream import LEVELS
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
    given = build_parser().parse_args(arguments)
    if given.command == "damage":
        return 0 if try_all() else 1
    if given.command == "resume":
        from tests.hostile.resume import kills

        with TemporaryDirectory() as folder:
            return 0 if kills(given.count, given.seed, Path(folder)) else 1
    if given.command == "viewer":
        from tests.hostile import viewer_cost

        return 0 if viewer_cost.table(given.level) else 1
    return 0 if table(given.level, given.entries or ENTRIES) else 1


def build_parser() -> ArgumentParser:
    """The parser of the checks."""
    parser = ArgumentParser("python -m tests.hostile", description="The long checks of hostile input.")
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("damage", help="every truncation and every flipped bit of every core stream")
    killed = commands.add_parser("resume", help="encodes that are killed, and what they kept changed in between")
    killed.add_argument("count", type=int, metavar="KILLS", help="how often an encode is killed")
    killed.add_argument("seed", type=int, nargs="?", default=1, help="of the moments and changes (1)")
    entries = "".join(f"\n  {entry!r}" for entry in ENTRIES)
    memory = commands.add_parser(
        "memory", help="peak memory of decoding streams at the limits of a level", epilog=f"ENTRY is one of:{entries}",
        formatter_class=RawDescriptionHelpFormatter,
    )  # fmt: skip
    viewer = commands.add_parser("viewer", help="CPU time of a frame in the viewer's decoder, beside gsvc_ref's")
    for command in (memory, viewer):
        command.add_argument("level", type=int, choices=LEVELS, metavar="LEVEL", help=", ".join(map(str, LEVELS)))
    memory.add_argument("entries", nargs="*", type=entry_name, metavar="ENTRY", help="ways into the decoder; all")
    return parser


def entry_name(text: str) -> str:
    """The name of a way into the decoder."""
    if text not in ENTRIES:
        raise ArgumentTypeError(f"there is no entry {text!r}; --help lists them")
    return text


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
