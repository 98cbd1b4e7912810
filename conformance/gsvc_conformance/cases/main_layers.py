"""Streams of profile `main` with layers, legal ones and faulty ones (spec.md section 15.13)."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, Final

from gsvc_base import spec
from gsvc_base.draws import Draws
from gsvc_conformance.case import Fault, Inputs, add, case
from gsvc_conformance.cases.building import operated, result
from gsvc_conformance.cases.main_streams import MAIN_HEADER, Plan, crowd, frame_of
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.bit_writer import Writer
from gsvc_ref.bitstream.coder import encode_uv
from gsvc_ref.bitstream.crc import parameter_checksum
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.main.frames import MainState, frame_body
from gsvc_ref.testing import OVERVIEW_HEADER, overview_frames, write_stream

Edit = Callable[[bytes], bytes]
"""What makes the payload of a chunk from the one that is right."""


@dataclass(frozen=True)
class LayerPlan:
    """A chunk of a layer.

    Attributes
    ----------
    frame
        The number of the frame behind which it stands; -1: behind the header.
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


def with_layers(rng: Draws, plans: Iterable[Plan | MainCodes], layers: Iterable[LayerPlan], **header: Any) -> bytes:
    """A stream of frames with chunks `n` behind them; `layers` by frame and layer."""
    made = replace(MAIN_HEADER, **{"layer_count": 4, **header})
    state, base = _initial(made), []
    for plan in plans:
        codes, _, state = _frame(made, plan, state, rng)
        base.append(codes)
    behind: dict[int, list[tuple[bytes, bytes]]] = {}
    states: dict[int, MainState] = {}
    for entry in layers:
        codes, body, after = _frame(made, entry.plan, states.get(entry.layer, _initial(made)), rng)
        states[entry.layer] = after
        checksum = int(parameter_checksum(after.splats)).to_bytes(4, "little") if made.parameter_checksum_flag else b""
        payload = bytes([entry.layer, ord(codes.type)]) + checksum + body
        behind.setdefault(entry.frame, []).append((b"n", entry.edit(payload) if entry.edit else payload))
    places = iter(range(-1, len(base)))
    return operated(
        lambda chunks: [
            new for chunk in chunks for new in [chunk, *(behind.get(next(places), []) if chunk[0] in b"HIPR" else [])]
        ],
        write_stream(made, base, index=False),
    )


def _initial(header: SequenceHeader) -> MainState:
    return MainState.initial(header.width, header.height)


def _frame(
    header: SequenceHeader, plan: Plan | MainCodes, state: MainState, rng: Draws
) -> tuple[MainCodes, bytes, MainState]:
    """The codes of a frame behind a state, its body, and the state behind it."""
    codes = frame_of(header, plan, state, rng)[0] if isinstance(plan, Plan) else plan
    if codes.type == "R":
        return codes, b"", state
    s = Writer()
    after = frame_body(s, codes.type, state, header.max_lane_exponent, header.limits.splats, codes).after
    return codes, s.getvalue(), after


BASE: Final = Plan("I", 6), Plan("P", 1), Plan("R"), Plan("P", 2)
LAYERS: Final = (
    LayerPlan(0, 1, Plan("I", 8, 16)), LayerPlan(0, 2, Plan("I", 4, 12)), LayerPlan(1, 1, Plan("P", 2, 16)),
    LayerPlan(1, 2, Plan("R")), LayerPlan(2, 2, Plan("P", 1, 12)), LayerPlan(3, 1, Plan("P", 0, 20, motion_cell=3)),
    LayerPlan(3, 2, Plan("I", 3, 8)), LayerPlan(3, 3, Plan("I", 2, 8)),
)  # fmt: skip


@case("core", "reconstruct_layers", each={str(layer): layer for layer in range(4)})
def quality(value: int) -> Inputs:
    """A stream of a base and three layers, in quality {key}: splats of layers stand behind those of the base."""
    stream = with_layers(Draws(19), BASE, LAYERS)
    expected = yield {"stream": stream, "layer": value}
    assert result(expected, "error") == ""
    counts = result(expected, "counts")
    base = spec.reconstruct_stream(stream)["counts"]
    assert (counts >= base).all()
    assert bool((counts > base).any()) == (value > 0)


@case("core", "reconstruct_layers", rules=["R-15.13-2"], flags=["kept"])
def layer_behind_an_r_frame() -> Inputs:
    """Behind an R-frame without its chunk a layer is there as before; behind a P-frame without it, it is gone."""
    plans = Plan("I", 4), Plan("R"), Plan("P", 1), Plan("P"), Plan("I", 2)
    layers = LayerPlan(0, 1, Plan("I", 5)), LayerPlan(3, 1, Plan("I", 3))
    expected = yield {"stream": with_layers(Draws(23), plans, layers), "layer": 1}
    base = spec.reconstruct_stream(with_layers(Draws(23), plans, layers))["counts"]
    assert (result(expected, "counts") - base).tolist() == [5, 5, 0, 3, 0]


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
    """`R` of a layer behind an I-frame is no reference, but behind P and R it repeats the splats of the layer."""
    layers = (LayerPlan(0, 1, Plan("I", 5)), LayerPlan(1, 1, Plan("R")), LayerPlan(2, 1, Plan("R")),
              LayerPlan(3, 1, Plan("P", 1)))  # fmt: skip
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
    layers = [LayerPlan(n, layer, Plan("I", 20, 16) if n == 0 else replace(p, lane_exponent=n % 3, motion_cell=layer))
              for n in range(4) for layer in (1, 2)]  # fmt: skip
    expected = yield {"stream": with_layers(Draws(43), base, layers, width=150, height=70), "layer": 2}
    assert result(expected, "error") == ""


@case("core", "reconstruct_layers", flags=["clamp"])
def layers_without_splats() -> Inputs:
    """A base without splats under a layer that has some, and a layer that has none."""
    base = Plan("I"), Plan("P"), Plan("P", 2)
    layers = (LayerPlan(0, 1, Plan("I", 3)), LayerPlan(0, 2, Plan("I")), LayerPlan(1, 1, Plan("P", 1)),
              LayerPlan(1, 2, Plan("P")), LayerPlan(2, 2, Plan("I", 4)))  # fmt: skip
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
    layers = LayerPlan(0, 1, Plan("I", 3)), LayerPlan(0, 2, Plan("I", 2), lambda _: b"\x02Z")
    expected = yield {"stream": with_layers(Draws(53), BASE, layers), "layer": value}
    assert result(expected, "error") == ""


@case("core", "reconstruct_layers", rules=["R-6.2-6"])
def chunk_before_the_first_frame() -> Inputs:
    """A chunk `n` behind the header is of no frame, so it is skipped, although it has the form of an I of layer 1."""
    layers = LayerPlan(-1, 1, Plan("I", 3)), LayerPlan(1, 1, Plan("I", 5))
    stream = with_layers(Draws(61), BASE, layers)
    expected = yield {"stream": stream, "layer": 1}
    assert result(expected, "error") == ""
    extra = result(expected, "counts") - spec.reconstruct_stream(stream)["counts"]
    assert extra.tolist() == [0, 5, 5, 0]


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
    layers = [LayerPlan(n, layer, Plan("P" if n else "I", 5 if n else 60, 32 - 6 * layer, 6)) for n in range(2)
              for layer in range(1, 4)]  # fmt: skip
    base = Plan("I", 60, 32, 6), Plan("P", 3, 32, 6, 1)
    stream = with_layers(Draws(59), base, layers, level=2, max_lane_exponent=6)
    expected = yield {"stream": stream, "layer": 3}
    assert result(expected, "counts")[0] == 240


def _body(*, tools: int = 4, quantizer: int = 24, count: int = 2) -> Edit:
    """A payload whose body says this much, of what is an I of layer 1."""
    return lambda payload: payload[:2] + bytes([quantizer, tools]) + encode_uv(count) + payload[5:]


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


LAYER_I: Final = Plan("I", 2)
FAULTY_LAYERS: Final = {
    "layer_0": FaultyLayer((LayerPlan(0, 0, LAYER_I),), "R-15.13-1", "a chunk is of layer 0", "the base has no chunk"),
    "layer_4": FaultyLayer((LayerPlan(0, 4, LAYER_I),), "R-15.13-1", "a chunk is of layer 4", "layer_count is 4"),
    "no_layers": FaultyLayer((LayerPlan(0, 1, LAYER_I),), "R-15.13-1", "a chunk is of layer 1", "layer_count is 1",
                             header=(("layer_count", 1),)),
    "not_in_order": FaultyLayer((LayerPlan(0, 2, LAYER_I), LayerPlan(0, 1, LAYER_I)), "R-15.13-1",
                                "a chunk of layer 1 stands behind one of layer 2", "layers stand in their order"),
    "twice": FaultyLayer((LayerPlan(0, 1, LAYER_I), LayerPlan(0, 1, Plan("P"))), "R-15.13-1",
                         "a frame has two chunks of layer 1", "one at most"),
    "reserved_type": FaultyLayer((LayerPlan(0, 1, LAYER_I, lambda p: p[:1] + b"B" + p[2:]),), "R-3.2-1",
                                 "layer_type is B", "I, P or R"),
    "p_without_i": FaultyLayer((LayerPlan(0, 1, Plan("P", 2)),), "R-15.13-2", "a layer begins with P", "with I"),
    "r_without_i": FaultyLayer((LayerPlan(1, 1, Plan("R")),), "R-15.13-2", "a layer begins with R", "with I",
                               complete=2),
    "p_behind_a_gap": FaultyLayer((LayerPlan(0, 1, LAYER_I), LayerPlan(3, 1, Plan("P"))), "R-15.13-2",
                                  "a layer goes on with P, and the P-frame of the base before has no chunk of it",
                                  "it is gone", complete=4),
    "p_behind_an_i_frame": FaultyLayer((LayerPlan(0, 1, LAYER_I), LayerPlan(1, 1, Plan("P"))), "R-15.13-2",
                                       "a layer goes on with P behind an I-frame of the base", "it is gone",
                                       (Plan("I", 2), Plan("I", 2)), complete=2),
    "checksum": FaultyLayer((LayerPlan(0, 1, LAYER_I, lambda p: p[:2] + bytes([p[2] ^ 1]) + p[3:]),), "R-6.4-3",
                            "the checksum of a layer has another bit", "it is that of the layer's splats",
                            header=(("parameter_checksum_flag", True),)),
    "quantizer_80": FaultyLayer((LayerPlan(0, 1, LAYER_I, _body(quantizer=80)),), "R-3.2-1",
                                "quantizer of a layer is 80", "79 is the highest"),
    "frame_reserved": FaultyLayer((LayerPlan(0, 1, LAYER_I, _body(tools=5)),), "R-3.2-1",
                                  "frame_reserved of a layer is 1", "0"),
    "eight_lanes": FaultyLayer((LayerPlan(0, 1, LAYER_I, _body(tools=0x64)),), "R-15.5-1",
                               "a layer has 8 lanes", "max_lane_exponent is 2"),
    "field_of_i": FaultyLayer((LayerPlan(0, 1, LAYER_I, _body(tools=0x0C)),), "R-15.5-2",
                              "I of a layer has a motion field", "there is nothing that moves"),
    "no_densities": FaultyLayer((LayerPlan(0, 1, LAYER_I, _body(tools=0)),), "R-15.5-3",
                                "I of a layer has no densities", "it must have its own"),
    "densities_of_the_base": FaultyLayer(
        (LayerPlan(0, 1, Plan("I")), LayerPlan(1, 1, Plan("P", 2), lambda p: p[:3] + bytes([p[3] & ~4]) + p[4:])),
        "R-15.5-4", "new splats of a layer without densities, which the base has", "a layer needs its own", complete=2),
    "splats": FaultyLayer((LayerPlan(0, 1, LAYER_I, _body(count=16379)),), "R-5-2",
                          "6 splats of the base and 16379 of a layer", "level 1 allows 16384 together"),
    "splats_of_two_layers": FaultyLayer(
        (LayerPlan(0, 1, Plan("I", 3)), LayerPlan(0, 2, LAYER_I, _body(count=16376))),
        "R-5-2", "6 splats of the base, 3 of layer 1 and 16376 of layer 2", "level 1 allows 16384 together"),
    "work": FaultyLayer((LayerPlan(0, 1, covering(113)), LayerPlan(0, 2, covering(100))), "R-5-4",
                        "513 splats of the base and two layers cover 256x256 pixels: 2^25 + 2^16 pairs",
                        "level 1 allows 2^25", (covering(300),), tuple(SIZE.items())),
    "lane_state": FaultyLayer((LayerPlan(0, 1, Plan("I", 1, kind="likely"), lambda p: p[:-4] + bytes(4)),), "R-6.6-5",
                              "a lane state of a layer is too low", "2^16 is the lowest"),
    "word_too_few": FaultyLayer((LayerPlan(0, 1, Plan("I", 9), lambda p: p[:-2]),), "R-7-1",
                                "the last word of a layer is missing", "its symbols need it"),
    "word_too_many": FaultyLayer((LayerPlan(0, 1, Plan("I", 9), lambda p: p + bytes(2)),), "R-7-1",
                                 "a word of a layer is left over", "all words are taken"),
    "odd_byte": FaultyLayer((LayerPlan(0, 1, Plan("I", 9), lambda p: p + b"\0"),), "R-6.2-3",
                            "a byte stands behind the last word of a layer", "words fill the payload"),
    "r_with_a_body": FaultyLayer((LayerPlan(0, 1, LAYER_I), LayerPlan(1, 1, Plan("R"), lambda p: p + b"\x18")),
                                 "R-6.2-3", "R of a layer has a quantizer", "it has nothing", complete=2),
    "empty": FaultyLayer((LayerPlan(0, 1, LAYER_I, lambda _: b""),), "R-6.2-3", "a chunk of a layer is empty",
                         "it has a layer"),
    "cut": FaultyLayer((LayerPlan(0, 1, LAYER_I, lambda p: p[:4]),), "R-6.2-3",
                       "a chunk of a layer ends before its count", "it has a body"),
}  # fmt: skip
"""Faulty streams with layers, by the ends of their slugs."""


def faulty_layer(value: FaultyLayer) -> Inputs:
    """A decoder of layers reports the kind of the fault, and yields the frames before it."""
    stream = with_layers(Draws(31), value.plans, value.layers, **dict(value.header))
    expected = yield {"stream": stream, "layer": 3}
    assert result(expected, "error").split()[1] == value.rule
    assert len(result(expected, "counts")) == value.complete
    assert spec.reconstruct_stream(stream)["error"] == ""


for key, entry in FAULTY_LAYERS.items():
    add("faulty", "reconstruct_layers", f"layer_{key}", title=f"{entry.rule} is broken: {entry.lie}.",
        reason="A decoder that shows the base alone finds no fault.", rules=[entry.rule],
        fault=Fault(entry.lie, entry.truth), function=faulty_layer, arguments={"value": entry})  # fmt: skip
