"""Streams with a fault: elements that lie, and surgery on chunks. Checksums are right, so that the fault is reached."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import I8, U2, U4
from gsvc_base.errors import UsageError
from gsvc_ref.bitstream import SequenceHeader, crc32c
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.stream import StreamWriter
from gsvc_ref.stream.profiles import AnyCodes

LayersOfFrames = Mapping[int, Sequence[tuple[int, MainCodes]]]
"""Layers of frames with their codes, in their order, by the number of the frame."""


@dataclass(frozen=True, eq=False)
class Lie:
    """One element, or run of equal ones, of a stream that does not say the truth."""

    element: str
    """Its name in spec.md, also after that of its plane or channel: ``symbol``, ``color_index[1].symbol``,
    ``l21.cholesky_scale``; ``align`` is what `align()` skips."""
    value: Any
    """What is written instead: an int; a list of them for a run; raw ``bytes``; a string of bits such as ``"0110"``; or
    a function from the truth to one of these. A single `f32` is a run of one."""
    occurrence: int = 0  # which of that name, through the stream as it is written: a payload before its chunk


@dataclass
class Liar:
    """The state that the writers of one stream share: the lies, and how often each element has been written."""

    lies: Iterable[Lie]
    counts: Counter[str] = field(default_factory=Counter)
    written: set[Lie] = field(default_factory=set)

    def value_of(self, prefix: str, element: str, truth: Any) -> Any:
        """The value to write for an element, whose full name begins with `prefix`."""
        out = truth
        for name in {element, prefix + element}:
            for lie in self.lies:
                if lie.element == name and lie.occurrence == self.counts[name]:
                    self.written.add(lie)
                    out = lie.value(truth) if callable(lie.value) else lie.value
            self.counts[name] += 1
        return out

    def writer(self, first_bit: int) -> "FaultyWriter":
        """The Writer of a payload or chunk: a `make_writer` for `StreamWriter`."""
        return FaultyWriter(first_bit, self)


class FaultyWriter(Writer):
    """A Writer that writes what a `Liar` says, and goes on as if it had written the truth."""

    def __init__(self, first_bit: int, liar: Liar) -> None:
        super().__init__(first_bit)
        self._liar = liar

    def _emit(self, name: str, truth: Any, write: Callable[[Any], object]) -> None:
        out = self._liar.value_of(self._prefix, name, truth)
        if isinstance(out, bytes) and not isinstance(truth, bytes):
            out = "".join(f"{byte:08b}" for byte in out)
        if isinstance(out, str):
            for bit in out:
                super().u(name, 1, int(bit))
        else:
            write(out)

    def u(self, name: str, size: int, value: int = 0) -> int:
        """`u(size)`."""
        self._emit(name, value, lambda out: super(FaultyWriter, self).u(name, size, out))
        return value

    def le(self, name: str, size: int, value: int = 0) -> int:
        """`le(size)`."""
        self._emit(name, value, lambda out: super(FaultyWriter, self).le(name, size, out))
        return value

    def uv(self, name: str, value: int = 0) -> int:
        """`uv`."""
        self._emit(name, value, lambda out: super(FaultyWriter, self).uv(name, out))
        return value

    def raw(self, name: str, size: int, value: bytes = b"", *, counted: bool = True) -> bytes:
        """A run of bytes."""
        self._emit(name, value, lambda out: super(FaultyWriter, self).raw(name, len(out), out, counted=counted))
        return value

    def fixed(self, name: str, count: int, size: int, values: U2 | None = None) -> U2:
        """A run of `u(size)`."""
        assert values is not None
        self._emit(name, values, lambda out: super(FaultyWriter, self).fixed(name, len(out), size, np.asarray(out)))
        return values

    def golombs(self, name: str, count: int, order: int, values: I8 | None = None) -> I8:
        """A run of `eg(order)`."""
        assert values is not None
        self._emit(name, values, lambda out: super(FaultyWriter, self).golombs(name, len(out), order, np.asarray(out)))
        return values

    def pairs(self, names: tuple[str, str], count: int, values: U4 | None = None) -> Iterator[U4]:
        """A run of pairs of `uv`; the lie is about the first name."""
        assert values is not None
        self._emit(
            names[0], values, lambda out: list(super(FaultyWriter, self).pairs(names, len(out), np.asarray(out)))
        )
        yield values

    def array(self, name: str, count: int, dtype: str, values: NDArray[Any] | None = None) -> NDArray[Any]:
        """A run of `le(2)`, `le(4)`, `f16` or `f32`."""
        assert values is not None

        def write(out: Any) -> None:
            super(FaultyWriter, self).array(name, len(out), dtype, np.asarray(out, dtype))

        self._emit(name, values, write)
        return values


def write_stream(
    header: SequenceHeader,
    frames: Iterable[AnyCodes],
    *,
    index: bool = True,
    ancillary: dict[int, tuple[str, bytes]] | None = None,
    layers: LayersOfFrames | None = None,
    lies: Iterable[Lie] = (),
) -> bytes:
    """The bytes of a stream, with elements that lie.

    The header's `frame_count` becomes that of `frames`. `ancillary` has type and payload of a chunk by the number of
    the frame that it precedes, `layers` those of frames by their number. A UsageError says that the frames break a
    rule, or that no element was written which a lie is about.
    """
    lies = list(lies)
    liar = Liar(lies)
    target = BytesIO()
    frames = list(frames)
    writer = StreamWriter(target, replace(header, frame_count=len(frames)), index=index, make_writer=liar.writer)
    for number, codes in enumerate(frames):
        if ancillary and number in ancillary:
            writer.write_ancillary(*ancillary[number])
        writer.write_frame(codes, layers=dict((layers or {}).get(number, ())))
    writer.finish()
    missing = [lie for lie in lies if lie not in liar.written]
    if missing:
        raise UsageError(f"never written, since the stream has no such element: {missing}")
    return target.getvalue()


def split_chunks(stream: bytes) -> list[tuple[bytes, bytes]]:
    """The chunks (type, payload) of a legal stream, in order."""
    parts = []
    at = PREFIX_SIZE
    while at < len(stream):
        chunk_type = stream[at : at + 1]
        length = shift = 0
        while True:
            at += 1
            length |= (stream[at] & 0x7F) << shift
            shift += 7
            if stream[at] < 0x80:
                break
        parts.append((chunk_type, stream[at + 1 : at + 1 + length]))
        at += 1 + length + 4
    return parts


def join_chunks(chunks: Iterable[tuple[bytes, bytes]], *, prefix: bytes) -> bytes:
    """A stream of `prefix` (magic and version) and chunks (type, payload), with the lengths and checksums they need."""
    stream = prefix
    for chunk_type, payload in chunks:
        body = chunk_type + encode_uv(len(payload)) + payload
        stream += body + crc32c(body).to_bytes(4, "little")
    return stream
