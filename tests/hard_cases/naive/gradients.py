"""Gradients of splats by formulas that look right, in binary32."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance.operation import Values
from tests.hard_cases.naive.rendering import LN_255, covariance, forward_substitution, renderer

F4 = NDArray[np.float32]
HALF = np.float32(0.5)
STEP = np.float32(2**-10)


def _pixels(residual: F4) -> tuple[F4, F4]:
    height, width, _ = residual.shape
    return np.arange(width, dtype=np.float32) + HALF, np.arange(height, dtype=np.float32)[:, None] + HALF


def by_the_conic(parameters: F4, residual: F4) -> Values:
    """Gradients by the inverse covariance ((A, B), (B, C)), whose derivatives divide by the determinant squared."""
    gradients = np.zeros((len(parameters), 8), np.float32)
    px, py = _pixels(residual)
    for n, splat in enumerate(parameters):
        l11, l21, l22 = splat[2:5]
        if min(l11, l22) < 2.0**-126:
            continue
        a, b, c, D = covariance(splat)
        A, B, C = c / D, -b / D, a / D
        dx, dy = np.broadcast_arrays(px - splat[0], py - splat[1])
        sigma = A * dx * dx / 2 + B * dx * dy + C * dy * dy / 2
        g = np.where(sigma <= LN_255, np.exp(-sigma), np.float32(0))
        q = g * (residual @ splat[5:])
        of_A, of_B, of_C = -np.sum(q * dx * dx) / 2, -np.sum(q * dx * dy), -np.sum(q * dy * dy) / 2
        of_a = (-c * c * of_A + b * c * of_B - b * b * of_C) / (D * D)
        of_b = (2 * b * c * of_A - (a * c + b * b) * of_B + 2 * a * b * of_C) / (D * D)
        of_c = (-b * b * of_A + a * b * of_B - a * a * of_C) / (D * D)
        of_L = 2 * l11 * of_a + l21 * of_b, l11 * of_b + 2 * l21 * of_c, 2 * l22 * of_c
        of_x, of_y = np.sum(q * (A * dx + B * dy)), np.sum(q * (B * dx + C * dy))
        gradients[n] = of_x, of_y, *of_L, *np.einsum("hw,hwc->c", g, residual)
    return {"gradients": gradients}


def masked_by_product(parameters: F4, residual: F4) -> Values:
    """Every splat over every pixel, the moments u u multiplied by a weight that is 0 where it covers nothing."""
    return _by_moments(parameters, residual, np.float32)


def in_binary16(parameters: F4, residual: F4) -> Values:
    """The residual, its product with the colour and their sums in binary16."""
    return _by_moments(parameters, residual, np.float16)


def _by_moments(parameters: F4, residual: F4, kind: type[np.floating[Any]]) -> Values:
    gradients = np.zeros((len(parameters), 8), np.float32)
    px, py = _pixels(residual)
    e = residual.astype(kind)
    for n, (x, y, l11, l21, l22, *color) in enumerate(parameters):
        u1 = np.broadcast_to((px - x) / l11, residual.shape[:2])
        u2 = ((py - y) - l21 * u1) / l22
        sigma = (u1 * u1 + u2 * u2) / 2
        g = (np.exp(-sigma) * (sigma <= LN_255)).astype(kind)
        q = g * (e @ np.array(color).astype(kind))
        v2 = u2 / l22
        v1 = (u1 - l21 * v2) / l11
        sums = [np.sum((q * m).astype(kind)) for m in (v1, v2, v1 * u1, v2 * u1, v2 * u2)]
        gradients[n] = *sums, *np.sum(g[..., None] * e, axis=(0, 1), dtype=kind)
    return {"gradients": gradients}


def by_differences(parameters: F4, residual: F4) -> Values:
    """Central differences of sum(residual * C), 2^-10 to either side."""
    gradients = np.zeros((len(parameters), 8), np.float32)
    height, width, _ = residual.shape
    render_sum = renderer(forward_substitution)
    for n, column in np.ndindex(gradients.shape):
        ends = []
        for step in (STEP, -STEP):
            moved = parameters[n : n + 1].copy()
            moved[0, column] += step
            ends.append(np.sum(residual * render_sum(parameters=moved, width=width, height=height)["sum"]))
        gradients[n, column] = (ends[0] - ends[1]) / (2 * STEP)
    return {"gradients": gradients}
