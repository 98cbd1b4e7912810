"""How preset `quick` fits splats of profile `paper`: by the L-BFGS of profile `main`, in place of Adan.

The paper's quantisers follow, with a short fine-tuning. They have one scale for the factors of all splats, so here the
shapes of splats keep within the bounds of `walk`.
"""

from typing import Final

import numpy as np
from numpy.random import Generator

from gsvc_base.arrays import F4, F8, I8
from gsvc_ref.encoder.main.intra import grow
from gsvc_ref.encoder.main.settings import IntraSettings
from gsvc_ref.encoder.main.target import Target
from gsvc_ref.training import NEW, Growth
from gsvc_ref.training.coordinates import to_coordinates, to_parameters
from gsvc_ref.training.walk import Walk, add_pull

GROWING: Final = 0.75
"""The share of the evaluations of an I-frame in which splats are added."""

GROWTH: Final = Growth(end=0.45)
"""When splats are added in these, as in profile `main`."""

PULL: Final = 0.01
"""The pull of a P-frame's splats towards where they began, as a share of the metric (`add_pull`): without it bits go to
directions that gain next to nothing."""

GRADIENT_SHARE: Final = 0.5
"""The share of its gradient's term by which a splat is judged before it is removed: a fit makes up for the rest. On 30
frames of `carphone` and `bikes` at N = 700 1/4 and 1/2 gave the same within 0.2 dB; 1 took 0.4 dB from `carphone`."""


def grown(target: Target, total: int, iterations: int, rng: Generator) -> F4:
    """Splats (total, 8) f4 of an I-frame: they are added where the picture is worst, and then all descend."""
    growing = max(1, round(GROWING * iterations))
    z = grow(target, total, rng, IntraSettings(grow=growing, growth=GROWTH))
    return _descended(target, z, np.zeros(len(z)), iterations - growing)


def refitted(target: Target, parameters: F4, origins: I8, iterations: int) -> F4:
    """Splats (N, 8) f4 of a P-frame after their descent; the pull holds those that the frame before has."""
    return _descended(target, to_coordinates(parameters), np.where(origins == NEW, 0.0, PULL), iterations)


def exchanged(target: Target, parameters: F4, kept: int, new: int, rng: Generator) -> tuple[F4, I8]:
    """The splats that a P-frame begins with: the `kept` of most worth, then `new` ones where the picture is worst.

    Removing a splat of the colour n changes the squared error by |n|^2 - n . dE/dn. The second term is large where a
    splat shows what the picture no longer has.

    Parameters
    ----------
    target
        The picture.
    parameters
        (N, 8) f4, the splats of the frame before.
    kept, new
        How many of these stay, and how many are added.
    rng
        Draws the places of new splats.

    Returns
    -------
    parameters
        (kept + new, 8) f4.
    origins
        (kept + new,) i8: the index of each in the frame before, or NEW.
    """
    _, gradient = target.evaluate(parameters)
    colors = to_coordinates(parameters)[:, 5:8]  # (N, 3) f8
    worth = (colors * (colors - GRADIENT_SHARE * gradient[:, 5:8])).sum(axis=1)
    stay = np.sort(np.argsort(-worth, kind="stable")[:kept])
    added = to_parameters(target.new_splats(new, kept + new, rng)) if new else parameters[:0]
    return np.concatenate([parameters[stay], added]), np.concatenate([stay, np.full(new, NEW)])


def _descended(target: Target, z: F8, pull: F8, iterations: int) -> F4:
    """The best of the splats on the way down from coordinates z (N, 8), each with its pull (N,) towards them."""
    walk, start = Walk(len(z)), z
    for _ in range(iterations):
        error, gradient = target.evaluate(to_parameters(z))
        error += add_pull(z, start, pull, gradient)
        z = walk.next(z, error, gradient)
    return to_parameters(z if walk.best is None else walk.best[1])
