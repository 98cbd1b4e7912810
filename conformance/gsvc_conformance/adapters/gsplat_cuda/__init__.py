"""The CUDA rasteriser of the paper's authors, with its autograd: pictures and gradients, no bitstream.

It is a public fork of gsplat (github.com/XingtongGe/gsplat at bf697c8), on which GaussianImage and the authors' code of
GSVC build. It is no part of this project, and needs PyTorch, nvcc and an NVIDIA GPU:

    git clone https://github.com/XingtongGe/gsplat
    git -C gsplat checkout bf697c8
    pip install --no-build-isolation ./gsplat
    gsvc-conformance run --module gsvc_conformance.adapters.gsplat_cuda --waivers FILE

FILE is `expected_failures.toml` beside this module: which vectors fail, and which equation of spec.md the rasteriser
breaks in each. It says what a GPU was asked, and what is a prediction by the double of the rasteriser in
tests/adapters, which failed the same 117 of 204 vectors as the rasteriser on an H200. It is for bf697c8; the open pull
request 1 counts the off-diagonal entry twice in yet another place, and should fail the gradients of l22, too.
"""

from typing import Any, Final

import numpy as np
import torch
from gsplat.project_gaussians_2d import project_gaussians_2d
from gsplat.rasterize_sum import rasterize_gaussians_sum

from gsvc_conformance.adapters import nvidia

Values = dict[str, Any]

DEVICE: Final = "cuda"
TILE: Final = 16
"""Pixels along the side of a tile; the kernels are compiled for it."""
SMALLEST_NORMAL: Final = 2.0**-126


def environment() -> dict[str, str]:
    """The device and the versions that it runs on."""
    if not torch.cuda.is_available():
        raise RuntimeError("the rasteriser needs an NVIDIA GPU, and PyTorch with CUDA")
    return {
        "device": torch.cuda.get_device_name(),
        **nvidia.driver(),
        "compute capability": "{}.{}".format(*torch.cuda.get_device_capability()),
        "CUDA": str(torch.version.cuda),
        "PyTorch": torch.__version__,
    }


def render_sum(parameters: Any, width: int, height: int) -> Values:
    """(9-2): f4 (H, W, 3), from f4 (N, 8) parameters."""
    with torch.no_grad():
        return {"sum": picture(on_device(parameters), width, height).cpu().numpy()}


def render_frame(parameters: Any, width: int, height: int, bit_depth: int) -> Values:
    """R-9.1-1: u1 or u2 (H, W, 3); the rounding is ours, the rasteriser has none."""
    with torch.no_grad():
        total = picture(on_device(parameters), width, height).double()
        samples = torch.round(total.clamp(0, 1) * (2**bit_depth - 1)).cpu().numpy()
    return {"frame": samples.astype(np.uint8 if bit_depth == 8 else np.uint16)}


def render_gradients(parameters: Any, residual: Any) -> Values:
    """(10-7) to (10-9): f4 (N, 8), as the rasteriser's own backward pass has them."""
    height, width = residual.shape[:2]
    splats = on_device(parameters).requires_grad_()
    (gradients,) = torch.autograd.grad(picture(splats, width, height), splats, on_device(residual))
    return {"gradients": gradients.cpu().numpy()}


def picture(splats: torch.Tensor, width: int, height: int) -> torch.Tensor:
    """The sum over a frame, with what is conventional there put in its place.

    Parameters
    ----------
    splats
        f4 (N, 8) on the device: x, y, l11, l21, l22, R, G, B, in pixels, pixel centres at halves.
    width, height
        Of the frame.

    Returns
    -------
    f4 (H, W, 3).
    """
    # The sign of a factor means nothing there; here what is not positive is degenerate (section 9.1).
    diagonal = splats[:, [2, 4]]
    splats = splats[(torch.isfinite(diagonal) & (diagonal >= SMALLEST_NORMAL)).all(1)]
    splats = torch.cat([splats, colorless(width, height)])
    tiles = ((width + TILE - 1) // TILE, (height + TILE - 1) // TILE, 1)
    centers, depths, radii, conics, tiles_hit = project_gaussians_2d(
        normalized(splats[:, :2], width, height), splats[:, 2:5], height, width, tiles
    )
    total: torch.Tensor = rasterize_gaussians_sum(
        centers, depths, radii, conics, tiles_hit, splats[:, 5:], torch.ones_like(splats[:, :1]), height, width,
        TILE, TILE, background=torch.zeros_like(splats[0, 5:]),
    )  # fmt: skip
    return total


def normalized(centers: torch.Tensor, width: int, height: int) -> torch.Tensor:
    """f4 (N, 2) positions as they are given there: -1 to 1 over the frame, the first pixel's centre at 0 pixels."""
    size = torch.tensor([width, height], dtype=torch.float64, device=centers.device)
    return rounded((2 * centers.double() - 1) / size - 1)


def rounded(values: torch.Tensor) -> torch.Tensor:
    """To binary32, which the kernels take."""
    return values.float()


def colorless(width: int, height: int) -> torch.Tensor:
    """One splat, f4 (1, 8), over all tiles and of no colour: the rasteriser takes no empty list.

    As the last one it takes nobody's place.
    """
    size = float(max(width, height))
    return torch.tensor([[width / 2, height / 2, size, 0, size, 0, 0, 0]], device=DEVICE)


def on_device(values: Any) -> torch.Tensor:
    """A NumPy array as a tensor on the device."""
    return torch.from_numpy(values).to(DEVICE)
