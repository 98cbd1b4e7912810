"""Other renderers of these splats: programs as a user would write them, and the C++ limit where it is given.

The PyTorch renderers get their gradients from autograd. All of them follow the definition (spec.md section 9.1), and
tests/benchmarks holds them against it; only the C++ limit has its pixel centres at integers.
"""

import importlib.util
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4
from gsvc_base.constants import LN_255, SUPPORT_RADIUS

ROWS_AT_ONCE: Final = 8
"""Rows of a chunk of the dense renderer: with all rows at once autograd would keep gigabytes."""


def numpy_frame(parameters: F4, width: int, height: int) -> NDArray[np.uint8]:
    """Plain NumPy: splat by splat, over the box around it; (H, W, 3) u1."""
    picture = np.zeros((height, width, 3), np.float32)
    for x, y, l11, l21, l22, *color in parameters:
        reach_x, reach_y = SUPPORT_RADIUS * l11, SUPPORT_RADIUS * np.hypot(l21, l22)
        left, right = max(int(x - reach_x), 0), min(int(x + reach_x) + 1, width)
        top, bottom = max(int(y - reach_y), 0), min(int(y + reach_y) + 1, height)
        if left >= right or top >= bottom:
            continue
        u1 = (np.arange(left, right, dtype=np.float32) + np.float32(0.5) - x) / l11
        dy = np.arange(top, bottom, dtype=np.float32)[:, None] + np.float32(0.5) - y
        u2 = (dy - l21 * u1) / l22
        sigma = (u1 * u1 + u2 * u2) / 2
        g = np.where(sigma <= LN_255, np.exp(-sigma), np.float32(0))
        picture[top:bottom, left:right] += g[..., None] * np.array(color, np.float32)
    return np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8)


def load_torch(threads: int) -> Any:
    """PyTorch with this many threads, or None where it is not installed."""
    try:
        import torch
    except ImportError:
        return None
    torch.set_num_threads(threads)
    return torch


class DensePyTorch:
    """Every splat at every pixel, some rows at a time; the loss is that of `gsvc_ref.rendering.Objective`."""

    def __init__(self, torch: Any, target: F4) -> None:
        self.torch, self.target = torch, torch.from_numpy(target)

    def iteration(self, parameters: F4) -> tuple[float, F4]:
        """The loss and its gradient (N, 8) f4."""
        torch = self.torch
        height, width, _ = self.target.shape
        p = torch.tensor(parameters, requires_grad=True)
        across = torch.arange(width) + 0.5
        total = 0.0
        for top in range(0, height, ROWS_AT_ONCE):
            rows = self.target[top : top + ROWS_AT_ONCE]
            down = torch.arange(top, top + len(rows)) + 0.5
            u1 = ((across - p[:, 0:1]) / p[:, 2:3])[:, None, :]  # (N, 1, W)
            u2 = ((down - p[:, 1:2])[:, :, None] - p[:, 3, None, None] * u1) / p[:, 4, None, None]  # (N, rows, W)
            sigma = (u1 * u1 + u2 * u2) / 2
            g = torch.where(sigma <= LN_255, torch.exp(-sigma), 0.0)
            C = torch.einsum("nhw,nc->hwc", g, p[:, 5:])
            loss = torch.sum((straight_clamp(C) - rows) ** 2) / (height * width)
            loss.backward()
            total += loss.item()
        return total, p.grad.numpy()


class PairListPyTorch:
    """The list of all (splat, pixel) pairs in the splats' boxes, and `index_add` into the picture."""

    def __init__(self, torch: Any, target: F4) -> None:
        self.torch, self.target = torch, torch.from_numpy(target)

    def iteration(self, parameters: F4) -> tuple[float, F4]:
        """The loss and its gradient (N, 8) f4."""
        torch = self.torch
        height, width, _ = self.target.shape
        p = torch.tensor(parameters, requires_grad=True)
        with torch.no_grad():
            splat, row, column = self._pairs(p)
        q = p[splat]  # (pairs, 8)
        u1 = (column + 0.5 - q[:, 0]) / q[:, 2]
        u2 = (row + 0.5 - q[:, 1] - q[:, 3] * u1) / q[:, 4]
        sigma = (u1 * u1 + u2 * u2) / 2
        g = torch.where(sigma <= LN_255, torch.exp(-sigma), 0.0)
        C = torch.zeros(height * width, 3).index_add(0, row * width + column, g[:, None] * q[:, 5:])
        loss = torch.sum((straight_clamp(C) - self.target.reshape(-1, 3)) ** 2) / (height * width)
        loss.backward()
        return loss.item(), p.grad.numpy()

    def _pairs(self, p: Any) -> tuple[Any, Any, Any]:
        """Splat, row and column of each pair."""
        torch = self.torch
        height, width, _ = self.target.shape
        reach_x, reach_y = SUPPORT_RADIUS * p[:, 2], SUPPORT_RADIUS * torch.hypot(p[:, 3], p[:, 4])
        left, top = (p[:, 0] - reach_x).long().clamp(0, width), (p[:, 1] - reach_y).long().clamp(0, height)
        right = ((p[:, 0] + reach_x).long() + 1).clamp(0, width)
        bottom = ((p[:, 1] + reach_y).long() + 1).clamp(0, height)
        wide, tall = (right - left).clamp(0), (bottom - top).clamp(0)
        count = wide * tall
        splat = torch.repeat_interleave(torch.arange(len(p)), count)
        place = torch.arange(len(splat)) - (torch.cumsum(count, 0) - count)[splat]
        return splat, top[splat] + place // wide[splat], left[splat] + place % wide[splat]


def straight_clamp(C: Any) -> Any:
    """Clamp to 0..1 whose gradient is handed straight through, as `Objective` does."""
    return C + (C.clamp(0, 1) - C).detach()


class Limit:
    """The C++ limit in a folder, or the sentence that says why there is none."""

    def __init__(self, folder: Path | None) -> None:
        self.stick: Any = None  # its `Limit` object, or None
        self.reason = "needs the C++ limit (LIMIT=FOLDER)"  # reason for its absence
        if folder is None:
            return
        try:
            with silent_stderr():
                self.stick = _load(folder / "limit.py").Limit()
        except Exception as error:  # whatever its compiler or loader meets
            self.reason = f"the C++ limit does not build here ({type(error).__name__}; it needs g++ and AVX-512)"


def _load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise FileNotFoundError(path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


@contextmanager
def silent_stderr() -> Iterator[None]:
    """Let what other programs write to standard error go nowhere: pages of a compiler's complaints."""
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
