"""Streams of profile `main` with layers, legal ones and faulty ones (spec.md section 15.13)."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from gsvc_base import spec
from gsvc_base.draws import Draws
from gsvc_conformance.case import Fault, Inputs, add, case
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.cases.building import operated, result
from gsvc_conformance.cases.main_streams import MAIN_HEADER, Plan, codes_of, crowd, frame_of
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.bitstream.crc import parameter_checksum
from gsvc_ref.bitstream.header import MAX_LAYERS
from gsvc_ref.main.cells import halving_count
from gsvc_ref.main.codes import NO_FIELD, MainCodes
from gsvc_ref.main.densities import PLANES, SLOPED
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
    at = 1 + 4 * made.parameter_checksum_flag
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
                    mask = masks.get(number, sum({1 << layer for layer in now[number][1]} - {1}))
                    payload = payload[:at] + bytes([mask]) + payload[at + 1 :]
                found += [(kind, payload), *behind.get(number, [])]
            else:
                found.append((kind, payload))
        return found

    return operated(edit, write_stream(replace(made, qualities=()), base, index=False))


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


@case("core", "reconstruct_layers", each={str(layer): layer for layer in range(4)})
def quality(value: int) -> Inputs:
    """A stream of a base and three layers, in quality {key}: the splats of layers follow those of the base."""
    stream = with_layers(Draws(19), BASE, LAYERS)
    expected = yield {"stream": stream, "layer": value}
    assert result(expected, "error") == ""
    counts = result(expected, "counts")
    base = spec.reconstruct_stream(stream)["counts"]
    assert (counts >= base).all()
    assert bool((counts > base).any()) == (value > 0)


@case("core", "reconstruct_layers", rules=["R-15.13-2"], flags=["kept"])
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
    assert result(expected, "error") == ""
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


@case("core", "reconstruct_layers", rules=["R-15.13-2"], each={"64_pixels": 1, "32_pixels": 2, "16_pixels": 3})
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
    assert result(expected, "error") == ""


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


@case("core", "reconstruct_layers", rules=["R-15.13-2"], flags=["kept"])
def past_of_a_carried_layer() -> Inputs:
    """A P-frame changes splats of a layer and adds some, the next one carries all of them, and then nothing is past."""
    plans = Plan("I", 2), *[Plan("P", 1)] * 3
    p = Plan("P", 6, kind="any", own=False)
    layers = LayerPlan(0, 1, Plan("I", 12)), LayerPlan(1, 1, p), LayerPlan(3, 1, p)
    expected = yield {"stream": with_layers(Draws(28), plans, layers), "layer": 1}
    assert result(expected, "error") == ""


@case("core", "reconstruct_layers", rules=["R-15.13-1"])
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
    assert result(expected, "error") == ""


@case("core", "reconstruct_layers", rules=["R-13-9", "R-15.13-5", "R-15.13-6"])
def dropped_above_the_quality() -> Inputs:
    """A server has dropped layers 2 and 3 and left the masks: a decoder of quality 1 misses nothing."""
    lost = [(entry.frame, entry.layer) for entry in LAYERS if entry.layer > 1]
    expected = yield {"stream": with_layers(Draws(19), BASE, LAYERS, lost=lost), "layer": 1}
    assert result(expected, "error") == ""
    whole = spec.reconstruct_layers(with_layers(Draws(19), BASE, LAYERS), 1)
    assert np.array_equal(result(expected, "parameters"), whole["parameters"])


@case("core", "reconstruct_layers", rules=["R-6.4-3"])
def layers_with_checksums() -> Inputs:
    """Each layer has the checksum of its own splats."""
    stream = with_layers(Draws(29), BASE, LAYERS, parameter_checksum_flag=True)
    expected = yield {"stream": stream, "layer": 3}
    assert result(expected, "error") == ""


@case("core", "reconstruct_stream")
def base_of_layers() -> Inputs:
    """A decoder that shows the base alone skips the chunks of layers."""
    expected = yield {"stream": with_layers(Draws(19), BASE, LAYERS)}
    assert result(expected, "error") == ""


@case("core", "reconstruct_layers", rules=["R-15.13-2"], flags=["kept"])
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
    assert result(expected, "error") == ""
    extra = result(expected, "counts") - spec.reconstruct_stream(stream)["counts"]
    assert extra[:3].tolist() == [5, 5, 5]


@case("core", "reconstruct_layers", rules=["R-15.13-3"])
def a_layer_is_missing() -> Inputs:
    """Layers 1 and 3 without a layer 2: quality 3 has the splats of both, in this order."""
    layers = LayerPlan(0, 1, Plan("I", 5)), LayerPlan(0, 3, Plan("I", 7)), LayerPlan(1, 3, Plan("P", 2))
    stream = with_layers(Draws(41), BASE, layers)
    expected = yield {"stream": stream, "layer": 3}
    assert result(expected, "counts")[0] == spec.reconstruct_stream(stream)["counts"][0] + 12


@case("core", "reconstruct_layers", flags=["prediction", "kept"])
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
    assert result(expected, "error") == ""


@case("core", "reconstruct_layers", flags=["clamp"])
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
    assert result(expected, "error") == ""
    assert result(expected, "counts")[0] == 3


@case("core", "reconstruct_layers", rules=["R-6.2-5"])
def layers_of_profile_paper() -> Inputs:
    """Profile `paper` has no layers: a chunk `n` is skipped like any other that a decoder does not know."""
    stream = write_stream(OVERVIEW_HEADER, overview_frames())
    expected = yield {"stream": operated(lambda c: [*c[:2], (b"n", b"\x01I"), *c[2:]], stream), "layer": 1}
    assert result(expected, "error") == ""
    assert len(result(expected, "counts")) == 3


@case("core", "reconstruct_layers", rules=["R-15.13-1"], each={"0": 0, "1": 1})
def faults_above_the_quality(value: int) -> Inputs:
    """Layer 2 has a reserved type and no body: who wants quality {key} looks at its number only."""
    layers = LayerPlan(0, 1, Plan("I", 3)), LayerPlan(0, 2, Plan("I", 2), lambda _: b"\xbfZ")
    expected = yield {"stream": with_layers(Draws(53), BASE, layers), "layer": value}
    assert result(expected, "error") == ""


@case("core", "reconstruct_layers", rules=["R-6.2-6"])
def chunk_before_the_first_frame() -> Inputs:
    """A chunk `n` after the header is of no frame, so it is skipped, although it has the form of an I of layer 1."""
    layers = LayerPlan(-1, 1, Plan("I", 3)), LayerPlan(1, 1, Plan("I", 5))
    stream = with_layers(Draws(61), BASE, layers)
    expected = yield {"stream": stream, "layer": 1}
    assert result(expected, "error") == ""
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


LAYER_I: Final = Plan("I", 2)
MISSING: Final = "layer_mask names a layer without a chunk after "
STANDS: Final = "it must stand there"
FAULTY_LAYERS: Final = {
    "layer_0": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I, lambda p: bytes([p[0] & 63]) + p[1:]),),
        "R-3.2-1",
        "a chunk is of layer 0",
        "the base has no chunk",
    ),
    "not_named": FaultyLayer(
        (LayerPlan(0, 2, LAYER_I),),
        "R-15.13-1",
        "a chunk is of layer 2, and the mask names layer 3",
        "it must be named",
        masks=((0, 8),),
    ),
    "beyond_layer_count": FaultyLayer(
        (LayerPlan(0, 3, LAYER_I),),
        "R-15.13-1",
        "a chunk is of layer 3",
        "layer_count is 3",
        header=(("layer_count", 3),),
    ),
    "no_layers": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I),),
        "R-15.13-1",
        "a chunk is of layer 1",
        "layer_count is 1",
        header=(("layer_count", 1),),
    ),
    "not_in_order": FaultyLayer(
        (LayerPlan(0, 3, LAYER_I), LayerPlan(0, 2, LAYER_I)),
        "R-15.13-1",
        "a chunk of layer 2 stands after one of layer 3",
        "layers stand in their order",
        quality=1,
    ),
    "twice": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I), LayerPlan(0, 1, Plan("P"))),
        "R-15.13-1",
        "a frame has two chunks of layer 1",
        "one at most",
    ),
    "reserved_type": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I, lambda p: bytes([p[0] | 48]) + p[1:]),), "R-3.2-1", "layer_type is 3", "I, P or R"
    ),
    "mask_bit_0": FaultyLayer(
        (), "R-3.2-1", "bit 0 of layer_mask is 1", "it is reserved", masks=((1, 1),), in_base=True
    ),
    "mask_bit_4": FaultyLayer(
        (),
        "R-3.2-1",
        "bit 4 of layer_mask of an R-frame is 1",
        "it is reserved",
        complete=2,
        masks=((2, 16),),
        in_base=True,
    ),
    "mask_bit_7": FaultyLayer(
        (), "R-3.2-1", "bit 7 of layer_mask is 1", "it is reserved", complete=0, masks=((0, 128),), in_base=True
    ),
    "frame_low": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I), LayerPlan(1, 1, Plan("R"), lambda p: bytes([p[0] & ~15]))),
        "R-15.13-4",
        "frame_low after frame 1 is 0",
        "1",
        complete=2,
    ),
    "frame_low_of_16": FaultyLayer(
        (LayerPlan(16, 1, LAYER_I, lambda p: bytes([p[0] | 15]) + p[1:]),),
        "R-15.13-4",
        "frame_low after frame 16 is 15",
        "0",
        (Plan("I", 2), *[Plan("R")] * 17),
        complete=17,
    ),
    "missing_behind_i": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I),), "R-15.13-6", MISSING + "an I-frame", STANDS, lost=((0, 1),)
    ),
    "missing_behind_p": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I), LayerPlan(1, 1, Plan("P"))),
        "R-15.13-6",
        MISSING + "a P-frame",
        STANDS,
        complete=2,
        lost=((1, 1),),
    ),
    "missing_behind_r": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I), LayerPlan(2, 1, Plan("P"))),
        "R-15.13-6",
        MISSING + "an R-frame",
        STANDS,
        complete=3,
        lost=((2, 1),),
    ),
    "missing_at_the_end": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I), LayerPlan(3, 1, Plan("P"))),
        "R-15.13-6",
        MISSING + "the last frame",
        STANDS,
        complete=4,
        lost=((3, 1),),
    ),
    "missing_below": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I), LayerPlan(0, 2, LAYER_I), LayerPlan(1, 1, Plan("R")), LayerPlan(1, 2, Plan("P"))),
        "R-15.13-6",
        "a chunk of layer 2 stands where one of layer 1 is named",
        STANDS,
        complete=2,
        lost=((1, 1),),
    ),
    "missing_below_one_that_is_not_wanted": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I), LayerPlan(0, 2, LAYER_I)),
        "R-15.13-6",
        "a chunk of layer 2 stands where one of layer 1 is named, and the decoder wants that alone",
        STANDS,
        quality=1,
        lost=((0, 1),),
    ),
    "p_without_i": FaultyLayer((LayerPlan(0, 1, Plan("P", 2)),), "R-15.13-2", "a layer begins with P", "with I"),
    "r_without_i": FaultyLayer(
        (LayerPlan(1, 1, Plan("R")),), "R-15.13-2", "a layer begins with R", "with I", complete=2
    ),
    "p_behind_an_i_frame": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I), LayerPlan(1, 1, Plan("P"))),
        "R-15.13-2",
        "a layer goes on with P after an I-frame of the base",
        "it is gone",
        (Plan("I", 2), Plan("I", 2)),
        complete=2,
    ),
    "checksum": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I, lambda p: p[:1] + bytes([p[1] ^ 1]) + p[2:]),),
        "R-6.4-3",
        "the checksum of a layer has another bit",
        "it is that of the layer's splats",
        header=(("parameter_checksum_flag", True),),
    ),
    "quantizer_80": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I, _body(quantizer=80)),), "R-3.2-1", "quantizer of a layer is 80", "79 is the highest"
    ),
    "field_of_i": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I, _body(head=7)),),
        "R-15.5-2",
        "I of a layer has a motion field",
        "there is nothing that moves",
    ),
    "no_densities": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I, _body(number=2)),),
        "R-15.5-3",
        "I of a layer has no densities",
        "it must have its own",
    ),
    "densities_of_the_base": FaultyLayer(
        (LayerPlan(0, 1, Plan("I")), LayerPlan(1, 1, Plan("P", 2), without_densities)),
        "R-15.5-4",
        "new splats of a layer without densities, which the base has",
        "a layer needs its own",
        complete=2,
    ),
    "splats": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I, _body(number=2 * 16378 + 1)),),
        "R-5-2",
        "6 splats of the base and 16379 of a layer",
        "level 1 allows 16384 together",
    ),
    "splats_of_two_layers": FaultyLayer(
        (LayerPlan(0, 1, Plan("I", 3)), LayerPlan(0, 2, LAYER_I, _body(number=2 * 16375 + 1))),
        "R-5-2",
        "6 splats of the base, 3 of layer 1 and 16376 of layer 2",
        "level 1 allows 16384 together",
    ),
    "splats_that_are_carried": FaultyLayer(
        (LayerPlan(0, 1, crowd(MAIN_HEADER, (25, 0), 16380)),),
        "R-5-2",
        "a base of 2 splats grows by 3 below a layer of 16380, which is carried",
        "level 1 allows 16384 together",
        (Plan("I", 2), Plan("P", 3, kind="likely")),
        complete=1,
    ),
    "work": FaultyLayer(
        (LayerPlan(0, 1, covering(113)), LayerPlan(0, 2, covering(100))),
        "R-5-4",
        "513 splats of the base and two layers cover 256x256 pixels: 2^25 + 2^16 pairs",
        "level 1 allows 2^25",
        (covering(300),),
        tuple(SIZE.items()),
    ),
    "work_that_is_carried": FaultyLayer(
        (LayerPlan(0, 1, covering(300)),),
        "R-5-4",
        "a base of 212 splats grows by 1 below a layer of 300, all of which cover 256x256 pixels",
        "level 1 allows 2^25 pairs",
        (covering(212), grown(212, 1, covering(1))),
        tuple(SIZE.items()),
    ),
    "second_of_a_layer": FaultyLayer(
        (LayerPlan(0, 1, covering(100)), LayerPlan(4, 2, covering(112)), LayerPlan(8, 2, Plan("R"))),
        "R-5-7",
        "with layer 2 the ninth frame of a second has 9 times the work of a frame",
        "level 1 allows 8 times that of a frame",
        (covering(300), *[Plan("R")] * 8),
        (*SIZE.items(), ("paced_flag", True)),
        complete=9,
    ),
    "point_of_too_many_splats": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I),),
        "R-5-9",
        "the base has 16385 splats, and quality 0 asks for level 1",
        "level 1 allows 16384",
        (crowd(MAIN_HEADER, (25, 0), 16385),),
        tuple(LEVEL_2.items()),
        complete=0,
        quality=0,
        in_base=True,
    ),
    "point_of_too_much_work": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I),),
        "R-5-9",
        "513 splats of the base cover 256x256 pixels, and quality 0 asks for level 1",
        "level 1 allows 2^25 pairs",
        (covering(513),),
        (*SIZE.items(), *LEVEL_2.items()),
        complete=0,
        quality=0,
        in_base=True,
    ),
    "point_of_a_layer": FaultyLayer(
        (LayerPlan(0, 1, covering(213)), LayerPlan(0, 2, LAYER_I)),
        "R-5-9",
        "513 splats of the base and layer 1 cover 256x256 pixels, and quality 1 asks for level 1",
        "level 1 allows 2^25 pairs",
        (covering(300),),
        (*SIZE.items(), ("level", 2), ("layer_count", 3), ("qualities", ((1, 0), (1, 0), (2, 0)))),
        quality=1,
    ),
    "lane_state": FaultyLayer(
        (LayerPlan(0, 1, Plan("I", 1, kind="likely"), _low_state),),
        "R-6.6-5",
        "a lane state of a layer is too low",
        "2^16 is the lowest",
    ),
    "word_too_few": FaultyLayer(
        (LayerPlan(0, 1, Plan("I", 9), lambda p: p[:-2]),),
        "R-7-1",
        "the last word of a layer is missing",
        "its symbols need it",
    ),
    "word_too_many": FaultyLayer(
        (LayerPlan(0, 1, Plan("I", 9), lambda p: p + bytes(2)),),
        "R-7-1",
        "a word of a layer is left over",
        "all words are taken",
    ),
    "r_with_a_body": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I), LayerPlan(1, 1, Plan("R"), lambda p: p + b"\x18")),
        "R-6.2-3",
        "R of a layer has a quantizer",
        "it has nothing",
        complete=2,
    ),
    "empty": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I, lambda _: b""),), "R-6.2-3", "a chunk of a layer is empty", "it has a layer"
    ),
    "cut": FaultyLayer(
        (LayerPlan(0, 1, LAYER_I, lambda p: p[:3]),),
        "R-6.2-3",
        "a chunk of a layer ends before its count",
        "it has a body",
    ),
}
"""Faulty streams with layers, by the ends of their slugs."""


def faulty_layer(value: FaultyLayer) -> Inputs:
    """A decoder of layers reports the kind of the fault, and yields the frames before it."""
    stream = with_layers(
        Draws(31), value.plans, value.layers, masks=dict(value.masks), lost=value.lost, **dict(value.header)
    )
    expected = yield {"stream": stream, "layer": value.quality}
    assert result(expected, "error").split()[1] == value.rule
    assert len(result(expected, "counts")) == value.complete
    assert (spec.reconstruct_stream(stream)["error"] == "") != value.in_base


for key, entry in FAULTY_LAYERS.items():
    add(
        "faulty",
        "reconstruct_layers",
        f"layer_{key}",
        title=f"{entry.rule} is broken: {entry.lie}.",
        reason="" if entry.in_base else "A decoder that shows the base alone finds no fault.",
        rules=[entry.rule],
        fault=Fault(entry.lie, entry.truth),
        function=faulty_layer,
        arguments={"value": entry},
    )


POINTS: Final[dict[str, tuple[str, Lie, str, str]]] = {
    "level_0": ("R-3.2-1", Lie("quality_level", 0), "quality_level is 0", "it is reserved"),
    "level_6": ("R-3.2-1", Lie("quality_level", 6, 1), "the second quality_level is 6", "5 is the highest"),
    "reserved": ("R-3.2-1", Lie("quality_reserved", 4), "quality_reserved is 4", "0"),
    "below_the_level": (
        "R-5-9",
        Lie("quality_level", 1, 1),
        "level is 2, and no quality_level is",
        "level is the greatest",
    ),
    "above_the_level": ("R-5-9", Lie("quality_level", 3), "quality_level is 3, and level 2", "level is the greatest"),
    "too_many_pixels": (
        "R-5-9",
        Lie("quality_halvings", 0),
        "a frame has 600x300 pixels, and quality 0 asks for level 1",
        "level 1 allows 2^17",
    ),
}
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
