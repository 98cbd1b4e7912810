"""The operations of spec.md that training does step by step, each as one function of its inputs."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gsvc_base.arrays import F4, F8, I8
from gsvc_base.checks import door
from gsvc_base.errors import UsageError
from gsvc_ref.training.adan import Adan, AdanSettings
from gsvc_ref.training.convergence import Convergence
from gsvc_ref.training.schedule import StepDecay


class AdanStep(NamedTuple):
    """The parameters and the state of the optimiser after a step."""

    parameters: F4
    """(N, P), as the rest but `steps`."""
    m: F4
    v: F4
    n: F4
    previous: F4
    steps: I8
    """(N,)"""


# twin of spec.learning_rates
@door
def learning_rates(iterations: ArrayLike, rate: float, factor: float, interval: int) -> F8:
    """The learning rates of iterations, which are counted from 0, by `StepDecay` (10-12); R-10.4-1.

    Parameters
    ----------
    iterations
        (K,) i8.
    rate
        The rate of iteration 0.
    factor, interval
        As in `StepDecay`.

    Returns
    -------
    F8
        (K,).

    Raises
    ------
    UsageError
        The factor or the interval is out of its range.
    """
    schedule = StepDecay(factor, interval)
    return np.array([rate * schedule(int(iteration)) for iteration in np.asarray(iterations)], np.float64)


# twin of spec.adan_step
@door
def adan_step(
    parameters: ArrayLike,
    gradients: ArrayLike,
    m: ArrayLike,
    v: ArrayLike,
    n: ArrayLike,
    previous: ArrayLike,
    steps: ArrayLike,
    rates: ArrayLike,
    units: ArrayLike,
    beta1: float,
    beta2: float,
    beta3: float,
    epsilon: float,
) -> AdanStep:
    """One step of `Adan` from a given state, which is not changed: (10-13) and (10-14); R-10.4-2.

    Parameters
    ----------
    parameters, gradients
        (N, P) f4.
    m, v, n, previous
        (N, P) f4, the averages and the gradient of the step before.
    steps
        (N,) i8, the number of steps that each row has taken.
    rates, units
        (P,) f4, learning rates, and parameter = unit * learned value.
    beta1, beta2, beta3, epsilon
        As in `AdanSettings`.

    Returns
    -------
    AdanStep
        New arrays.

    Raises
    ------
    UsageError
        A shape does not fit, a number is out of its range, or a gradient is NaN or too large.
    """
    moved = np.array(parameters, np.float32, order="C")
    if moved.ndim != 2:
        raise UsageError(f"parameters has shape {moved.shape}; it must be (N, P)")
    given = {"m": m, "v": v, "n": n, "previous": previous}
    state = {name: np.array(part, np.float32, order="C") for name, part in given.items()}
    taken = np.array(steps, np.int64)
    for name, part in state.items():
        if part.shape != moved.shape:
            raise UsageError(f"{name} has shape {part.shape}; it must be that of parameters, {moved.shape}")
    if taken.shape != moved.shape[:1]:
        raise UsageError(f"steps has shape {taken.shape}; it must be {moved.shape[:1]}, one for each row")
    adan = Adan(0, moved.shape[1], AdanSettings(beta1, beta2, beta3, epsilon)).with_state(**state, steps=taken)
    adan.step(moved, np.asarray(gradients, np.float32), rates, units=units)
    return AdanStep(moved, *adan.state)


# twin of spec.converged
@door
def converged(losses: ArrayLike, patience: int, tolerance: float) -> int:
    """The iteration, from 1, after which training stops by `Convergence` (10-31), or 0; R-10.10-1.

    Parameters
    ----------
    losses
        (K,) f8, the loss of each iteration.
    patience, tolerance
        As in `Convergence`.

    Returns
    -------
    int
        0 if training goes on.

    Raises
    ------
    UsageError
        A number is out of its range, or a loss is NaN.
    """
    test = Convergence(patience, tolerance).start()
    stops = (number for number, loss in enumerate(np.asarray(losses).tolist(), 1) if test.update(loss))
    return next(stops, 0)
