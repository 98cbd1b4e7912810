"""Losses and gradients of weights by formulas that look right."""

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance.operation import Values

F4 = NDArray[np.float32]


def _of(picture: F4, total: np.floating, residual: F4) -> Values:
    pixels = picture.shape[0] * picture.shape[1]
    return {"loss": np.array(np.float64(total) / pixels), "residual": np.float32(2 / pixels) * residual}


def by_moments(picture: F4, target: F4) -> Values:
    """The sum of squares as sum x^2 - 2 sum x y + sum y^2, in binary32."""
    x = np.clip(picture, 0, 1)
    total = np.sum(x * x) - 2 * np.sum(x * target) + np.sum(target * target)
    return _of(picture, total, x - target)


def clamped_after_the_square(picture: F4, target: F4) -> Values:
    """The squared differences are clamped, not the sum."""
    difference = picture - target
    return _of(picture, np.sum(np.minimum(difference * difference, np.float32(1))), difference)


def in_binary16(values: F4, gradients: F4) -> Values:
    """Weights, colours and their gradients in binary16."""
    w, color, by_product = (part.astype(np.float16) for part in (values[:, 8:], values[:, 5:8], gradients[:, 5:]))
    of_weight = np.sum(color * by_product, axis=1, keepdims=True)
    return {"gradients": np.concatenate([gradients[:, :5], w * by_product, of_weight], axis=1).astype(np.float32)}


def flushed(values: F4) -> Values:
    """Products below 2^-126 become zero."""
    products = values[:, 5:8] * values[:, 8:]
    products[abs(products) < 2.0**-126] = 0
    return {"parameters": np.concatenate([values[:, :5], products], axis=1)}
