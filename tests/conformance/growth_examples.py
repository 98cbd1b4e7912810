"""The worked examples of spec.md, Annex F: streams of tomorrow, byte by byte, and what a decoder of today says of them.

``python tests/conformance/growth_examples.py F.5`` prints the elements of one, a line for each.
"""

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from io import BytesIO
from typing import Final
from uuid import UUID

import numpy as np

from gsvc_ref import concat
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.chunks import MAGIC, VERSION_MAJOR, VERSION_MINOR
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.bitstream.crc import crc32c, parameter_checksum
from gsvc_ref.bitstream.frames import splat_block
from gsvc_ref.bitstream.planes import plane
from gsvc_ref.main.codes import IntraCodes, MainCodes
from gsvc_ref.main.densities import Densities, Density
from gsvc_ref.main.frames import frame_body
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.paper import Kept, SplatBlock
from gsvc_ref.stream import StreamReader
from gsvc_ref.testing import OVERVIEW_HEADER, overview_frames, split_chunks, write_stream

OVERVIEW: Final = write_stream(OVERVIEW_HEADER, overview_frames(), index=False)
"""The stream of section 4.2: frames I, P and R of one splat."""
CHUNKS: Final = split_chunks(OVERVIEW)
HEADER: Final = CHUNKS[0][1]
EXAMPLE_UUID: Final = UUID("f81d4fae-7dec-11d0-a765-00a0c91e6bf6")
HALF: Final = np.float16

SHIFT_FLAG: Final = 4
REORDER_FLAG: Final = 8


@dataclass(frozen=True)
class Element:
    """Bytes of a stream, and the elements that they are."""

    name: str
    data: bytes


@dataclass(frozen=True)
class Example:
    """A stream, and what `reconstruct_stream` of today answers: the number of `frames`, then `error`."""

    clause: str
    elements: list[Element]
    frames: int
    error: str = ""

    @property
    def data(self) -> bytes:
        """The bytes."""
        return b"".join(element.data for element in self.elements)


PREFIX: Final = Element("magic, version_major, version_minor", MAGIC + bytes([VERSION_MAJOR, VERSION_MINOR]))


def chunk(chunk_type: str, payload: Iterable[Element]) -> list[Element]:
    """The elements of a chunk."""
    payload = list(payload)
    data = b"".join(element.data for element in payload)
    head = chunk_type.encode() + encode_uv(len(data))
    crc = crc32c(data, crc32c(head)).to_bytes(4, "little")
    return [Element(f"chunk_type {chunk_type}, chunk_length", head), *payload, Element("chunk_crc", crc)]


def known(number: int) -> list[Element]:
    """The chunk of that number of the stream of section 4.2."""
    chunk_type, payload = CHUNKS[number]
    return chunk(chunk_type.decode(), [Element("payload as in section 4.2", payload)])


def number(name: str, value: int) -> Element:
    """An element `uv`."""
    return Element(name, encode_uv(value))


def byte(name: str, value: int) -> Element:
    return Element(name, bytes([value]))


PAPER_TAIL: Final = Element("bit_depth to lane_count", HEADER[23:])


def header(*tail: Element, profile: int = 0, flags: int = 0, frame_count: int = 3) -> list[Element]:
    """A sequence header whose elements from `bit_depth` on are `tail`, or those of section 4.2."""
    return chunk("H", [
        byte("profile", profile),
        Element("level", HEADER[1:2]),
        byte("flags", flags),
        Element("width to sample_aspect_denominator", HEADER[3:19]),
        Element("frame_count", frame_count.to_bytes(4, "little")),
        *(tail or [PAPER_TAIL]),
    ])  # fmt: skip


def end(frame_count: int) -> list[Element]:
    return chunk("E", [Element("frame_count", frame_count.to_bytes(4, "little")), Element("index_length", bytes(4))])


def block(kind: str, codes: SplatBlock) -> Element:
    """A splat block of one splat."""
    p = Writer()
    splat_block(p, OVERVIEW_HEADER, 1, kind, Kept(), codes)  # type: ignore[arg-type]
    return Element(f"splat_block(1, {kind})", p.getvalue())


def survivor_map(*symbols: int) -> Element:
    p = Writer()
    plane(p, OVERVIEW_HEADER, "survivors", "survivor_map", len(symbols), 2, np.array(symbols, np.uint8))
    return Element("survivor_map", p.getvalue())


MAIN_TAIL: Final = (
    Element("bit_depth to chroma_sample_loc_type", HEADER[23:30]),
    byte("max_lane_exponent", 0),
    byte("layer_count", 2),
    byte("main_tools", 0),
    *[byte(f"quality_level, quality_halvings, quality_reserved of quality {q}", 1 << 5) for q in range(2)],
)
PLANES: Final = (Density(0, 8, 90), Density(1, 6, 10, 6), Density(1, 5, 8, 5), Density(0, 20, 20, -8),
                 Density(1, 21, 2, 1), Density(0, 24, -3))  # fmt: skip


def main_splat(cell: list[int], colors: list[int]) -> MainCodes:
    """An I-frame of one round splat at a corner of a cell, with D = 4."""
    new = IntraCodes(*(np.array([row], np.int64) for row in (cell, colors, [2, 0, 0], [0, 0])))
    return MainCodes(type="I", quantizer=24, densities=Densities(PLANES, (3, 3, 3, 3)), new=new)


def main_body(codes: MainCodes, before: MainState) -> tuple[Element, MainState]:
    """frame_body(), and the state after it."""
    p = Writer()
    after = frame_body(p, codes.type, before, 0, 16384, codes).after
    return Element(f"frame_body({codes.type})", p.getvalue()), after


def main_frames(*masks: int) -> list[list[Element]]:
    """The payloads of the frames I, P and R of profile `main`: the splat moves and becomes darker."""
    first, state = main_body(main_splat([1, 1], [9, 2, 0]), MainState.initial(16, 12))
    q = np.array([[3, -1, 0, 0, 0, -2, 0, 0]], np.int64)
    second, _ = main_body(MainCodes(type="P", quantizer=24, modes=np.array([5]), differences=q), state)
    return [
        [number("frame_number", n), byte("layer_mask", mask), *body]
        for n, (mask, body) in enumerate(zip(masks or (0, 0, 0), ([first], [second], []), strict=True))
    ]


def second_profile() -> Example:
    """A stream of profile `main` with one splat; its header says that there may be one layer."""
    i, p, r = main_frames()
    frames = [*chunk("I", i), *chunk("P", p), *chunk("R", r)]
    return Example("F.3", [PREFIX, *header(*MAIN_TAIL, profile=1), *frames, *end(3)], 3)


def optional_elements() -> Example:
    """A shift of all splats in each frame; the P-frame has it in place of differences."""
    splats = [frame.splats for frame in StreamReader(OVERVIEW)]

    def opening(n: int, x: float, y: float) -> list[Element]:
        crc = parameter_checksum(splats[n]).to_bytes(4, "little")
        shift = np.array([x, y], HALF).tobytes()
        return [number("frame_number", n), Element("parameter_checksum", crc), Element("shift_x, shift_y", shift)]

    intra = Element("splat_count, splat_block(1, intra)", CHUNKS[1][1][1:])
    predicted = [number("new_splat_count", 0), survivor_map(1), block("inter", SplatBlock())]
    elements = [
        PREFIX,
        *header(flags=SHIFT_FLAG | 1),
        *chunk("I", [*opening(0, 0, 0), intra]),
        *chunk("P", [*opening(1, 0.125, -0.125), *predicted]),
        *chunk("R", opening(2, 0, 0)),
        *end(3),
    ]
    return Example("F.4", elements, 0, "unsupported R-3.2-1 112")


def reordered(*, flagged: bool = True) -> Example:
    """Bidirectional frames; without their flag only to show what the flag is for."""
    moved = Element("new_splat_count to the end of the splat block", CHUNKS[2][1][1:])
    half_way = SplatBlock(positions=np.array([[0.0625, -0.0625]], HALF).view(np.uint16))
    between = [
        number("frame_number", 1),
        number("backward_step", 1),
        number("forward_step", 1),
        number("new_splat_count", 0),
        survivor_map(1, 0),
        block("inter", half_way),
    ]
    elements = [
        PREFIX,
        *(header(PAPER_TAIL, byte("reorder_depth", 1), flags=REORDER_FLAG) if flagged else header()),
        *known(1),
        *chunk("P", [number("frame_number", 2), moved]),
        *chunk("B", between),
        *end(3),
    ]
    return Example("F.5", elements, 0, "unsupported R-3.2-1 112")


def layers(*, whole: bool = True) -> Example:
    """The stream of F.3 with a layer, a green splat at (8.125, 4.125), which frame 1 carries."""
    i, p, r = main_frames(2, 0, 2)
    body, _ = main_body(main_splat([2, 1], [2, 0, -6]), MainState.initial(16, 12))
    head = "layer, layer_type, frame_low"
    repeated = chunk("n", [byte(head, 1 << 6 | 2 << 4 | 2)]) if whole else []
    frames = [*chunk("I", i), *chunk("n", [byte(head, 1 << 6), body]), *chunk("P", p), *chunk("R", r), *repeated]
    return Example("F.6", [PREFIX, *header(*MAIN_TAIL, profile=1), *frames, *end(3)], 3)


def time_stamps() -> Example:
    """A tick is a millisecond, and the frames are shown for 40, 40 and 80 of them."""
    times = [
        number("ticks_per_second", 1000),
        number("first_frame", 0),
        number("run_count", 2),
        number("frame_run", 2),
        number("frame_ticks", 40),
        number("frame_run", 1),
        number("frame_ticks", 80),
    ]
    return Example("F.7", [PREFIX, *known(0), *chunk("t", times), *known(1), *known(2), *known(3), *known(4)], 3)


def private_chunk() -> Example:
    """Frame 1 has the place where it was taken, which stays true wherever the stream is cut: a chunk `s`."""
    payload = [Element("UUID", EXAMPLE_UUID.bytes), Element("data of its owner", b"48.1N 11.6E")]
    return Example("F.8", [PREFIX, *known(0), *known(1), *known(2), *chunk("s", payload), *known(3), *known(4)], 3)


def concatenated() -> Example:
    """Section 4.2 and F.8, joined by gsvc_ref; the chunk `s` stays, and the result has an index of its own."""
    out = BytesIO()
    concat([OVERVIEW, private_chunk().data], out)
    elements, frames = [PREFIX], 0
    for letter, payload in split_chunks(out.getvalue()):
        chunk_type = letter.decode()
        if chunk_type == "H":
            elements += header(frame_count=6)
        elif chunk_type in "IPR":
            elements += chunk(chunk_type, [number("frame_number", frames), Element("the other elements", payload[1:])])
            frames += 1
        else:
            elements += chunk(chunk_type, [Element("payload", payload)])
    example = Example("F.9", elements, 6)
    assert example.data == out.getvalue()
    return example


def examples() -> list[Example]:
    """All of them, in the order of the annex."""
    return [
        second_profile(),
        optional_elements(),
        reordered(),
        layers(),
        time_stamps(),
        private_chunk(),
        concatenated(),
    ]


def listing(example: Example) -> str:
    """The elements of an example, each with its first byte and its bytes."""
    lines, offset = [], 0
    for element in example.elements:
        lines.append(f"{offset:4}  {element.name:45}  {element.data.hex(' ')}")
        offset += len(element.data)
    return "\n".join(lines)


if __name__ == "__main__":
    asked = [example for example in examples() if example.clause in sys.argv[1:]]
    if not asked:
        raise SystemExit(__doc__)
    print("\n\n".join(map(listing, asked)))
