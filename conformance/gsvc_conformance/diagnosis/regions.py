"""Where an output is wrong: from some place on, in its last part, in every n-th place, in single columns or channels.

Blocks of threads, warps, tiles and grids leave such traces, whatever the formula: an element that no thread came to
keeps what the buffer held.
"""

from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance.diagnosis.failures import EXPLAINED, F8, Array, Mask, Part
from gsvc_conformance.names import columns, dimensions, item

BLOCKS: Final = (32, 64, 128, 256, 16, 8, 4)
"""Usual sizes of warps, blocks of threads and vectors: the last one may be partial. The most usual ones come first."""

PERIODS: Final = (2, 3, 4, 8, 16, 32, 64, 128, 256)
"""Distances at which single lanes, threads or rows are lost."""

TILES: Final = (16, 8, 32)
"""Usual sides of tiles of pixels."""

TILED: Final = ("rendering", "deterministic", "training")
"""Classes of pictures that are made of splats, tile by tile."""

MIN_BLOCK: Final = 32
"""Multiples of this number are named as such."""

MAX_ROUND: Final = 8
"""Maximum number of round numbers that are as good as the first wrong place."""

FAINT: Final = 1e-3
"""Fraction of the largest element below which an error would not show."""

Shape = tuple[int, ...]
Grid = tuple[Array, ...]
Where = Callable[[NDArray[np.int64], int], Mask]
"""From the numbers of elements, and how many there are, which of them are meant."""


class Candidate(NamedTuple):
    """A description that may fit an output.

    Attributes
    ----------
    sentence
        To stand after "looks like".
    foresees
        Whether a vector that expects an array would show it, too; None: not known.
    least
        Fraction of the operation's failures that must show it.
    telling
        How much it counts, of the 1 that it takes: an output of which all is lost may have lost anything, and a single
        number agrees with one of many accounts by chance.
    single
        Whether it names single terms, which many other mutants spoil in some vector: then most failures must have such.
    """

    sentence: str
    foresees: Callable[[F8], bool] | None = None
    least: float = 0.0
    telling: float = 1.0
    single: bool = False


class Axis(NamedTuple):
    """A way to count the elements of an output: what is counted, and the number of each element of a shape."""

    noun: str
    number: Callable[[Shape], NDArray[np.int64]]


def size_hint(k: int) -> str:
    """Words for a number of elements: a power of two, or a multiple of one."""
    if k >= 2 and k & (k - 1) == 0:
        return f" ({k} = 2^{k.bit_length() - 1}: one block, table or grid of {k}?)"
    if k and k % MIN_BLOCK == 0:
        block = max(b for b in BLOCKS if k % b == 0)
        return f" ({k} = {k // block} x {block}: so many whole blocks of {block}?)"
    return ""


def axes(part: Part) -> list[Axis]:
    """The axes of an output that is no table's columns: its items, and for pictures rows, columns and all pixels."""
    letters = [letter.upper() for letter in dimensions(part.operation, part.name)]
    if not ("H" in letters and "W" in letters):
        return [_axis(f"{item(part.operation, part.name)}s", lambda s, g: g[0])] if part.right.shape else []
    y, x = letters.index("H"), letters.index("W")
    found = [_axis("rows of pixels", lambda s, g: g[y]), _axis("columns of pixels", lambda s, g: g[x])]
    if y > 0:
        return [_axis("frames", lambda s, g: g[0]), *found]
    found.append(_axis("pixels, row after row,", lambda s, g: g[y] * s[x] + g[x]))
    sides = TILES if part.operation.group in TILED else ()
    return found + [_axis(f"tiles of {side}x{side}", _in_tiles(side, y, x)) for side in sides]


def _in_tiles(side: int, y: int, x: int) -> Callable[[Shape, Grid], Array]:
    return lambda s, g: g[y] // side * -(-s[x] // side) + g[x] // side


def _axis(noun: str, index: Callable[[Shape, Grid], Array]) -> Axis:
    return Axis(noun, lambda shape: np.broadcast_to(index(shape, np.indices(shape, sparse=True)), shape))


def region_candidates(part: Part) -> Iterator[Candidate]:
    """Descriptions of the place of the wrong elements, the most telling first; none where all are wrong."""
    if part.right.size < 2 or not part.right.shape:
        return
    state, seen = content(part)
    for axis in axes(part):
        index = axis.number(part.right.shape)
        size = int(index.max()) + 1
        wrong, visible = (np.bincount(index[mask].ravel(), minlength=size) > 0 for mask in (part.wrong, seen))
        if wrong.sum() and (visible & ~wrong).any():
            for words, where in _shapes(wrong, visible | wrong):
                whole = part.wrong[(part.wrong | seen) & where(index, size)]
                if state != "wrong" and whole.mean() < EXPLAINED:
                    continue
                sentence = words.replace("NOUN", axis.noun).replace("IS", f"are {state}")
                yield Candidate(sentence, _would_show(axis, where))
    yield from _edges(part, state, seen)


def content(part: Part) -> tuple[str, Mask]:
    """Descriptions of the contents of the wrong elements, and which elements could show them."""
    held = part.mine[part.wrong]
    with np.errstate(invalid="ignore"):
        if np.isnan(held).all():
            return "NaN", np.ones(part.right.shape, np.bool_)
        if (held == held[0]).all():
            return ("0" if held[0] == 0 else f"all {held[0]:g}"), part.differs(np.full(part.right.shape, held[0]))
        return "wrong", part.differs(np.zeros(part.right.shape))


def _would_show(axis: Axis, where: Where) -> Callable[[F8], bool]:
    """Whether an expected array has anything at the places of a shape, and anything elsewhere."""

    def foresees(value: F8) -> bool:
        index = axis.number(value.shape)
        there = abs(value.astype(np.float64)) > FAINT * max(float(np.nanmax(abs(value))), 1e-30)
        mask = where(index, int(index.max()) + 1)
        return bool((there & mask).any() and (there & ~mask).any())

    return foresees


def _shapes(wrong: Mask, visible: Mask) -> Iterator[tuple[str, Where]]:
    """Suffixes, last parts, first items and periods of an axis, and where each is."""
    size, places = len(wrong), np.flatnonzero(wrong)
    first, last = int(places[0]), int(places[-1])
    start = int(np.flatnonzero(visible[:first])[-1]) + 1 if visible[:first].any() else 0
    if start and _fills(wrong, visible, slice(first, None)):
        if start <= size - 1 <= first:
            yield "the last of the NOUN IS", _from_last
        for k in sorted({first, *_round(start, first)}, key=lambda k: (k & (k - 1) != 0, k % MIN_BLOCK != 0, k)):
            if 1 < k < size:
                yield f"NOUN from {k} on IS{size_hint(k)}", _from(k)
        for block in BLOCKS:
            if size % block and start <= size // block * block <= first and size > block:
                yield (f"the last partial block of {block} of the NOUN IS",
                       _beyond(block))  # fmt: skip
    if first == last == int(np.flatnonzero(visible)[0]) and first == 0:
        yield "the first of the NOUN IS", lambda i, n: np.asarray(i == 0)
    for period in PERIODS:
        rest = np.unique(places % period)
        shown = np.flatnonzero(visible)
        if len(rest) > 1 or len(shown) < 4 or size < 2 * period or len(places) < 2:
            continue
        if _fills(wrong, visible, slice(int(rest[0]), None, period)):
            every = {2: "second", 3: "third"}.get(period, f"{period}th")
            yield (f"every {every} of the NOUN IS (number {rest[0]} of each {period})",
                   _every(period, int(rest[0])))  # fmt: skip
            return


def _from_last(i: NDArray[np.int64], n: int) -> Mask:
    return np.asarray(i == n - 1)


def _from(k: int) -> Where:
    return lambda i, n: np.asarray(i >= k)


def _beyond(block: int) -> Where:
    return lambda i, n: np.asarray(i >= n // block * block)


def _every(period: int, rest: int) -> Where:
    return lambda i, n: np.asarray(i % period == rest)


def _round(start: int, first: int) -> list[int]:
    """Round numbers that are as good a beginning as the first wrong element: those before it cannot show."""
    numbers = {k for block in BLOCKS for k in range(-(-max(start, 1) // block) * block, first + 1, block)}
    return sorted(numbers, key=lambda k: (k & (k - 1) != 0, -(k & -k)))[:MAX_ROUND]


def _fills(wrong: Mask, visible: Mask, where: slice) -> bool:
    """Whether nearly all places of a part that can show it are wrong."""
    shown = visible[where]
    return bool(shown.any() and wrong[where][shown].mean() >= EXPLAINED)


def _edges(part: Part, state: str, seen: Mask) -> Iterator[Candidate]:
    """Last rows and columns together, last partial tiles, and the outermost pixels of pictures (H, W, 3)."""
    if part.right.ndim != 3:
        return
    height, width = part.right.shape[:2]
    y, x = np.indices((height, width))
    pairs = {
        "the last row and column of pixels": (y == height - 1, x == width - 1),
        "the outermost rows and columns of pixels": ((y == height - 1) | (y == 0), (x == width - 1) | (x == 0)),
    }
    for side in TILES:
        pairs[f"pixels left out that lie beyond the last whole tile of {side}x{side}"] = (
            y >= height // side * side, x >= width // side * side)  # fmt: skip
        across, down = -(-height // side) * side, -(-width // side) * side
        pairs[f"pixels left out beyond as many tiles of {side}x{side} as the other side of the picture has: the grid's "
              "width and height exchanged"] = (y >= down, x >= across)  # fmt: skip
        pairs[f"the last row and column of each tile of {side}x{side}"] = (y % side == side - 1, x % side == side - 1)
        pairs[f"the first row and column of each tile of {side}x{side}"] = (y % side == 0, x % side == 0)
    wrong, there = np.asarray(part.wrong.any(axis=2)), np.asarray(seen.any(axis=2))
    for sentence, (rows, across) in pairs.items():
        mask = rows | across
        shown = (there | wrong) & mask
        if mask.all() and "left out" in sentence and not part.mine.any():
            yield Candidate(sentence, telling=0.0)
        if (wrong & ~mask).any() or not (there & ~mask).any() or not shown.any() or wrong[shown].mean() < EXPLAINED:
            continue
        if "left out" in sentence:
            yield Candidate(sentence)
        elif (wrong & rows & ~across).any() and (wrong & across & ~rows).any():
            yield Candidate(f"{sentence} are {state}")


def column_candidates(part: Part) -> Iterator[Candidate]:
    """The columns or channels that alone are wrong, by name; nothing where all are."""
    names = columns(part.operation, part.name, part.right.shape[-1] if part.right.ndim else None)
    if part.name == "header":
        yield Candidate(f"errors in {', '.join(names[place] for place in np.flatnonzero(part.wrong))} alone")
        return
    if part.right.ndim < 2 or len(names) != part.right.shape[-1]:
        return
    bad = np.asarray(part.wrong.reshape(-1, len(names)).any(axis=0))
    able = part.differs(np.zeros(part.right.shape)).reshape(-1, len(names)).any(axis=0)
    if not bad[able].all():
        listed = ", ".join(name for name, is_bad in zip(names, bad, strict=True) if is_bad)
        state, k = content(part)[0], int(np.argmax(bad))
        if names[0] == "stage 0" and k and bad[k:].all():
            yield Candidate(f"stages from {k} on are {state}")
            return
        yield Candidate(f"{listed} {state}" if state in ("0", "NaN") else f"errors in {listed} alone")
