"""``gsvc bench``: rate-distortion curves, BD-rates and seconds of GSVC and other codecs on a clip, as a page."""

import shlex
import tempfile
from argparse import ArgumentTypeError, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from gsvc_base.cli.arguments import frame_range, size, whole
from gsvc_base.cli.errors import EXIT_INTERRUPTED, say
from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import print_json, show, table
from gsvc_base.errors import UsageError
from gsvc_lab.cli.report import check_page
from gsvc_ref.cli.files import STDIO, add_background, check_input
from gsvc_tools.cli.where import opened_workers

if TYPE_CHECKING:
    from gsvc_lab.bench.planes import PlanarClip
    from gsvc_lab.bench.runner import Entry, Measured

COMMAND: Final = "gsvc bench"
FRAMES: Final = 16
SIZE: Final = (352, 288)
POINTS: Final = 4


def add_command(commands: Any) -> None:
    """Add the command to the subparsers of ``gsvc``."""
    parser = commands.add_parser(
        "bench",
        help="set GSVC against other codecs on a clip: curves, BD-rates, seconds",
        description="Encode a clip by GSVC and by other codecs at several qualities, and write a page with "
        "rate-distortion curves, BD-rates, and seconds of encoding and decoding. Codecs need the extra bench: pip "
        "install 'gsvc_ref[bench]'. After Ctrl-C the page has what was measured.",
        allow_abbrev=False,
    )
    parser.set_defaults(run=run)
    parser.add_argument("clip", metavar="CLIP", help="a video, a folder of PNG files, or a scene such as scene:pan")
    parser.add_argument(
        "--codecs", type=names, metavar="LIST",
        help="of gsvc, gsvc-slow, gsvc-paper, x264, x264-ip (I- and P-frames only), x265, svt-av1, vvenc, with commas "
        "between; the first is set against the others (default: gsvc,x264,x264-ip,x265,svt-av1,vvenc)",
    )  # fmt: skip
    parser.add_argument(
        "--frames", type=frame_range, default=(0, FRAMES), metavar="A:B",
        help=f"take frames A to B-1 (default: 0:{FRAMES})",
    )  # fmt: skip
    part = parser.add_mutually_exclusive_group()
    part.add_argument(
        "--size", type=size, default=SIZE, metavar="WxH",
        help=f"take at most so much out of the middle of the picture (default: {SIZE[0]}x{SIZE[1]})",
    )  # fmt: skip
    part.add_argument("--whole", action="store_true", help="take the whole picture")
    parser.add_argument(
        "--points", type=whole, default=POINTS, metavar="P", help=f"points of a curve, 2 to 6 (default: {POINTS})"
    )
    add_background(parser)
    parser.add_argument("-o", "--output", metavar="PAGE", help="the page to write (default: CLIP's name-bench.html)")
    parser.add_argument(
        "--scheduler", metavar="tcp://HOST:8786",
        help="measure the points of GSVC at the same time on the workers of this scheduler of dask (extra cluster; "
        "docs/cluster.md), whose seconds are then on the page; other codecs run here",
    )  # fmt: skip
    parser.add_argument(
        "--threads", type=whole, metavar="T", help="threads to compute with (default: all; with --scheduler one)"
    )
    parser.add_argument("--json", action="store_true", help="print all points and BD-rates as JSON, and only that")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")


def names(text: str) -> tuple[str, ...]:
    """``gsvc,x264`` is ("gsvc", "x264")."""
    listed = tuple(name.strip() for name in text.split(",") if name.strip())
    if not listed:
        raise ArgumentTypeError(f"{text!r} names no coder; give names with commas between, such as gsvc,x264")
    return listed


def run(arguments: Namespace) -> int:
    """Measure and write the page; 0, or 130 when it was interrupted."""
    if arguments.clip == STDIO:
        raise UsageError("every coder reads the clip, and standard input can be read once: save it to a file")
    if not 2 <= arguments.points <= 6:
        raise UsageError(f"--points {arguments.points}: a curve has 2 to 6 points")
    check_input(arguments.clip, folder_allowed=True)
    page = arguments.output or f"{Path(arguments.clip.rpartition(':')[2]).stem}-bench.html"
    check_page(page, arguments.clip)
    from gsvc_lab.bench import runner
    from gsvc_lab.bench.page import write_page
    from gsvc_ref.cli.compilation import compilation_notice

    entries = runner.chosen(arguments.codecs or runner.DEFAULT)
    silent = arguments.quiet or arguments.json
    with (
        tempfile.TemporaryDirectory(prefix="gsvc-bench-") as name,
        compilation_notice(COMMAND, silent=silent),
        ProgressDisplay(quiet=arguments.quiet) as display,
        opened_workers(arguments.scheduler) as executor,
    ):
        clip = _load(arguments, Path(name))
        if not silent:
            video = clip.format
            show(
                f"{clip.title}: {clip.frame_count} frames of {video.width}x{video.height}, {clip.note}; "
                f"{arguments.points} points of {', '.join(entry.name for entry in entries)}"
            )
        display.status("loading kernels")
        if executor is None:
            _warm_up(entries, Path(name))
        measured = runner.measure(
            clip, entries, arguments.points, Path(name), arguments.threads, display.update, executor
        )
    if not measured.count and not measured.interrupted:
        reasons = "; ".join(f"{name}: {why}" for name, why in measured.missing.items())
        raise UsageError(f"no coder could be run: {reasons}")
    if not measured.count:
        say(COMMAND, "interrupted before the first point; nothing was written")
        return EXIT_INTERRUPTED
    write_page(measured, entries, _command(arguments, page), page)
    if arguments.json:
        print_json(bench_object(measured, entries))
    elif not arguments.quiet:
        show("", *describe(measured, entries), "", f"{page}: open it in a browser")
    if measured.interrupted:
        say(COMMAND, f"interrupted; {page} has {measured.count} of {measured.planned} points")
        return EXIT_INTERRUPTED
    return 0


def _load(arguments: Namespace, folder: Path) -> "PlanarClip":
    from gsvc_lab.bench.planes import from_any

    start, stop = arguments.frames
    count = 10**9 if stop is None else stop - start
    return from_any(
        arguments.clip,
        folder / "clip.yuv",
        count,
        None if arguments.whole else arguments.size,
        start,
        arguments.background,
    )


def _warm_up(entries: "list[Entry]", folder: Path) -> None:
    """Compile what GSVC and the metrics need, so that no point waits for it."""
    from gsvc_lab.bench.coders import Coder
    from gsvc_lab.bench.measure import warm_up

    warm_up([entry.coder for entry in entries if isinstance(entry.coder, Coder)], folder)


def _command(arguments: Namespace, page: str) -> str:
    """The command that measures the same again."""
    start, stop = arguments.frames
    words = ["gsvc", "bench", arguments.clip, "--frames", f"{start}:{'' if stop is None else stop}"]
    words += ["--codecs", ",".join(arguments.codecs)] if arguments.codecs else []
    words += ["--whole"] if arguments.whole else ["--size", f"{arguments.size[0]}x{arguments.size[1]}"]
    words += ["--points", str(arguments.points)]
    words += ["--background", f"#{bytes(arguments.background).hex()}"] if arguments.background else []
    words += ["--threads", str(arguments.threads)] if arguments.threads is not None else []
    words += ["--scheduler", arguments.scheduler] if arguments.scheduler is not None else []
    return shlex.join([*words, "-o", page])


def describe(measured: "Measured", entries: "list[Entry]") -> list[str]:
    """Ends of the curves and BD-rates in lines."""
    from gsvc_lab.bench.page import rates
    from gsvc_lab.bench.tables import cell

    found = {one.anchor: cell(one.rates["psnr"]) for one in rates(measured.curves, entries)}
    rows = []
    for curve in measured.curves:
        if not curve.points:
            rows.append([curve.coder, "–", "–", "–", "not run" if curve.missing else "–"])
            continue
        first, last = curve.points[0], curve.points[-1]
        rows.append(
            [
                curve.coder,
                f"{first.bits_per_pixel:.3f} to {last.bits_per_pixel:.3f}",
                f"{first.psnr:.2f} to {last.psnr:.2f}",
                f"{first.encoding_seconds:.3f} to {last.encoding_seconds:.3f}",
                found.get(curve.coder, ""),
            ]
        )
    lines = table(["coder", "bits/pixel", "PSNR, dB", "encoding, s/frame", f"{entries[0].name} against it"], rows)
    lines += [f"note: {name} could not be run: {why}" for name, why in measured.missing.items()]
    return [*lines, f"The last column has the BD-rate in PSNR: the bits that {entries[0].name} takes more."]


def bench_object(measured: "Measured", entries: "list[Entry]") -> dict[str, Any]:
    """Everything measured, for ``--json``."""
    from gsvc_lab.bench.page import rates

    clip = measured.clip
    return {
        "clip": clip.title,
        "note": clip.note,
        "format": clip.format,
        "interrupted": measured.interrupted,
        "curves": measured.curves,
        "bd_rates": rates(measured.curves, entries),
    }
