"""The adaptive models of P-frames (spec.md section 15.11)."""

from collections.abc import Mapping
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from gsvc_base.arrays import I8
from gsvc_ref._jit import kernel
from gsvc_ref.main.passes import TOTAL, Distributions, Run, magnitude_classes

MODELS: Final[Mapping[str, tuple[tuple[int, ...], ...]]] = {
    "vector": (
        (736, 152, 76, 40, 52, 36, 44, 28, 36, 20, 20, 10, 8, 4, 3, 2, 2),
        (1024, 116, 36, 16, 16, 10, 12, 8, 10, 6, 6, 4, 3, 2),
        (500, 286, 116, 56, 62, 40, 50, 36, 44, 22, 28, 14, 10, 4, 2),
        (320, 148, 80, 56, 82, 68, 108, 74, 112, 68, 72, 36, 32, 10, 6, 2),
        (386, 102, 48, 44, 60, 50, 104, 66, 98, 80, 96, 54, 46, 18, 10, 5, 4),
    ),
    "mode": (
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
    ),
    "position": (
        (432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2),
        (432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2),
        (432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2),
        (432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2),
    ),
    "shape": (
        (432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2),
        (432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2),
        (432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2),
        (432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2),
        (576, 320, 156, 72, 70, 28, 24, 10, 8, 3, 2),
        (576, 320, 156, 72, 70, 28, 24, 10, 8, 3, 2),
        (576, 320, 156, 72, 70, 28, 24, 10, 8, 3, 2),
    ),
    "color": (
        (264, 244, 228, 148, 152, 76, 72, 36, 24, 10, 8, 4),
        (736, 320, 96, 42, 32, 14, 14, 7, 5, 3, 2),
        (736, 320, 96, 42, 32, 14, 14, 7, 5, 3, 2),
        (736, 320, 96, 42, 32, 14, 14, 7, 5, 3, 2),
        (944, 224, 44, 18, 14, 6, 6, 3, 2, 2, 2),
        (944, 224, 44, 18, 14, 6, 6, 3, 2, 2, 2),
        (944, 224, 44, 18, 14, 6, 6, 3, 2, 2, 2),
    ),
}  # fmt: skip
"""The counts of each context of the models by name at the start, without those at the end that are 1 (R-15.11-1)."""

SYMBOLS: Final = {"vector": 24, "mode": 9, "position": 24, "shape": 24, "color": 24}
"""The number of symbols of each model."""

MAX_MODEL_SYMBOLS: Final = max(SYMBOLS.values())


class Row(NamedTuple):
    """Where the contexts of a model are in the counts of all: the first row, and the one after the last."""

    first: int
    end: int


def _rows() -> dict[str, Row]:
    ends = np.cumsum([0, *map(len, MODELS.values())]).tolist()
    return {name: Row(*ends[i : i + 2]) for i, name in enumerate(MODELS)}


ROWS: Final = _rows()


def _counts(name: str) -> I8:
    """All counts of a model at the start (contexts, MAX_MODEL_SYMBOLS), 0 where it has no symbol."""
    ones = [[*row, *[1] * (SYMBOLS[name] - len(row))] for row in MODELS[name]]
    return np.pad(np.array(ones, np.int64), ((0, 0), (0, MAX_MODEL_SYMBOLS - SYMBOLS[name])))


_SYMBOLS_OF: Final[I8] = np.concatenate([np.full(len(MODELS[name]), SYMBOLS[name]) for name in MODELS])
"""The number of symbols of each row."""

_START: Final[I8] = np.concatenate([_counts(name) for name in MODELS])
"""The counts of all models at the start, (33, 24)."""

SUM_BITS: Final = 17
"""The counts of a context are shifted until their sum has no more bits, so that 32 bits do."""

GAIN: Final = 64
"""What one symbol adds to a count (15-11)."""


def distributions(counts: I8) -> Distributions:
    """The distribution of each context of a model with these counts (contexts, K)."""
    return _distributions(counts, np.full(len(counts), counts.shape[1]))


@kernel()
def _distributions(counts: I8, symbols: I8) -> Distributions:
    """The distributions of contexts with that many symbols each (15-14)."""
    first = np.zeros(len(counts) + 1, np.int64)
    for context in range(len(counts)):
        first[context + 1] = first[context] + symbols[context] + 1
    cumulative = np.zeros(first[len(counts)], np.int64)
    for context in range(len(counts)):
        K, total, shift, largest, at = symbols[context], 0, 0, 0, 0
        for s in range(K):
            total += counts[context, s]
        while total >> shift >= 1 << SUM_BITS:
            shift += 1
        total = 0
        for s in range(K):
            total += counts[context, s] >> shift
        begin = first[context]
        for s in range(K):
            frequency = 1 + (TOTAL - K) * (counts[context, s] >> shift) // total
            cumulative[begin + s + 1] = cumulative[begin + s] + frequency
            if frequency > largest:
                largest, at = frequency, s
        rest = TOTAL - cumulative[begin + K]
        for s in range(at, K):
            cumulative[begin + s + 1] += rest
    return Distributions(cumulative, first)


@kernel()
def model_distributions(counts: I8) -> Distributions:
    """The distribution of each context of all models (33, 24)."""
    return _distributions(counts, _SYMBOLS_OF)


@kernel()
def note_symbols(contexts: I8, symbols: I8, seen: I8) -> None:
    """Count the symbols of a pass in their contexts."""
    for i in range(len(symbols)):
        seen[contexts[i], symbols[i]] += 1


@kernel()
def adapted(counts: I8, seen: I8) -> I8:
    """The counts of a model after a frame in which each symbol was seen so often in each context (15-11)."""
    contexts, symbols = counts.shape
    after = counts.copy()
    for context in range(contexts):
        used = False
        for s in range(symbols):
            used |= seen[context, s] > 0
        for s in range(symbols):
            if used:
                after[context, s] = counts[context, s] - ((counts[context, s] + 7) >> 3) + GAIN * seen[context, s]
    return after


class Models:
    """All models in one frame: static while the frame is coded."""

    def __init__(self, counts: I8 = _START) -> None:
        self.counts = counts  # (33, 24), of the contexts of all models
        self._seen = np.zeros_like(counts)

    @cached_property
    def distributions(self) -> Distributions:
        """The distributions of all contexts."""
        return model_distributions(self.counts)

    def code(self, run: Run, at: int, name: str, contexts: I8, symbols: I8 | None = None) -> I8:
        """A part of the pass `at`: symbols by a model."""
        rows = ROWS[name].first + contexts
        symbols = run.symbols(at, self.distributions, rows, symbols)
        note_symbols(rows, symbols, self._seen)
        return symbols

    def code_magnitudes(
        self, run: Run, at: int, name: str, contexts: I8, magnitudes: I8 | None = None, *, late: bool = False
    ) -> I8:
        """Magnitudes: classes in the pass `at`, by a model, and low bits, early after it or late."""
        classes = self.code(run, at, name, contexts, None if magnitudes is None else magnitude_classes(magnitudes))
        return run.low_bits(None if late else at, classes, magnitudes)

    def adapted(self) -> "Models":
        """The models of the next frame."""
        return Models(adapted(self.counts, self._seen))
