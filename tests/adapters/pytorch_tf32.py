"""The PyTorch adapter as tensor cores run it with ``set_float32_matmul_precision("high")``, on any machine.

    PYTHONPATH=tests/adapters gsvc-conformance run --module pytorch_tf32 --model tf32/1

Its products of matrices, (9-2) and the two of its backward pass, get factors with 11 significant bits. Products of
these are exact in binary32, in which they are added. All else is as in binary32.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import torch
from torch import Tensor

from gsvc_conformance.adapters.pytorch import environment as environment
from gsvc_conformance.adapters.pytorch import rendering


def to_tf32(x: Tensor) -> Tensor:
    """To 11 significant bits, half away from zero."""
    bits = (x.contiguous().view(torch.int32) + 0x1000) & ~0x1FFF
    return torch.where(x.isfinite(), bits.view(torch.float32), x)


class Product(torch.autograd.Function):
    """A product of batches of matrices, whose gradients are such products, too."""

    @staticmethod
    def forward(ctx: Any, a: Tensor, b: Tensor) -> Tensor:
        ctx.save_for_backward(a, b)
        return torch.bmm(to_tf32(a), to_tf32(b))

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, Tensor]:
        a, b = (to_tf32(part) for part in ctx.saved_tensors)
        rounded = to_tf32(gradient)
        return torch.bmm(rounded, b.transpose(1, 2)), torch.bmm(a.transpose(1, 2), rounded)


@contextmanager
def on_tensor_cores() -> Iterator[None]:
    """The operator @ with `Product` in its place, in backward passes too."""
    plain = Tensor.__matmul__
    Tensor.__matmul__ = lambda a, b: Product.apply(a, b)
    try:
        yield
    finally:
        Tensor.__matmul__ = plain


def render_sum(**inputs: Any) -> dict[str, Any]:
    """Operation: (9-2) over a frame."""
    with on_tensor_cores():
        return rendering.render_sum(**inputs)


def render_frame(**inputs: Any) -> dict[str, Any]:
    """Operation: sum, clamp, scale, round."""
    with on_tensor_cores():
        return rendering.render_frame(**inputs)


def render_gradients(**inputs: Any) -> dict[str, Any]:
    """Operation: the gradient of sum(residual * C)."""
    with on_tensor_cores():
        return rendering.render_gradients(**inputs)
