"""One step of RVQ codebooks in training: moving averages of the vectors that use them, and new codewords for dead ones.

`rvq_training` has the codebooks of a frame, and where they start. Here the codewords of all stages are one array
(K, 3), stage after stage.
"""

from collections.abc import Callable
from itertools import islice
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import F4, F8
from gsvc_base.checks import door
from gsvc_base.errors import UsageError
from gsvc_ref._jit import kernel
from gsvc_ref.paper.half import from_half, to_half
from gsvc_ref.paper.rvq import Indices, residuals

Draw = Callable[[int], F8]
"""A function that draws a number of uniform numbers in [0, 1)."""

REVIVED_COUNT: Final = 1.0
"""Moving count of a codeword that replaces a dead one: as if one splat had always used it."""


class RvqUpdate(NamedTuple):
    """The codebooks of all stages after an update, one after the other; K is the number of all codewords."""

    counts: F8
    """(K,), the moving counts n_b."""
    sums: F8
    """(K, 3), the moving sums S_b."""
    codebooks: F4
    """(K, 3), values of binary16."""


# twin of spec.rvq_update
@door
def rvq_update(
    x: ArrayLike,
    indices: Indices,
    codebook_sizes: ArrayLike,
    codebooks: F4,
    counts: F8,
    sums: F8,
    uniforms: F8,
    decay: float,
    smoothing: float,
    dead_count: float,
) -> RvqUpdate:
    """One step of the moving averages, and new codewords for dead ones: (10-22) to (10-24), R-10.6-3, R-10.6-4.

    Parameters
    ----------
    x
        (N, 3) f4.
    indices
        (N, M) u2, `rvq_assign`'s choice among the codebooks.
    codebook_sizes
        (M,) i8, the number of codewords of each stage.
    codebooks, counts, sums
        (K, 3) f4, (K,) f8 and (K, 3) f8, stage after stage; not changed.
    uniforms
        (D,) f8 in [0, 1), of which every dead codeword that is replaced takes the next.
    decay, smoothing, dead_count
        As in `RvqSettings`.

    Returns
    -------
    RvqUpdate
        The given arrays themselves where there are no vectors.

    Raises
    ------
    UsageError
        A vector is not finite, indices do not fit, or there are too few uniform numbers.
    """
    vectors, sizes = np.ascontiguousarray(x, np.float32), np.asarray(codebook_sizes, np.int64)
    residuals(vectors, indices, sizes, codebooks)  # refuses what does not fit
    if len(vectors) == 0:
        return RvqUpdate(counts, sums, codebooks)
    w = np.ones(len(vectors))
    return updated(
        vectors, indices, sizes, codebooks, counts, sums, _in_turn(uniforms), decay, smoothing, dead_count, w, False
    )


def _in_turn(uniforms: F8) -> Draw:
    """Draws given numbers, each once."""
    numbers = iter(uniforms.tolist())

    def draw(count: int) -> F8:
        drawn = np.array(list(islice(numbers, count)))
        if len(drawn) < count:
            raise UsageError(f"there are {len(uniforms)} uniform numbers; give one for each dead codeword")
        return drawn

    return draw


def updated(
    x: F4,
    indices: Indices,
    sizes: NDArray[np.int64],
    codebooks: F4,
    counts: F8,
    sums: F8,
    draw: Draw,
    decay: float,
    smoothing: float,
    dead_count: float,
    w: F8,
    zero_codeword: bool,
) -> RvqUpdate:
    """(10-22) to (10-24) with weights; `sizes` (M,) are those of the stages, `draw` gives uniform numbers."""
    ends = np.cumsum(sizes)
    starts = ends - sizes
    batch_counts, batch_sums = totals(x, w, indices, codebooks, ends)
    counts = decay * counts + (1 - decay) * batch_counts  # (K,) f8
    sums = decay * sums + (1 - decay) * batch_sums  # (10-22), (K, 3) f8
    total = np.repeat(np.add.reduceat(counts, starts), sizes)  # n of each stage, beside each of its codewords
    # Laplace smoothing: no count is 0 for a stage that is used
    smoothed = (counts + smoothing) / (total + np.repeat(sizes, sizes) * smoothing) * total
    codebook = np.where(
        smoothed[:, None] > 0, sums / np.where(smoothed > 0, smoothed, 1)[:, None], codebooks
    )  # (10-23)
    dead = counts < dead_count  # R-10.6-4
    if zero_codeword:
        dead[starts] = False  # it stands for "no difference"
    if dead.any():
        r = residuals(x, indices, sizes, codebooks)  # (M + 1, N, 3) f4
        for k, stage in enumerate(slice(first, end) for first, end in zip(starts.tolist(), ends.tolist(), strict=True)):
            if dead[stage].any():
                errors = w * np.square(r[k + 1], dtype=np.float64).sum(axis=1)
                _revive(dead[stage], codebook[stage], counts[stage], sums[stage], r[k], errors, draw)
    if zero_codeword:
        codebook[starts] = sums[starts] = 0
    return RvqUpdate(counts, sums, from_half(to_half(codebook)))


def _revive(dead: NDArray[np.bool_], codebook: F8, counts: F8, sums: F8, residual: F4, errors: F8, draw: Draw) -> None:
    """Put residuals, drawn in proportion to their errors (N,), in the place of dead codewords."""
    reach = errors.cumsum()
    if reach[-1] == 0:  # every vector is met exactly: nothing to gain
        return
    drawn = np.searchsorted(reach, draw(int(np.count_nonzero(dead))) * reach[-1], side="right")
    drawn = np.minimum(drawn, len(errors) - 1)  # a product that rounds up to the total would pass the last
    codebook[dead] = residual[drawn]
    counts[dead] = REVIVED_COUNT
    sums[dead] = REVIVED_COUNT * codebook[dead]  # (10-24)


@kernel()
def totals(x: F4, w: F8, indices: Indices, books: F4, ends: NDArray[np.int64]) -> tuple[F8, F8]:
    """Weighted counts (K,) and sums (K, 3), in binary64, of the vectors that reach each codeword of each stage."""
    counts, sums = np.zeros(books.shape[0]), np.zeros((books.shape[0], 3))
    r = np.empty(3, np.float32)
    for n in range(x.shape[0]):
        for c in range(3):
            r[c] = x[n, c]
        first = 0
        for k in range(ends.size):
            place = first + np.int64(indices[n, k])
            counts[place] += w[n]
            for c in range(3):
                sums[place, c] += w[n] * np.float64(r[c])
                r[c] -= books[place, c]  # what the next stage gets, in binary32 as (10-20)
            first = ends[k]
    return counts, sums
