"""Splats to codes in stages, each of which makes good for what the one before has rounded (preset `quick`).

Quantisation-aware fine-tuning (`fine_tuning`) evaluates the picture for every step that it takes. Here most of the work
is done on splats alone:

1. what is to stay as it is takes the bits of the reference, and the others make good for it by a few steps of L-BFGS;
2. positions are rounded, and Cholesky factors and colours go on for a few steps; then the factors are rounded;
3. one evaluation gives what the picture lacks under each splat, and conjugate gradients in the Gram matrix (`gram`)
   the colours that bring the most of it;
4. codebooks are learned for these colours, and each splat in turn takes the codeword that is best given what the
   choices of its neighbours left: `rounded_with_feedback`.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_ref._jit import kernel
from gsvc_ref.arrays import F4, F8, I8
from gsvc_ref.quantization import rvq
from gsvc_ref.reconstruction import FrameCodes, State, reconstruct
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

WORTH_CODEBOOKS: Final = 0.05
"""Codebooks are sent anew where they take more than this part of the squared error, 0.2 dB."""


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
    matrix = gram(x)
    loss, changes = work.color_changes(x, matrix, free[:, 2])
    x[:, 5:8] += changes
    most = WORTH_CODEBOOKS * loss * objective.width * objective.height
    codes = quantizer.codes(x, chosen_codewords(x, quantizer, matrix, most))
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

    def color_changes(self, x: F4, matrix: Gram, free: NDArray[np.bool_]) -> tuple[float, F4]:
        """The loss, and the changes (n, 3) f4 of the free colours that bring the picture closest."""
        loss, gradient = self._objective.evaluate(x)
        self._report(loss)
        changes = solved_colors(matrix, gradient[:, 5:8] * (-self._pixels / 2.0), free, SOLVER_STEPS)
        return loss, np.clip(changes, -MOST_COLOR_CHANGE, MOST_COLOR_CHANGE).astype(np.float32)

    def _report(self, loss: float) -> None:
        self.done += 1
        if self._on_iteration:
            self._on_iteration(self.done, self._all, loss)


def chosen_codewords(x: F4, quantizer: FrameQuantizer, matrix: Gram, most: float) -> list[NDArray[np.uint16]]:
    """The codewords (n, M) u2 of each block's splats, given what their colours are to be in x (n, 8) f4.

    The codebooks that a decoder has are used where what they leave, e' K e, is at most `most` above what others leave.
    """
    for block, rows in quantizer.blocks:
        block.learn_colors(x[rows])
    chosen, left = _rounded_colors(x, quantizer, matrix)
    for i in (i for i in range(len(chosen)) if quantizer.blocks[i][0].kept.codebooks is not None):
        if left <= most:
            break
        block, rows = quantizer.blocks[i]
        kept = block.kept, block.learned
        block.forget_codebooks(x[rows])
        others, less = _rounded_colors(x, quantizer, matrix)
        if less < left - most:
            chosen, left = others, less
        else:
            block.kept, block.learned = kept
    return chosen


def _rounded_colors(x: F4, quantizer: FrameQuantizer, matrix: Gram) -> tuple[list[NDArray[np.uint16]], float]:
    """The codewords of each block's splats by the codebooks of now, and e' K e of what they leave."""
    errors = np.zeros((len(x), 3))
    blocks = []
    for block, rows in quantizer.blocks:
        wanted = block.differences(x[rows])[:, 5:8]
        chosen = rvq.rvq_assign(wanted, *rvq.flat(block.codebooks))
        left = rvq.dequantize(chosen, *rvq.flat(block.codebooks)) - wanted
        errors[rows] = np.where(block.active[:, 2:], left, 0)
        blocks.append((block, rows.indices(len(x))[0], wanted, chosen))
    for block, first, wanted, chosen in blocks:
        round_with_feedback(matrix, wanted, block.active[:, 2], first, *rvq.joined(block.codebooks), chosen, errors)
    return [chosen for _, _, _, chosen in blocks], squared_change(matrix, errors)


def round_with_feedback(
    matrix: Gram,
    wanted: F4,
    free: NDArray[np.bool_],
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
    free
        (n,) bool: the colours that may change; the others keep the codeword that they have.
    first
        The index of the first of these splats among all.
    books, ends
        The codebooks stage after stage, (K, 3) f4, and where each ends, (M,) i8.
    chosen
        (n, M) u2, codewords to begin with; changed in place.
    errors
        (N, 3) f8, the sum of the codewords less what was wanted, of all splats; changed in place.
    """
    _round(
        matrix.starts, matrix.columns, matrix.values, matrix.diagonal, wanted, free, first, books, ends, chosen, errors
    )


@kernel()
def _round(
    starts: I8, columns: I8, values: F8, diagonal: F8, wanted: F4, free: NDArray[np.bool_], first: int, books: F4,
    ends: I8, chosen: NDArray[np.uint16], errors: F8,
) -> None:  # fmt: skip
    """`round_with_feedback`, splat by splat."""
    planes = books.T.copy().astype(np.float64)  # contiguous over codewords
    found = np.empty(ends.size, np.int64)
    cost = np.empty(len(books))
    for n in range(len(wanted)):
        if not free[n]:
            continue
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
