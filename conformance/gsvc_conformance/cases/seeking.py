"""Cases of seeking: frames decoded from the last I-frame before them, whatever an index or a payload before it says."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np

from gsvc_conformance.case import Fault, Inputs, add, case
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
from gsvc_conformance.cases.faults import end_of
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.paper import FrameCodes
from gsvc_ref.stream import reconstruct_stream
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


def late(count: int) -> bytes:
    """A paced stream of a frame a second, `count` I-frames and five R-frames, of which the fourth comes too late."""
    frames = [*[FrameCodes.intra_frame(intra_block(1))] * count, *[FrameCodes.repeated_frame()] * 5]
    return write_stream(HEADER, frames, index=False, lies=[Lie("flags", 2), Lie("frame_rate_numerator", 1)])


def frames() -> list[FrameCodes]:
    """Frames I P P I R P I P, none like another but the R-frame; the second P of the first group uses what is kept."""
    first, second, third = (FrameCodes.intra_frame(intra_block(2, first=n)) for n in (0, 3, 6))
    kept = predicted([1, 1], inter_block(2, quantizer=None, books=None))
    moved = predicted([1, 1])
    return [first, moved, kept, second, FrameCodes.repeated_frame(), moved, third, moved]


def stream(*, index: bool = True) -> bytes:
    """The stream of `frames`, whose header does not tell their number."""
    return write_stream(HEADER, frames(), index=index, lies=[Lie("frame_count", 0)])


def damaged(chunk: int, data: bytes | None = None) -> bytes:
    """The stream with another last byte in the payload of a chunk, whose checksum stays: frame n is chunk n + 1."""
    data = stream() if data is None else data
    chunks = split_chunks(data)
    head = len(join_chunks(chunks[: chunk + 1], prefix=data[:PREFIX_SIZE])) - 5
    return data[:head] + bytes([data[head] ^ 1]) + data[head + 1 :]


def edited(edit: Callable[[Chunks], Chunks]) -> bytes:
    """The stream without index after an operation on its chunks H I P P I R P I P E."""
    return operated(edit, stream(index=False))


def with_chunk(place: int, *chunk: tuple[bytes, bytes]) -> bytes:
    """The stream without index with further chunks before the frame of a number."""
    return edited(lambda c: [*c[: place + 1], *chunk, *c[place + 1 :]])


def with_head(place: int, head: bytes) -> bytes:
    """The stream without index up to the frame of a number, and other bytes in its place."""
    data = stream(index=False)
    return join_chunks(split_chunks(data)[: place + 1], prefix=data[:PREFIX_SIZE]) + head


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


def _broken_index(place: int) -> bytes:
    return with_chunk(place, (b"x", encode_uv(2) + bytes([1, 1, 0, 0])))


UNSEEN: Final[dict[str, tuple[str, Callable[[], bytes], int, int]]] = {
    "p_frame_before": ("a P-frame before the I-frame is damaged", partial(damaged, 2), 4, 5),
    "i_frame_before": ("an I-frame of an earlier group is damaged", partial(damaged, 1), 3, 3),
    "group_before": ("the I-frame before the last one is damaged", partial(damaged, 4), 6, 7),
    "ancillary_before": ("an ancillary chunk before the I-frame is damaged",
                         lambda: damaged(3, with_chunk(2, (b"q", b"abc"))), 3, 5),
    "ancillary_first": ("an ancillary chunk before the first frame is damaged",
                        lambda: damaged(1, with_chunk(0, (b"q", b"abc"))), 1, 2),
    "index_before": ("an index before the I-frame breaks R-6.7-1", partial(_broken_index, 2), 4, 4),
    "number_before": ("a frame before the I-frame has a wrong number",
                      lambda: write_stream(HEADER, frames(), lies=[Lie("frame_number", 9, 1)]), 3, 3),
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


def _lies(*lies: Lie) -> bytes:
    return write_stream(HEADER, frames(), lies=lies)


def _swallowing() -> bytes:
    """A P-frame whose length takes in the chunk after it, so that its checksum is found where that of the next is."""
    data = stream(index=False)
    chunks = split_chunks(data)
    whole = join_chunks(chunks[2:4], prefix=b"")
    return operated(lambda c: [*c[:2], (b"P", whole), *c[4:]], data)


def _kept_inter() -> bytes:
    """Frames I P I P, the last of which has no quantiser of its own; that of the first P-frame is forgotten."""
    own = predicted([1, 1])
    flags = [FrameCodes.intra_frame(intra_block(2)), own, FrameCodes.intra_frame(intra_block(2, first=3)), own]
    return write_stream(HEADER, flags, lies=[Lie("quantizer_present", 0, 3)])


FAULTS: Final[dict[str, tuple[str, str, str, Callable[[], bytes], int, int, int]]] = {
    "damaged_first": ("malformed R-6.2-2", "the frame asked for is damaged", "it is sound",
                      partial(damaged, 3), 2, 2, 0),
    "damaged_within": ("malformed R-6.2-2", "the second frame of the range is damaged", "it is sound",
                       partial(damaged, 6), 4, 6, 1),
    "damaged_i_frame": ("malformed R-6.2-2", "the I-frame before the frame is damaged",
                        "it is sound; no earlier one takes its place", partial(damaged, 4), 5, 5, 0),
    "damaged_between": ("malformed R-6.2-2", "a frame between the I-frame and the frame is damaged", "it is sound",
                        partial(damaged, 2), 2, 2, 0),
    "damaged_ancillary_between": ("malformed R-6.2-2", "an ancillary chunk after the I-frame is damaged",
                                  "it is sound",
                                  lambda: damaged(3, with_chunk(2, (b"q", b"abc"))), 2, 2, 0),
    "damaged_ancillary_first": ("malformed R-6.2-2",
                                "an ancillary chunk before frame 0, which is asked for, is damaged",
                                "nothing is hopped over to frame 0",
                                lambda: damaged(1, with_chunk(0, (b"q", b"abc"))), 0, 1, 0),
    "damaged_header": ("malformed R-6.2-2", "the sequence header is damaged", "it is sound",
                       partial(damaged, 0), 6, 6, 0),
    "magic": ("malformed R-6.1-1", "the magic number is another", "it is that of 6.1",
              lambda: _lies(Lie("magic", b"\x89PNG\r\n\x1a\n")), 6, 6, 0),
    "type_on_the_way": ("malformed R-6.2-1", "a chunk before the I-frame has the type 1", "types are ASCII letters",
                        partial(with_chunk, 2, (b"1", b"")), 5, 5, 0),
    "length_on_the_way": ("malformed R-3.1-1", "a length before the I-frame takes a byte too many",
                          "it has the fewest bytes", partial(with_head, 1, b"P\x80\0" + bytes(200)), 5, 5, 0),
    "limit_on_the_way": ("limit R-5-3", "a chunk before the I-frame claims 2^20 + 1 bytes", "at most 2^20",
                         partial(with_head, 1, b"P" + encode_uv(2**20 + 1)), 5, 5, 0),
    "long_header_on_the_way": ("limit R-5-3", "a second header claims 1025 bytes", "at most 1024, and one",
                               partial(with_chunk, 1, (b"H", bytes(1025))), 5, 5, 0),
    "unknown_on_the_way": ("unsupported R-3.2-1", "a chunk before the I-frame has the critical type B",
                           "such types are reserved", partial(with_chunk, 2, (b"B", b"\0")), 5, 5, 0),
    "header_on_the_way": ("invalid R-6.1-3", "a second sequence header stands before the I-frame", "there is one",
                          lambda: edited(lambda c: [*c[:3], c[0], *c[3:]]), 5, 5, 0),
    "cut_at_a_chunk": ("malformed R-6.2-4", "the stream ends after a frame before the one asked for",
                       "it has an end chunk",
                       partial(with_head, 4, b""), 5, 5, 0),
    "cut_in_a_length": ("malformed R-6.2-4", "the stream ends in a length", "chunks are complete",
                        partial(with_head, 4, b"P\x80"), 5, 5, 0),
    "cut_in_a_payload": ("malformed R-6.2-4", "the stream ends in a payload", "chunks are complete",
                         partial(with_head, 4, b"R\x02\0"), 5, 5, 0),
    "cut_in_a_checksum": ("malformed R-6.2-4", "the stream ends in the checksum of the frame asked for",
                          "chunks are complete", partial(with_head, 4, b"R\x01\0\0\0\0"), 4, 4, 0),
    "cut_behind_damage": ("malformed R-6.2-4", "the I-frame is damaged, and the stream ends before the frame asked for",
                          "the hop, which meets the end, comes first",
                          lambda: damaged(4, with_head(4, b"R\x09\0")), 4, 4, 0),
    "r_frame_first": ("invalid R-6.4-2", "the first frame is an R-frame", "it is an I-frame",
                      lambda: edited(lambda c: [c[0], (b"R", b"\0"), *c[2:]]), 4, 4, 0),
    "no_frame": ("invalid R-6.1-5", "there is no frame", "there is at least one",
                 lambda: edited(lambda c: [c[0], end_of(0)]), 4, 4, 0),
    "number_of_the_i_frame": ("invalid R-6.4-1", "the I-frame has the number 4", "it is the fourth frame, which has 3",
                              lambda: _lies(Lie("frame_number", 4, 3)), 5, 5, 0),
    "frame_missing": ("invalid R-6.4-1", "a frame before the I-frame is missing", "frames are counted",
                      lambda: edited(lambda c: [*c[:3], *c[4:]]), 5, 6, 0),
    "frame_twice": ("invalid R-6.4-1", "a frame before the I-frame stands twice", "frames are counted",
                    lambda: edited(lambda c: [*c[:3], *c[2:]]), 5, 5, 0),
    "frame_swallowed": ("invalid R-6.4-1", "the length of a P-frame takes in the frame after it", "frames are counted",
                        _swallowing, 5, 5, 0),
    "index_between": ("invalid R-6.7-1", "an index after the I-frame does not grow", "frame numbers and offsets grow",
                      partial(_broken_index, 4), 4, 5, 0),
    "kept_over_the_i_frame": ("invalid R-6.5-4", "a P-frame uses a quantiser from before the I-frame",
                             "it is forgotten",
                              _kept_inter, 3, 3, 0),
    "i_frame_due": ("limit R-5-8", "in a paced stream an I-frame is due, and another frame comes",
                    "from frame 0 on, nothing is hopped over, and the pace is judged",
                    lambda: late(1), 0, 5, 4),
    "end_damaged": ("malformed R-6.2-2", "the end chunk is damaged, and a frame beyond it is asked for", "it is sound",
                    partial(damaged, 9, stream(index=False)), 8, 8, 0),
    "end_of_the_range_damaged": ("malformed R-6.2-2",
                                 "the end chunk is damaged, and frames up to one beyond it are asked for",
                                 "it is sound", partial(damaged, 9, stream(index=False)), 6, 8, 2),
    "frame_count": ("invalid R-6.8-1", "the end chunk says 9 frames, and frame 8 is asked for", "there are 8",
                    lambda: edited(lambda c: [*c[:-1], end_of(9)]), 8, 8, 0),
    "index_length": ("invalid R-6.8-2", "index_length is 0 after an index, and frame 8 is asked for", "it is its size",
                     lambda: _lies(Lie("index_length", 0)), 8, 8, 0),
    "byte_behind_the_end": ("invalid R-6.1-4", "a byte follows the end chunk, and frame 8 is asked for",
                            "nothing follows",
                            lambda: stream() + b"\0", 8, 8, 0),
    "end_early": ("invalid R-6.1-4", "an end chunk stands between frames", "nothing follows it",
                  lambda: edited(lambda c: [*c[:3], end_of(2), *c[3:]]), 5, 5, 0),
}  # fmt: skip
"""Faults that are met: kind and rule, the lie, the truth, the stream, the frames asked for, and how many precede it."""


def faulty(value: tuple[str, str, str, Callable[[], bytes], int, int, int]) -> Inputs:
    """What a hop or the decoder meets is the error, and frames before it are handed out."""
    error, _, _, make, first, last, complete = value
    expected = yield {"stream": make(), "first": first, "last": last}
    assert result(expected, "error").rpartition(" ")[0] == error
    assert len(result(expected, "counts")) == complete


for what, entry in FAULTS.items():
    rule = entry[0].split()[1]
    add(
        "faulty",
        "seek",
        f"{rule.lower().replace('-', '_').replace('.', '_')}_{what}",
        title=f"{rule} is broken: {entry[1]}.",
        reason="" if entry[-1] == 0 else f"Frames before the fault: {entry[-1]}.",
        rules=[rule, "R-12.6-1", "R-12.6-7"],
        flags=["check-order"] if what == "cut_behind_damage" else [],
        fault=Fault(entry[1], entry[2]),
        function=faulty,
        arguments={"value": entry},
    )
