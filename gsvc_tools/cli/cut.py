"""``gsvc cut``: some frames of a `.gsvc` file, or its lower quality layers, without decoding it."""

import sys
from argparse import Namespace
from typing import TYPE_CHECKING, Any, Final

from gsvc_base.cli.arguments import add_force, frame_range, whole
from gsvc_base.cli.errors import EXIT_INTERRUPTED, say
from gsvc_base.cli.parser import add_output
from gsvc_base.cli.text import plural, print_json, show
from gsvc_base.errors import UsageError
from gsvc_ref.cli.files import STDIO, check_input, check_output, check_stream_name, display_name

if TYPE_CHECKING:
    from gsvc_tools.editing import ConcatReport

GSVC_CUT: Final = "gsvc cut"


def add_command(commands: Any) -> None:
    """Add the command to the subparsers of ``gsvc``."""
    parser = commands.add_parser(
        "cut",
        help="keep some frames of a .gsvc file, or its lower quality layers, without encoding anything again",
        description="Write a .gsvc file with some of the frames of another one, or with the base and the quality "
        "layers up to K, or both. Nothing is decoded. The result gets its name when it is complete.",
        allow_abbrev=False,
    )
    parser.set_defaults(run=run)
    parser.add_argument("input", metavar="IN.gsvc", help="a .gsvc file, or - for standard input")
    add_output(parser, "OUT.gsvc", "the file to write, or - for standard output")
    parser.add_argument(
        "--frames", type=frame_range, metavar="A:B",
        help="keep frames A to B-1 only; A must be an I-frame (gsvc info --frames-table lists them)",
    )  # fmt: skip
    parser.add_argument("--layer", type=whole, metavar="K", help="the highest layer that stays; 0 is the base alone")
    parser.add_argument("--json", action="store_true", help="print the report as JSON, and only that")
    add_force(parser)
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")


def run(arguments: Namespace) -> int:
    """Cut the file; 0, or 130 when it was interrupted."""
    if arguments.json and arguments.output == STDIO:
        raise UsageError("--json needs standard output, which carries the stream: write to a file, or drop --json")
    if arguments.layer is None and arguments.frames is None:
        raise UsageError("say what stays: --frames A:B for some of the frames, --layer K for the lower quality layers")
    check_input(arguments.input)
    if arguments.output is None:
        raise UsageError("there is no output; give the name of a file to write, such as OUT.gsvc")
    check_output(arguments.output, arguments.input)
    check_stream_name(arguments.output, force=arguments.force)
    from gsvc_ref._jit import SMALL_TO_COPY
    from gsvc_tools.cli.reading import reading

    silent = arguments.quiet or arguments.json
    try:
        with reading(GSVC_CUT, arguments.input, silent=silent, small=SMALL_TO_COPY):
            from gsvc_tools.editing import cut

            source = sys.stdin.buffer if arguments.input == STDIO else arguments.input
            start, stop = arguments.frames or (0, None)
            report = cut(source, arguments.output, arguments.layer, start=start, stop=stop)
    except KeyboardInterrupt:
        say(GSVC_CUT, "interrupted; nothing was written")
        return EXIT_INTERRUPTED
    if arguments.json:
        print_json(report_object(arguments, report))
    elif not arguments.quiet:
        show(*summary(arguments, report), file=sys.stderr if arguments.output == STDIO else sys.stdout)
    return 0


def summary(arguments: Namespace, report: "ConcatReport") -> list[str]:
    """The result in lines."""
    output = display_name(arguments.output, "standard output")
    start, _ = arguments.frames or (0, None)
    parts = [f"{output}: {plural(report.file_bytes, 'byte')}, {plural(report.frame_count, 'frame')}"]
    if arguments.frames:
        parts.append(f"those from {start} to {start + report.frame_count - 1}")
    if arguments.layer is not None:
        parts.append("the base alone" if arguments.layer == 0 else f"the base and {plural(arguments.layer, 'layer')}")
    lines = [", ".join(parts)]
    for chunk_type, count in report.left_out.items():
        why = "of layers above" if chunk_type == "n" else "which would not be true of the result"
        lines.append(f"  left out: {plural(count, 'chunk')} {chunk_type}, {why}")
    return lines


def report_object(arguments: Namespace, report: "ConcatReport") -> dict[str, Any]:
    """The report for ``--json``."""
    return {
        "input": arguments.input,
        "output": arguments.output,
        "file_bytes": report.file_bytes,
        "first_frame": (arguments.frames or (0, None))[0],
        "frame_count": report.frame_count,
        "left_out": report.left_out,
        "header": report.header.arguments,
    }
