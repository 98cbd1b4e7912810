"""``gsvc encode`` with all of its options: resampling, jobs, many machines, resuming, a page, and a dry run."""

from argparse import Namespace
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from gsvc_base.cli.arguments import frame_rate, scale
from gsvc_ref.cli import encode as plain
from gsvc_ref.cli.encode_options import make_settings
from gsvc_ref.cli.files import check_input, check_output, check_stream_name
from gsvc_tools.cli.encode_page import check_page, without_page, write_page
from gsvc_tools.cli.encode_progress import progress_callback
from gsvc_tools.cli.where import add_where_options, opened_executor, resume_folder, started_processes

if TYPE_CHECKING:
    from gsvc_ref import Settings
    from gsvc_ref.encoder import EncodeReport
    from gsvc_ref.video import VideoReader
    from gsvc_tools.video.resampling import Resampled

RESUME: Final = "; the same command goes on from the groups of pictures that are complete"
"""What is said of an interrupted encode with ``--resume``."""


def add_command(commands: Any) -> None:
    """Add the command to the subparsers of ``gsvc``."""
    parser = plain.add_command(commands)
    parser.set_defaults(run=run)
    resampling = parser.add_argument_group("resampling")
    resampling.add_argument(
        "--scale", type=scale, metavar="F|WxH", help="resample the pictures: by a factor, as 0.5, or to 640x360"
    )
    resampling.add_argument(
        "--fps", type=frame_rate, metavar="R",
        help="another frame rate, as 12.5 or 30000/1001: at each time the frame that is shown then",
    )  # fmt: skip
    add_where_options(parser)
    page = parser.add_argument_group("page")
    page.add_argument(
        "--report", metavar="PAGE.html",
        help="then write a page to look at: pictures, PSNR, bits, what x264 needs (gsvc report makes it later, too)",
    )  # fmt: skip


def run(arguments: Namespace) -> int:
    """Encode, or estimate what that takes; 0, or 130 when it was interrupted."""
    if arguments.dry_run:
        return plain.unless_interrupted(lambda: _estimate(arguments))
    plain.check_names(arguments)
    check_page(arguments)
    return plain.unless_interrupted(lambda: _encode(arguments))


def _estimate(arguments: Namespace) -> int:
    from gsvc_tools.cli.dry_run import dry_run

    check_input(arguments.input, folder_allowed=True)
    if arguments.output is not None:
        check_output(arguments.output, arguments.input)
        check_stream_name(arguments.output, force=arguments.force)
    return dry_run(arguments, _resampled(arguments), make_settings(arguments))


def _encode(arguments: Namespace) -> int:
    folder = resume_folder(arguments)
    with (
        started_processes(arguments) as processes,  # they load while this process does
        opened_executor(arguments, processes) as (jobs, executor),
    ):
        return plain.encode_file(arguments, _extras(arguments, jobs, executor, folder))


def _resampled(arguments: Namespace) -> "Resampled":
    """The source, resampled as the options say."""
    from gsvc_tools.video.resampling import Resampled

    return Resampled(plain.NamedInput(arguments.input, arguments.background).open_video, arguments.scale, arguments.fps)


def _extras(arguments: Namespace, jobs: int, executor: Executor | None, folder: Path | None) -> plain.Extras:
    from gsvc_tools.targets.reading_again import can_be_read_again
    from gsvc_tools.targets.screen_content import screen_note

    is_readable_again = can_be_read_again(arguments.input)

    def look(reader: "VideoReader", settings: "Settings") -> None:
        """Note what is to be expected of the pictures, by the first one."""
        if not is_readable_again or settings.frames[0] > 0 or (first := reader.peek()) is None:
            return
        if (note := screen_note(first, reader.format.peak, settings)) is not None:
            reader.note(note)

    def advice(report: "EncodeReport") -> str:
        """What to do about an encode that ended early."""
        goes_on = report.interrupted and folder is not None and folder.exists()
        return (RESUME if goes_on else "") + without_page(arguments)

    return plain.Extras(
        source=_resampled,
        options={"jobs": jobs, "executor": executor, "resume": folder},
        opens_again=lambda settings: settings.goal is not None and is_readable_again,
        look=look,
        progress=progress_callback,
        notes=lambda report: _notes(report, jobs, folder),
        advice=advice,
        after=lambda report: write_page(arguments, report),
    )


def _notes(report: "EncodeReport", jobs: int, folder: Path | None) -> list[str]:
    """A sentence where a single group of pictures leaves jobs without work, or nothing to resume from."""
    if (jobs == 1 and folder is None) or report.interrupted or len(report.frames) == 1:
        return []
    if any(frame.type == "I" for frame in report.frames[1:]):
        return []
    effect = "one process was at work" if jobs > 1 else "none was kept before the end"
    return [f"one group of pictures, so {effect}; --key-frames K makes more"]
