"""Constant rate in profile `main`: D of P-frames becomes finer where their PSNR drifts below that of the first one."""

from dataclasses import dataclass, replace
from typing import Final

RECOVERED: Final = 0.4
"""D goes back toward that of the I-frame once the loss of PSNR is this many dB below the one allowed."""

JUMP: Final = 3.0
"""A P-frame this many dB below the one before shows something else, and is the new reference of the group."""

FINEST: Final = 8
"""Maximum number of eighths of an octave by which D becomes finer."""


@dataclass(frozen=True)
class Drift:
    """What P-frames of a group have lost, which decides on D of the next one.

    The first P-frame after the I-frame is the reference; the I-frame itself, whose splats are all new, is better than
    those that follow it.
    """

    fall: float  # dB by which a P-frame may be below the reference
    coarsest: int  # the quantizer of the I-frame
    reference_psnr: float | None = None  # in dB; None: no P-frame so far
    last_psnr: float = 0.0  # of the last P-frame, in dB

    def after(self, psnr: float) -> "Drift":
        """What is known after another P-frame with this PSNR in dB."""
        begins = self.reference_psnr is None or psnr < self.last_psnr - JUMP
        return replace(self, reference_psnr=psnr if begins else self.reference_psnr, last_psnr=psnr)

    def following(self, quantizer: int) -> int:
        """The quantizer of the next P-frame, after one with this quantizer."""
        if self.reference_psnr is None:
            return quantizer
        lost = self.reference_psnr - self.last_psnr
        if lost > self.fall:
            return max(quantizer - 1, self.coarsest - FINEST, 0)
        if lost < self.fall - RECOVERED:
            return min(quantizer + 1, self.coarsest)
        return quantizer
