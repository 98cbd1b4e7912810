"""What a faulty stream is, and short ways to make one."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from conformance.cases.building import HEADER, Chunks, intra_block, operated, predicted, quantizer_of
from gsvc_ref.bitstream import StreamReader
from gsvc_ref.bitstream.coder import Element
from gsvc_ref.reconstruction import FrameCodes, SplatBlock
from gsvc_ref.testing import OVERVIEW_HEADER, RICH_HEADER, Lie, overview_frames, rich_frames, write_stream


@dataclass(frozen=True)
class Broken:
    """A faulty stream.

    Attributes
    ----------
    rule, kind
        The rule that it breaks, and so the kind of the error.
    what
        The rest of its slug.
    lie, truth
        What the stream says, and what would be legal.
    make
        Its bytes.
    complete
        How many frames precede the fault.
    also
        Rules that it breaks as well, but that are checked later.
    """

    rule: str
    kind: str
    what: str
    lie: str
    truth: str
    make: Callable[[], bytes]
    complete: int = 0
    also: tuple[str, ...] = ()

    @property
    def slug(self) -> str:
        """The rule in lower case with underscores, and what is wrong."""
        return f"{self.rule.lower().replace('-', '_').replace('.', '_')}_{self.what}"


def rich(*lies: Lie, **header: Any) -> bytes:
    """The rich stream with lies: 60 splats, frames I P R I P, an index, checksums."""
    return write_stream(replace(RICH_HEADER, **header), rich_frames(), lies=lies)


def overview(*lies: Lie, index: bool = True, **header: Any) -> bytes:
    """The overview stream with lies: one splat, frames I P R."""
    return write_stream(replace(OVERVIEW_HEADER, **header), overview_frames(), index=index, lies=lies)


def three(*lies: Lie) -> bytes:
    """Frames I P I of one splat each, all with quantisers and codebooks of their own, and an index; with lies."""
    intra = FrameCodes.intra_frame(intra_block(1))
    return write_stream(HEADER, [intra, predicted([1]), intra], lies=lies)


def with_an_empty_frame(*lies: Lie) -> bytes:
    """Frames I I P: one splat, no splat, and one new splat with quantiser and codebooks of its own; with lies."""
    frames = [FrameCodes.intra_frame(intra_block(1)), FrameCodes.intra_frame(None), predicted([], None, intra_block(1))]
    return write_stream(HEADER, frames, lies=lies)


def with_payload(number: int, edit: Callable[[bytes], bytes]) -> bytes:
    """The overview stream without index, chunks H I P R E, with another payload of one chunk."""

    def operation(chunks: Chunks) -> Chunks:
        chunks[number] = chunks[number][0], edit(chunks[number][1])
        return chunks

    return operated(operation)


def with_chunk(chunk_type: bytes, payload: bytes = b"") -> bytes:
    """The overview stream without index, with one more chunk behind its I-frame."""
    return operated(lambda c: [*c[:2], (chunk_type, payload), *c[2:]])


def end_of(frame_count: int) -> tuple[bytes, bytes]:
    """An end chunk without index."""
    return b"E", frame_count.to_bytes(4, "little") + bytes(4)


def count_unknown(header: bytes) -> bytes:
    """The payload of a sequence header whose frame count is 0."""
    return header[:19] + bytes(4) + header[23:]


def flat(count: int, *lies: Lie, width: int, height: int, checked: bool = False) -> bytes:
    """A stream of one I-frame of equal splats with l11 = l22 = 1; its parameters may be `checked`."""
    zeros = np.zeros((count, 3), np.uint16)
    quantizer = quantizer_of([1, 1, 1], [1, 0, 1])
    block = SplatBlock(zeros[:, :2], zeros, zeros[:, :1], quantizer, (np.zeros((1, 3), np.float16),))
    header = replace(OVERVIEW_HEADER, width=width, height=height, parameter_checksum_flag=checked)
    return write_stream(header, [FrameCodes.intra_frame(block)], lies=lies)


def colored(step: int, *lies: Lie) -> bytes:
    """An I-frame of two splats, whose indices into a codebook of 5 are 0 and `step`."""
    block = rich_frames()[0].intra
    assert block is not None
    assert block.positions is not None
    assert block.cholesky is not None
    colors = np.array([[0, 0], [step, 0]], np.uint16)
    few = replace(block, positions=block.positions[:2], cholesky=block.cholesky[:2], colors=colors)
    return write_stream(RICH_HEADER, [FrameCodes.intra_frame(few)], lies=lies)


def room_behind(data: bytes, name: str) -> int:
    """The bytes left in the payload behind the first element of a name in a legal stream."""
    elements: list[Element] = []
    list(StreamReader(data, trace=elements.append))
    element = next(e for e in elements if e.name.endswith(name))
    end = min(e.bit for e in elements if e.name == "chunk_crc" and e.bit > element.bit)
    return (end - element.bit - element.bits) // 8
