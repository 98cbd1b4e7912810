"""Frames of profile `main` on the device: the passes of spec.md 15.1, one dispatch or a few each.

The host hands over the elements of a body, the lane states and the words. Everything else stays on the device: states,
models and what the passes decode. All dispatches of a frame are recorded and submitted together, since none needs a
number that only the device knows: where a pass has the items of a list, the list says how many they are, and the host
asks for as many invocations as there can be. After the frame the host reads the final lane states, how many words were
taken, and how many splats stayed.

A pass of the entropy coder is one workgroup of main_passes.wgsl, each lane an invocation. Its items depend on no other
one of the pass, so what is around a pass is done for all items at once:

    choose      (main_lists)        the items of a pass: those that have raw bits, a sign, the bit of a group, ...
    read_...    (main_passes)       the pass: all lanes at once
    the rest    (main_splats, ...)  what the next pass needs: contexts, classes, sizes, densities

    P-frame     model_frequencies of all models
                [field]     x: read_modeled, low bits -> field_contexts -> y: the same -> signs of x, of y
                            -> signed_codes -> field_vectors -> motion_of_splats
                modes       mode_contexts -> read_modeled
                groups      position, shape, color: choose by the bit -> component by component: read_modeled, low bits
                            -> magnitudes (and the contexts of the next one); then the signs of each component
                states      differences -> choose who stays -> stay;  adapt_model of all models
    new splats  plane_densities
                halves      halving by halving: ask -> choose -> read_densities, low bits -> halve -> choose
                            -> starts -> locate
                colours     luma, chroma, chroma: read_densities, low bits (two passes), signs -> signed_codes
                            -> code_classes
                shapes      size, aspect, shear: read_densities, low bits -> window_codes
                places      place_bits -> raw bits of x, then of y;  new_splats
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from gsvc_conformance.adapters.host import MainBody, MainFrame
from gsvc_conformance.adapters.main_operations import SIDES, Array, MainOperations, Recording, groups
from gsvc_conformance.adapters.main_tables import ALPHAS, step_of

MAX_LANES: Final = 64
ROUNDS_AT_ONCE: Final = 1 << 12
"""A dispatch decodes so many symbols of each lane, each with a search of 10 rounds at most: Mesa's software rasteriser
leaves the loops of an invocation after 65,535 rounds of all of them together."""
CELL: Final = 4
"""Side of a cell of an I-frame in pixels."""
PART: Final = 12
"""Bytes of a Part of main_cells.wgsl."""
DENSITY: Final = 36
"""Bytes of a Density of main_densities.wgsl."""
DENSITIES_OF_PLANE: Final = 40
CHROMA: Final = 1
SHAPES: Final = 3
"""The numbers of the first planes of colour and of shape."""
FIRST, BY_CHOICE, BY_ITEM = range(3)
UPPER, LOWER, SIGNS = range(3)
ALL_BITS: Final = 0xFFFFFFFF

_RAMP: Final = (432, 320, 184, 100, 96, 44, 40, 18, 14, 6, 4, 2)
COUNTS: Final[Mapping[str, tuple[tuple[int, ...], ...]]] = {
    "vector": (
        (736, 152, 76, 40, 52, 36, 44, 28, 36, 20, 20, 10, 8, 4, 3, 2, 2),
        (1024, 116, 36, 16, 16, 10, 12, 8, 10, 6, 6, 4, 3, 2),
        (500, 286, 116, 56, 62, 40, 50, 36, 44, 22, 28, 14, 10, 4, 2),
        (320, 148, 80, 56, 82, 68, 108, 74, 112, 68, 72, 36, 32, 10, 6, 2),
        (386, 102, 48, 44, 60, 50, 104, 66, 98, 80, 96, 54, 46, 18, 10, 5, 4),
    ),
    "mode": (
        (1184, 20, 24, 10, 14, 6, 7, 9, 6),
        (1032, 52, 68, 32, 40, 11, 17, 22, 6),
        (752, 92, 116, 66, 96, 26, 52, 74, 6),
        (928, 68, 92, 46, 48, 14, 33, 45, 6),
        (736, 116, 146, 92, 70, 26, 46, 50, 6),
        (336, 97, 193, 176, 92, 48, 122, 216, 6),
        (944, 52, 79, 49, 44, 16, 33, 57, 6),
        (912, 53, 84, 54, 56, 18, 41, 58, 6),
        (784, 53, 87, 70, 66, 22, 54, 138, 6),
        (1056, 27, 62, 32, 24, 11, 20, 26, 22),
    ),
    "position": (_RAMP,) * 4,
    "shape": (*(_RAMP,) * 4, *((576, 320, 156, 72, 70, 28, 24, 10, 8, 3, 2),) * 3),
    "color": (
        (264, 244, 228, 148, 152, 76, 72, 36, 24, 10, 8, 4),
        *((736, 320, 96, 42, 32, 14, 14, 7, 5, 3, 2),) * 3,
        *((944, 224, 44, 18, 14, 6, 6, 3, 2, 2, 2),) * 3,
    ),
}
"""The counts of each model at the start: `MODELS` of section 15.11, without the ones after them."""
GROUPS: Final = (("position", 0, 2), ("shape", 2, 5), ("color", 5, 8))
"""The groups of differences: first component, and the one behind the last; group i has bit i of a mode."""


def symbols_of(model: str) -> int:
    """K of the contexts of a model."""
    return 9 if model == "mode" else 24


def _counts_at_the_start(on: MainOperations) -> dict[str, Any]:
    """The buffers of the counts of all models."""
    return {
        name: on.integers(np.array([[*row, *[1] * (symbols_of(name) - len(row))] for row in rows]))
        for name, rows in COUNTS.items()
    }


@dataclass(frozen=True)
class DeviceState:
    """Splats on the device, and the models behind them.

    Attributes
    ----------
    on
        What the device does.
    count
        The number of splats.
    splats
        The buffer of their states, i4 (count, 8) or more.
    past
        The buffer of what the last frame did with each, p of section 15.11.
    counts
        The counts of each model; a buffer is never changed once a frame is decoded.
    """

    on: MainOperations
    count: int
    splats: Any
    past: Any
    counts: Mapping[str, Any]

    def __len__(self) -> int:
        return self.count

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        """The states, i8 (count, 8)."""
        found = self.on.signed(self.splats, self.count, 8) if self.count else np.zeros((0, 8), np.int64)
        return found if dtype is None else found.astype(dtype)


class MainDecoder(MainOperations):
    """The back end of `gsvc_conformance.adapters.host` for profile `main`."""

    def no_splats(self) -> DeviceState:
        """The state before an I-frame."""
        none = self.accelerator.storage(0)
        return DeviceState(self, 0, none, none, _counts_at_the_start(self))

    def parameters(self, state: DeviceState | Array) -> Array:
        """The parameters f4 (N, 8) of a state."""
        buffer = state.splats if isinstance(state, DeviceState) else self.integers(state)
        return self.parameters_of(buffer, len(state))

    def decode(self, state: DeviceState, body: MainBody) -> MainFrame:
        """A frame, from the state before it."""
        decoding = _Decoding(self, state, body)
        if state.count:
            decoding.predict()
        if body.count:
            decoding.add_splats()
        return decoding.finish()


class _Decoding:
    """The dispatches of a frame."""

    def __init__(self, on: MainOperations, state: DeviceState, body: MainBody) -> None:
        self.on, self.state, self.body = on, state, body
        self.recording = on.accelerator.recording()
        self.lanes = len(body.lane_states)
        self.step = step_of(body.quantizer)
        self.run = self.on.accelerator.upload(
            np.concatenate([body.lane_states, np.zeros(MAX_LANES + 1 - self.lanes, np.uint32)])
        )
        self.words = self.on.accelerator.upload(np.ascontiguousarray(body.words, np.uint16))
        self.splats = self.on.accelerator.storage(32 * (state.count + body.count))
        self.past = self.on.accelerator.storage(4 * (state.count + body.count))
        self.stays = self.on.accelerator.storage(4 * (state.count + 1))
        self.counts: Mapping[str, Any] = state.counts
        self.side = SIDES[body.motion_cell]
        self.columns = -(-body.width // self.side) if self.side else 0
        self.rows = -(-body.height // self.side) if self.side else 0
        self.vectors = self.on.accelerator.storage(8 * self.rows * self.columns)
        self.modes = self.on.accelerator.storage(4 * state.count)
        self.differences = self.on.accelerator.storage(32 * state.count)
        self.unused = self.on.accelerator.storage(4)

    def finish(self) -> MainFrame:
        """Hand the frame to the device, and read what the host has to know."""
        self.recording.submit()
        run = self.on.accelerator.download(self.run, np.uint32, MAX_LANES + 1)
        before = self.state.count
        count = int(self.on.accelerator.download(self.stays, np.uint32, 1)[0]) + self.body.count
        return MainFrame(
            DeviceState(self.on, count, self.splats, self.past, self.counts),
            self.on.signed(self.vectors, self.rows, self.columns, 2),
            self.on.signed(self.modes, before),
            self.on.signed(self.differences, before, 8),
            [int(x) for x in run[: self.lanes]],
            int(run[MAX_LANES]),
        )

    # ---- What is around the passes

    def on_splats(self, entry_point: str, count: int, buffers: dict[int, Any], **numbers: int) -> None:
        """A pass of main_splats.wgsl, one invocation for each of `count` items; `numbers` as its Frame has them."""
        fields = {
            "count": count,
            "step": self.step,
            "width": self.body.width,
            "height": self.body.height,
            "columns": self.columns,
            "rows": self.rows,
            "side": self.side,
            "first": 0,
            "component": 0,
            "components": 1,
            "last": 0,
            "bit": 0,
            "mark": self.body.new_mark,
        }
        values = [*(fields | numbers).values()]
        threads = 8 * count if entry_point == "differences" else count
        self.recording.dispatch("main_splats", entry_point, groups(threads, 256), buffers, values)

    def chosen(
        self,
        numbers: Any,
        count: int,
        *,
        offset: int = 0,
        stride: int = 1,
        flipped: int = 0,
        mask: int = ALL_BITS,
        threshold: int = 0,
        into: Any = None,
    ) -> Any:
        """The list of the items with ((number ^ flipped) & mask) > threshold."""
        items = into or self.on.accelerator.storage(4 * (count + 1))
        condition = [count, offset, stride, flipped, mask, threshold]
        self.recording.dispatch("main_lists", "choose", 1, {1: numbers, 2: items}, condition)
        return items

    # ---- Passes

    def decode_pass(self, entry_point: str, most: int, buffers: dict[int, Any], items: Any, **numbers: int) -> None:
        """A pass of main_passes.wgsl over all items from 0 to most - 1, or over those of a list."""
        fields = {
            "listed": int(items is not None),
            "count": most,
            "chosen_by": FIRST,
            "first_choice": 0,
            "symbols": 0,
            "magnitudes": 0,
            "kind": 0,
            "offset": 0,
            "stride": 1,
        }
        values = [*(fields | numbers).values()]
        bound = {2: self.run, 3: self.words, 4: self.unused if items is None else items, **buffers}
        rounds = -(-most // self.lanes)
        for first in range(0, rounds, ROUNDS_AT_ONCE):
            pieces = [self.lanes, len(self.body.words), first, min(rounds - first, ROUNDS_AT_ONCE), *values]
            self.recording.dispatch("main_passes", entry_point, 1, bound, pieces)

    def read_bits(
        self, bits: Any, count: int, values: Any, kind: int, items: Any, offset: int = 0, stride: int = 1
    ) -> None:
        """Raw bits of the items of a list; of one sign each, `bits` is not looked at."""
        numbers = {"kind": kind, "offset": offset, "stride": stride}
        self.decode_pass("read_bits", count, {6: bits, 7: values}, items, **numbers)

    def low_bits(self, bits: Any, count: int, *, large: bool = False) -> Any:
        """The low bits of items that have so many; `large`: some may have more than 14."""
        low = self.on.accelerator.storage(4 * count)
        if large:
            self.read_bits(bits, count, low, UPPER, self.chosen(bits, count, threshold=14))
        self.read_bits(bits, count, low, LOWER, self.chosen(bits, count))
        return low

    def read_modeled(self, model: "_Model", contexts: Any, count: int, items: Any = None) -> tuple[Any, Any]:
        """The symbols of items by a model, and how many low bits follow each, if they are classes of magnitudes."""
        found, bits = self.on.accelerator.storage(4 * count), self.on.accelerator.storage(4 * count)
        buffers = {5: contexts, 6: model.cumulative, 7: found, 8: model.seen, 9: bits}
        numbers = {"chosen_by": BY_CHOICE, "symbols": model.symbols, "magnitudes": int(model.name != "mode")}
        self.decode_pass("read_modeled", count, buffers, items, **numbers)
        return found, bits

    def read_densities(
        self,
        densities: Any,
        count: int,
        *,
        choices: Any = None,
        chosen_by: int = FIRST,
        plane: int = 0,
        magnitudes: bool = False,
        items: Any = None,
    ) -> tuple[Any, Any]:
        """The bins of items, and how many low bits follow each."""
        found, bits = self.on.accelerator.storage(4 * count), self.on.accelerator.storage(4 * count)
        buffers = {1: self.on.tables, 5: choices or self.unused, 6: densities, 7: found, 9: bits}
        numbers = {"chosen_by": chosen_by, "first_choice": DENSITIES_OF_PLANE * plane, "magnitudes": int(magnitudes)}
        self.decode_pass("read_densities", count, buffers, items, **numbers)
        return found, bits

    def signs(self, numbers: Any, count: int, into: Any = None, offset: int = 0, stride: int = 1) -> Any:
        """The signs of items whose number is not 0."""
        found = into or self.on.accelerator.storage(4 * count)
        items = self.chosen(numbers, count, offset=offset, stride=stride)
        self.read_bits(self.unused, count, found, SIGNS, items, offset, stride)
        return found

    # ---- Splats of the frame before

    def predict(self) -> None:
        """The field, modes and differences, and the splats that stay."""
        count = self.state.count
        models = {name: _Model(self.on, name, counts, self.recording) for name, counts in self.state.counts.items()}
        motion = self.on.accelerator.storage(8 * count)
        if self.side:
            self.read_field(models["vector"])
            self.on_splats("motion_of_splats", count, {2: self.state.splats, 3: self.vectors, 6: motion})
        contexts = self.on.accelerator.storage(4 * count)
        buffers = {2: self.state.splats, 3: self.state.past, 4: motion, 5: self.vectors, 6: contexts}
        self.on_splats("mode_contexts", count, buffers)
        self.modes, _ = self.read_modeled(models["mode"], contexts, count)
        self.read_differences(models)
        self.chosen(self.modes, count, flipped=8, mask=8, into=self.stays)
        buffers = {1: self.on.tables, 2: self.state.splats, 3: motion, 4: self.differences, 5: self.stays}
        buffers |= {6: self.splats, 7: self.modes, 8: self.past}
        self.on_splats("stay", count, buffers)
        self.counts = {name: model.adapted(self.recording) for name, model in models.items()}

    def read_field(self, model: "_Model") -> None:
        """The vectors of the field."""
        cells = self.rows * self.columns
        contexts, codes = self.on.accelerator.storage(4 * cells), self.on.accelerator.storage(8 * cells)
        classes, low = [], []
        for axis in range(2):
            found, bits = self.read_modeled(model, contexts, cells)
            classes.append(found)
            low.append(self.low_bits(bits, cells))
            if axis == 0:
                contexts = self.on.accelerator.storage(4 * cells)
                self.on_splats("field_contexts", cells, {2: found, 6: contexts})
        signs = [self.signs(found, cells) for found in classes]
        for axis in range(2):
            buffers = {2: classes[axis], 3: low[axis], 4: signs[axis], 6: codes}
            self.on_splats("signed_codes", cells, buffers, component=axis, components=2)
        self.on_splats("field_vectors", self.rows, {2: codes, 6: self.vectors})

    def read_differences(self, models: Mapping[str, "_Model"]) -> None:
        """The differences of all groups."""
        count = self.state.count
        magnitudes, signs = self.on.accelerator.storage(32 * count), self.on.accelerator.storage(32 * count)
        for bit, (group, first, end) in enumerate(GROUPS):
            items = self.chosen(self.modes, count, mask=1 << bit)
            before, contexts = self.on.accelerator.storage(4 * count), self.on.accelerator.storage(4 * count)
            for component in range(first, end):
                classes, bits = self.read_modeled(models[group], contexts, count, items)
                low = self.low_bits(bits, count)
                buffers = {2: classes, 3: low, 4: self.modes, 6: magnitudes, 7: before, 8: contexts}
                self.on_splats(
                    "magnitudes",
                    count,
                    buffers,
                    first=3 * (component - first) + 1,
                    component=component,
                    components=8,
                    last=int(component == end - 1),
                    bit=1 << bit,
                )
            for component in range(first, end):
                self.signs(magnitudes, count, signs, component, 8)
        self.on_splats("differences", count, {2: magnitudes, 4: signs, 6: self.differences})

    # ---- New splats

    def add_splats(self) -> None:
        """The splats of an I-frame, or the new ones of a P-frame."""
        count = self.body.count
        densities = self.on.accelerator.storage(DENSITY * DENSITIES_OF_PLANE * 6)
        told = [number for plane in self.body.planes for number in plane]
        buffers = {1: self.on.tables, 4: densities}
        self.recording.dispatch("main_frequencies", "plane_densities", 1, buffers, told)
        cells = self.read_cells()
        colors, shapes, places = (
            self.on.accelerator.storage(12 * count),
            self.on.accelerator.storage(12 * count),
            self.on.accelerator.storage(8 * count),
        )
        luma = None
        for plane in range(SHAPES):
            chosen_by = BY_CHOICE if plane >= CHROMA else FIRST
            classes, bits = self.read_densities(
                densities, count, choices=luma, chosen_by=chosen_by, plane=plane, magnitudes=True
            )
            luma = luma or classes
            low = self.low_bits(bits, count, large=True)
            signs = self.signs(classes, count)
            buffers = {2: classes, 3: low, 4: signs, 6: colors}
            self.on_splats("signed_codes", count, buffers, component=plane, components=3)
        j = self.on.accelerator.storage(4 * count)
        self.on_splats("code_classes", count, {3: colors, 6: j})
        for component in range(3):
            plane = SHAPES + component
            bins, bits = self.read_densities(densities, count, choices=j, chosen_by=BY_CHOICE, plane=plane)
            buffers = {2: bins, 3: self.low_bits(bits, count), 4: j, 5: densities, 6: shapes}
            first = DENSITIES_OF_PLANE * plane
            self.on_splats("window_codes", count, buffers, first=first, component=component, components=3)
        for axis in range(2):
            bits = self.on.accelerator.storage(4 * count)
            self.on_splats("place_bits", count, {2: j, 4: shapes, 6: bits}, component=axis)
            self.read_bits(bits, count, places, LOWER, self.chosen(bits, count), axis, 2)
        buffers = {2: cells, 3: colors, 4: shapes, 5: places, 6: self.splats, 7: self.stays, 8: self.past}
        self.on_splats("new_splats", count, buffers)

    def read_cells(self) -> Any:
        """The cell of each new splat, i4 (count, 2)."""
        count = self.body.count
        inside = -(-self.body.width // CELL), -(-self.body.height // CELL)
        size = 2 ** (len(self.body.alphas) // 2)
        parts, items = self.on.integers(np.array([0, 0, count])), self.on.integers(np.array([1, 0]))
        for halving, alpha in enumerate(self.body.alphas):
            axis = halving % 2
            size = size // 2 if axis == 0 else size
            most = min(2**halving, count)
            numbers = [most, axis, size, inside[axis], ALPHAS.index(alpha)]
            densities, asked, halves = (
                self.on.accelerator.storage(DENSITY * most),
                self.on.accelerator.storage(4 * most),
                self.on.accelerator.storage(2 * PART * most),
            )
            buffers = {2: parts, 3: items, 4: densities, 5: asked}
            self.recording.dispatch("main_cells", "ask", groups(most, 256), buffers, numbers)
            which = self.chosen(asked, most)
            bins, bits = self.read_densities(densities, most, chosen_by=BY_ITEM, items=which)
            low = self.low_bits(bits, most)
            buffers = {2: parts, 3: items, 4: densities, 6: bins, 7: low, 8: halves}
            self.recording.dispatch("main_cells", "halve", groups(most, 256), buffers, numbers)
            parts, items = halves, self.chosen(halves, 2 * most, offset=2, stride=3)
        firsts, cells = self.on.accelerator.storage(4 * count), self.on.accelerator.storage(8 * count)
        self.recording.dispatch("main_lists", "starts", 1, {1: parts, 2: items, 3: firsts}, [0, 2, 3])
        buffers = {2: parts, 3: items, 5: firsts, 6: cells}
        self.recording.dispatch("main_cells", "locate", groups(count, 256), buffers, [count])
        return cells


class _Model:
    """A model while a P-frame is decoded: its frequencies, and how often each symbol was seen."""

    def __init__(self, on: MainOperations, name: str, counts: Any, recording: Recording) -> None:
        self.on, self.name, self.counts = on, name, counts
        self.contexts, self.symbols = len(COUNTS[name]), symbols_of(name)
        self.cumulative = self.on.accelerator.storage(4 * self.contexts * (self.symbols + 1))
        self.seen = self.on.accelerator.storage(4 * self.contexts * self.symbols)
        numbers = [self.contexts, self.symbols]
        buffers = {2: counts, 3: self.cumulative}
        recording.dispatch("main_frequencies", "model_frequencies", 1, buffers, numbers)

    def adapted(self, recording: Recording) -> Any:
        """The buffer of the counts behind the frame."""
        counts = self.on.accelerator.storage(4 * self.contexts * self.symbols)
        buffers = {2: self.counts, 3: counts, 5: self.seen}
        recording.dispatch("main_frequencies", "adapt_model", 1, buffers, [self.contexts, self.symbols])
        return counts
