"""``gsvc encode``: a video in, a `.gsvc` file out."""

import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TextIO

from gsvc_base.cli.arguments import add_force
from gsvc_base.cli.errors import EXIT_DATA, EXIT_INTERRUPTED, say, what_was_saved
from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import plural, print_json, show
from gsvc_base.errors import UsageError
from gsvc_ref.cli.encode_options import add_options, make_settings
from gsvc_ref.cli.encode_page import check_page, without_page, write_page
from gsvc_ref.cli.encode_text import describe_settings, is_one_group, progress_callback, report_object, summary
from gsvc_ref.cli.files import STDIO, check_input, check_output, check_stream_name, describe_format, display_name
from gsvc_ref.cli.where import add_where_options, opened_executor, resume_folder, started_processes

if TYPE_CHECKING:
    from gsvc_ref import Settings
    from gsvc_ref.encoder import EncodeReport
    from gsvc_ref.processes import Processes
    from gsvc_ref.video import VideoReader

GSVC_ENCODE: Final = "gsvc encode"
GO_ON: Final = "; the same command goes on from the groups of pictures that are complete"
"""What is said of an interrupted encode with ``--resume``."""


def add_command(commands: Any) -> None:
    """Add the command to the subparsers of ``gsvc``."""
    parser = commands.add_parser(
        "encode",
        help="encode a video as a .gsvc file",
        description="Encode a video as a .gsvc file, which stands under its name once it is complete. After Ctrl-C, "
        "SIGTERM, or a fault of the source it holds the frames done so far, as a valid file.",
        allow_abbrev=False,
    )
    parser.set_defaults(run=run)
    parser.add_argument("input", metavar="IN", help="a video, a folder of PNG files, or - for y4m on standard input")
    parser.add_argument(
        "output", metavar="OUT.gsvc", nargs="?", help="the file to write, or - for standard output; none with --dry-run"
    )
    add_options(parser)
    add_where_options(parser)
    add_force(parser)


def run(arguments: Namespace) -> int:
    """Encode; 0, or 130 when it was interrupted."""
    if arguments.output is None and not arguments.dry_run:
        raise UsageError("there is no output; give the name of a file to write, such as OUT.gsvc, or --dry-run")
    if arguments.json and arguments.output == STDIO and not arguments.dry_run:
        raise UsageError("--json needs standard output, which carries the stream: write to a file, or drop --json")
    check_input(arguments.input, folder_allowed=True)
    if arguments.output is not None:
        check_output(arguments.output, arguments.input)
        check_stream_name(arguments.output, force=arguments.force)
        check_page(arguments)
    try:
        with started_processes(arguments) as processes:
            return _encode(arguments, processes)
    except KeyboardInterrupt:
        say(GSVC_ENCODE, "interrupted before the first frame was complete; nothing was saved")
        return EXIT_INTERRUPTED


def _encode(arguments: Namespace, processes: "Processes | None") -> int:
    from gsvc_ref import IncompleteEncodeError, encode
    from gsvc_ref.cli.compilation import compilation_notice
    from gsvc_ref.encoder.reading_again import can_be_read_again
    from gsvc_ref.video import Resampled, open_video

    settings = make_settings(arguments)
    source = Resampled(lambda: open_video(arguments.input), arguments.scale, arguments.fps)
    if arguments.dry_run:
        from gsvc_ref.cli.dry_run import dry_run

        return dry_run(arguments, source, settings)
    resume = resume_folder(arguments)
    out = sys.stderr if arguments.output == STDIO else sys.stdout
    talkative = not (arguments.quiet or arguments.json)
    with (
        compilation_notice(GSVC_ENCODE, silent=not talkative) as notice,
        source.open_video() as reader,
        opened_executor(arguments, processes) as (jobs, executor),
    ):
        if can_be_read_again(arguments.input):
            _look_at_first(reader, settings)
        if talkative:
            _introduce(arguments.input, reader, settings, out)
        shown = list(reader.notes)
        fault = None
        try:
            with ProgressDisplay(quiet=arguments.quiet) as display:
                progress = progress_callback(display)
                again = settings.goal is not None and can_be_read_again(arguments.input)
                report = encode(
                    source if again else reader, arguments.output, settings,
                    live=arguments.live, jobs=jobs, executor=executor, resume=resume, progress=progress,
                )  # fmt: skip
        except IncompleteEncodeError as error:
            fault, report = error, error.report
        except OSError as error:
            if arguments.live and not what_was_saved(error) and Path(arguments.output).is_file():
                say(GSVC_ENCODE, f"{arguments.output} ends early; it can be decoded up to its last complete frame")
            raise
        if talkative:
            for note in report.notes:
                if note not in shown:
                    show(f"  note: {note}", file=out)
            if (jobs > 1 or resume) and not report.interrupted and is_one_group(report):
                so = "one process was at work" if jobs > 1 else "none was kept before the end"
                show(f"  note: one group of pictures, so {so}; --key-frames K makes more", file=out)
            show(*summary(arguments.output, report, compiled=notice.said), file=out)
        elif arguments.json:
            print_json(report_object(arguments, report, reader.format))
    if fault is not None:
        say(GSVC_ENCODE, str(fault) + without_page(arguments))
        return EXIT_DATA
    if report.interrupted:
        go_on = GO_ON if resume and resume.exists() else ""
        say(GSVC_ENCODE, _interrupted(arguments.output, report) + go_on + without_page(arguments))
        return EXIT_INTERRUPTED
    return write_page(arguments, report)


def _look_at_first(reader: "VideoReader", settings: "Settings") -> None:
    """Note what is to be expected of the pictures, by the first one."""
    from gsvc_ref.encoder.screen_content import screen_note

    if settings.frames[0] > 0 or (first := reader.peek()) is None:
        return
    if (note := screen_note(first, reader.format.peak, settings)) is not None:
        reader.note(note)


def _introduce(name: str, reader: "VideoReader", settings: "Settings", out: TextIO) -> None:
    """Say what is encoded, what was assumed about it, and how."""
    video = reader.format
    described = describe_settings(settings, video.width, video.height)  # which may refuse them
    show(f"{display_name(name)}: {describe_format(video)}", file=out)
    for note in reader.notes:
        show(f"  note: {note}", file=out)
    show(f"settings: {described}", file=out)


def _interrupted(output: str, report: "EncodeReport") -> str:
    count = plural(len(report.frames), "frame")
    return f"interrupted; {display_name(output, 'standard output')} is a valid file with the {count} done so far"
