"""``gsvc accuracy``: what accuracy costs in time, on this machine."""

import shlex
from argparse import ArgumentTypeError, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from gsvc_base.cli.arguments import positive, whole
from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import duration, print_json, show, table
from gsvc_base.errors import UsageError
from gsvc_ref.cli.files import STDIO, check_input, check_output

if TYPE_CHECKING:
    from gsvc_lab.accuracy import AccuracyReport, Source

PAGE: Final = "accuracy.html"


def add_command(commands: Any) -> None:
    """Add the command to the subparsers of ``gsvc``."""
    parser = commands.add_parser(
        "accuracy",
        help="show what accuracy costs in time",
        description="Measure what the precision of the kernels, threads, the support cut-off, quantisers, splats, "
        "iterations, start and learning rates cost and bring, each with everything else fixed, and PSNR against "
        "seconds of encoding. About two minutes.",
        allow_abbrev=False,
    )
    parser.set_defaults(run=run)
    parser.add_argument("clip", metavar="CLIP", nargs="?", help="a video, a picture or a folder of them")
    parser.add_argument("--scene", metavar="NAME", help="instead of CLIP: demo, or a photograph (default: chelsea)")
    parser.add_argument("--frame", type=whole, default=0, metavar="K", help="the frame to take, from 0 (default: 0)")
    parser.add_argument(
        "--group", type=names, metavar="A,B", help="measure these groups only: precision, threads, cutoff, position, "
        "cholesky, color, gradients, splats, iterations, start, rates, encoding"
    )  # fmt: skip
    parser.add_argument("--seconds", type=positive, metavar="S", help="about how long to measure (default: 110)")
    parser.add_argument(
        "--repeats", type=whole, metavar="R", help="maximum number of runs of each setting (default: 9)"
    )
    parser.add_argument("--json", action="store_true", help="print the measurements as JSON, and only that")
    parser.add_argument("--plot", action="store_true", help=f"write a page with plots and tables: {PAGE}")
    parser.add_argument("-o", "--output", metavar="FILE", help="write the page to this file (implies --plot)")
    parser.add_argument("--markdown", metavar="FILE", help="put the tables between the markers of a Markdown file")
    parser.add_argument("--quiet", action="store_true", help="show no progress")


def names(text: str) -> tuple[str, ...]:
    """``precision,cutoff`` is ("precision", "cutoff")."""
    listed = tuple(name.strip() for name in text.split(",") if name.strip())
    if not listed:
        raise ArgumentTypeError(f"{text!r} names no group; give names with commas between, such as precision,cutoff")
    return listed


def run(arguments: Namespace) -> int:
    """Measure and show; 0."""
    if arguments.clip is not None and arguments.scene is not None:
        raise UsageError(f"both {arguments.clip} and the scene {arguments.scene} are given; give one of them")
    if arguments.clip is not None:
        check_input(arguments.clip, folder_allowed=True)
    page = arguments.output or (PAGE if arguments.plot else None)
    if page is not None:
        if page == STDIO:
            raise UsageError(f"the page goes to a file, such as -o {PAGE}")
        check_output(page, STDIO)
    from gsvc_base.files import write_text
    from gsvc_base.pages.markers import check_markers, put_between
    from gsvc_lab import accuracy
    from gsvc_lab.accuracy.groups import check_names
    from gsvc_lab.accuracy.tables import BEGIN, END

    groups = accuracy.GROUP_NAMES if arguments.group is None else arguments.group
    check_names(groups)
    if arguments.markdown is not None:
        check_markers(Path(arguments.markdown), BEGIN, END)
    report = measure(_source(arguments), groups, arguments)
    if page is not None:
        write_text(accuracy.accuracy_html(report, command_line(arguments)), page)
    if arguments.markdown is not None:
        put_between(Path(arguments.markdown), BEGIN, END, accuracy.markdown(report))
    if arguments.json:
        print_json(accuracy.accuracy_object(report))
    else:
        show(*describe(report))
        if page is not None:
            show(f"\n{page}: plots and tables to look at in a browser")
    return 0


def _source(arguments: Namespace) -> "Source":
    from gsvc_lab.accuracy import clip_source, scene_source
    from gsvc_lab.accuracy.sources import DEFAULT_SCENE

    if arguments.clip is not None:
        return clip_source(arguments.clip, arguments.frame)
    return scene_source(arguments.scene or DEFAULT_SCENE, arguments.frame)


def measure(source: "Source", groups: tuple[str, ...], arguments: Namespace) -> "AccuracyReport":
    """Measure with progress on standard error."""
    from gsvc_lab.accuracy import measure_accuracy

    given = {name: value for name in ("seconds", "repeats") if (value := getattr(arguments, name)) is not None}
    with ProgressDisplay(quiet=arguments.quiet) as display:
        return measure_accuracy(source, groups, on_progress=display.update, **given)


def command_line(arguments: Namespace) -> str:
    """The command that measures the same again."""
    words = ["gsvc", "accuracy", *([arguments.clip] if arguments.clip is not None else [])]
    options = (("--scene", arguments.scene), ("--frame", arguments.frame or None), ("--seconds", arguments.seconds),
               ("--repeats", arguments.repeats), ("--group", ",".join(arguments.group or ()) or None))  # fmt: skip
    for name, value in options:
        words += [name, f"{value:g}" if isinstance(value, float) else str(value)] if value is not None else []
    return shlex.join([*words, "--plot"])


def describe(report: "AccuracyReport") -> list[str]:
    """The measurements in lines."""
    from gsvc_lab.accuracy.tables import (
        LEGEND,
        WORK,
        cells,
        curve_lines,
        header,
        machine_text,
        run_counts,
        source_text,
    )

    lines = [f"{source_text(report)}; {machine_text(report)}"]
    for result in report.groups:
        group = result.group
        rows = [cells(group, measured) for measured in result.measurements]
        lines += ["", f"{group.title} ({group.name}): errors against {group.against}"]
        lines.append(f"  time of {WORK[group.kind]}; {run_counts(result)}")
        body = table(header(group)[1:], [row[1:] for row in rows])
        lines += [f"{mark:>3} {line}" for mark, line in zip(["", *(row[0] for row in rows)], body, strict=True)]
        lines += [f"  {group.note}"] if group.note else []
    if report.curves:
        lines += ["", "Encoding one I-frame (encoding): PSNR against the source", *_indented(curve_lines(report))]
    notes = [*LEGEND, *(f"Note: {note}." for note in report.notes)] if report.groups else []
    return [*lines, "", *notes, f"Measured in {duration(report.seconds)}."]


def _indented(lines: list[str]) -> list[str]:
    return [f"  {line}" for line in lines]
