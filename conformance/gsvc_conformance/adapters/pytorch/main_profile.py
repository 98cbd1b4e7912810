"""Profile `main` (section 15): frequencies, classes, states and parameters, all splats at once, in integers of 64 bits.

The passes themselves are not here: a lane depends on itself, symbol by symbol, and tensors have no lanes.
"""

import math
from functools import cache
from typing import Final

import numpy as np
import torch
from torch import Tensor

from gsvc_conformance.adapters.pytorch.device import DEVICE, Array, Arrays, array, tensor

OCTAVE: Final = 1024
TOTAL: Final = 2**14
X_MOST, S_MOST, N_MOST, STEP_MOST = 2**24, 32767, 2**28, 2**17 - 1
A_LEAST, A_MOST = -3072, 13311
SIDES: Final = (0, 64, 32, 16)
K: Final = (42862, 52495, 30308)
"""MAIN_K."""
REACH: Final = 54544
FILTERS: Final = (0, 427, 953, 1953)
"""F_h of (5-2)."""


@cache
def _exp2_table() -> Tensor:
    """EXP2 (15.3): ten square roots are the root of order 1024, rounded down."""
    roots = []
    for i in range(OCTAVE):
        power = 1 << (16 * OCTAVE + i)
        for _ in range(10):
            power = math.isqrt(power)
        roots.append((power + 1) >> 1)
    return torch.tensor(roots, device=DEVICE)


def exp2(v: Tensor, k: int) -> Tensor:
    """(15-2)."""
    shift = (v >> 10) - 15 + k
    mantissa = _exp2_table()[v & (OCTAVE - 1)]
    return torch.where(shift >= 0, mantissa << shift.clamp(min=0), mantissa >> (-shift).clamp(0, 63))


@cache
def _families() -> Tensor:
    """LOGISTIC and LAPLACE, (15-3), (2, 257) i8."""
    tail = exp2(96 * (128 - torch.arange(1, 129, device=DEVICE)), 15)
    lower = torch.stack((2**31 // (2**15 + tail), 2**30 // tail))
    zero = torch.zeros_like(lower[:, :1])
    return torch.cat((zero, lower, 2**16 - lower[:, :-1].flip(1), zero + 2**16), 1)


def _step(quantizer: int) -> int:
    """D (15-4)."""
    return int(_exp2_table()[128 * (quantizer % 8)]) << (quantizer // 8) >> 12


def _classes(n: Tensor, step: int) -> Tensor:
    """(15-4): the thresholds that the energy reaches."""
    k = ((n.abs() + step // 2) // step).clamp(max=1024)
    thresholds = 2 ** (2 * torch.arange(1, 11, device=DEVICE) - 1)
    return torch.searchsorted(thresholds, (k * k).sum(1), right=True)


def _clipped(state: Tensor) -> Tensor:
    """R-15.4-1."""
    most = torch.tensor([X_MOST] * 2 + [A_MOST] * 2 + [S_MOST] + [N_MOST] * 3, device=DEVICE)
    least = torch.tensor([-X_MOST] * 2 + [A_LEAST] * 2 + [-S_MOST] + [-N_MOST] * 3, device=DEVICE)
    return torch.minimum(torch.maximum(state, least), most)


def density_frequencies(edges: Array, centre: int, density_family: int, scale_code: int, unit_bits: int) -> Arrays:
    """Operation: (15-6)."""
    return {"cumulative": array(_density(tensor(edges), centre, density_family, scale_code, unit_bits), "i8")}


def _density(edges: Tensor, centre: int, density_family: int, scale_code: int, unit_bits: int) -> Tensor:
    bins, T = len(edges) + 1, _families()[density_family]
    scale = int(_exp2_table()[-256 * scale_code % OCTAVE]) >> 2
    shift = 2 - -scale_code // 4 + unit_bits
    u = (2**15 + ((edges - 2 * centre) * scale >> shift)).clamp(0, 2**16 - 1)
    place = u >> 8
    v = T[place] + ((T[place + 1] - T[place]) * (u & 255) >> 8)
    inner = torch.arange(1, bins, device=DEVICE) + ((TOTAL - bins) * v >> 16)
    ends = torch.tensor([0, TOTAL], device=DEVICE)
    return torch.cat((ends[:1], inner, ends[1:]))


def window_frequencies(centre: int, step: int, density_family: int, scale_code: int) -> Arrays:
    """Operation: (15-7), and (15-6) of it."""
    scale = int(exp2(torch.tensor(256 * scale_code, device=DEVICE), 4))
    r = next(r for r in range(16) if 16 * scale <= 512 * (step << r))
    first, end = (centre - 8 * scale) // (step << r), -((-centre - 8 * scale) // (step << r)) + 1
    edges = (2 * (torch.arange(first + 1, end, device=DEVICE) << r) - 1) * step
    cumulative = _density(edges, centre, density_family, scale_code, 4)
    return {"cumulative": array(cumulative, "i8"), "first": np.array(first), "low_bits": np.array(r)}


def model_frequencies(counts: Array) -> Arrays:
    """Operation: (15-14)."""
    c = tensor(counts)
    octaves = 2 ** torch.arange(17, 33, device=DEVICE)
    c = c >> torch.searchsorted(octaves, c.sum(1, keepdim=True), right=True)
    f = 1 + (TOTAL - c.shape[1]) * c // c.sum(1, keepdim=True)
    first = (f == f.amax(1, keepdim=True)).long().cumsum(1).cumsum(1) == 1  # of the greatest
    f = f + first * (TOTAL - f.sum(1, keepdim=True))
    return {"cumulative": array(torch.cat((torch.zeros_like(f[:, :1]), f.cumsum(1)), 1), "i8")}


def codes_of_classes(classes: Array, low: Array, negative: Array) -> Arrays:
    """Operation: magnitudes of classes with signs (section 15.7)."""
    q = tensor(classes)
    magnitudes = torch.where(q < 4, q, ((2 + q % 2) << (q // 2 - 1).clamp(min=0)) + tensor(low))
    return {"codes": array(magnitudes * (1 - 2 * tensor(negative)), "i8")}


def cells_of_halves(width: int, height: int, count: int, first_halves: Array) -> Arrays:
    """Operation: all parts of a halving at once (section 15.8)."""
    inside, numbers = (-(-width // 4), -(-height // 4)), tensor(first_halves)
    origins = torch.zeros((1, 2), dtype=torch.int64, device=DEVICE)
    counts = torch.tensor([count], device=DEVICE)
    halvings = (max(inside) - 1).bit_length()
    for halving in range(2 * halvings):
        axis, size = halving % 2, 2 ** (halvings - 1 - halving // 2)
        own, numbers = numbers[: len(counts)], numbers[len(counts) :]
        first = torch.where(origins[:, axis] + size < inside[axis], torch.minimum(own, counts), counts)
        second = origins.clone()
        second[:, axis] += size
        counts = torch.stack((first, counts - first), 1).ravel()
        origins = torch.stack((origins, second), 1).reshape(-1, 2)[counts > 0]
        counts = counts[counts > 0]
    return {"cells": array(origins.repeat_interleave(counts, 0), "i8")}


def field_vectors(differences: Array) -> Arrays:
    """Operation: sums down the first column and along rows, reduced (section 15.10)."""
    d = tensor(differences).clone()
    d[:, 0] = d[:, 0].cumsum(0)
    return {"vectors": array((d.cumsum(1) + 2**15) % 2**16 - 2**15, "i8")}


def adapt_model(counts: Array, seen: Array) -> Arrays:
    """Operation: (15-11)."""
    c, h = tensor(counts), tensor(seen)
    used = (h > 0).any(1, keepdim=True)
    return {"counts": array(torch.where(used, (7 * c >> 3) + 64 * h, c), "i8")}


def splat_classes(state: Array, quantizer: int) -> Arrays:
    """Operation: (15-4)."""
    return {"classes": array(_classes(tensor(state)[:, 5:], _step(quantizer)), "i8")}


def main_intra(quantizer: int, cells: Array, colors: Array, shapes: Array, places: Array) -> Arrays:
    """Operation: (15-10) and (15-15)."""
    step = _step(quantizer)
    n = tensor(colors).clamp(-(N_MOST // step), N_MOST // step) * step
    j = _classes(n, step)[:, None]
    size, aspect, shear = tensor(shapes).tensor_split(3, 1)
    logs = (torch.cat((size + aspect, size - aspect), 1) * (1477 >> j)).clamp(A_LEAST, A_MOST)
    g = ((logs >> 10) + 1 - j).clamp(-4, 2)
    positions = 1024 * tensor(cells) + (tensor(places) << (g + 8)) + (1 << (g + 7))
    return {"state": array(_clipped(torch.cat((positions, logs, shear * (2048 >> j), n), 1)), "i8")}


def _between(position: Tensor, side: int, cells: int) -> tuple[Tensor, Tensor, Tensor]:
    """The cell before a position and the one after it, and the 64ths of the way between their centres."""
    b = (256 * side).bit_length() - 1
    u = (position - 128 * side).clamp(0, (cells - 1) << b)
    i = (u >> b).clamp(max=max(cells - 2, 0))
    return i, (i + 1).clamp(max=cells - 1), ((u - (i << b)) >> (b - 6))[:, None]


def motion_of_splats(state: Array, vectors: Array, motion_cell: int) -> Arrays:
    """Operation: (15-12)."""
    X, Y = tensor(state)[:, :2].unbind(1)
    V, side = tensor(vectors), SIDES[motion_cell]
    i, i1, f = _between(X, side, V.shape[1])
    j, j1, h = _between(Y, side, V.shape[0])
    upper, lower = ((64 - f) * V[row, i] + f * V[row, i1] for row in (j, j1))
    return {"motion": array(((64 - h) * upper + h * lower + 32) >> 6, "i8")}


def mode_contexts(
    width: int, height: int, state: Array, past: Array, motion: Array, vectors: Array, motion_cell: int
) -> Arrays:
    """Operation: the contexts of section 15.11."""
    where, V, side = tensor(state)[:, :2], tensor(vectors), SIDES[motion_cell]
    moved = where + tensor(motion)
    outside = ((moved < 0) | (moved >= torch.tensor([256 * width, 256 * height], device=DEVICE))).any(1)
    contexts = 3 * tensor(past)
    if side:
        unrest = torch.zeros(V.shape[:2], dtype=torch.int64, device=DEVICE)
        for axis in range(2):
            size = V.shape[axis]
            step = V.diff(dim=axis).abs().sum(2)
            unrest.narrow(axis, 0, size - 1).copy_(torch.maximum(unrest.narrow(axis, 0, size - 1), step))
            unrest.narrow(axis, 1, size - 1).copy_(torch.maximum(unrest.narrow(axis, 1, size - 1), step))
        column, row = (where // (256 * side)).unbind(1)
        own = unrest[row.clamp(0, V.shape[0] - 1), column.clamp(0, V.shape[1] - 1)]
        contexts = contexts + (own > 2).long() + (own > 7).long()
    return {"contexts": array(torch.where(outside, torch.full_like(contexts, 9), contexts), "i8")}


def main_inter(quantizer: int, state: Array, motion: Array, differences: Array) -> Arrays:
    """Operation: (15-13)."""
    step, s, q, d = _step(quantizer), tensor(state), tensor(differences), tensor(motion)
    X, Y, A, B, S = s[:, :5].unbind(1)
    j = _classes(s[:, 5:], step)
    g_x, g_y = (exp2(v + 512 - 1024 * j, 8).clamp(1, STEP_MOST) for v in (A, B))
    g_s = S.sign() * (S.abs() * g_y >> 10).clamp(max=STEP_MOST)
    h = 1477 >> j
    new_A = (A + (q[:, 2] + q[:, 3]) * h).clamp(A_LEAST, A_MOST)
    new_B = (B + (q[:, 2] - q[:, 3]) * h).clamp(A_LEAST, A_MOST)
    v = (new_A - A) - (new_B - B)
    product, shift = S.abs() * _exp2_table()[v & (OCTAVE - 1)], (v >> 10) - 15
    grown = torch.where(shift >= 0, product << shift.clamp(min=0), product >> (-shift).clamp(0, 63))
    sheared = S.sign() * grown.clamp(max=S_MOST)
    columns = (
        X + d[:, 0] + q[:, 0] * g_x,
        Y + d[:, 1] + q[:, 0] * g_s + q[:, 1] * g_y,
        new_A,
        new_B,
        sheared + q[:, 4] * (2048 >> j),
    )
    return {"state": array(_clipped(torch.cat((torch.stack(columns, 1), s[:, 5:] + q[:, 5:] * step), 1)), "i8")}


def _digits(p: Tensor) -> Tensor:
    return torch.searchsorted(2 ** torch.arange(32, device=DEVICE), p, right=True)


def _pattern(negative: Tensor, p: Tensor, k: Tensor | int) -> Tensor:
    """The number +- q 2^(e + k) with (q, e) = r24(p), as the bit pattern of binary32: no floating point takes part."""
    e = (_digits(p) - 24).clamp(min=0)
    q = (p + torch.where(e > 0, (1 << e >> 1) - 1 + (p >> e & 1), 0)) >> e
    z = _digits(q)  # 25 if q is 2^24
    fraction = torch.where(z > 24, 0, q << (24 - z).clamp(min=0)) & 2**23 - 1
    pattern = ((k + e + z + 126) << 23 | fraction) - torch.where(negative, 2**31, 0)  # as a signed integer
    return torch.where(q > 0, pattern, 0).to(torch.int32).view(torch.float32)


def state_parameters(state: Array) -> Arrays:
    """Operation: (15-5)."""
    X, Y, A, B, S, *n = tensor(state).unbind(1)
    s = (_digits(torch.stack(n).abs().amax(0)) - 14).clamp(min=0)
    P0, P1, P2 = (value * k >> s for value, k in zip(n, K, strict=True))
    v, positive = -(A + B) >> 1, torch.zeros_like(A, dtype=torch.bool)
    of_A, of_B, G = (_exp2_table()[value & OCTAVE - 1] for value in (A, B, v))
    columns = [
        _pattern(X < 0, X.abs(), -8),
        _pattern(Y < 0, Y.abs(), -8),
        _pattern(positive, of_A, (A >> 10) - 15),
        _pattern(S < 0, S.abs() * of_B, (B >> 10) - 25),
        _pattern(positive, of_B, (B >> 10) - 15),
        *(_pattern(T < 0, T.abs() * G >> 15, s + (v >> 10) - 29) for T in (P0 + P1 + P2, P0 - 2 * P2, P0 - P1 + P2)),
    ]
    return {"parameters": array(torch.stack(columns, 1), "f4")}


def main_work(state: Array, width: int, height: int, halvings: int) -> Arrays:
    """Operation: (5-2)."""
    X, Y, A, B, S = tensor(state)[:, :5].unbind(1)
    E_x, e = ((_exp2_table()[v & OCTAVE - 1] * REACH >> 21 - (v >> 10)) + 1 for v in (A, B))
    m = 1024 + S.abs()
    E_y = (e >> 10) * m + ((e & 1023) * m >> 10) + 1
    work = torch.ones_like(X)
    for middle, reach, size in ((X, E_x + FILTERS[halvings], width), (Y, E_y + FILTERS[halvings], height)):
        end = ((middle + reach + 256 * 2**halvings - 1) >> 8 + halvings).clamp(max=-(-size // 2**halvings))
        work = work * (end - ((middle - reach) >> 8 + halvings).clamp(min=0)).clamp(min=0)
    return {"work": array(work.sum(), "i8")}
