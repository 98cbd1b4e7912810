"""Constant rate in profile `main`: D of P-frames becomes finer where their PSNR sinks."""

from typing import Final

RECOVERED: Final = 0.4
"""D goes back to that of the I-frame once P-frames are so many dB less behind than is allowed."""

JUMP: Final = 3.0
"""A P-frame with so many dB less than the one before shows something else, and those after it are held against it."""

FINEST: Final = 8
"""D becomes finer by at most so many eighths of an octave."""


class HeldLevel:
    """Chooses D of each P-frame of a group by the PSNR of those before.

    The first P-frame behind an I-frame says what level is held; the I-frame itself, whose splats are all new, is better
    than those that follow it.

    Parameters
    ----------
    fall
        The dB by which a P-frame may be behind the first one.
    """

    def __init__(self, fall: float) -> None:
        self._fall = fall
        self._coarsest = 0
        self._level: float | None = None  # the PSNR that the others are held against
        self._last = 0.0

    def begin(self, quantizer: int) -> None:
        """Begin a group with an I-frame of this quantiser."""
        self._coarsest, self._level = quantizer, None

    def next(self, quantizer: int, quality: float) -> int:
        """The quantiser of the next P-frame, after one with this quantiser and PSNR in dB."""
        if self._level is None or quality < self._last - JUMP:
            self._level = quality
        self._last = quality
        behind = self._level - quality
        if behind > self._fall:
            return max(quantizer - 1, self._coarsest - FINEST, 0)
        if behind < self._fall - RECOVERED:
            return min(quantizer + 1, self._coarsest)
        return quantizer
