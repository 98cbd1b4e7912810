"""Steps of training (spec.md 10.2 to 10.4, 10.7 and 10.8)."""

from typing import Final

import numpy as np
import pyopencl as cl

from gsvc_conformance.adapters.opencl.device import (
    Array,
    Floats,
    Values,
    buffer,
    download,
    groups,
    lanes,
    launch,
    upload,
)

DECAY: Final = np.dtype([(name, "f4") for name in ("beta1", "beta2", "beta3", "rest1", "rest2", "rest3", "epsilon")])
"""Decay of training.cl."""


def loss(picture: Floats, target: Floats) -> Values:
    """The loss of a picture, () f8, and dL/dC, (H, W, 3) f4: R-10.2-1."""
    samples, pixels = picture.size, float(picture.shape[0] * picture.shape[1])
    residual, partial = buffer(4 * samples), buffer(4 * groups(samples))
    images = upload(picture, "f4"), upload(target, "f4")
    launch("loss", samples, *images, np.uint64(samples), pixels, residual, partial)
    return {
        "loss": total(partial, groups(samples), pixels),
        "residual": download(residual, picture.shape, "f4"),
    }


def total(partial: cl.Buffer, count: int, divisor: float) -> Array:
    """The sums of work-groups, added up on the device and divided: () f8."""
    result = buffer(4)
    launch("sum_partial", lanes(), partial, count, divisor, result)
    return download(result, (), "f4").astype("f8")


def weighted_parameters(values: Floats) -> Values:
    """The parameters that splats with weights are rendered by, (N, 8) f4: (10-10)."""
    parameters = buffer(32 * len(values))
    launch("weighted_parameters", len(values), upload(values, "f4"), len(values), parameters, exact=True)
    return {"parameters": download(parameters, (len(values), 8), "f4")}


def weighted_gradients(values: Floats, gradients: Floats) -> Values:
    """The gradients of colours and weights from those of their products, (N, 9) f4: (10-11)."""
    result = buffer(36 * len(values))
    launch("weighted_gradients", len(values), upload(values, "f4"), upload(gradients, "f4"), len(values), result)
    return {"gradients": download(result, values.shape, "f4")}


def adan_step(
    parameters: Floats, gradients: Floats, m: Floats, v: Floats, n: Floats, previous: Floats, steps: Array,
    rates: Floats, units: Floats, beta1: float, beta2: float, beta3: float, epsilon: float,
) -> Values:  # fmt: skip
    """One step of Adan, in place on the device: R-10.4-2.

    What follows from the decay rates and a row's number of steps is formed here, in binary64 (10.4). In training all
    rows that were added together share their k: there these are a few numbers an iteration, and the state stays on
    the device.
    """
    betas = np.array([beta1, beta2, beta3])
    correction = np.ones((len(steps), 4))
    correction[:, :3] = 1 / (1 - betas ** (steps[:, None] + 1))
    correction[:, 3] = steps > 0
    decay = np.array((*betas, *(1 - betas), epsilon), DECAY)
    state = {"parameters": parameters, "m": m, "v": v, "n": n, "previous": previous}
    there = {name: upload(array, "f4") for name, array in state.items()}
    moments = there["m"], there["v"], there["n"], there["previous"]
    launch(
        "adan_step", parameters.size, there["parameters"], upload(gradients, "f4"), *moments,
        upload(correction, "f4"), upload(rates, "f4"), upload(units, "f4"), parameters.shape[1],
        np.uint64(parameters.size), decay,
    )  # fmt: skip
    return {name: download(there[name], parameters.shape, "f4") for name in state} | {"steps": steps + 1}


def prune(weights: Floats, removed: int) -> Values:
    """The splats that stay when those of least weight leave, (n,) i8: R-10.7-2."""
    count = len(weights)
    keys, survivors = buffer(4 * count), buffer(8 * (count - removed))
    launch("prune_keys", count, upload(weights, "f4"), count, keys)
    launch("prune", lanes(), keys, count, removed, survivors)
    return {"survivors": download(survivors, (count - removed,), "i8")}


def compact(
    survivors: Array, values: Floats, m: Floats, v: Floats, n: Floats, previous: Floats, steps: Array
) -> Values:
    """The rows of the survivors, in their order: R-10.7-3."""
    count, columns = len(survivors), values.shape[1]
    chosen = upload(survivors, "i8")

    def rows_of(array: Floats) -> Array:
        left = buffer(4 * count * columns)
        launch("compact", count * columns, upload(array, "f4"), chosen, columns, np.uint64(count * columns), left)
        return download(left, (count, columns), "f4")

    state = {"values": values, "m": m, "v": v, "n": n, "previous": previous}
    return {name: rows_of(array) for name, array in state.items()} | {"steps": steps[survivors]}


def augment(values: Floats, uniforms: Floats, width: int, height: int) -> Values:
    """Random splats of small weight after the old ones, (M, 9) f4: R-10.8-1."""
    new = buffer(36 * len(uniforms))
    launch(
        "augment", len(uniforms), upload(uniforms, "f4"), len(uniforms), float(width), float(height), new, exact=True
    )
    return {"values": np.concatenate([values, download(new, (len(uniforms), 9), "f4")])}
