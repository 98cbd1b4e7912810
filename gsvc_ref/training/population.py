"""The splats of one frame in training."""

from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4
from gsvc_base.splats import PARAMETERS_PER_SPLAT, Splats
from gsvc_ref.rendering import Objective
from gsvc_ref.training.adan import Adan, AdanSettings
from gsvc_ref.training.augmentation import augment
from gsvc_ref.training.pruning import compact, prune
from gsvc_ref.training.weighting import WEIGHT, weighted_gradients, weighted_parameters

NEW: Final = -1
"""Origin of a splat that the reference frame does not have."""


class Population:
    """Splats in training: parameters, weights w, origins and the optimiser's state, row by row."""

    keeps_best: ClassVar[bool] = False

    def __init__(
        self, splats: Splats, weight: float, origins: NDArray[np.int64], optimizer: AdanSettings | None = None
    ) -> None:
        self.values = _rows(splats, weight)  # (N, 9) f4: the columns of `Splats.to_array`, then w
        self.origins = origins  # (N,) i8, the index of the splat in the reference frame, or NEW
        self.optimizer = Adan(len(splats), PARAMETERS_PER_SPLAT + 1, optimizer)

    def __len__(self) -> int:
        return len(self.values)

    @property
    def weights(self) -> F4:
        """The weights w, (N,) f4."""
        return self.values[:, WEIGHT]

    def parameters(self) -> F4:
        """The parameters that are rendered, (N, 8) f4, with the colours w c' (10-10)."""
        return weighted_parameters(self.values)

    def splats(self) -> Splats:
        """The splats with w c' as their colours: what is coded, and what the next frame starts from."""
        return Splats.from_array(self.parameters())

    def append(self, splats: Splats, weight: float) -> None:
        """Add new splats at the end, with fresh optimiser state."""
        self._grow(np.concatenate([self.values, _rows(splats, weight)]))

    def augment(self, uniforms: F4, width: int, height: int) -> None:
        """Add random splats of small weight at the end, with fresh optimiser state; see `augmentation.augment`."""
        self._grow(augment(self.values, uniforms, width, height))

    def _grow(self, values: F4) -> None:
        """Take values with new rows at their end."""
        new = len(values) - len(self)
        self.values = values
        self.origins = np.concatenate([self.origins, np.full(new, NEW, np.int64)])
        self.optimizer = self.optimizer.append(new)

    def take(self, indices: NDArray[np.int64]) -> None:
        """Keep the splats of these indices, in this order, with their optimiser state."""
        kept = compact(indices, self.values, *self.optimizer.state)
        self.values, self.optimizer = kept.values, self.optimizer.with_state(*kept[1:])
        self.origins = self.origins[indices]

    def prune(self, count: int) -> None:
        """Remove the splats of the least |w| (GSP)."""
        self.take(prune(self.weights, count))

    def evaluate(self, objective: Objective) -> tuple[float, F4]:
        """The loss, and its gradient by all nine columns, (N, 9) f4, by the chain rule through w c'."""
        loss, gradient = objective.evaluate(self.parameters())
        return loss, weighted_gradients(self.values, gradient)

    def learn(self, factor: float) -> None:
        """Learn nothing besides the values."""


def _rows(splats: Splats, weight: float) -> F4:
    """The values of splats that all have the same weight, (N, 9) f4."""
    return np.concatenate([splats.to_array(), np.full((len(splats), 1), weight, np.float32)], axis=1)
