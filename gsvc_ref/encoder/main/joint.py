"""I-frames with layers: the splats of all layers are fitted, weighed against their bits, and rounded together.

The base is fitted as an I-frame is, and each layer to what is left, with all splats below it free to move. What is
made small is the sum over qualities l of

    w_l * squared error of the picture of layers 0 to l

with w = 1 for the topmost one. A base that is made alone is in the way of the layers above it: they take 5 to 25 % more
bits than a single layer of their quality, where they take -8 to 7 % with this. What the base takes more than a single
layer of its quality is the price, and its weight is the knob. The idea is that of P-GSVC (L. Wang, Y. Shi and W. T.
Ooi, arXiv:2603.10551), by the authors of the paper.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.random import Generator

from gsvc_base.arrays import F8, I8
from gsvc_ref.encoder.main.codes import nearest_codes
from gsvc_ref.encoder.main.coordinates import squared_energies, to_parameters
from gsvc_ref.encoder.main.descent import Walk
from gsvc_ref.encoder.main.fitter import descend, fit
from gsvc_ref.encoder.main.intra import (
    BITS_WEIGHT,
    PARTS,
    REMOVALS,
    REMOVED_ENERGY,
    SURPLUS,
    add_bits,
    drawn_parts,
    ordered,
    quantizer_for,
)
from gsvc_ref.encoder.main.settings import IntraSettings
from gsvc_ref.encoder.main.target import LayeredTarget, Target
from gsvc_ref.main.codes import IntraCodes, MainCodes
from gsvc_ref.main.reconstruct import intra_state
from gsvc_ref.main.state import parameters_of
from gsvc_ref.main.tables import QUANTIZERS, step_of

COARSER: Final = (6, 4, 4)
"""By how many eighths of an octave D of each layer is coarser than that of the next one, of 2, 3 or 4 layers.

With one D for all, a base takes 40 to 70 % more bits than a single layer of its quality.
"""

TOPMOST_COARSER: Final = (6, 7, 8)
"""By how many D of the topmost layer is coarser than `quantizer_for` all splats, of 2, 3 or 4 layers.

It then is about that of a single layer of so many splats. Splats that lie on others are faint, and the rule finds less.
"""


def encode_joint(
    targets: Sequence[Target], splats: Sequence[int], weights: Sequence[float], rng: Generator, settings: IntraSettings
) -> list[MainCodes]:
    """The codes of an I-frame's base and of each layer above it, of about `splats` >= 1 splats each.

    There is a target of the whole picture for each quality, and a weight.
    """
    return _Joint(targets, weights, rng, settings).codes(splats)


def joint_evaluations(settings: IntraSettings, layers: int) -> int:
    """How many evaluations of a picture that takes, about."""
    grown = settings.initialization * layers * (layers + 1) // 2
    return grown + layers * (settings.refinement + settings.rounding * (len(PARTS) + 1))


class _Joint:
    """The layers of an I-frame in the making."""

    def __init__(
        self, targets: Sequence[Target], weights: Sequence[float], rng: Generator, settings: IntraSettings
    ) -> None:
        self.targets, self.weights, self.rng, self.settings = targets, weights, rng, settings
        self.count = len(targets)
        self.steps: list[int] = []  # of each layer, and its D
        self.D = np.zeros(self.count)

    def codes(self, splats: Sequence[int]) -> list[MainCodes]:
        """Grow, refine, round."""
        z, layers = self._grown(splats)
        finest = quantizer_for(z) + TOPMOST_COARSER[self.count - 2]
        coarser = COARSER[self.count - 2] * np.arange(self.count)[::-1]
        quantizers = [int(one) for one in np.minimum(finest + coarser, QUANTIZERS - 1)]
        self.steps = [step_of(quantizer) for quantizer in quantizers]
        self.D = np.array(self.steps) / 16
        target = LayeredTarget(self.targets, self.weights, layers)
        rounded = self._rounded(target, self._refined(target, z))
        size = target.width, target.height
        return [ordered(quantizer, one, *size) for quantizer, one in zip(quantizers, rounded, strict=True)]

    def _grown(self, splats: Sequence[int]) -> tuple[F8, I8]:
        """Coordinates (N, 8) of splats close to the picture in each quality, and their layers (N,)."""
        z, layers = np.zeros((0, 8)), np.zeros(0, np.int64)
        for layer, count in enumerate(splats):
            target: Target | LayeredTarget = self.targets[0]
            if layer:
                weights = [weight / self.weights[layer] for weight in self.weights[: layer + 1]]
                target = LayeredTarget(self.targets[: layer + 1], weights, layers)
                self.targets[layer].evaluate(to_parameters(z))
            z = fit(target, max(1, round(SURPLUS * count)), self.rng, self.settings.initialization, z)
            layers = np.concatenate([layers, np.full(len(z) - len(layers), layer)])
        return z, layers

    def _refined(self, target: LayeredTarget, z: F8) -> F8:
        """Coordinates (N, 8) after descent with the term of the bits; the weakest of each layer go."""
        least = np.square(REMOVED_ENERGY * self.D)
        done, walk = 0, Walk(len(z), self.D[-1])
        for share in (*REMOVALS, 1.0):
            stop = int(self.settings.refinement * share)
            z = self._descended(target, z, walk, stop - done)
            done = stop
            kept = np.flatnonzero(squared_energies(z) > least[target.layers])
            z, target.layers = z[kept], target.layers[kept]
            walk.take(kept)
        return z

    def _rounded(self, target: LayeredTarget, z: F8) -> list[IntraCodes]:
        """The codes of each layer's splats, rounded part by part as by `round_sequentially`."""
        layers = target.layers
        rounded = [[IntraCodes()] for _ in self.targets]
        held = [np.zeros((0, 8), np.float32) for _ in self.targets]
        parts = drawn_parts(len(z), self.rng)
        z = self._descended(target, z, Walk(len(z), self.D[-1]), self.settings.rounding)
        for part, unsorted in parts:
            free = np.sort(unsorted)
            for layer, step in enumerate(self.steps):
                own = part[layers[part] == layer]
                rounded[layer].append(nearest_codes(z[own], step, target.width, target.height))
                held[layer] = np.concatenate([held[layer], parameters_of(intra_state(rounded[layer][-1], step))])
            if len(free):
                target.layers = layers[free]
                target.hold(held)
                z[free] = self._descended(target, z[free], Walk(len(free), self.D[-1]), self.settings.rounding)
        return [IntraCodes.joined(one) for one in rounded]

    def _descended(self, target: LayeredTarget, z: F8, walk: Walk, evaluations: int) -> F8:
        """As `descend`, with the term of the bits, which weighs as much as the qualities that have the layer."""
        ends = (0, *target.ends(), len(z))

        def add(z: F8, gradient: F8) -> float:
            total = 0.0
            for layer, D in enumerate(self.D):
                own = slice(ends[layer], ends[layer + 1])
                total += add_bits(D, BITS_WEIGHT * sum(self.weights[layer:]), z[own], gradient[own])
            return total

        return descend(target, z, walk, evaluations, add)
