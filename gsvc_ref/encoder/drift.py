"""Constant rate in profile `main`: D of P-frames becomes finer where their PSNR drifts below that of the first one."""

from dataclasses import dataclass, replace
from typing import Final

RECOVERED: Final = 0.4
"""D goes back to that of the I-frame once a P-frame has this many dB more than the least that is allowed."""

JUMP: Final = 3.0
"""A P-frame with this many dB less than the one before shows something else: those after it are compared with it."""

FINEST: Final = 8
"""D becomes finer by at most this many eighths of an octave."""


@dataclass(frozen=True)
class Drift:
    """What P-frames of a group have lost, which decides on D of the next one.

    They are compared with the first P-frame after the I-frame; the I-frame itself, whose splats are all new, is better
    than those that follow it.
    """

    fall: float  # dB by which a P-frame may be below the first one
    coarsest: int  # the quantizer of the I-frame
    first_psnr: float | None = None  # what P-frames are compared with, in dB; None: there is none yet
    last_psnr: float = 0.0  # of the last P-frame, in dB

    def after(self, psnr: float) -> "Drift":
        """What is known after another P-frame with this PSNR in dB."""
        begins = self.first_psnr is None or psnr < self.last_psnr - JUMP
        return replace(self, first_psnr=psnr if begins else self.first_psnr, last_psnr=psnr)

    def following(self, quantizer: int) -> int:
        """The quantizer of the next P-frame, after one with this quantizer."""
        if self.first_psnr is None:
            return quantizer
        lost = self.first_psnr - self.last_psnr
        if lost > self.fall:
            return max(quantizer - 1, self.coarsest - FINEST, 0)
        if lost < self.fall - RECOVERED:
            return min(quantizer + 1, self.coarsest)
        return quantizer
