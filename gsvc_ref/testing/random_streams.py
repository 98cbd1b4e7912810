"""Random legal streams with what they stand for, from any `Choices`; nothing here needs Hypothesis."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from gsvc_base.arrays import U2
from gsvc_base.draws import Draws
from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_ref.bitstream import LEVELS, SequenceHeader, level_for
from gsvc_ref.paper import (
    BlockKind,
    Codebooks,
    FrameCodes,
    FrameType,
    Kept,
    Quantizer,
    SplatBlock,
    State,
    reconstruct,
)
from gsvc_ref.paper.half import EXPONENT_MASK
from gsvc_ref.stream.profiles import AnyCodes
from gsvc_ref.testing.choices import Choices, SeededChoices
from gsvc_ref.testing.faults import LayersOfFrames, Lie, write_stream

ANY_SIZE_SPLATS = 256
"""Number of splats of any size that every level allows on frames of any size: its work is 256 times its pixels."""

FEW_SPLATS = 8
"""Number of splats at which no plane is worth entropy coding, and a stream can be read by eye."""

LEVEL1_PIXELS = 1 << 17
"""Pixels of a frame of level 1."""

SYMBOL_KINDS = ("constant", "uniform", "peaked", "sparse", "rare")
"""Kinds of planes that make an encoder use every `plane_mode`."""


@dataclass(frozen=True, eq=False)
class Stream:
    """A legal stream."""

    data: bytes
    header: SequenceHeader
    frames: Sequence[AnyCodes]
    splats: list[Splats]  # of each frame, bit for bit; of a frame with layers, those of the base
    layers: LayersOfFrames = field(default_factory=dict)  # of frames, by their number

    def __repr__(self) -> str:
        types = " ".join(f"{codes.type}({len(splats)})" for codes, splats in zip(self.frames, self.splats, strict=True))
        size = f"{self.header.width}x{self.header.height}"
        return f"<Stream {size}, frames and their splats {types}, {len(self.data)} bytes>"

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:  # Hypothesis prints a dataclass field by field without
        printer.text(repr(self))


@dataclass(frozen=True)
class Wishes:
    """What a random stream has to have; what is None, or an element that is not there, is drawn."""

    elements: Mapping[str, int] = field(default_factory=dict)
    """Values of the sequence header by the names of `SequenceHeader`. With a size and without a level, the level is
    raised to one that allows the size and `splats`."""
    frames: int | None = None  # how many
    splats: int | None = None  # how many each frame has
    types: str = "IPR"  # of the frames after the first, an I-frame; a letter that is there twice is drawn more often
    index: bool | None = None
    ancillary: bool | None = None
    paced: bool | None = None

    def __post_init__(self) -> None:
        if not self.types or set(self.types) - set("IPR"):
            raise UsageError(f"the types {self.types!r} are not letters of IPR, such as IPR or PPPR")
        if self.frames is not None and self.frames < 1:
            raise UsageError("a stream has at least one frame")
        if self.splats is not None and self.splats < 0:
            raise UsageError("a frame has at least 0 splats")


ANYTHING: Final = Wishes()


def random_stream(
    seed: int,
    *,
    max_frames: int = 5,
    max_count: int = 120,
    max_pixels: int = LEVEL1_PIXELS,
    wishes: Wishes = ANYTHING,
) -> Stream:
    """The legal stream of a seed: what the strategy `streams` draws, for those without Hypothesis.

    `max_count` limits the new splats of a frame, and all limits count where `wishes` do not say how many. A UsageError
    says that no legal stream has what is wished.
    """
    choices = SeededChoices(seed)
    return make_stream(choices, max_frames=max_frames, max_count=max_count, max_pixels=max_pixels, wishes=wishes)


def make_stream(
    choices: Choices, *, max_frames: int, max_count: int, max_pixels: int, wishes: Wishes = ANYTHING
) -> Stream:
    """A legal stream with anything that the syntax allows, and all of `wishes`.

    Any mix of frame types, plane modes, kept quantisers and codebooks; any number of lanes; with and without index,
    parameter checksums, a frame count in the header, ancillary chunks, and header elements of a later minor version;
    paced where it keeps the limits of a second. What is wished is drawn like all else, and then replaced: so the rest
    stays what it was. A UsageError says that no legal stream has what is wished.
    """
    header = granted(make_header(choices, max_pixels=max_pixels), wishes)
    state = State.initial(header.width, header.height)
    codes: list[FrameCodes] = []
    splats: list[Splats] = []
    drawn = choices.integer(1, max_frames)
    for number in range(wishes.frames or drawn):
        types = wishes.types if number else "I"
        codes.append(make_frame(choices, header, state, types=types, max_count=max_count, count=wishes.splats))
        state = reconstruct(codes[-1], state)
        splats.append(state.splats)
    number_of_chunks = choices.integer(0, 2)
    ancillary = {
        choices.integer(0, len(codes) - 1): (choices.pick("abz"), choices.binary(9))
        for _ in range(number_of_chunks if wishes.ancillary is None else wishes.ancillary and max(1, number_of_chunks))
    }
    header = replace(header, frame_count=choices.pick((0, len(codes))))
    elements = [Lie("frame_count", header.frame_count)]
    if choices.integer(0, 7) == 7:
        elements.append(Lie("version_minor", choices.integer(1, 255)))
        elements.append(Lie("lane_count", bytes([header.lane_count]) + choices.binary(5)))
    index = choices.boolean()
    parts: dict[str, Any] = {
        "index": index if wishes.index is None else wishes.index, "ancillary": ancillary, "lies": elements,
    }  # fmt: skip
    paced = choices.boolean()
    if wishes.paced:
        return paced_stream(header, codes, splats, parts, wishes)
    if paced and wishes.paced is None:
        try:
            return written(replace(header, paced_flag=True), codes, splats, parts)
        except UsageError:  # it does not keep the limits of a second
            pass
    return written(header, codes, splats, parts)


def granted(header: SequenceHeader, wishes: Wishes, more: int = 0) -> SequenceHeader:
    """A drawn header with the elements that are wished, of a level for `more` splats beside those that are wished."""
    unknown = [name for name in wishes.elements if name not in vars(header)]
    if unknown:
        raise UsageError(f"the sequence header has no element {unknown[0]}; it has {', '.join(vars(header))}")
    wished = {**vars(header), **wishes.elements}
    width, height = wished["width"], wished["height"]
    splats = 0 if wishes.splats is None else wishes.splats + more
    needed = level_for(width, height, splats=splats, work=splats * width * height)  # each may cover all of the frame
    if wishes.elements.get("level", needed) < needed:
        raise UsageError(f"{splats} splats of any size on {width}x{height} pixels need level {needed}: wish for fewer, "
                         "or for that level")  # fmt: skip
    return SequenceHeader(**{**wished, "level": max(wished["level"], needed)})


def paced_stream(
    header: SequenceHeader, codes: Sequence[AnyCodes], splats: list[Splats], parts: Mapping[str, Any], wishes: Wishes
) -> Stream:
    """The paced stream, at its frame rate, or else, unless that is wished, at 25 frames a second."""
    header = replace(header, paced_flag=True)
    try:
        return written(header, codes, splats, parts)
    except UsageError:
        if any(name.startswith("frame_rate_") for name in wishes.elements):
            raise
        usual = replace(header, frame_rate_numerator=25, frame_rate_denominator=1)
        return written(usual, codes, splats, parts)


def written(
    header: SequenceHeader, codes: Sequence[AnyCodes], splats: list[Splats], parts: Mapping[str, Any]
) -> Stream:
    """The stream, whose `parts` are options of `write_stream`."""
    return Stream(write_stream(header, codes, **parts), header, codes, splats, parts.get("layers", {}))


def make_header(choices: Choices, *, max_pixels: int) -> SequenceHeader:
    """A legal sequence header; all elements but the size take their whole range."""
    width = choices.integer(1, choices.pick((64, min(65535, max_pixels))))
    height = choices.integer(1, min(65535, max(1, max_pixels // width)))
    known_aspect = choices.boolean()
    return SequenceHeader(
        level=choices.integer(level_for(width, height), max(LEVELS)),
        parameter_checksum_flag=choices.boolean(),
        width=width,
        height=height,
        frame_rate_numerator=choices.pick((25, 30000, choices.integer(1, 2**32 - 1))),
        frame_rate_denominator=choices.pick((1, 1001, choices.integer(1, 2**32 - 1))),
        sample_aspect_numerator=choices.integer(1, 65535) if known_aspect else 0,
        sample_aspect_denominator=choices.integer(1, 65535) if known_aspect else 0,
        bit_depth=choices.integer(8, 16),
        chroma_format=choices.integer(0, 3),
        color_primaries=choices.integer(0, 255),
        transfer_characteristics=choices.integer(0, 255),
        matrix_coefficients=choices.integer(0, 255),
        video_full_range_flag=choices.integer(0, 1),
        chroma_sample_loc_type=choices.integer(0, 5),
        cholesky_bits=choices.integer(1, 12),
        color_stages=choices.integer(1, 8),
        color_codewords=choices.integer(1, choices.pick((16, 1024))),
        entropy_precision=choices.integer(12, 16),
        lane_count=choices.integer(1, choices.pick((4, 64))),
    )


def make_frame(
    choices: Choices,
    header: SequenceHeader,
    state: State,
    *,
    types: str = "IPR",
    max_count: int = 120,
    count: int | None = None,
) -> FrameCodes:
    """A frame that may follow `state`: one of `types`, with up to `max_count` new splats and `ANY_SIZE_SPLATS` in all.

    With `count` that is the number of its splats, unless it is an R-frame; `state` must have no more.
    """
    letters: tuple[FrameType, ...] = ("I", "P", "R")
    options = [letter for letter in letters for _ in range(types.count(letter))]
    frame_type = choices.pick(options)
    if frame_type == "R":
        return FrameCodes.repeated_frame()
    survivors = np.zeros(0, np.bool_)
    inter = None
    if frame_type == "P":
        share = choices.pick((0.0, 0.5, 0.9, 1.0))
        survivors = choices.generator().random(len(state.splats)) < share
        if survivors.any():
            inter = _block(choices, header, int(np.count_nonzero(survivors)), "inter", state.inter)
    staying = int(np.count_nonzero(survivors))
    room = min(max_count, ANY_SIZE_SPLATS - staying) if count is None else 0
    drawn = choices.integer(0, choices.pick((min(room, FEW_SPLATS), room)))
    new = drawn if count is None else count - staying
    kept = Kept() if frame_type == "I" else state.intra
    intra = _block(choices, header, new, "intra", kept) if new else None
    return FrameCodes.intra_frame(intra) if frame_type == "I" else FrameCodes.predicted_frame(survivors, inter, intra)


def _block(choices: Choices, header: SequenceHeader, count: int, kind: BlockKind, kept: Kept) -> SplatBlock:
    """A block that uses what is kept whenever it may and the choices like it to."""

    def present() -> bool:
        return kind == "intra" or choices.boolean()

    positions = _positions(choices, count, kind) if present() else None
    cholesky = colors = quantizer = codebooks = None
    if present():
        cholesky = _columns(choices, count, (1 << header.cholesky_bits,) * 3)
        if kept.quantizer is None or choices.boolean():
            quantizer = _quantizer(choices)
    if present():
        if kept.codebooks is None or choices.boolean():
            codebooks = _codebooks(choices, header)
        books = codebooks or kept.codebooks or ()
        colors = _columns(choices, count, tuple(len(book) for book in books))
    return SplatBlock(positions, cholesky, colors, quantizer, codebooks)


def _positions(choices: Choices, count: int, kind: BlockKind) -> U2:
    """Binary16 patterns (count, 2) u2, finite: plausible ones, all alike, or any."""
    rng = choices.generator()
    style = choices.pick(("plausible", "alike", "any"))
    if style == "any":
        signs = rng.choice(np.array([0, 0x8000], np.uint16), (count, 2))
        bits: U2 = rng.integers(0, EXPONENT_MASK, (count, 2), np.uint16) | signs
        return bits
    spread = 1.0 if kind == "intra" else 2.0**-6
    values = rng.uniform(-spread, spread, (count, 2)).astype(np.float16)
    if style == "alike":
        values[:] = values[0]
    return values.view(np.uint16)


def _quantizer(choices: Choices) -> Quantizer:
    """Scales and offsets that are plausible, tiny or huge, but cannot overflow within a few frames."""
    rng = choices.generator()
    exponent = choices.pick((-126, -130 + 64, -6, 0, 60))
    scale = np.ldexp(rng.uniform(1, 2, 3), exponent)
    return Quantizer(scale.astype(np.float32), (rng.normal(0, 8, 3) * scale).astype(np.float32))


def _codebooks(choices: Choices, header: SequenceHeader) -> Codebooks:
    rng = choices.generator()
    spread = choices.pick((0.0, 0.3, 6e4))
    stages = choices.integer(1, header.color_stages)
    sizes = [choices.integer(1, header.color_codewords) for _ in range(stages)]
    return tuple(rng.uniform(-spread, spread, (size, 3)).astype(np.float16) for size in sizes)


def _columns(choices: Choices, count: int, alphabets: tuple[int, ...]) -> U2:
    """(count, len(alphabets)) u2, each column a plane of another kind."""
    rng = choices.generator()
    columns = np.empty((count, len(alphabets)), np.uint16)
    for k, alphabet in enumerate(alphabets):
        columns[:, k] = paint_symbols(rng, choices.pick(SYMBOL_KINDS), count, alphabet)
    return columns


def paint_symbols(rng: Draws, kind: str, count: int, alphabet: int) -> U2:
    """Symbols (count,) u2 below `alphabet` of one kind: constant, uniform, peaked, sparse or rare."""
    if kind == "constant":
        return np.full(count, rng.integers(alphabet), np.uint16)
    if kind == "uniform":
        return rng.integers(0, alphabet, count, np.uint16)
    if kind == "peaked":
        spread = rng.normal(rng.integers(alphabet), max(1.0, alphabet / 12), count)
        return np.asarray(np.clip(np.rint(spread), 0, alphabet - 1), np.uint16)
    if kind == "sparse":
        return rng.choice(rng.integers(0, alphabet, 3, np.uint16), count)
    symbols = np.full(count, rng.integers(alphabet), np.uint16)
    symbols[rng.integers(count)] = rng.integers(alphabet)
    return symbols
