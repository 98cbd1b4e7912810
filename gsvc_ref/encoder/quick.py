"""How preset `quick` fits splats of profile `paper`: by the L-BFGS of profile `main`, in place of Adan.

The paper's quantisers follow, with a short fine-tuning.
"""

from typing import Final

import numpy as np
from numpy.random import Generator

from gsvc_base.arrays import F4, I8
from gsvc_ref.encoder.main.coordinates import to_coordinates, to_parameters
from gsvc_ref.encoder.main.descent import Walk
from gsvc_ref.encoder.main.fitter import FIT_D, descend, fit
from gsvc_ref.encoder.main.target import Target
from gsvc_ref.training import NEW

PRUNED_GRADIENT_SHARE: Final = 0.5
"""The share of its gradient's term by which a splat is judged before it is removed: a fit compensates the rest. On 30
frames of `carphone` and `bikes` at N = 700 1/4 and 1/2 gave the same within 0.2 dB; 1 took 0.4 dB from `carphone`."""


def grown(target: Target, total: int, iterations: int, rng: Generator) -> F4:
    """Splats (total, 8) f4 of an I-frame: they are added where the picture is worst, and descend together."""
    return to_parameters(fit(target, total, rng, iterations))


def refitted(target: Target, parameters: F4, iterations: int) -> F4:
    """Splats (N, 8) f4 of a P-frame after their descent."""
    z = to_coordinates(parameters)
    return to_parameters(descend(target, z, Walk(len(z), FIT_D), iterations))


def exchanged(
    target: Target,
    parameters: F4,  # (N, 8) f4, the splats of the frame before
    kept: int,
    new: int,
    rng: Generator,
) -> tuple[F4, I8]:
    """The start of a P-frame: the `kept` splats of most worth, then `new` ones where the picture is worst.

    Returns the splats (kept + new, 8) f4, and the index of each in the frame before, or NEW, (kept + new,) i8. Removing
    a splat of the colour n changes the squared error by |n|^2 - n . dE/dn. The second term is large where a splat shows
    what the picture no longer has.
    """
    _, gradient = target.evaluate(parameters)
    colors = to_coordinates(parameters)[:, 5:8]  # (N, 3) f8
    worth = (colors * (colors - PRUNED_GRADIENT_SHARE * gradient[:, 5:8])).sum(axis=1)
    stay = np.sort(np.argsort(-worth, kind="stable")[:kept])
    added = to_parameters(target.new_splats(new, kept + new, rng)) if new else parameters[:0]
    return np.concatenate([parameters[stay], added]), np.concatenate([stay, np.full(new, NEW)])
