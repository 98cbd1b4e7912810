"""Large arrays in few bytes: runs that repeat a few elements, which a manifest lists and a file holds.

A *run* ``[n, first, length, phase]`` stands for n elements: elements first .. first + length - 1 of the file, again and
again, beginning with element first + phase. An array is its runs one after the other, in C order. Where the manifest
says ``differences``, these are the first element and the differences between neighbours, and the array is their running
sum. Nothing is compressed in any other way, so the bytes are the same everywhere.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.errors import UsageError
from gsvc_conformance.reading import MAX_BYTES, elements_of

Array = NDArray[Any]
Run = list[int]

LEAST: Final = 1 << 12
"""Arrays of fewer elements stay as they are."""

SAVED: Final = 64
"""Minimum number of elements that a run saves; shorter ones are kept as they are."""

LONGEST: Final = 1 << 12
"""The longest period that is looked for, in elements."""

KEY: Final = 8
"""Number of elements that must come again where a period begins."""

RECENT: Final = 4
"""Number of the last periods that may go on after an element that breaks them."""


@dataclass(frozen=True, eq=False)
class Packed:
    """The elements that a file holds (n,), and what the manifest says of them."""

    elements: Array
    runs: list[Run]
    differences: bool = False

    @property
    def entry(self) -> dict[str, Any]:
        """The fields of the manifest."""
        return {"runs": self.runs, **({"differences": True} if self.differences else {})}

    @property
    def size(self) -> int:
        """About how many bytes they take."""
        return self.elements.nbytes + 16 * len(self.runs)


def pack(array: Array) -> Packed | None:
    """Runs that stand for an array, or None if it is small or they would not be half of its bytes."""
    if array.size < LEAST:
        return None
    flat = np.ascontiguousarray(array).reshape(-1)
    ways = [_Search(flat).packed(False)]
    if flat.dtype.kind == "i":
        ways.append(_Search(np.diff(flat, prepend=flat.dtype.type(0)).astype(flat.dtype)).packed(True))
    best = min(ways, key=lambda packed: packed.size)
    return best if best.size < array.nbytes // 2 else None


def unpack(elements: Array, entry: Mapping[str, Any], path: Path | None = None) -> Array:
    """The array that elements of a file and the entry of a manifest (runs, shape, perhaps differences) stand for.

    Messages name the file by its path, if that is given.

    Raises
    ------
    UsageError
        The runs do not fit the file or the shape.
    """
    shape, runs = tuple(entry["shape"]), entry["runs"]
    count = elements_of(shape)
    fits = all(
        n >= 1 and first >= 0 and length >= 1 and first + length <= elements.size and 0 <= phase < length
        for n, first, length, phase in runs
    )
    too_large = count * elements.itemsize > MAX_BYTES
    if elements.ndim != 1 or not fits or too_large or sum(run[0] for run in runs) != count:
        file = path or entry["file"]
        raise UsageError(f"the runs of {file} do not fit its {elements.size} elements and the shape {shape}")
    parts = [_repeated(np.roll(elements[first : first + length], -phase), n) for n, first, length, phase in runs]
    flat = np.concatenate([elements[:0], *parts])
    return (np.cumsum(flat, dtype=flat.dtype) if entry.get("differences") else flat).reshape(shape)


def _repeated(block: Array, n: int) -> Array:
    """The first n elements of a block that comes again and again; np.resize joins as many arrays as it repeats."""
    return np.broadcast_to(block, (-(-n // len(block)), len(block))).reshape(-1)[:n]


class _Search:
    """Runs of an array (n,), found from its beginning to its end."""

    def __init__(self, flat: Array) -> None:
        self._flat = flat
        self._bits = flat.view(f"u{flat.itemsize}")  # NaN and the sign of zero count
        self._bytes = flat.tobytes()
        self._blocks: list[tuple[int, int, int]] = []  # first in the file, length, where in the array it began
        self._kept: list[Array] = []  # what the file holds
        self._stored = 0

    def packed(self, differences: bool) -> Packed:
        """Everything, in runs."""
        runs: list[Run] = []
        at = literal = 0
        while at < len(self._flat):
            run = self._again(at) or self._new(at)
            if run is None:
                at += 1
                if self._stored + at - literal > len(self._flat) // 2:
                    break  # it does not pay any more: the rest is kept as it is
                continue
            if literal < at:
                runs.append(self._literal(literal, at))
            runs.append(run if run[1] >= 0 else self._store(at, run))
            at += run[0]
            literal = at
        if literal < len(self._flat):
            runs.append(self._literal(literal, len(self._flat)))
        return Packed(np.concatenate([self._flat[:0], *self._kept]), runs, differences)

    def _again(self, at: int) -> Run | None:
        """A run of a block that is stored, in step with where it began."""
        for first, length, origin in reversed(self._blocks[-RECENT:]):
            phase = (at - origin) % length
            if self._bits[at] != self._bits[origin + phase]:
                continue
            n = self._matched(at, origin, length, phase)
            if n >= SAVED:
                return [n, first, length, phase]
        return None

    def _new(self, at: int) -> Run | None:
        """A run of a block that begins here, with first = -1: it is not stored yet."""
        size = self._flat.itemsize
        key = self._bytes[at * size : (at + KEY) * size]
        place = self._bytes.find(key, (at + 1) * size, (at + LONGEST + KEY) * size)
        while place % size and place >= 0:
            place = self._bytes.find(key, place + 1, (at + LONGEST + KEY) * size)
        if place < 0:
            return None
        length = place // size - at
        n = length + self._matched(at + length, at, length, 0)
        return [n, -1, length, 0] if n >= 2 * length and n >= length + SAVED else None

    def _matched(self, at: int, origin: int, length: int, phase: int) -> int:
        """The number of elements from `at` on that repeat the block at `origin`, beginning with its element `phase`."""
        bits, total, size = self._bits, 0, KEY
        block = np.roll(bits[origin : origin + length], -phase)
        while at + total < len(bits):
            part = bits[at + total : at + total + size]
            other = block[np.arange(total, total + len(part)) % length]
            differing = np.flatnonzero(part != other)
            if len(differing):
                return total + int(differing[0])
            total += len(part)
            size *= 4
        return total

    def _literal(self, first: int, end: int) -> Run:
        self._kept.append(self._flat[first:end])
        self._stored += end - first
        return [end - first, self._stored - (end - first), end - first, 0]

    def _store(self, at: int, run: Run) -> Run:
        n, _, length, phase = run
        first = self._stored
        self._kept.append(self._flat[at : at + length])
        self._stored += length
        self._blocks.append((first, length, at))
        return [n, first, length, phase]
