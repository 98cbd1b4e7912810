"""P-frames of profile `main`: the codes that bring the splats of the frame before close to a new picture.

1. The motion field, by `motion_field`.
2. Proximal descent on the differences q (`differences`): the squared error, an L1 term, and a price for each group
   (position, shape, colour) that has any difference. A splat whose groups stay 0 costs next to nothing.
3. A third of the way, new splats where they gain more than they cost (`new_splats`).
4. Descent with rounding, over the groups that were not 0; the best iterate is kept.

Splats that cover no pixel any more are removed.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.arrays import F4
from gsvc_ref.main_encoder import differences
from gsvc_ref.main_encoder.motion_field import Field, best_field, flow_at_points
from gsvc_ref.main_encoder.new_splats import NewCodes, NewSplats, best_candidates, rounded, state_parameters
from gsvc_ref.rendering import Objective

I8 = NDArray[np.int64]

ROUNDING_OFFSET: Final = 0.4
"""Differences are rounded away from 0 from 1 - offset on."""


@dataclass(frozen=True)
class InterSettings:
    """How a P-frame is encoded.

    Attributes
    ----------
    cells
        The sides of the motion field's cells to choose from, in pixels, from large to small.
    motion_steps
        Gauss-Newton steps for each of them.
    iterations, rounded_iterations
        Of steps 2 and 4.
    length, momentum
        Of the proximal descent.
    sparsity
        Weight of the L1 term.
    price
        What a group costs, in D^2.
    motion_price
        Squared error that a bit of the field is worth, in D^2.
    new_gain
        A new splat must promise to take more than this off the squared error, in D^2.
    new_energy
        New splats with an energy below this many D are dropped.
    new_share
        Most new splats, as a share of the clip's number.
    """

    cells: tuple[int, ...] = (64, 32, 16)
    motion_steps: int = 4
    motion_rounds: int = 6
    iterations: int = 80
    rounded_iterations: int = 30
    length: float = 0.06
    momentum: float = 0.9
    sparsity: float = 0.4
    price: float = 0.36
    motion_price: float = 1.2
    cell_gain: float = 2.4
    new_gain: float = 9.0
    new_energy: float = 4.5
    new_share: float = 0.1
    new_sizes: float = 1.0


@dataclass(frozen=True)
class InterCodes:
    """The codes of a P-frame.

    Attributes
    ----------
    field
        The motion field.
    differences
        (N, 8) i8.
    removed
        (N,) bool.
    new
        The new splats, in the order in which they were found.
    """

    field: Field
    differences: I8
    removed: NDArray[np.bool_]
    new: NewCodes


class InterEncoder:
    """Encodes one P-frame after the other.

    Parameters
    ----------
    codec
        The module of the profile's reconstruction.
    width, height
        The frame's size in pixels.
    settings
        How.
    """

    def __init__(self, codec: Any, width: int, height: int, settings: InterSettings) -> None:
        self.codec, self.width, self.height, self.settings = codec, width, height, settings
        self.past: Field | None = None

    def encode(
        self, state: I8, objective: Objective, before: F4, after: F4, step: int, limits: I8, total: int
    ) -> InterCodes:
        """The codes of the next frame.

        Parameters
        ----------
        state
            (N, 8) i8, the decoded splats of the frame before.
        objective
            Of the new picture.
        before, after
            (H, W, 3) f4, the pictures between which the flow is estimated: the frame before, and the new source.
        step
            D in 1/16.
        limits
            (3, classes, 2) i8, as for `rounded`.
        total
            The clip's number of splats.
        """
        codec, s = self.codec, self.settings
        D = step / 16
        scale = self.height * self.width * 255.0**2  # loss to squared error
        reference = np.asarray(codec.to_binary32(state), np.float32)  # (N, 8) f4
        flow = flow_at_points(before, after)
        prices = s.motion_price * D * D, s.cell_gain
        field = best_field(
            objective, reference, flow, self.past, *prices, s.cells, s.motion_steps, s.motion_rounds
        )
        self.past = field
        count = len(state)
        shift = (np.zeros(count, np.int64), np.zeros(count, np.int64))
        if field.cell:
            shift = tuple(codec.moved(state, field.vectors, field.cell))
        level = codec.level(state[:, 5:], step)
        anchor = differences.anchors(state, shift, codec.steps(state, level), level, codec.H_SIZE, codec.H_SHEAR)

        q, y = np.zeros((count, 8)), np.zeros((count, 8))
        parameters = np.empty((count, 8), np.float32)  # (N, 8) f4
        differences.values(anchor, y, D, parameters)
        length = np.full(count, s.length)
        new = NewSplats(np.empty((0, 8)), D, self.width, self.height)
        of_q = scale / (2 * D * D)
        group_prices = np.empty((count, 3))
        for iteration in range(s.iterations):
            if iteration == s.iterations // 3 and s.new_share > 0:
                new = self._add(objective, parameters, D, total)
                parameters = np.concatenate([parameters, np.empty((len(new), 8), np.float32)])
            if len(new) and iteration > s.iterations // 2 and iteration % 5 == 0:
                new.keep(s.new_energy)
                parameters = parameters[: count + len(new)]
            new.put_parameters(parameters[count:])
            _, gradient = objective.evaluate(parameters)
            group_prices[:] = s.price * min(1.0, 0.3 + iteration / s.iterations)
            differences.proximal_step(
                anchor, parameters[:count], gradient[:count], D, of_q, y, q, length, s.momentum, s.sparsity,
                group_prices,
            )
            new.step(parameters[count:], gradient[count:], scale, 0.25)
        new.keep(s.new_energy)
        return self._round(objective, anchor, q, new, step, limits, field)

    def _add(self, objective: Objective, parameters: F4, D: float, total: int) -> NewSplats:
        """New splats where the picture of the parameters is wrong."""
        s = self.settings
        objective.loss(parameters)
        mean = (self.width * self.height / max(total, 1)) ** 0.5 * s.new_sizes
        sizes = (0.165 * mean, 0.33 * mean, 0.66 * mean)
        most = round(s.new_share * total)
        z = best_candidates(-objective.residual(), sizes, s.new_gain * D * D, most)
        return NewSplats(z, D, self.width, self.height)

    def _round(
        self, objective: Objective, anchor: Any, q: Any, new: NewSplats, step: int, limits: I8, field: Field
    ) -> InterCodes:
        """Step 4, from the differences q and the new splats."""
        s, count, D = self.settings, len(q), step / 16
        scale = self.height * self.width * 255.0**2
        sizes = self.codec.H_SIZE, self.codec.H_SHEAR
        mask = np.stack([(q[:, a:b] != 0).any(axis=1) for a, b in ((0, 2), (2, 5), (5, 8))], axis=1)
        length = np.full(count, s.length / 2)
        y = np.sign(q) * np.floor(np.abs(q) + ROUNDING_OFFSET)
        parameters = np.empty((count + len(new), 8), np.float32)
        differences.values(anchor, y, D, parameters[:count])
        best_loss, best_y, best_codes = np.inf, y, rounded(new.z, step, self.width, self.height, *sizes, limits)
        gradient = np.zeros((count, 8), np.float32)
        for iteration in range(s.rounded_iterations + 1):
            if len(new) and iteration % 5 == 0 and iteration <= s.rounded_iterations * 2 // 3:
                new.keep(s.new_energy)
                parameters = parameters[: count + len(new)]
            codes = rounded(new.z, step, self.width, self.height, *sizes, limits)
            state_parameters(codes.state, parameters[count:])
            loss, gradient = objective.evaluate(parameters)
            if loss < best_loss and iteration >= s.rounded_iterations * 2 // 3:
                best_loss, best_y, best_codes = loss, y.copy(), codes
            differences.rounded_step(
                anchor, parameters[:count], gradient[:count], D, scale / (2 * D * D), y, q, length, ROUNDING_OFFSET, mask
            )
            new.step(parameters[count:], gradient[count:], scale, 0.25)
        whole = best_y.astype(np.int64)
        removed = (gradient[:count] == 0).all(axis=1) & (whole == 0).all(axis=1)
        coded = np.abs(best_codes.colors).sum(axis=1) > 0
        return InterCodes(field, whole, removed, best_codes.take(np.flatnonzero(coded)))
