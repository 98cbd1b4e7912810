"""Rendering (section 9.1) as a function of tensors that autograd can differentiate."""

import math
from collections.abc import Iterator
from typing import Final

import numpy as np
import torch
from torch import Tensor
from torch.utils.checkpoint import checkpoint

from gsvc_conformance.adapters.pytorch.device import DEVICE, Array, Arrays, array, tensor
from gsvc_conformance.adapters.pytorch.tiles import TILE, Grid, TileLists, groups

LN_255: Final = 5.541263545158426

LARGEST: Final = torch.finfo(torch.float32).max

BATCH: Final = 8
"""Splats of one tile that are evaluated together; the last batch of a tile is filled up."""

BATCHES: Final = 2**9 if DEVICE.type == "cpu" else 2**13
"""Batches at once, of 8 x 256 numbers in each of a dozen arrays: few enough for caches, or enough to fill a GPU."""

NOWHERE: Final = (-1e9, -1e9, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""The splat that fills up batches: it covers no pixel of any frame."""


def render(parameters: Tensor, width: int, height: int) -> Tensor:
    """The sum C (9-2) of splats (N, 8) f4 over a frame, (H, W, 3) f4.

    Differentiable: autograd finds the gradients of 10.3. Memory does not grow with the splats of a pixel: what autograd
    needs is computed again in the backward pass, batch by batch.

    Sums go through `index_put_`, which is the backward pass of indexing, too: CUDA sorts for it. `index_add_`,
    `scatter_add_` and the backward pass of `index_select` add by float atomics in any order, and those of NVIDIA flush
    subnormal numbers. A gradient made of many of them would be 0, which (13-16) does not allow.
    """
    grid = Grid(width, height)
    pixels = torch.zeros(grid.tiles, TILE * TILE, 3, device=parameters.device)
    nowhere = torch.tensor([NOWHERE], device=parameters.device)
    for group, lists in groups(parameters.detach(), grid):
        splats = torch.cat((parameters[group], nowhere))
        for tile, members in _batches(lists):
            part = checkpoint(
                _batch_sums, splats, members, *grid.centers(tile), use_reentrant=False, preserve_rng_state=False
            )
            pixels.index_put_((tile,), part, accumulate=True)
    return grid.picture(pixels)


def _batches(lists: TileLists) -> Iterator[tuple[Tensor, Tensor]]:
    """The tiles (B,) and splats (B, 8) of some batches at a time; -1 fills up."""
    whole = (lists.count + BATCH - 1) // BATCH
    tile = torch.repeat_interleave(torch.arange(len(whole), device=whole.device), whole)
    within = torch.arange(len(tile), device=whole.device) - (torch.cumsum(whole, 0) - whole)[tile]
    step = torch.arange(BATCH, device=whole.device)
    for tiles, numbers in zip(torch.split(tile, BATCHES), torch.split(within, BATCHES), strict=True):
        place = BATCH * numbers[:, None] + step
        there = place < lists.count[tiles, None]
        pair = torch.where(there, lists.first[tiles, None] + place, 0)
        yield tiles, torch.where(there, lists.splats[pair], -1)


def _batch_sums(splats: Tensor, members: Tensor, columns: Tensor, rows: Tensor) -> Tensor:
    """The sum that each batch adds to the pixels of its tile, (B, 256, 3).

    Parameters
    ----------
    splats, members
        (n, 8) f4, the last one being `NOWHERE`, and which of them are in a batch, (B, 8) i8.
    columns, rows
        Pixel centres of the batch's tile, (B, 16) f4 each.
    """
    chosen = splats[members % len(splats)]  # (B, 8, 8); -1 becomes n - 1, `NOWHERE`
    x, y, l11, l21, l22 = chosen[:, :, :5, None, None].unbind(2)  # (B, 8, 1, 1) each
    d_x = columns[:, None, None, :] - x
    d_y = rows[:, None, :, None] - y
    # A pixel that is not covered has the gradient 0, but autograd multiplies this 0 by derivatives: if u1 or u2 were
    # infinite there, 0 · ∞ = NaN would reach the parameters. So both are kept within ±4, where σ is 8 or more.
    u1 = _bounded_quotient(d_x, l11)
    u2 = _bounded_quotient(d_y - l21 * u1, l22)
    sigma = (u1 * u1 + u2 * u2) / 2  # (9-1)
    g = torch.where(sigma <= LN_255, torch.exp(-sigma), 0.0)
    # (9-2), as a product of matrices: in binary32 as long as nobody allows TF32 (set_float32_matmul_precision).
    return g.flatten(2).transpose(1, 2) @ chosen[:, :, 5:]


def _bounded_quotient(a: Tensor, b: Tensor) -> Tensor:
    """The quotient a / b, rounded once, or ±4 where it is beyond; there it has no gradient.

    For the derivative by b autograd has (a / b) / b: 0 for a = 1 and b = 10^30, although it is then multiplied with
    gradients of 10^30. So b / b = 1 takes the derivative instead: first (a / b) times the gradient is summed over the
    pixels, then the sum is divided by b.
    """
    unit = b.detach()
    limit = (4 * unit).clamp(max=LARGEST)
    return (torch.clamp(a, -limit, limit) / unit) * (unit / b)


def render_sum(parameters: Array, width: int, height: int) -> Arrays:
    """Operation: (9-2) over a frame."""
    with torch.no_grad():
        return {"sum": array(render(tensor(parameters), width, height), "f4")}


def render_gradients(parameters: Array, residual: Array) -> Arrays:
    """Operation: the gradient of sum(residual · C), a vector-Jacobian product of `render`."""
    height, width, _ = residual.shape
    splats = tensor(parameters).requires_grad_()
    picture = render(splats, width, height)
    if not picture.requires_grad:  # no splat reaches the frame
        return {"gradients": array(torch.zeros_like(splats), "f4")}
    (gradients,) = torch.autograd.grad(picture, splats, tensor(residual))
    return {"gradients": array(gradients, "f4")}


def quantized(picture: Tensor, bit_depth: int) -> Array:
    """R-9.1-1: clamp, scale, round half to even."""
    samples = torch.round(picture.clamp(0, 1) * (2**bit_depth - 1))
    return array(samples, "u1" if bit_depth == 8 else "u2")


def to_frame(sum: Array, bit_depth: int) -> Arrays:
    """Operation: R-9.1-1."""
    return {"frame": quantized(tensor(sum), bit_depth)}


def render_frame(parameters: Array, width: int, height: int, bit_depth: int) -> Arrays:
    """Operation: sum, clamp, scale, round."""
    with torch.no_grad():
        return {"frame": quantized(render(tensor(parameters), width, height), bit_depth)}


def scale_parameters_filtered(parameters: Array, width: int, height: int, new_width: int, new_height: int) -> Arrays:
    """Operation: the splats for a smaller frame (9-9); ratios and variances come from the host."""
    a, e = new_width / width, new_height / height
    h_x, h_y = (torch.tensor(_deviation(*sides), device=DEVICE) for sides in ((width, new_width), (height, new_height)))
    given = tensor(parameters)
    x, y, l11, l21, l22 = (given[:, :5] * tensor(np.array([a, e, a, e, e], np.float32))).unbind(1)
    m11 = torch.hypot(l11, h_x)
    m22 = torch.hypot(torch.hypot(l22, h_y), l21 * (h_x / m11))
    colors = given[:, 5:] * (l11 / m11 * (l22 / m22))[:, None]
    filtered = torch.cat((torch.stack((x, y, m11, l21 * (l11 / m11), m22), 1), colors), 1)
    unfiltered = torch.cat((torch.stack((x, y, l11, l21, l22), 1), given[:, 5:]), 1)
    drawn = (given[:, [2, 4]] >= torch.finfo(torch.float32).tiny).all(1)  # R-9.4-3
    return {"parameters": array(torch.where(drawn[:, None], filtered, unfiltered), "f4")}


def _deviation(old: int, new: int) -> float:
    return math.sqrt(max(0, old - new) * (old + new) / 12) / old
