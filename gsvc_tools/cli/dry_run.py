"""``gsvc encode --dry-run``: what an encode is likely to take, by some of its frames."""

from argparse import Namespace
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import duration, plural, print_json, show, to_json
from gsvc_ref.cli.compilation import compilation_notice
from gsvc_ref.cli.encode_text import describe_settings
from gsvc_ref.cli.files import describe_format, display_name

if TYPE_CHECKING:
    from gsvc_ref import Settings
    from gsvc_tools.targets.trial import Estimate, Range
    from gsvc_tools.video.resampling import Resampled

GSVC_DRY_RUN: Final = "gsvc encode"


def dry_run(arguments: Namespace, source: "Resampled", settings: "Settings") -> int:
    """Say what an encode is likely to take, and write nothing; 0."""
    from gsvc_tools.jobs.processes import check_jobs
    from gsvc_tools.targets.trial import estimate

    jobs = 1 if arguments.jobs is None else arguments.jobs
    check_jobs(jobs)
    silent = arguments.quiet or arguments.json
    with compilation_notice(GSVC_DRY_RUN, silent=silent), ProgressDisplay(quiet=silent) as display:
        display.status("encoding some frames to see")
        found = estimate(source.open_video, settings, jobs)
    if arguments.json:
        print_json({"input": arguments.input, "settings": to_json(settings), **to_json(found)})
    else:
        show(*lines(arguments.input, found, settings))
    return 0


def lines(name: str, found: "Estimate", settings: "Settings") -> list[str]:
    """The estimate in lines."""
    video = found.format
    per_second = "" if found.frames is not None else " for each second of the video, whose length is not known"
    return [
        f"{display_name(name)}: {describe_format(video)}",
        *(f"  note: {note}" for note in found.notes),
        f"settings: {describe_settings(settings, video.width, video.height)}",
        f"likely, by {plural(found.frames_tried, 'frame')} that were encoded and thrown away{per_second}:",
        f"  time       {_with_range(found.seconds, duration)}, on this machine at its present load",
        f"  size       {_with_range(found.file_bytes, lambda size: f'{_rounded(size):,}')} bytes",
        f"  bits/pixel {_with_range(found.bits_per_pixel, lambda bits: f'{bits:.3g}')}",
        f"  mean PSNR  {_with_range(found.mean_psnr, lambda psnr: f'{psnr:.1f}')} dB",
        f"  splats     {found.splats:,} in an I-frame; level {found.level}",
    ]


def _with_range(values: "Range", text: Callable[[float], str]) -> str:
    """What is likely, and from where to where."""
    return f"{text(values.likely)} ({text(values.low)} to {text(values.high)})"


def _rounded(number: float) -> int:
    """A number with three digits that count."""
    unit = 10 ** max(0, len(str(int(number))) - 3)
    return int(round(number / unit) * unit)
