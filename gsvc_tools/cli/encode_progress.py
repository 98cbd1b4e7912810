"""The progress of ``gsvc encode``: stages, passes, groups of pictures in work, and the time left."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import decibel, plural
from gsvc_tools.cli.time_left import GroupsTimeLeft, TimeLeft

if TYPE_CHECKING:
    from gsvc_ref.encoder import Progress

STAGES: Final = {
    "detect": "looking for cuts",
    "encode": "encoding",
    "fit": "fitting",
    "quantize": "quantising",
}
"""The stages of an encode in words."""

FIT_SHARE: Final = 0.6
"""The share of a frame's time that its first stage takes, roughly, for the estimate of the time left."""


def progress_callback(display: ProgressDisplay) -> "Callable[[Progress], None] | None":
    """The function that shows the progress of `gsvc_ref.encode`; None when nothing is to be shown."""
    if not display.active:
        return None
    done, kept = 0.0, 0
    side_by_side, pass_name = False, ""
    left, groups_left = TimeLeft(), GroupsTimeLeft()

    def show(progress: "Progress") -> None:
        nonlocal done, kept, side_by_side, pass_name, left, groups_left
        if progress.step != pass_name:  # another pass
            pass_name, done, side_by_side = progress.step, 0.0, False
            left, groups_left = TimeLeft(), GroupsTimeLeft()
        if progress.stage == "groups":
            side_by_side, done = True, progress.frame + 1
            rest = None if progress.frame_count is None else progress.frame_count - progress.kept
            seconds = groups_left.update(progress.frame + 1 - progress.kept, progress.elapsed_s, rest)
            work = f"{plural(progress.iteration, 'group')} of pictures in work"
            text = f"{progress.frame + 1}{_of_all(progress)} frames  {work}{_pace(progress, groups_left.rate)}"
            display.update(_with_pass(pass_name, text), done, progress.frame_count, left_s=seconds, guess=False)
            return
        if side_by_side:  # it reads ahead
            return
        share = progress.iteration / progress.iterations if progress.iterations else 0.0
        if progress.stage == "encode":
            done = max(done, progress.frame + share)
        elif progress.stage == "fit":
            done = max(done, progress.frame + share * FIT_SHARE)
        elif progress.stage == "quantize":  # once or, with a PSNR to reach, several times
            done = max(done, progress.frame + FIT_SHARE + share * (1 - FIT_SHARE))
        seconds = None
        if progress.kept != kept:  # this frame took no time, and the next one that does begins a group
            kept, left = progress.kept, TimeLeft()
        elif progress.stage != "detect":
            part = max(0.0, done - progress.frame)
            seconds = left.update(progress.frame, part, progress.elapsed_s, progress.frame_count)
        psnr = f"  {decibel(progress.psnr)}" if progress.psnr is not None else ""
        iterations = f" {progress.iteration}/{progress.iterations}" if progress.iterations else ""
        stage = f"{STAGES.get(progress.stage, progress.stage)}{iterations}{psnr}"
        text = f"frame {progress.frame + 1}{_of_all(progress)}  {stage}{_pace(progress, left.rate)}"
        display.update(_with_pass(pass_name, text), done, progress.frame_count, left_s=seconds, guess=False)

    return show


def _of_all(progress: "Progress") -> str:
    return f"/{progress.frame_count}" if progress.frame_count else ""


def _pace(progress: "Progress", rate: float) -> str:
    """Frames per second, where nobody can say how long it will take."""
    return f"  {rate:.3g} frames/s" if progress.frame_count is None and rate else ""


def _with_pass(pass_name: str, text: str) -> str:
    return f"{pass_name}: {text}" if pass_name else text
