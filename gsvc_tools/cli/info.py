"""``gsvc info``: the contents of a `.gsvc` file, and the share of its bits that each part takes."""

from argparse import Namespace
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Final

from gsvc_base.cli.arguments import add_max_level
from gsvc_base.cli.errors import EXIT_DATA, say
from gsvc_base.cli.text import frame_runs, plural, print_json, show, table
from gsvc_base.errors import GsvcError
from gsvc_ref.cli.damage import Gaps, describe_damage
from gsvc_ref.cli.files import check_input, describe_format, display_name, open_stream
from gsvc_tools.cli.decisions import decision_lines, decisions_object, stream_decisions

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gsvc_ref.bitstream import SequenceHeader
    from gsvc_ref.stream import FrameSummary, Gap, Stream, StreamSummary
    from gsvc_ref.video import VideoFormat

GSVC_INFO: Final = "gsvc info"


def add_command(commands: Any) -> None:
    """Add the command to the subparsers of ``gsvc``."""
    parser = commands.add_parser(
        "info",
        help="tell what a .gsvc file holds and where its bits went",
        description="Tell what a .gsvc file holds and where its bits went.",
        allow_abbrev=False,
    )
    parser.set_defaults(run=run)
    parser.add_argument("input", metavar="FILE", help="a .gsvc file, or - for standard input")
    parser.add_argument("--json", action="store_true", help="print everything, frame by frame, as JSON")
    parser.add_argument("--frames-table", action="store_true", help="print a line for each frame")
    parser.add_argument(
        "--decisions", action="store_true", help="print what the encoder decided about each effect, and why"
    )
    parser.add_argument(
        "--salvage", action="store_true", help="of a damaged file tell all that is left, and every gap in it"
    )
    add_max_level(parser)


def run(arguments: Namespace) -> int:
    """Print the information; 0, or 1 for a damaged stream."""
    check_input(arguments.input)
    from gsvc_tools.cli.reading import reading

    name = display_name(arguments.input)
    try:
        with (
            reading(GSVC_INFO, arguments.input, silent=arguments.json),
            open_stream(arguments.input, salvage=arguments.salvage, max_level=arguments.max_level) as stream,
        ):
            video, notes, summary = stream.format, stream.notes, stream.info(salvage=arguments.salvage)
            damage = _damage(name, stream, summary)
    except GsvcError as error:  # there is not even a header
        if arguments.json:
            print_json({"error": error_object(error)})
        raise
    if arguments.json:
        info = info_object(summary, salvage=arguments.salvage)
        if arguments.decisions:
            decisions, note = stream_decisions(summary)
            info |= {"decisions": decisions_object(decisions), "decisions_note": note}
        print_json(info)
    else:
        lines = describe(name, video, notes, summary, frame_by_frame=arguments.frames_table)
        if arguments.decisions:
            decisions, note = stream_decisions(summary)
            lines += ["", *(decision_lines(decisions) if note is None else [f"note: {note}"])]
        show(*lines)
    for line in damage:
        say(GSVC_INFO, line)
    return EXIT_DATA if damage else 0


def _damage(name: str, stream: "Stream", summary: "StreamSummary") -> list[str]:
    """Sentences about the damage, if there is any."""
    count = len(summary.frames)
    if summary.error is not None:
        return list(describe_damage(name, stream, summary.error, 0, count))
    if not summary.gaps:
        return []
    return [f"{name} is damaged: {all_gaps(summary.gaps).total(count)}"]


def all_gaps(found: "Iterable[Gap]") -> Gaps:
    """Gaps of a whole stream."""
    gaps = Gaps()
    for gap in found:
        gaps(gap)
    return gaps


def error_object(error: GsvcError) -> dict[str, Any]:
    """A fault for JSON."""
    return {"kind": error.kind, "message": error.message, "rule": error.rule, "bit": error.bit}


def gap_object(gap: "Gap") -> dict[str, Any]:
    """A gap for JSON."""
    return {
        "first_missing": gap.first_missing,
        "missing_count": gap.missing_count,
        "offset": gap.offset,
        "size": gap.size,
        "skipped": gap.skipped,
        "predicted_from": gap.predicted_from,
        "fault_count": gap.fault_count,
        "faults": [error_object(fault) for fault in gap.faults],
    }


def info_object(summary: "StreamSummary", *, salvage: bool) -> dict[str, Any]:
    """The summary for ``--json``.

    `gaps` is there with ``--salvage``, else `error` when the stream is damaged; `times_s` where frames are not evenly
    spaced, when each is shown in seconds from the first.
    """
    rate = summary.header.frame_rate
    info = {
        "header": summary.header.arguments,
        "frame_rate": rate,
        "time_base": 1 / rate,
        "frame_count": len(summary.frames),
        "file_bytes": summary.file_bytes,
        "bits": summary.bits,
        "frames": summary.frames,
    }
    if not summary.times.is_even:
        info["times_s"] = [float(summary.times.time_of(frame.number)) for frame in summary.frames]
    if salvage:
        info["gaps"] = [gap_object(gap) for gap in summary.gaps]
    if summary.error is not None:
        info["error"] = error_object(summary.error)
    return info


def describe(
    name: str, video: "VideoFormat", notes: list[str], summary: "StreamSummary", *, frame_by_frame: bool
) -> list[str]:
    """The information in lines."""
    lines = [
        f"{name}: {plural(summary.file_bytes, 'byte')}, {plural(len(summary.frames), 'complete frame')}",
        *(f"  note: {note}" for note in notes),
        *_header_lines(summary.header, video),
    ]
    if summary.frames:
        lines += [_rate_line(summary), *_time_lines(summary), _type_line(summary.frames), *_layer_lines(summary)]
    lines += ["", *bit_lines(summary)]
    if summary.gaps:
        gaps = all_gaps(summary.gaps)
        for frame in summary.frames:
            gaps.incomplete(frame.number, frame.lacking)
        lines += ["", *gaps.lines()]
    return lines + (["", *_frame_lines(summary.frames)] if frame_by_frame and summary.frames else [])


def _header_lines(header: "SequenceHeader", video: "VideoFormat") -> list[str]:
    from gsvc_ref.bitstream.header import PROFILES
    from gsvc_ref.video.format import SITING_NAMES

    color = video.color
    siting = f", chroma siting {SITING_NAMES[color.chroma_location]}" if video.chroma_format in ("420", "422") else ""
    promised = plural(header.frame_count, "frame") if header.frame_count else "number of frames left open"
    checksums = ", a checksum of each frame's splats" if header.parameter_checksum_flag else ""
    paced = ", paced" if header.paced_flag else ""
    return [
        f"  video       {describe_format(replace(video, frame_count=None))}",
        f"  colour      primaries {color.primaries}, transfer {color.transfer}, matrix {color.matrix} (H.273){siting}",
        f"  header      profile {PROFILES[header.profile]}, level {header.level}{paced}, {promised}{checksums}",
        *_tool_lines(header),
    ]


def _tool_lines(header: "SequenceHeader") -> list[str]:
    """What the header says of the tools of its profile."""
    from gsvc_ref.bitstream.header import MAIN

    if header.profile == MAIN:
        layers = f"{plural(header.layer_count, 'layer')}" if header.layer_count > 1 else "one layer"
        if header.layer_count > 1:
            points = [
                f"{point.level}" + (f" at 1/{1 << point.halvings}" if point.halvings else "")
                for point in header.operating_points
            ]
            layers += f" of level{'s' if len({*points}) > 1 else ''} {', '.join(dict.fromkeys(points))}"
        return [f"  tools       up to {plural(1 << header.max_lane_exponent, 'lane')} of the entropy coder, {layers}"]
    return [
        f"  quantisers  Cholesky {header.cholesky_bits} bits; colours up to {plural(header.color_stages, 'stage')} of "
        f"up to {plural(header.color_codewords, 'codeword')}",
        f"  entropy     {header.entropy_precision}-bit frequencies, {plural(header.lane_count, 'lane')}",
    ]


def _rate_line(summary: "StreamSummary") -> str:
    header, damaged = summary.header, summary.error is not None or bool(summary.gaps)
    sizes = (frame.size + sum(layer.size for layer in frame.layers) for frame in summary.frames)
    bits = 8 * (sum(sizes) if damaged else summary.file_bytes)
    seconds = sum((summary.times.duration_of(frame.number) for frame in summary.frames), Fraction(0))
    bits_per_pixel = bits / (header.width * header.height * len(summary.frames))
    kilobits = float(bits / seconds / 1000)
    of_what = "the complete frames" if damaged else "video"
    return f"  rate        {bits_per_pixel:.4f} bits/pixel, {kilobits:.1f} kbit/s, {float(seconds):.2f} s of {of_what}"


def _time_lines(summary: "StreamSummary") -> list[str]:
    """How long frames are shown, where they are not evenly spaced."""
    if summary.times.is_even:
        return []
    spans = [1000 * float(summary.times.duration_of(frame.number)) for frame in summary.frames]
    return [f"  times       frames are shown for {min(spans):.4g} to {max(spans):.4g} ms each"]


def _type_line(frames: "list[FrameSummary]") -> str:
    types: list[str] = [frame.type for frame in frames]
    numbers = [frame.number for frame in frames]
    splats = [frame.splats for frame in frames]
    counts = ", ".join(f"{types.count(kind)} {kind}" for kind in "IPR" if kind in types)
    span = plural(splats[0], "splat") if len({*splats}) == 1 else f"{min(splats):,} to {max(splats):,} splats"
    each = "" if any(frame.layers for frame in frames) else f"; {span} each"  # the lines of layers tell theirs
    return f"  frames      {counts} ({frame_runs(types, numbers)}){each}"


def _layer_lines(summary: "StreamSummary") -> list[str]:
    """A line for the base and for each layer: its bits, and how many splats and which frames have it."""
    if summary.header.layer_count == 1:
        return []
    total = 8 * summary.file_bytes
    parts = [("base", 8 * sum(frame.size for frame in summary.frames), [frame.splats for frame in summary.frames])]
    for number in range(1, summary.header.layer_count):
        found = [layer for frame in summary.frames for layer in frame.layers if layer.layer == number]
        parts.append((f"layer {number}", 8 * sum(layer.size for layer in found), [layer.splats for layer in found]))
    lines = []
    for name, bits, splats in parts:
        span = "no splats" if not splats else f"{min(splats):,} to {max(splats):,} splats"
        if len({*splats}) == 1:
            span = plural(splats[0], "splat")
        chunks = plural(len(splats), "chunk")
        lines.append(f"  {name:<11} {bits:,} bits, {bits / total:.1%} of the file; {chunks}, {span} each")
    return lines


def bit_lines(summary: "StreamSummary") -> list[str]:
    """A table of where the bits of a stream went."""
    total = 8 * summary.file_bytes
    rows = [[part, f"{count:,}", f"{count / total:.1%}"] for part, count in summary.bits.items() if count]
    return table(("part", "bits", "share"), [*rows, ["total", f"{total:,}", "100.0%"]])


def _frame_lines(frames: "list[FrameSummary]") -> list[str]:
    parts = list(dict.fromkeys(part for frame in frames for part, count in frame.bits.items() if count))
    rows = [
        [
            str(frame.number),
            frame.type,
            f"{frame.splats:,}",
            f"{8 * frame.size:,}",
            *(f"{frame.bits.get(part, 0):,}" for part in parts),
        ]
        for frame in frames
    ]
    return table(("frame", "type", "splats", "bits", *parts), rows)
