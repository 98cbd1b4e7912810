"""Reconstruction (section 8): exact, because every operation is a kernel of its own and rounds once."""

from typing import Final

import numpy as np
import torch
from torch import Tensor

from gsvc_conformance.adapters.pytorch.device import DEVICE, Array, Arrays, array, tensor
from gsvc_conformance.adapters.pytorch.tiles import boxes

REFLECTED_POLYNOMIAL: Final = 0x82F63B78
"""CRC-32C (6.2)."""


def half_values(bits: Array) -> Tensor:
    """(8-5): PyTorch's own binary16, subnormal numbers and infinities included, as f4."""
    return tensor(bits.view("i2")).view(torch.float16).float()


def from_half(bits: Array) -> Arrays:
    """Operation: the values of binary16 patterns."""
    return {"values": array(half_values(bits), "f4")}


def to_half(values: Array) -> Arrays:
    """Operation: (8-6)."""
    return {"bits": array(tensor(values).half().view(torch.int16), "i2").view("u2")}


def dequantized(codes: Array, scale: Array, offset: Array) -> Tensor:
    """fl(fl(q s) + β) of (8-3): two kernels, two roundings; torch.addcmul might round once."""
    product = tensor(codes).float() * tensor(scale)
    return product + tensor(offset)


def lsq_dequantize(codes: Array, scale: Array, offset: Array) -> Arrays:
    """Operation: values of LSQ+ codes."""
    return {"values": array(dequantized(codes, scale, offset), "f4")}


def _codeword_sums(color_indices: Array, codebook_sizes: Array, codewords: Array) -> Tensor:
    """The sums of (8-4), in the order of the stages."""
    values, indices = half_values(codewords), tensor(color_indices)
    colors, *others = (book[indices[:, k]] for k, book in enumerate(torch.split(values, codebook_sizes.tolist())))
    for chosen in others:
        colors = colors + chosen
    return colors


def _half_size(width: int, height: int) -> Tensor:
    return torch.tensor([width / 2, height / 2], device=DEVICE)  # exact


def reconstruct_intra(
    width: int,
    height: int,
    positions: Array,
    cholesky: Array,
    scale: Array,
    offset: Array,
    color_indices: Array,
    codebook_sizes: Array,
    codewords: Array,
) -> Arrays:
    """Operation: the left column of (8-1) to (8-4)."""
    mu = (half_values(positions) + 1) * _half_size(width, height)
    L = dequantized(cholesky, scale, offset)
    c = _codeword_sums(color_indices, codebook_sizes, codewords)
    return {"parameters": array(torch.cat((mu, L, c), 1), "f4")}


def reconstruct_inter(
    width: int,
    height: int,
    reference: Array,
    survivors: Array,
    positions: Array,
    cholesky: Array,
    scale: Array,
    offset: Array,
    color_indices: Array,
    codebook_sizes: Array,
    codewords: Array,
) -> Arrays:
    """Operation: the right column of (8-1) to (8-4); an attribute that is not present stays as it was."""
    mu, L, c = tensor(reference)[tensor(survivors) == 1].tensor_split((2, 5), 1)
    if len(positions):
        mu = mu + half_values(positions) * _half_size(width, height)
    if len(cholesky):
        L = L + dequantized(cholesky, scale, offset)
    if len(color_indices):
        c = c + _codeword_sums(color_indices, codebook_sizes, codewords)
    return {"parameters": array(torch.cat((mu, L, c), 1), "f4")}


def rendering_work(parameters: Array, width: int, height: int) -> Arrays:
    """Operation: the pixels in all boxes (5-1)."""
    left, right, top, bottom = boxes(tensor(parameters), width, height)
    return {"work": int(((right - left) * (bottom - top)).sum())}


def parameter_checksum(parameters: Array) -> Arrays:
    """Operation: the CRC-32C of R-6.4-3, found by halves: log2 of the length is the number of steps in a row.

    A register is linear in what was shifted into it, so that of bytes A followed by B is that of A, shifted by as many
    zeros as B has bytes, xor that of B. Zeros in front of the first byte change nothing.
    """
    columns = np.hsplit(parameters.astype("<f4"), (2, 5))
    data = np.concatenate([np.frombuffer(part.tobytes(), np.uint8) for part in columns])
    if not len(data):
        return {"checksum": 0}
    start = tensor(data).long()
    start[:4] ^= 0xFF  # a register that begins with FFFFFFFF
    levels = (len(data) - 1).bit_length()
    registers = torch.zeros(2**levels, dtype=torch.int64, device=DEVICE)
    registers[-len(data) :] = _register_of_bytes()[start]
    # What one zero byte makes of each single bit of a register: its lowest eight are shifted out, the others down.
    low, high = _register_of_bytes()[2 ** torch.arange(8, device=DEVICE)], 2 ** torch.arange(24, device=DEVICE)
    shift = torch.cat((low, high))
    for _ in range(levels):
        first, second = registers.view(-1, 2).unbind(1)
        registers = _shifted(first, shift) ^ second
        shift = _shifted(shift, shift)  # by twice as many bytes
    return {"checksum": int(registers) ^ 0xFFFFFFFF}


def _register_of_bytes() -> Tensor:
    """The register after each byte from an empty one, (256,) i8."""
    register = torch.arange(256, device=DEVICE)
    for _ in range(8):
        register = (register >> 1) ^ (REFLECTED_POLYNOMIAL * (register & 1))
    return register


def _shifted(registers: Tensor, shift: Tensor) -> Tensor:
    """A linear map of registers: the xor of what it makes of each of their bits."""
    result = torch.zeros_like(registers)
    for bit, image in enumerate(shift):
        result ^= (registers >> bit & 1) * image
    return result
