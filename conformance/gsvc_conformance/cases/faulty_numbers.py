"""Faults of descriptors: numbers `uv` in other bytes, numbers that are not finite, bits that are skipped."""

from collections.abc import Iterator
from functools import partial
from typing import Final

import numpy as np

from gsvc_conformance.cases.building import BOOKS, HEADER, intra_block
from gsvc_conformance.cases.faults import (
    CRC_SIZE,
    PAPER,
    Broken,
    Sound,
    colored,
    each_of,
    overview,
    rich,
    value_of,
)
from gsvc_ref.bitstream import crc32c
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.paper import FrameCodes
from gsvc_ref.testing import Lie, split_chunks, write_stream

CONTAINER: Final = (("frame_number", 1, 1, 1), ("entry_count", 0, 1, 3), ("frame_number_step", 0, 0, 3))
"""Elements `uv` of any overview: which one of its name, its value, and how many frames precede it."""
COUNTS: Final = {
    False: (("splat_count", 0, 1, 0), ("new_splat_count", 0, 0, 1)),
    True: (("splat_number", 0, 1, 0),),
}
"""Elements `uv` of the overview of profile `paper`, and of `main`."""


def number_faults() -> Iterator[Broken]:
    """All of profile `paper`."""
    yield from number_forms(PAPER)
    yield from _words()
    yield from _descriptors()


def number_forms(of: Sound) -> Iterator[Broken]:
    """A `uv` in too many bytes, or beyond 32 bits where a decoder of 32 bits sees the truth."""
    _, (_, intra), *_ = split_chunks(of.overview(index=False))
    first = _first_offset(of)
    for element, number, truth, complete in (
        *COUNTS[of.is_main], ("chunk_length", 1, len(intra), 0), *CONTAINER,
    ):  # fmt: skip
        forms = {"longer_than_needed": _longer(truth), "plus_two_to_the_32": encode_uv(truth + 2**32)}
        if element in ("splat_count", "splat_number", "chunk_length"):
            forms |= {"two_to_the_32": encode_uv(2**32), "six_bytes": b"\x80" * 5 + b"\0"}
        for what, form in forms.items():
            said = form + encode_uv(first) if element == "frame_number_step" else form
            make = (
                partial(_length, of, form)
                if element == "chunk_length"
                else partial(of.overview, Lie(element, said, number))
            )
            yield Broken("R-3.1-1", "malformed", f"{element}_{what}", f"{element} is written as {form.hex(' ')}",
                         "it has the fewest bytes and is below 2^32", make, complete)  # fmt: skip
    yield Broken("R-3.1-1", "malformed", "offset_step_plus_two_to_the_32",
                 f"offset_step is written as {encode_uv(first + 2**32).hex(' ')}", "it is below 2^32",
                 partial(of.overview, Lie("frame_number_step", b"\0" + encode_uv(first + 2**32))), 3)  # fmt: skip


def _first_offset(of: Sound) -> int:
    """Where the first chunk after the header begins in an overview, in bytes."""
    return PREFIX_SIZE + 1 + 1 + len(split_chunks(of.overview())[0][1]) + CRC_SIZE


def _words() -> Iterator[Broken]:
    words = int(value_of(rich(), "word_count"))
    yield Broken("R-3.1-1", "malformed", "word_count_plus_two_to_the_32", f"word_count is {words} + 2^32",
                 "it is below 2^32", lambda: rich(Lie("word_count", encode_uv(words + 2**32))))  # fmt: skip


def _length(of: Sound, form: bytes) -> bytes:
    """The overview, the length of whose I-frame is written in another way; its checksum covers these bytes."""
    data, first = of.overview(index=False), _first_offset(of)
    _, (letter, payload), *_ = split_chunks(data)
    said = letter + form + payload
    behind = first + 1 + 1 + len(payload) + CRC_SIZE
    return data[:first] + said + crc32c(said).to_bytes(CRC_SIZE, "little") + data[behind:]


def _longer(value: int) -> bytes:
    """A `uv` with a byte too many."""
    *head, last = encode_uv(value)
    return bytes([*head, last | 0x80, 0])


def _descriptors() -> Iterator[Broken]:
    numbers = {
        "offset_infinite": ("cholesky_offset is infinite", (Lie("cholesky_offset", [np.inf]),)),
        "offset_not_a_number": ("cholesky_offset is NaN", (Lie("cholesky_offset", [np.nan], 2),)),
        "scale_infinite": ("cholesky_scale is infinite", (Lie("cholesky_scale", [np.inf], 1),)),
        "scale_not_a_number": ("cholesky_scale is NaN", (Lie("cholesky_scale", [np.nan]),)),
        "codeword_infinite": ("a codeword is -infinity", (Lie("codeword", [0, -np.inf, 0]),)),
        "codeword_not_a_number": ("a codeword is NaN", (Lie("codeword", [0, 0, np.nan]),)),
    }
    yield from each_of("R-3.1-2", "invalid", "numbers are finite", numbers, overview)
    for what, said, number in (("infinite", "infinite", np.inf), ("not_a_number", "NaN", np.nan)):
        lie = Lie("codeword", lambda words, number=number: [*words[:-1], number])
        yield Broken("R-3.1-2", "invalid", f"unused_codeword_{what}", f"a codeword that no splat uses is {said}",
                     "numbers are finite", partial(colored, 1, lie))  # fmt: skip
    codes = {"17_zeros": ("a frequency begins with 17 zero bits", (Lie("frequency", "0" * 17 + "1" * 40),))}
    yield from each_of("R-3.1-3", "malformed", "there are at most 16", codes, rich)
    skipped = {"constant": ("a bit that align() skips is 1", (Lie("align", 1),))}
    yield from each_of("R-3.1-4", "invalid", "skipped bits are 0", skipped, overview)
    yield Broken("R-3.1-4", "invalid", "behind_a_raw_plane", "a bit skipped after the symbols of a raw plane is 1",
                 "skipped bits are 0", lambda: _raw(Lie("color_index[1].align", 1)))  # fmt: skip
    yield from each_of("R-3.1-4", "invalid", "skipped bits are 0",
                     {"in_a_coded_plane": ("a bit skipped after a table is 1", (Lie("align", 1, 5),))},
                     rich)  # fmt: skip


def _raw(*lies: Lie) -> bytes:
    """An I-frame whose last plane is raw: four indices of 3 bits into a codebook of 5; with lies."""
    return write_stream(HEADER, [FrameCodes.intra_frame(intra_block(4, books=BOOKS[:1]))], index=False, lies=lies)
