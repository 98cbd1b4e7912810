"""Reading bits: the one place where a stream's bounds are checked."""

from collections.abc import Callable, Iterator
from typing import Any, Final, NoReturn

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import I8, U2, U4
from gsvc_ref.bitstream.coder import UV_LIMIT, Bytes, Coder, Element
from gsvc_ref.bitstream.golomb import GOLOMB_LONGEST, TOO_LONG, UNDERFLOW, decode_golombs
from gsvc_ref.bitstream.rules import broken

_UNPACKED_AT_ONCE: Final = 1 << 16
"""Elements of a run that are unpacked at once, so that temporaries stay small."""


class Reader(Coder):
    """A Coder that takes the values from the payload of a chunk, or other bytes, and trusts none of them."""

    def __init__(
        self,
        data: Bytes,
        *,
        first_bit: int = 0,  # offset of `data` from the start of the stream
        end_rule: str = "R-6.2-3",  # broken by an element that does not fit: R-6.2-4 outside of a payload
        trace: Callable[[Element], None] | None = None,  # gets each element, and the one that cannot be read
    ) -> None:
        super().__init__(first_bit, trace)
        self._data = memoryview(data).toreadonly()  # parts of it are no copies
        self._bit = 0
        self._end_rule = end_rule

    @property
    def position(self) -> int:
        """Offset in bits, from the start of the stream, of the next element."""
        return self.first_bit + self._bit

    @property
    def bits_left(self) -> int:
        """Bits of the data that have not been read."""
        return 8 * len(self._data) - self._bit

    @property
    def bytes_left(self) -> int:
        """Whole bytes of the data that have not been read."""
        return self.bits_left // 8

    @property
    def rest(self) -> memoryview:
        """The whole bytes that have not been read, and stay so."""
        return self._data[(self._bit + 7) >> 3 :]

    def fail(self, rule: str, message: str, *, bit: int | None = None) -> NoReturn:
        """Raise the GsvcError of a rule."""
        raise broken(rule, message, self.element_bit if bit is None else bit)

    def _need(self, bits: int, name: str, start: int | None = None) -> None:
        """Make sure that `bits` follow for the element or run that starts here, or at the bit `start` (R-3.1-6)."""
        if bits > self.bits_left:
            self._underflow(name, self.position if start is None else start)

    def _note_fault(self, name: str, bit: int, end: int) -> None:
        """Trace an element that the bits from `bit` to `end` are not."""
        if self._trace is not None:
            self._trace(Element(bit, end - bit, self._category, self._prefix + name, None, self.block))

    def _underflow(self, name: str, bit: int) -> NoReturn:
        self._note_fault(name, bit, self.position + self.bits_left)
        if self._end_rule == "R-6.2-3":
            self.fail("R-6.2-3", f"the payload ends inside `{name}`; its elements need more bytes than it has", bit=bit)
        self.fail(self._end_rule, f"the stream ends inside `{name}`: it was cut, or a length is wrong", bit=bit)

    def _take(self, bits: int, name: str) -> int:
        self._need(bits, name)
        window = int.from_bytes(self._data[self._bit >> 3 : (self._bit + bits + 7) >> 3], "big")
        self._bit += bits
        return window >> (-self._bit % 8) & ((1 << bits) - 1)  # without the bits of the last byte that follow

    def _take_bytes(self, size: int, name: str) -> memoryview:
        self._need(8 * size, name)
        first = self._bit >> 3
        self._bit += 8 * size
        return self._data[first : first + size]

    def u(self, name: str, size: int, value: int = 0) -> int:
        """`u(size)`."""
        start = self.position
        value = self._take(size, name)
        self._record(name, start, value)
        return value

    def le(self, name: str, size: int, value: int = 0) -> int:
        """`le(size)`."""
        start = self.position
        value = int.from_bytes(self._take_bytes(size, name), "little")
        self._record(name, start, value)
        return value

    def uv(self, name: str, value: int = 0) -> int:
        """`uv` (R-3.1-1)."""
        start = self.position
        value = 0
        for shift in range(0, 35, 7):  # at most five bytes
            self._need(8, name, start)
            byte = self._take_bytes(1, name)[0]
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                break
        is_too_long = byte == 0 and shift > 0
        if byte >= 0x80 or value >= UV_LIMIT or is_too_long:
            self._note_fault(name, start, self.position)
        if byte >= 0x80 or value >= UV_LIMIT:
            self.fail("R-3.1-1", f"`{name}` is 2^32 or more", bit=start)
        if is_too_long:
            self.fail("R-3.1-1", f"`{name}` = {value} is written in more bytes than it needs", bit=start)
        self._record(name, start, value)
        return value

    def eg(self, name: str, order: int, value: int = 0) -> int:
        """`eg(order)` (R-3.1-3), in its plain form."""
        start = self.position
        z = one = 0
        while self.bits_left and not (one := self._take(1, name)):
            z += 1
            if z > GOLOMB_LONGEST:
                self._golomb_too_long(name, start)
        if not one or z + order > self.bits_left:
            self._underflow(name, start)
        value = (((1 << z) - 1) << order) + self._take(z + order, name)
        self._record(name, start, value)
        return value

    def _golomb_too_long(self, name: str, bit: int) -> NoReturn:
        self._note_fault(name, bit, bit + GOLOMB_LONGEST + 1)
        self.fail("R-3.1-3", f"`{name}` begins with more than {GOLOMB_LONGEST} zero bits", bit=bit)

    def raw(self, name: str, size: int, value: bytes = b"", *, counted: bool = True) -> Bytes:
        """A run of `size` bytes; not `counted` if its elements are counted elsewhere."""
        start = self.position
        read = self._take_bytes(size, name)
        if counted:
            self._record(name, start, read if self._trace is None else bytes(read))
        return read

    def array(self, name: str, count: int, dtype: str, values: NDArray[Any] | None = None) -> NDArray[Any]:
        """A run of `count` elements `le(2)`, `le(4)`, `f16` or `f32`, dtype u2, u4, f2 or f4: (count,)."""
        start = self.position
        stored = np.dtype(dtype).newbyteorder("<")
        data = self._take_bytes(count * stored.itemsize, name)
        read = np.frombuffer(data, stored).astype(dtype)  # a copy: aligned, writable, native
        self._record(name, start, read)
        return read

    def align(self) -> None:
        """`align()` (R-3.1-4)."""
        bits = -self._bit % 8
        if bits and self.u("align", bits) != 0:
            self.fail("R-3.1-4", "the bits that are skipped up to the next byte are not all zero")

    def fixed(self, name: str, count: int, size: int, values: U2 | None = None) -> U2:
        """A run of `count` elements `u(size)`, size at most 16: (count,) u2."""
        start = self.position
        self._need(count * size, name)
        read = np.empty(count, np.uint16)
        for first in range(0, count, _UNPACKED_AT_ONCE):
            block = read[first : first + _UNPACKED_AT_ONCE]
            block[:] = self._unpack(len(block), size)
        self._record(name, start, read)
        return read

    def _unpack(self, count: int, size: int) -> NDArray[np.uint32]:
        """`count` integers of `size` <= 16 bits: each lies in three bytes, at any first bit."""
        if size == 0:
            return np.zeros(count, np.uint32)
        first, end = self._bit >> 3, (self._bit + count * size + 7) >> 3
        window = np.frombuffer(b"".join((self._data[first:end], bytes(3))), np.uint8).astype(np.uint32)
        phase = self._bit & 7
        offsets = np.arange(phase, phase + count * size, size, dtype=np.uint32)
        at = offsets >> 3
        self._bit += count * size
        three = window[at] << 16 | window[at + 1] << 8 | window[at + 2]
        values: NDArray[np.uint32] = three >> (24 - size - (offsets & 7)) & ((1 << size) - 1)
        return values

    def golombs(self, name: str, count: int, order: int, values: I8 | None = None) -> I8:
        """A run of `count` elements `eg(order)`: (count,) i8 (R-3.1-3)."""
        start = self.position
        read = np.full(count, -1, np.int64)
        status, bit = decode_golombs(np.frombuffer(self._data, np.uint8), self._bit, order, read)
        if status < 0 and read[0] >= 0:
            self._bit = bit
            self._record(name, start, read[: int(np.argmin(read))])
        if status == TOO_LONG:
            self._golomb_too_long(name, self.first_bit + bit)
        if status == UNDERFLOW:
            self._underflow(name, self.first_bit + bit)
        self._bit = bit
        self._record(name, start, read)
        return read

    def pairs(self, names: tuple[str, str], count: int, values: U4 | None = None) -> Iterator[U4]:
        """`count` pairs of `uv`, as blocks (n, 2) u4; what precedes a fault is yielded before the fault is raised."""
        while count > 0:
            start = self.position
            block, used = self._whole_pairs(min(count, _UNPACKED_AT_ONCE))
            if len(block) == 0:  # the next pair is faulty: the plain form says how
                self.uv(names[0])
                self.uv(names[1])
            self._bit += 8 * used
            self._record(f"{names[0]}, {names[1]}", start, block)
            count -= len(block)
            yield block

    def _whole_pairs(self, most: int) -> tuple[U4, int]:
        """The legal pairs of `uv` that come next, (n, 2) u4 with n <= most, and the bytes they take."""
        first = self._bit >> 3
        data = np.frombuffer(self._data[first : first + 10 * most], np.uint8)  # two of five bytes each at most
        ends = np.flatnonzero(data < 0x80)[: 2 * most]  # bit 7 says that more follow
        starts = np.concatenate([np.zeros(1, np.int64), ends[:-1] + 1])[: len(ends)]
        sizes = ends - starts + 1
        last = data[ends]
        legal = (sizes <= 4) | ((sizes == 5) & (last < 0x10))  # below 2^32
        legal &= (sizes == 1) | (last != 0)  # in no more bytes than needed
        good = (int(np.argmin(legal)) if not legal.all() else len(legal)) // 2 * 2  # whole pairs before the first fault
        values = np.zeros(good, np.uint32)
        for group in range(int(sizes[:good].max(initial=0))):
            part = sizes[:good] > group
            values[part] |= (data[starts[:good][part] + group].astype(np.uint32) & 0x7F) << np.uint32(7 * group)
        return values.reshape(-1, 2), int(ends[good - 1]) + 1 if good else 0
