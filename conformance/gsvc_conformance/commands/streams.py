"""``streams``: write random legal streams with what they decode to, for soak tests."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Final

from gsvc_base.cli.arguments import size, whole
from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import plural, show
from gsvc_conformance.commands import count, times

if TYPE_CHECKING:
    from gsvc_ref.testing.random_streams import Wishes

ELEMENTS: Final = {
    "level": ("level", 1, 5, "level of spec.md section 5"),
    "bit_depth": ("bit-depth", 8, 16, "bits of a sample"),
    "lane_count": ("lanes", 1, 64, "lanes of entropy coding"),
    "cholesky_bits": ("cholesky-bits", 1, 12, "bits of a Cholesky code"),
    "color_stages": ("color-stages", 1, 8, "most stages of codebooks"),
    "color_codewords": ("codewords", 1, 1024, "most codewords of a stage"),
    "entropy_precision": ("entropy-precision", 12, 16, "bits of entropy coding"),
}
"""By element of the sequence header: its option, the ends of its range, and what it is."""

YES_OR_NO: Final = {"yes": True, "no": False}


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.epilog = (
        "The same seed and options give the same bytes. Of each stream OUT has NAME.gsvc; NAME.counts.npy, how many "
        "splats each frame has; NAME.parameters.npy, the splats of all frames one after the other; NAME.frames.npy, "
        "rendered deterministically; and NAME.lowest.npy and NAME.highest.npy, between which bounded rendering must "
        "stay. OUT/index.json lists them. What is not asked for is drawn: any value that a stream may have."
    )
    parser.add_argument("folder", type=Path, metavar="OUT", help="where to write: a new or empty folder")
    parser.add_argument("--seed", type=count, default=0, metavar="S", help="a number from 0 (default: 0)")
    parser.add_argument("--count", type=times, default=10, metavar="K", help="how many streams (default: 10)")
    parser.add_argument("--without-frames", action="store_true", help="write no frames, which take most of the time")
    parser.add_argument(
        "--scheduler", metavar="tcp://HOST:8786",
        help="make them on the workers of this scheduler of dask (pip install 'gsvc_ref[cluster]'); same bytes",
    )  # fmt: skip
    parser.add_argument("--quiet", action="store_true", help="show no progress")
    wishes = parser.add_argument_group("what every stream has", "what is left out is drawn")
    wishes.add_argument("--size", type=size, metavar="WxH", help="pixels of a frame, such as 64x48")
    wishes.add_argument("--frames", type=times, metavar="T", help="number of frames")
    wishes.add_argument("--splats", type=count, metavar="N", help="splats of every frame")
    wishes.add_argument(
        "--types", default="IPR", metavar="LETTERS",
        help="types of the frames after the first, which is an I-frame; a letter that stands there three times is "
        "drawn three times as often: PPPR (IPR)",
    )  # fmt: skip
    for element, (option, low, high, what) in ELEMENTS.items():
        wishes.add_argument(
            f"--{option}", type=within(low, high), dest=element, metavar="N", help=f"{what}, {low} to {high}"
        )
    for option, what in (("index", "an index"), ("ancillary", "ancillary chunks"), ("paced", "the limits of a second")):
        wishes.add_argument(f"--{option}", choices=YES_OR_NO, help=f"whether they have {what}")


def within(low: int, high: int) -> Callable[[str], int]:
    """The type of a whole number of a range."""

    def number(text: str) -> int:
        if not low <= (value := whole(text)) <= high:
            raise ArgumentTypeError(f"{text} is not in {low} to {high}")
        return value

    return number


def wishes_of(arguments: Namespace) -> "Wishes":
    """What the options ask for.

    Raises
    ------
    UsageError
        There are no such types of frames.
    """
    from gsvc_ref.testing.random_streams import Wishes

    given = {element: getattr(arguments, element) for element in ELEMENTS}
    if arguments.size:
        given |= dict(zip(("width", "height"), arguments.size, strict=True))
    return Wishes(
        elements={element: value for element, value in given.items() if value is not None},
        frames=arguments.frames, splats=arguments.splats, types=arguments.types.upper(),
        **{name: YES_OR_NO.get(getattr(arguments, name)) for name in ("index", "ancillary", "paced")},
    )  # fmt: skip


def run(arguments: Namespace) -> int:
    """Write them; 0.

    Raises
    ------
    UsageError
        No stream has what is asked for, or the folder is not empty.
    """
    from gsvc_conformance.streams import write_streams
    from gsvc_tools.cli.where import opened_workers

    import_module("numba")  # if it is missing, this is said before any work
    wishes = wishes_of(arguments)
    with ProgressDisplay(quiet=arguments.quiet) as display, opened_workers(arguments.scheduler) as executor:
        display.status("getting ready; the first run compiles kernels, half a minute")

        def on_stream(number: int) -> None:
            display.update(f"stream {number + 1} of {arguments.count}", number, arguments.count)

        write_streams(
            arguments.seed, arguments.count, arguments.folder, on_stream,
            wishes=wishes, pictures=not arguments.without_frames, executor=executor,
        )  # fmt: skip
    show(f"{plural(arguments.count, 'stream')} in {arguments.folder}")
    return 0
