"""Metrics, colours and the last rounding by formulas that look right."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance.operation import Values
from gsvc_conformance.spec import Patch, namespace
from tests.hard_cases.measuring import Variant

F4 = NDArray[np.float32]
Frame = NDArray[np.unsignedinteger[Any]]


def _metrics(a: Frame, b: Frame, bit_depth: int, **changed: Any) -> Values:
    """The right metrics, but for some."""
    return {**namespace()["metrics"](a, b, bit_depth), **{name: np.array(value) for name, value in changed.items()}}


def _psnr(mse: Any, bit_depth: int) -> Any:
    return 10 * np.log10(np.float64((2**bit_depth - 1) ** 2) / np.float64(mse))


def with_a_floor(a: Frame, b: Frame, bit_depth: int) -> Values:
    """PSNR with 1e-10 added to the MSE, so that it is never infinite."""
    mse = np.mean((a.astype(np.float64) - b) ** 2)
    return _metrics(a, b, bit_depth, psnr=_psnr(mse + 1e-10, bit_depth))


def in_32_bits(a: Frame, b: Frame, bit_depth: int) -> Values:
    """The sum of squares in an unsigned integer of 32 bits."""
    mse = np.sum((a.astype(np.int64) - b) ** 2).astype(np.uint32) / a.size
    return _metrics(a, b, bit_depth, mse=mse, psnr=_psnr(mse, bit_depth))


def by_moments(a: Frame, b: Frame, bit_depth: int) -> Values:
    """MSE as E[a^2] - 2 E[a b] + E[b^2] in binary32."""
    x, y = a.astype(np.float32), b.astype(np.float32)
    mse = np.mean(x * x) - 2 * np.mean(x * y) + np.mean(y * y)
    return _metrics(a, b, bit_depth, mse=mse, psnr=_psnr(mse, bit_depth))


def _patched(operation: str, *patches: Patch) -> Variant:
    """The code of spec.md with other lines in it."""
    return lambda **inputs: namespace(patches)[operation](**inputs)


without_constants = _patched(
    "metrics", ("\nLUMINANCE_K = 0.01", "\nLUMINANCE_K = 0.0"), ("\nSTRUCTURE_K = 0.03", "\nSTRUCTURE_K = 0.0")
)
"""SSIM without C1 and C2: nothing divided by nothing where a window is flat."""

powers_of_negatives = _patched(
    "metrics", ("result *= max(factor, 0.0) ** weights[j]", "result *= np.float64(factor) ** weights[j]")
)
"""MS-SSIM with powers of the means as they are: a negative one has none."""


def in_binary16(sum: F4, bit_depth: int) -> Values:
    """The clamped sum and its product with the peak in binary16."""
    product = np.clip(sum, 0, 1).astype(np.float16) * np.float16(2**bit_depth - 1)
    return {"frame": np.rint(product).astype(np.float64)}


def _fixed_point(matrix: NDArray[np.float64], terms: list[Any], offsets: NDArray[np.int64]) -> list[Any]:
    """Integer arithmetic with coefficients of 8 fractional bits."""
    whole = np.rint(256 * matrix).astype(np.int64)
    return [
        (sum(c * term for c, term in zip(row, terms, strict=True)) + 128 >> 8) + offset
        for row, offset in zip(whole, offsets, strict=True)
    ]


def planes_in_fixed_point(y: Frame, cb: Frame, cr: Frame, **elements: int) -> Values:
    """To R'G'B' in integers, with coefficients of 8 fractional bits."""
    matrix, full, depth = (elements[k] for k in ("matrix_coefficients", "video_full_range_flag", "bit_depth"))
    gain, offset = namespace()["color_gains"](matrix, full, depth)
    inverse = namespace()["color_matrices"](matrix)[1] * ((2**depth - 1) / gain)
    terms = [plane.astype(np.int64) - int(zero) for plane, zero in zip((y, cb, cr), offset, strict=True)]
    channels = _fixed_point(inverse, terms, np.zeros(3, np.int64))
    return {"frame": np.clip(np.stack(channels, axis=-1), 0, 2**depth - 1)}


def frame_in_fixed_point(frame: Frame, **elements: int) -> Values:
    """To 4:4:4 planes in integers, with coefficients of 8 fractional bits."""
    matrix, full, depth = (elements[k] for k in ("matrix_coefficients", "video_full_range_flag", "bit_depth"))
    gain, offset = namespace()["color_gains"](matrix, full, depth)
    forward = namespace()["color_matrices"](matrix)[0] * (gain / (2**depth - 1))[:, None]
    planes = _fixed_point(forward, list(np.moveaxis(frame.astype(np.int64), -1, 0)), offset.astype(np.int64))
    return {name: np.clip(plane, 0, 2**depth - 1) for name, plane in zip(("y", "cb", "cr"), planes, strict=True)}
