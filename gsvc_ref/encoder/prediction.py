"""The start of a P-frame of profile `paper`: its splats moved along the flow, and how many come (GSA) and go (GSP)."""

from typing import Final

from gsvc_base.arrays import F4
from gsvc_ref.encoder.held_quality import BEST
from gsvc_ref.encoder.log import OFF, FrameLog
from gsvc_ref.encoder.motion import estimated_motion
from gsvc_ref.encoder.settings import PaperSettings
from gsvc_ref.rendering import Objective
from gsvc_ref.training import psnr_of_loss

NEW_DROP: Final = 1.0
"""A P-frame that is predicted this many dB worse than the frame before has something new to show."""

MAX_NEW: Final = 3.0
"""A frame gets at most this many times `FrameSettings.new_fraction` of new splats, one time for each NEW_DROP."""


def moved_along_flow(
    parameters: F4,  # (N, 8) f4, as decoded in the frame before
    picture_before: F4 | None,  # (H, W, 3) f4, the source of the frame before; None: motion is off
    picture: F4,  # (H, W, 3) f4
    objective: Objective,
    log: FrameLog,
) -> tuple[F4, float]:
    """The splats along the optical flow, if that brings the picture closer, and the PSNR of the prediction in dB."""
    psnr_before = psnr_of_loss(objective.loss(parameters))
    if picture_before is None:
        log.add("motion", OFF, done=False)
        return parameters, psnr_before
    moved = parameters.copy()
    moved[:, :2] += estimated_motion(picture_before, picture, parameters[:, :2])
    psnr_moved = psnr_of_loss(objective.loss(moved))
    if psnr_moved <= psnr_before:
        log.add("motion", "moving splats along the flow would not bring the prediction closer", done=True)
        return parameters, psnr_before
    gain = min(psnr_moved, BEST) - psnr_before
    log.add("motion", f"moved splats bring the prediction {max(gain, 0):.1f} dB closer", done=True)
    return moved, psnr_moved


def exchange_counts(
    settings: PaperSettings,
    old: int,  # splats of the frame before
    total: int,  # N
    most: int,  # splats that a frame may have
    drop: float,  # dB by which the prediction is worse than the frame before
    log: FrameLog,
) -> tuple[int, int]:
    """The number of splats that GSA adds to a P-frame, and that of its old ones that GSP removes."""
    new = _added(settings, total, drop, log)
    if settings.psnr is not None:
        new = max(new, total - old)
    if settings.effects.gsp == "off":
        new, removed = min(new, max(0, most - old)), 0
    elif settings.effects.gsp == "all" and settings.psnr is None:
        removed = min(new, old)  # as many go as come (paper section 3.5)
    else:
        removed = min(max(0, old + new - total), old)  # those that have no room
    _log_exchange(settings, new, removed, log)
    return new, removed


def _added(settings: PaperSettings, total: int, drop: float, log: FrameLog) -> int:
    """The number of splats that GSA asks for."""
    mode = settings.effects.gsa
    need = {"off": 0.0, "all": 1.0}.get(mode, min(drop / NEW_DROP, MAX_NEW) if drop > NEW_DROP else 0.0)
    new = round(settings.inter.new_fraction * total * need)
    if mode == "off":
        reason = OFF
    elif mode == "all":
        reason = "asked for"
    else:
        reason = f"predicted with {max(drop, 0.0):.1f} dB less than the frame before has"
    log.add("gsa", reason, done=new > 0)
    return new


def _log_exchange(settings: PaperSettings, new: int, removed: int, log: FrameLog) -> None:
    """Log how many splats come and go."""
    if settings.effects.gsa == "all" and not new:
        log.add("gsa", "no room for more splats without pruning", done=False)
    if settings.effects.gsp == "off":
        reason = OFF
    elif removed:
        reason = f"{removed:,} splats go and {new:,} come"
    else:
        reason = "the rate has room for all splats"
    log.add("gsp", reason, done=removed > 0)
