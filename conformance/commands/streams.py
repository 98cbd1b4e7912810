"""``streams``: write random legal streams with what they decode to, for soak tests."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from gsvc_ref.cli.arguments import whole
from gsvc_ref.cli.text import plural
from gsvc_ref.errors import UsageError


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.epilog = "The same seed gives the same streams."
    parser.add_argument("folder", type=Path, metavar="OUT", help="where to write")
    parser.add_argument("--seed", type=whole, default=0, metavar="S", help="a number from 0 (default: 0)")
    parser.add_argument("--count", type=whole, default=10, metavar="K", help="how many (default: 10)")


def run(arguments: Namespace) -> int:
    """Write them; 0."""
    if arguments.seed < 0 or arguments.count < 1:
        raise UsageError("the seed must be 0 or more and the count 1 or more")
    from conformance.streams import write_streams

    write_streams(arguments.seed, arguments.count, arguments.folder)
    print(f"{plural(arguments.count, 'stream')} in {arguments.folder}")
    return 0
