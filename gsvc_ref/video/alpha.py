"""Transparent pictures: GSVC has no alpha, so they are put onto a background of one color, or refused."""

from collections.abc import Sequence

import numpy as np

from gsvc_base.arrays import Frame
from gsvc_base.checks import check_range, check_whole
from gsvc_base.errors import GsvcError, UsageError

Background = tuple[int, int, int]
"""R', G', B' of 8 bits."""


def background_of(color: str | Sequence[int] | None) -> Background | None:
    """A color by its name in CSS, as ``#rrggbb``, or by three numbers 0..255; None is none.

    A UsageError says that it is not a color, or that it is transparent itself.
    """
    if color is None:
        return None
    if not isinstance(color, str):
        samples = tuple(color)
    else:
        from PIL import ImageColor

        try:
            samples = ImageColor.getrgb(color)
        except ValueError:
            samples = ()
    if len(samples) != 3:
        raise UsageError(f"the background {color!r} is not a color; give a name such as white, or #rrggbb")
    for sample in samples:
        check_whole("a sample of the background", sample)
        check_range("a sample of the background", sample, 0, 255)
    red, green, blue = samples
    return int(red), int(green), int(blue)


def check_alpha(alpha: Frame, peak: int, background: Background | None, name: str) -> bool:
    """Whether a picture is opaque everywhere, by its alpha (H, W) of 0..peak.

    A GsvcError ``unsupported`` refuses one that is not where there is no background: the color under a transparent
    pixel would be a guess.
    """
    opaque = int(alpha.min()) >= peak
    if not opaque and background is None:
        raise GsvcError(
            "unsupported",
            f"{name} is transparent in places, and GSVC has no alpha: flatten it onto a background, as with "
            f"--background white, or open_video(..., background='white')",
        )
    return opaque


def flattened(frame: Frame, alpha: Frame, peak: int, background: Background) -> Frame:
    """A frame (H, W, 3) with its alpha (H, W), both with samples 0..peak, on a background, as browsers do it.

    Samples of R'G'B' are mixed as they are, and rounded.
    """
    a = alpha[..., None].astype(np.uint64)
    below = (np.array(background, np.uint64) * peak + 127) // 255
    mixed = (frame * a + below * (peak - a) + peak // 2) // peak
    return mixed.astype(frame.dtype)


def flattening_note(name: str, background: Background | None) -> str:
    """A note about a source that has been flattened."""
    return f"transparent places of {name} show the background #{bytes(background or ()).hex()}"
