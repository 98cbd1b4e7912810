"""Reconstruction: from codes to splats, exactly (spec.md sections 5, 6.4 and 8).

The oracles are plain NumPy, operation by operation in the order of the text; gsvc_ref answers by compiled kernels.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gsvc_base import spec
from gsvc_conformance.expectations import Exact, Expectation
from gsvc_conformance.operation import exactly, paired

Array = NDArray[Any]
Oracle = dict[str, Expectation]


paired(
    "from_half",
    "reconstruction",
    "The values of binary16 patterns.",
    inputs="bits: u2 (N,)",
    outputs="values: f4 (N,)",
    equations=("8-5",),
    rules=("R-8-3",),
    oracle=exactly(spec.from_half),
)


paired(
    "to_half",
    "reconstruction",
    "The binary16 patterns nearest to values, ties to even.",
    inputs="values: f4 (N,)",
    outputs="bits: u2 (N,)",
    equations=("8-6",),
    rules=("R-8-3",),
    oracle=exactly(spec.to_half),
)


def _halves(bits: Array) -> Array:
    return np.asarray(bits.view(np.float16), np.float32)


def _color_sum(color_indices: Array, codebook_sizes: Array, codewords: Array) -> Array:
    """fl(... fl(C1 + C2) + ...), (n, 3) f4."""
    firsts = np.cumsum(codebook_sizes) - codebook_sizes
    total: Array = _halves(codewords)[firsts[0] + color_indices[:, 0]]
    for first, indices in zip(firsts[1:], color_indices.T[1:], strict=True):
        total = total + _halves(codewords)[first + indices]
    return total


def _intra_plain(
    width: int, height: int, positions: Array, cholesky: Array, scale: Array, offset: Array, color_indices: Array,
    codebook_sizes: Array, codewords: Array,
) -> Oracle:  # fmt: skip
    """The intra column of section 8 in NumPy's binary32."""
    half_size = np.array([width, height], np.float32) / np.float32(2)
    xy = (_halves(positions) + np.float32(1)) * half_size  # (8-1), (8-2)
    l = cholesky.astype(np.float32) * scale + offset  # (8-3)
    c = _color_sum(color_indices, codebook_sizes, codewords)  # (8-4)
    return {"parameters": Exact(np.concatenate([xy, l, c], axis=1))}


def _inter_plain(
    width: int, height: int, reference: Array, survivors: Array, positions: Array, cholesky: Array, scale: Array,
    offset: Array, color_indices: Array, codebook_sizes: Array, codewords: Array,
) -> Oracle:  # fmt: skip
    """The inter column of section 8 in NumPy's binary32."""
    result = reference[np.flatnonzero(survivors)]
    half_size = np.array([width, height], np.float32) / np.float32(2)
    if len(positions):
        result[:, 0:2] += _halves(positions) * half_size  # (8-1), (8-2)
    if len(cholesky):
        result[:, 2:5] += cholesky.astype(np.float32) * scale + offset  # (8-3)
    if len(color_indices):
        result[:, 5:8] += _color_sum(color_indices, codebook_sizes, codewords)  # (8-4)
    return {"parameters": Exact(result)}


paired(
    "reconstruct_intra",
    "reconstruction",
    "The splats that the codes of an intra block stand for.",
    inputs="width: int; height: int; positions: u2 (N, 2); cholesky: u2 (N, 3); scale: f4 (3,); offset: f4 (3,); "
    "color_indices: u2 (N, M); codebook_sizes: i8 (M,); codewords: u2 (B, 3)",
    outputs="parameters: f4 (N, 8)",
    equations=("8-1", "8-2", "8-3", "8-4"),
    rules=("R-3.3-1", "R-3.3-2", "R-8-2"),
    oracle=_intra_plain,
)


paired(
    "reconstruct_inter",
    "reconstruction",
    "The survivors of a frame after the differences of an inter block; an attribute without rows is not present.",
    inputs="width: int; height: int; reference: f4 (N, 8); survivors: u1 (N,); positions: u2 (n or 0, 2); "
    "cholesky: u2 (n or 0, 3); scale: f4 (3,); offset: f4 (3,); color_indices: u2 (n or 0, M); "
    "codebook_sizes: i8 (M,); codewords: u2 (B, 3)",
    outputs="parameters: f4 (n, 8)",
    equations=("8-1", "8-2", "8-3", "8-4"),
    rules=("R-3.3-1", "R-3.3-2", "R-8-2"),
    oracle=_inter_plain,
)


paired(
    "parameter_checksum",
    "reconstruction",
    "The checksum of a frame's parameters.",
    inputs="parameters: f4 (N, 8)",
    outputs="checksum: i8 ()",
    rules=("R-6.4-3",),
    oracle=exactly(spec.parameter_checksum),
)


paired(
    "rendering_work",
    "reconstruction",
    "How many (splat, pixel) pairs the boxes of splats hold.",
    inputs="parameters: f4 (N, 8); width: int; height: int",
    outputs="work: i8 ()",
    equations=("5-1",),
    rules=("R-5-4",),
    oracle=exactly(spec.rendering_work),
)


paired(
    "main_work",
    "reconstruction",
    "How many (splat, pixel) pairs the boxes of splats of profile `main` hold.",
    inputs="state: i8 (N, 8); width: int; height: int; halvings: int",
    outputs="work: i8 ()",
    equations=("5-2",),
    rules=("R-5-4",),
    oracle=exactly(spec.main_work),
)
