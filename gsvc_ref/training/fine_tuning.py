"""Quantisation-aware fine-tuning of a frame (paper section 3.8): the loss is that of what the decoder will show."""

import math
from typing import ClassVar

from gsvc_base.arrays import F4
from gsvc_base.splats import PARAMETERS_PER_SPLAT
from gsvc_ref.paper import FrameCodes, State, reconstruct
from gsvc_ref.rendering import Objective
from gsvc_ref.training.adan import Adan
from gsvc_ref.training.frame_quantizer import FrameQuantizer
from gsvc_ref.training.loop import OnIteration, minimise
from gsvc_ref.training.settings import FitSettings


def fine_tune(
    values: F4,  # (n, 8) f4, fitted, in the order of the quantizer's population
    quantizer: FrameQuantizer,  # changed in place
    objective: Objective,
    settings: FitSettings,
    on_iteration: OnIteration | None = None,  # once more than there are iterations, unless they converge
) -> tuple[FrameCodes, State, int]:
    """Minimise the loss of the decoded splats over the values and the learned quantisers.

    Returns the codes with the least loss of all evaluations, the decoder's state after them, and the iterations made.
    """
    model = _QuantizedValues(values, quantizer, settings)
    objective.freeze(quantizer.forward(values)[0], quantizer.static)  # no step changes these splats
    iterations = minimise(model, objective, settings, on_iteration)
    objective.thaw()
    values, quantizer.learned = model.best
    codes = quantizer.codes(values)
    return codes, reconstruct(codes, quantizer.before), iterations


class _QuantizedValues:
    """A model whose splats are rendered as a decoder will have them; gradients go straight through."""

    keeps_best: ClassVar[bool] = True

    def __init__(self, values: F4, quantizer: FrameQuantizer, settings: FitSettings) -> None:
        self.values = values.copy()
        self.quantizer = quantizer
        self.optimizer = Adan(len(values), PARAMETERS_PER_SPLAT, settings.optimizer)
        self.least, self.best = math.inf, (values, quantizer.learned)

    def evaluate(self, objective: Objective) -> tuple[float, F4]:
        """The loss of the decoded splats, and the straight-through gradient by the values, (n, 8) f4."""
        decoded, self._results = self.quantizer.forward(self.values)
        loss, gradient = objective.evaluate(decoded)
        if loss < self.least:
            self.least, self.best = loss, (self.values.copy(), self.quantizer.learned)
        return loss, self.quantizer.backward(self._results, gradient)

    def learn(self, factor: float) -> None:
        """One step of the quantisers."""
        self.quantizer.learn(self._results, factor)
