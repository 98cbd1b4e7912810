"""Faulty seeks: faults in the chunks that a decoder hops over and in the frames that it decodes (spec.md 12.6)."""

from collections.abc import Callable
from functools import partial
from typing import Final

from gsvc_conformance.case import Fault, Inputs, add
from gsvc_conformance.cases.building import HEADER, intra_block, predicted, result
from gsvc_conformance.cases.faults import end_of, slug_of
from gsvc_conformance.cases.faulty_main import streams
from gsvc_conformance.cases.main_streams import Plan
from gsvc_conformance.cases.seeking import MAIN, PAPER, Groups
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.paper import FrameCodes
from gsvc_ref.testing import Lie, join_chunks, split_chunks, write_stream


def _swallowing(of: Groups) -> bytes:
    """A P-frame whose length takes in the chunk after it, so that its checksum is found where that of the next is."""
    whole = join_chunks(split_chunks(of.stream(index=False))[2:4], prefix=b"")
    return of.edited(lambda c: [*c[:2], (b"P", whole), *c[4:]])


def _kept_in_paper() -> bytes:
    """Frames I P I P, the last of which has no quantiser of its own; that of the first P-frame is forgotten."""
    own = predicted([1, 1])
    flags = [FrameCodes.intra_frame(intra_block(2)), own, FrameCodes.intra_frame(intra_block(2, first=3)), own]
    return write_stream(HEADER, flags, lies=[Lie("quantizer_present", 0, 3)])


Entry = tuple[str, str, str, Callable[[], bytes], int, int, int]
"""A fault that is met: kind and rule, the lie, the truth, the stream, the frames asked for, and how many precede it."""


def seek_faults(of: Groups) -> dict[str, Entry]:
    """All that streams of any profile can have, by the ends of their slugs."""
    return {
        "damaged_first": ("malformed R-6.2-2", "the frame asked for is damaged", "it is sound",
                          partial(of.damaged, 3), 2, 2, 0),
        "damaged_within": ("malformed R-6.2-2", "the second frame of the range is damaged", "it is sound",
                           partial(of.damaged, 6), 4, 6, 1),
        "damaged_i_frame": ("malformed R-6.2-2", "the I-frame before the frame is damaged",
                            "it is sound; no earlier one takes its place", partial(of.damaged, 4), 5, 5, 0),
        "damaged_between": ("malformed R-6.2-2", "a frame between the I-frame and the frame is damaged", "it is sound",
                            partial(of.damaged, 2), 2, 2, 0),
        "damaged_ancillary_between": ("malformed R-6.2-2", "an ancillary chunk after the I-frame is damaged",
                                      "it is sound",
                                      lambda: of.damaged(3, of.with_chunk(2, (b"q", b"abc"))), 2, 2, 0),
        "damaged_ancillary_first": ("malformed R-6.2-2",
                                    "an ancillary chunk before frame 0, which is asked for, is damaged",
                                    "nothing is hopped over to frame 0",
                                    lambda: of.damaged(1, of.with_chunk(0, (b"q", b"abc"))), 0, 1, 0),
        "damaged_header": ("malformed R-6.2-2", "the sequence header is damaged", "it is sound",
                           partial(of.damaged, 0), 6, 6, 0),
        "type_on_the_way": ("malformed R-6.2-1", "a chunk before the I-frame has the type 1", "types are ASCII letters",
                            partial(of.with_chunk, 2, (b"1", b"")), 5, 5, 0),
        "length_on_the_way": ("malformed R-3.1-1", "a length before the I-frame takes a byte too many",
                              "it has the fewest bytes", partial(of.with_head, 1, b"P\x80\0" + bytes(200)), 5, 5, 0),
        "limit_on_the_way": ("limit R-5-3", "a chunk before the I-frame claims 2^20 + 1 bytes", "at most 2^20",
                             partial(of.with_head, 1, b"P" + encode_uv(2**20 + 1)), 5, 5, 0),
        "long_header_on_the_way": ("limit R-5-3", "a second header claims 1025 bytes", "at most 1024, and one",
                                   partial(of.with_chunk, 1, (b"H", bytes(1025))), 5, 5, 0),
        "unknown_on_the_way": ("unsupported R-3.2-1", "a chunk before the I-frame has the critical type B",
                               "such types are reserved", partial(of.with_chunk, 2, (b"B", b"\0")), 5, 5, 0),
        "header_on_the_way": ("invalid R-6.1-3", "a second sequence header stands before the I-frame", "there is one",
                              lambda: of.edited(lambda c: [*c[:3], c[0], *c[3:]]), 5, 5, 0),
        "cut_at_a_chunk": ("malformed R-6.2-4", "the stream ends after a frame before the one asked for",
                           "it has an end chunk",
                           partial(of.with_head, 4, b""), 5, 5, 0),
        "cut_in_a_length": ("malformed R-6.2-4", "the stream ends in a length", "chunks are complete",
                            partial(of.with_head, 4, b"P\x80"), 5, 5, 0),
        "cut_in_a_payload": ("malformed R-6.2-4", "the stream ends in a payload", "chunks are complete",
                             partial(of.with_head, 4, b"R\x02\0"), 5, 5, 0),
        "cut_in_a_checksum": ("malformed R-6.2-4", "the stream ends in the checksum of the frame asked for",
                              "chunks are complete", partial(of.with_head, 4, b"R\x01\0\0\0\0"), 4, 4, 0),
        "cut_behind_damage": ("malformed R-6.2-4",
                              "the I-frame is damaged, and the stream ends before the frame asked for",
                              "the hop, which meets the end, comes first",
                              lambda: of.damaged(4, of.with_head(4, b"R\x09\0")), 4, 4, 0),
        "r_frame_first": ("invalid R-6.4-2", "the first frame is an R-frame", "it is an I-frame",
                          lambda: of.edited(lambda c: [c[0], (b"R", b"\0"), *c[2:]]), 4, 4, 0),
        "no_frame": ("invalid R-6.1-5", "there is no frame", "there is at least one",
                     lambda: of.edited(lambda c: [c[0], end_of(0)]), 4, 4, 0),
        "no_frame_behind_damage": ("invalid R-6.1-5", "there is no frame, and the end chunk is damaged",
                                   "the hop, which meets the end, comes first",
                                   lambda: of.damaged(1, of.edited(lambda c: [c[0], end_of(0)])), 4, 4, 0),
        "number_of_the_i_frame": ("invalid R-6.4-1", "the I-frame has the number 4",
                                  "it is the fourth frame, which has 3",
                                  lambda: of.lying(Lie("frame_number", 4, 3)), 5, 5, 0),
        "frame_missing": ("invalid R-6.4-1", "a frame before the I-frame is missing", "frames are counted",
                          lambda: of.edited(lambda c: [*c[:3], *c[4:]]), 5, 6, 0),
        "frame_twice": ("invalid R-6.4-1", "a frame before the I-frame stands twice", "frames are counted",
                        lambda: of.edited(lambda c: [*c[:3], *c[2:]]), 5, 5, 0),
        "frame_swallowed": ("invalid R-6.4-1", "the length of a P-frame takes in the frame after it",
                            "frames are counted",
                            partial(_swallowing, of), 5, 5, 0),
        "index_between": ("invalid R-6.7-1", "an index after the I-frame does not grow",
                          "frame numbers and offsets grow",
                          partial(of.broken_index, 4), 4, 5, 0),
        "i_frame_due": ("limit R-5-8", "in a paced stream an I-frame is due, and another frame comes",
                        "from frame 0 on, nothing is hopped over, and the pace is judged",
                        lambda: of.late(1), 0, 5, 4),
        "end_damaged": ("malformed R-6.2-2", "the end chunk is damaged, and a frame beyond it is asked for",
                        "it is sound",
                        lambda: of.damaged(9, of.stream(index=False)), 8, 8, 0),
        "end_of_the_range_damaged": ("malformed R-6.2-2",
                                     "the end chunk is damaged, and frames up to one beyond it are asked for",
                                     "it is sound", lambda: of.damaged(9, of.stream(index=False)), 6, 8, 2),
        "frame_count": ("invalid R-6.8-1", "the end chunk says 9 frames, and frame 8 is asked for", "there are 8",
                        lambda: of.edited(lambda c: [*c[:-1], end_of(9)]), 8, 8, 0),
        "frame_count_of_the_header": ("invalid R-6.3-2", "the header says 9 frames, and frame 8 is asked for",
                                      "there are 8", lambda: of.lying(Lie("frame_count", 9)), 8, 8, 0),
        "index_length": ("invalid R-6.8-2", "index_length is 0 after an index, and frame 8 is asked for",
                         "it is its size",
                         lambda: of.lying(Lie("index_length", 0)), 8, 8, 0),
        "byte_behind_the_end": ("invalid R-6.1-4", "a byte follows the end chunk, and frame 8 is asked for",
                                "nothing follows",
                                lambda: of.stream() + b"\0", 8, 8, 0),
        "end_early": ("invalid R-6.1-4", "an end chunk stands between frames", "nothing follows it",
                      lambda: of.edited(lambda c: [*c[:3], end_of(2), *c[3:]]), 5, 5, 0),
    }  # fmt: skip


OF_PAPER: Final[dict[str, Entry]] = {
    "magic": ("malformed R-6.1-1", "the magic number is another", "it is that of 6.1",
              lambda: PAPER.lying(Lie("magic", b"\x89PNG\r\n\x1a\n")), 6, 6, 0),
    "kept_over_the_i_frame": ("invalid R-6.5-4", "a P-frame uses a quantiser from before the I-frame",
                              "it is forgotten", _kept_in_paper, 3, 3, 0),
}  # fmt: skip
"""Faults of profile `paper`, and of streams whose profile cannot be read."""
KEPT: Final = (Plan("I", 1), Plan("I"), Plan("P", 1))
"""Frames of which the last one has new splats and densities, after an I-frame without splats."""
OF_MAIN: Final[dict[str, Entry]] = {
    "kept_over_the_i_frame": ("invalid R-15.5-4", "a P-frame uses densities from before the I-frame",
                              "they are forgotten",
                              partial(streams, KEPT, Lie("splat_number", lambda number: number - 1, 1)), 2, 2, 0),
}  # fmt: skip
"""Faults of profile `main`."""


def faulty(value: Entry) -> Inputs:
    """What a hop or the decoder meets is the error, and frames before it are handed out."""
    error, _, _, make, first, last, complete = value
    expected = yield {"stream": make(), "first": first, "last": last}
    assert result(expected, "error").rpartition(" ")[0] == error
    assert len(result(expected, "counts")) == complete


for twin, entries in ((False, {**seek_faults(PAPER), **OF_PAPER}), (True, {**seek_faults(MAIN), **OF_MAIN})):
    for what, entry in entries.items():
        rule = entry[0].split()[1]
        add(
            "faulty",
            "seek",
            f"{slug_of(rule)}_{'main_' * twin}{what}",
            title=f"{rule} is broken{' in profile `main`' * twin}: {entry[1]}.",
            reason="" if entry[-1] == 0 else f"Frames before the fault: {entry[-1]}.",
            rules=[rule, "R-12.6-1", "R-12.6-7"],
            flags=["check-order"] if what.endswith("_behind_damage") else [],
            fault=Fault(entry[1], entry[2]),
            function=faulty,
            arguments={"value": entry},
        )
