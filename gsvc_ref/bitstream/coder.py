"""The interface of bits: what a syntax function may say, whether it is read or written (spec.md section 3.1).

Each syntax function of spec.md stands once in this package. It is handed a `Coder` and calls it for every element in
the order of the spec's table, with the element's name. A `Reader` ignores the values it is given and returns what the
bytes say; a `Writer` writes the values and returns them:

    width = s.le("width", 2, given.width)

Checks stand beside the elements and call `fail`: a Reader raises GsvcError with the bit offset of the element at fault,
a Writer raises UsageError, since the caller asked for a stream that no decoder may accept.
"""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final, NoReturn

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import I8, U2, U4

CATEGORIES: Final = (
    "container",  # magic, version, chunk types, lengths and checksums
    "header",  # sequence header
    "frame_header",  # frame numbers, splat counts, flags of blocks
    "checksums",  # parameter_checksum
    "survivors",
    "positions",
    "cholesky",
    "quantizers",  # cholesky_scale, cholesky_offset
    "colors",
    "codebooks",  # stage_count, codeword_count, codeword
    "index",
    "end",
    "ancillary",  # payloads of chunks that this version does not know
)
"""Categories of bits of profile `paper`, which add up to the size of a stream. Alignment counts to its element's."""

RUN_PARTS: Final = (
    "cells",
    "luma",
    "chroma",
    "size",
    "aspect",
    "shear",
    "place",
    "motion",
    "modes",
    "position",
    "shape",
    "color",
)
"""The parts of a run of profile `main`: categories that get the whole bits of the code length of their symbols."""

ENTROPY_CODER: Final = "entropy_coder"
"""The category of the bits of a run that belong to no symbol: the final states, and what was rounded down."""

MAIN_CATEGORIES: Final = (
    "container",
    "header",
    "frame_header",
    "checksums",
    "densities",
    *RUN_PARTS,
    ENTROPY_CODER,
    "index",
    "end",
    "ancillary",
)
"""Categories of bits of profile `main`."""


def categories_of(profile: int) -> tuple[str, ...]:
    """The categories of bits that a stream of a profile may have."""
    return (CATEGORIES, MAIN_CATEGORIES)[profile]


UV_LIMIT: Final = 1 << 32

Bytes = bytes | bytearray | memoryview


@dataclass(frozen=True)
class Element:
    """One syntax element, or a run of equal ones, in a stream."""

    bit: int  # offset of its first bit from the start of the stream
    bits: int  # its size
    category: str  # one of `CATEGORIES` or `MAIN_CATEGORIES`
    name: str  # that of spec.md, after the name of its plane or channel, if any
    value: Any  # int, float, or an array for a run; None for the element at fault, if the bits are no such element
    block: str = ""  # the kind of its splat block, intra or inter; empty outside of blocks


class Coder(ABC):
    """Bits in the making or under examination by descriptors (R-3.1-5), and an account of them."""

    def __init__(self, first_bit: int = 0, trace: Callable[[Element], None] | None = None) -> None:
        self.bits: Counter[tuple[str, str]] = Counter()  # number of bits by (category, element)
        self.element_bit = first_bit  # offset from the start of the stream of the element coded last
        self.first_bit = first_bit  # that of the first element
        self._trace = trace
        self._category = "container"
        self._prefix = ""
        self.block = ""  # the kind of the splat block that is coded; empty outside of blocks

    @property
    @abstractmethod
    def position(self) -> int:
        """Offset in bits, from the start of the stream, of the next element."""

    @property
    @abstractmethod
    def bytes_left(self) -> int:
        """Whole bytes that may still follow."""

    @contextmanager
    def part(self, category: str, prefix: str = "") -> Iterator[None]:
        """Count the elements of a ``with`` block to a category; name them after a plane."""
        outside = self._category, self._prefix
        self._category, self._prefix = category, prefix and f"{prefix}."
        try:
            yield
        finally:
            self._category, self._prefix = outside

    def bits_by_category(self) -> Counter[str]:
        """The number of bits of each category."""
        counts: Counter[str] = Counter()
        for (category, _), bits in self.bits.items():
            counts[category] += bits
        return counts

    def divide(self, category: str, parts: Mapping[str, int]) -> None:
        """Count bits of a category to its parts instead, as many as `parts` gives each, as long as there are some."""
        left = sum(bits for (counted, _), bits in self.bits.items() if counted == category)
        for part, wanted in parts.items():
            bits = min(wanted, left)
            left -= bits
            self.bits[part, "symbols"] += bits
            self.bits[category, "symbols"] -= bits

    def _record(self, name: str, start: int, value: Any) -> None:
        self.element_bit = start
        size = self.position - start
        self.bits[self._category, name] += size
        if self._trace is not None:
            self._trace(Element(start, size, self._category, self._prefix + name, value, self.block))

    @abstractmethod
    def fail(self, rule: str, message: str, *, bit: int | None = None) -> NoReturn:
        """Say that the element coded last (or the one at `bit`) breaks a rule."""

    @abstractmethod
    def u(self, name: str, size: int, value: int = 0) -> int:
        """`u(size)`."""

    @abstractmethod
    def le(self, name: str, size: int, value: int = 0) -> int:
        """`le(size)`."""

    @abstractmethod
    def uv(self, name: str, value: int = 0) -> int:
        """`uv` (R-3.1-1)."""

    @abstractmethod
    def eg(self, name: str, order: int, value: int = 0) -> int:
        """`eg(order)` (R-3.1-3)."""

    @abstractmethod
    def raw(self, name: str, size: int, value: bytes = b"", *, counted: bool = True) -> Bytes:
        """A run of `size` bytes; not `counted` if its elements are counted elsewhere."""

    @abstractmethod
    def align(self) -> None:
        """`align()`: zero bits up to the next byte boundary (R-3.1-4)."""

    @abstractmethod
    def fixed(self, name: str, count: int, size: int, values: U2 | None = None) -> U2:
        """A run of `count` elements `u(size)`, size at most 16: (count,) u2."""

    @abstractmethod
    def golombs(self, name: str, count: int, order: int, values: I8 | None = None) -> I8:
        """A run of `count` elements `eg(order)`: (count,) i8 (R-3.1-3)."""

    @abstractmethod
    def pairs(self, names: tuple[str, str], count: int, values: U4 | None = None) -> Iterator[U4]:
        """`count` pairs of `uv`, as blocks (n, 2) u4; what precedes a fault is yielded before the fault is raised."""

    @abstractmethod
    def array(self, name: str, count: int, dtype: str, values: NDArray[Any] | None = None) -> NDArray[Any]:
        """A run of `count` elements `le(2)`, `le(4)`, `f16` or `f32`, dtype u2, u4, f2 or f4: (count,)."""

    def floats(self, name: str, count: int, dtype: str, values: NDArray[Any] | None = None) -> NDArray[Any]:
        """A run of `count` elements `f16` or `f32`, dtype ``f2`` or ``f4``: (count,) (R-3.1-2)."""
        read = self.array(name, count, dtype, values)
        finite = np.isfinite(read)
        if not finite.all():
            bit = self.element_bit + 8 * read.itemsize * int(np.argmin(finite))
            self.fail("R-3.1-2", f"`{name}` is not finite", bit=bit)
        return read

    def f32(self, name: str, value: float = 0.0) -> np.float32:
        """`f32` (R-3.1-2)."""
        read: np.float32 = self.floats(name, 1, "f4", np.array([value], np.float32))[0]
        return read


def encode_uv(value: int) -> bytes:
    """The bytes of a `uv`."""
    groups = bytearray()
    while value >= 0x80:
        groups.append(value & 0x7F | 0x80)
        value >>= 7
    groups.append(value)
    return bytes(groups)
