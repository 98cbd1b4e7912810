"""Splats to codes in stages, each of which makes good for what the one before has rounded (preset `quick`).

Quantisation-aware fine-tuning (`fine_tuning`) evaluates the picture for every step that it takes. Here most of the work
is done on splats alone:

1. what is to stay as it is takes the bits of the reference, and the others make good for it by a few steps of L-BFGS;
2. positions are rounded, and Cholesky factors and colours go on for a few steps; then the factors are rounded;
3. one evaluation gives what the picture lacks under each splat, and conjugate gradients in the Gram matrix (`gram`)
   the colours that bring the most of it;
4. codebooks are learned for these colours, and each splat in turn takes the codeword that is best given what the
   choices of its neighbours left: `round_with_feedback`.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8, I8
from gsvc_ref._jit import kernel
from gsvc_ref.paper import FrameCodes, State, reconstruct, rvq
from gsvc_ref.rendering import Objective
from gsvc_ref.training.frame_quantizer import FrameQuantizer
from gsvc_ref.training.gram import Gram, gram, solved_colors, squared_change
from gsvc_ref.training.loop import OnIteration
from gsvc_ref.training.settings import RoundingSettings
from gsvc_ref.training.walk import Free, FreeSplats, Walk

SOLVER_STEPS: Final = 8
"""Steps of conjugate gradients."""

MOST_COLOR_CHANGE: Final = 0.2
"""Largest change of a colour, of 1, in one solution: a linear model holds where pixels are not clamped."""


def round_in_stages(
    values: F4,
    quantizer: FrameQuantizer,
    objective: Objective,
    settings: RoundingSettings,
    on_iteration: OnIteration | None = None,
) -> tuple[FrameCodes, State, int]:
    """The codes of fitted splats.

    Parameters
    ----------
    values
        (n, 8) f4, the fitted parameters in the order of the quantiser's population.
    quantizer
        Its learned quantisers are learned anew.
    objective
        The frame's picture.
    settings
        How many evaluations it takes.
    on_iteration
        Called after each evaluation.

    Returns
    -------
    codes
        The codes.
    state
        The decoder's state after them.
    iterations
        The number of evaluations made.
    """
    work = _Refits(objective, settings, on_iteration)
    free = quantizer.active
    x = quantizer.snapped(values)
    if not free.any():
        codes = quantizer.codes(x)
        return codes, reconstruct(codes, quantizer.before), 0
    if (still := ~free.any(axis=1)).any():
        objective.freeze(x, still)
    x = work.refitted(x, free, settings.first)
    x = quantizer.rounded_positions(x)
    x = work.refitted(x, free & np.array([False, True, True]), settings.iterations - settings.first)
    x = quantizer.rounded_cholesky(x)
    colored = np.flatnonzero(free[:, 2])
    matrix = gram(x[colored])
    x[colored, 5:8] += work.color_changes(x, matrix, colored)
    codes = quantizer.codes(x, chosen_codewords(x, quantizer, matrix))
    objective.thaw()
    return codes, reconstruct(codes, quantizer.before), work.done


class _Refits:
    """The evaluations of one frame's rounding."""

    def __init__(self, objective: Objective, settings: RoundingSettings, on_iteration: OnIteration | None) -> None:
        self._objective, self._on_iteration = objective, on_iteration
        self._pixels = objective.width * objective.height
        self._all = settings.iterations + 1
        self.done = 0

    def refitted(self, x: F4, free: Free, steps: int) -> F4:
        """Splats (n, 8) f4 after some steps over what is free, (n, 3) bool: the best of them."""
        if steps < 1 or not free.any():
            return x
        splats = FreeSplats(self._objective, x, free, self._pixels, hold=False)
        z = splats.start()
        walk = Walk(len(z))
        for _ in range(steps):
            loss, error, gradient = splats.evaluate(z)
            self._report(loss)
            z = walk.next(z, error, gradient)
        assert walk.best is not None
        if splats.error(z) > walk.best[0]:
            z = walk.best[1]
        return splats.at(z)

    def color_changes(self, x: F4, matrix: Gram, colored: NDArray[np.int64]) -> F4:
        """The changes (k, 3) f4 of some colours that bring the picture closest; `matrix` is that of their splats."""
        loss, gradient = self._objective.evaluate(x)
        self._report(loss)
        changes = solved_colors(matrix, gradient[colored, 5:8] * (-self._pixels / 2.0), SOLVER_STEPS)
        return np.clip(changes, -MOST_COLOR_CHANGE, MOST_COLOR_CHANGE).astype(np.float32)

    def _report(self, loss: float) -> None:
        self.done += 1
        if self._on_iteration:
            self._on_iteration(self.done, self._all, loss)


def chosen_codewords(x: F4, quantizer: FrameQuantizer, matrix: Gram) -> list[NDArray[np.uint16]]:
    """The codewords (n, M) u2 of each block's splats, given what their colours are to be in x (n, 8) f4.

    `matrix` is that of the splats whose colours may change. Codebooks that the decoder keeps are used, unless others
    leave less of e' K e by more than they are worth; those are made larger as long as they leave too much.
    """
    colored = [(block, rows) for block, rows in quantizer.blocks if block.present[2]]
    for block, rows in colored:
        if block.kept.codebooks is None:
            block.learn_colors(x[rows])
    chosen, left = _rounded_colors(x, quantizer, matrix)
    for block, rows in colored:
        factor = 1 if block.kept.codebooks is not None else 2
        while left > quantizer.worth and factor * block.settings.colors.codewords[0] <= quantizer.most_codewords:
            before = block.kept, block.rvq
            block.learn_colors(x[rows], factor)
            others, less = _rounded_colors(x, quantizer, matrix)
            if less > left - quantizer.worth:
                block.kept, block.rvq = before
                break
            chosen, left, factor = others, less, 2 * factor
    return chosen


def _rounded_colors(x: F4, quantizer: FrameQuantizer, matrix: Gram) -> tuple[list[NDArray[np.uint16]], float]:
    """The codewords of each block's splats by the codebooks of now, and e' K e of what they leave."""
    errors = np.zeros((len(matrix.diagonal), 3))
    every, blocks, first = [], [], 0
    for block, rows in quantizer.blocks:
        count = int(np.count_nonzero(block.active[:, 2]))
        if not block.present[2]:
            every.append(np.zeros((len(block.active), 1), np.uint16))
            continue
        wanted = block.differences(x[rows])[:, 5:8]
        chosen = rvq.rvq_assign(wanted, *rvq.flat(block.codebooks))
        own, wanted = chosen[block.active[:, 2]], wanted[block.active[:, 2]]
        errors[first : first + count] = rvq.dequantize(own, *rvq.flat(block.codebooks)) - wanted
        blocks.append((block, first, wanted, own, chosen))
        every.append(chosen)
        first += count
    for block, first, wanted, own, chosen in blocks:
        round_with_feedback(matrix, wanted, first, *rvq.joined(block.codebooks), own, errors)
        chosen[block.active[:, 2]] = own
    return every, squared_change(matrix, errors)


def round_with_feedback(
    matrix: Gram,
    wanted: F4,
    first: int,
    books: F4,
    ends: I8,
    chosen: NDArray[np.uint16],
    errors: F8,
) -> None:
    """Let each splat in turn take the codeword that is best given the errors e that all others have left.

    With the others held, e' K e is least where e_n = -h_n / K_nn, h_n = the sum over m != n of K_nm e_m; so the splat
    asks for the codeword nearest to `wanted` - h_n / K_nn, stage by stage, and takes it if e' K e falls. The sum over
    all splats never rises above that of the codewords to begin with.

    Parameters
    ----------
    matrix
        K of all N splats.
    wanted
        (n, 3) f4, what the codewords of n splats are to add up to.
    first
        The index of the first of these splats among all.
    books, ends
        The codebooks stage after stage, (K, 3) f4, and where each ends, (M,) i8.
    chosen
        (n, M) u2, codewords to begin with; changed in place.
    errors
        (N, 3) f8, the sum of the codewords less what was wanted, of all splats; changed in place.
    """
    _round(matrix.starts, matrix.columns, matrix.values, matrix.diagonal, wanted, first, books, ends, chosen, errors)


@kernel()
def _round(
    starts: I8, columns: I8, values: F8, diagonal: F8, wanted: F4, first: int, books: F4,
    ends: I8, chosen: NDArray[np.uint16], errors: F8,
) -> None:  # fmt: skip
    """`round_with_feedback`, splat by splat."""
    planes = books.T.copy().astype(np.float64)  # contiguous over codewords
    found = np.empty(ends.size, np.int64)
    cost = np.empty(len(books))
    for n in range(len(wanted)):
        i = first + n
        h0, h1, h2 = 0.0, 0.0, 0.0
        for k in range(starts[i], starts[i + 1]):
            j, value = columns[k], values[k]
            if j != i:
                h0 += value * errors[j, 0]
                h1 += value * errors[j, 1]
                h2 += value * errors[j, 2]
        h0, h1, h2 = h0 / diagonal[i], h1 / diagonal[i], h2 / diagonal[i]
        r0, r1, r2 = wanted[n, 0] - h0, wanted[n, 1] - h1, wanted[n, 2] - h2
        begin = 0
        for stage in range(ends.size):
            red, green, blue = (
                planes[0, begin : ends[stage]], planes[1, begin : ends[stage]], planes[2, begin : ends[stage]]
            )  # fmt: skip
            for b in range(red.size):
                e0, e1, e2 = r0 - red[b], r1 - green[b], r2 - blue[b]
                cost[b] = (e0 * e0 + e1 * e1) + e2 * e2
            best = 0
            for b in range(1, red.size):
                if cost[b] < cost[best]:
                    best = b
            found[stage] = best
            r0, r1, r2 = r0 - red[best], r1 - green[best], r2 - blue[best]
            begin = ends[stage]
        t0, t1, t2 = errors[i, 0] + h0, errors[i, 1] + h1, errors[i, 2] + h2
        if (r0 * r0 + r1 * r1) + r2 * r2 < (t0 * t0 + t1 * t1) + t2 * t2:
            for stage in range(ends.size):
                chosen[n, stage] = found[stage]
            errors[i, 0], errors[i, 1], errors[i, 2] = -r0 - h0, -r1 - h1, -r2 - h2
