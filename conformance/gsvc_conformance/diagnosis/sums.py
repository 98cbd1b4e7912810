"""Which terms of a sum were left out or taken twice: partial blocks, lost tiles, lost or doubled splats."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from gsvc_conformance.diagnosis.failures import Array, Failure, Part
from gsvc_conformance.diagnosis.regions import BLOCKS, MIN_BLOCK, PERIODS, TILES, Candidate, size_hint
from gsvc_conformance.diagnosis.terms import Terms, names_of, terms_of

MAX_TOLD: Final = 8
"""Maximum number of beginnings of a missing part that are candidates, round ones first."""

MAX_SOLVED: Final = 160
"""Maximum number of terms whose weights are found by least squares."""

INTEGER: Final = 0.02
"""Maximum distance of a weight from an integer."""


def sum_candidates(failure: Failure, part: Part) -> Iterator[Candidate]:
    """Accounts of wrong terms of a sum, simple ones first; none where the output is no sum."""
    terms = terms_of(failure, part)
    if terms is None or terms.terms.size == 0 or not np.isfinite(terms.terms).all():
        return
    flat = _flat(part, terms.chosen)
    total = terms.finish(terms.base + terms.terms.sum(axis=0))
    if not flat.wrong.any() or (~(abs(total - flat.right) <= flat.slack(total) + flat.allowed)).mean() > 0.1:
        return  # the right output is not this sum, as where a dead codeword is replaced
    counts = 0.5 if len(flat.right) == 1 else 1.0
    for sentence, weights in _weights(terms):
        if flat.agrees(terms.finish(terms.base + weights @ terms.terms)):
            yield Candidate(sentence, telling=counts * weights.any())
    for sentence in (*_prefixes(terms, flat), *_stored(terms, flat)):
        yield Candidate(sentence, telling=counts)
    for sentence in _solved(terms, flat):
        yield Candidate(sentence, telling=counts, single=True)


def _flat(part: Part, chosen: Array) -> Part:
    """Some elements of a part."""
    right, mine, allowed = (array.ravel()[chosen] for array in (part.right, part.mine, part.allowed))
    return replace(part, right=right, mine=mine, allowed=allowed, wrong=part.wrong.ravel()[chosen])


def _weights(terms: Terms) -> Iterator[tuple[str, Array]]:
    """Plausible weights of the terms, by what they are called."""
    if terms.size is None:
        yield from _along(terms.noun, np.arange(len(terms.terms)))
        return
    height, width = terms.size
    y, x = (index.ravel() for index in np.indices(terms.size))
    yield from _along("rows of pixels", y)
    yield from _along("columns of pixels", x)
    yield from _along("pixels, row after row,", y * width + x)
    last = (y == height - 1) | (x == width - 1)
    outer = last | (y == 0) | (x == 0)
    yield "the last row and column of pixels left out", 1.0 - last
    yield "the outermost pixels left out", 1.0 - outer
    yield "the outermost pixels taken twice", 1.0 + outer
    yield "the last row and column of pixels taken twice", 1.0 + last
    for name, part in {"left": x < width // 2, "right": x >= width // 2, "upper": y < height // 2,
                       "lower": y >= height // 2}.items():  # fmt: skip
        yield f"the {name} half of the pixels left out", 1.0 - part
    for side in TILES:
        yield from _tiled(y, x, side, terms.size)


def _tiled(y: Array, x: Array, side: int, size: tuple[int, int]) -> Iterator[tuple[str, Array]]:
    """Patterns of weights of tiles of pixels, and of the threads of each."""
    height, width = size
    tile = f"tile of {side}x{side}"
    beyond = (y >= height // side * side) | (x >= width // side * side)
    yield f"pixels left out that lie beyond the last whole {tile}", 1.0 - beyond
    for axis, name in ((y, "row"), (x, "column")):
        yield f"the first {name} of each {tile} taken twice", 1.0 + ((axis % side == 0) & (axis > 0))
        yield f"the last {name} of each {tile} left out", 1.0 - (axis % side == side - 1)
        yield f"the first {name} of each {tile} left out", 1.0 - (axis % side == 0)
    yield f"the first row and column of each {tile} taken twice", (
        1.0 + ((y % side == 0) & (y > 0))) * (1.0 + ((x % side == 0) & (x > 0)))  # fmt: skip
    yield from _along(f"tiles of {side}x{side}", y // side * -(-width // side) + x // side)
    thread = y % side * side + x % side
    for k in (16, 32, 64, 128):
        if k < side * side:
            yield f"all but the first {k} threads of each {tile} left out", 1.0 * (thread < k)
            yield f"threads from {side * side - k} on of each {tile} left out", 1.0 * (thread < side * side - k)
    for period in (2, 16, 32):
        yield f"the last of each {period} threads of a {tile} left out", 1.0 - (thread % period == period - 1)
        yield f"all but the first of each {period} threads of a {tile} left out", 1.0 * (thread % period == 0)
    yield f"the second half of each warp of 32 threads of a {tile} left out", 1.0 * (thread % 32 < 16)
    yield f"all but the first warp of 32 threads of each {tile} left out", 1.0 * (thread < 32)


def _along(noun: str, index: Array) -> Iterator[tuple[str, Array]]:
    """Patterns of weights of terms that are counted."""
    size = int(index.max()) + 1
    yield f"the last of the {noun} left out", 1.0 * (index < size - 1)
    yield f"the first of the {noun} left out", 1.0 * (index > 0)
    for block in BLOCKS:
        if size % block:
            yield f"the last partial block of {block} of the {noun} left out", 1.0 * (index < size // block * block)
    yield f"the last of the {noun} taken twice", 1.0 + (index == size - 1)
    yield f"the first of the {noun} taken twice", 1.0 + (index == 0)
    for period in PERIODS:
        if size > period:
            every = {2: "second", 3: "third"}.get(period, f"{period}th")
            for rest in sorted({0, 1, period - 1}):
                yield f"every {every} of the {noun} left out", 1.0 - (index % period == rest)
                yield f"only every {every} of the {noun} taken", 1.0 * (index % period == rest)
            if period >= 8:
                yield f"the second half of each {period} of the {noun} left out", 1.0 * (index % period < period // 2)


def _prefixes(terms: Terms, flat: Part) -> Iterator[str]:
    """The terms up to some place only, or from some place on only; of those that fit the round ones first."""
    table, count = terms.terms, len(terms.terms)
    for noun, groups in _groups(terms):
        order = np.argsort(groups, kind="stable")
        ends = np.flatnonzero(np.diff(groups[order])) + 1
        if len(flat.right) == 1:  # one number agrees with one of many by chance
            ends = np.array([end for end in ends if groups[order[end]] % MIN_BLOCK == 0], np.int64)
        reach = np.cumsum(table[order], axis=0)[ends - 1] if len(ends) else np.zeros((0, table.shape[1]))
        fits = [k for k, total in enumerate(reach) if flat.agrees(terms.finish(terms.base + total))]
        numbers = sorted((int(groups[order[ends[k]]]) for k in fits), key=_roundness)
        for k in numbers[:MAX_TOLD]:
            if 1 < k < groups.max():
                yield f"{noun} from {k} on left out{size_hint(k)}"
        skipped = table.sum(axis=0) - reach
        fits = [k for k, total in enumerate(skipped) if flat.agrees(terms.finish(terms.base + total))]
        for k in sorted((int(groups[order[ends[k]]]) for k in fits), key=_roundness)[:2]:
            if 1 < k < count:
                yield f"the first {k} {noun} left out"


def _roundness(k: int) -> tuple[bool, bool, int]:
    return k & (k - 1) != 0, k % MIN_BLOCK != 0, k


def _groups(terms: Terms) -> Iterator[tuple[str, Array]]:
    if terms.size is None:
        yield terms.noun, np.arange(len(terms.terms))
        return
    y, x = (index.ravel() for index in np.indices(terms.size))
    yield "rows of pixels", y
    yield "columns of pixels", x
    if len(flat_index := y * terms.size[1] + x) <= 1 << 13:
        yield "pixels, row after row,", flat_index


def _stored(terms: Terms, flat: Part) -> Iterator[str]:
    """The last term of each element alone, or the largest: a store, or a maximum, in place of a sum."""
    yield from _one_of(terms, flat, terms.noun, terms.terms)
    if terms.size is not None:
        y, x = (index.ravel() for index in np.indices(terms.size))
        for side in TILES:
            across = -(-terms.size[1] // side)
            by_tile = np.zeros((-(-terms.size[0] // side) * across, terms.terms.shape[1]))
            np.add.at(by_tile, y // side * across + x // side, terms.terms)
            if len(by_tile) > 1:
                yield from _one_of(terms, flat, f"tiles of {side}x{side}", by_tile)


def _one_of(terms: Terms, flat: Part, noun: str, table: Array) -> Iterator[str]:
    """One term of each element in place of all."""
    there = table != 0
    last = len(table) - 1 - there[::-1].argmax(axis=0)
    last_value = np.where(there.any(axis=0), table[last, np.arange(table.shape[1])], 0.0)
    first_value = np.where(there.any(axis=0), table[there.argmax(axis=0), np.arange(table.shape[1])], 0.0)
    for sentence, value in (
        (f"the last of the {noun} alone, wherever there are several: a store in place of an addition", last_value),
        (f"the first of the {noun} alone, wherever there are several", first_value),
        (f"the largest of the {noun} in place of their sum", np.maximum(table.max(axis=0), 0.0)),
    ):
        if flat.agrees(terms.finish(terms.base + value)):
            yield sentence


def _solved(terms: Terms, flat: Part) -> Iterator[str]:
    """Single terms that were left out or taken several times, by least squares."""
    count, table = len(terms.terms), terms.terms
    if not 1 < count <= MAX_SOLVED or 2 * count > len(flat.right) or terms.size is not None:
        return
    if not np.isfinite(flat.mine).all() or not table.any():
        return
    usable = np.ones(len(flat.right), np.bool_)
    target = flat.mine - terms.base
    if flat.name == "frame":
        peak = float(terms.finish(np.ones(1))[0])
        usable = (flat.mine > 0) & (flat.mine < peak) & (flat.right > 0) & (flat.right < peak)
        target = flat.mine / peak
    if usable.sum() < 2 * count:
        return
    weights = np.linalg.lstsq(table[:, usable].T, target[usable], rcond=None)[0]
    seen = abs(table).max(axis=1) > 0
    whole = np.where(seen, np.rint(weights), 1.0)
    if (abs(weights - whole)[seen] > INTEGER).any() or (whole == 1).all() or (whole < 0).any():
        return
    if flat.agrees(terms.finish(terms.base + whole @ table)):
        yield "; ".join(names_of(terms.noun, whole))
