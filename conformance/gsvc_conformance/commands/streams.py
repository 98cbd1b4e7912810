"""``streams``: write random legal streams with what they decode to, for soak tests."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from gsvc_ref.cli.arguments import whole
from gsvc_ref.cli.progress import ProgressDisplay
from gsvc_ref.cli.text import plural, show
from gsvc_ref.errors import UsageError


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.epilog = (
        "The same seed gives the same bytes. Of each stream OUT has NAME.gsvc; NAME.counts.npy, how many splats each "
        "frame has; NAME.parameters.npy, the splats of all frames one after the other; NAME.frames.npy, rendered "
        "deterministically; and NAME.lowest.npy and NAME.highest.npy, between which bounded rendering must stay. "
        "OUT/index.json lists them."
    )
    parser.add_argument("folder", type=Path, metavar="OUT", help="where to write")
    parser.add_argument("--seed", type=whole, default=0, metavar="S", help="a number from 0 (default: 0)")
    parser.add_argument("--count", type=whole, default=10, metavar="K", help="how many (default: 10)")
    parser.add_argument("--quiet", action="store_true", help="show no progress")


def run(arguments: Namespace) -> int:
    """Write them; 0."""
    if arguments.seed < 0 or arguments.count < 1:
        raise UsageError("the seed must be 0 or more and the count 1 or more")
    from gsvc_conformance.streams import write_streams

    with ProgressDisplay(quiet=arguments.quiet) as display:
        display.status("getting ready; the first run compiles kernels, half a minute")

        def on_stream(number: int) -> None:
            display.update(f"stream {number + 1} of {arguments.count}", number, arguments.count)

        write_streams(arguments.seed, arguments.count, arguments.folder, on_stream)
    show(f"{plural(arguments.count, 'stream')} in {arguments.folder}")
    return 0
