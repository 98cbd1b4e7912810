"""A hundred thousand steps of Adan as they get written; each from 0, with the authors' decay rates."""

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.training.adan import AdanSettings

F4 = NDArray[np.float32]


def parameters_in_half(gradients: F4, rate: float, settings: AdanSettings) -> float:
    """Parameters in binary16, with averages that are exact: for a constant gradient the update is 1."""
    theta, step = np.float16(0), np.float16(rate * np.sign(gradients[0]))
    for _ in range(len(gradients)):
        theta = np.float16(theta - step)
    return float(theta)


def without_epsilon(gradients: F4, rate: float, settings: AdanSettings) -> float:
    """The quotient of averages alone, which for gradients of 0 is that of the first step."""
    with np.errstate(invalid="ignore"):
        return float(-rate * gradients[0] / abs(gradients[0]))


def difference_to_nothing(gradients: F4, rate: float, settings: AdanSettings) -> float:
    """In binary64, but the first difference is taken against a gradient of 0."""
    b1, b2, b3 = settings.beta1, settings.beta2, settings.beta3
    theta = m = v = n = p = 0.0
    p1 = p2 = p3 = 1.0
    for g in gradients.tolist():
        m, v = b1 * m + (1 - b1) * g, b2 * v + (1 - b2) * (g - p)
        n = b3 * n + (1 - b3) * (g + b2 * (g - p)) ** 2
        p1, p2, p3 = p1 * b1, p2 * b2, p3 * b3
        theta -= rate * (m / (1 - p1) + b2 * v / (1 - p2)) / ((n / (1 - p3)) ** 0.5 + settings.epsilon)
        p = g
    return theta


def plain_sums(gradients: F4, rate: float, settings: AdanSettings) -> float:
    """In binary32, with sums that are divided by their weights at the end: M = b M + g, for m = (1 - b) M."""
    b1, b2, b3 = (np.float32(b) for b in (settings.beta1, settings.beta2, settings.beta3))
    theta = M = V = N = np.float32(0)
    weights, p = [0.0, 0.0, 0.0], gradients[0]
    with np.errstate(over="ignore", invalid="ignore"):
        for g in gradients:
            M, V = b1 * M + g, b2 * V + (g - p)
            N = b3 * N + (g + b2 * (g - p)) ** 2
            weights = [
                b * w + 1 for b, w in zip((settings.beta1, settings.beta2, settings.beta3), weights, strict=True)
            ]
            below = np.sqrt(N / np.float32(weights[2])) + np.float32(settings.epsilon)
            theta -= np.float32(rate) * (M / np.float32(weights[0]) + b2 * V / np.float32(weights[1])) / below
            p = g
    return float(theta)
