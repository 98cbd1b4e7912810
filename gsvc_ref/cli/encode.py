"""``gsvc encode``: a video in, a `.gsvc` file out."""

import shlex
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TextIO

from gsvc_base.cli.arguments import add_force
from gsvc_base.cli.errors import EXIT_DATA, EXIT_INTERRUPTED, say, what_was_saved
from gsvc_base.cli.parser import add_output
from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import plural, print_json, show
from gsvc_base.errors import UsageError
from gsvc_ref.cli.encode_options import add_options, make_settings
from gsvc_ref.cli.encode_text import describe_settings, frame_progress, report_object, summary
from gsvc_ref.cli.files import (
    STDIO,
    add_background,
    check_input,
    check_output,
    check_stream_name,
    default_output,
    describe_format,
    display_name,
    say_damage,
)

if TYPE_CHECKING:
    from gsvc_ref import Settings
    from gsvc_ref.encoder import EncodeReport, Progress
    from gsvc_ref.video import VideoFormat, VideoReader, VideoSource
    from gsvc_ref.video.alpha import Background

GSVC_ENCODE: Final = "gsvc encode"


@dataclass(frozen=True)
class NamedInput:
    """A source by its name, which is read from its beginning each time that it is opened."""

    name: str
    background: "Background | None" = None  # of what is transparent

    def open_video(self) -> "VideoReader":
        """A new reader of its frames."""
        from gsvc_ref.video import open_video

        return open_video(self.name, background=self.background)


@dataclass(frozen=True)
class Extras:
    """What a command adds to an encode that does more than this one."""

    # The source, which can be opened again and again.
    source: "Callable[[Namespace], VideoSource]" = lambda arguments: NamedInput(arguments.input, arguments.background)
    options: Mapping[str, Any] = field(default_factory=dict)  # arguments of `gsvc_ref.encode`
    # Whether `gsvc_ref.encode` opens the source, as often as it needs, with these settings.
    opens_again: "Callable[[Settings], bool]" = lambda settings: False
    # Called with the source before it is encoded, so that it may get notes.
    look: "Callable[[VideoReader, Settings], None]" = lambda reader, settings: None
    # What shows the progress of `gsvc_ref.encode`.
    progress: "Callable[[ProgressDisplay], Callable[[Progress], None] | None]" = frame_progress
    notes: "Callable[[EncodeReport], list[str]]" = lambda report: []  # sentences on the encode
    advice: "Callable[[EncodeReport], str]" = lambda report: ""  # the end of a sentence on one that ended early
    after: "Callable[[EncodeReport], int]" = lambda report: 0  # what follows a complete one; its exit code


PLAIN: Final = Extras()


def add_command(commands: Any) -> ArgumentParser:
    """Add the command to the subparsers of ``gsvc``; its parser."""
    parser: ArgumentParser = commands.add_parser(
        "encode",
        help="encode a video as a .gsvc file",
        description="Encode a video as a .gsvc file, which stands under its name once it is complete. After Ctrl-C, "
        "SIGTERM, or a fault of the source it holds the frames done so far, as a valid file.",
        allow_abbrev=False,
    )
    parser.set_defaults(run=run)
    parser.add_argument("input", metavar="IN", help="a video, a folder of PNG files, or - for y4m on standard input")
    add_output(
        parser, "OUT.gsvc", "the file to write, or - for standard output; default: IN with the suffix .gsvc, if that "
        "file does not exist yet",
    )  # fmt: skip
    add_options(parser)
    add_background(parser)
    add_force(parser)
    return parser


def run(arguments: Namespace) -> int:
    """Encode; 0, or 130 when it was interrupted."""
    check_names(arguments)
    return unless_interrupted(lambda: encode_file(arguments))


def unless_interrupted(encode: Callable[[], int]) -> int:
    """The exit code of an encode, also where Ctrl-C ends it before there is anything to save."""
    try:
        return encode()
    except KeyboardInterrupt:
        say(GSVC_ENCODE, "interrupted before the first frame was complete; nothing was saved")
        return EXIT_INTERRUPTED


def check_names(arguments: Namespace) -> None:
    """Refuse names of files that cannot be read or written; an output without a name gets that of the input."""
    if arguments.output is None:
        arguments.output = default_output(arguments.input)
    if arguments.json and arguments.output == STDIO:
        raise UsageError("--json needs standard output, which carries the stream: write to a file, or drop --json")
    check_input(arguments.input, folder_allowed=True)
    check_output(arguments.output, arguments.input)
    check_stream_name(arguments.output, force=arguments.force)


def encode_file(arguments: Namespace, extras: Extras = PLAIN) -> int:
    """Encode, and say what came out; 0, 1 after a fault, or 130 when it was interrupted."""
    from gsvc_ref import IncompleteEncodeError, encode
    from gsvc_ref.cli.compilation import compilation_notice

    settings = make_settings(arguments)
    source = extras.source(arguments)
    out = sys.stderr if arguments.output == STDIO else sys.stdout
    talkative = not (arguments.quiet or arguments.json)
    with (
        compilation_notice(GSVC_ENCODE, silent=not talkative) as notice,
        source.open_video() as reader,
    ):
        extras.look(reader, settings)
        shown = list(reader.notes)
        notes = say_damage(GSVC_ENCODE, shown)
        if talkative:
            _introduce(arguments.input, reader.format, notes, settings, out)
        fault = None
        try:
            with ProgressDisplay(quiet=arguments.quiet) as display:
                report = encode(
                    source if extras.opens_again(settings) else reader, arguments.output, settings,
                    live=arguments.live, progress=extras.progress(display), **extras.options,
                )  # fmt: skip
        except IncompleteEncodeError as error:
            fault, report = error, error.report
        except OSError as error:
            if arguments.live and not what_was_saved(error) and Path(arguments.output).is_file():
                say(GSVC_ENCODE, f"{arguments.output} ends early; it can be decoded up to its last complete frame")
            raise
        if talkative:
            for note in [*report.notes, *extras.notes(report)]:
                if note not in shown:
                    show(f"  note: {note}", file=out)
            show(*_result(arguments, report, compiled=notice.said), file=out)
        elif arguments.json:
            print_json(report_object(arguments, report, reader.format))
    if fault is not None:
        say(GSVC_ENCODE, str(fault) + extras.advice(report))
        return EXIT_DATA
    if report.interrupted:
        say(GSVC_ENCODE, _interrupted(arguments.output, report) + extras.advice(report))
        return EXIT_INTERRUPTED
    return extras.after(report)


def _introduce(name: str, video: "VideoFormat", notes: list[str], settings: "Settings", out: TextIO) -> None:
    """Say what is encoded, what was assumed about it, and how."""
    described = describe_settings(settings, video.width, video.height)  # which may refuse them
    show(f"{display_name(name)}: {describe_format(video)}", file=out)
    for note in notes:
        show(f"  note: {note}", file=out)
    show(f"settings: {described}", file=out)


def _result(arguments: Namespace, report: "EncodeReport", *, compiled: bool) -> list[str]:
    """The file beside its source, and what to do next."""
    output, path = arguments.output, Path(arguments.input)
    scale, rate = getattr(arguments, "scale", None), getattr(arguments, "fps", None)
    start, stop = report.settings.frames
    is_whole = (start, stop) == (0, None) and not (scale or rate or report.interrupted or report.fault)
    source_bytes = path.stat().st_size if is_whole and path.is_file() else None
    lines = summary(output, report, compiled=compiled, source_bytes=source_bytes, verbose=arguments.verbose)
    if source_bytes and report.file_bytes > source_bytes:
        lines.append("  note: the file is larger than its source; a lower --quality makes it smaller")
    if output != STDIO:
        has_its_shape = rate is None and not isinstance(scale, tuple)
        source = [arguments.input] if path.exists() and has_its_shape else []
        begins = ["--source-from", str(start)] if source and start else []
        lines.append(f"  next: gsvc view {shlex.join([output, *source, *begins])}")
    return lines


def _interrupted(output: str, report: "EncodeReport") -> str:
    count = plural(len(report.frames), "frame")
    return f"interrupted; {display_name(output, 'standard output')} is a valid file with the {count} done so far"
