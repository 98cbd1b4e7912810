"""The learning of RVQ codebooks: k-means, then moving averages, with dead codewords replaced.

The paper asks for a commitment loss (`gsvc_ref.paper.rvq.commitment`) and leaves the codebooks' own rule open.
Ours, per stage and training step, for the vectors r that reach the stage and their codewords i::

    n_b <- a n_b + (1 - a) * sum of w over i = b          S_b <- a S_b + (1 - a) * sum of w r over i = b    (10-22)
    C[b] = S_b / ((n_b + e) / (n + B e) * n)              n = sum of n_b                                    (10-23)

with decay a and Laplace smoothing e. The weights w have the mean 1, so that n_b counts splats.
"""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from gsvc_base.arrays import F4, F8
from gsvc_base.checks import check_types
from gsvc_base.errors import UsageError
from gsvc_ref._jit import kernel
from gsvc_ref.paper.codebook_update import totals, updated
from gsvc_ref.paper.half import LARGEST_HALF, from_half, to_half
from gsvc_ref.paper.rvq import MAX_CODEWORDS, Indices, flat, joined, residuals, rvq_assign


@dataclass(frozen=True)
class RvqSettings:
    """Numbers of codewords, and how they are learned."""

    codewords: tuple[int, ...] = (8, 8)  # B of each of the M stages; two stages of 8 are the authors'
    decay: float = 0.8  # a, in [0, 1)
    smoothing: float = 1e-5  # e, at least 0
    dead_count: float = 0.5
    """A codeword whose moving count n_b falls below this many splats is replaced by a residual of its stage, drawn with
    a probability proportional to its weighted squared error; 0 never replaces."""
    kmeans_iterations: int = 5  # Lloyd's, at the start
    zero_codeword: bool = False  # codeword 0 of every stage stays (0, 0, 0): no difference costs no error

    def __post_init__(self) -> None:
        check_types(self)
        if not self.codewords or not all(1 <= count <= MAX_CODEWORDS for count in self.codewords):
            raise UsageError(f"codewords is {self.codewords}; give 1..{MAX_CODEWORDS} for each of at least one stage")
        if not 0 <= self.decay < 1:
            raise UsageError(f"decay is {self.decay}; it must be in [0, 1)")
        if not (self.smoothing >= 0 and self.dead_count >= 0 and self.kmeans_iterations >= 0):
            raise UsageError("smoothing, dead_count and kmeans_iterations must be at least 0")


@dataclass(frozen=True, eq=False)
class RvqState:
    """Codebooks in training: one entry per stage in each tuple."""

    codebooks: tuple[F4, ...]  # (B, 3), always values of binary16, as in a stream
    counts: tuple[F8, ...]  # (B,) the moving counts n_b in splats
    sums: tuple[F8, ...]  # (B, 3) the moving sums S_b


def initialize(x: ArrayLike, settings: RvqSettings, rng: Generator, weights: ArrayLike | None = None) -> RvqState:
    """Codebooks of x (N, 3) by k-means (k-means++ seeds, then Lloyd), each stage on the residuals of the one before.

    N may be 0, and codewords beyond the number of distinct vectors repeat the first one. The weights (N,) say how much
    each splat counts (its covered area, say): at least 0 and not all 0. Counts and sums are those of the last
    assignment.
    """
    residual = np.ascontiguousarray(x, np.float32)
    _check_differences(residual)
    w = _unit_mean(weights, len(residual))
    stages = []
    for codewords in settings.codewords:
        codebook = _kmeans(residual, w, codewords, settings, rng)
        indices = rvq_assign(residual, [codewords], codebook)
        counts, sums = totals(residual, w, indices, *joined([codebook]))
        residual = residuals(residual, indices, [codewords], codebook)[1]
        stages.append((codebook, counts, sums))
    return RvqState(*(tuple(part) for part in zip(*stages, strict=True)))


def update(
    state: RvqState,
    x: ArrayLike,
    indices: Indices,
    settings: RvqSettings,
    rng: Generator,
    weights: ArrayLike | None = None,
) -> RvqState:
    """One step of the moving averages (R-10.6-3), all stages from the residuals that the present codebooks leave.

    The indices (N, M) u2 are those of `rvq_assign` for x (N, 3) among `state.codebooks`. `rng` is used only where
    codewords are dead. Without splats the result is `state` itself.
    """
    vectors = np.ascontiguousarray(x, np.float32)
    residuals(vectors, indices, *flat(state.codebooks))  # refuses what does not fit
    if len(vectors) == 0:
        return state
    return moved(state, vectors, indices, settings, rng, _unit_mean(weights, len(vectors)))


def moved(state: RvqState, x: F4, indices: Indices, settings: RvqSettings, rng: Generator, w: F8) -> RvqState:
    """`update` without checks; w is (N,) f8, 0 for vectors that are to be left out and of mean 1 over the others."""
    sizes, books = flat(state.codebooks)
    new = updated(
        x, indices, sizes, books, np.concatenate(state.counts), np.concatenate(state.sums), rng.random, settings.decay,
        settings.smoothing, settings.dead_count, w, settings.zero_codeword,
    )  # fmt: skip
    ends = np.cumsum(sizes)
    return RvqState(
        codebooks=tuple(np.split(new.codebooks, ends[:-1])),
        counts=tuple(np.split(new.counts, ends[:-1])),
        sums=tuple(np.split(new.sums, ends[:-1])),
    )


def _kmeans(x: F4, w: F8, codewords: int, settings: RvqSettings, rng: Generator) -> F4:
    centers = np.zeros((codewords, 3), np.float32)
    if len(x) == 0:
        return centers
    _seed(x, w, rng.random(codewords), settings.zero_codeword, centers)
    for _ in range(settings.kmeans_iterations):
        counts, sums = totals(x, w, rvq_assign(x, [codewords], centers), *joined([centers]))
        moved = counts > 0
        moved[0] &= not settings.zero_codeword
        centers[moved] = (sums[moved] / counts[moved, None]).astype(np.float32)
    return from_half(to_half(np.clip(centers, -LARGEST_HALF, LARGEST_HALF)))  # a difference may be twice as large


@kernel()
def _seed(x: F4, w: F8, uniforms: F8, zero_first: bool, centers: F4) -> None:
    """k-means++: each center is a vector drawn in proportion to w times its squared distance from those before."""
    nearest = w.copy()  # (N,) f8: the first draw is in proportion to w alone
    for b in range(centers.shape[0]):
        if b > 0 or not zero_first:
            drawn = _draw(nearest, uniforms[b])
            # Once every vector is a center, nothing is left to draw: the rest repeats the first.
            for c in range(3):
                centers[b, c] = x[drawn, c] if drawn >= 0 else centers[0, c]
        for n in range(x.shape[0]):
            e0 = np.float64(x[n, 0]) - np.float64(centers[b, 0])
            e1 = np.float64(x[n, 1]) - np.float64(centers[b, 1])
            e2 = np.float64(x[n, 2]) - np.float64(centers[b, 2])
            distance = w[n] * (e0 * e0 + e1 * e1 + e2 * e2)
            if b == 0 or distance < nearest[n]:
                nearest[n] = distance


@kernel()
def _draw(masses: F8, uniform: float) -> int:
    """The place at which the running sum of masses passes uniform times their total; -1 where all are zero."""
    total = 0.0
    for n in range(masses.shape[0]):
        total += masses[n]
    reached, last = 0.0, -1
    for n in range(masses.shape[0]):
        if masses[n] > 0:
            last = n
            reached += masses[n]
            if reached > uniform * total:
                break
    return last


def _check_differences(x: F4) -> None:
    """Refuse what is not the difference of two colours that codewords can hold."""
    wrong = x[~(np.abs(x) <= 2 * LARGEST_HALF)]  # NaN is among them
    if len(wrong):
        value = "NaN" if np.isnan(wrong[0]) else wrong[0]
        raise UsageError(f"a vector has the component {value}; the largest magnitude is 2 * {LARGEST_HALF:.0f}")


def _unit_mean(weights: ArrayLike | None, count: int) -> F8:
    if weights is None:
        return np.ones(count)
    w = np.asarray(weights, np.float64)
    if w.shape != (count,):
        raise UsageError(f"weights have shape {w.shape}; they must be ({count},)")
    if not (np.isfinite(w).all() and (w >= 0).all() and (count == 0 or w.any())):
        raise UsageError("weights must be finite, at least 0 and not all 0")
    return w / w.mean() if count else w
