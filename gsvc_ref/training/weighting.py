"""The weights w of splats in training (paper section 3.4): they are rendered with the colours w c'.

A splat in training is a row of nine values: the columns of `Splats.to_array`, then w.
"""

import numpy as np

from gsvc_base.arrays import F4
from gsvc_base.checks import door
from gsvc_base.splats import PARAMETERS_PER_SPLAT
from gsvc_ref._jit import kernel

WEIGHT = PARAMETERS_PER_SPLAT
"""The column of w."""


# twin of spec.weighted_parameters
@door
def weighted_parameters(values: F4) -> F4:
    """The parameters that are rendered of splats with weights: colours are w c' (10-10); R-10.3-2.

    Parameters
    ----------
    values
        (N, 9) f4, the splats in training.

    Returns
    -------
    F4
        (N, 8).
    """
    parameters = np.empty((len(values), PARAMETERS_PER_SPLAT), np.float32)
    _weighted_parameters(values, parameters)
    return parameters


# twin of spec.weighted_gradients
@door
def weighted_gradients(values: F4, gradients: F4) -> F4:
    """The gradients of colours and weights from those of their products (10-11); R-10.3-2.

    Parameters
    ----------
    values
        (N, 9) f4, the splats in training.
    gradients
        (N, 8) f4, dL/dparameters of `weighted_parameters`.

    Returns
    -------
    F4
        (N, 9), dL/dvalues.
    """
    result = np.empty_like(values)
    _weighted_gradients(values, gradients, result)
    return result


@kernel()
def _weighted_parameters(values: F4, parameters: F4) -> None:
    """Fill parameters (N, 8) f4 from values (N, 9) f4."""
    for n in range(values.shape[0]):
        for k in range(5):
            parameters[n, k] = values[n, k]
        for k in range(5, 8):
            parameters[n, k] = values[n, k] * values[n, 8]  # (10-10)


@kernel()
def _weighted_gradients(values: F4, gradients: F4, result: F4) -> None:
    """Fill dL/dvalues (N, 9) f4 from dL/dparameters (N, 8) f4; dL/dw adds red and green first, then blue."""
    for n in range(values.shape[0]):
        for k in range(5):
            result[n, k] = gradients[n, k]
        for k in range(5, 8):
            result[n, k] = values[n, 8] * gradients[n, k]  # (10-11)
        by_weight = gradients[n, 5] * values[n, 5] + gradients[n, 6] * values[n, 6]
        result[n, 8] = by_weight + gradients[n, 7] * values[n, 7]
