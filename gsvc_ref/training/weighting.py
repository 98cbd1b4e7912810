"""The weights w of splats in training (paper section 3.4): rendered are w c', and gradients come back through that.

A splat in training is a row of nine values: the columns of `Splats.to_array`, then w. The functions named `..._plain`
are the definitions (R-10.3-2), the kernels their twins, bit for bit.
"""

import numpy as np

from gsvc_ref._jit import kernel
from gsvc_ref.splats import F4, PARAMETERS_PER_SPLAT
from gsvc_ref.training.pruning import fold_weights

COLOR = slice(5, 8)
"""The columns of c'."""

WEIGHT = PARAMETERS_PER_SPLAT
"""The column of w."""


def rendered_plain(values: F4) -> F4:
    """What is rendered, (N, 8) f4, of the values (N, 9) f4: colours are w c'."""
    parameters = values[:, :PARAMETERS_PER_SPLAT].copy()
    parameters[:, COLOR] = fold_weights(values[:, COLOR], values[:, WEIGHT])  # (10-10)
    return parameters


def grad_rendered_plain(values: F4, grad_parameters: F4) -> F4:
    """dL/dvalues (N, 9) f4 from dL/dparameters (N, 8) f4: with G = dL/d(w c'),  dL/dc' = w G,  dL/dw = G . c'."""
    G, c, w = grad_parameters[:, COLOR], values[:, COLOR], values[:, WEIGHT]
    products = G * c
    by_weight = (products[:, 0] + products[:, 1]) + products[:, 2]
    return np.concatenate([grad_parameters[:, :5], w[:, None] * G, by_weight[:, None]], axis=1)  # (10-11)


def rendered(values: F4) -> F4:
    """`rendered_plain`, fast."""
    parameters = np.empty((len(values), PARAMETERS_PER_SPLAT), np.float32)
    _rendered(values, parameters)
    return parameters


def grad_rendered(values: F4, grad_parameters: F4) -> F4:
    """`grad_rendered_plain`, fast."""
    gradient = np.empty_like(values)
    _grad_rendered(values, grad_parameters, gradient)
    return gradient


@kernel()
def _rendered(values: F4, parameters: F4) -> None:
    for n in range(values.shape[0]):
        for k in range(5):
            parameters[n, k] = values[n, k]
        for k in range(5, 8):
            parameters[n, k] = values[n, k] * values[n, 8]  # (10-10)


@kernel()
def _grad_rendered(values: F4, grad_parameters: F4, gradient: F4) -> None:
    for n in range(values.shape[0]):
        for k in range(5):
            gradient[n, k] = grad_parameters[n, k]
        for k in range(5, 8):
            gradient[n, k] = values[n, 8] * grad_parameters[n, k]  # (10-11)
        by_weight = grad_parameters[n, 5] * values[n, 5] + grad_parameters[n, 6] * values[n, 6]
        gradient[n, 8] = by_weight + grad_parameters[n, 7] * values[n, 7]
