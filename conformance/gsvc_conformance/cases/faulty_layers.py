"""Faulty streams of profile `main` with layers (spec.md section 15.13)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from gsvc_base import spec
from gsvc_base.draws import Draws
from gsvc_conformance.case import Fault, Inputs, add
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.cases.building import result
from gsvc_conformance.cases.main_layers import BASE, LEVEL_2, SIZE, Edit, LayerPlan, covering, with_layers
from gsvc_conformance.cases.main_streams import MAIN_HEADER, Plan, codes_of, crowd
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.main.cells import halving_count
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.main.densities import PLANES, SLOPED
from gsvc_ref.testing import Lie, join_chunks, split_chunks, write_stream


def grown(count: int, new: int, kind: MainCodes) -> MainCodes:
    """A P-frame of `count` splats that stay as they are, with `new` ones of an I-frame."""
    still = np.zeros(count, np.int64), np.zeros((count, 8), np.int64)
    return replace(kind, type="P", new=kind.new.take(np.arange(new)), modes=still[0], differences=still[1])


def _body(*, head: int = 3, quantizer: int = 24, number: int = 3) -> Edit:
    """A payload whose body says this much, of what is an I of layer 1 with two splats."""
    return lambda payload: payload[:1] + bytes([head, quantizer]) + encode_uv(number) + payload[4:]


def without_densities(payload: bytes) -> bytes:
    """The payload of a layer whose `splat_number` says that it has no densities."""
    at = 2 + (payload[1] >> 1 & 1)
    return payload[:at] + bytes([payload[at] & ~1]) + payload[at + 1 :]


def _low_state(payload: bytes) -> bytes:
    """The payload of a layer of one lane and few splats, whose `lane_state` is 0."""
    bits = 16 * len(PLANES) + 8 * len(SLOPED) + 3 * halving_count(MAIN_HEADER.width, MAIN_HEADER.height)
    at = 4 + -(-bits // 8)
    return payload[:at] + bytes(4) + payload[at + 4 :]


def _first_layer(data: bytes) -> tuple[int, int]:
    """Where the first chunk `n` of a stream begins and ends."""
    chunks = split_chunks(data)
    number = next(number for number, (kind, _) in enumerate(chunks) if kind == b"n")
    start, end = (len(join_chunks(chunks[:n], prefix=data[:PREFIX_SIZE])) for n in (number, number + 1))
    return start, end


def _other_checksum(data: bytes) -> bytes:
    """The stream with another bit in `chunk_crc` of its first chunk `n`."""
    _, end = _first_layer(data)
    return data[: end - 1] + bytes([data[end - 1] ^ 1]) + data[end:]


def _long_claim(data: bytes) -> bytes:
    """The stream up to the length of its first chunk `n`, which is beyond level 1."""
    start, _ = _first_layer(data)
    return data[: start + 1] + encode_uv(2**20 + 1)


@dataclass(frozen=True)
class FaultyLayer:
    """A faulty stream with layers: its chunks, the rule, the lie and the truth, and the counts of its frames."""

    layers: tuple[LayerPlan, ...]
    rule: str
    lie: str
    truth: str
    plans: tuple[Plan | MainCodes, ...] = BASE
    header: tuple[tuple[str, Any], ...] = ()
    complete: int = 1
    quality: int = 3
    masks: tuple[tuple[int, int], ...] = ()
    lost: tuple[tuple[int, int], ...] = ()
    in_base: bool = False  # whether a decoder of the base finds it, too
    long: bool = False  # whether the stream is too long for mutants
    spoil: Callable[[bytes], bytes] = bytes  # what is done to the stream


LAYER_I: Final = Plan("I", 2)
MISSING: Final = "layer_mask names a layer without a chunk after "
STANDS: Final = "it must stand there"
LAST_OF_LEVEL_2: Final = ("level", 2), ("layer_count", 3), ("qualities", ((1, 0), (1, 0), (2, 0)))
OF_LEVEL_1: Final = {
    "splats": FaultyLayer((LayerPlan(0, 1, LAYER_I, _body(number=2 * 16378 + 1)),), "R-5-2",
        "6 splats of the base and 16379 of a layer", "level 1 allows 16384 together"),
    "splats_of_a_layer_that_is_repeated": FaultyLayer((LayerPlan(0, 1, crowd(MAIN_HEADER, (25, 0), 16380)),
        LayerPlan(1, 1, Plan("R"))),
        "R-5-2", "a base of 2 splats grows by 3 below a layer of 16380, which is repeated",
        "level 1 allows 16384 together", (Plan("I", 2), Plan("P", 3, kind="likely")), complete=2, long=True),
    "splats_that_are_carried": FaultyLayer((LayerPlan(0, 1, crowd(MAIN_HEADER, (25, 0), 16380)),), "R-5-2",
        "a base of 2 splats grows by 3 below a layer of 16380, which is carried", "level 1 allows 16384 together",
        (Plan("I", 2), Plan("P", 3, kind="likely")), complete=1),
}  # fmt: skip
"""More splats with a layer than level 1 allows; faulty streams of level 2, too, whose quality 1 is of level 1."""
FAULTY_LAYERS: Final = {
    "layer_0": FaultyLayer((LayerPlan(0, 1, LAYER_I, lambda p: bytes([p[0] & 63]) + p[1:]),), "R-3.2-1",
        "a chunk is of layer 0", "the base has no chunk"),
    "not_named": FaultyLayer((LayerPlan(0, 2, LAYER_I),), "R-15.13-1",
        "a chunk is of layer 2, and the mask names layer 3", "it must be named", masks=((0, 8),)),
    "beyond_layer_count": FaultyLayer((LayerPlan(0, 3, LAYER_I),), "R-15.13-1", "a chunk is of layer 3",
        "layer_count is 3", header=(("layer_count", 3),)),
    "no_layers": FaultyLayer((LayerPlan(0, 1, LAYER_I),), "R-15.13-1", "a chunk is of layer 1", "layer_count is 1",
        header=(("layer_count", 1),)),
    "not_in_order": FaultyLayer((LayerPlan(0, 3, LAYER_I), LayerPlan(0, 2, LAYER_I)), "R-15.13-1",
        "a chunk of layer 2 stands after one of layer 3", "layers stand in their order", quality=1),
    "twice": FaultyLayer((LayerPlan(0, 1, LAYER_I), LayerPlan(0, 1, Plan("P"))), "R-15.13-1",
        "a frame has two chunks of layer 1", "one at most"),
    "twice_i": FaultyLayer((LayerPlan(0, 1, LAYER_I), LayerPlan(0, 1, LAYER_I)), "R-15.13-1",
        "a frame has two chunks I of layer 1", "one at most"),
    "reserved_type": FaultyLayer((LayerPlan(0, 1, LAYER_I, lambda p: bytes([p[0] | 48]) + p[1:]),), "R-3.2-1",
        "layer_type is 3", "I, P or R"),
    "mask_bit_0": FaultyLayer((), "R-3.2-1", "bit 0 of layer_mask is 1", "it is reserved", masks=((1, 1),),
        in_base=True),
    "mask_bit_4": FaultyLayer((), "R-3.2-1", "bit 4 of layer_mask of an R-frame is 1", "it is reserved", complete=2,
        masks=((2, 16),), in_base=True),
    **{f"mask_bit_{bit}": FaultyLayer((), "R-3.2-1", f"bit {bit} of layer_mask is 1", "it is reserved", complete=0,
        masks=((0, 1 << bit),), in_base=True) for bit in (5, 6)},
    "mask_bit_7": FaultyLayer((), "R-3.2-1", "bit 7 of layer_mask is 1", "it is reserved", complete=0,
        masks=((0, 128),), in_base=True),
    "wrong_checksum": FaultyLayer((LayerPlan(0, 1, LAYER_I),), "R-6.2-2", "chunk_crc of a layer has another bit",
        "it is the CRC-32C, whether a decoder shows the layer or not", spoil=_other_checksum, in_base=True),
    "payload_over_the_level": FaultyLayer((LayerPlan(0, 1, LAYER_I),), "R-5-3",
        "a chunk of a layer claims 2^20 + 1 bytes",
        "level 1 allows 2^20, whether a decoder shows the layer or not", spoil=_long_claim, in_base=True),
    "frame_low": FaultyLayer((LayerPlan(0, 1, LAYER_I), LayerPlan(1, 1, Plan("R"), lambda p: bytes([p[0] & ~15]))),
        "R-15.13-4", "frame_low after frame 1 is 0", "1", complete=2),
    "frame_low_of_16": FaultyLayer((LayerPlan(16, 1, LAYER_I, lambda p: bytes([p[0] | 15]) + p[1:]),), "R-15.13-4",
        "frame_low after frame 16 is 15", "0", (Plan("I", 2), *[Plan("R")] * 17), complete=17),
    "missing_behind_i": FaultyLayer((LayerPlan(0, 1, LAYER_I),), "R-15.13-6", MISSING + "an I-frame", STANDS,
        lost=((0, 1),)),
    "missing_behind_p": FaultyLayer((LayerPlan(0, 1, LAYER_I), LayerPlan(1, 1, Plan("P"))), "R-15.13-6",
        MISSING + "a P-frame", STANDS, complete=2, lost=((1, 1),)),
    "missing_behind_r": FaultyLayer((LayerPlan(0, 1, LAYER_I), LayerPlan(2, 1, Plan("P"))), "R-15.13-6",
        MISSING + "an R-frame", STANDS, complete=3, lost=((2, 1),)),
    "missing_at_the_end": FaultyLayer((LayerPlan(0, 1, LAYER_I), LayerPlan(3, 1, Plan("P"))), "R-15.13-6",
        MISSING + "the last frame", STANDS, complete=4, lost=((3, 1),)),
    "missing_below": FaultyLayer((LayerPlan(0, 1, LAYER_I), LayerPlan(0, 2, LAYER_I),
        LayerPlan(1, 1, Plan("R")), LayerPlan(1, 2, Plan("P"))),
        "R-15.13-6", "a chunk of layer 2 stands where one of layer 1 is named", STANDS, complete=2, lost=((1, 1),)),
    "missing_below_one_that_is_not_wanted": FaultyLayer((LayerPlan(0, 1, LAYER_I), LayerPlan(0, 2, LAYER_I)),
        "R-15.13-6", "a chunk of layer 2 stands where one of layer 1 is named, and the decoder wants that alone",
        STANDS, quality=1, lost=((0, 1),)),
    "p_without_i": FaultyLayer((LayerPlan(0, 1, Plan("P", 2)),), "R-15.13-2", "a layer begins with P", "with I"),
    "r_without_i": FaultyLayer((LayerPlan(1, 1, Plan("R")),), "R-15.13-2", "a layer begins with R", "with I",
        complete=2),
    "p_behind_an_i_frame": FaultyLayer((LayerPlan(0, 1, LAYER_I), LayerPlan(1, 1, Plan("P"))), "R-15.13-2",
        "a layer goes on with P after an I-frame of the base", "it is gone", (Plan("I", 2), Plan("I", 2)), complete=2),
    "checksum": FaultyLayer((LayerPlan(0, 1, LAYER_I, lambda p: p[:1] + bytes([p[1] ^ 1]) + p[2:]),), "R-6.4-3",
        "the checksum of a layer has another bit", "it is that of the layer's splats",
        header=(("parameter_checksum_flag", True),)),
    "quantizer_80": FaultyLayer((LayerPlan(0, 1, LAYER_I, _body(quantizer=80)),), "R-3.2-1",
        "quantizer of a layer is 80", "79 is the highest"),
    "field_of_i": FaultyLayer((LayerPlan(0, 1, LAYER_I, _body(head=7)),), "R-15.5-2", "I of a layer has a motion field",
        "there is nothing that moves"),
    "no_densities": FaultyLayer((LayerPlan(0, 1, LAYER_I, _body(number=2)),), "R-15.5-3",
        "I of a layer has no densities", "it must have its own"),
    "densities_of_the_base": FaultyLayer((LayerPlan(0, 1, Plan("I")), LayerPlan(1, 1, Plan("P", 2), without_densities)),
        "R-15.5-4", "new splats of a layer without densities, which the base has", "a layer needs its own", complete=2),
    "splats_of_two_layers": FaultyLayer((LayerPlan(0, 1, Plan("I", 3)),
        LayerPlan(0, 2, LAYER_I, _body(number=2 * 16375 + 1))),
        "R-5-2", "6 splats of the base, 3 of layer 1 and 16376 of layer 2", "level 1 allows 16384 together"),
    "splats_of_a_layer_that_grows": FaultyLayer((LayerPlan(0, 1, Plan("I", 3)),
        LayerPlan(1, 1, Plan("P", 2), _body(number=2 * 16380 + 1))),
        "R-5-2", "a base of 7 splats, and 3 of a layer that grows by 16381", "level 1 allows 16384 together",
        complete=2),
    **OF_LEVEL_1,
    "work": FaultyLayer((LayerPlan(0, 1, covering(113)), LayerPlan(0, 2, covering(100))), "R-5-4",
        "513 splats of the base and two layers cover 256x256 pixels: 2^25 + 2^16 pairs", "level 1 allows 2^25",
        (covering(300),), tuple(SIZE.items())),
    "work_that_is_carried": FaultyLayer((LayerPlan(0, 1, covering(300)),), "R-5-4",
        "a base of 212 splats grows by 1 below a layer of 300, all of which cover 256x256 pixels",
        "level 1 allows 2^25 pairs", (covering(212), grown(212, 1, covering(1))), tuple(SIZE.items())),
    "work_of_a_point_that_takes_less": FaultyLayer((LayerPlan(0, 1, covering(213)),), "R-5-4",
        "513 splats of the base and layer 1 cover 256x256 pixels, and quality 1 is shown at half size",
        "level 1 allows 2^25 pairs at full size", (covering(300),),
        (*SIZE.items(), ("layer_count", 2), ("qualities", ((1, 1), (1, 1)))), quality=1),
    "work_of_a_point_that_takes_less_and_is_carried": FaultyLayer((LayerPlan(0, 1, covering(300)),), "R-5-4",
        "a base of 212 splats grows by 1 below a layer of 300, and quality 1 is shown at half size",
        "level 1 allows 2^25 pairs at full size", (covering(212), grown(212, 1, covering(1))),
        (*SIZE.items(), ("layer_count", 2), ("qualities", ((1, 1), (1, 1)))), quality=1),
    "second_of_a_layer": FaultyLayer((LayerPlan(0, 1, covering(100)), LayerPlan(4, 2, covering(112)),
        LayerPlan(8, 2, Plan("R"))),
        "R-5-7", "with layer 2 the ninth frame of a second has 9 times the work of a frame",
        "level 1 allows 8 times that of a frame", (covering(300), *[Plan("R")] * 8),
        (*SIZE.items(), ("paced_flag", True)), complete=9),
    "distance_of_i_frames": FaultyLayer((LayerPlan(0, 1, LAYER_I), LayerPlan(3, 1, LAYER_I)), "R-5-8",
        "an I-frame is due in a paced stream, and a layer had one a second ago", "I-frames of the base count alone",
        (Plan("I", 2), *[Plan("R")] * 4), (("paced_flag", True), ("frame_rate_numerator", 1)), complete=4,
        in_base=True),
    "bytes_of_a_layer": FaultyLayer((LayerPlan(0, 2, LAYER_I, lambda p: p.ljust(2**20, b"\0")),), "R-5-7",
        "a second has more than 2^20 bytes with a layer above the wanted quality", "level 1 allows 2^20",
        header=(("paced_flag", True),), quality=0, in_base=True, long=True),
    "point_of_a_payload": FaultyLayer((LayerPlan(0, 1, LAYER_I, lambda p: p.ljust(2**20 + 1, b"\0")),), "R-5-9",
        "layer 1 has 2^20 + 1 bytes, and quality 1 asks for level 1", "level 1 allows 2^20",
        header=LAST_OF_LEVEL_2, quality=1, long=True),
    "point_of_a_second": FaultyLayer((), "R-5-9",
        "65 frames of 512x256 pixels stand in a second, and quality 0 asks for level 1",
        "level 1 allows 64 times those of a frame", (Plan("I"), *[Plan("R")] * 64),
        (*LEVEL_2.items(), ("width", 512), ("height", 256), ("paced_flag", True), ("frame_rate_numerator", 65)),
        complete=64, quality=0, in_base=True),
    "point_of_a_second_of_a_layer": FaultyLayer((LayerPlan(0, 1, covering(100)),
        LayerPlan(4, 1, grown(100, 112, covering(112))), LayerPlan(8, 1, Plan("R"))), "R-5-9",
        "with layer 1 the ninth frame of a second has 9 times the work of a frame, and quality 1 asks for level 1",
        "level 1 allows 8 times that of a frame", (covering(300), *[Plan("R")] * 8),
        (*SIZE.items(), *LAST_OF_LEVEL_2, ("paced_flag", True)), complete=9, quality=1),
    "point_of_too_many_splats": FaultyLayer((LayerPlan(0, 1, LAYER_I),), "R-5-9",
        "the base has 16385 splats, and quality 0 asks for level 1", "level 1 allows 16384",
        (crowd(MAIN_HEADER, (25, 0), 16385),), tuple(LEVEL_2.items()), complete=0, quality=0, in_base=True),
    "point_of_too_much_work": FaultyLayer((LayerPlan(0, 1, LAYER_I),), "R-5-9",
        "513 splats of the base cover 256x256 pixels, and quality 0 asks for level 1", "level 1 allows 2^25 pairs",
        (covering(513),), (*SIZE.items(), *LEVEL_2.items()), complete=0, quality=0, in_base=True),
    "point_of_a_layer": FaultyLayer((LayerPlan(0, 1, covering(213)), LayerPlan(0, 2, LAYER_I)), "R-5-9",
        "513 splats of the base and layer 1 cover 256x256 pixels, and quality 1 asks for level 1",
        "level 1 allows 2^25 pairs", (covering(300),),
        (*SIZE.items(), *LAST_OF_LEVEL_2), quality=1),
    "point_of_too_many_bytes": FaultyLayer((LayerPlan(0, 1, LAYER_I, lambda p: p[:1] + bytes(2**20)),), "R-5-9",
        "a chunk of layer 1 has 2^20 + 1 bytes, and quality 1 asks for level 1", "level 1 allows 2^20",
        header=LAST_OF_LEVEL_2, quality=1, long=True),
    **{f"point_of_{name}": replace(entry, rule="R-5-9", lie=f"{entry.lie}; quality 1 asks for level 1",
        header=LAST_OF_LEVEL_2, quality=1) for name, entry in OF_LEVEL_1.items()},
    "lane_state": FaultyLayer((LayerPlan(0, 1, Plan("I", 1, kind="likely"), _low_state),), "R-6.6-5",
        "a lane state of a layer is too low", "2^16 is the lowest"),
    "word_too_few": FaultyLayer((LayerPlan(0, 1, Plan("I", 9), lambda p: p[:-2]),), "R-7-1",
        "the last word of a layer is missing", "its symbols need it"),
    "word_too_many": FaultyLayer((LayerPlan(0, 1, Plan("I", 9), lambda p: p + bytes(2)),), "R-7-1",
        "a word of a layer is left over", "all words are taken"),
    "r_with_a_body": FaultyLayer((LayerPlan(0, 1, LAYER_I), LayerPlan(1, 1, Plan("R"), lambda p: p + b"\x18")),
        "R-6.2-3", "R of a layer has a quantizer", "it has nothing", complete=2),
    "empty": FaultyLayer((LayerPlan(0, 1, LAYER_I, lambda _: b""),), "R-6.2-3", "a chunk of a layer is empty",
        "it has a layer"),
    "cut": FaultyLayer((LayerPlan(0, 1, LAYER_I, lambda p: p[:3]),), "R-6.2-3",
        "a chunk of a layer ends before its count", "it has a body"),
}  # fmt: skip
"""Faulty streams with layers, by the ends of their slugs."""


def faulty_layer(value: FaultyLayer) -> Inputs:
    """A decoder of layers reports the kind of the fault, and yields the frames before it."""
    stream = _stream_of(value)
    expected = yield {"stream": stream, "layer": value.quality}
    _check(value, expected)
    assert (spec.reconstruct_stream(stream)["error"] == "") != value.in_base


def faulty_base(value: FaultyLayer) -> Inputs:
    """So does a decoder of the base, where it finds the fault, too."""
    expected = yield {"stream": _stream_of(value)}
    _check(value, expected)


def _stream_of(value: FaultyLayer) -> bytes:
    masks, header = dict(value.masks), dict(value.header)
    return value.spoil(with_layers(Draws(31), value.plans, value.layers, masks=masks, lost=value.lost, **header))


def _check(value: FaultyLayer, expected: Mapping[str, Any]) -> None:
    assert result(expected, "error").split()[1] == value.rule
    assert len(result(expected, "counts")) == value.complete


OF_BASE: Final = {
    f"main_layer_{key}": entry for key, entry in FAULTY_LAYERS.items() if entry.in_base and not entry.long
}
"""Those that a decoder without layers has to find."""

for name, function, entries in (
    ("reconstruct_layers", faulty_layer, {f"layer_{key}": entry for key, entry in FAULTY_LAYERS.items()}),
    ("reconstruct_stream", faulty_base, OF_BASE),
):
    for key, entry in entries.items():
        add(
            "faulty",
            name,
            key,
            title=f"{entry.rule} is broken: {entry.lie}.",
            reason="" if entry.in_base else "A decoder that shows the base alone finds no fault.",
            rules=[entry.rule],
            flags=[CAPACITY] if entry.long else [],
            fault=Fault(entry.lie, entry.truth),
            function=function,
            arguments={"value": entry},
        )


POINTS: Final[dict[str, tuple[str, Lie, str, str]]] = {
    "level_0": ("R-3.2-1", Lie("quality_level", 0), "quality_level is 0", "it is reserved"),
    "level_6": ("R-3.2-1", Lie("quality_level", 6, 1), "the second quality_level is 6", "5 is the highest"),
    "reserved": ("R-3.2-1", Lie("quality_reserved", 4), "quality_reserved is 4", "0"),
    **{f"reserved_{value}": ("R-3.2-1", Lie("quality_reserved", value), f"quality_reserved is {value}", "0")
       for value in (1, 2)},
    "below_the_level": ("R-5-9", Lie("quality_level", 1, 1), "level is 2, and no quality_level is",
        "level is the greatest"),
    "above_the_level": ("R-5-9", Lie("quality_level", 3), "quality_level is 3, and level 2", "level is the greatest"),
    "payload": ("R-5-9", Lie("chunk_length", 2**20 + 1, 1),
        "the I-frame claims 2^20 + 1 bytes, and quality 0 asks for level 1", "level 1 allows 2^20"),
    "too_many_splats": ("R-5-9", Lie("splat_number", 2 * 16384 + 1),
        "splat_number says 16385 splats, and quality 0 asks for level 1", "level 1 allows 16384"),
    "too_many_pixels": ("R-5-9", Lie("quality_halvings", 0),
        "a frame has 600x300 pixels, and quality 0 asks for level 1", "level 1 allows 2^17"),
    "too_many_bytes": ("R-5-9", Lie("chunk_length", 2**20 + 1, 1),
        "a chunk claims 2^20 + 1 bytes, and quality 0 asks for level 1", "level 1 allows 2^20"),
}  # fmt: skip
"""Faulty operating points of a stream of two qualities, of which the first is shown at half size."""


def faulty_point(value: tuple[str, Lie, str, str]) -> Inputs:
    """The stream is refused before its first frame."""
    header = replace(MAIN_HEADER, width=600, height=300, level=2, layer_count=2, qualities=((1, 1), (2, 0)))  # type: ignore[arg-type]
    codes = codes_of(header, [Plan("I", 3)], Draws(33))
    expected = yield {"stream": write_stream(header, codes, index=False, lies=[value[1]])}
    assert result(expected, "error").split()[1] == value[0]


for key, point in POINTS.items():
    add(
        "faulty",
        "reconstruct_stream",
        f"main_point_{key}",
        title=f"{point[0]} is broken: {point[2]}.",
        reason="",
        rules=[point[0]],
        fault=Fault(point[2], point[3]),
        function=faulty_point,
        arguments={"value": point},
    )
