"""``gsvc compare``: the distance of two videos."""

from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from gsvc_base.cli.arguments import add_layer, frame_range
from gsvc_base.cli.errors import EXIT_DATA, say
from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import decibel, plural, print_json, show, table
from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.files import STREAM_SUFFIX
from gsvc_ref.cli.damage import describe_damage
from gsvc_ref.cli.encode import NamedInput
from gsvc_ref.cli.files import (
    STDIO,
    CompleteFrames,
    add_background,
    check_input,
    describe_format,
    display_name,
    open_stream,
    say_damage,
)

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from gsvc_ref.metrics import Comparison, FrameComparison
    from gsvc_ref.rendering import Precision
    from gsvc_ref.stream import Stream
    from gsvc_ref.video import VideoFormat, VideoSource
    from gsvc_ref.video.alpha import Background

GSVC_COMPARE: Final = "gsvc compare"


@dataclass(frozen=True)
class Side:
    """One of the two videos: its name, format, notes of its reader, its frames, and the stream, if it is one."""

    name: str
    format: "VideoFormat"
    notes: list[str]
    frames: CompleteFrames
    start: int = 0
    stream: "Stream | None" = None


def add_command(commands: Any) -> None:
    """Add the command to the subparsers of ``gsvc``."""
    parser = commands.add_parser(
        "compare",
        help="compare two videos: PSNR, MS-SSIM and VMAF",
        description="Compare two videos or .gsvc files frame by frame: PSNR, MS-SSIM, and VMAF where ffmpeg has it.",
        allow_abbrev=False,
    )
    parser.set_defaults(run=run)
    parser.add_argument("original", metavar="A", help="the original: a video, a folder of PNG files, a .gsvc file or -")
    parser.add_argument("other", metavar="B", help="what to compare with it, of the same size")
    parser.add_argument(
        "--frames", type=frame_range, default=(0, None), metavar="A:B", help="compare frames A to B-1 of both only"
    )
    parser.add_argument(
        "--precision", choices=("fast", "deterministic", "exact"), default="fast",
        help="how .gsvc files are rendered, see gsvc decode --help",
    )  # fmt: skip
    add_layer(parser)
    add_background(parser)
    parser.add_argument("--no-vmaf", action="store_true", help="leave out VMAF")
    parser.add_argument("--json", action="store_true", help="print the scores as JSON, and only that")
    parser.add_argument("--quiet", action="store_true", help="print the means only")


def run(arguments: Namespace) -> int:
    """Compare; 0, or 1 when a video is damaged."""
    if arguments.original == arguments.other == STDIO:
        raise UsageError("both videos cannot come from standard input; give a file for one of them")
    for name in (arguments.original, arguments.other):
        check_input(name, folder_allowed=True)
    from gsvc_ref.cli.compilation import compilation_notice  # after the checks: it imports the compiler

    like = _format_of_stream(arguments.original, arguments.other)

    def opened(name: str) -> "AbstractContextManager[Side]":
        return open_side(name, arguments.frames, arguments.precision, arguments.layer, arguments.background, like)

    with (
        compilation_notice(GSVC_COMPARE, silent=arguments.quiet or arguments.json),
        opened(arguments.original) as a,
        opened(arguments.other) as b,
    ):
        for side in (a, b):
            say_damage(GSVC_COMPARE, side.notes)
        try:
            comparison = _compare(a, b, arguments)
        except GsvcError:
            if (damage := _damage(a) + _damage(b)) == []:
                raise
            comparison = None  # the fault is what matters, not that no pair of frames came before it
        else:
            damage = _damage(a) + _damage(b)
        if comparison is not None:
            first = arguments.frames[0]
            if arguments.json:
                print_json(comparison_object(comparison, a, b, first))
            else:
                show(*describe(comparison, a, b, first, brief=arguments.quiet))
    for message in damage:
        say(GSVC_COMPARE, message)
    return EXIT_DATA if damage else 0


def _format_of_stream(*names: str) -> "VideoFormat | None":
    """The format of the GSVC stream among two videos, if there is one in a file."""
    for name in names:
        if name != STDIO and holds_stream(name):
            with open_stream(name) as stream:
                return stream.format
    return None


def holds_stream(name: str) -> bool:
    """Whether a file is, or claims by its name to be, a GSVC stream."""
    from gsvc_ref.bitstream.chunks import MAGIC

    path = Path(name)
    if path.suffix.lower() == STREAM_SUFFIX:
        return True
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


@contextmanager
def open_side(
    name: str,
    frames: tuple[int, int | None],
    precision: "Precision",
    layer: int | None = None,
    background: "Background | None" = None,
    like: "VideoFormat | None" = None,
) -> Iterator[Side]:
    """Open a video or a GSVC stream, to read a half-open range of its frames.

    A video is shown on a background, and resampled as for a stream of format `like`; a stream is decoded up to a layer.
    """
    start, stop = frames
    if name != STDIO and holds_stream(name):
        import gsvc_ref

        with open_stream(name, layer=layer) as stream:
            decoded = gsvc_ref.decode(stream, start=start, stop=stop, precision=precision)
            yield Side(name, stream.format, stream.notes, CompleteFrames(iter(decoded)), start, stream)
    else:
        source: VideoSource = NamedInput(name, background)
        if like is not None and name != STDIO:
            from gsvc_tools.video.resampling import resampled_like

            source = resampled_like(source.open_video, like)
        with source.open_video() as reader:
            yield Side(display_name(name), reader.format, reader.notes, CompleteFrames(islice(reader, start, stop)))


def _compare(a: Side, b: Side, arguments: Namespace) -> "Comparison":
    from gsvc_ref.metrics import compare_frames

    if a.format.bit_depth != b.format.bit_depth:
        raise UsageError(
            f"{a.name} has {a.format.bit_depth} bits per sample and {b.name} {b.format.bit_depth}; only equal depths "
            f"can be compared: convert one of them first"
        )
    expected = a.format.frame_count
    with ProgressDisplay(quiet=arguments.quiet) as display:

        def show(frame: "FrameComparison") -> None:
            of_all = f"/{expected}" if expected else ""
            display.update(f"frame {frame.number + 1}{of_all}  {decibel(frame.psnr)}", frame.number + 1, expected)

        return compare_frames(
            a.frames, b.frames, a.format.peak,
            frame_rate=a.format.frame_rate, with_vmaf=not arguments.no_vmaf, on_frame=show,
        )  # fmt: skip


def _damage(side: Side) -> list[str]:
    """Sentences about the damage of a video, if there is any."""
    if side.frames.damage is None:
        return []
    if side.stream is None:
        count = plural(side.frames.count, "complete frame")
        return [f"{side.name} is damaged after {count}: {side.frames.damage}"]
    damage, _ = describe_damage(side.name, side.stream, side.frames.damage, side.start, side.frames.count)
    return [f"{damage}; only the frames before it could be compared"]


def comparison_object(comparison: "Comparison", a: Side, b: Side, first: int) -> dict[str, Any]:
    """The comparison for ``--json``, with frame numbers as in the videos."""
    scores = comparison.to_json()
    for frame in scores["frames"]:
        frame["number"] += first
    return {"a": a.name, "b": b.name, **scores, "errors": _damage(a) + _damage(b)}


def describe(comparison: "Comparison", a: Side, b: Side, first: int, *, brief: bool) -> list[str]:
    """The comparison in lines."""
    from gsvc_ref.video.stream import Damage

    lines = []
    if not brief:
        for letter, side in (("A", a), ("B", b)):
            lines.append(f"{letter}  {side.name}: {describe_format(side.format)}")
            lines += [f"   note: {note}" for note in side.notes if not isinstance(note, Damage)]
        lines += ["", *_frame_lines(comparison, first), ""]
    lines.append(f"PSNR     {_mean_psnr(comparison)}")
    lines.append(f"MS-SSIM  {comparison.mean_ms_ssim:.5f}")
    if comparison.vmaf is not None:
        mean = comparison.vmaf.mean
        lines.append(f"VMAF     {mean:.2f}" if mean is not None else f"VMAF     none: {comparison.vmaf.reason}")
    reason = comparison.vmaf.reason if comparison.vmaf is not None else None
    notes = [note for note in comparison.notes if note != reason]
    for place, side in (("first", a), ("second", b)):
        if side.frames.damage is not None:
            ends = f"the {place} video ends"
            why = f"the {place} video (damaged after frame {first + side.frames.count - 1}) ends"
            notes = [note.replace(ends, why) for note in notes]
    return lines + [f"note: {note}" for note in notes]


def _mean_psnr(comparison: "Comparison") -> str:
    total, same = len(comparison.frames), comparison.identical_frames
    if same == total:
        return f"identical: {plural(total, 'frame')} equal in every sample"
    if same == 0:
        return f"{comparison.mean_psnr:.2f} dB, mean of {plural(total, 'frame')}"
    different = [frame.psnr for frame in comparison.frames if not frame.identical]
    mean = sum(different) / len(different)
    return f"{mean:.2f} dB, mean of the {len(different)} frames that differ; {same} of {total} are identical"


def _frame_lines(comparison: "Comparison", first: int) -> list[str]:
    scores = comparison.vmaf.scores if comparison.vmaf is not None else None
    header = ["frame", "PSNR", "MS-SSIM", *(["VMAF"] if scores else [])]
    return table(
        header,
        [
            [
                str(frame.number + first),
                decibel(frame.psnr),
                f"{frame.ms_ssim:.5f}",
                *([f"{scores[frame.number]:.2f}"] if scores else []),
            ]
            for frame in comparison.frames
        ],
    )
