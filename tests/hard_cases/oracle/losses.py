"""The loss and the gradients of weights in 60 digits, from (10-1), (10-2), (10-10) and (10-11)."""

from collections.abc import Mapping

import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from tests.hard_cases.measuring import Truth, exactly, precise

F4 = NDArray[np.float32]


@precise
def loss(picture: F4, target: F4) -> Mapping[str, Truth]:
    """(10-1) and (10-2)."""
    pixels = picture.shape[0] * picture.shape[1]
    clamped = np.minimum(np.maximum(exactly(picture), mpf(0)), mpf(1))
    difference = clamped - exactly(target)
    total = np.array(sum((difference * difference).flat) / pixels, object)
    return {"loss": Truth(total), "residual": Truth(2 * difference / pixels)}


@precise
def weighted_gradients(values: F4, gradients: F4) -> Mapping[str, Truth]:
    """(10-11)."""
    value, given = exactly(values), exactly(gradients)
    w, by_product = value[:, 8:], given[:, 5:]
    of_weight = np.sum(by_product * value[:, 5:8], axis=1, keepdims=True)
    return {"gradients": Truth(np.concatenate([given[:, :5], w * by_product, of_weight], axis=1))}


@precise
def weighted_parameters(values: F4) -> Mapping[str, Truth]:
    """(10-10): the product is rounded to the nearest multiple of its last place, ties to even."""
    value = exactly(values)
    products = value[:, 5:8] * value[:, 8:]
    rounded = np.array([_to_binary32(product) for product in products.flat], object).reshape(products.shape)
    return {"parameters": Truth(np.concatenate([value[:, :5], rounded], axis=1))}


def _to_binary32(value: mpf) -> mpf:
    """fl(value) of a number below 2^128, subnormal ones included."""
    if value == 0:
        return mpf(0)
    _, mantissa, exponent, bits = value._mpf_
    last = max(exponent + bits - 24, -149)  # exponent of the last place
    if exponent >= last:
        return value
    whole, part = divmod(mantissa, 1 << (last - exponent))
    half = 1 << (last - exponent - 1)
    whole += part > half or (part == half and whole % 2 == 1)
    return mpf(whole) * mpf(2) ** last * (1 if value > 0 else -1)
