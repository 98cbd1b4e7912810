"""``gsvc report``: a page about any `.gsvc` file, with or without its source; and that of ``gsvc encode --report``."""

import shlex
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from gsvc_base.cli.arguments import whole
from gsvc_base.cli.errors import EXIT_DATA, say
from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import show
from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.cli.files import STDIO, add_background, check_input, check_output, open_stream

if TYPE_CHECKING:
    from gsvc_lab.report.contents import Wanted
    from gsvc_ref.encoder import EncodeReport
    from gsvc_ref.video.alpha import Background

COMMAND: Final = "gsvc report"
PAGE_SUFFIXES: Final = (".html", ".htm")


def add_command(commands: Any) -> None:
    """Add the command to the subparsers of ``gsvc``."""
    parser = commands.add_parser(
        "report",
        help="write a page about a .gsvc file: pictures, quality, bits",
        description="Write a page about a .gsvc file: pictures, where its bits went, what the encoder decided, damage; "
        "with the source also PSNR, MS-SSIM, VMAF, differences, and what x264 needs at equal PSNR. "
        "gsvc encode --report PAGE writes it after an encode.",
        allow_abbrev=False,
    )
    parser.set_defaults(run=run)
    parser.add_argument("file", metavar="FILE", help="a .gsvc file")
    parser.add_argument("source", metavar="SOURCE", nargs="?", help="the video that was encoded")
    parser.add_argument(
        "-o", "--output", metavar="PAGE", help="the page to write (default: FILE's name with .html, in this folder)"
    )
    parser.add_argument(
        "--start", type=whole, default=0, metavar="K",
        help="the frame of SOURCE that the first frame of FILE shows (default: 0)",
    )  # fmt: skip
    add_background(parser)
    parser.add_argument("--no-vmaf", action="store_true", help="leave out VMAF")
    parser.add_argument("--no-x264", action="store_true", help="leave out what x264 needs at equal PSNR")
    parser.add_argument("--threads", type=whole, metavar="T", help="threads to compute with")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")


def run(arguments: Namespace) -> int:
    """Write the page; 0, or 1 for a damaged file, which has a page all the same."""
    if STDIO in (arguments.file, arguments.source):
        raise UsageError("the page is made of files that can be read more than once: save standard input to a file")
    check_input(arguments.file)
    if arguments.source is not None:
        check_input(arguments.source, folder_allowed=True)
    elif arguments.start:
        raise UsageError("--start is about SOURCE, which is not given")
    if arguments.start < 0:
        raise UsageError(f"--start {arguments.start}: frames are counted from 0")
    page = arguments.output or f"{Path(arguments.file).stem}{PAGE_SUFFIXES[0]}"
    check_page(page, arguments.file, *([arguments.source] if arguments.source is not None else []))
    from gsvc_ref.cli.compilation import compilation_notice

    with compilation_notice(COMMAND, silent=arguments.quiet):
        with open_stream(arguments.file):  # which says what to do where there is not even a header
            pass
        from gsvc_lab.report.contents import Wanted

        wanted = Wanted(
            Path(arguments.file), arguments.source, arguments.start, command=_command(arguments, page),
            vmaf=not arguments.no_vmaf, x264=not arguments.no_x264, threads=arguments.threads,
            background=arguments.background,
        )  # fmt: skip
        damage = write_page(wanted, page, quiet=arguments.quiet)
    if not arguments.quiet:
        show(f"{page}: open it in a browser")
    for sentence in damage[:1]:
        say(COMMAND, f"{arguments.file} is damaged: {sentence}")
    return EXIT_DATA if damage else 0


def check_page(page: str, *sources: str) -> None:
    """Refuse a page that cannot be written, before work is done for it.

    A UsageError says that it is not the name of a page; others are those of `check_output`.
    """
    if Path(page).suffix.lower() not in PAGE_SUFFIXES:
        raise UsageError(
            f"{page} is not the name of a page; it ends in .html, such as {Path(page).stem or 'page'}.html"
        )
    for source in sources:
        check_output(page, source)


def _command(arguments: Namespace, page: str) -> str:
    """The command that writes the page again."""
    words = ["gsvc", "report", arguments.file, *([arguments.source] if arguments.source is not None else [])]
    words += ["--start", str(arguments.start)] if arguments.start else []
    words += ["--background", f"#{bytes(arguments.background).hex()}"] if arguments.background else []
    words += [option for option in ("--no-vmaf", "--no-x264") if getattr(arguments, option[2:].replace("-", "_"))]
    return shlex.join([*words, "-o", page])


def write_page(wanted: "Wanted", page: str, *, quiet: bool) -> list[str]:
    """Measure and write, with progress; sentences on the damage of the file, none of a sound one."""
    from gsvc_lab.pages.report import write_damaged, write_report
    from gsvc_lab.report.contents import damage_of, report_data, summarise

    with ProgressDisplay(quiet=quiet) as display:
        display.status("reading")
        summary = summarise(wanted.file)
        damage = damage_of(summary)
        if summary.frames:
            data = report_data(wanted, summary, display.update)
            display.status("writing the page")
            write_report(data, page)
        else:
            write_damaged(wanted.file.name, wanted.command, damage or ["It has no frame."], summary.bits, page)
    return damage


def after_encode(
    file: str,
    source: str | None,
    start: int,
    page: str,
    encoded: "EncodeReport",
    command: str,
    *,
    quiet: bool,
    background: "Background | None",
) -> None:
    """Write the page of ``gsvc encode --report``; a source that cannot be compared is left out, and said."""
    from gsvc_lab.report.contents import Wanted

    wanted = Wanted(Path(file), source, start, encoded, command, background=background)
    try:
        write_page(wanted, page, quiet=quiet)
    except (UsageError, GsvcError) as error:
        if source is None:
            raise
        if not quiet:
            show(f"  note: the page has no comparison with the source: {error}")
        write_page(Wanted(Path(file), None, 0, encoded, command), page, quiet=quiet)
    if not quiet:
        show(f"{page}: open it in a browser")
