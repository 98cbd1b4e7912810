"""``gsvc import``: splats of any trainer in, a `.gsvc` file out."""

import re
import sys
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Iterator, Sequence
from contextlib import closing
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from gsvc_base.cli.arguments import add_force, finite, frame_rate, key_frames, positive, whole
from gsvc_base.cli.errors import EXIT_DATA, EXIT_INTERRUPTED, say
from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import decibel, plural, print_json, show, to_json
from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.cli.files import STDIO, check_input, check_output, check_stream_name, display_name
from gsvc_tools.cli.encode_progress import progress_callback

if TYPE_CHECKING:
    from gsvc_ref.encoder import EncodeReport

GSVC_IMPORT: Final = "gsvc import"

WRITE_OPTIONS: Final = (
    "profile", "quality", "psnr", "refit", "key_frames", "degenerate", "bit_depth", "level", "cholesky_bits",
    "color_stages", "color_codewords", "seed", "threads", "checksums",
)  # fmt: skip
"""Options that are arguments of `gsvc_ref.write` of the same name."""


CHECKPOINTS: Final = (".pt", ".pth", ".tar", ".ckpt", ".pkl")
"""How the names of files end that hold objects of Python."""


class _SplatFrames(NamedTuple):
    """Frames of splats, and what their files say about them."""

    frames: Any
    files: Sequence[Path]
    """The file of each frame."""
    width: int | None
    height: int | None
    frame_rate: Fraction | None


def add_command(commands: Any) -> None:
    """Add the command to the subparsers of ``gsvc``."""
    parser = commands.add_parser(
        "import",
        help="write splats of any trainer as a .gsvc file",
        description="Write splats that were trained elsewhere as a .gsvc file: an NPZ file of all frames, or a PLY "
        "file as gsplat and 3DGS write it for each frame. No picture is needed. Standard error lists what is lost.",
        allow_abbrev=False,
    )
    parser.set_defaults(run=run)
    parser.add_argument(
        "inputs", metavar="SPLATS", nargs="+",
        help="an NPZ file, PLY files in the order of the frames, or a folder of PLY files",
    )  # fmt: skip
    parser.add_argument("output", metavar="OUT.gsvc", help="the file to write, or - for standard output")
    frames = parser.add_argument_group("frames")
    frames.add_argument("--width", type=whole, metavar="W", help="width of the frames in pixels; PLY needs it")
    frames.add_argument("--height", type=whole, metavar="H", help="height of the frames in pixels; PLY needs it")
    frames.add_argument(
        "--frame-rate", type=frame_rate, metavar="R", help="frames per second, such as 25 or 30000/1001"
    )
    frames.add_argument("--bit-depth", type=whole, metavar="B", help="bits of a sample of decoded frames, 8 to 16")
    frames.add_argument(
        "--key-frames", type=key_frames, metavar="auto|K|LIST",
        help="I-frames: auto (default; where one is better), every K frames, or listed as 0,12,40",
    )  # fmt: skip
    add_units(parser)
    splats = parser.add_argument_group("splats")
    splats.add_argument(
        "--degenerate", choices=("refuse", "turn", "remove"),
        help="splats whose l11 or l22 is not above 0, which cover nothing: refuse them (default), turn signs so that "
        "L L^T stays, for trainers that leave signs open, or remove them",
    )  # fmt: skip
    splats.add_argument(
        "--profile", choices=("main", "paper"),
        help="main (default): few bits; paper: the quantisers of the paper, for splats of any size and place",
    )  # fmt: skip
    splats.add_argument("--seed", type=whole, metavar="S", help="seed of the codebooks, and of the order of rounding")
    main = parser.add_argument_group("profile main")
    main.add_argument(
        "--psnr", type=positive, metavar="DB",
        help="the least PSNR of each frame against the picture of the splats given (default 48)",
    )  # fmt: skip
    main.add_argument("--quality", type=whole, metavar="Q", help="in place of --psnr: how fine codes are, 0 to 79")
    main.add_argument(
        "--refit", choices=("all", "colors", "none"),
        help="how splats of I-frames make up for the rounding of others: in all parameters, by about a step of the "
        "codes (default), in their colours alone, or not at all",
    )  # fmt: skip
    paper = parser.add_argument_group("profile paper", "one of these options chooses it")
    paper.add_argument("--cholesky-bits", type=whole, metavar="b", help="bits of a Cholesky code, 1..12 (default 12)")
    paper.add_argument("--color-stages", type=whole, metavar="M", help="stages of the colour quantiser, 1..8")
    paper.add_argument(
        "--color-codewords", type=whole, metavar="B",
        help="codewords of a stage, 1..1024 (default: stages and codewords that pay for the splats of the first frame)",
    )  # fmt: skip
    stream = parser.add_argument_group("stream")
    stream.add_argument("--level", type=whole, metavar="L", help="level of the stream, 1 to 5 (default: the least)")
    stream.add_argument("--checksums", action="store_true", default=None, help="add a checksum of each frame's splats")
    other = parser.add_argument_group("other")
    other.add_argument("--threads", type=whole, metavar="T", help="threads to measure with")
    other.add_argument("--json", action="store_true", help="print the report as JSON, and only that")
    add_force(parser)
    other.add_argument("--quiet", action="store_true", help="print nothing but errors, and what gets lost")


def add_units(parser: ArgumentParser) -> None:
    """Add the options that say where the units of PLY files are in pixels."""
    units = parser.add_argument_group("units of PLY files")
    units.add_argument(
        "--pixels-per-unit", type=positive, default=1.0, metavar="S", help="pixels of a unit of the file (default 1)"
    )
    units.add_argument(
        "--origin", type=point, default=(0.0, 0.0), metavar="X,Y",
        help="the point of the file at the upper left corner of the frame (default 0,0), whose first pixel has its "
        "centre at (0.5, 0.5); for trainers with pixel centres at whole numbers --origin=-0.5,-0.5",
    )  # fmt: skip


def point(text: str) -> tuple[float, float]:
    """``-0.5,2`` is (-0.5, 2.0)."""
    parts = text.split(",")
    if len(parts) != 2:
        raise ArgumentTypeError(f"{text!r} is not X,Y, such as 0,0 or -0.5,-0.5")
    return finite(parts[0]), finite(parts[1])


def run(arguments: Namespace) -> int:
    """Import; 0, 1 after a fault after the first frame, or 130 when it was interrupted."""
    if arguments.json and arguments.output == STDIO:
        raise UsageError("--json needs standard output, which carries the stream: write to a file, or drop --json")
    for name in arguments.inputs:
        if name == STDIO:
            raise UsageError("splats cannot come from standard input; give a file")
        check_input(name, folder_allowed=True)
        check_output(arguments.output, name)
    check_stream_name(arguments.output, force=arguments.force)
    try:
        return _import(arguments)
    except KeyboardInterrupt:
        say(GSVC_IMPORT, "interrupted before the first frame was complete; nothing was saved")
        return EXIT_INTERRUPTED


def _import(arguments: Namespace) -> int:
    from gsvc_ref import IncompleteEncodeError, write
    from gsvc_ref.cli.compilation import compilation_notice
    from gsvc_tools.writing.given_splats import SplatsError

    lost: list[str] = []
    source = _opened(arguments, lost)
    out = sys.stderr if arguments.output == STDIO else sys.stdout
    talkative = not (arguments.quiet or arguments.json)
    fault = None
    with closing(source.frames):
        width = source.width if arguments.width is None else arguments.width
        height = source.height if arguments.height is None else arguments.height
        if width is None or height is None:
            raise UsageError(
                f"{arguments.inputs[0]} does not say the size of the frames; give --width and --height in pixels"
            )
        rate = arguments.frame_rate or source.frame_rate or Fraction(25)
        options = {name: value for name in WRITE_OPTIONS if (value := getattr(arguments, name)) is not None}
        if talkative:  # what is written may take long, and a file of a few bytes may hold a million frames
            show(f"{arguments.inputs[0]}: {plural(len(source.files), 'frame')}, {width}x{height}", file=out)
        with compilation_notice(GSVC_IMPORT, silent=not talkative), ProgressDisplay(quiet=arguments.quiet) as display:
            try:
                report = write(
                    arguments.output, source.frames, width, height, rate, progress=progress_callback(display), **options
                )
            except IncompleteEncodeError as error:
                fault, report = error, error.report
            except SplatsError as error:
                raise GsvcError("invalid", f"{source.files[error.frame]}: {error}") from None
    lost += [*report.notes, _quantised(report)]
    if arguments.json:
        print_json(report_object(arguments, report, lost))
    else:
        for sentence in lost:
            say(GSVC_IMPORT, f"lost: {sentence}")
        if talkative:
            show(summary(arguments.output, report), file=out)
    if fault is not None:
        place = f"{source.files[fault.__cause__.frame]}: " if isinstance(fault.__cause__, SplatsError) else ""
        say(GSVC_IMPORT, str(GsvcError(fault.kind, place + fault.message, rule=fault.rule, bit=fault.bit)))
        return EXIT_DATA
    return EXIT_INTERRUPTED if report.interrupted else 0


def _opened(arguments: Namespace, lost: list[str]) -> _SplatFrames:
    """The frames of the files; `lost` gets a sentence for each thing that they lose, when they are read."""
    from gsvc_tools.splat_files import NpzSplats

    inputs = [Path(name) for name in arguments.inputs]
    files = [file for path in inputs for file in (_ply_files(path) if path.is_dir() else [path])]
    if odd := next((file for file in files if not file.is_file()), None):  # a pipe would be waited for
        raise UsageError(f"{odd} is not a regular file; give an NPZ file or PLY files")
    if len(inputs) == 1 and inputs[0].suffix.lower() == ".npz":
        splats = NpzSplats(inputs[0])
        return _SplatFrames(splats, inputs * len(splats), splats.width, splats.height, splats.frame_rate)
    if checkpoint := next((file for file in files if file.suffix.lower() in CHECKPOINTS), None):
        raise UsageError(
            f"{checkpoint} is a checkpoint of PyTorch, which is a program to run; docs/splats-in-and-out.md has the "
            "lines that make an NPZ file of one, under 'Checkpoints of GaussianImage and GSVC'"
        )
    if wrong := next((file for file in files if file.suffix.lower() != ".ply"), None):
        raise UsageError(
            f"{wrong} is neither one NPZ file nor PLY; give OUT.gsvc last, and files of one kind before it"
        )
    return _SplatFrames(_flattened(files, arguments, lost), files, None, None, None)


def _ply_files(folder: Path) -> list[Path]:
    """The PLY files of a folder in the order of the numbers in their names."""
    files = [path for path in folder.iterdir() if path.suffix.lower() == ".ply"]
    if not files:
        raise UsageError(f"the folder {folder} holds no .ply files; give one that does")
    return sorted(files, key=lambda path: [(int(n or 0), text) for n, text in re.findall(r"(\d*)(\D*)", path.name)])


def _flattened(files: list[Path], arguments: Namespace, lost: list[str]) -> Iterator[Any]:
    from gsvc_tools.splat_files import from_gaussians, read_ply

    for file in files:
        vertices = read_ply(file)
        flat = from_gaussians(
            vertices.columns, str(file), pixels_per_unit=arguments.pixels_per_unit, origin=arguments.origin
        )
        lost += [sentence for sentence in vertices.lost + flat.lost if sentence not in lost]
        yield flat.parameters


def _quantised(report: "EncodeReport") -> str:
    worst = min(report.frames, key=lambda frame: frame.psnr)
    psnr = decibel(worst.psnr, "no difference in a pixel")
    return f"what quantisers round: frame {worst.number}, the worst, has {psnr} against the splats that were given"


def summary(output: str, report: "EncodeReport") -> str:
    """The result in a line."""
    splats = sum(frame.splats for frame in report.frames)
    each = f", {report.file_bytes / splats:.1f} bytes a splat" if splats else ""
    types = ", ".join(f"{count} {kind}" for kind, count in report.frame_types.items())
    return (
        f"{display_name(output, 'standard output')}: {plural(report.file_bytes, 'byte')}{each}, level "
        f"{report.header.level}; {plural(len(report.frames), 'frame')}: {types}"
    )


def report_object(arguments: Namespace, report: "EncodeReport", lost: list[str]) -> dict[str, Any]:
    """The report for ``--json``."""
    return {
        "inputs": arguments.inputs,
        "output": arguments.output,
        "lost": lost,
        "file_bytes": report.file_bytes,
        "bits_per_pixel": report.bits_per_pixel,
        "mean_psnr": report.mean_psnr,
        "seconds": report.seconds,
        "interrupted": report.interrupted,
        "fault": report.fault,
        "header": report.header.arguments,
        "frames": report.frames,
        "settings": to_json(report.settings),
    }
