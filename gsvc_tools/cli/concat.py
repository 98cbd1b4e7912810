"""``gsvc concat``: several `.gsvc` files as one, without decoding them."""

import sys
from argparse import Namespace
from typing import TYPE_CHECKING, Any, Final

from gsvc_base.cli.arguments import add_force
from gsvc_base.cli.errors import EXIT_INTERRUPTED, say
from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import plural, print_json, show
from gsvc_base.errors import UsageError
from gsvc_ref.cli.files import STDIO, check_input, check_output, check_stream_name, display_name

if TYPE_CHECKING:
    from gsvc_tools.editing import ConcatReport

GSVC_CONCAT: Final = "gsvc concat"


def add_command(commands: Any) -> None:
    """Add the command to the subparsers of ``gsvc``."""
    parser = commands.add_parser(
        "concat",
        help="join .gsvc files to one, without encoding anything again",
        description="Join .gsvc files that have the same sequence header: the frames of the first one, then those of "
        "the next. Nothing is decoded, so no quality is lost. The result gets its name when it is complete.",
        allow_abbrev=False,
    )
    parser.set_defaults(run=run)
    parser.add_argument("inputs", metavar="IN", nargs="+", help="a .gsvc file; one of them may be - for standard input")
    parser.add_argument(
        "-o", "--output", metavar="OUT", required=True, help="the file to write, or - for standard output"
    )
    parser.add_argument("--json", action="store_true", help="print the report as JSON, and only that")
    add_force(parser)
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")


def run(arguments: Namespace) -> int:
    """Join the files; 0, or 130 when it was interrupted."""
    if arguments.json and arguments.output == STDIO:
        raise UsageError("--json needs standard output, which carries the stream: write to a file, or drop --json")
    if arguments.inputs.count(STDIO) > 1:
        raise UsageError("only one part can come from standard input; give files for the others")
    for name in arguments.inputs:
        check_input(name)
        check_output(arguments.output, name)
    check_stream_name(arguments.output, force=arguments.force)
    from gsvc_ref._jit import SMALL_TO_COPY
    from gsvc_tools.cli.reading import reading

    silent = arguments.quiet or arguments.json
    try:
        with reading(GSVC_CONCAT, *arguments.inputs, silent=silent, small=SMALL_TO_COPY):
            report = _concat(arguments)
    except KeyboardInterrupt:
        say(GSVC_CONCAT, "interrupted; nothing was written")
        return EXIT_INTERRUPTED
    if arguments.json:
        print_json(report_object(arguments, report))
    elif not arguments.quiet:
        show(*summary(arguments, report), file=sys.stderr if arguments.output == STDIO else sys.stdout)
    return 0


def _concat(arguments: Namespace) -> "ConcatReport":
    from gsvc_tools.editing import concat

    names = arguments.inputs
    with ProgressDisplay(quiet=arguments.quiet) as display:

        def progress(part: int, done: int, total: int | None) -> None:
            text = f"{display_name(names[part])}, file {part + 1}/{len(names)}, {plural(done, 'byte')}"
            display.update(text, done, total)

        sources = [sys.stdin.buffer if name == STDIO else name for name in names]
        return concat(sources, arguments.output, progress=progress if display.active else None)


def summary(arguments: Namespace, report: "ConcatReport") -> list[str]:
    """The result in lines."""
    output = display_name(arguments.output, "standard output")
    lines = [f"{output}: {plural(report.file_bytes, 'byte')}, {plural(report.frame_count, 'frame')}"]
    spans = [f"{part.first_frame} to {part.first_frame + part.frame_count - 1}" for part in report.parts]
    width = max(map(len, spans))
    for span, name in zip(spans, arguments.inputs, strict=True):
        lines.append(f"  frames {span.rjust(width)}  {display_name(name)}")
    for chunk_type, count in report.left_out.items():
        why = "which would not be true of the whole (spec.md, 6.10)"
        if chunk_type == "t":
            why = "with time stamps in other units, so that the frames of their part are evenly spaced now"
        lines.append(f"  left out: {plural(count, 'chunk')} {chunk_type}, {why}")
    return lines


def report_object(arguments: Namespace, report: "ConcatReport") -> dict[str, Any]:
    """The report for ``--json``."""
    parts = zip(arguments.inputs, report.parts, strict=True)
    return {
        "output": arguments.output,
        "file_bytes": report.file_bytes,
        "frame_count": report.frame_count,
        "parts": [
            {"input": name, "first_frame": part.first_frame, "frame_count": part.frame_count} for name, part in parts
        ],
        "left_out": report.left_out,
        "header": report.header.arguments,
    }
