"""Steps of training (spec.md 10.2 to 10.4, 10.7 and 10.8)."""

from typing import Final

import numpy as np

from gsvc_conformance.adapters.cuda.device import Array, Buffer, Floats, Values, download, launch, storage, upload

THREADS: Final = 256
"""Threads of a block of training.cu and quantization.cu."""

DECAY: Final = np.dtype([(name, "f4") for name in ("beta1", "beta2", "beta3", "rest1", "rest2", "rest3", "epsilon")])
"""Decay of training.cu."""


def blocks(items: int) -> int:
    """The blocks that have a thread for each item."""
    return -(-items // THREADS)


def total(losses: Buffer, count: int, divisor: int) -> Array:
    """The sums of so many blocks, added up and divided: () f8."""
    told = storage(8)
    launch("add_losses", 1, THREADS, losses, count, np.float64(1 / divisor), None, told)
    return download(told, (), "f8")


def loss(picture: Floats, target: Floats) -> Values:
    """The loss of a picture, () f8, and dL/dC, (H, W, 3) f4: R-10.2-1."""
    samples, pixels = picture.size, picture.shape[0] * picture.shape[1]
    residual, losses = storage(4 * samples), storage(8 * blocks(samples))
    images = upload(picture, "f4"), upload(target, "f4")
    launch("loss", blocks(samples), THREADS, *images, np.int64(samples), float(pixels), residual, losses)
    return {"loss": total(losses, blocks(samples), pixels), "residual": download(residual, picture.shape, "f4")}


def weighted_parameters(values: Floats) -> Values:
    """The parameters that splats with weights are rendered by, (N, 8) f4: (10-10)."""
    count = len(values)
    parameters = storage(32 * count)
    launch("weighted_parameters", blocks(count), THREADS, upload(values, "f4"), count, parameters, exact=True)
    return {"parameters": download(parameters, (count, 8), "f4")}


def weighted_gradients(values: Floats, gradients: Floats) -> Values:
    """The gradients of colours and weights from those of their products, (N, 9) f4: (10-11)."""
    count = len(values)
    result = storage(36 * count)
    launch("weighted_gradients", blocks(count), THREADS, upload(values, "f4"), upload(gradients, "f4"), count, result)
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
    corrections = np.ones((len(steps), 4))
    corrections[:, :3] = 1 / (1 - betas ** (steps[:, None] + 1))
    corrections[:, 3] = steps > 0
    decay = np.array((*betas, *(1 - betas), epsilon), DECAY)[()]
    state = {"parameters": parameters, "m": m, "v": v, "n": n, "previous": previous}
    there = {name: upload(array, "f4") for name, array in state.items()}
    moments = there["m"], there["v"], there["n"], there["previous"]
    launch(
        "adan_step", blocks(parameters.size), THREADS, there["parameters"], upload(gradients, "f4"), *moments,
        upload(corrections, "f4"), upload(rates, "f4"), upload(units, "f4"), parameters.shape[1],
        np.int64(parameters.size), decay,
    )  # fmt: skip
    return {name: download(there[name], parameters.shape, "f4") for name in state} | {"steps": steps + 1}


def prune(weights: Floats, removed: int) -> Values:
    """The splats that stay when those of least weight leave, (n,) i8: R-10.7-2."""
    count = len(weights)
    survivors = storage(8 * (count - removed))
    launch("prune", 1, THREADS, upload(weights, "f4"), count, removed, survivors)
    return {"survivors": download(survivors, (count - removed,), "i8")}


def compact(
    survivors: Array, values: Floats, m: Floats, v: Floats, n: Floats, previous: Floats, steps: Array
) -> Values:
    """The rows of the survivors, in their order: R-10.7-3."""
    count, columns = len(survivors), values.shape[1]
    chosen = upload(survivors, "i8")

    def rows_of(array: Floats) -> Array:
        left, size = storage(4 * count * columns), count * columns
        launch("compact", blocks(size), THREADS, upload(array, "f4"), chosen, columns, np.int64(size), left)
        return download(left, (count, columns), "f4")

    state = {"values": values, "m": m, "v": v, "n": n, "previous": previous}
    return {name: rows_of(array) for name, array in state.items()} | {"steps": steps[survivors]}


def augment(values: Floats, uniforms: Floats, width: int, height: int) -> Values:
    """Random splats of small weight after the old ones, (M, 9) f4: R-10.8-1."""
    count = len(uniforms)
    new = storage(36 * count)
    frame = float(width), float(height)
    launch("augment", blocks(count), THREADS, upload(uniforms, "f4"), count, *frame, new, exact=True)
    return {"values": np.concatenate([values, download(new, (count, 9), "f4")])}
