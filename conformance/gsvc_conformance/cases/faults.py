"""Faulty streams, and short ways to make one: of both profiles where a fault is one of the container."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from gsvc_base.draws import Draws
from gsvc_conformance.cases.building import HEADER, Chunks, intra_block, operated, predicted, quantizer_of
from gsvc_conformance.cases.main_streams import MAIN_HEADER, Plan, codes_of
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.coder import Element, encode_uv
from gsvc_ref.bitstream.header import MAIN as MAIN_PROFILE
from gsvc_ref.bitstream.rans import encode_plane
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.paper import FrameCodes, SplatBlock
from gsvc_ref.stream import StreamReader
from gsvc_ref.stream.profiles import AnyCodes
from gsvc_ref.testing import OVERVIEW_HEADER, RICH_HEADER, Lie, overview_frames, rich_frames, write_stream

CRC_SIZE: Final = 4
"""Bytes of `chunk_crc`."""


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
    twin
        Whether profile `paper` has such a fault, too, so that the slug says that this one is of `main`.
    """

    rule: str
    kind: str
    what: str
    lie: str
    truth: str
    make: Callable[[], bytes]
    complete: int = 0
    also: tuple[str, ...] = ()
    twin: bool = False

    @property
    def slug(self) -> str:
        """The rule in lower case with underscores, and what is wrong."""
        return f"{slug_of(self.rule)}_{'main_' * self.twin}{self.what}"


def slug_of(rule: str) -> str:
    """A rule as slugs have it."""
    return rule.lower().replace("-", "_").replace(".", "_")


def each_of(
    rule: str, kind: str, truth: str, entries: Mapping[str, tuple[str, tuple[Lie, ...]]], of: Callable[..., bytes],
    complete: int = 0,
) -> Iterator[Broken]:  # fmt: skip
    """A faulty stream per entry: what is special, the sentence, and the lies."""
    for what, (lie, lies) in entries.items():
        yield Broken(rule, kind, what, lie, truth, partial(of, *lies), complete)


@dataclass(frozen=True)
class Sound:
    """Sound streams of a profile, in which faults of the container are planted.

    Attributes
    ----------
    header, frames
        Those of the overview: one splat, frames I P R.
    plain_frames
        Frames I P R whose elements end where they say: a run of profile `main` ends with the payload.
    header_of_three, three_frames
        Those of a stream of two groups, frames I P I.
    """

    header: SequenceHeader
    frames: Callable[[], Sequence[AnyCodes]]
    plain_frames: Callable[[], Sequence[AnyCodes]]
    header_of_three: SequenceHeader
    three_frames: Callable[[], Sequence[AnyCodes]]

    @property
    def is_main(self) -> bool:
        """Whether the profile is `main`."""
        return self.header.profile == MAIN_PROFILE

    def overview(self, *lies: Lie, index: bool = True, **header: Any) -> bytes:
        """The overview stream with lies."""
        return write_stream(replace(self.header, **header), self.frames(), index=index, lies=lies)

    def plain(self, *lies: Lie, index: bool = True) -> bytes:
        """A stream of the plain frames with lies."""
        return write_stream(self.header, self.plain_frames(), index=index, lies=lies)

    def three(self, *lies: Lie) -> bytes:
        """The stream of two groups with its index; with lies."""
        return write_stream(self.header_of_three, self.three_frames(), lies=lies)

    def edited(self, edit: Callable[[Chunks], Chunks], *lies: Lie) -> bytes:
        """The overview without index, with lies, after an operation on its chunks H I P R E."""
        return operated(edit, self.overview(*lies, index=False))

    def with_payload(self, number: int, edit: Callable[[bytes], bytes]) -> bytes:
        """The plain stream without index, with another payload of one of its chunks H I P R E."""

        def operation(chunks: Chunks) -> Chunks:
            chunks[number] = chunks[number][0], edit(chunks[number][1])
            return chunks

        return operated(operation, self.plain(index=False))

    def with_chunk(self, chunk_type: bytes, payload: bytes = b"") -> bytes:
        """The overview without index, with one more chunk after its I-frame."""
        return self.edited(lambda c: [*c[:2], (chunk_type, payload), *c[2:]])


def _groups_of_paper() -> list[AnyCodes]:
    """Frames I P I of one splat each, all with quantisers and codebooks of their own."""
    intra = FrameCodes.intra_frame(intra_block(1))
    return [intra, predicted([1]), intra]


PAPER: Final = Sound(OVERVIEW_HEADER, overview_frames, overview_frames, HEADER, _groups_of_paper)

SMALL_HEADER: Final = replace(MAIN_HEADER, width=16, height=12, max_lane_exponent=0)
"""The header of profile `main` with the least that a frame takes."""


def _small_frames(*plans: Plan) -> list[MainCodes]:
    """Frames of profile `main` as planned."""
    return codes_of(SMALL_HEADER, plans, Draws(15))


MAIN: Final = Sound(
    SMALL_HEADER, partial(_small_frames, Plan("I", 1), Plan("P"), Plan("R")),
    partial(_small_frames, Plan("I"), Plan("P"), Plan("R")),
    SMALL_HEADER, partial(_small_frames, Plan("I", 1), Plan("P"), Plan("I", 1)),
)  # fmt: skip

overview = PAPER.overview
three = PAPER.three


def rich(*lies: Lie, **header: Any) -> bytes:
    """The rich stream with lies: 60 splats, frames I P R I P, an index, checksums."""
    return write_stream(replace(RICH_HEADER, **header), rich_frames(), lies=lies)


def four(*lies: Lie) -> bytes:
    """Frames I P I P of one splat each, all with quantisers and codebooks of their own; with lies."""
    intra = FrameCodes.intra_frame(intra_block(1))
    return write_stream(HEADER, [intra, predicted([1])] * 2, lies=lies)


def with_an_empty_frame(*lies: Lie) -> bytes:
    """Frames I I P: one splat, no splat, and one new splat with quantiser and codebooks of its own; with lies."""
    frames = [FrameCodes.intra_frame(intra_block(1)), FrameCodes.intra_frame(None), predicted([], None, intra_block(1))]
    return write_stream(HEADER, frames, lies=lies)


def end_of(frame_count: int, index: bytes | None = None) -> tuple[bytes, bytes]:
    """An end chunk, after an index of this payload, or after none."""
    length = 0 if index is None else 1 + len(encode_uv(len(index))) + len(index) + CRC_SIZE
    return b"E", frame_count.to_bytes(4, "little") + length.to_bytes(4, "little")


def count_unknown(header: bytes) -> bytes:
    """The payload of a sequence header whose frame count is 0."""
    return header[:19] + bytes(4) + header[23:]


def flat(count: int, *lies: Lie, width: int, height: int, **others: Any) -> bytes:
    """A stream of one I-frame of equal splats with l11 = l22 = 1; the header may have `others` of its elements set."""
    zeros = np.zeros((count, 3), np.uint16)
    quantizer = quantizer_of([1, 1, 1], [1, 0, 1])
    block = SplatBlock(zeros[:, :2], zeros, zeros[:, :1], quantizer, (np.zeros((1, 3), np.float16),))
    header = replace(OVERVIEW_HEADER, width=width, height=height, **others)
    return write_stream(header, [FrameCodes.intra_frame(block)], lies=lies)


def with_table(plane: str, symbols: ArrayLike, frequencies: ArrayLike, *lies: Lie) -> bytes:
    """The rich stream without checksums, in whose first I-frame a coded plane has other symbols and another table.

    States and words are those of the table (frequencies of 12 bits from symbol 0 on), so a table that breaks a rule is
    all that is wrong; further lies come on top.
    """
    states, words = encode_plane(np.asarray(symbols), np.asarray(frequencies), 12, 2)
    said = {"table_bits": 12, "first_symbol": 0, "last_symbol": np.size(frequencies) - 1, "frequency": frequencies,
            "word_count": len(words), "lane_state": states, "word": words}  # fmt: skip
    table = [Lie(f"{plane}.{element}", value) for element, value in said.items()]
    return rich(*table, *lies, parameter_checksum_flag=False)


def colored(step: int, *lies: Lie) -> bytes:
    """An I-frame of two splats, whose indices into a codebook of 5 are 0 and `step`."""
    block = rich_frames()[0].intra
    assert block is not None
    assert block.positions is not None
    assert block.cholesky is not None
    colors = np.array([[0, 0], [step, 0]], np.uint16)
    few = replace(block, positions=block.positions[:2], cholesky=block.cholesky[:2], colors=colors)
    header = replace(RICH_HEADER, parameter_checksum_flag=False)
    return write_stream(header, [FrameCodes.intra_frame(few)], lies=lies)


def elements_of(data: bytes) -> list[Element]:
    """The elements of a legal stream."""
    elements: list[Element] = []
    list(StreamReader(data, trace=elements.append))
    return elements


def value_of(data: bytes, name: str) -> Any:
    """The value of the first element of a name in a legal stream."""
    return next(e.value for e in elements_of(data) if e.name.endswith(name))


def room_behind(data: bytes, name: str) -> int:
    """The bytes left in the payload after the first element of a name in a legal stream."""
    elements = elements_of(data)
    element = next(e for e in elements if e.name.endswith(name))
    end = min(e.bit for e in elements if e.name == "chunk_crc" and e.bit > element.bit)
    return (end - element.bit - element.bits) // 8
