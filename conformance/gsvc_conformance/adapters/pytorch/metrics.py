"""The metrics of two frames (section 11.2), in integers and binary64.

In binary32 the variances of (11-6) would lose digits, and cuDNN convolves with ten bits (TF32) unless told not to.
"""

import math
from typing import Final

import torch
from torch import Tensor
from torch.nn import functional

from gsvc_conformance.adapters.pytorch.device import Array, Arrays, tensor

SCALE_WEIGHTS: Final = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)
WINDOW_SIZE: Final = 11
WINDOW_DEVIATION: Final = 1.5


def metrics(a: Array, b: Array, bit_depth: int) -> Arrays:
    """Operation: (11-5) and (11-7)."""
    peak = 2**bit_depth - 1
    x, y = tensor(a).long(), tensor(b).long()
    mse = int(((x - y) ** 2).sum()) / x.numel()
    psnr = 10 * math.log10(peak * peak / mse) if mse else math.inf
    channels = _ms_ssim(x.permute(2, 0, 1)[:, None].double(), y.permute(2, 0, 1)[:, None].double(), peak)
    return {"mse": mse, "psnr": psnr, "ms_ssim": channels.mean().item()}


def _ms_ssim(x: Tensor, y: Tensor, peak: int) -> Tensor:
    """(11-7) of channels (3, 1, H, W), (3,)."""
    side, scales = min(x.shape[2:]), 1
    while scales < 5 and (side := (side + 1) // 2) >= WINDOW_SIZE:
        scales += 1
    weights = torch.tensor(SCALE_WEIGHTS[:scales], dtype=x.dtype, device=x.device)
    factors = []
    for scale in range(scales):
        similarity, structure = _similarities(x, y, peak)
        factors.append(similarity if scale == scales - 1 else structure)
        x, y = _halved(x), _halved(y)
    return (torch.stack(factors, 1).clamp(min=0) ** (weights / weights.sum())).prod(1)


def _similarities(x: Tensor, y: Tensor, peak: int) -> tuple[Tensor, Tensor]:
    """The means of l cs and of cs (11-6) over a channel, (3,) each."""
    c1, c2 = (0.01 * peak) ** 2, (0.03 * peak) ** 2
    mean_x, mean_y = _window_means(x), _window_means(y)
    variance_x = _window_means(x * x) - mean_x * mean_x
    variance_y = _window_means(y * y) - mean_y * mean_y
    covariance = _window_means(x * y) - mean_x * mean_y
    luminance = (2 * mean_x * mean_y + c1) / (mean_x * mean_x + mean_y * mean_y + c1)
    structure = (2 * covariance + c2) / (variance_x + variance_y + c2)
    return (luminance * structure).mean((1, 2, 3)), structure.mean((1, 2, 3))


def _window_means(channels: Tensor) -> Tensor:
    """Means under the window, at all places at which it lies inside."""
    down, across = (_taps(size, channels) for size in channels.shape[2:])
    return functional.conv2d(functional.conv2d(channels, down[None, None, :, None]), across[None, None, None, :])


def _taps(size: int, like: Tensor) -> Tensor:
    taps = min(WINDOW_SIZE, size)
    offsets = torch.arange(taps, dtype=like.dtype, device=like.device) - (taps - 1) / 2
    weights = torch.exp(-(offsets**2) / (2 * WINDOW_DEVIATION**2))
    return weights / weights.sum()


def _halved(channels: Tensor) -> Tensor:
    """Means of 2 x 2 samples; the last row or column of an odd size counts twice."""
    height, width = channels.shape[2:]
    even = functional.pad(channels, (0, width % 2, 0, height % 2), mode="replicate")
    return functional.avg_pool2d(even, 2)
