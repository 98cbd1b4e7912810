"""The adaptive models of P-frames (spec.md section 15.11)."""

from typing import Final, NamedTuple

import numpy as np

from gsvc_ref._jit import kernel
from gsvc_ref.arrays import I8
from gsvc_ref.main_profile.passes import ONE, Distributions, Run


class Start(NamedTuple):
    """A model at the start: its symbols, and the counts of each context without those at the end that are 1."""

    symbols: int
    counts: tuple[tuple[int, ...], ...]

    def rows(self) -> I8:
        """All counts, (contexts, symbols)."""
        return np.array([[*row, *[1] * (self.symbols - len(row))] for row in self.counts], np.int64)


STARTS: Final = {
    "vector": Start(24, (
        (736, 152, 76, 40, 52, 36, 44, 28, 36, 20, 20, 10, 8, 4, 3, 2, 2),
        (1024, 116, 36, 16, 16, 10, 12, 8, 10, 6, 6, 4, 3, 2),
        (500, 286, 116, 56, 62, 40, 50, 36, 44, 22, 28, 14, 10, 4, 2),
        (320, 148, 80, 56, 82, 68, 108, 74, 112, 68, 72, 36, 32, 10, 6, 2),
        (386, 102, 48, 44, 60, 50, 104, 66, 98, 80, 96, 54, 46, 18, 10, 5, 4),
    )),
    "mode": Start(9, (
        (1184, 20, 24, 10, 14, 6, 7, 9, 6),
        (1032, 52, 68, 32, 40, 11, 17, 22, 6),
        (752, 92, 116, 66, 96, 26, 52, 74, 6),
        (928, 68, 92, 46, 48, 14, 33, 45, 6),
        (736, 116, 146, 92, 70, 26, 46, 50, 6),
        (336, 97, 193, 176, 92, 48, 122, 216, 6),
        (944, 52, 79, 49, 44, 16, 33, 57, 6),
        (912, 53, 84, 54, 56, 18, 41, 58, 6),
        (784, 53, 87, 70, 66, 22, 54, 138, 6),
        (1056, 27, 62, 32, 24, 11, 20, 26, 22),
    )),
    "position": Start(24, (
        (432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2),
        (432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2),
        (432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2),
        (432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2),
    )),
    "shape": Start(24, (
        (432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2),
        (432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2),
        (432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2),
        (432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2),
        (576, 320, 156, 72, 70, 28, 24, 10, 8, 3, 2),
        (576, 320, 156, 72, 70, 28, 24, 10, 8, 3, 2),
        (576, 320, 156, 72, 70, 28, 24, 10, 8, 3, 2),
    )),
    "color": Start(24, (
        (264, 244, 228, 148, 152, 76, 72, 36, 24, 10, 8, 4),
        (736, 320, 96, 42, 32, 14, 14, 7, 5, 3, 2),
        (736, 320, 96, 42, 32, 14, 14, 7, 5, 3, 2),
        (736, 320, 96, 42, 32, 14, 14, 7, 5, 3, 2),
        (944, 224, 44, 18, 14, 6, 6, 3, 2, 2, 2),
        (944, 224, 44, 18, 14, 6, 6, 3, 2, 2, 2),
        (944, 224, 44, 18, 14, 6, 6, 3, 2, 2, 2),
    )),
}  # fmt: skip
"""The models by name (R-15.11-1)."""

SUM_BITS: Final = 17
"""The counts of a context are shifted until their sum has no more bits, so that 32 bits do."""

GAIN: Final = 64
"""What one symbol adds to a count (15-11)."""


def distributions(counts: I8) -> Distributions:
    """The distribution of each context of a model with these counts (contexts, K)."""
    contexts, symbols = counts.shape
    cumulative = np.empty((contexts, symbols + 1), np.int64)
    _distributions(counts, cumulative)
    return Distributions(cumulative.ravel(), np.arange(contexts + 1) * (symbols + 1))


@kernel()
def _distributions(counts: I8, cumulative: I8) -> None:
    contexts, symbols = counts.shape
    for context in range(contexts):
        total, shift, sum_of_frequencies, largest, at = 0, 0, 0, 0, 0
        for s in range(symbols):
            total += counts[context, s]
        while total >> shift >= 1 << SUM_BITS:
            shift += 1
        total = 0
        for s in range(symbols):
            total += counts[context, s] >> shift
        for s in range(symbols):
            frequency = 1 + (ONE - symbols) * (counts[context, s] >> shift) // total  # (15-14)
            sum_of_frequencies += frequency
            if frequency > largest:
                largest, at = frequency, s
        cumulative[context, 0] = 0
        for s in range(symbols):
            frequency = 1 + (ONE - symbols) * (counts[context, s] >> shift) // total
            frequency += ONE - sum_of_frequencies if s == at else 0
            cumulative[context, s + 1] = cumulative[context, s] + frequency


@kernel()
def _note(contexts: I8, symbols: I8, seen: I8) -> None:
    for i in range(len(symbols)):
        seen[contexts[i], symbols[i]] += 1


@kernel()
def _note_classes(contexts: I8, magnitudes: I8, seen: I8) -> None:
    for i in range(len(magnitudes)):
        s = magnitudes[i]
        if s >= 4:
            exponent = 2
            while s >> (exponent + 1):
                exponent += 1
            s = 2 * exponent + (s >> (exponent - 1) & 1)
        seen[contexts[i], s] += 1


def adapted(counts: I8, seen: I8) -> I8:
    """The counts of a model after a frame in which each symbol was seen so often in each context (15-11)."""
    used = (seen > 0).any(axis=1, keepdims=True)
    return np.where(used, (7 * counts >> 3) + GAIN * seen, counts)


class Models:
    """All models in one frame: static while the frame is coded."""

    def __init__(self, counts: dict[str, I8] | None = None) -> None:
        self.counts = counts or {name: start.rows() for name, start in STARTS.items()}
        self._seen = {name: np.zeros_like(rows) for name, rows in self.counts.items()}
        self._distributions: dict[str, Distributions] = {}

    def code(self, run: Run, name: str, contexts: I8, symbols: I8 | None = None) -> I8:
        """A pass of symbols by a model."""
        symbols = run.symbols(self._of(name), contexts, symbols)
        _note(contexts, symbols, self._seen[name])
        return symbols

    def code_magnitudes(self, run: Run, name: str, contexts: I8, magnitudes: I8 | None = None) -> I8:
        """Passes of classes, by a model, and of low bits."""
        magnitudes = run.magnitudes(self._of(name), contexts, magnitudes)
        _note_classes(contexts, magnitudes, self._seen[name])
        return magnitudes

    def _of(self, name: str) -> Distributions:
        if name not in self._distributions:
            self._distributions[name] = distributions(self.counts[name])
        return self._distributions[name]

    def adapted(self) -> "Models":
        """The models of the next frame."""
        return Models({name: adapted(rows, self._seen[name]) for name, rows in self.counts.items()})
