"""Constant rate in profile `main`: D of P-frames becomes finer where their PSNR sinks."""

from dataclasses import dataclass, replace
from typing import Final

RECOVERED: Final = 0.4
"""D goes back to that of the I-frame once P-frames are so many dB less behind than is allowed."""

JUMP: Final = 3.0
"""A P-frame with so many dB less than the one before shows something else, and those after it are held against it."""

FINEST: Final = 8
"""D becomes finer by at most so many eighths of an octave."""


@dataclass(frozen=True)
class HeldLevel:
    """D of the next P-frame of a group, by the PSNR of those before.

    The first P-frame behind an I-frame says what level is held; the I-frame itself, whose splats are all new, is better
    than those that follow it.

    Attributes
    ----------
    fall
        The dB by which a P-frame may be behind the first one.
    coarsest
        The quantiser of the I-frame.
    level, last
        The PSNR that P-frames are held against, and that of the last one, in dB; None: there is none yet.
    """

    fall: float
    coarsest: int
    level: float | None = None
    last: float = 0.0

    def after(self, quality: float) -> "HeldLevel":
        """What is known after another P-frame with this PSNR in dB."""
        begins = self.level is None or quality < self.last - JUMP
        return replace(self, level=quality if begins else self.level, last=quality)

    def following(self, quantizer: int) -> int:
        """The quantiser of the next P-frame, after one with this quantiser."""
        if self.level is None:
            return quantizer
        behind = self.level - self.last
        if behind > self.fall:
            return max(quantizer - 1, self.coarsest - FINEST, 0)
        if behind < self.fall - RECOVERED:
            return min(quantizer + 1, self.coarsest)
        return quantizer
