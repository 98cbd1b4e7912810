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
from gsvc_ref.encoder.main.codes import INTRA_LIMITS, limits_of, nearest_codes
from gsvc_ref.encoder.main.coordinates import gradient_by_coordinates, to_parameters
from gsvc_ref.encoder.main.densities import choose_densities
from gsvc_ref.encoder.main.field import Field, best_field
from gsvc_ref.encoder.main.new_splats import CUTOFF, NewSplats, best_candidates
from gsvc_ref.encoder.main.settings import InterSettings
from gsvc_ref.encoder.main.target import SQUARE_OF_8_BITS
from gsvc_ref.main.cells import cell_order
from gsvc_ref.main.codes import GROUPS, SIDES, IntraCodes, MainCodes, modes_of
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.main.motion import field_motion
from gsvc_ref.main.reconstruct import add_differences, intra_state
from gsvc_ref.main.state import parameters_of
from gsvc_ref.main.tables import step_of
from gsvc_ref.rendering import Objective, SampledObjective

LENGTH: Final = 0.5  # the step of a splat in proximal descent is this over its crowding, within the next two
MIN_LENGTH: Final = 0.02
MAX_LENGTH: Final = 0.3

WORTH: Final = 1.0  # a splat is removed where the squared error does not rise by this many D^2 without it
NEW_GAIN: Final = 9.0  # a new splat must promise to take more than this off the squared error, in D^2
NEW_ENERGY: Final = 4.5  # new splats with an energy below this many D are dropped
NEW_SIZES: Final = (0.165, 0.33, 0.66)  # deviations of new splats to try, in mean distances of splats

MIN_NEW_SIZE: Final = 0.5
"""Smallest of them in pixels. The picture of a smaller splat on few pixels has more energy than the splat has in the
plane: below 0.4 px more than twice as much, so that taking it off the residual would make that larger."""

PRICE: Final = 0.9  # what a group costs that has any difference, in 2 D^2
FIRST_SHARE: Final = 0.3  # the price begins with this share of its final value

LOOK: Final = 10
"""Every so often, in iterations, proximal descent asks which splats rest, and whether more iterations are worth it."""

REST: Final = 0.25
"""A splat rests if it has no difference and the squared length of its next step is below this share of what would give
it one, in each group. Where little moves, descent takes half the time; on six clips the bits at equal PSNR stayed the
same within what seeds scatter by, with shares of 0.25 and 0.5."""

MAX_TIMES: Final = 6  # most iterations of proximal descent, in units of `InterSettings.iterations`
ADDITION: Final = 3  # new splats come after 1/3 of the iterations: the residual then shows what old ones cannot mend
PRUNING: Final = 2  # they go from 1/2 on: those that promise NEW_GAIN begin with 3 D, and need time for NEW_ENERGY
PRUNING_INTERVAL: Final = 5  # distance in iterations of the times when weak new splats are dropped
JUDGED: Final = 3  # the last 1/3 of the iterations with rounding sees all pixels: the best of them is kept
ROUNDING_OFFSET: Final = 0.4  # differences are rounded away from 0 from 1 - offset on


@dataclass(frozen=True)
class PFrame:
    """What a P-frame is made from."""

    state: MainState  # the decoder's, after the frame before
    objective: Objective  # of all pixels of the new picture
    sampled: SampledObjective  # of a lattice of its pixels in each turn
    picture_before: F4  # (H, W, 3), where the optical flow begins: the source of the frame before
    picture: F4  # (H, W, 3), the new source
    quantizer: int
    intra_splats: int  # the number of splats of an I-frame, of which new ones are a share
    previous: Field | None = None  # that of the frame before, if that is a P-frame

    @property
    def step(self) -> int:
        """D in 1/16."""
        return step_of(self.quantizer)


def encode_inter(frame: PFrame, settings: InterSettings) -> tuple[MainCodes, Field]:
    """The codes of a P-frame, and its field, which may come close to that of the next one."""
    state = frame.state
    reference, pictures = state.splats.to_array(), (frame.picture_before, frame.picture)
    inherited = field_motion(state.values, *state.inherited)
    field = best_field(frame.sampled, reference, inherited, pictures, frame.previous, settings, frame.step / 16)
    motion = field_motion(state.values, field.vectors, field.cell) if field.cell else inherited
    q, removed, new = _Updates(frame, motion, settings).codes()
    new = new.take(cell_order(new.cells, state.width, state.height))
    densities = None
    if len(new) and state.densities is None:  # no splat was in the last I-frame
        densities = choose_densities(new, frame.step, state.width, state.height)
    codes = MainCodes(
        frame.quantizer, type="P", motion_cell=SIDES.index(field.cell), new=new, densities=densities,
        vectors=field.vectors, modes=modes_of(q, removed), differences=np.where(removed[:, None], 0, q),
    )  # fmt: skip
    return codes, field


class _Updates:
    """The differences and new splats of one frame in the making."""

    def __init__(self, frame: PFrame, motion: I8, settings: InterSettings) -> None:
        self.frame, self.motion, self.settings, self.D = frame, motion, settings, frame.step / 16
        self.width, self.height = frame.objective.width, frame.objective.height
        pixels = self.width * self.height
        self.scale = pixels * SQUARE_OF_8_BITS  # loss to squared error
        self.anchors = differences.anchors_of(frame.state.values, motion, frame.step, pixels)
        parameters = to_parameters(self.anchors.z)
        length = np.clip(LENGTH / differences.crowding(parameters), MIN_LENGTH, MAX_LENGTH)
        q, y = np.zeros((2, len(motion), 8))
        self.at = differences.Iterate(q, y, parameters, length)
        self.new = NewSplats(np.empty((0, 8)), self.D, self.width, self.height)
        self.none = np.zeros(len(motion), np.bool_)
        self.idle = self.none  # the splats at rest, which the objectives hold

    def codes(self) -> tuple[I8, NDArray[np.bool_], IntraCodes]:
        """Descend, add, descend, round: the differences, which splats are removed, and the new ones."""
        s = self.settings
        losses: list[float] = []
        for iteration in range(MAX_TIMES * s.iterations):
            if iteration == s.iterations // ADDITION:
                self._add()
            if iteration > s.iterations // PRUNING and iteration % PRUNING_INTERVAL == 0:
                self.new.keep(NEW_ENERGY)
            losses.append(self._descend(iteration, PRICE * min(1.0, FIRST_SHARE + iteration / s.iterations)))
            if len(losses) >= s.iterations and len(losses) % LOOK == 0:
                before, last = sum(losses[-2 * LOOK : -LOOK]), sum(losses[-LOOK:])
                if last > (1 - s.progress) * before:
                    break
        self.new.keep(NEW_ENERGY)
        return self._round()

    def _descend(self, iteration: int, price: float) -> float:
        """One iteration of step 2, with the price of a group; the loss before it on the lattice of its turn."""
        looks = iteration > 0 and iteration % LOOK == 0
        if looks:
            self._rest(self.none, self.frame.sampled)
        new = to_parameters(self.new.z)
        loss, gradient, of_new = self._evaluate(new, iteration)
        resting = differences.idle(self.anchors, self.at, gradient, REST * price) if looks else self.idle
        differences.proximal_step(self.anchors, self.at, gradient, price)
        self.new.step(new, of_new, self.scale)
        if looks:
            self._rest(resting, self.frame.sampled)
        return loss

    def _add(self) -> None:
        """New splats where the picture of the parameters is wrong."""
        total, objective = self.frame.intra_splats, self.frame.objective
        objective.loss(self.at.parameters, drawn=True)
        mean = math.sqrt(self.width * self.height / max(total, 1))
        sizes = tuple(max(share * mean, MIN_NEW_SIZE) for share in NEW_SIZES)
        least, most = NEW_GAIN * self.D * self.D, math.floor(self.settings.new_share * total + 0.5)
        z = best_candidates(-objective.residual(), sizes, least, most, objective.threads)
        self.new = NewSplats(z, self.D, self.width, self.height)

    def _rest(self, resting: NDArray[np.bool_], *objectives: Objective | SampledObjective) -> None:
        """Let the splats (N,) bool rest, and no others; the objectives hold them as they are."""
        self.idle = resting
        for objective in objectives:
            objective.hold(self.at.parameters[self.idle])

    def _evaluate(self, new: F4, turn: int | None = None) -> tuple[float, F4, F4]:
        """The loss with new splats (n, 8) on the lattice of a turn, None: all pixels; its gradient by both kinds.

        The gradient (N, 8) is zero where splats rest.
        """
        moving = np.flatnonzero(~self.idle)
        parameters = np.concatenate([self.at.parameters[moving], new])
        if turn is None:
            loss, found = self.frame.objective.evaluate(parameters)
        else:
            loss, found = self.frame.sampled.evaluate(parameters, turn)
        gradient = np.zeros(self.at.parameters.shape, np.float32)
        gradient[moving] = found[: len(moving)]
        return loss, gradient, found[len(moving) :]

    def _decoded(self) -> I8:
        """The state (N, 8) that a decoder makes of the whole differences y; its parameters become those drawn."""
        state = add_differences(self.frame.state.values, self.motion, self.at.y.astype(np.int64), self.frame.step)
        self.at.parameters[:] = parameters_of(state)
        return state

    def _round(self) -> tuple[I8, NDArray[np.bool_], IntraCodes]:
        """Step 4."""
        last, step, at = self.settings.rounded_iterations, self.frame.step, self.at
        objectives = self.frame.sampled, self.frame.objective
        kept = self.frame.state.densities
        limits = limits_of(kept) if kept else INTRA_LIMITS
        mask = np.stack([(at.q[:, first:end] != 0).any(axis=1) for _, first, end in GROUPS], axis=1)
        whole = np.minimum(np.floor(np.abs(at.q) + ROUNDING_OFFSET), differences.MAX_DIFFERENCE)
        at.y[:] = np.sign(at.q) * whole
        at.length[:] /= 2
        self._decoded()
        self._rest(np.asarray((~mask).all(axis=1)), *objectives)
        least = math.inf
        for iteration in range(last + 1):
            left = last - iteration
            if iteration % PRUNING_INTERVAL == 0 and JUDGED * left >= last:
                self.new.keep(NEW_ENERGY)
            codes = nearest_codes(self.new.z, step, self.width, self.height, limits)
            drawn = parameters_of(intra_state(codes, step))
            is_near_end = JUDGED * left <= last
            loss, gradient, of_new = self._evaluate(drawn, None if is_near_end else iteration)
            if is_near_end and loss < least:
                least, best, new = loss, at.y.astype(np.int64), codes
            differences.rounded_step(self.anchors, at, gradient, ROUNDING_OFFSET, mask)
            self.new.step(drawn, of_new, self.scale)
            self._decoded()
        self._rest(self.none, *objectives)
        at.y[:] = best
        removed = self._added_by_removal(self._decoded(), new) < WORTH
        return best, removed, new.take(np.flatnonzero((new.colors != 0).any(axis=1)))

    def _added_by_removal(self, state: I8, new: IntraCodes) -> F8:
        """What the squared error would rise by without each splat of a state (N, 8) alone, (N,) f8 in D^2.

        The error is quadratic in a splat's color n: |n|^2 - n . gradient; a splat outside the frame adds nothing.
        """
        parameters = self.at.parameters
        _, gradient, _ = self._evaluate(parameters_of(intra_state(new, self.frame.step)))
        by_n = gradient_by_coordinates(parameters, gradient)[:, 5:] * self.scale
        n = state[:, 5:] / 16
        added = n * (n - by_n) / (self.D * self.D)
        return np.where(self._outside(parameters), 0.0, (added[:, 0] + added[:, 1]) + added[:, 2])

    def _outside(self, parameters: F4) -> NDArray[np.bool_]:
        """Which splats lie outside the frame with all of their deviations up to CUTOFF, (N,) bool."""
        x, y, l11, l21, l22 = parameters[:, :5].astype(np.float64).T
        wide, high = CUTOFF * l11, CUTOFF * np.sqrt(l21 * l21 + l22 * l22)
        return np.asarray((x < -wide) | (x > self.width + wide) | (y < -high) | (y > self.height + high))
