"""Text and screen content: how a picture shows it, and the PSNR to expect.

A splat is smooth and a letter is not, so that text takes several times the splats of a photograph. Pictures of screens
have areas of one colour, and edges that rise from one pixel to the next.
"""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from gsvc_base.arrays import Frame
from gsvc_base.portable import log2, whole_power
from gsvc_ref.encoder.settings import Settings

SHARP_EDGE: Final = 64 / 255
"""A sharp edge is a difference of two neighbouring pixels by this part of the peak, in luma..."""

SOFT_EDGE: Final = 16 / 255
"""...and an edge of any kind is one of this."""

MIN_FLAT: Final = 0.4
"""Screen content has at least this fraction of equal pairs of neighbours in a row..."""

MIN_SHARP: Final = 0.005
"""...this fraction of sharp edges among all pairs of neighbours..."""

MIN_SHARP_SHARE: Final = 0.4
"""...and this fraction of sharp ones among its edges. Of 24 pages, terminals, slides and windows drawn with Pillow's
font, 176x144 to 640x360, all are found; the scanned and the photographed page of scikit-image are not. Of 20 scenes and
20 other pictures of scikit-image two are found, which are drawings in black and white."""

GOOD: Final = 35.0
"""The PSNR in dB for which a number of splats is recommended."""

SPLATS_OF_EDGE: Final = 0.56
"""Splats for each pixel of a sharp edge that GOOD takes; 0.38 to 0.69 for 13 such pictures of 176x144 and 352x288."""

SCREEN_DB_PER_DOUBLING: Final = 7.0
"""What twice the splats gain there, in dB; photographs gain 3 to 5."""


@dataclass(frozen=True)
class Sharpness:
    """What tells screen content."""

    flat: float  # the fraction of pairs of neighbours in a row that are equal
    sharp: float  # the fraction of pairs of neighbours, in rows and columns, with a sharp edge between them
    share: float  # the fraction of sharp ones among all edges
    edge_pixels: int  # the number of pixels at a sharp edge, about

    @classmethod
    def of(cls, frame: Frame, peak: int) -> Self:
        """Of a frame (H, W, 3) u1 or u2 with samples of 0..peak."""
        height, width = frame.shape[:2]
        if min(height, width) < 2:
            return cls(0.0, 0.0, 0.0, 0)
        whole = frame.astype(np.int32)
        luma = (2 * whole[..., 0] + 5 * whole[..., 1] + whole[..., 2]) // 8  # BT.601's, in eighths
        across, down = abs(np.diff(luma, axis=1)), abs(np.diff(luma, axis=0))

        def edges(difference: float) -> float:
            return float((across >= difference * peak).mean() + (down >= difference * peak).mean()) / 2

        flat = float((whole[:, 1:] == whole[:, :-1]).all(axis=2).mean())
        sharp, soft = edges(SHARP_EDGE), edges(SOFT_EDGE)
        return cls(flat, sharp, sharp / soft if soft else 0.0, round(sharp * height * width))

    @property
    def is_screen(self) -> bool:
        """Whether the frame looks like text or a screen."""
        return self.flat >= MIN_FLAT and self.sharp >= MIN_SHARP and self.share >= MIN_SHARP_SHARE

    @property
    def good_splats(self) -> int:
        """The number of splats with which such a frame has GOOD, about."""
        return max(1, round(SPLATS_OF_EDGE * self.edge_pixels))

    def expected_psnr(self, splats: int) -> float:
        """The PSNR in dB of such a frame with a number of splats, about."""
        return GOOD + SCREEN_DB_PER_DOUBLING * float(log2(splats / self.good_splats))


def screen_note(frame: Frame, peak: int, settings: Settings) -> str | None:
    """What is to be expected of a frame (H, W, 3) u1 or u2 that looks like a screen, or None if nothing bad is.

    The frame has samples of 0..peak, and is to be encoded with the settings.
    """
    sharpness = Sharpness.of(frame, peak)
    if not sharpness.is_screen:
        return None
    look = f"this looks like text or a screen ({100 * sharpness.flat:.0f} % even, sharp edges), which splats suit badly"
    height, width = frame.shape[:2]
    splats, good = settings.told_splats(width, height), sharpness.good_splats
    needed = f"about {_rounded(good):,} splats for {GOOD:.0f} dB"
    if splats is None:
        return f"{look}: expect {needed} in an I-frame"
    if splats >= good:
        return None
    expected = max(sharpness.expected_psnr(splats), 10.0)
    return f"{look}: expect {expected:.0f} dB, give or take 4, with {splats:,} splats, and {needed} (--splats, --psnr)"


def _rounded(count: int) -> int:
    """A number with two digits that count."""
    unit = round(whole_power(10.0, max(0, len(str(count)) - 2)))
    return round(count / unit) * unit
