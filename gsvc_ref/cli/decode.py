"""``gsvc decode``: a `.gsvc` file in, a video out."""

import sys
from argparse import Namespace
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from gsvc_base.cli.arguments import add_layer, add_max_level, frame_range, positive, whole
from gsvc_base.cli.errors import EXIT_DATA, EXIT_INTERRUPTED, say
from gsvc_base.cli.parser import add_output
from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import per_second, plural, show
from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.cli.damage import Gaps, describe_damage
from gsvc_ref.cli.files import (
    STDIO,
    CompleteFrames,
    check_input,
    check_output,
    display_name,
    open_stream,
)

if TYPE_CHECKING:
    from gsvc_ref.stream import Stream
    from gsvc_ref.video import Frame, VideoFormat, VideoWriter
    from gsvc_ref.video.stream import Extras

GSVC_DECODE: Final = "gsvc decode"


def add_command(commands: Any) -> None:
    """Add the command to the subparsers of ``gsvc``."""
    parser = commands.add_parser(
        "decode",
        help="decode a .gsvc file to a video",
        description="Decode a .gsvc file to a video. Of a damaged file all complete frames before the damage are "
        "written, with --salvage also those after it (exit code 1).",
        allow_abbrev=False,
    )
    parser.set_defaults(run=run)
    parser.add_argument("input", metavar="IN.gsvc", help="the file to decode, or - for standard input")
    add_output(
        parser, "OUT", "OUT.y4m; a folder, for PNG files; OUT.mp4, .mkv, .mov or .webm for a lossy copy to look at, "
        ".gif or .webp for an animation; or - for y4m on standard output",
    )  # fmt: skip
    parser.add_argument(
        "--frames", type=frame_range, default=(0, None), metavar="A:B",
        help="decode frames A to B-1 only, from the I-frame at or before A",
    )  # fmt: skip
    parser.add_argument(
        "--scale", type=positive, default=1.0, metavar="S",
        help="render at S times the size; below 1 filtered by the area of the new pixels, but with --precision "
        "deterministic sampled, which has jagged edges",
    )  # fmt: skip
    parser.add_argument(
        "--precision", choices=("fast", "deterministic", "exact"), default="fast",
        help="fast (default): binary32; deterministic: binary32, the same pixels on every machine; "
        "exact: the definition in binary64, slow",
    )  # fmt: skip
    parser.add_argument(
        "--chroma", choices=("rgb", "420", "422", "444"), help="chroma format to write; default: as the source had"
    )
    parser.add_argument(
        "--audio-from", metavar="SOURCE",
        help="copy the sound of SOURCE, the video that was encoded, from its first picture on and without encoding it "
        "again; to .mp4, .mkv, .mov and .webm",
    )  # fmt: skip
    parser.add_argument(
        "--salvage", action="store_true",
        help="of a damaged file write every frame that is left: skip damaged ones, and those after them up to the next "
        "I-frame, and tell what is missing",
    )  # fmt: skip
    add_layer(parser)
    add_max_level(parser)
    parser.add_argument("--threads", type=whole, metavar="T", help="threads to compute with")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")


def run(arguments: Namespace) -> int:
    """Decode; 0, 1 for a damaged stream, 130 when interrupted."""
    check_input(arguments.input)
    if arguments.output is None:
        raise UsageError("there is no output; give OUT.y4m, OUT.mp4, or a folder for PNG files (gsvc view shows IN)")
    check_output(arguments.output, arguments.input, folder_allowed=True)
    _check_sound(arguments)
    try:
        from gsvc_base.interrupts import Interrupts

        with Interrupts(patient=False, once=True):  # a terminal that is closed may send SIGHUP twice
            return _decode(arguments)
    except KeyboardInterrupt:
        done = "the output ends early" if arguments.output == STDIO else "nothing was saved"
        say(GSVC_DECODE, f"interrupted; {done}")
        return EXIT_INTERRUPTED


def _check_sound(arguments: Namespace) -> None:
    """Refuse sound that cannot be copied, before anything is decoded."""
    if arguments.audio_from is None:
        return
    from gsvc_ref.video.opening import takes_sound

    check_input(arguments.audio_from)
    check_output(arguments.output, arguments.audio_from)
    if arguments.audio_from == STDIO or not takes_sound(arguments.output):
        raise UsageError("--audio-from takes a file, and an output with a place for sound: .mp4, .mkv, .mov or .webm")


def _decode(arguments: Namespace) -> int:
    import gsvc_ref
    from gsvc_ref.cli.compilation import compilation_notice

    start, stop = arguments.frames
    gaps = Gaps() if arguments.salvage else None
    with (
        compilation_notice(GSVC_DECODE, silent=arguments.quiet),
        open_stream(
            arguments.input, salvage=arguments.salvage, max_level=arguments.max_level, layer=arguments.layer
        ) as stream,
    ):
        decoded = gsvc_ref.decode(
            stream, start=start, stop=stop,
            scale=arguments.scale, precision=arguments.precision, threads=arguments.threads, on_gap=gaps,
            on_incomplete=gaps.incomplete if gaps else None,
        )  # fmt: skip
        frames = CompleteFrames(iter(decoded))
        writer = _write(frames, stream, arguments, gaps)
        if writer is None and frames.damage is None and not (gaps and gaps.found):
            raise UsageError(f"{_frames_of(stream, arguments)} holds no frame of --frames {start}:{stop or ''}")
        if writer is not None and frames.damage is None and not arguments.quiet:
            _report(arguments, writer, stream)
        if frames.damage is not None:
            _report_damage(arguments, frames.damage, frames.count, stream)
            return EXIT_DATA
    if gaps is not None and gaps.found:
        _report_gaps(arguments, gaps, frames.count, moved=writer is not None and writer.frames_skipped > 0)
        return EXIT_DATA
    return 0


def _report(arguments: Namespace, writer: "VideoWriter", stream: "Stream") -> None:
    """Say what was written."""
    out = sys.stderr if arguments.output == STDIO else sys.stdout
    name, video = display_name(arguments.output, "standard output"), writer.format
    frames_of = f"{plural(writer.frames_written, 'frame')} of {video.width}x{video.height}"
    show(f"{name}: {frames_of}, {per_second(video.frame_rate)}, {writer.written_depth} bits", file=out)
    start, _ = arguments.frames
    numbering = [f"names count from frame {start}"] if start and Path(arguments.output).is_dir() else []
    for note in [*stream.notes, *writer.notes, *_time_notes(stream, writer), *numbering]:
        show(f"  note: {note}", file=out)


def _time_notes(stream: "Stream", writer: "VideoWriter") -> list[str]:
    """A sentence if frames are not evenly spaced in time."""
    if stream.times().is_even:
        return []
    if writer.carries_times:
        return ["frames are not evenly spaced in time, and are shown as in the source"]
    return [
        "frames are not evenly spaced in time, which the output cannot say: it counts them at "
        f"{per_second(writer.format.frame_rate)}; .mp4, .mkv, .mov, .webm, .gif and .webp keep their times"
    ]


def _write(frames: CompleteFrames, stream: "Stream", arguments: Namespace, gaps: Gaps | None) -> "VideoWriter | None":
    """Write all frames; the closed writer, or None when there was no frame."""
    from gsvc_ref.video import open_writer

    first = next(frames, None)
    if first is None:
        return None
    height, width, _ = first.shape
    video = replace(stream.format, width=width, height=height, frame_count=None)
    if arguments.chroma is not None:
        video = with_chroma(video, arguments.chroma)
    with (
        open_writer(arguments.output, video, extras=_extras(stream, arguments)) as writer,
        ProgressDisplay(quiet=arguments.quiet) as display,
    ):
        for frame in _with_progress(chain([first], frames), _expected(stream, arguments), display):
            if gaps is not None:
                writer.skip(gaps.missing - writer.frames_skipped)
            writer.write(frame)
    return writer


def _extras(stream: "Stream", arguments: Namespace) -> "Extras":
    """Time stamps and sound, from the first frame on that is decoded."""
    from gsvc_ref.video.stream import Extras

    times, sound = stream.times(), arguments.audio_from
    return Extras(None if times.is_even else times, arguments.frames[0], None if sound is None else Path(sound))


def with_chroma(video: "VideoFormat", chroma: Any) -> "VideoFormat":
    """The format with other planes; R'G'B' and Y'CbCr need a matrix that suits them."""
    from gsvc_ref.video.format import assumed_matrix

    color = video.color
    if chroma == "rgb":
        color = replace(color, matrix=0, full_range=True)
    elif color.matrix == 0:
        color = replace(color, matrix=assumed_matrix(video.height), full_range=False)
    return replace(video, chroma_format=chroma, color=color)


def _with_progress(frames: "Iterable[Frame]", expected: int | None, display: ProgressDisplay) -> "Iterator[Frame]":
    of_all = f"/{expected}" if expected else ""
    for count, frame in enumerate(frames, 1):
        display.update(f"frame {count}{of_all}", count, expected)
        yield frame


def _expected(stream: "Stream", arguments: Namespace) -> int | None:
    """The number of frames that the stream promises for the range that was asked for."""
    start, stop = arguments.frames
    total = stream.frame_count
    ends = [end for end in (stop, total) if end is not None]
    return max(min(ends) - start, 0) if ends else None


def _frames_of(stream: "Stream", arguments: Namespace) -> str:
    total = stream.frame_count
    return f"{display_name(arguments.input)}" + (f", with its {plural(total, 'frame')}," if total else "")


def _report_damage(arguments: Namespace, damage: GsvcError, count: int, stream: "Stream") -> None:
    """Say what the fault is, what was saved, what is missing and what to do."""
    name, output = display_name(arguments.input), display_name(arguments.output, "standard output")
    start, stop = arguments.frames
    total, next_number = stream.frame_count, start + count
    end = total if stop is None else min(stop, total or stop)
    fault, advice = describe_damage(name, stream, damage, start, count)
    if end is None:
        missing = f"missing: what follows frame {next_number - 1}" if next_number else "missing: all"
    elif end > next_number:
        last = f" to {end - 1}" if end > next_number + 1 else ""
        missing = f"missing: frame{'s' if last else ''} {next_number}{last}"
    else:
        missing, advice = "no frame is missing", ""
    kept = f"{output} holds the {plural(count, 'complete frame')} before the fault" if count else "nothing was written"
    say(GSVC_DECODE, fault)
    say(GSVC_DECODE, f"{kept}; {missing}" + (f". {advice}" if advice else ""))


def _report_gaps(arguments: Namespace, gaps: Gaps, count: int, *, moved: bool) -> None:
    """Say what is damaged and what is missing: a line for each gap, which frame moved up first, and the sum."""
    output = display_name(arguments.output, "standard output")
    for line in gaps.lines():
        say(GSVC_DECODE, line)
    if moved and not Path(arguments.output).is_dir():
        first, missing = next((gap.first_missing, gap.missing_count) for gap in gaps.found if gap.missing_count)
        say(
            GSVC_DECODE,
            f"frames after a gap move up: frame {first - arguments.frames[0]} of {output} is frame {first + missing} "
            f"of the video; a folder of PNG files keeps the numbers",
        )
    kept = f"{output} holds {plural(count, 'frame')}" if count else "nothing was written"
    say(GSVC_DECODE, f"{display_name(arguments.input)} is damaged: {gaps.total(count)}; {kept}")
