"""Streams of profile `main` with layers (spec.md section 15.13)."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from gsvc_base import spec
from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.cases.building import on, operated, result
from gsvc_conformance.cases.main_streams import MAIN_HEADER, READ, Plan, crowd, frame_of
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.bitstream.crc import parameter_checksum
from gsvc_ref.bitstream.header import MAX_LAYERS
from gsvc_ref.main.codes import NO_FIELD, MainCodes
from gsvc_ref.main.frames import frame_body
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.main.layers import Layers
from gsvc_ref.testing import OVERVIEW_HEADER, Lie, overview_frames, write_stream

Edit = Callable[[bytes], bytes]
"""What makes the payload of a chunk from the one that is right."""


@dataclass(frozen=True)
class LayerPlan:
    """A chunk of a layer.

    Attributes
    ----------
    frame
        The number of the frame that it follows; -1: it follows the header.
    layer
        The layer.
    plan
        What its frame has, or the codes of it.
    edit
        What is done to its payload, or None.
    """

    frame: int
    layer: int
    plan: Plan | MainCodes
    edit: Edit | None = None


def with_layers(
    rng: Draws,
    plans: Iterable[Plan | MainCodes],
    layers: Iterable[LayerPlan],
    *,
    masks: Mapping[int, int] | None = None,
    lost: Iterable[tuple[int, int]] = (),
    **header: Any,
) -> bytes:
    """A stream of frames with chunks `n` after them; `layers` by frame and layer.

    Masks name the layers that follow, but for those frames that `masks` has another one of. The chunks of the pairs of
    frame and layer in `lost` are left out then.
    """
    made, layers, masks = replace(MAIN_HEADER, **{"layer_count": 4, **header}), list(layers), masks or {}
    state, base, now = _initial(made), [], []
    plans = list(plans)
    for number, plan in enumerate(plans):
        codes, _, state = _frame(made, plan, state, rng)
        base.append(codes)
        named = [entry.layer for entry in layers if entry.frame == number]
        moves = codes.field if codes.type == "P" else NO_FIELD
        now.append((state, named, moves))
    shown, behind = Layers(MAX_LAYERS), dict[int, list[tuple[bytes, bytes]]]()
    for number in range(-1, len(base)):
        if number >= 0:
            shown = shown.after(base[number].type, now[number][0], now[number][1], now[number][2], number)
        for entry in [entry for entry in layers if entry.frame == number]:
            codes, body, after = _frame(made, entry.plan, shown.start_of(entry.layer, made), rng)
            shown = replace(shown, there={**shown.there, entry.layer: replace(after, inherited=NO_FIELD)})
            flag, checksum = made.parameter_checksum_flag, int(parameter_checksum(after.splats))
            payload = bytes([head(entry.layer, codes.type, number)]) + checksum.to_bytes(4, "little") * flag + body
            if (number, entry.layer) not in lost:
                behind.setdefault(number, []).append((b"n", entry.edit(payload) if entry.edit else payload))
    places = iter(range(-1, len(base)))

    def edit(chunks: list[tuple[bytes, bytes]]) -> list[tuple[bytes, bytes]]:
        found: list[tuple[bytes, bytes]] = []
        for kind, payload in chunks:
            if kind[0] in b"HIPR":
                number = next(places)
                if kind == b"H" and made.qualities:
                    points = bytes(quality.level << 5 | quality.halvings << 3 for quality in made.qualities)
                    payload = payload[: -len(points)] + points
                if number >= 0 and made.layer_count > 1:
                    at = len(encode_uv(number)) + 4 * made.parameter_checksum_flag
                    mask = masks.get(number, sum({1 << layer for layer in now[number][1]} - {1}))
                    payload = payload[:at] + bytes([mask]) + payload[at + 1 :]
                found += [(kind, payload), *behind.get(number, [])]
            else:
                found.append((kind, payload))
        return found

    unchecked = replace(made, qualities=(), paced_flag=False)
    flags = Lie("flags", 2 * made.paced_flag + made.parameter_checksum_flag)
    return operated(edit, write_stream(unchecked, base, index=False, lies=[flags]))


def head(layer: int, layer_type: str, number: int) -> int:
    """The first byte of a chunk `n`."""
    return layer << 6 | "IPR".index(layer_type) << 4 | number & 15


def _initial(header: SequenceHeader) -> MainState:
    return MainState.initial(header.width, header.height)


def _frame(
    header: SequenceHeader, plan: Plan | MainCodes, state: MainState, rng: Draws
) -> tuple[MainCodes, bytes, MainState]:
    """The codes of a frame after a state, its body, and the state after it."""
    codes = frame_of(header, plan, state, rng)[0] if isinstance(plan, Plan) else plan
    if codes.type == "R":
        return codes, b"", state
    s = Writer()
    after = frame_body(s, codes.type, state, header.max_lane_exponent, header.limits.splats, codes).after
    return codes, s.getvalue(), after


QUALITY: Final = ("reconstruct_layers", "decode_layers")
"""The operations that most streams with layers are cases of."""


def check_sound(expected: Mapping[str, Any]) -> None:
    """The expected error is empty, and the pictures are not blank."""
    if "frames" in expected:
        assert result(expected, "frames").any()
    else:
        assert result(expected, "error") == ""


BASE: Final = Plan("I", 6), Plan("P", 1), Plan("R"), Plan("P", 2)
LAYERS: Final = (
    LayerPlan(0, 1, Plan("I", 8, 16)),
    LayerPlan(0, 2, Plan("I", 4, 12)),
    LayerPlan(1, 1, Plan("P", 2, 16)),
    LayerPlan(1, 2, Plan("R")),
    LayerPlan(2, 2, Plan("P", 1, 12)),
    LayerPlan(3, 1, Plan("P", 0, 20, motion_cell=3)),
    LayerPlan(3, 2, Plan("I", 3, 8)),
    LayerPlan(3, 3, Plan("I", 2, 8)),
)


@on("core", *QUALITY, each={str(layer): layer for layer in range(4)})
def quality(value: int) -> Inputs:
    """A stream of a base and three layers, in quality {key}: the splats of layers follow those of the base."""
    stream = with_layers(Draws(19), BASE, LAYERS)
    expected = yield {"stream": stream, "layer": value}
    check_sound(expected)
    if "counts" in expected:
        counts = result(expected, "counts")
        base = spec.reconstruct_stream(stream)["counts"]
        assert (counts >= base).all()
        assert bool((counts > base).any()) == (value > 0)


@on("core", *QUALITY, rules=["R-15.13-2"], flags=["kept"])
def layers_that_are_carried() -> Inputs:
    """Without a chunk a layer stays after R, moves with the base after P, and is gone after an I-frame."""
    plans = (
        Plan("I", 4),
        Plan("R"),
        Plan("P", 1, motion_cell=3, kind="any"),
        Plan("P", motion_cell=2, kind="any"),
        Plan("I", 2),
    )
    layers = LayerPlan(0, 1, Plan("I", 5)), LayerPlan(3, 1, Plan("P", 3))
    stream = with_layers(Draws(23), plans, layers, width=150, height=70)
    expected = yield {"stream": stream, "layer": 1}
    check_sound(expected)
    if "counts" in expected:
        base = spec.reconstruct_stream(stream)["counts"]
        extra = (result(expected, "counts") - base).tolist()
        assert extra[:3] == [5, 5, 5]
        assert extra[4] == 0
        splats = np.split(result(expected, "parameters"), np.cumsum(result(expected, "counts"))[:-1])
        behind_r, behind_p = splats[1][base[1] :], splats[2][base[2] :]
        assert np.array_equal(splats[0][base[0] :], behind_r)
        assert (behind_r[:, :2] != behind_p[:, :2]).any()
        assert np.array_equal(behind_r[:, 2:], behind_p[:, 2:])


@case("core", "reconstruct_layers", rules=["R-15.13-2"], flags=["kept", "clamp"])
def a_layer_carried_out_of_the_frame() -> Inputs:
    """The field of the base carries splats of a layer outside, and its next P codes their modes in context 9."""
    plans = Plan("I", 9), *[Plan("P", motion_cell=1, kind="any")] * 3, Plan("P", 1)
    layers = LayerPlan(0, 1, Plan("I", 20)), LayerPlan(4, 1, Plan("P", 2, kind="any"))
    stream = with_layers(Draws(24), plans, layers, width=150, height=70)
    expected = yield {"stream": stream, "layer": 1}
    assert result(expected, "error") == ""
    counts = result(expected, "counts")
    moved = result(expected, "parameters")[: counts[:4].sum()][-20:]
    assert (moved[:, 0] < 0).any() or (moved[:, 0] >= 150).any()


@case("core", "reconstruct_layers", rules=["R-15.13-2", "R-15.4-1"], flags=["clamp"])
def a_layer_carried_to_the_ends_of_its_range() -> Inputs:
    """Nine P-frames carry a layer by 8190 pixels each, to the right and upward: X ends at 2^24 and Y at -2^24."""
    size: dict[str, Any] = {"width": 144, "height": 16}
    x = 4095 * np.minimum(np.arange(1, 10), 8)
    moved = MainCodes(type="P", quantizer=24, motion_cell=3, vectors=np.stack([x, -x], axis=1)[None],
                      modes=np.zeros(1, np.int64), differences=np.zeros((1, 8), np.int64))  # fmt: skip
    base = crowd(replace(MAIN_HEADER, **size), (25, 0), 1), *[moved] * 9
    layer = crowd(replace(MAIN_HEADER, **size), (25, 0), 2)
    cells = layer.new.cells + np.array([35, 0])
    stream = with_layers(Draws(0), base, [LayerPlan(0, 1, replace(layer, new=replace(layer.new, cells=cells)))], **size)
    expected = yield {"stream": stream, "layer": 1}
    assert result(expected, "error") == ""
    assert (result(expected, "parameters")[-2:, :2] == [65536, -65536]).all()


@on("core", *QUALITY, rules=["R-15.13-2"], each={"64_pixels": 1, "32_pixels": 2, "16_pixels": 3})
def layers_that_inherit(value: int) -> Inputs:
    """Cells of {key}: layer 1 takes the field of the base for motion and contexts, and layer 2 has one of its own."""
    base = (
        Plan("I", 12),
        Plan("P", 1, motion_cell=value, kind="any"),
        Plan("R"),
        Plan("P", 1, motion_cell=value, kind="any"),
    )
    p = Plan("P", 2, 30, 1, kind="any", own=False)
    layers = [LayerPlan(0, 1, Plan("I", 30, 16)), LayerPlan(0, 2, Plan("I", 9, 16))]
    for n in (1, 2, 3):  # after the R-frame there is no field to inherit
        layers += [LayerPlan(n, 1, p), LayerPlan(n, 2, replace(p, motion_cell=3 - value % 3))]
    expected = yield {"stream": with_layers(Draws(25), base, layers, width=150, height=70), "layer": 2}
    check_sound(expected)


@case("core", "reconstruct_layers", rules=["R-15.13-2"], flags=[CAPACITY])
def layers_carried_and_inheriting_by_turns() -> Inputs:
    """Three layers over eighteen frames, so that the 4 low bits of the frame number start again at 0 after frame 15."""
    plans = Plan("I", 8), *[Plan("P", n % 3, motion_cell=n % 4, kind="any") for n in range(1, 18)]
    layers = [LayerPlan(0, layer, Plan("I", 4 + layer)) for layer in (1, 2, 3)]
    for n in range(1, 18):
        layers += [
            LayerPlan(n, layer, Plan("R" if n % 5 == 0 else "P", 1 - n % 2, motion_cell=(n + layer) % 3))
            for layer in (1, 2, 3)
            if n % (layer + 1)
        ]
    expected = yield {"stream": with_layers(Draws(26), plans, layers, width=70, height=50), "layer": 3}
    assert result(expected, "error") == ""
    assert len(result(expected, "counts")) == 18


@on("core", *QUALITY, rules=["R-15.13-2"], flags=["kept"])
def past_of_a_carried_layer() -> Inputs:
    """A P-frame changes splats of a layer and adds some, the next one carries all of them, and then nothing is past."""
    plans = Plan("I", 2), *[Plan("P", 1)] * 3
    p = Plan("P", 6, kind="any", own=False)
    layers = LayerPlan(0, 1, Plan("I", 12)), LayerPlan(1, 1, p), LayerPlan(3, 1, p)
    expected = yield {"stream": with_layers(Draws(28), plans, layers), "layer": 1}
    check_sound(expected)


@on("core", *QUALITY, rules=["R-15.13-1"])
def a_mask_beyond_layer_count() -> Inputs:
    """Bits of layers that the stream does not have are ignored: an editor that drops layers leaves them."""
    stream = with_layers(
        Draws(27),
        BASE,
        [entry for entry in LAYERS if entry.layer == 1],
        layer_count=2,
        masks={0: 0b1110, 1: 0b1010, 2: 0b1000, 3: 0b0110},
    )
    expected = yield {"stream": stream, "layer": 1}
    check_sound(expected)


@on("core", *QUALITY, rules=["R-13-9", "R-15.13-5", "R-15.13-6"])
def dropped_above_the_quality() -> Inputs:
    """A server has dropped layers 2 and 3 and left the masks: a decoder of quality 1 misses nothing."""
    lost = [(entry.frame, entry.layer) for entry in LAYERS if entry.layer > 1]
    expected = yield {"stream": with_layers(Draws(19), BASE, LAYERS, lost=lost), "layer": 1}
    check_sound(expected)
    if "counts" in expected:
        whole = spec.reconstruct_layers(with_layers(Draws(19), BASE, LAYERS), 1)
        assert np.array_equal(result(expected, "parameters"), whole["parameters"])


@on("core", *QUALITY, rules=["R-6.4-3"])
def layers_with_checksums() -> Inputs:
    """Each layer has the checksum of its own splats."""
    stream = with_layers(Draws(29), BASE, LAYERS, parameter_checksum_flag=True)
    expected = yield {"stream": stream, "layer": 3}
    check_sound(expected)


@case("core", "reconstruct_stream")
def base_of_layers() -> Inputs:
    """A decoder that shows the base alone skips the chunks of layers."""
    expected = yield {"stream": with_layers(Draws(19), BASE, LAYERS)}
    assert result(expected, "error") == ""


@on("core", *READ, rules=["R-6.2-5"], flags=["unknown"])
def layers_where_there_are_none() -> Inputs:
    """Chunks of layers, and a layer_count of 1: a decoder that shows the base skips them, as it skips others."""
    expected = yield {"stream": with_layers(Draws(19), BASE, LAYERS, layer_count=1)}
    assert len(result(expected, "counts")) == len(BASE)


@on("core", *QUALITY, rules=["R-15.13-2"], flags=["kept"])
def layer_that_is_repeated() -> Inputs:
    """`R` of a layer is illegal after an I-frame; after P and R it repeats the splats of the layer."""
    layers = (
        LayerPlan(0, 1, Plan("I", 5)),
        LayerPlan(1, 1, Plan("R")),
        LayerPlan(2, 1, Plan("R")),
        LayerPlan(3, 1, Plan("P", 1)),
    )
    stream = with_layers(Draws(37), BASE, layers)
    expected = yield {"stream": stream, "layer": 1}
    check_sound(expected)
    if "counts" in expected:
        extra = result(expected, "counts") - spec.reconstruct_stream(stream)["counts"]
        assert extra[:3].tolist() == [5, 5, 5]


@on("core", *QUALITY, rules=["R-15.13-3"])
def a_layer_is_missing() -> Inputs:
    """Layers 1 and 3 without a layer 2: quality 3 has the splats of both, in this order."""
    layers = LayerPlan(0, 1, Plan("I", 5)), LayerPlan(0, 3, Plan("I", 7)), LayerPlan(1, 3, Plan("P", 2))
    stream = with_layers(Draws(41), BASE, layers)
    expected = yield {"stream": stream, "layer": 3}
    check_sound(expected)
    if "counts" in expected:
        assert result(expected, "counts")[0] == spec.reconstruct_stream(stream)["counts"][0] + 12


@on("core", *QUALITY, flags=["kept"], each={"1": 1, "2": 2})
def an_i_frame_of_a_layer_sets_its_models_back(value: int) -> Inputs:
    """I, P, I and P of a layer, with any symbols, of which the base has I and three P; the quality is {key}."""
    p = Plan("P", 2, 30, 1, 3, kind="any", own=False)
    layers = [
        LayerPlan(n, layer, Plan("I", 20, 16) if n in (0, 2) else replace(p, motion_cell=layer))
        for n in range(4)
        for layer in (1, 2)
    ]
    stream = with_layers(Draws(44), (Plan("I", 20), p, p, p), layers, width=150, height=70)
    expected = yield {"stream": stream, "layer": value}
    check_sound(expected)


@on("core", *QUALITY, flags=["prediction", "kept"])
def layers_have_models_of_their_own() -> Inputs:
    """P-frames of two layers, any symbols: models, densities, fields and lanes of each layer and of the base."""
    p = Plan("P", 2, 30, 1, 3, kind="any", own=False)
    base = Plan("I", 20), p, replace(p, lane_exponent=2, motion_cell=2), p
    layers = [
        LayerPlan(n, layer, Plan("I", 20, 16) if n == 0 else replace(p, lane_exponent=n % 3, motion_cell=layer))
        for n in range(4)
        for layer in (1, 2)
    ]
    expected = yield {"stream": with_layers(Draws(43), base, layers, width=150, height=70), "layer": 2}
    check_sound(expected)


@on("core", *QUALITY, flags=["clamp"])
def layers_without_splats() -> Inputs:
    """A base without splats under a layer that has some, and a layer that has none."""
    base = Plan("I"), Plan("P"), Plan("P", 2)
    layers = (
        LayerPlan(0, 1, Plan("I", 3)),
        LayerPlan(0, 2, Plan("I")),
        LayerPlan(1, 1, Plan("P", 1)),
        LayerPlan(1, 2, Plan("P")),
        LayerPlan(2, 2, Plan("I", 4)),
    )
    expected = yield {"stream": with_layers(Draws(47), base, layers), "layer": 2}
    check_sound(expected)
    if "counts" in expected:
        assert result(expected, "counts")[0] == 3


@case("core", "reconstruct_layers", rules=["R-6.2-5"])
def layers_of_profile_paper() -> Inputs:
    """Profile `paper` has no layers: a chunk `n` is skipped like any other that a decoder does not know."""
    stream = write_stream(OVERVIEW_HEADER, overview_frames())
    expected = yield {"stream": operated(lambda c: [*c[:2], (b"n", b"\x01I"), *c[2:]], stream), "layer": 1}
    assert result(expected, "error") == ""
    assert len(result(expected, "counts")) == 3


@on("core", *QUALITY, rules=["R-15.13-1"], each={"0": 0, "1": 1})
def faults_above_the_quality(value: int) -> Inputs:
    """Layer 2 has a reserved type and no body: who wants quality {key} looks at its number only."""
    layers = LayerPlan(0, 1, Plan("I", 3)), LayerPlan(0, 2, Plan("I", 2), lambda _: b"\xbfZ")
    expected = yield {"stream": with_layers(Draws(53), BASE, layers), "layer": value}
    check_sound(expected)


@on("core", *QUALITY, rules=["R-6.2-6"])
def chunk_before_the_first_frame() -> Inputs:
    """A chunk `n` after the header is of no frame, so it is skipped, although it has the form of an I of layer 1."""
    layers = LayerPlan(-1, 1, Plan("I", 3)), LayerPlan(1, 1, Plan("I", 5))
    stream = with_layers(Draws(61), BASE, layers)
    expected = yield {"stream": stream, "layer": 1}
    check_sound(expected)
    if "counts" in expected:
        extra = result(expected, "counts") - spec.reconstruct_stream(stream)["counts"]
        assert extra.tolist() == [0, 5, 5, 5]


SIZE: Final[dict[str, Any]] = {"width": 256, "height": 256}
"""A frame of which 512 splats that cover it are the rendering work of level 1."""


def covering(count: int) -> MainCodes:
    """An I-frame of splats that cover all of a frame of `SIZE`."""
    return crowd(replace(MAIN_HEADER, **SIZE), (25, 0), count)


@case("uncommon", "reconstruct_layers", rules=["R-15.13-3", "R-5-4"], flags=["limit"])
def layers_of_as_much_work_as_allowed() -> Inputs:
    """300 splats of the base, 112 of layer 1 and 100 of layer 2 cover 256x256 pixels: 2^25 pairs, as level 1 allows."""
    layers = LayerPlan(0, 1, covering(112)), LayerPlan(0, 2, covering(100))
    expected = yield {"stream": with_layers(Draws(0), [covering(300)], layers, **SIZE), "layer": 2}
    assert result(expected, "error") == ""
    work = spec.rendering_work(result(expected, "parameters"), 256, 256)["work"]
    assert int(work) == 2**25


@case("uncommon", "reconstruct_layers", flags=["lanes", "many"])
def layers_of_many_lanes() -> Inputs:
    """Four qualities of 120 splats each, by 64 lanes, in frames of level 2."""
    layers = [
        LayerPlan(n, layer, Plan("P" if n else "I", 5 if n else 60, 32 - 6 * layer, 6))
        for n in range(2)
        for layer in range(1, 4)
    ]
    stream = with_layers(
        Draws(59), [Plan("I", 60, 32, 6), Plan("P", 3, 32, 6, 1)], layers, level=2, max_lane_exponent=6
    )
    expected = yield {"stream": stream, "layer": 3}
    assert result(expected, "counts")[0] == 240


LEVEL_2: Final[dict[str, Any]] = {"level": 2, "layer_count": 2, "qualities": ((1, 0), (2, 0))}
"""A stream whose base asks for level 1, and the two layers together for level 2."""


@case("uncommon", "reconstruct_layers", rules=["R-5-9", "R-5-10"], flags=["limit"], each={"0": 0, "1": 1})
def operating_points(value: int) -> Inputs:
    """512 splats of the base cover 256x256 pixels, as level 1 allows; 100 of a layer need level 2: quality {key}."""
    stream = with_layers(Draws(0), [covering(512)], [LayerPlan(0, 1, covering(100))], **SIZE, **LEVEL_2)
    expected = yield {"stream": stream, "layer": value}
    assert result(expected, "error") == ""


@case("uncommon", "reconstruct_layers", rules=["R-5-9"], flags=["limit"], each={"quarter": 2, "eighth": 3})
def operating_points_of_smaller_sizes(value: int) -> Inputs:
    """The base at {key} of 1024x1000 pixels keeps level 1, which the whole size exceeds."""
    points: dict[str, Any] = {"level": 2, "layer_count": 2, "qualities": ((1, value), (2, 0))}
    large: dict[str, Any] = {"width": 1024, "height": 1000}
    expected = yield {
        "stream": with_layers(Draws(3), [Plan("I", 40)], [LayerPlan(0, 1, Plan("I", 9))], **large, **points),
        "layer": 0,
    }
    assert result(expected, "error") == ""


@case("uncommon", "reconstruct_layers", rules=["R-5-9"], flags=["limit"])
def work_of_an_operating_point_at_half_size() -> Inputs:
    """513 splats of the base cover 256x256 pixels, more than level 1 allows, and at half size a quarter of it."""
    points: dict[str, Any] = {"level": 2, "layer_count": 2, "qualities": ((1, 1), (2, 0))}
    stream = with_layers(Draws(0), [covering(513)], [LayerPlan(0, 1, covering(1))], **SIZE, **points)
    expected = yield {"stream": stream, "layer": 0}
    assert result(expected, "error") == ""


@case("uncommon", "reconstruct_layers", rules=["R-5-9"])
def operating_points_of_many_levels() -> Inputs:
    """Four qualities, from level 1 at full size to level 5 at an eighth of it."""
    points: dict[str, Any] = {"level": 5, "layer_count": 4, "qualities": ((1, 0), (3, 1), (4, 2), (5, 3))}
    layers = [LayerPlan(0, layer, Plan("I", 2)) for layer in (1, 2, 3)]
    expected = yield {"stream": with_layers(Draws(4), [Plan("I", 3)], layers, **points), "layer": 3}
    assert result(expected, "error") == ""
