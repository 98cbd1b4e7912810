"""``streams``: write random legal streams with what they decode to, for soak tests."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Final

from gsvc_base.cli.arguments import size, whole
from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import plural, show
from gsvc_base.errors import UsageError
from gsvc_conformance.commands import count, times
from gsvc_conformance.profiles import PROFILES

if TYPE_CHECKING:
    from gsvc_ref.testing.random_streams import Wishes

ELEMENTS: Final = {
    "level": ("level", 1, 5, "level of spec.md section 5", PROFILES),
    "bit_depth": ("bit-depth", 8, 16, "bits of a sample", PROFILES),
    "lane_count": ("lanes", 1, 64, "lanes of entropy coding, of profile main a power of two and the most", PROFILES),
    "cholesky_bits": ("cholesky-bits", 1, 12, "bits of a Cholesky code", ("paper",)),
    "color_stages": ("color-stages", 1, 8, "most stages of codebooks", ("paper",)),
    "color_codewords": ("codewords", 1, 1024, "most codewords of a stage", ("paper",)),
    "entropy_precision": ("entropy-precision", 12, 16, "bits of entropy coding", ("paper",)),
    "layer_count": ("layers", 1, 4, "the base and the layers above it", ("main",)),
}
"""By element of the sequence header: its option, the ends of its range, what it is, and the profiles that have it."""

YES_OR_NO: Final = {"yes": True, "no": False}


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.epilog = (
        "The same seed and options give the same bytes. Of each stream OUT has NAME.gsvc; NAME.counts.npy, how many "
        "splats each frame has; NAME.parameters.npy, the splats of all frames one after the other; NAME.frames.npy, "
        "rendered deterministically; and NAME.lowest.npy and NAME.highest.npy, between which bounded rendering must "
        "stay. Where a stream has layers, these files are about its base, and NAME.layer_L.counts.npy and "
        "NAME.layer_L.parameters.npy are its splats with layer L. OUT/index.json lists the streams. What is not asked "
        "for is drawn: any value that a stream may have."
    )
    parser.add_argument("folder", type=Path, metavar="OUT", help="where to write: a new or empty folder")
    parser.add_argument("--seed", type=count, default=0, metavar="S", help="a number from 0 (default: 0)")
    parser.add_argument("--count", type=times, default=10, metavar="K", help="how many streams (default: 10)")
    parser.add_argument(
        "--profile",
        choices=PROFILES,
        help="streams of this profile (default: of all that have what is asked for, in turn)",
    )
    parser.add_argument("--without-frames", action="store_true", help="write no frames, which take most of the time")
    parser.add_argument(
        "--jobs", type=times, default=1, metavar="J", help="processes that make them at the same time; same bytes (1)"
    )
    parser.add_argument(
        "--scheduler", metavar="tcp://HOST:8786",
        help="make them on the workers of this scheduler of dask (pip install 'gsvc_ref[cluster]'); same bytes",
    )  # fmt: skip
    parser.add_argument("--quiet", action="store_true", help="show no progress")
    wishes = parser.add_argument_group("what every stream has", "what is left out is drawn")
    wishes.add_argument("--size", type=size, metavar="WxH", help="pixels of a frame, such as 64x48")
    wishes.add_argument("--frames", type=times, metavar="T", help="number of frames")
    wishes.add_argument("--splats", type=count, metavar="N", help="splats of every frame, without layers")
    wishes.add_argument(
        "--types", default="IPR", metavar="LETTERS",
        help="types of the frames after the first, which is an I-frame; a letter that stands there three times is "
        "drawn three times as often: PPPR (IPR)",
    )  # fmt: skip
    for element, (option, low, high, what, profiles) in ELEMENTS.items():
        wishes.add_argument(
            f"--{option}",
            type=within(low, high),
            dest=element,
            metavar="N",
            help=f"{what}, {low} to {high}{of_profile(profiles)}",
        )
    for option, what in (("index", "an index"), ("ancillary", "ancillary chunks"), ("paced", "the limits of a second")):
        wishes.add_argument(f"--{option}", choices=YES_OR_NO, help=f"whether they have {what}")


def of_profile(profiles: tuple[str, ...]) -> str:
    """The profile in words, if not all have it."""
    return "" if profiles == PROFILES else f" (profile {profiles[0]})"


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


def profiles_of(arguments: Namespace) -> list[str]:
    """The profiles that have what the options ask for: of all, or of the one that is named.

    Raises
    ------
    UsageError
        There is none.
    """
    found = [arguments.profile] if arguments.profile else list(PROFILES)
    for element, (option, _, _, _, profiles) in ELEMENTS.items():
        if (value := getattr(arguments, element)) is None:
            continue
        own = ("paper",) if element == "lane_count" and value & (value - 1) else profiles
        found = [profile for profile in found if profile in own]
        if not found:
            beside = f"profile {arguments.profile}" if arguments.profile else "the other options"
            raise UsageError(f"--{option} {value} is of profile {own[0]}, which does not go with {beside}")
    return found


@contextmanager
def _workers(arguments: Namespace) -> Iterator[Executor | None]:
    """What makes the streams: workers of a scheduler, processes, or, if this is None, the command itself."""
    from gsvc_tools.cli.where import opened_workers
    from gsvc_tools.jobs.processes import Processes, check_jobs

    check_jobs(arguments.jobs)
    if arguments.scheduler is not None or arguments.jobs == 1:
        with opened_workers(arguments.scheduler) as executor:
            yield executor
        return
    processes = Processes(min(arguments.jobs, arguments.count), preload="gsvc_conformance.streams")
    try:
        yield processes
    finally:
        processes.kill()


def run(arguments: Namespace) -> int:
    """Write them; 0.

    Raises
    ------
    UsageError
        No stream has what is asked for, or the folder is not empty.
    """
    from gsvc_conformance.streams import write_streams

    import_module("numba")  # if it is missing, this is said before any work
    wishes, profiles = wishes_of(arguments), profiles_of(arguments)
    with ProgressDisplay(quiet=arguments.quiet) as display, _workers(arguments) as executor:
        display.status("getting ready; the first run compiles kernels, half a minute")

        def on_stream(number: int) -> None:
            display.update(f"stream {number + 1} of {arguments.count}", number, arguments.count)

        write_streams(
            arguments.seed, arguments.count, arguments.folder, on_stream,
            wishes=wishes, profiles=profiles, pictures=not arguments.without_frames, executor=executor,
        )  # fmt: skip
    show(f"{plural(arguments.count, 'stream')} in {arguments.folder}")
    return 0
