"""Where tensors live, and how arrays get there and back."""

import os
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

Array = NDArray[Any]
Arrays = dict[str, Any]


def _chosen() -> torch.device:
    """The device of GSVC_TORCH_DEVICE, else CUDA where there is one, else the CPU.

    Raises
    ------
    ValueError
        This PyTorch cannot calculate in binary64 on it.
    """
    name = os.environ.get("GSVC_TORCH_DEVICE") or ("cuda" if torch.cuda.is_available() else "cpu")
    try:
        device = torch.device(name)
        torch.ones(1, dtype=torch.float64, device=device).item()
    except (RuntimeError, AssertionError, TypeError) as error:  # each kind of device has its own
        raise ValueError(
            f"PyTorch {torch.__version__} cannot calculate in binary64 on {name}; GSVC_TORCH_DEVICE may be cpu, or "
            "cuda or cuda:1 with a GPU and a PyTorch that was built for it (pytorch.org has the command)"
        ) from error
    return device


DEVICE: Final = _chosen()


def tensor(array: Array) -> Tensor:
    """A copy of an array on the device; u2 and u4, with which PyTorch can hardly calculate, become i8."""
    wide = array.astype(np.int64) if array.dtype.kind == "u" and array.itemsize > 1 else array
    return torch.tensor(np.ascontiguousarray(wide), device=DEVICE)


def array(values: Tensor, dtype: str) -> Array:
    """A copy of a tensor in main memory, in a NumPy type such as ``u2``."""
    return np.asarray(values.detach().cpu().numpy().astype(dtype))
