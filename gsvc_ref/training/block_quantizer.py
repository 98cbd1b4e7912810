"""The quantisers of one block: values to codes, gradients, and learning.

The forward direction is the decoder's own: codes are reconstructed by `gsvc_ref.paper`, so what fine-tuning
sees is, bit for bit, what a decoder will have.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8
from gsvc_ref.paper import (
    Kept,
    LsqParameters,
    Quantizer,
    SplatBlock,
    coarsen_half,
    lsq,
    lsq_quantize,
    rvq,
    to_half,
)
from gsvc_ref.paper.half import FINEST_HALF, LARGEST_HALF
from gsvc_ref.paper.lsq_parameters import bounded_scale, from_mse, with_exact_zero
from gsvc_ref.paper.rvq_training import RvqState, initialize, moved
from gsvc_ref.training.adan import Adan, AdanSettings
from gsvc_ref.training.picture_change import Active, shape_weights
from gsvc_ref.training.settings import BlockSettings
from gsvc_ref.training.straight_through import (
    decode_cholesky,
    decode_colors,
    decode_positions,
    difference_of,
    grad_decode,
)


class ForwardResult(NamedTuple):
    """Intermediate results of `BlockQuantizer.forward`, for `backward` and `learn`."""

    difference: F4
    """(n, 8) f4, the values or differences that were quantised."""
    indices: NDArray[np.uint16]
    """(n, M) u2, codewords."""
    errors: F4
    """(n, 3) f4, the errors that the stages left, summed over the stages."""


class Learned(NamedTuple):
    """The quantisers of a block at one moment."""

    lsq: LsqParameters
    rvq: RvqState | None


class BlockQuantizer:
    """Quantises one block: values as they are (intra), or their difference from a reference (inter)."""

    def __init__(
        self,
        values: F4,  # (n, 8) f4, from which the quantisers are started
        reference: F4 | None,  # (n, 8) f4, the same splats as decoded before; None: an intra block
        active: Active | None,  # (n, 3) bool, what may differ from the reference; None: all
        size: F4,  # (2,) f4, half the width and height in pixels
        settings: BlockSettings,
        rng: np.random.Generator,  # draws starts of codebooks and replacements of dead codewords
        kept: Kept,  # what the decoder has and is used unchanged
    ) -> None:
        self.reference, self.size, self.settings, self.rng, self.kept = reference, size, settings, rng, kept
        self.active = np.ones((len(values), 3), np.bool_) if active is None else active
        self._no_reference = np.empty((0, 8), np.float32)
        self._largest = np.float32(lsq.largest_code(settings.cholesky_bits))
        # The weight of a colour in learning, (n,): l11 l22 is the splat's area up to a factor.
        self.area = np.sqrt(np.abs(values[:, 2] * values[:, 4])) if settings.weigh_by_area else np.ones(len(values))
        self.present = tuple(reference is None or bool(part.any()) for part in self.active.T)
        difference = self.differences(values)
        self.lsq = self._start_lsq(difference[:, 2:5], shape_weights(values) if settings.weigh_factors else None)
        self.rvq = self._start_rvq(difference[:, 5:8])
        self._books, self._ends = rvq.joined(self.codebooks)
        self._shares = self._shares_of_colors()
        # A row each for scale and offset, in steps of the scale; the decoder's arithmetic stays binary32.
        self._lsq_optimizer = Adan(2, 3, AdanSettings(0.9, 0.92, 0.99))
        self._lsq_gradient = np.zeros((2, 3), np.float32)

    def differences(self, values: F4) -> F4:
        """What is quantised, (n, 8) f4: the values, or their differences where they are active and 0 elsewhere."""
        if self.reference is None:
            return values
        mask = np.repeat(self.active, [2, 3, 3], axis=1)  # (n, 8)
        return np.where(mask, values - self.reference, np.float32(0)).astype(np.float32)

    def _start_lsq(self, cholesky: F4, weights: F8 | None) -> LsqParameters:
        if self.kept.quantizer is not None:
            return LsqParameters(self.kept.quantizer.scale, self.kept.quantizer.offset)
        if (fixed := fixed_steps(self.settings)) is not None:
            return fixed
        return from_mse(cholesky, self.settings.cholesky_bits, weights)

    def _start_rvq(self, colors: F4) -> RvqState | None:
        if self.kept.codebooks is not None:
            return None
        chosen = self.active[:, 2]
        if not chosen.any():  # then no colour is coded, but the codebooks must exist
            chosen = np.ones_like(chosen)
        return initialize(colors[chosen], self.settings.colors, self.rng, self.area[chosen])

    def _shares_of_colors(self) -> NDArray[np.float64]:
        """How much each colour counts in learning, (n,) f8: 0 if it is not active, and 1 on average over the others."""
        area = np.where(self.active[:, 2], self.area, 0)
        total = math.fsum(area)
        return area * (np.count_nonzero(self.active[:, 2]) / total) if total > 0 else area

    @property
    def quantizer(self) -> Quantizer:
        """Scale and offset in use."""
        return Quantizer(self.lsq.scale, self.lsq.offset)

    @property
    def codebooks(self) -> tuple[F4, ...]:
        """The codebooks in use, each (B, 3) f4 of binary16 values."""
        if self.kept.codebooks is not None:
            return tuple(book.astype(np.float32) for book in self.kept.codebooks)
        assert self.rvq is not None
        return self.rvq.codebooks

    def codes(self, values: F4) -> SplatBlock:
        """The codes of values (n, 8) f4, with the quantisers that the decoder does not have yet."""
        difference = self.differences(values)
        position, cholesky, color = self.present
        own_quantizer = cholesky and self.kept.quantizer is None
        own_codebooks = color and self.kept.codebooks is None
        return SplatBlock(
            positions=self._position_bits(difference[:, :2]) if position else None,
            cholesky=lsq_quantize(difference[:, 2:5], self.lsq.scale, self.lsq.offset, self.settings.cholesky_bits)
            if cholesky
            else None,
            colors=rvq.rvq_assign(difference[:, 5:8], *rvq.flat(self.codebooks)) if color else None,
            quantizer=self.quantizer if own_quantizer else None,
            codebooks=tuple(book.astype(np.float16) for book in self.codebooks) if own_codebooks else None,
        )

    def _position_bits(self, positions: F4) -> NDArray[np.uint16]:
        offset = np.float32(1 if self.reference is None else 0)
        normalised = np.clip(positions / self.size - offset, -LARGEST_HALF, LARGEST_HALF)
        return to_half(coarsen_half(normalised, self.step_exponent))

    @property
    def step_exponent(self) -> int:
        """The binary logarithm of the step of normalised positions: at most `position_step` pixels."""
        if self.settings.position_step is None:
            return FINEST_HALF
        return math.frexp(self.settings.position_step / float(self.size.max()))[1] - 1

    def forward(self, values: F4, decoded: F4) -> ForwardResult:
        """Write the splats that a decoder will have of values (n, 8) f4 into `decoded`: bit for bit as by `codes`."""
        count, stages = len(values), len(self._ends)
        difference, errors = np.empty((count, 8), np.float32), np.empty((count, 3), np.float32)
        indices = np.empty((count, stages), np.uint16)
        reference = self._no_reference if self.reference is None else self.reference
        difference_of(values, reference, self.active, difference)
        position, cholesky, color = self.present
        # An absent plane leaves the reference as it is, as `reconstruct` does.
        if not (position and cholesky and color):
            np.copyto(decoded, reference)
        if position:
            decode_positions(difference, reference, self.size, self.step_exponent, decoded)
        if cholesky:
            decode_cholesky(difference, reference, self.lsq.scale, self.lsq.offset, self._largest, decoded)
        if color:
            decode_colors(difference, reference, self._books, self._ends, indices, errors, decoded)
        return ForwardResult(difference, indices, errors)

    def backward(self, result: ForwardResult, grad_decoded: F4) -> F4:
        """The straight-through gradient by the values, given that by the decoded splats, both (n, 8) f4.

        Positions pass unchanged; Cholesky factors where LSQ+ did not clamp; colours get the commitment gradient added.
        The gradients of scale and offset are kept for `learn`.
        """
        grad_values, sums = np.empty_like(grad_decoded), np.empty((2, 3))
        grad_decode(
            result.difference, result.errors, self.active, self.lsq.scale, self.lsq.offset, self._largest,
            np.float32(2 / max(3 * len(grad_decoded), 1)), np.float32(self.settings.commitment), grad_decoded,
            grad_values, sums,
        )  # fmt: skip
        # The learned variables are log(scale) and offset / scale: both gradients in units of the scale.
        self._lsq_gradient = sums.astype(np.float32) * self.lsq.scale
        return grad_values

    def color_error(self, values: F4) -> float:
        """The squared error of the quantised colours, weighted as in training."""
        colors = self.differences(values)[:, 5:8]
        books = rvq.flat(self.codebooks)
        error = rvq.dequantize(rvq.rvq_assign(colors, *books), *books) - colors
        return float((self.area * np.square(error).sum(axis=1))[self.active[:, 2]].sum())

    def learn(self, result: ForwardResult, factor: float) -> None:
        """One step of scale, offset and codebooks, unless they are the decoder's already or fixed."""
        if self.kept.quantizer is None and self.settings.cholesky_step is None:
            steps = np.zeros((2, 3), np.float32)
            rate = np.full(3, self.settings.quantizer_rate * factor, np.float32)
            # From zero the step is the increment itself, of log(scale) and of offset / scale.
            self._lsq_optimizer.step(steps, self._lsq_gradient, rate)
            # exp to second order: steps are of the size of the rate, and a library's exp may differ from another's.
            growth = 1 + steps[0] + steps[0] * steps[0] / 2
            self.lsq = LsqParameters(
                bounded_scale(self.lsq.scale * growth), self.lsq.offset + steps[1] * self.lsq.scale
            )
        if self.rvq is not None and self.present[2]:
            colors = result.difference[:, 5:8]
            self.rvq = moved(self.rvq, colors, result.indices, self.settings.colors, self.rng, self._shares)
            self._books, self._ends = rvq.joined(self.codebooks)

    @property
    def static(self) -> NDArray[np.bool_]:
        """The splats that keep the bits of the reference whatever is learned, (n,) bool."""
        zero_stays_zero = self.reference is not None and (
            (self.settings.cholesky_step is not None or not self.present[1])
            and (self.settings.colors.zero_codeword or not self.present[2])
        )
        return np.asarray(~self.active.any(axis=1) & zero_stays_zero)

    @property
    def learned(self) -> Learned:
        """The quantisers as `learn` has left them."""
        return Learned(self.lsq, self.rvq)

    @learned.setter
    def learned(self, learned: Learned) -> None:
        self.lsq, self.rvq = learned
        self._books, self._ends = rvq.joined(self.codebooks)


def fixed_steps(settings: BlockSettings) -> LsqParameters | None:
    """The quantiser of factors around an exact zero, if its step is fixed."""
    if settings.cholesky_step is None:
        return None
    scale = np.full(3, settings.cholesky_step, np.float32)
    middle = 1 << (settings.cholesky_bits - 1)
    return with_exact_zero(LsqParameters(scale, -middle * scale), settings.cholesky_bits)
