"""Decisions as they get written: in binary64 where spec.md has rational numbers, in binary32 where it has binary64."""

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance.operation import Values
from tests.hard_cases.measuring import Variant

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]


def key_frames(form: str) -> Variant:
    """The paper's rule in binary64, whatever the window."""

    def select_key_frames(
        losses_i: F8, losses_p: F8, window: int, threshold: float, guard_ratio: float, robust: int
    ) -> Values:
        D = losses_p - losses_i[1:]
        keys = [0]
        for t in range(len(D)):
            W = D[max(0, t - window) : t + window + 1]
            if form == "windows filled with zeros":
                W = np.concatenate([W, np.zeros(2 * window + 1 - len(W))])
            n, S, Q = np.float64(len(W)), W.sum(), (W * W).sum()
            if form == "sums of squares":
                is_key = n * D[t] > S and (n * D[t] - S) ** 2 > threshold**2 * (n * Q - S * S)
            elif form == "a score":
                is_key = not (D[t] - W.mean()) / W.std() <= threshold
            else:
                is_key = D[t] > W.mean() + threshold * W.std()
            if is_key:
                keys.append(t + 1)
        return {"key_frames": np.array(keys, np.int64)}

    return select_key_frames


def converged_in_binary32(losses: F8, patience: int, tolerance: float) -> Values:
    """Losses in binary32."""
    calm = abs(np.diff(losses.astype(np.float32))) <= np.float32(tolerance)
    ends = [j + 2 for j in range(patience - 1, len(calm)) if calm[j - patience + 1 : j + 1].all()]
    return {"iteration": np.array(ends[0] if ends else 0, np.int64)}


def prune_by_squares(weights: F4, removed: int) -> Values:
    """Squares in place of magnitudes."""
    order = np.argsort(-(weights * weights), kind="stable")
    return {"survivors": np.sort(order[: len(weights) - removed]).astype(np.int64)}


def augment_in_half(values: F4, uniforms: F4, width: int, height: int) -> Values:
    """Products in binary16, as in training of mixed precision."""
    new = np.zeros((len(uniforms), 9), np.float16)
    new[:, :8] = uniforms.astype(np.float16) * np.array([width, height, 1, 1, 1, 1, 1, 1], np.float16)
    new[:, 2:5:2] += np.float16(0.5)
    new[:, 8] = 0.01
    return {"values": np.concatenate([values, new.astype(np.float32)])}
