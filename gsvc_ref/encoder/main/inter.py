"""P-frames of profile `main`: the codes that bring the splats of the frame before close to a new picture.

1. The motion field, by `field`.
2. Proximal descent on the differences q (`differences`): the squared error, an L1 term, and a price for each group
   (position, shape, color) that has any difference. A splat whose groups stay 0 costs next to nothing. Splats that are
   far from any difference rest: they are rendered once for the next LOOK iterations.
3. A third of the way, new splats where they gain more than they cost (`new_splats`).
4. Descent with rounding, over the groups that were not 0, with the other splats at rest; the best iterate is kept. It
   is judged by the picture of a decoder: all parameters are those of states, by `add_differences` and `intra_state`.

Splats that the picture hardly misses are removed.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4, F8, I8
from gsvc_ref.encoder.main import differences
from gsvc_ref.encoder.main.codes import limits_of, nearest_codes
from gsvc_ref.encoder.main.coordinates import gradient_by_coordinates, to_parameters
from gsvc_ref.encoder.main.densities import choose_densities
from gsvc_ref.encoder.main.field import Field, best_field, flow_at_points
from gsvc_ref.encoder.main.new_splats import CUTOFF, NewSplats, best_candidates
from gsvc_ref.encoder.main.settings import InterSettings
from gsvc_ref.encoder.main.target import SQUARE_OF_8_BITS
from gsvc_ref.main.cells import cell_order
from gsvc_ref.main.codes import GROUPS, SIDES, IntraCodes, MainCodes, modes_of
from gsvc_ref.main.densities import PLANES, Densities, Density
from gsvc_ref.main.frames import MainState
from gsvc_ref.main.motion import field_motion
from gsvc_ref.main.reconstruct import add_differences, intra_state
from gsvc_ref.main.state import parameters_of
from gsvc_ref.main.tables import step_of
from gsvc_ref.rendering import Objective, SampledObjective

LEAST_LENGTH: Final = 0.02  # of a splat's step in proximal descent
MOST_LENGTH: Final = 0.3
MOST_VECTOR: Final = 2047  # longest vector in quarter pixels along x or y, so that every difference of two has a class

NO_DENSITIES: Final = Densities((Density(scale_code=20),) * len(PLANES), ())
"""What new splats are held to where no densities are kept, and their own are chosen."""

NEW_SIZES: Final = (0.165, 0.33, 0.66)  # deviations of new splats to try, in mean distances of splats

LEAST_NEW_SIZE: Final = 0.5
"""Smallest of them in pixels. The picture of a smaller splat on few pixels has more energy than the splat has in the
plane: below 0.4 px more than twice as much, so that taking it off the residual would make that larger."""

FIRST_PRICE: Final = 0.3  # the price of a group begins with this share of it

LOOK: Final = 10
"""After so many iterations of proximal descent it is asked which splats rest, and whether more are worth their time."""

REST: Final = 0.25
"""A splat rests if it has no difference, and its next step would have to have a squared length of more than this share
of what it has to bring one about. Where little moves, descent takes half the time; on six clips the bits at equal PSNR
stayed the same within what seeds scatter by, with shares of 0.25 and 0.5."""

MOST_TIMES: Final = 6  # most iterations of proximal descent, in units of `InterSettings.iterations`
PRUNING_INTERVAL: Final = 5  # weak new splats are dropped every so many iterations
ROUNDING_OFFSET: Final = 0.4  # differences are rounded away from 0 from 1 - offset on


@dataclass(frozen=True)
class PFrame:
    """What a P-frame is made from."""

    state: MainState  # the decoder's, after the frame before
    objective: Objective  # of all pixels of the new picture
    sampled: SampledObjective  # of a lattice of its pixels in each turn
    before: F4  # (H, W, 3), where the optical flow begins: the source of the frame before, or its decoded picture
    after: F4  # (H, W, 3), the new source
    quantizer: int
    total: int  # the clip's number of splats, of which new ones are a share

    @property
    def step(self) -> int:
        """D in 1/16."""
        return step_of(self.quantizer)


class InterEncoder:
    """Encodes one P-frame after the other, by its settings; another one begins at every I-frame."""

    def __init__(self, settings: InterSettings) -> None:
        self.settings = settings
        self.previous: Field | None = None

    def encode(self, frame: PFrame) -> MainCodes:
        """The codes of the next frame."""
        values, state = frame.state.values, frame.state
        flow = flow_at_points(frame.before, frame.after)
        self.previous = field = best_field(
            frame.sampled, state.splats.to_array(), flow, self.previous, self.settings, frame.step / 16
        )
        motion, vectors = np.zeros((len(values), 2), np.int64), np.zeros((0, 0, 2), np.int64)
        if field.cell:
            vectors = np.clip(field.vectors, -MOST_VECTOR, MOST_VECTOR)
            motion = field_motion(values, vectors, field.cell)
        q, removed, new = _Updates(frame, motion, self.settings).codes()
        new = new.take(cell_order(new.cells, state.width, state.height))
        densities = None
        if len(new) and state.densities is None:  # no splat was in the last I-frame
            densities = choose_densities(new, frame.step, state.width, state.height)
        return MainCodes(
            frame.quantizer, type="P", motion_cell=SIDES.index(field.cell), new=new, densities=densities,
            vectors=vectors, modes=modes_of(q, removed),
            differences=np.where(removed[:, None], 0, q),
        )  # fmt: skip


class _Updates:
    """The differences and new splats of one frame in the making."""

    def __init__(self, frame: PFrame, motion: I8, settings: InterSettings) -> None:
        self.frame, self.motion, self.settings = frame, motion, settings
        self.count, self.D = len(motion), frame.step / 16
        self.width, self.height = frame.objective.width, frame.objective.height
        pixels = self.width * self.height
        self.scale = pixels * SQUARE_OF_8_BITS  # loss to squared error
        self.anchors = differences.anchors_of(frame.state.values, motion, frame.step, pixels)
        self.limits = limits_of(frame.state.densities or NO_DENSITIES)
        self.q, self.y = np.zeros((self.count, 8)), np.zeros((self.count, 8))  # see `Iterate`
        self.parameters = to_parameters(self.anchors.z)  # (N + n, 8) f4, of the splats at y and of the new ones
        crowding = differences.crowding(self.parameters)
        self.length = np.clip(settings.length / crowding, LEAST_LENGTH, MOST_LENGTH)  # (N,) f8
        self.new = NewSplats(np.empty((0, 8)), self.D, self.width, self.height)
        self.idle = np.zeros(self.count, np.bool_)  # the splats at rest, which the objectives hold

    def codes(self) -> tuple[I8, NDArray[np.bool_], IntraCodes]:
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

    def _iterate(self, length: F8) -> differences.Iterate:
        return differences.Iterate(self.q, self.y, self.parameters[: self.count], length)

    def _descend(self, iteration: int, ramp: float) -> float:
        """One iteration of step 2, with prices times `ramp`; the loss before it on the lattice of its turn."""
        s, count, at = self.settings, self.count, self._iterate(self.length)
        looks = iteration > 0 and iteration % LOOK == 0
        if looks:
            self._rest(np.zeros(count, np.bool_), self.frame.sampled)
        self.parameters[count:] = to_parameters(self.new.z)
        loss, gradient = self._evaluate(iteration)
        resting = self.idle
        prices = differences.Prices(s.momentum, s.sparsity, s.price * ramp)
        if looks:
            lower = prices._replace(group=REST * prices.group)
            resting = differences.idle(self.anchors, at, gradient[:count], lower)
        differences.proximal_step(self.anchors, at, gradient[:count], prices)
        self.new.step(self.parameters[count:], gradient[count:], self.scale)
        if looks:
            self._rest(resting, self.frame.sampled)
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

    def _rest(self, resting: NDArray[np.bool_], *objectives: Objective | SampledObjective) -> None:
        """Let the splats (N,) bool rest, and no others; the objectives hold them as they are."""
        self.idle = resting
        for objective in objectives:
            objective.hold(self.parameters[: self.count][resting])

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

    def _decoded(self) -> I8:
        """The state (N, 8) that a decoder makes of the whole differences y; its parameters become those drawn."""
        state = add_differences(self.frame.state.values, self.motion, self.y.astype(np.int64), self.frame.step)
        self.parameters[: self.count] = parameters_of(state)
        return state

    def _round(self) -> tuple[I8, NDArray[np.bool_], IntraCodes]:
        """Step 4."""
        count, last, step = self.count, self.settings.rounded_iterations, self.frame.step
        objectives = self.frame.sampled, self.frame.objective
        mask = np.stack([(self.q[:, first:end] != 0).any(axis=1) for _, first, end in GROUPS], axis=1)
        whole = np.minimum(np.floor(np.abs(self.q) + ROUNDING_OFFSET), differences.MOST_DIFFERENCE)
        self.y = np.sign(self.q) * whole
        self._decoded()
        self._rest(np.asarray((~mask).all(axis=1)), *objectives)
        length, least = self.length / 2, math.inf
        for iteration in range(last + 1):
            if iteration % PRUNING_INTERVAL == 0 and 3 * iteration <= 2 * last:
                self._prune()
            codes = nearest_codes(self.new.z, step, self.width, self.height, self.limits)
            self.parameters[count:] = parameters_of(intra_state(codes, step))
            is_near_end = 3 * iteration >= 2 * last
            loss, gradient = self._evaluate(None if is_near_end else iteration)
            if is_near_end and loss < least:
                least, best, new = loss, self.y.astype(np.int64), codes
            differences.rounded_step(self.anchors, self._iterate(length), gradient[:count], ROUNDING_OFFSET, mask)
            self.new.step(self.parameters[count:], gradient[count:], self.scale)
            self._decoded()
        self._rest(np.zeros(count, np.bool_), *objectives)
        self.y = best.astype(np.float64)
        removed = self._added_by_removal(self._decoded(), new) < self.settings.worth
        return best, removed, new.take(np.flatnonzero((new.colors != 0).any(axis=1)))

    def _added_by_removal(self, state: I8, new: IntraCodes) -> F8:
        """What the squared error would rise by without each splat of a state (N, 8) alone, (N,) f8 in D^2.

        The error is quadratic in a splat's color n: |n|^2 - n . gradient; a splat outside the frame adds nothing.
        """
        parameters = np.concatenate([parameters_of(state), parameters_of(intra_state(new, self.frame.step))])
        _, gradient = self.frame.objective.evaluate(parameters)
        by_n = gradient_by_coordinates(parameters, gradient)[: self.count, 5:] * self.scale
        n = state[:, 5:] / 16
        added = n * (n - by_n) / (self.D * self.D)
        return np.where(self._outside(parameters), 0.0, (added[:, 0] + added[:, 1]) + added[:, 2])

    def _outside(self, parameters: F4) -> NDArray[np.bool_]:
        """Which splats lie outside the frame with all of their deviations up to CUTOFF, (N,) bool."""
        x, y, l11, l21, l22 = parameters[: self.count, :5].astype(np.float64).T
        wide, high = CUTOFF * l11, CUTOFF * np.sqrt(l21 * l21 + l22 * l22)
        return np.asarray((x < -wide) | (x > self.width + wide) | (y < -high) | (y > self.height + high))
