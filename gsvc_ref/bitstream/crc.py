"""CRC-32C, the checksum of chunks (R-6.2-2) and of reconstructed parameters (R-6.4-3)."""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.checks import door
from gsvc_base.splats import Splats
from gsvc_ref._jit import are_plain, kernel

REFLECTED_POLYNOMIAL: Final = 0x82F63B78
"""1EDC6F41, the Castagnoli polynomial, with its bits in reverse order."""


def _table() -> NDArray[np.uint32]:
    """The register after one byte, for each byte: (256,) u4."""
    register = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        register = (register >> 1 ^ (register & 1) * np.uint32(REFLECTED_POLYNOMIAL)).astype(np.uint32)
    return register


CRC_TABLE: Final = _table()
"""(256,) u4: the register after each byte."""


def _tables() -> NDArray[np.uint32]:
    """(8, 256) u4: the register after a byte that is followed by 0, 1, … 7 zero bytes."""
    tables = np.empty((8, 256), np.uint32)
    tables[0] = CRC_TABLE
    for zeros in range(1, 8):
        tables[zeros] = (tables[zeros - 1] >> 8) ^ CRC_TABLE[tables[zeros - 1] & 0xFF]
    return tables


_TABLES: Final = _tables()


@kernel()
def _crc32c_kernel(data: NDArray[np.uint8], register: np.int64, tables: NDArray[np.uint32]) -> np.int64:
    """Eight bytes at a time: the CRC is linear, so that each byte's share is found by one look-up."""
    size = len(data)
    whole = size - size % 8
    for at in range(0, whole, 8):
        register = (
            np.int64(tables[7, (register ^ data[at]) & 0xFF])
            ^ np.int64(tables[6, ((register >> 8) ^ data[at + 1]) & 0xFF])
            ^ np.int64(tables[5, ((register >> 16) ^ data[at + 2]) & 0xFF])
            ^ np.int64(tables[4, ((register >> 24) ^ data[at + 3]) & 0xFF])
            ^ np.int64(tables[3, data[at + 4]])  # the register has four bytes: the others enter alone
            ^ np.int64(tables[2, data[at + 5]])
            ^ np.int64(tables[1, data[at + 6]])
            ^ np.int64(tables[0, data[at + 7]])
        )
    for at in range(whole, size):
        register = (register >> 8) ^ np.int64(tables[0, (register ^ data[at]) & 0xFF])
    return register


def crc32c(data: bytes | bytearray | memoryview, crc: int = 0) -> int:
    """CRC-32C of `data`, continuing from the checksum `crc` of what stood before it: of b"123456789", E3069283."""
    if are_plain():
        return _crc32c_of_bytes(bytes(data), crc ^ 0xFFFFFFFF) ^ 0xFFFFFFFF
    # Read-only, so that Numba compiles the kernel for one type of array only.
    bytes_ = np.frombuffer(memoryview(data).toreadonly(), np.uint8)
    return int(_crc32c_kernel(bytes_, np.int64(crc ^ 0xFFFFFFFF), _TABLES)) ^ 0xFFFFFFFF


def _crc32c_of_bytes(data: bytes, register: int) -> int:
    """`_crc32c_kernel` for Python's integers: ten times as fast as that kernel when it is not compiled."""
    table = CRC_TABLE.tolist()
    for byte in data:
        register = register >> 8 ^ table[(register ^ byte) & 0xFF]
    return register


REGISTER_SPACING: Final = 64
"""Bytes between two positions whose register `registers` gives."""


def _zero_tables() -> NDArray[np.uint32]:
    """(32, 4, 256) u4: what 2^k zero bytes make of a register, for each value of each of its four bytes."""
    tables = np.empty((32, 4, 256), np.uint32)
    for byte in range(4):
        register = np.arange(256, dtype=np.uint32) << np.uint32(8 * byte)
        tables[0, byte] = (register >> 8) ^ CRC_TABLE[register & 0xFF]
    for k in range(1, 32):  # 2^k zero bytes are 2^(k-1), twice
        half = tables[k - 1]
        tables[k] = half[0][half & 0xFF] ^ half[1][half >> 8 & 0xFF] ^ half[2][half >> 16 & 0xFF] ^ half[3][half >> 24]
    return tables


ZERO_TABLES: Final = _zero_tables()


@kernel()
def _registers_kernel(data: NDArray[np.uint8], tables: NDArray[np.uint32]) -> NDArray[np.uint32]:
    kept = np.empty(len(data) // REGISTER_SPACING + 1, np.uint32)
    kept[0] = 0
    for n in range(1, len(kept)):
        part = data[(n - 1) * REGISTER_SPACING : n * REGISTER_SPACING]
        kept[n] = _crc32c_kernel(part, np.int64(kept[n - 1]), tables)
    return kept


def registers(data: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """The register, which begins as 0, before each `REGISTER_SPACING`-th byte of read-only data, u4."""
    return _registers_kernel(data, _TABLES)


@kernel()
def _after_zeros(register: np.int64, size: int, zero_tables: NDArray[np.uint32]) -> np.int64:
    """The register `size` zero bytes later."""
    k = 0
    while size > 0:
        # The binary digits of the number of bytes: one table for each power of two.
        if size & 1:
            register = (
                np.int64(zero_tables[k, 0, register & 0xFF])
                ^ np.int64(zero_tables[k, 1, (register >> 8) & 0xFF])
                ^ np.int64(zero_tables[k, 2, (register >> 16) & 0xFF])
                ^ np.int64(zero_tables[k, 3, (register >> 24) & 0xFF])
            )
        size >>= 1
        k += 1
    return register


@kernel()
def _register_at(
    data: NDArray[np.uint8], kept: NDArray[np.uint32], at: int, zero_tables: NDArray[np.uint32]
) -> np.int64:
    n = at // REGISTER_SPACING
    register = np.int64(kept[n])
    for i in range(n * REGISTER_SPACING, at):
        register = (register >> 8) ^ np.int64(zero_tables[0, 0, (register ^ data[i]) & 0xFF])
    return register


@kernel()
def crc32c_of_part(
    data: NDArray[np.uint8],
    kept: NDArray[np.uint32],
    first: int,
    end: int,
    zero_tables: NDArray[np.uint32],
) -> np.int64:
    """CRC-32C of data[first:end] in a time that does not depend on its length.

    `kept` is what `registers` made of the data. The register is a linear function of what it began as and of the data.
    So the register at `end` is that of the part alone, begun as FFFFFFFF, plus what (register at `first` + FFFFFFFF)
    has become after end - first zero bytes.
    """
    before = _register_at(data, kept, first, zero_tables) ^ 0xFFFFFFFF
    after = _register_at(data, kept, end, zero_tables)
    return after ^ _after_zeros(before, end - first, zero_tables) ^ 0xFFFFFFFF


# twin of spec.parameter_checksum
@door
def parameter_checksum(parameters: Splats | ArrayLike) -> int:
    """`parameter_checksum` of a frame (R-6.4-3).

    Parameters
    ----------
    parameters
        Its splats, or their parameters (N, 8) f4.

    Returns
    -------
    int
        CRC-32C of all positions, then all Cholesky factors, then all colours, each little-endian binary32.

    Raises
    ------
    UsageError
        The parameters do not describe splats.
    """
    splats, checksum = Splats.of(parameters), 0
    for part in (splats.positions, splats.cholesky, splats.colors):
        checksum = crc32c(part.astype("<f4", copy=False).view(np.uint8).data, checksum)
    return checksum
