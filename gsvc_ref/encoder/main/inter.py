"""P-frames of profile `main`: the codes that bring the splats of the frame before close to a new picture.

1. The motion field, by `motion_field`.
2. Proximal descent on the differences q (`differences`): the squared error, an L1 term, and a price for each group
   (position, shape, colour) that has any difference. A splat whose groups stay 0 costs next to nothing. Splats that are
   far from any difference rest: they are rendered once for the next LOOK iterations.
3. A third of the way, new splats where they gain more than they cost (`candidates`, `new_splats`).
4. Descent with rounding, over the groups that were not 0, with the other splats at rest; the best iterate is kept.

Splats that the picture hardly misses are removed.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8, I8
from gsvc_ref.encoder.main import differences
from gsvc_ref.encoder.main.candidates import REACH, best_candidates
from gsvc_ref.encoder.main.density_choice import choose_densities
from gsvc_ref.encoder.main.motion_field import Field, best_field, flow_at_points
from gsvc_ref.encoder.main.new_splats import NewCodes, NewSplats, rounded, state_parameters
from gsvc_ref.encoder.main.settings import InterSettings
from gsvc_ref.main.cells import cell_order
from gsvc_ref.main.codes import SIDES, IntraCodes, MainCodes, modes_of
from gsvc_ref.main.densities import PLANES, Densities, Density, windows_of
from gsvc_ref.main.frames import MainState
from gsvc_ref.main.motion import field_motion
from gsvc_ref.main.reconstruct import position_steps
from gsvc_ref.main.state import CLASSES, SHEAR_STEPS, SIZE_STEPS, classes
from gsvc_ref.main.tables import step_of
from gsvc_ref.rendering import Objective, SampledObjective

LEAST_LENGTH: Final = 0.02
MOST_LENGTH: Final = 0.3
"""Limits of a splat's step in proximal descent."""

MOST_VECTOR: Final = 2047
"""Longest vector in quarter pixels along x or y, so that every difference of two has a class."""

MOST_DIFFERENCE: Final = 4095
"""Largest difference, of the last class."""

NO_DENSITIES: Final = Densities((Density(scale_code=20),) * len(PLANES), ())
"""What new splats are held to where no densities are kept, and their own are chosen."""

NEW_RATE: Final = 0.25
"""Adam's rate for new splats, in units of D."""

NEW_SIZES: Final = (0.165, 0.33, 0.66)
"""Deviations of new splats to try, in mean distances of splats."""

LEAST_NEW_SIZE: Final = 0.5
"""Smallest of them in pixels. The picture of a smaller splat on few pixels has more energy than the splat has in the
plane: below 0.4 px more than twice as much, so that taking it off the residual would make that larger."""

FIRST_PRICE: Final = 0.3
"""The price of a group begins with this share of it."""

LOOK: Final = 10
"""Every so many iterations of proximal descent it is asked which splats rest, and whether more are worth their time."""

REST: Final = 0.25
"""A splat rests if it has no difference, and its next step would have to have a squared length of more than this share
of what it has to bring one about. Where little moves, descent takes half the time; on six clips the bits at equal PSNR
stayed the same within what seeds scatter by, with shares of 0.25 and 0.5."""

MOST_TIMES: Final = 6
"""There are at most so many times `InterSettings.iterations`."""

PRUNING_INTERVAL: Final = 5
"""Weak new splats are dropped every so many iterations."""

ROUNDING_OFFSET: Final = 0.4
"""Differences are rounded away from 0 from 1 - offset on."""


@dataclass(frozen=True)
class PFrame:
    """What a P-frame is made from.

    Attributes
    ----------
    state
        The decoder's state behind the frame before.
    objective, sampled
        Of the new picture: all of it, and a lattice of pixels in each turn.
    before, after
        (H, W, 3) f4, the pictures between which the optical flow is estimated: the source of the frame before, or its
        decoded picture, and the new source.
    quantizer
        0..79.
    total
        The clip's number of splats, of which new ones are a share.
    """

    state: MainState
    objective: Objective
    sampled: SampledObjective
    before: F4
    after: F4
    quantizer: int
    total: int

    @property
    def step(self) -> int:
        """D in 1/16."""
        return step_of(self.quantizer)


class InterEncoder:
    """Encodes one P-frame after the other.

    Parameters
    ----------
    settings
        How.

    Attributes
    ----------
    past
        The field of the frame before; None at first, and to be set to None at every I-frame.
    """

    def __init__(self, settings: InterSettings) -> None:
        self.settings = settings
        self.past: Field | None = None

    def encode(self, frame: PFrame) -> MainCodes:
        """The codes of the next frame."""
        s, values = self.settings, frame.state.values
        D = frame.step / 16
        self.past = field = best_field(
            frame.sampled, frame.state.splats.to_array(), flow_at_points(frame.before, frame.after), self.past,
            s.motion_price * D * D, s.cell_gain, s.cells, s.motion_steps, s.motion_rounds,
        )  # fmt: skip
        motion = np.zeros((len(values), 2), np.int64)
        vectors = np.clip(field.vectors, -MOST_VECTOR, MOST_VECTOR)
        if field.cell:
            motion = field_motion(values, vectors, field.cell)
        level = classes(values[:, 5:], frame.step)
        g_x, g_y, _ = position_steps(values, level)
        right, down = (np.ascontiguousarray(column) for column in motion.T)
        anchor = differences.anchors(values, (right, down), (g_x, g_y), level, SIZE_STEPS, SHEAR_STEPS)
        found, removed, new = _Updates(frame, anchor, s).codes()
        added, kept = in_order(new, frame.state), frame.state.densities
        own = None
        if len(added) and kept is None:  # no splat was in the last I-frame
            own = choose_densities(added, frame.step, frame.state.width, frame.state.height)
        return MainCodes(
            frame.quantizer, type="P", motion_cell=SIDES.index(field.cell), new=added,
            densities=own,
            vectors=vectors if field.cell else np.zeros((0, 0, 2), np.int64),
            modes=modes_of(found, removed), differences=np.where(removed[:, None], 0, found),
        )  # fmt: skip


def in_order(new: NewCodes, state: MainState) -> IntraCodes:
    """The codes of new splats in the order of their cells."""
    order = cell_order(new.cells, state.width, state.height)
    return IntraCodes(new.cells, new.colors, new.shapes, new.places).take(order)


def limits_of(densities: Densities | None) -> I8:
    """The least and the greatest code of size, aspect and shear that new splats may have, (3, classes, 2)."""
    limits = np.zeros((3, CLASSES, 2), np.int64)
    for row, plane in enumerate(PLANES[3:]):
        windows = windows_of(plane, (densities or NO_DENSITIES).of(plane))
        bins = np.diff(windows.distributions.first) - 1
        limits[row, :, 0] = windows.first << windows.low_bits
        limits[row, :, 1] = ((windows.first + bins) << windows.low_bits) - 1
    return limits


class _Updates:
    """The differences and new splats of one frame in the making.

    Attributes
    ----------
    q, y
        (N, 8) f8, the differences, and those at which the gradient is taken.
    new
        The new splats.
    parameters
        (N + n, 8) f4, of the splats with the differences y and of the new ones.
    length
        (N,) f8, step lengths.
    idle
        (N,) bool, the splats at rest, which the objectives hold.
    """

    def __init__(self, frame: PFrame, anchor: F8, settings: InterSettings) -> None:
        self.frame, self.anchor, self.settings = frame, anchor, settings
        self.limits = limits_of(frame.state.densities)
        self.count, self.D = len(anchor), frame.step / 16
        self.width, self.height = frame.objective.width, frame.objective.height
        self.scale = self.width * self.height * 255.0 * 255.0  # loss to squared error
        self.by_q = self.scale / (2 * self.D * self.D)  # loss to f
        self.q, self.y = np.zeros((self.count, 8)), np.zeros((self.count, 8))
        self.parameters = np.empty((self.count, 8), np.float32)
        differences.values(anchor, self.y, self.D, self.parameters)
        crowding = differences.crowding(self.parameters)
        self.length = np.clip(settings.length / crowding, LEAST_LENGTH, MOST_LENGTH)
        self.new = NewSplats(np.empty((0, 8)), self.D, self.width, self.height)
        self.idle = np.zeros(self.count, np.bool_)

    def codes(self) -> tuple[I8, NDArray[np.bool_], NewCodes]:
        """Descend, add, descend, round: the differences, which splats are removed, and the new ones."""
        s = self.settings
        losses: list[float] = []
        for iteration in range(MOST_TIMES * s.iterations):
            if iteration == s.iterations // 3:
                self._add()
            if iteration > s.iterations // 2 and iteration % PRUNING_INTERVAL == 0:
                self._prune()
            losses.append(self._descend(iteration, min(1.0, FIRST_PRICE + iteration / s.iterations)))
            if len(losses) >= s.iterations and len(losses) % LOOK == 0:
                before, last = sum(losses[-2 * LOOK : -LOOK]), sum(losses[-LOOK:])
                if last > (1 - s.progress) * before:
                    break
        self._prune()
        return self._round()

    def _descend(self, iteration: int, ramp: float) -> float:
        """One iteration of step 2, with prices times `ramp`; the loss before it on the lattice of its turn."""
        s, count = self.settings, self.count
        looks = iteration > 0 and iteration % LOOK == 0
        if looks:
            self._rest(np.zeros(count, np.bool_), self.frame.sampled)
        self.new.put_parameters(self.parameters[count:])
        loss, gradient = self._evaluate(iteration)
        idle = self.idle
        if looks:
            idle = differences.idle(
                self.anchor, self.parameters[:count], gradient[:count], self.D, self.by_q, self.y, self.q, self.length,
                s.sparsity, REST * s.price * ramp,
            )  # fmt: skip
        differences.proximal_step(
            self.anchor, self.parameters[:count], gradient[:count], self.D, self.by_q, self.y, self.q, self.length,
            s.momentum, s.sparsity, s.price * ramp,
        )  # fmt: skip
        self.new.step(self.parameters[count:], gradient[count:], self.scale, NEW_RATE)
        if looks:
            self._rest(idle, self.frame.sampled)
        return loss

    def _add(self) -> None:
        """New splats where the picture of the parameters is wrong."""
        s, total, objective = self.settings, self.frame.total, self.frame.objective
        objective.loss(self.parameters, drawn=True)
        mean = math.sqrt(self.width * self.height / max(total, 1))
        sizes = tuple(max(share * mean, LEAST_NEW_SIZE) for share in NEW_SIZES)
        least, most = s.new_gain * self.D * self.D, math.floor(s.new_share * total + 0.5)
        z = best_candidates(-objective.residual(), sizes, least, most, objective.threads)
        self.new = NewSplats(z, self.D, self.width, self.height)
        self.parameters = np.concatenate([self.parameters, np.empty((len(z), 8), np.float32)])

    def _rest(self, idle: NDArray[np.bool_], *objectives: Objective | SampledObjective) -> None:
        """Let the splats (N,) bool rest, and no others; the objectives hold them as they are."""
        self.idle = idle
        for objective in objectives:
            objective.hold(self.parameters[: self.count][idle])

    def _evaluate(self, turn: int | None = None) -> tuple[float, F4]:
        """The loss on the lattice of a turn, None: all pixels; the gradient (N + n, 8), zero where splats rest."""
        moving = np.ones(len(self.parameters), np.bool_)
        moving[: self.count] = ~self.idle
        parameters, gradient = self.parameters[moving], np.zeros(self.parameters.shape, np.float32)
        if turn is None:
            loss, gradient[moving] = self.frame.objective.evaluate(parameters)
        else:
            loss, gradient[moving] = self.frame.sampled.evaluate(parameters, turn)
        return loss, gradient

    def _prune(self) -> None:
        """Drop new splats that have become too weak."""
        self.new.keep(self.settings.new_energy)
        self.parameters = self.parameters[: self.count + len(self.new)]

    def _round(self) -> tuple[I8, NDArray[np.bool_], NewCodes]:
        """Step 4."""
        count, last = self.count, self.settings.rounded_iterations
        objectives = self.frame.sampled, self.frame.objective
        mask = np.stack([(self.q[:, first:end] != 0).any(axis=1) for first, end in differences.GROUPS], axis=1)
        self.y = np.sign(self.q) * np.floor(np.abs(self.q) + ROUNDING_OFFSET)
        differences.values(self.anchor, self.y, self.D, self.parameters[:count])
        self._rest(np.asarray((~mask).all(axis=1)), *objectives)
        length, least = self.length / 2, math.inf
        for iteration in range(last + 1):
            if iteration % PRUNING_INTERVAL == 0 and 3 * iteration <= 2 * last:
                self._prune()
            codes = rounded(
                self.new.z, self.frame.step, self.width, self.height, SIZE_STEPS, SHEAR_STEPS, self.limits
            )  # fmt: skip
            state_parameters(codes.state, self.parameters[count:])
            is_near_end = 3 * iteration >= 2 * last
            loss, gradient = self._evaluate(None if is_near_end else iteration)
            if is_near_end and loss < least:
                least, best, best_new, parameters = loss, self.y.astype(np.int64), codes, self.parameters.copy()
            differences.rounded_step(
                self.anchor, self.parameters[:count], gradient[:count], self.D, self.by_q, self.y, self.q, length,
                ROUNDING_OFFSET, mask,
            )  # fmt: skip
            self.new.step(self.parameters[count:], gradient[count:], self.scale, NEW_RATE)
        self._rest(np.zeros(count, np.bool_), *objectives)
        removed = self._added_by_removal(best, parameters) < self.settings.worth
        visible = (best_new.colors != 0).any(axis=1)
        return np.clip(best, -MOST_DIFFERENCE, MOST_DIFFERENCE), removed, best_new.take(np.flatnonzero(visible))

    def _added_by_removal(self, q: I8, parameters: F4) -> F8:
        """What the squared error would rise by without each splat alone, (N,) f8 in D^2, at the differences q (N, 8).

        The error is quadratic in a splat's colour n: |n|^2 - n . gradient; a splat outside the frame adds nothing.
        """
        _, gradient = self.frame.objective.evaluate(parameters)
        y, by_q = q.astype(np.float64), np.empty((self.count, 8))
        differences.gradients(self.anchor, y, parameters, gradient, self.D, self.by_q, by_q)
        n, g = self.anchor[:, 10:] / self.D + y[:, 5:], 2 * by_q[:, 5:]
        added = n * (n - g)
        return np.where(self._outside(parameters), 0.0, (added[:, 0] + added[:, 1]) + added[:, 2])

    def _outside(self, parameters: F4) -> NDArray[np.bool_]:
        """Which splats lie outside the frame with all of their deviations up to REACH, (N,) bool."""
        x, y, l11, l21, l22 = parameters[: self.count, :5].astype(np.float64).T
        wide, high = REACH * l11, REACH * np.sqrt(l21 * l21 + l22 * l22)
        return np.asarray((x < -wide) | (x > self.width + wide) | (y < -high) | (y > self.height + high))
