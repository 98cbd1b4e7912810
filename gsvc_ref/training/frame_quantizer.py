"""The quantisers of a frame: what is coded as a difference, and which quantisers of the decoder are used again."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.splats import F4
from gsvc_ref.paper import FrameCodes, Kept, State, reconstruct
from gsvc_ref.rendering import Objective
from gsvc_ref.training.block_quantizer import BlockQuantizer, ForwardResult, Learned
from gsvc_ref.training.picture_change import Active, picture_change
from gsvc_ref.training.population import NEW, Population
from gsvc_ref.training.psnr import psnr_of_loss
from gsvc_ref.training.settings import BlockSettings

REUSE_ERROR: Final = 2.5
"""The decoder's codebooks are used again if they raise the squared error of the differences by at most this factor."""

REUSE_LOSS: Final = 1.25
"""The decoder's quantisers are used again for new splats if they raise the loss by at most this factor (1 dB)."""

BITS_OF_ATTRIBUTES: Final = np.array([1.0, 1.0, 0.5], np.float32)
"""What a change of position, Cholesky factor and colour must be worth, in proportion to their bits. On 16
frames of `carphone` and 10 of `bikes` 1/2 in place of 1 for colours gave 0.2 dB for 1 % of the bytes."""

STEPS_PSNR: Final = 35.0
"""PSNR in dB for which the fixed steps of `BlockSettings` are meant."""

DB_PER_ERROR_DOUBLING: Final = 6.020599913279624
"""PSNR in dB that twice the error costs, 20 log10(2)."""

MAX_DOUBLINGS: Final = 2
"""Maximum number of times that fixed steps are doubled or halved."""


class FrameQuantizer:
    """The quantisers of a frame: one for the survivors' differences, one for the values of all other splats."""

    def __init__(
        self,
        population: Population,  # survivors first, in the order of the reference, then new splats
        objective: Objective,
        intra: BlockSettings,  # for values
        inter: BlockSettings,  # for differences
        before: State,  # `State.forget` for an I-frame
        rng: np.random.Generator,  # draws the starts of codebooks
        accepted: float = 0.0,  # a loss: with less, differences are coded no finer than for this one
    ) -> None:
        values = population.parameters()
        origins = population.origins[population.origins != NEW]
        self.before, self.survivors = before, len(origins)
        self.map = np.zeros(len(before.splats), np.bool_)
        self.map[origins] = True
        size = np.array([before.width / 2, before.height / 2], np.float32)
        self.inter: BlockQuantizer | None = None
        self.intra: BlockQuantizer | None = None
        total = max(objective.loss(values), accepted) * before.width * before.height
        if self.survivors:
            old, reference = values[: self.survivors], before.splats.to_array()[origins]
            # A change must make as much squared error as a splat's mean share of it, times the threshold.
            active = changed(old, reference, total / len(values) * inter.static_threshold)
            block = with_steps_for(total / (before.width * before.height), inter)
            self.inter = inter_quantizer(old, reference, active, size, block, before.inter, rng)
        if self.survivors < len(values):
            self.intra = intra_quantizer(values, self.survivors, objective, size, intra, before, rng)
        rows = (slice(0, self.survivors), slice(self.survivors, None))
        self.blocks = [
            (block, part) for block, part in zip((self.inter, self.intra), rows, strict=True) if block is not None
        ]

    def codes(self, values: F4) -> FrameCodes:
        """The codes of values (n, 8) f4."""
        parts = {id(block): block.codes(values[rows]) for block, rows in self.blocks}
        inter, intra = (parts.get(id(block)) for block in (self.inter, self.intra))
        if len(self.map) == 0:
            return FrameCodes.intra_frame(intra)
        return FrameCodes.predicted_frame(self.map, inter, intra)

    def forward(self, values: F4) -> tuple[F4, list[ForwardResult]]:
        """The splats that a decoder will have of values (n, 8) f4, bit for bit as by `codes` and `reconstruct`."""
        decoded = np.empty_like(values)
        return decoded, [block.forward(values[rows], decoded[rows]) for block, rows in self.blocks]

    def backward(self, results: list[ForwardResult], grad_decoded: F4) -> F4:
        """The gradient by the values given that by the decoded splats, both (n, 8) f4."""
        parts = [
            block.backward(result, grad_decoded[rows])
            for (block, rows), result in zip(self.blocks, results, strict=True)
        ]
        return np.concatenate(parts)

    def learn(self, results: list[ForwardResult], factor: float) -> None:
        """One step of all quantisers that are learned."""
        for (block, _), result in zip(self.blocks, results, strict=True):
            block.learn(result, factor)

    @property
    def static(self) -> NDArray[np.bool_]:
        """The splats that fine-tuning cannot change, (n,) bool."""
        return np.concatenate([block.static for block, _ in self.blocks])

    @property
    def learned(self) -> list[Learned]:
        """The quantisers as `learn` has left them."""
        return [block.learned for block, _ in self.blocks]

    @learned.setter
    def learned(self, learned: list[Learned]) -> None:
        for (block, _), one in zip(self.blocks, learned, strict=True):
            block.learned = one


def changed(values: F4, reference: F4, least: float) -> Active:
    """The attributes whose `picture_change` is large enough, (n, 3) bool: position, Cholesky factor, colour."""
    return np.asarray(~(picture_change(values, reference) < least * BITS_OF_ATTRIBUTES), np.bool_)


def with_steps_for(loss: float, settings: BlockSettings) -> BlockSettings:
    """The settings with fixed steps that are halved or doubled as often as the error at this loss is."""
    if settings.cholesky_step is None or loss <= 0:
        return settings
    doublings = round((STEPS_PSNR - psnr_of_loss(loss)) / DB_PER_ERROR_DOUBLING)
    factor = math.ldexp(1.0, min(max(doublings, -MAX_DOUBLINGS), MAX_DOUBLINGS))
    position_step = None if settings.position_step is None else settings.position_step * factor
    return settings.with_(position_step=position_step, cholesky_step=settings.cholesky_step * factor)


def inter_quantizer(
    values: F4, reference: F4, active: Active, size: F4, settings: BlockSettings, kept: Kept, rng: np.random.Generator
) -> BlockQuantizer:
    """A quantiser of differences that uses what the decoder keeps wherever a new one is hardly better."""

    def quantizer(reused: Kept) -> BlockQuantizer:
        return BlockQuantizer(values, reference, active, size, settings, rng, reused)

    fresh = quantizer(Kept())
    same = kept.quantizer if settings.cholesky_step is not None and kept.quantizer == fresh.quantizer else None
    if kept.codebooks is not None:
        again = quantizer(Kept(same, kept.codebooks))
        if again.color_error(values) <= REUSE_ERROR * fresh.color_error(values):
            return again
    return quantizer(Kept(same, None))


def intra_quantizer(
    values: F4,
    survivors: int,
    objective: Objective,
    size: F4,
    settings: BlockSettings,
    before: State,
    rng: np.random.Generator,
) -> BlockQuantizer:
    """A quantiser of the splats after the survivors: the one that the decoder keeps, unless the picture suffers.

    A quantiser of an I-frame's splats can be far from what new ones need, such as those of the first picture after
    black.
    """
    new, none_stay = values[survivors:], np.zeros(len(before.splats), np.bool_)

    def loss(quantizer: BlockQuantizer) -> float:
        codes = FrameCodes.predicted_frame(none_stay, None, quantizer.codes(new))
        coded = reconstruct(codes, before).splats.to_array()
        return objective.loss(np.concatenate([values[:survivors], coded]))

    fresh = BlockQuantizer(new, None, None, size, settings, rng, Kept())
    if before.intra == Kept():
        return fresh
    again = BlockQuantizer(new, None, None, size, settings, rng, before.intra)
    return again if loss(again) <= REUSE_LOSS * loss(fresh) else fresh
