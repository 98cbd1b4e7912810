"""Constant rate in profile `main`: D of P-frames becomes finer where their PSNR sinks."""

from dataclasses import dataclass, replace
from typing import Final

RECOVERED: Final = 0.4
"""D goes back toward that of the I-frame once the loss of PSNR is this many dB below the one allowed."""

JUMP: Final = 3.0
"""A P-frame this many dB below the one before shows something else, and is the new reference of the group."""

FINEST: Final = 8
"""Maximum number of eighths of an octave by which D becomes finer."""


@dataclass(frozen=True)
class HeldLevel:
    """D of the next P-frame of a group, by the PSNR of those before.

    The first P-frame after an I-frame is the reference; the I-frame itself, whose splats are all new, is better than
    those that follow it.
    """

    fall: float  # the dB by which a P-frame may be below the reference
    coarsest: int  # quantizer of the I-frame
    # PSNR in dB of the reference (None: no P-frame so far), and of the last P-frame
    reference: float | None = None
    last: float = 0.0

    def after(self, psnr: float) -> "HeldLevel":
        """What is known after another P-frame with this PSNR in dB."""
        begins = self.reference is None or psnr < self.last - JUMP
        return replace(self, reference=psnr if begins else self.reference, last=psnr)

    def following(self, quantizer: int) -> int:
        """The quantizer of the next P-frame, after one with this quantizer."""
        if self.reference is None:
            return quantizer
        loss = self.reference - self.last
        if loss > self.fall:
            return max(quantizer - 1, self.coarsest - FINEST, 0)
        if loss < self.fall - RECOVERED:
            return min(quantizer + 1, self.coarsest)
        return quantizer
