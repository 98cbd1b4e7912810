"""The worked examples of spec.md, Annex F: streams of tomorrow, byte by byte, and what a decoder of today says of them.

``python tests/conformance/growth_examples.py --write`` writes their bytes, tables and answers into spec.md again, which
is due when a version, a checksum or a header element has changed; test_growth.py tells.
"""

import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Final
from uuid import UUID

import numpy as np

from gsvc_base.spec import step_of
from gsvc_ref import concat
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.chunks import MAGIC, VERSION_MAJOR, VERSION_MINOR
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.bitstream.crc import crc32c, parameter_checksum
from gsvc_ref.bitstream.frames import splat_block
from gsvc_ref.bitstream.header import SequenceHeader
from gsvc_ref.bitstream.planes import plane
from gsvc_ref.main.codes import IntraCodes, MainCodes
from gsvc_ref.main.densities import Densities, Density
from gsvc_ref.main.frames import MainState, frame_body
from gsvc_ref.paper import Kept, SplatBlock
from gsvc_ref.stream import StreamReader
from gsvc_ref.testing import OVERVIEW_HEADER, overview_frames, split_chunks, write_stream

SPEC: Final = Path(__file__).parents[2] / "spec.md"
OVERVIEW: Final = write_stream(OVERVIEW_HEADER, overview_frames(), index=False)
CHUNKS: Final = split_chunks(OVERVIEW)
HEADER: Final = CHUNKS[0][1]
AS_BEFORE: Final = "as in section 4.2"
EXAMPLE_UUID: Final = UUID("f81d4fae-7dec-11d0-a765-00a0c91e6bf6")
HALF: Final = np.float16

SHIFT_FLAG: Final = 4
REORDER_FLAG: Final = 8


@dataclass(frozen=True)
class Row:
    """Bytes of a stream, the elements that they are, and their value; a row that is `known` shows its ends only."""

    data: bytes
    element: str
    value: str
    known: bool = False


@dataclass(frozen=True)
class Example:
    """A stream, and what `reconstruct_stream` of today says: `error`, after so many `frames`."""

    clause: str
    rows: list[Row]
    frames: int
    error: str = ""

    @property
    def data(self) -> bytes:
        """The bytes."""
        return b"".join(row.data for row in self.rows)


def prefix() -> Row:
    version = bytes([VERSION_MAJOR, VERSION_MINOR])
    return Row(MAGIC + version, "`magic`, `version_major`, `version_minor`", f"{AS_BEFORE}: {VERSION_MAJOR}, 0", True)


def chunk(chunk_type: str, payload: Iterable[Row]) -> list[Row]:
    """The rows of a chunk; one of which all is known is one row."""
    payload = list(payload)
    data = b"".join(row.data for row in payload)
    head = chunk_type.encode() + encode_uv(len(data))
    crc = crc32c(data, crc32c(head))
    stored = crc.to_bytes(4, "little")
    if all(row.known for row in payload):
        return [Row(head + data + stored, f"chunk `{chunk_type}`", payload[0].value, True)]
    return [
        Row(head, "`chunk_type`, `chunk_length`", f"`{chunk_type}`, {len(data)}"),
        *payload,
        Row(stored, "`chunk_crc`", f"{crc:08X}"),
    ]


def known(number: int) -> list[Row]:
    """The chunk of that number of the stream of section 4.2."""
    chunk_type, payload = CHUNKS[number]
    return chunk(chunk_type.decode(), [Row(payload, "", AS_BEFORE, True)])


def header(*, profile: int = 0, flags: str = "0", frame_count: int = 3, rest: Iterable[Row] = ()) -> list[Row]:
    """A sequence header whose elements from `bit_depth` on are those of section 4.2, or `rest`."""
    tail = list(rest) or [Row(HEADER[23:], "`bit_depth` to `lane_count`", AS_BEFORE, True)]
    bits = int(flags, 2)
    return chunk(
        "H",
        [
            Row(bytes([profile]), "`profile`", str(profile)),
            Row(HEADER[1:2], "`level`", "1"),
            Row(bytes([bits]), "`flags`", f"{flags} in binary" if bits else "0"),
            Row(HEADER[3:19], "`width` to `sample_aspect_denominator`", AS_BEFORE, True),
            Row(frame_count.to_bytes(4, "little"), "`frame_count`", str(frame_count)),
            *tail,
        ],
    )


def number(name: str, value: int) -> Row:
    """An element `uv`."""
    return Row(encode_uv(value), f"`{name}`", str(value))


def end(frame_count: int) -> list[Row]:
    return chunk(
        "E",
        [
            Row(frame_count.to_bytes(4, "little"), "`frame_count`", str(frame_count)),
            Row(bytes(4), "`index_length`", "0"),
        ],
    )


def block(kind: str, codes: SplatBlock, said: str) -> Row:
    """A splat block of one splat."""
    p = Writer()
    splat_block(p, OVERVIEW_HEADER, 1, kind, Kept(), codes)  # type: ignore[arg-type]
    return Row(p.getvalue(), f"splat_block(1, {kind})", said)


def halves(*values: float) -> np.ndarray:
    return np.array([values], HALF).view(np.uint16)


def survivor_map(*symbols: int) -> Row:
    p = Writer()
    plane(p, OVERVIEW_HEADER, "survivors", "survivor_map", len(symbols), 2, np.array(symbols, np.uint8))
    return Row(p.getvalue(), "`survivor_map`", "symbols " + ", ".join(map(str, symbols)))


MAIN_HEADER: Final = SequenceHeader(
    profile=1, level=1, width=16, height=12, frame_rate_numerator=25, frame_count=3, layer_count=2
)
"""The header of the streams of profile `main`: that of section 4.2 as far as the elements are the same."""
PLANES: Final = (Density(0, 8, 90), Density(1, 6, 10, 6), Density(1, 5, 8, 5), Density(0, 20, 20, -8),
                 Density(1, 21, 2, 1), Density(0, 24, -3))  # fmt: skip


def main_splat(cell: list[int], colors: list[int]) -> MainCodes:
    """An I-frame of one round splat at a corner of a cell."""
    new = IntraCodes(*(np.array([row], np.int64) for row in (cell, colors, [2, 0, 0], [0, 0])))
    return MainCodes(type="I", quantizer=24, densities=Densities(PLANES, (3, 3, 3, 3)), new=new)


def main_body(codes: MainCodes, before: MainState) -> tuple[list[Row], MainState]:
    """The rows of frame_body(), and the state behind it."""
    p = Writer()
    after = frame_body(p, codes.type, before, 1, 16384, codes).after
    data = p.getvalue()
    count = "splat_count" if codes.type == "I" else "new_splat_count"
    tools = f"{codes.motion_cell << 3 | (codes.densities is not None) << 2:08b}"
    said = f"{tools} in binary: 1 lane, {'no field' if codes.motion_cell == 0 else 'a field'}"
    rows = [
        Row(data[:1], "`quantizer`", f"{codes.quantizer}: D is {step_of(codes.quantizer) / 16:g}"),
        Row(data[1:2], "`lane_exponent` to `frame_reserved`", said + (", densities" if codes.densities else "")),
        Row(data[2:3], f"`{count}`", str(len(codes.new))),
    ]
    end = 3
    if codes.densities:
        end += 18
        rows.append(Row(data[3:end], "densities()", "six planes, and four halvings with α = 4"))
    rows.append(Row(data[end : end + 4], "`lane_state`", f"{int.from_bytes(data[end : end + 4], 'little'):08X}"))
    words = data[end + 4 :]
    rows += [Row(words, "`word`", f"{len(words) // 2} words")] if words else []
    return rows, after


def main_frames() -> list[list[Row]]:
    """The payloads of the frames I, P and R of profile `main`."""
    first, state = main_body(main_splat([1, 1], [9, 2, 0]), MainState.initial(16, 12))
    q = np.array([[3, -1, 0, 0, 0, -2, 0, 0]], np.int64)
    second, _ = main_body(MainCodes(type="P", quantizer=24, modes=np.array([5]), differences=q), state)
    return [[number("frame_number", n), *rows] for n, rows in enumerate((first, second, []))]


def main_header() -> list[Row]:
    own = [
        Row(HEADER[23:30], "`bit_depth` to `chroma_sample_loc_type`", AS_BEFORE, True),
        Row(b"\x01", "`lane_count`", "1"),
        Row(b"\x02", "`layer_count`", "2"),
    ]
    return header(profile=1, rest=own)


def second_profile() -> Example:
    """A stream of profile `main`."""
    i, p, r = main_frames()
    return Example("F.3", [prefix(), *main_header(), *chunk("I", i), *chunk("P", p), *chunk("R", r), *end(3)], 3)


def optional_elements() -> Example:
    splats = [frame.splats for frame in StreamReader(OVERVIEW)]

    def opening(n: int, x: float, y: float) -> list[Row]:
        crc = parameter_checksum(splats[n])
        shift = np.array([x, y], HALF)
        return [
            number("frame_number", n),
            Row(crc.to_bytes(4, "little"), "`parameter_checksum`", f"{crc:08X}"),
            Row(shift.tobytes(), "`shift_x`, `shift_y`", ", ".join(f"{value:g}" for value in shift).replace("-", "−")),
        ]

    intra = Row(CHUNKS[1][1][1:], "`splat_count`, splat_block(1, intra)", AS_BEFORE, True)
    predicted = [
        *opening(1, 0.125, -0.125),
        number("new_splat_count", 0),
        survivor_map(1),
        block("inter", SplatBlock(), "nothing is present: the splat follows the shift"),
    ]
    rows = [
        prefix(),
        *header(flags="101"),
        *chunk("I", [*opening(0, 0, 0), intra]),
        *chunk("P", predicted),
        *chunk("R", opening(2, 0, 0)),
        *end(3),
    ]
    return Example("F.4", rows, 0, "unsupported R-3.2-1 112")


def reordered(*, flagged: bool = True) -> Example:
    """Bidirectional frames; without their flag only to show what the flag is for."""
    tail = [
        Row(HEADER[23:], "`bit_depth` to `lane_count`", AS_BEFORE, True),
        Row(b"\x01", "`reorder_depth`", "1"),
    ]
    moved = Row(CHUNKS[2][1][1:], "`new_splat_count` to the end of the splat block", AS_BEFORE, True)
    between = [
        number("frame_number", 1),
        number("backward_step", 1),
        number("forward_step", 1),
        number("new_splat_count", 0),
        survivor_map(1, 0),
        block("inter", SplatBlock(positions=halves(0.0625, -0.0625)), "positions: 0.0625, −0.0625; all else stays"),
    ]
    rows = [
        prefix(),
        *(header(flags="1000", rest=tail) if flagged else header()),
        *known(1),
        *chunk("P", [number("frame_number", 2), moved]),
        *chunk("B", between),
        *end(3),
    ]
    return Example("F.5", rows, 0, "unsupported R-3.2-1 112")


def layers() -> Example:
    """The stream of F.3 with a splat more in frame 0."""
    i, p, r = main_frames()
    body, _ = main_body(main_splat([2, 1], [2, 0, -6]), MainState.initial(16, 12))
    added = [Row(b"\x01", "`layer`", "1"), Row(b"I", "`layer_type`", "`I`"), *body]
    frames = [*chunk("I", i), *chunk("n", added), *chunk("P", p), *chunk("R", r)]
    return Example("F.6", [prefix(), *main_header(), *frames, *end(3)], 3)


def time_stamps() -> Example:
    times = [
        number("ticks_per_second", 1000),
        number("first_frame", 0),
        number("run_count", 2),
        number("frame_run", 2),
        number("frame_ticks", 40),
        number("frame_run", 1),
        number("frame_ticks", 80),
    ]
    rows = [prefix(), *known(0), *chunk("t", times), *known(1), *known(2), *known(3), *known(4)]
    return Example("F.7", rows, 3)


def private_chunk() -> Example:
    payload = [
        Row(EXAMPLE_UUID.bytes, "UUID", str(EXAMPLE_UUID)),
        Row(b"48.1N 11.6E", "what its owner likes", "`48.1N 11.6E`"),
    ]
    rows = [prefix(), *known(0), *known(1), *known(2), *chunk("s", payload), *known(3), *known(4)]
    return Example("F.8", rows, 3)


def concatenated() -> Example:
    """Section 4.2 and F.8, joined by gsvc_ref; its rows are found again in what came out."""
    out = BytesIO()
    concat([OVERVIEW, private_chunk().data], out)
    rows, frames = [prefix()], 0
    for letter, payload in split_chunks(out.getvalue()):
        chunk_type = letter.decode()
        if chunk_type == "H":
            rows += header(frame_count=6)
        elif chunk_type in "IPR":
            rest = Row(payload[1:], "the other elements", AS_BEFORE, True)
            renumbered = number("frame_number", frames)
            of_first_part = frames < 3
            rows += chunk(chunk_type, [replace(renumbered, value=AS_BEFORE, known=True), rest] if of_first_part else
                          [renumbered, *([rest] if rest.data else [])])  # fmt: skip
            frames += 1
        elif chunk_type == "s":
            rows += chunk("s", [Row(payload, "", "as in section F.8: frame-bound and safe to copy", True)])
        elif chunk_type == "x":
            rows += chunk("x", [Row(payload, "`entry_count`, and both steps of each entry", _values(payload))])
        else:
            rows += chunk("E", [
                Row(payload[:4], "`frame_count`", "6"),
                Row(payload[4:], "`index_length`", str(int.from_bytes(payload[4:], "little"))),
            ])  # fmt: skip
    example = Example("F.9", rows, 6)
    assert example.data == out.getvalue()
    return example


def _values(payload: bytes) -> str:
    """The `uv`s of a payload."""
    values, value, shift = [], 0, 0
    for byte in payload:
        value |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            values.append(value)
            value = shift = 0
    return ", ".join(map(str, values))


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


def written(example: Example) -> str:
    """The bytes, the table and the answer of an example, as they stand in spec.md."""
    digits = [f"{byte:02x}" for byte in example.data]
    lines = ["```hex", *(" ".join(digits[first : first + 32]) for first in range(0, len(digits), 32)), "```", ""]
    lines += ["| byte | hexadecimal | element | value |", "|---:|---|---|---|"]
    offset = 0
    for row in example.rows:
        hexadecimal = row.data.hex(" ").upper()
        if row.known and len(row.data) > 4:
            hexadecimal = f"{row.data[:2].hex(' ').upper()} … {row.data[-1:].hex().upper()}"
        lines.append(f"| {offset} | {hexadecimal} | {row.element} | {row.value} |")
        offset += len(row.data)
    return "\n".join([*lines, "", _answer(example)])


def _answer(example: Example) -> str:
    frames = f"{example.frames} frame{'' if example.frames == 1 else 's'}" if example.frames else "no frame"
    if not example.error:
        return f"A decoder of this version answers: {frames}, without a fault."
    kind, rule, bit = example.error.split()
    return f"A decoder of this version answers: {frames}, then `{kind}`, {rule}, bit {bit} (byte {int(bit) // 8})."


def place(text: str, example: Example) -> tuple[int, int]:
    """Where an example stands in spec.md: from its bytes to the end of its answer."""
    first = text.index(f"### {example.clause} ")
    found = re.compile(r"^```hex\n.*?^A decoder of this version answers:[^\n]*", re.MULTILINE | re.DOTALL).search(
        text, first
    )
    assert found is not None, example.clause
    return found.span()


def write() -> None:
    """Write all examples into spec.md."""
    text = SPEC.read_text(encoding="utf-8")
    for example in examples():
        first, stop = place(text, example)
        text = text[:first] + written(example) + text[stop:]
    SPEC.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    if sys.argv[1:] != ["--write"]:
        raise SystemExit(__doc__)
    write()
