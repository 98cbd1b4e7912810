"""Where an output is wrong: from some place on, in its last part, in every n-th place, in single columns or channels.

Blocks of threads, warps, tiles and grids leave such traces, whatever the formula: an element that no thread came to
keeps what the buffer held.
"""

from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from conformance.diagnosis.failures import EXPLAINED, Array, Mask, Part
from conformance.names import columns, dimensions, item

BLOCKS: Final = (256, 128, 64, 32, 16, 8, 4)
"""Usual sizes of blocks of threads, warps and vectors: the last one may be partial."""

PERIODS: Final = (2, 3, 4, 8, 16, 32, 64, 128, 256)
"""Distances at which single lanes, threads or rows are lost."""

TILES: Final = (16, 8, 32)
"""Usual sides of tiles of pixels."""

LEAST_BLOCK: Final = 32
"""Multiples of this are told as such."""


class Candidate(NamedTuple):
    """What an output may look like.

    Attributes
    ----------
    sentence
        To stand after "looks like".
    foresees
        Whether a vector whose output has a shape would show it, too; None: not known.
    """

    sentence: str
    foresees: Callable[[tuple[int, ...]], bool] | None = None


class Axis(NamedTuple):
    """A way to count the elements of an output."""

    noun: str
    index: NDArray[np.int64]
    size: int
    of_shape: Callable[[tuple[int, ...]], int]


def size_hint(k: int) -> str:
    """What a number of elements may be, in words: a power of two, or so many blocks of one."""
    if k >= 2 and k & (k - 1) == 0:
        return f" ({k} = 2^{k.bit_length() - 1}: one block, table or grid of {k}?)"
    if k and k % LEAST_BLOCK == 0:
        block = max(b for b in BLOCKS if k % b == 0)
        return f" ({k} = {k // block} x {block}: so many whole blocks of {block}?)"
    return ""


def axes(part: Part) -> list[Axis]:
    """The axes of an output that is no table's columns: its items, and for pictures rows, columns and all pixels."""
    shape = part.right.shape
    port = next(port for port in part.stage.outputs if port.name == part.name)
    letters = [letter.upper() for letter in dimensions(port)]
    grid = np.indices(shape, sparse=True)
    found = []
    if "H" in letters and "W" in letters:
        y, x = letters.index("H"), letters.index("W")
        if y > 0:
            found.append(_axis("frames", grid[0], shape, lambda s: s[0]))
        found.append(_axis("rows of pixels", grid[y], shape, lambda s: s[y]))
        found.append(_axis("columns of pixels", grid[x], shape, lambda s: s[x]))
        if y == 0:
            found.append(_axis("pixels, row after row,", grid[y] * shape[x] + grid[x], shape, lambda s: s[0] * s[1]))
            for side in TILES:
                across = -(-shape[x] // side)
                tiles = grid[y] // side * across + grid[x] // side
                found.append(_axis(f"tiles of {side}x{side}", tiles, shape, _tiles(side)))
    elif shape:
        found.append(_axis(f"{item(part.stage, part.name)}s", grid[0], shape, lambda s: s[0]))
    return found


def _tiles(side: int) -> Callable[[tuple[int, ...]], int]:
    return lambda s: -(-s[0] // side) * -(-s[1] // side)


def _axis(noun: str, index: Array, shape: tuple[int, ...], of_shape: Callable[[tuple[int, ...]], int]) -> Axis:
    return Axis(noun, np.broadcast_to(index, shape), of_shape(shape), of_shape)


def region_candidates(part: Part) -> Iterator[Candidate]:
    """What the place of the wrong elements looks like, the most telling first; nothing where all are wrong."""
    if part.right.size < 2 or not part.right.shape:
        return
    state, seen = _content(part)
    whose = f" of {part.name}" if len(part.stage.outputs) > 1 else ""
    for axis in axes(part):
        wrong, visible = (_by_index(mask, axis) for mask in (part.wrong, seen))
        if wrong.sum() and not wrong.all():
            for candidate in _shapes(axis, wrong, visible):
                yield Candidate(candidate.sentence.replace("IS", state, 1) + whose, candidate.foresees)
    yield from _edges(part, state, seen)


def _content(part: Part) -> tuple[str, Mask]:
    """What the wrong elements hold, and which elements could show it."""
    held = part.mine[part.wrong]
    with np.errstate(invalid="ignore"):
        if np.isnan(held).all():
            return "NaN", np.ones(part.right.shape, np.bool_)
        if (held == held[0]).all():
            return ("0" if held[0] == 0 else f"all {held[0]:g}"), part.differs(np.full(part.right.shape, held[0]))
    return "wrong", np.ones(part.right.shape, np.bool_)


def _by_index(mask: Mask, axis: Axis) -> Mask:
    return np.asarray(np.bincount(axis.index[mask].ravel(), minlength=axis.size) > 0)


def _shapes(axis: Axis, wrong: Mask, visible: Mask) -> Iterator[Candidate]:
    """Suffixes, last parts, prefixes and periods of an axis."""
    size, places = axis.size, np.flatnonzero(wrong)
    first, last = int(places[0]), int(places[-1])
    noun, of_shape = axis.noun, axis.of_shape
    if first > 0 and _fills(wrong, visible, slice(first, None)):
        start = int(np.flatnonzero(visible[:first])[-1]) + 1 if visible[:first].any() else first
        for k in sorted({first, *_round(start, first)}, key=lambda k: (k & (k - 1) != 0, k % LEAST_BLOCK != 0, k)):
            if k > 1 and k < size - 1:
                yield Candidate(f"{noun} from {k} on IS{size_hint(k)}", lambda s, k=k: of_shape(s) > k)
        if start <= size - 1 <= first:
            yield Candidate(f"the last of the {noun} IS", lambda s: of_shape(s) > 1)
        for block in BLOCKS:
            k = size // block * block
            if size % block and start <= k <= first and k > 0:
                yield Candidate(
                    f"the last partial block of {block} of the {noun} IS (no multiple of {block})",
                    lambda s, block=block: of_shape(s) % block > 0 and of_shape(s) > block,
                )
        if 1 < first < size - 1:
            return
    if last < size - 1 and _fills(wrong, visible, slice(None, last + 1)):
        yield Candidate(f"the first {'' if last == 0 else last + 1} of the {noun} IS".replace("  ", " "))
    for period in PERIODS:
        rest = np.unique(places % period)
        if len(rest) == 1 and size >= 2 * period and _fills(wrong, visible, slice(int(rest[0]), None, period)):
            yield Candidate(f"every {_nth(period)} of the {noun} IS (number {rest[0]} of each {period})")
            return


def _round(start: int, first: int) -> list[int]:
    """Round numbers that are as good a beginning as the first wrong element: those before it cannot show."""
    return [k for block in BLOCKS for k in range(-(-max(start, 1) // block) * block, first + 1, block)][:8]


def _nth(period: int) -> str:
    return {2: "second", 3: "third"}.get(period, f"{period}th")


def _fills(wrong: Mask, visible: Mask, where: slice) -> bool:
    """Whether nearly all places of a part that can show it are wrong."""
    shown = visible[where] | wrong[where]
    return bool(wrong[where][shown].mean() >= EXPLAINED)


def _edges(part: Part, state: str, seen: Mask) -> Iterator[Candidate]:
    """Last rows and columns together, last partial tiles, and the outermost pixels of pictures (H, W, 3)."""
    if part.right.ndim != 3:
        return
    height, width = part.right.shape[:2]
    rows, across = np.indices((height, width))
    masks = {
        "the last row and column of pixels": (rows == height - 1) | (across == width - 1),
        "the outermost pixels": (rows == height - 1) | (across == width - 1) | (rows == 0) | (across == 0),
    }
    for side in TILES:
        beyond = (rows >= height // side * side) | (across >= width // side * side)
        masks[f"pixels left out that lie beyond the last whole tile of {side}x{side}"] = beyond
        inner = (rows % side == side - 1) | (across % side == side - 1)
        masks[f"the last row and column of each tile of {side}x{side}"] = inner
        masks[f"the first row and column of each tile of {side}x{side}"] = (rows % side == 0) | (across % side == 0)
    wrong = part.wrong.any(axis=2)
    for sentence, mask in masks.items():
        shown = (seen.any(axis=2) | wrong) & mask
        if not (wrong & ~mask).any() and not mask.all() and shown.any() and wrong[shown].mean() >= EXPLAINED:
            yield Candidate(sentence if "left out" in sentence else f"{sentence} {state}")


def column_candidates(part: Part) -> Iterator[Candidate]:
    """The columns or channels that alone are wrong, by name; nothing where all are."""
    names = columns(part.stage, part.name, part.right.shape[-1] if part.right.ndim else None)
    if part.name == "header" or part.right.ndim < 2 or len(names) != part.right.shape[-1]:
        return
    bad = part.wrong.reshape(-1, len(names)).any(axis=0)
    if not bad.all():
        listed = ", ".join(name for name, is_bad in zip(names, bad, strict=True) if is_bad)
        yield Candidate(f"errors in {listed} alone" + (f" (of {part.name})" if len(part.stage.outputs) > 1 else ""))
