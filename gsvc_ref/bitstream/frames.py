"""Frames and splat blocks (spec.md sections 6.4 and 6.5)."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from gsvc_base.arrays import U2
from gsvc_base.constants import SMALLEST_NORMAL
from gsvc_ref.bitstream.coder import Coder
from gsvc_ref.bitstream.header import SequenceHeader
from gsvc_ref.bitstream.planes import plane
from gsvc_ref.paper import BlockKind, Codebooks, FrameCodes, FrameType, Kept, Quantizer, SplatBlock, State
from gsvc_ref.paper.codes import NO_QUANTIZER
from gsvc_ref.paper.half import EXPONENT_MASK

LAYERS_OF_MASK: Final = 0b1110
"""The bits of `layer_mask` that are not reserved."""

NO_BLOCK: Final = SplatBlock()
NO_FRAME_CODES: Final = FrameCodes.repeated_frame()
"""The codes that a Reader, which ignores values, is given."""


@dataclass(frozen=True)
class FrameElements:
    """The elements of a frame: `frame_number`, `parameter_checksum` (None if the stream has none) and the codes."""

    frame_number: int
    parameter_checksum: int | None
    codes: FrameCodes


def frame(
    s: Coder,
    header: SequenceHeader,
    state: State,
    frame_type: FrameType,
    frame_number: int,
    given: FrameElements | None = None,
) -> FrameElements:
    """frame() of spec.md section 6.4: the frame `frame_number` after the frame before has left `state`.

    `given` is the frame that a Writer writes; its blocks must fit `state`.
    """
    elements = given or FrameElements(frame_number, None, NO_FRAME_CODES)
    head = frame_head(s, header, frame_number, elements.frame_number, elements.parameter_checksum)
    return FrameElements(*head, frame_codes(s, header, state, frame_type, elements.codes))


def frame_head(
    s: Coder, header: SequenceHeader, due: int, given_number: int = 0, given_checksum: int | None = None
) -> tuple[int, int | None]:
    """`frame_number`, which must be `due`, and `parameter_checksum`: what a frame of every profile begins with."""
    number = frame_number_of(s, due, given_number)
    if not header.parameter_checksum_flag:
        return number, None
    with s.part("checksums"):
        return number, s.le("parameter_checksum", 4, given_checksum or 0)


def layer_mask(s: Coder, header: SequenceHeader, given: Iterable[int] = ()) -> tuple[int, ...]:
    """`layer_mask`: the layers whose chunks follow a frame, in a stream that has some (spec.md section 15.13).

    What it says of layers that the stream does not have is ignored.
    """
    if header.layer_count == 1:
        return ()
    with s.part("frame_header"):
        mask = s.le("layer_mask", 1, sum(1 << layer for layer in given))
    if mask & ~LAYERS_OF_MASK:
        s.fail("R-3.2-1", f"`layer_mask` is {mask:08b} in binary; all bits but those of layers 1 to 3 are reserved")
    return tuple(layer for layer in range(1, header.layer_count) if mask >> layer & 1)


def frame_codes(
    s: Coder, header: SequenceHeader, state: State, frame_type: FrameType, codes: FrameCodes = NO_FRAME_CODES
) -> FrameCodes:
    """What follows `parameter_checksum` in a frame of profile `paper`; a Writer writes `codes`."""
    before = state.forget() if frame_type == "I" else state
    if frame_type == "I":
        splat_count = _splat_count(s, header, "splat_count", codes.intra_count)
        intra = splat_block(s, header, splat_count, "intra", before.intra, codes.intra) if splat_count else None
        codes = FrameCodes.intra_frame(intra)
    elif frame_type == "P":
        codes = _predicted(s, header, before, codes)
    return codes


def frame_number_of(s: Coder, due: int, given: int = 0) -> int:
    """`frame_number`, the first element of every frame, which must be the number that is `due` (R-6.4-1)."""
    with s.part("frame_header"):
        number = s.uv("frame_number", given)
    if number != due:
        s.fail("R-6.4-1", f"`frame_number` is {number}; it must be {due}")
    return number


def _predicted(s: Coder, header: SequenceHeader, state: State, codes: FrameCodes) -> FrameCodes:
    """The part of a frame that belongs to type `P`."""
    new_splat_count = _splat_count(s, header, "new_splat_count", codes.intra_count)
    reference_count = len(state.splats)
    survivors = np.zeros(0, np.bool_)
    bit = s.position
    if reference_count > 0:
        given = None if codes.survivors is None else codes.survivors.view(np.uint8)
        survivors = plane(s, header, "survivors", "survivor_map", reference_count, 2, given).astype(np.bool_)
    survivor_count = int(np.count_nonzero(survivors))
    if survivor_count + new_splat_count > header.limits.splats:
        _too_many(s, header, survivor_count + new_splat_count, bit)
    inter = intra = None
    if survivor_count > 0:
        inter = splat_block(s, header, survivor_count, "inter", state.inter, codes.inter)
    if new_splat_count > 0:
        intra = splat_block(s, header, new_splat_count, "intra", state.intra, codes.intra)
    return FrameCodes.predicted_frame(survivors, inter, intra)


def _splat_count(s: Coder, header: SequenceHeader, name: str, count: int) -> int:
    with s.part("frame_header"):
        count = s.uv(name, count)
    if count > header.limits.splats:
        _too_many(s, header, count)
    return count


def _too_many(s: Coder, header: SequenceHeader, count: int, bit: int | None = None) -> None:
    s.fail("R-5-2", f"a frame has {count} splats; level {header.level} allows {header.limits.splats}", bit=bit)


def splat_block(
    s: Coder, header: SequenceHeader, count: int, kind: BlockKind, kept: Kept, block: SplatBlock | None = None
) -> SplatBlock:
    """splat_block(count, kind) of spec.md section 6.5, `count` > 0, given what decoders keep for that kind."""
    given = block or NO_BLOCK
    s.block = kind
    with s.part("frame_header"):
        positions_present = _attribute_flag(s, "positions_present", kind, given.positions is not None)
        cholesky_present = _attribute_flag(s, "cholesky_present", kind, given.cholesky is not None)
        quantizer_present = s.u("quantizer_present", 1, int(given.quantizer is not None))
        _check_kept(s, "quantizer", cholesky_present, quantizer_present, kept.quantizer is not None)
        colors_present = _attribute_flag(s, "colors_present", kind, given.colors is not None)
        codebooks_present = s.u("codebooks_present", 1, int(given.codebooks is not None))
        _check_kept(s, "codebooks", colors_present, codebooks_present, kept.codebooks is not None)
        if (block_reserved := s.u("block_reserved", 3)) != 0:
            s.fail("R-6.5-1", f"`block_reserved` is {block_reserved}; it is reserved and must be 0")
    positions = _positions(s, header, count, given.positions) if positions_present else None
    cholesky = quantizer = None
    if cholesky_present:
        cholesky, quantizer = _cholesky(s, header, count, bool(quantizer_present), given)
    colors = codebooks = None
    if colors_present:
        codebooks = _codebooks(s, header, given.codebooks) if codebooks_present else None
        colors = _colors(s, header, count, codebooks or kept.codebooks or (), given.colors)
    s.block = ""
    return SplatBlock(positions, cholesky, colors, quantizer, codebooks)


def _attribute_flag(s: Coder, name: str, kind: BlockKind, present: bool) -> int:
    flag = s.u(name, 1, int(present))
    if kind == "intra" and not flag:
        s.fail("R-6.5-2", f"`{name}` is 0 in an intra block, which must have all three attributes")
    return flag


def _check_kept(s: Coder, what: str, attribute_present: int, own: int, is_kept: bool) -> None:
    if own and not attribute_present:
        s.fail("R-6.5-3", f"a block has a {what} of its own without the attribute that uses it")
    if attribute_present and not own and not is_kept:
        s.fail("R-6.5-4", f"a block uses the kept {what}, and there is none since the last I-frame")


def _positions(s: Coder, header: SequenceHeader, count: int, given: U2 | None) -> U2:
    columns = []
    for axis, letter in enumerate("xy"):
        code = None if given is None else given[:, axis]
        bit = s.position
        high = plane(
            s, header, "positions", f"position_high[{letter}]", count, 256, None if code is None else code >> 8
        )
        low = plane(
            s, header, "positions", f"position_low[{letter}]", count, 256, None if code is None else code & 0xFF
        )
        columns.append(high << 8 | low)
        infinite = columns[axis] & EXPONENT_MASK == EXPONENT_MASK
        if infinite.any():
            first = int(np.argmax(infinite))
            s.fail("R-6.5-7", f"position {letter} of splat {first} of a block is not a finite binary16", bit=bit)
    return np.column_stack(columns)


def _cholesky(
    s: Coder, header: SequenceHeader, count: int, quantizer_present: bool, given: SplatBlock
) -> tuple[U2, Quantizer | None]:
    columns = []
    scale, offset = np.empty(3, np.float32), np.empty(3, np.float32)
    own = given.quantizer or NO_QUANTIZER
    for channel, name in enumerate(("l11", "l21", "l22")):
        if quantizer_present:
            with s.part("quantizers", name):
                scale[channel] = s.f32("cholesky_scale", own.scale[channel])
                if not scale[channel] >= SMALLEST_NORMAL:
                    s.fail("R-6.5-5", f"`cholesky_scale` is {scale[channel]}; it must be a positive normal number")
                offset[channel] = s.f32("cholesky_offset", own.offset[channel])
        symbols = None if given.cholesky is None else given.cholesky[:, channel]
        alphabet = 1 << header.cholesky_bits
        columns.append(plane(s, header, "cholesky", f"cholesky_code[{name}]", count, alphabet, symbols))
    return np.column_stack(columns), Quantizer(scale, offset) if quantizer_present else None


def _codebooks(s: Coder, header: SequenceHeader, given: Codebooks | None) -> Codebooks:
    books = []
    with s.part("codebooks"):
        stage_count = s.le("stage_count", 1, len(given or ()))
        if not 1 <= stage_count <= header.color_stages:
            s.fail("R-6.5-6", f"`stage_count` is {stage_count}; it must be in 1..{header.color_stages}")
        for k in range(stage_count):
            book = None if given is None else given[k]
            codeword_count = s.le("codeword_count", 2, 0 if book is None else len(book))
            if not 1 <= codeword_count <= header.color_codewords:
                s.fail("R-6.5-6", f"`codeword_count` is {codeword_count}; it must be in 1..{header.color_codewords}")
            book = s.floats("codeword", 3 * codeword_count, "f2", None if book is None else book.ravel())
            books.append(book.reshape(codeword_count, 3))
    return tuple(books)


def _colors(s: Coder, header: SequenceHeader, count: int, books: Codebooks, given: U2 | None) -> U2:
    columns = []
    for k, book in enumerate(books):
        indices = None if given is None else given[:, k]
        columns.append(plane(s, header, "colors", f"color_index[{k + 1}]", count, len(book), indices))
    return np.column_stack(columns)
