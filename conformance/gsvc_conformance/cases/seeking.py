"""Cases of seeking: frames decoded from the last I-frame before them, whatever an index or a payload before it says."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.building import (
    HEADER,
    Chunks,
    inter_block,
    intra_block,
    operated,
    predicted,
    result,
    stream_of,
)
from gsvc_conformance.cases.container import INDICES_IN_WORDS, entries_of, indices, sequence, with_index
from gsvc_conformance.cases.faults import SMALL_HEADER, end_of
from gsvc_conformance.cases.main_streams import Plan, codes_of, crowd
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.paper import FrameCodes
from gsvc_ref.stream import reconstruct_stream
from gsvc_ref.stream.profiles import AnyCodes
from gsvc_ref.testing import Lie, join_chunks, split_chunks, write_stream

FAR: Final = 2**32 - 1
"""The greatest frame number that may be asked for."""

RANGES: Final = {
    "first_frame": (0, 0), "from_the_first": (0, 4), "in_a_group": (1, 1), "last_of_a_group": (2, 2), "i_frame": (3, 3),
    "r_frame": (4, 4), "behind_an_r_frame": (5, 5), "across_an_i_frame": (2, 4), "across_two_i_frames": (1, 7),
    "last_frame": (7, 7), "to_beyond_the_end": (6, 20), "far_beyond": (5, FAR), "first_beyond_the_end": (8, 8),
    "beyond_the_end": (FAR, FAR),
}  # fmt: skip
"""The first and the last frame, by what is special; the stream has the frames I P P I R P I P."""


@dataclass(frozen=True)
class Groups:
    """A stream of the frames I P P I R P I P, none like another but the R-frame, and ways to damage it.

    Attributes
    ----------
    header
        Its header.
    frames
        Its frames; the second P of the first group uses what is kept.
    one
        An I-frame of one splat.
    """

    header: SequenceHeader
    frames: Callable[[], list[AnyCodes]]
    one: Callable[[], AnyCodes]

    def stream(self, *, index: bool = True) -> bytes:
        """The stream, whose header does not tell the number of its frames."""
        return write_stream(self.header, self.frames(), index=index, lies=[Lie("frame_count", 0)])

    def lying(self, *lies: Lie) -> bytes:
        """The stream with a header that tells the number of its frames, and lies."""
        return write_stream(self.header, self.frames(), lies=lies)

    def late(self, count: int) -> bytes:
        """A paced stream of a frame a second: `count` I-frames and five R-frames, of which the fourth is too late."""
        intra = self.one()
        frames = [*[intra] * count, *[type(intra).repeated_frame()] * 5]
        return write_stream(self.header, frames, index=False, lies=[Lie("flags", 2), Lie("frame_rate_numerator", 1)])

    def damaged(self, chunk: int, data: bytes | None = None) -> bytes:
        """The stream with another last byte in the payload of a chunk, whose checksum stays: frame n is chunk n + 1."""
        data = self.stream() if data is None else data
        chunks = split_chunks(data)
        head = len(join_chunks(chunks[: chunk + 1], prefix=data[:PREFIX_SIZE])) - 5
        return data[:head] + bytes([data[head] ^ 1]) + data[head + 1 :]

    def edited(self, edit: Callable[[Chunks], Chunks]) -> bytes:
        """The stream without index after an operation on its chunks H I P P I R P I P E."""
        return operated(edit, self.stream(index=False))

    def with_chunk(self, place: int, *chunk: tuple[bytes, bytes]) -> bytes:
        """The stream without index with further chunks before the frame of a number."""
        return self.edited(lambda c: [*c[: place + 1], *chunk, *c[place + 1 :]])

    def with_head(self, place: int, head: bytes) -> bytes:
        """The stream without index up to the frame of a number, and other bytes in its place."""
        data = self.stream(index=False)
        return join_chunks(split_chunks(data)[: place + 1], prefix=data[:PREFIX_SIZE]) + head

    def broken_index(self, place: int) -> bytes:
        """The stream without index with an index that does not grow before the frame of a number."""
        return self.with_chunk(place, (b"x", encode_uv(2) + bytes([1, 1, 0, 0])))


def _frames_of_paper() -> list[AnyCodes]:
    first, second, third = (FrameCodes.intra_frame(intra_block(2, first=n)) for n in (0, 3, 6))
    kept = predicted([1, 1], inter_block(2, quantizer=None, books=None))
    moved = predicted([1, 1])
    return [first, moved, kept, second, FrameCodes.repeated_frame(), moved, third, moved]


def _frames_of_main() -> list[AnyCodes]:
    moved = Plan("P", kind="any")
    kept = Plan("P", 1, quantizer=None, own=False)
    intra = Plan("I", 2)
    return [*codes_of(SMALL_HEADER, [intra, moved, kept, intra, Plan("R"), moved, intra, moved], Draws(41))]


PAPER: Final = Groups(HEADER, _frames_of_paper, lambda: FrameCodes.intra_frame(intra_block(1)))
MAIN: Final = Groups(SMALL_HEADER, _frames_of_main, lambda: crowd(SMALL_HEADER, (32, 0), 1))

frames, stream, late, damaged = PAPER.frames, PAPER.stream, PAPER.late, PAPER.damaged
edited, with_chunk, with_head = PAPER.edited, PAPER.with_chunk, PAPER.with_head


def check_slice(expected: Any, data: bytes, first: int, last: int) -> None:
    """What is handed out is what decoding from the start gives for these frames; there is no error."""
    counts, parameters, _ = reconstruct_stream(data)
    ends = np.cumsum([0, *counts])
    here = slice(min(first, len(counts)), min(last + 1, len(counts)))
    assert result(expected, "error") == ""
    assert np.array_equal(result(expected, "counts"), counts[here])
    wanted = parameters[ends[here.start] : ends[here.stop]]
    assert result(expected, "parameters").tobytes() == wanted.tobytes()


@case("core", "seek", flags=["kept"], each={name: name for name in RANGES})
def range_of(value: str) -> Inputs:
    """Frames I P P I R P I P: {key}."""
    first, last = RANGES[value]
    expected = yield {"stream": stream(), "first": first, "last": last}
    check_slice(expected, stream(), first, last)


@case("core", "seek", flags=["index"], each={name: name for name in indices()},
      said=INDICES_IN_WORDS)  # fmt: skip
def index(value: str) -> Inputs:
    """{key}: what is found by hopping is the same."""
    entries = indices()[value]
    data = stream_of(sequence()) if entries is None else with_index(entries)
    expected = yield {"stream": data, "first": 3, "last": 4}
    check_slice(expected, data, 3, 4)


def forged() -> bytes:
    """I (red), an ancillary chunk that holds a whole I-frame 1 (green), I (blue), R, and an index of the green one."""
    colors = [FrameCodes.intra_frame(intra_block(1, first=n)) for n in (0, 1, 2)]
    rest = FrameCodes.repeated_frame()
    data = write_stream(HEADER, [colors[0], colors[2], rest], index=False)
    green = split_chunks(write_stream(HEADER, [colors[0], colors[1]], index=False))[2]
    hidden = join_chunks([green], prefix=b"")
    chunks = split_chunks(data)
    before = join_chunks(chunks[:2], prefix=data[:PREFIX_SIZE])
    inside = len(before) + 1 + len(encode_uv(len(hidden)))
    (_, first), *_ = entries_of(data)
    steps = encode_uv(2) + b"".join(encode_uv(n) for n in (0, first, 1, inside - first))
    return operated(lambda c: [*c[:2], (b"q", hidden), *c[2:-1], (b"x", steps), end_of(3, steps)], data)


@case("core", "seek", flags=["index"], each={"itself": (1, 1), "behind": (2, 2), "beyond": (3, 3)},
      said={"itself": "the frame that it names", "behind": "the one behind",
            "beyond": "what is beyond the end"})  # fmt: skip
def forged_index(value: tuple[int, int]) -> Inputs:
    """A legal stream whose index names a whole I-frame inside of another payload; asked for: {key}.

    A decoder that believes it shows another picture than one that decodes from the start.
    """
    first, last = value
    expected = yield {"stream": forged(), "first": first, "last": last}
    check_slice(expected, forged(), first, last)


@case("core", "seek", flags=["unknown"], each={"i_frame": (3, 3), "behind": (4, 5), "first_i_frame": (1, 1)},
      said={"i_frame": "an I-frame", "behind": "frames after it",
            "first_i_frame": "a frame of the first group"})  # fmt: skip
def ancillary_chunks(value: tuple[int, int]) -> Inputs:
    """There are chunks of unknown types between all others, and an index in the middle; asked for: {key}."""
    first, last = value
    extra: Chunks = [(b"i", b"\0"), (b"z", bytes(300)), (b"x", b"\0"), (b"p", b"")]
    data = edited(lambda c: [c[0], *(part for chunk in c[1:-1] for part in (*extra, chunk)), c[-1]])
    expected = yield {"stream": data, "first": first, "last": last}
    check_slice(expected, data, first, last)


@case("core", "seek", flags=["unknown"])
def indices_behind_the_end() -> Inputs:
    """Two indices before the end chunk, and a frame beyond the end: `index_length` is that of the second one."""
    data = operated(lambda c: [*c[:-2], (b"x", b"\0"), *c[-2:]], stream())
    expected = yield {"stream": data, "first": 8, "last": 9}
    check_slice(expected, data, 8, 9)


@case("core", "seek", rules=["R-6.4-1"])
def frames_beyond_8_bits() -> Inputs:
    """Three hundred frames, an I-frame among the last ones: a counter of frames takes more than 8 bits."""
    head, other = (FrameCodes.intra_frame(intra_block(1, first=n)) for n in (0, 5))
    rest = FrameCodes.repeated_frame()
    data = stream_of([head, *[rest] * 289, other, *[rest] * 8, predicted([1])], index=True)
    expected = yield {"stream": data, "first": 298, "last": 299}
    check_slice(expected, data, 298, 299)


UNSEEN: Final[dict[str, tuple[str, Callable[[], bytes], int, int]]] = {
    "p_frame_before": ("a P-frame before the I-frame is damaged", partial(damaged, 2), 4, 5),
    "i_frame_before": ("an I-frame of an earlier group is damaged", partial(damaged, 1), 3, 3),
    "group_before": ("the I-frame before the last one is damaged", partial(damaged, 4), 6, 7),
    "ancillary_before": ("an ancillary chunk before the I-frame is damaged",
                         lambda: damaged(3, with_chunk(2, (b"q", b"abc"))), 3, 5),
    "ancillary_first": ("an ancillary chunk before the first frame is damaged",
                        lambda: damaged(1, with_chunk(0, (b"q", b"abc"))), 1, 2),
    "index_before": ("an index before the I-frame breaks R-6.7-1", partial(PAPER.broken_index, 2), 4, 4),
    "number_before": ("a frame before the I-frame has a wrong number",
                      partial(PAPER.lying, Lie("frame_number", 9, 1)), 3, 3),
    "behind": ("the frame after the last one asked for is damaged", partial(damaged, 6), 3, 4),
    "end": ("the end chunk is damaged", partial(damaged, 9, stream(index=False)), 6, 7),
    "byte_behind": ("a byte follows the end chunk", lambda: stream() + b"\0", 7, 7),
    "cut_behind": ("the stream ends after the last frame asked for", partial(with_head, 6, b""), 3, 5),
    "elements_before": ("a P-frame before the I-frame has one byte as payload, and the right checksum",
                        lambda: edited(lambda c: [*c[:2], (b"P", b"?"), *c[3:]]), 3, 5),
}  # fmt: skip
"""Faults that neither a hop nor the decoder meets: the sentence, the stream, and the frames asked for."""


@case("core", "seek", rules=["R-12.6-1"], each=UNSEEN,
      said={name: sentence for name, (sentence, *_) in UNSEEN.items()})  # fmt: skip
def unseen_fault(value: tuple[str, Callable[[], bytes], int, int]) -> Inputs:
    """The frames are handed out although {key}."""
    _, make, first, last = value
    expected = yield {"stream": make(), "first": first, "last": last}
    assert result(expected, "error") == ""
    assert len(result(expected, "counts")) == last - first + 1
    sound = reconstruct_stream(stream()).parameters.reshape(8, 2, 8)[first : last + 1]
    assert result(expected, "parameters").tobytes() == sound.tobytes()


@case("core", "seek", rules=["R-5-7", "R-5-8", "R-12.6-4"], each={"group_of_the_first_frame": 1, "later_group": 3})
def pace_is_not_judged(value: int) -> Inputs:
    """In a paced stream an I-frame is due; who seeks frames of the {key} does not judge the pace."""
    expected = yield {"stream": late(value), "first": value, "last": value + 4}
    assert (result(expected, "error"), len(result(expected, "counts"))) == ("", 5)


@case("core", "seek", rules=["R-5-7", "R-12.6-4"])
def sums_of_a_second_are_not_judged() -> Inputs:
    """A second of a paced stream has 65 of the largest frames, and who seeks to its last ones does not judge that."""
    frames = [FrameCodes.intra_frame(None), *[FrameCodes.repeated_frame()] * 64]
    lies = [Lie("flags", 2), Lie("frame_rate_numerator", 65)]
    data = write_stream(replace(HEADER, width=512, height=256), frames, index=False, lies=lies)
    expected = yield {"stream": data, "first": 1, "last": 64}
    assert (result(expected, "error"), len(result(expected, "counts"))) == ("", 64)


@case("core", "seek", rules=["R-6.8-2", "R-12.6-6"])
def beyond_the_end_without_index() -> Inputs:
    """A frame beyond the end is asked for of a stream without index, so no index was hopped over."""
    expected = yield {"stream": stream(index=False), "first": 8, "last": 8}
    assert (result(expected, "error"), len(result(expected, "counts"))) == ("", 0)


@case("core", "seek", rules=["R-12.6-6"])
def fewer_frames_although_damaged() -> Inputs:
    """A frame beyond the end is asked for, and the stream has fewer; a damaged frame is hopped over."""
    expected = yield {"stream": damaged(5), "first": 8, "last": 8}
    assert (result(expected, "error"), len(result(expected, "counts"))) == ("", 0)
