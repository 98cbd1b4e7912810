"""The syntax elements of spec.md section 6, and which of their values the vectors have.

An element goes by its name in spec.md, without the plane or channel that it is part of; `frame_count (end)` is that of
the end chunk. A plane counts as an element by its role (`survivor_map`, `position_high`, ...), with its symbols as
values; so do `reference_count` and `survivor_count`, on which the presence of others depends.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

from gsvc_base.syntax import named
from gsvc_conformance.element_values import Number, Values, plane_values, values
from gsvc_conformance.sets import read_sets, withdrawn
from gsvc_conformance.spec import header_rows
from gsvc_conformance.vector import MANIFEST, files_in, vector_in

Aspect = Literal["min", "max", "default", "reserved", "absent"]
ASPECTS: Final[tuple[Aspect, ...]] = ("min", "max", "default", "reserved", "absent")

MOST: Final = 2**32 - 1
HALF: Final = 65504.0
TINY: Final = 2.0**-126


@dataclass(frozen=True)
class Syntax:
    """One syntax element.

    Attributes
    ----------
    minimum, maximum
        Ends of its range; None where the text gives none, or none that means anything for it alone.
    default
        The value that stands for "unknown" or "none".
    absent
        The element and its value with which this one is absent.
    refused
        Reserved values, and values beside the range, that a decoder must refuse.
    """

    minimum: Number | None = None
    maximum: Number | None = None
    default: int | None = None
    absent: tuple[str, int] | None = None
    refused: tuple[Number, ...] = ()

    def aspects(self) -> dict[Aspect, tuple[tuple[str | None, Number], ...]]:
        """For each aspect the element (None: this one) and the values that must occur."""
        found: dict[Aspect, tuple[tuple[str | None, Number], ...]] = {}
        single: tuple[tuple[Aspect, Number | None], ...] = (
            ("min", self.minimum),
            ("max", self.maximum),
            ("default", self.default),
        )
        for aspect, value in single:
            if value is not None:
                found[aspect] = ((None, value),)
        if self.refused:
            found["reserved"] = tuple((None, value) for value in self.refused)
        if self.absent is not None:
            found["absent"] = (self.absent,)
        return found


def _stated(name: str, **others: Any) -> Syntax:
    """An element with the range that spec.md states; an end that is another element is the greatest value of that."""
    about = named()[name]
    lowest, highest = about.get("minimum"), about.get("maximum")
    if isinstance(highest, str):
        highest = next(e["maximum"] for e in named().values() if highest in (e["name"], e.get("symbol")))
    return Syntax(lowest, highest, **others)


def _flag() -> Syntax:
    return Syntax(0, 1, absent=("splat_count", 0))


_REFUSED_TOO: Final = {"profile": (255,), "flags": (128,)}
_ZERO_IS_UNKNOWN: Final = ("sample_aspect_numerator", "sample_aspect_denominator", "frame_count")


def _of_header(name: str, size: int, lowest: int, highest: int) -> Syntax:
    """An element of the sequence header; the values next to its range are refused where its bytes can say them."""
    beside = tuple(value for value in (lowest - 1, highest + 1) if 0 <= value < 256**size)
    default = 0 if name in _ZERO_IS_UNKNOWN else None
    return Syntax(lowest, highest, default=default, refused=(*beside, *_REFUSED_TOO.get(name, ())))


_HEADER: Final[Mapping[str, Syntax]] = {row[0]: _of_header(*row) for row in header_rows("paper")}
"""The elements of the sequence header of profile `paper`, with the ranges of spec.md's own tables (section 6.3)."""

ELEMENTS: Final[Mapping[str, Syntax]] = {
    "magic": Syntax(),
    "version_major": Syntax(130, 130, refused=(0, 1, 2, 128, 129, 131, 255)),
    "version_minor": Syntax(0, 255),
    "chunk_type": Syntax(refused=tuple(b"ABXZ\x00@[`{\xe9")),
    "chunk_length": Syntax(0, 1 << 28, refused=((1 << 20) + 1, (1 << 28) + 1, MOST)),
    "chunk_crc": Syntax(),
    **_HEADER,
    "frame_number": Syntax(0, MOST),
    "parameter_checksum": Syntax(absent=("flags", 0)),
    "splat_count": Syntax(0, 1 << 22, refused=((1 << 14) + 1, (1 << 22) + 1, MOST)),
    "new_splat_count": Syntax(0, 1 << 22, refused=((1 << 14) + 1, MOST)),
    "survivor_map": _stated("survivor_map", absent=("reference_count", 0)),
    "positions_present": _flag(),
    "cholesky_present": _flag(),
    "quantizer_present": _flag(),
    "colors_present": _flag(),
    "codebooks_present": _flag(),
    "block_reserved": _stated("block_reserved", refused=(1, 2, 4)),
    "position_high": Syntax(0, 0xFB, absent=("positions_present", 0)),
    "position_low": Syntax(0, 255, absent=("positions_present", 0)),
    "cholesky_scale": Syntax(TINY, absent=("quantizer_present", 0), refused=(0.0, -1.0, TINY - 2.0**-149)),
    "cholesky_offset": Syntax(absent=("quantizer_present", 0)),
    "cholesky_code": Syntax(0, 4095, absent=("cholesky_present", 0)),
    "stage_count": _stated("stage_count", absent=("codebooks_present", 0), refused=(0, 2)),
    "codeword_count": _stated("codeword_count", absent=("codebooks_present", 0), refused=(0, 5)),
    "codeword": Syntax(-HALF, HALF, absent=("codebooks_present", 0)),
    "color_index": Syntax(0, 1023, absent=("colors_present", 0)),
    "plane_mode": _stated("plane_mode", refused=(3,)),
    "symbol": Syntax(0, 4095, absent=("plane_mode", 2)),
    "table_bits": _stated("table_bits", absent=("plane_mode", 0), refused=(0, 31)),
    "golomb_order": Syntax(0, 15, absent=("plane_mode", 0)),
    "first_symbol": Syntax(0, 4094, absent=("plane_mode", 0)),
    "last_symbol": Syntax(1, 4095, absent=("plane_mode", 0)),
    "frequency": Syntax(0, 65535, absent=("plane_mode", 0)),
    "word_count": Syntax(0, absent=("plane_mode", 0), refused=(MOST,)),
    "lane_state": _stated("lane_state", absent=("plane_mode", 0), refused=(65535, 0)),
    "word": Syntax(absent=("word_count", 0)),
    "entry_count": Syntax(0, absent=("index_length", 0)),
    "frame_number_step": Syntax(0, absent=("entry_count", 0)),
    "offset_step": Syntax(0, absent=("entry_count", 0)),
    "frame_count (end)": Syntax(1, MOST, refused=(0,)),
    "index_length": Syntax(0, default=0, refused=(1, MOST)),
    "max_lane_exponent": _stated("max_lane_exponent", refused=(7, 13)),
    "layer_count": _stated("layer_count", refused=(0, 5)),
    "main_tools": _stated("main_tools", refused=(1, 128)),
    "quality_level": _stated("quality_level", refused=(0, 6)),
    "quality_halvings": _stated("quality_halvings"),
    "quality_reserved": _stated("quality_reserved", refused=(4,)),
    "layer_mask": Syntax(0, 14, refused=(1, 128)),
    "lane_exponent": _stated("lane_exponent", refused=(3, 13, 15)),
    "motion_cell": _stated("motion_cell"),
    "quantizer_present (frame_body)": _stated("quantizer_present", refused=(0,)),
    "new_present": _flag(),
    "quantizer": _stated("quantizer", refused=(80, 255)),
    "splat_number": Syntax(0, absent=("new_present", 0), refused=(2 << 14, (2 << 14) + 1)),
    "lane_state (run)": Syntax(1 << 16, refused=(65535, 0)),
    "word_count (run)": Syntax(0, refused=(1 << 31,)),
    "word (run)": Syntax(),
    "raw_byte": Syntax(),
    **{name: _stated(name) for name in ("density_family", "scale_code", "centre", "slope", "halving_code")},
    "layer": _stated("layer", refused=(0,)),
    "layer_type": Syntax(0, 2, refused=(3,)),
    "frame_low": Syntax(0, 15),
}
"""All syntax elements, in the order of spec.md."""

UNCOVERED: Final[Mapping[tuple[str, Aspect], str]] = {
    ("chunk_length", "max"): "a chunk of 2^28 bytes would be larger than all vectors together",
    ("frame_count", "max"): "a stream would need 2^32 - 1 frames",
    ("frame_count (end)", "max"): "a stream would need 2^32 - 1 frames",
    ("frame_number", "max"): "a stream would need 2^32 frames",
    ("splat_count", "max"): "2^22 splats take more time than a vector may; 2^14, the limit of level 1, occurs",
    ("new_splat_count", "max"): "2^22 splats take more time than a vector may; the limit of level 1 is exercised",
}
"""Aspects without a vector, and why."""


Coverage = Mapping[tuple[str, Aspect], list[str]]
"""The ids of the vectors that have an aspect of an element."""


def _of_vectors(folder: Path) -> tuple[dict[str, Values], dict[str, Values]]:
    """The values in the legal and in the faulty streams and planes of a folder of vectors, by id."""
    legal: dict[str, Values] = {}
    faulty: dict[str, Values] = {}
    files = files_in(folder)
    gone = withdrawn(read_sets(files))
    for home, _, part in sorted(name.rpartition("/") for name in files):
        if home in gone or "/seek/" in home:  # a stream of seek may have a fault that is not met
            continue
        if part == "stream.gsvc":
            (faulty if home.startswith("faulty/") else legal)[home] = values(files[f"{home}/{part}"])
        elif part == MANIFEST and "/decode_plane/" in home:
            inputs = vector_in(files, home).inputs
            numbers = {name: value for name, value in inputs.items() if name != "data"}
            legal[home] = plane_values(inputs["data"].tobytes(), numbers)
    return legal, faulty


def element_coverage(folder: Path) -> Coverage:
    """The vectors of a folder that have each aspect of each element; of several refused values each is had by some."""
    legal, faulty = _of_vectors(folder)
    found: dict[tuple[str, Aspect], list[str]] = {}
    for element, syntax in ELEMENTS.items():
        for aspect, wanted in syntax.aspects().items():
            there = faulty if aspect == "reserved" else legal
            hits = [
                [name for name, some in there.items() if value in some.get(other or element, (0, set()))[1]]
                for other, value in wanted
            ]
            found[element, aspect] = sorted({name for some in hits for name in some}) if all(hits) else []
    return found


def element_rows(found: Coverage) -> list[list[str]]:
    """Rows of a table: element, then the vectors that have its min, max, default, reserved values, and lack it."""
    return [
        [f"`{element}`", *(_cell(element, aspect, syntax.aspects().get(aspect), found) for aspect in ASPECTS)]
        for element, syntax in ELEMENTS.items()
    ]


def _cell(
    element: str,
    aspect: Aspect,
    wanted: tuple[tuple[str | None, Number], ...] | None,
    found: Coverage,
) -> str:
    if wanted is None:
        return "–"
    what = ", ".join(f"`{other}` {value}" if other else str(value) for other, value in wanted)
    vectors = found[element, aspect]
    return f"{what}: {len(vectors) or UNCOVERED.get((element, aspect), '**missing**')}"


def uncovered_elements(found: Coverage) -> list[str]:
    """A sentence for each aspect that no vector has without a stated reason, and for each needless reason."""
    missing = [f"no vector has the {a} of {e}" for (e, a), ids in found.items() if not ids and (e, a) not in UNCOVERED]
    return missing + [f"the {a} of {e} has a vector and a reason to have none" for e, a in UNCOVERED if found[e, a]]
