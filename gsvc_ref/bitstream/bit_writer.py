"""Writing bits: the mirror of the reader."""

import sys
from collections.abc import Callable, Iterator
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import I8, U2, U4
from gsvc_base.errors import UsageError
from gsvc_ref.bitstream.coder import UV_LIMIT, Coder, Element, encode_uv
from gsvc_ref.bitstream.golomb import GOLOMB_LONGEST, golomb_bits


class Writer(Coder):
    """A Coder that writes the values it is given, and refuses what no reader would accept."""

    def __init__(self, first_bit: int = 0, trace: Callable[[Element], None] | None = None) -> None:
        super().__init__(first_bit, trace)
        self._bytes = bytearray()
        self._pending = 0  # the last bits, fewer than eight, which fill no byte yet
        self._pending_bits = 0

    @property
    def position(self) -> int:
        """Offset in bits, from the start of the stream, of the next element."""
        return self.first_bit + 8 * len(self._bytes) + self._pending_bits

    @property
    def bytes_left(self) -> int:
        """Whole bytes that may still follow: no limit."""
        return sys.maxsize

    def getvalue(self) -> bytes:
        """All bytes written; the last element must end at a byte boundary."""
        assert self._pending_bits == 0
        return bytes(self._bytes)

    def fail(self, rule: str, message: str, *, bit: int | None = None) -> NoReturn:
        """Raise the UsageError of a rule."""
        raise UsageError(f"{message} ({rule})")

    def append(self, other: "Writer") -> None:
        """Append all that another Writer has written, which must end at a byte boundary, as this one must."""
        assert self._pending_bits == 0
        self._bytes += other.getvalue()
        self.bits.update(other.bits)

    def _put(self, value: int, bits: int) -> None:
        self._pending = self._pending << bits | value
        self._pending_bits += bits
        whole = self._pending_bits // 8
        if whole:
            rest = self._pending_bits - 8 * whole
            self._bytes += (self._pending >> rest).to_bytes(whole, "big")
            self._pending &= (1 << rest) - 1
            self._pending_bits = rest

    def _put_array(self, bits: NDArray[np.uint8]) -> None:
        """Append an array of bits (u1, 0 or 1)."""
        if self._pending_bits:
            before = np.array([self._pending >> i & 1 for i in reversed(range(self._pending_bits))], np.uint8)
            bits = np.concatenate([before, bits])
        rest = len(bits) % 8
        self._bytes += np.packbits(bits[: len(bits) - rest]).tobytes()
        self._pending, self._pending_bits = 0, 0
        for bit in bits[len(bits) - rest :].tolist():
            self._put(bit, 1)

    def u(self, name: str, size: int, value: int = 0) -> int:
        """`u(size)`."""
        if not 0 <= value < 1 << size:
            raise UsageError(f"`{name}` = {value} does not fit into {size} bits")
        start = self.position
        self._put(value, size)
        self._record(name, start, value)
        return value

    def le(self, name: str, size: int, value: int = 0) -> int:
        """`le(size)`."""
        if not 0 <= value < 1 << 8 * size:
            raise UsageError(f"`{name}` = {value} does not fit into {size} bytes")
        start = self.position
        self._bytes += value.to_bytes(size, "little")
        self._record(name, start, value)
        return value

    def uv(self, name: str, value: int = 0) -> int:
        """`uv` (R-3.1-1)."""
        if not 0 <= value < UV_LIMIT:
            self.fail("R-3.1-1", f"`{name}` = {value} is not in 0..2^32 - 1")
        start = self.position
        self._bytes += encode_uv(value)
        self._record(name, start, value)
        return value

    def eg(self, name: str, order: int, value: int = 0) -> int:
        """`eg(order)` (R-3.1-3), in its plain form."""
        start = self.position
        z = ((value >> order) + 1).bit_length() - 1
        if value < 0 or z > GOLOMB_LONGEST:
            self.fail("R-3.1-3", f"`{name}` = {value} has no exponential Golomb code of order {order}")
        self._put(0, z)
        self._put(value + (1 << order), 1 + z + order)
        self._record(name, start, value)
        return value

    def raw(self, name: str, size: int, value: bytes = b"", *, counted: bool = True) -> bytes:
        """A run of `size` bytes; not `counted` if its elements are counted elsewhere."""
        assert len(value) == size
        assert self._pending_bits == 0
        start = self.position
        self._bytes += value
        if counted:
            self._record(name, start, value)
        return value

    def array(self, name: str, count: int, dtype: str, values: NDArray[Any] | None = None) -> NDArray[Any]:
        """A run of `count` elements `le(2)`, `le(4)`, `f16` or `f32`, dtype u2, u4, f2 or f4: (count,)."""
        assert values is not None
        assert len(values) == count
        assert self._pending_bits == 0
        start = self.position
        self._bytes += values.astype(np.dtype(dtype).newbyteorder("<")).tobytes()
        self._record(name, start, values)
        return values

    def align(self) -> None:
        """`align()` (R-3.1-4)."""
        bits = -self._pending_bits % 8
        if bits:
            self.u("align", bits, 0)

    def fixed(self, name: str, count: int, size: int, values: U2 | None = None) -> U2:
        """A run of `count` elements `u(size)`, size at most 16: (count,) u2."""
        assert values is not None
        assert len(values) == count
        start = self.position
        places = np.arange(size - 1, -1, -1, dtype=np.uint16)
        self._put_array((values[:, None] >> places & 1).astype(np.uint8).ravel())
        self._record(name, start, values)
        return values

    def golombs(self, name: str, count: int, order: int, values: I8 | None = None) -> I8:
        """A run of `count` elements `eg(order)`: (count,) i8 (R-3.1-3)."""
        assert values is not None
        assert len(values) == count
        start = self.position
        self._put_array(golomb_bits(values, order))
        self._record(name, start, values)
        return values

    def pairs(self, names: tuple[str, str], count: int, values: U4 | None = None) -> Iterator[U4]:
        """`count` pairs of `uv` from (count, 2) u4, yielded as one block."""
        assert values is not None
        assert values.shape == (count, 2)
        start = self.position
        self._bytes += b"".join(encode_uv(value) for value in values.ravel().tolist())
        self._record(f"{names[0]}, {names[1]}", start, values)
        yield values
