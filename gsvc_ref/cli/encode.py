"""``gsvc encode``: a video in, a `.gsvc` file out."""

import sys
from argparse import Namespace
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TextIO

from gsvc_ref.cli.arguments import finite, frame_range, key_frames, numbers_of, whole
from gsvc_ref.cli.decisions import effects_line
from gsvc_ref.cli.errors import EXIT_DATA, EXIT_INTERRUPTED, say, what_was_saved
from gsvc_ref.cli.files import STDIO, check_input, check_output, display_name
from gsvc_ref.cli.progress import ProgressDisplay
from gsvc_ref.cli.text import decibel, describe_format, duration, plural, print_json, show, to_json
from gsvc_ref.errors import UsageError

if TYPE_CHECKING:
    from gsvc_ref import Settings
    from gsvc_ref.encoder import EncodeReport, Progress
    from gsvc_ref.video import VideoFormat, VideoReader

COMMAND: Final = "gsvc encode"

OVERRIDES: Final = (
    "splats", "psnr", "quality", "iterations", "key_frames", "low_latency", "frames", "seed", "threads", "precision",
    "effects", "decisions", "cholesky_bits", "color_stages", "color_codewords", "lane_count", "index", "checksums",
    "paced", "profile", "layers", "layer_splats",
)  # fmt: skip
"""Options that are settings of the same name; one that is not given leaves the preset's value."""

STAGES: Final = {
    "detect": "looking for cuts",
    "encode": "encoding",
    "fit": "fitting",
    "rate": "looking for the number of splats",
    "quantize": "quantising",
}
"""The stages of an encode in words."""

FIT_SHARE: Final = 0.6
"""The share of a frame's time that its first stage takes, roughly, for the estimate of the time left."""


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
    parser.add_argument("output", metavar="OUT.gsvc", help="the file to write, or - for standard output")
    parser.add_argument(
        "--preset", choices=("quick", "slow", "paper"), default="quick",
        help="quick (default): some 100 to 300 steps a frame; slow: several times as many, fewer bits; paper: the "
        "settings of the paper, in profile paper, minutes a frame",
    )  # fmt: skip
    parser.add_argument(
        "--profile", choices=("main", "paper"),
        help="the coding tools of the stream: main (default), about a third of the bits; paper, the paper's quantisers",
    )  # fmt: skip
    rate = parser.add_argument_group("rate and quality")
    rate.add_argument("--splats", type=whole, metavar="N", help="splats of a frame, or the most with --psnr")
    rate.add_argument("--psnr", type=finite, metavar="DB", help="as few bits as keep each frame at this PSNR")
    rate.add_argument(
        "--layers", type=numbers_of(finite), metavar="DB,DB,...",
        help="quality layers of profile main, at most 4: the PSNR with the base, with layer 1, ..., as 30,34,38; "
        "gsvc decode --layer shows and gsvc cut --layer keeps the lower ones",
    )  # fmt: skip
    rate.add_argument(
        "--layers-splats", type=numbers_of(whole), metavar="N,N,...", dest="layer_splats",
        help="the same by the number of splats with the base, with layer 1, ..., as 200,400,800",
    )  # fmt: skip
    rate.add_argument(
        "--quality", type=whole, metavar="Q",
        help="how fine all codes are, 0 (coarse) to 79; 8 more halve every step, and 10 to 40 are usual. Without "
        "--splats as many splats as go with it (profile main)",
    )  # fmt: skip
    rate.add_argument(
        "--iterations", type=whole, metavar="K",
        help="profile paper: iterations of fitting an I-frame; P-frames in proportion",
    )  # fmt: skip
    rate.add_argument("--cholesky-bits", type=whole, metavar="b", help="profile paper: bits of a Cholesky code, 1..12")
    rate.add_argument(
        "--color-stages", type=whole, metavar="M", help="profile paper: stages of the colour quantiser, 1..8"
    )
    rate.add_argument("--color-codewords", type=whole, metavar="B", help="profile paper: codewords of a stage, 1..1024")
    frames = parser.add_argument_group("frames")
    frames.add_argument("--frames", type=frame_range, metavar="A:B", help="encode frames A to B-1 only")
    frames.add_argument(
        "--key-frames", type=key_frames, metavar="auto|K|LIST",
        help="I-frames: auto (default; at cuts), every K frames, or listed as 0,12,40",
    )  # fmt: skip
    # With default=None an option that is not given leaves the preset's value.
    frames.add_argument(
        "--low-latency", action="store_true", default=None, help="decide I-frames without looking ahead"
    )
    frames.add_argument(
        "--effects", metavar="auto|all|...",
        help="what the encoder does: auto (default; where the scene calls for it), all (default of preset paper; on "
        "every frame), then switches by name, for instance auto,gsa=off,dks=all: frames = auto|all; gsa, motion = "
        "auto|off; dks = auto|all|off; profile paper alone: regions = auto|all; gsa, gsp = auto|all|off",
    )  # fmt: skip
    stream = parser.add_argument_group("stream")
    stream.add_argument("--lanes", type=whole, metavar="L", dest="lane_count", help="lanes of the entropy coder, 1..64")
    stream.add_argument(
        "--no-index", action="store_false", default=None, dest="index", help="leave out the index for seeking"
    )
    stream.add_argument(
        "--no-decisions", action="store_false", default=None, dest="decisions",
        help="leave out what was decided about each frame (gsvc info --decisions)",
    )  # fmt: skip
    stream.add_argument(
        "--live", action="store_true",
        help="write under the final name, frame by frame: the growing file can be decoded up to its last complete "
        "frame, also if the encoder is killed; for the least delay add --low-latency",
    )  # fmt: skip
    stream.add_argument("--checksums", action="store_true", default=None, help="add a checksum of each frame's splats")
    stream.add_argument(
        "--paced", action="store_true", default=None,
        help="keep the limits of a second, so that a player can promise to keep pace: an I-frame at least every four "
        "seconds; where a second has too much, the encode ends with an error",
    )  # fmt: skip
    other = parser.add_argument_group("other")
    other.add_argument(
        "--seed", type=whole, metavar="S", help="seed of all randomness; the same seed gives the same file"
    )
    other.add_argument(
        "--threads", type=whole, metavar="T", help="threads to compute with; the file does not depend on it"
    )
    other.add_argument(
        "--jobs", type=whole, default=1, metavar="J",
        help="groups of pictures to encode at the same time, each in a process with one thread; the file does not "
        "depend on it. Default 1: a process takes a second to start, and a clip without cuts has one group (but "
        "--key-frames K makes more)",
    )  # fmt: skip
    other.add_argument(
        "--precision", choices=("fast", "deterministic"),
        help="fast (default), or deterministic: the file depends on the kind of CPU neither; about a quarter slower",
    )  # fmt: skip
    other.add_argument("--json", action="store_true", help="print the report as JSON, and only that")
    other.add_argument("--quiet", action="store_true", help="print nothing but errors")


def run(arguments: Namespace) -> int:
    """Encode; 0, or 130 when it was interrupted."""
    if arguments.json and arguments.output == STDIO:
        raise UsageError("--json needs standard output, which carries the stream: write to a file, or drop --json")
    check_input(arguments.input, folder_allowed=True)
    check_output(arguments.output, arguments.input)
    try:
        return _encode(arguments)
    except KeyboardInterrupt:
        say(COMMAND, "interrupted before the first frame was complete; nothing was saved")
        return EXIT_INTERRUPTED


def _encode(arguments: Namespace) -> int:
    from gsvc_ref import IncompleteEncodeError, encode
    from gsvc_ref.cli.compilation import compilation_notice
    from gsvc_ref.video import open_video

    settings = make_settings(arguments)
    out = sys.stderr if arguments.output == STDIO else sys.stdout
    talkative = not (arguments.quiet or arguments.json)
    with compilation_notice(COMMAND, silent=not talkative) as notice, open_video(arguments.input) as reader:
        if talkative:
            _introduce(arguments.input, reader, settings, out)
        shown = len(reader.notes)
        fault = None
        try:
            with ProgressDisplay(quiet=arguments.quiet) as display:
                progress = progress_callback(display)
                report = encode(
                    reader, arguments.output, settings, live=arguments.live, jobs=arguments.jobs, progress=progress
                )
        except IncompleteEncodeError as error:
            fault, report = error, error.report
        except OSError as error:
            if arguments.live and not what_was_saved(error) and Path(arguments.output).is_file():
                say(COMMAND, f"{arguments.output} ends early; it can be decoded up to its last complete frame")
            raise
        if talkative:
            for note in report.notes[shown:]:
                show(f"  note: {note}", file=out)
            if arguments.jobs > 1 and not report.interrupted and is_one_group(report):
                show("  note: one group of pictures, so one process was at work; --key-frames K makes more", file=out)
            show(*summary(arguments.output, report, compiled=notice.said), file=out)
        elif arguments.json:
            print_json(report_object(arguments, report, reader.format))
    if fault is not None:
        say(COMMAND, str(fault))
        return EXIT_DATA
    if report.interrupted:
        say(COMMAND, _interrupted(arguments.output, report))
        return EXIT_INTERRUPTED
    return 0


def make_settings(arguments: Namespace) -> "Settings":
    """The preset with what the command line overrides."""
    from gsvc_ref import Settings

    given = {name: getattr(arguments, name) for name in OVERRIDES}
    overrides = {name: value for name, value in given.items() if value is not None}
    presets = {"quick": Settings.quick, "slow": Settings.slow, "paper": Settings.paper}
    return presets[arguments.preset](**overrides)


def _introduce(name: str, reader: "VideoReader", settings: "Settings", out: TextIO) -> None:
    """Say what is encoded, what was assumed about it, and how."""
    video = reader.format
    described = describe_settings(settings, video.width, video.height)  # which may refuse them
    show(f"{display_name(name)}: {describe_format(video)}", file=out)
    for note in reader.notes:
        show(f"  note: {note}", file=out)
    show(f"settings: {described}", file=out)


def describe_settings(settings: "Settings", width: int, height: int) -> str:
    """The settings that matter most, in one line."""
    splats = plural(settings.most_splats(width, height), "splat")
    about = "about " if settings.profile == "main" else ""
    if settings.layer_count > 1:
        goals = [f"{goal:g} dB" for goal in settings.layers] or [
            plural(goal, "splat") for goal in settings.layer_splats
        ]
        rate = f"{settings.layer_count} layers of {', '.join(goals)}"
    elif settings.psnr is not None:
        rate = f"at least {settings.psnr:g} dB with at most {about}{splats} a frame"
    elif settings.quality is not None:
        most = f"{'at most ' if settings.splats is None else ''}{about}"
        rate = f"quality {settings.quality} with {most}{splats} a frame"
    else:
        rate = f"{about}{splats} a frame"
    keys = settings.key_frames
    if keys == "auto":
        chosen = "found from the past alone" if settings.low_latency else "found automatically"
    elif isinstance(keys, int):
        chosen = f"every {plural(keys, 'frame')}"
    else:
        chosen = "listed"
    return (
        f"profile {settings.profile}, preset {settings.preset}, {rate}, I-frames {chosen}, effects {settings.effects}, "
        f"seed {settings.seed}"
    )


def progress_callback(display: ProgressDisplay) -> "Callable[[Progress], None] | None":
    """The function that shows the progress of `gsvc_ref.encode`; None when nothing is to be shown."""
    if not display.active:
        return None
    done = 0.0
    side_by_side = False

    def show(progress: "Progress") -> None:
        nonlocal done, side_by_side
        if progress.stage == "groups":
            side_by_side, done = True, progress.frame + 1
            of_all = f"/{progress.frame_count}" if progress.frame_count else ""
            groups = f"{plural(progress.iteration, 'group')} of pictures in work"
            display.update(f"{progress.frame + 1}{of_all} frames  {groups}", done, progress.frame_count)
            return
        if side_by_side:  # it reads ahead
            return
        share = progress.iteration / progress.iterations if progress.iterations else 0.0
        if progress.stage == "encode":
            done = max(done, progress.frame + share)
        elif progress.stage == "fit":
            done = max(done, progress.frame + share * FIT_SHARE)
        elif progress.stage == "quantize":  # once or, with a quality to hold, again and again
            done = max(done, progress.frame + FIT_SHARE + share * (1 - FIT_SHARE))
        of_all = f"/{progress.frame_count}" if progress.frame_count else ""
        quality = f"  {decibel(progress.psnr)}" if progress.psnr is not None else ""
        steps = f" {progress.iteration}/{progress.iterations}" if progress.iterations else ""
        text = f"frame {progress.frame + 1}{of_all}  {STAGES.get(progress.stage, progress.stage)}{steps}{quality}"
        display.update(text, done, progress.frame_count)

    return show


def summary(output: str, report: "EncodeReport", *, compiled: bool) -> list[str]:
    """The result of an encode in lines; `compiled`: kernels were compiled in its time."""
    frames = report.frames
    counts = Counter[str](frame.type for frame in frames)
    types = ", ".join(f"{counts[kind]} {kind}" for kind in "IPR" if counts[kind])
    splats = max(frame.splats for frame in frames)
    stages = sorted(report.seconds_by_stage.items(), key=lambda item: -item[1])
    total = max(report.seconds, sum(report.seconds_by_stage.values()))  # several processes spend more than passes
    shares = ", ".join(f"{stage} {seconds / total:.0%}" for stage, seconds in stages[:4] if total)
    layers = layer_lines(report)
    return [
        f"{display_name(output, 'standard output')}: {plural(report.file_bytes, 'byte')}, "
        f"{report.bits_per_pixel:.4f} bits/pixel, {kilobits_per_second(report):.1f} kbit/s, "
        f"mean PSNR {decibel(report.mean_psnr, 'infinite (identical frames)')}",
        f"  {plural(len(frames), 'frame')}: {types}; at most {plural(splats, 'splat')} in one",
        *layers,
        f"  effects: {effects_line([frame.decisions for frame in frames], [frame.type for frame in frames])}",
        f"  {duration(report.seconds)}, {report.seconds / len(frames):.2f} s/frame"
        + (" with the compilation of kernels" if compiled else "")
        + (f" ({shares})" if shares else ""),
    ]


def is_one_group(report: "EncodeReport") -> bool:
    """Whether several frames form one group of pictures."""
    return len(report.frames) > 1 and all(frame.type != "I" for frame in report.frames[1:])


def layer_lines(report: "EncodeReport") -> list[str]:
    """A line for the base and for each layer: its rate, and the quality with it."""
    count = report.header.layer_count
    if count == 1:
        return []
    lines = []
    for layer in range(count):
        parts = [frame.layers[layer] for frame in report.frames]
        bits = sum(sum(part.bits.values()) for part in parts)
        rate = float(bits * report.header.frame_rate / len(parts) / 1000)
        quality = sum(part.psnr for part in parts) / len(parts)
        name = f"layer {layer}" if layer else "base"
        lines.append(f"  {name}: {rate:.1f} kbit/s, mean PSNR {decibel(quality, 'infinite')}")
    return lines


def kilobits_per_second(report: "EncodeReport") -> float:
    """The rate of the whole file in 1000 bits per second."""
    return float(8 * report.file_bytes * report.header.frame_rate / len(report.frames) / 1000)


def report_object(arguments: Namespace, report: "EncodeReport", video: "VideoFormat") -> dict[str, Any]:
    """The report for ``--json``."""
    return {
        "input": arguments.input,
        "output": arguments.output,
        "format": video,
        "file_bytes": report.file_bytes,
        "bits_per_pixel": report.bits_per_pixel,
        "kilobits_per_second": kilobits_per_second(report),
        "mean_psnr": report.mean_psnr,
        "seconds": report.seconds,
        "seconds_by_stage": report.seconds_by_stage,
        "interrupted": report.interrupted,
        "fault": report.fault,
        "header": report.header.arguments,
        "frames": report.frames,
        "notes": report.notes,
        "settings": to_json(report.settings),
    }


def _interrupted(output: str, report: "EncodeReport") -> str:
    count = plural(len(report.frames), "frame")
    return f"interrupted; {display_name(output, 'standard output')} is a valid file with the {count} done so far"
