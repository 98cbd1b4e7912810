"""Frames of profile `main` on the device: the passes of spec.md 15.1, one dispatch or a few each.

The host hands over the elements of a body and the run. Everything else stays on the device: states, models and what the
passes decode. All dispatches of a frame are recorded and submitted together, since none needs a number that only the
device knows: where a pass has the items of a list, the list says how many they are, and the host asks for as many
invocations as there can be. After the frame the host reads the final lane states, how many words and raw bits were
taken, and how many splats stayed.

A pass has symbols of several kinds, each a dispatch of main_passes.wgsl: a group of 32 lanes is a workgroup. Its items
depend on no other one of the pass, so what is around it is done for all items at once, as are raw values: `offsets` of
main_raw.wgsl finds where they begin, and `take` reads them.

    choose      (main_lists)        the items of a list: those with the bit of a group, the parts that have splats, ...
    read_...    (main_passes)       symbols of a pass: all lanes at once
    offsets, take (main_raw)        raw values
    the rest    (main_splats, ...)  what the next pass needs: contexts, classes, densities

    P-frame     model_frequencies of all models
      pass 1, 2   field, x, y: read_modeled, low bits, signs; field_contexts -> signed_codes -> field_vectors
                  -> motion_of_splats
      3           mode_contexts -> read_modeled; choose by the bits
      4, 5, 6     first, second, third components: read_modeled -> difference_contexts
      late        low bits, signs -> differences -> choose who stays -> stay;  adapt_model of all models
    new splats  plane_densities
      each halving  ask -> choose -> read_densities, low bits -> halve -> choose (-> starts -> locate)
      then        luma; both chroma: read_densities, low bits -> signed_codes without signs -> code_classes
                  size, aspect, shear: read_densities, low bits -> window_codes -> place_bits
      late        signs, low bits of shear, places -> new_splats

Both columns are generators, and each yield ends a pass of theirs, as in the code of section 15.
"""

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from gsvc_conformance.adapters.host import Field, MainBody, MainFrame
from gsvc_conformance.adapters.main_operations import (
    ALL_BITS,
    CELL,
    DENSITY,
    PART,
    SIDES,
    Array,
    MainOperations,
    Recording,
    groups,
)
from gsvc_conformance.adapters.main_tables import ALPHAS, step_of

MAX_LANES: Final = 4096
GROUP: Final = 32
"""Lanes that share one list of words."""
TAKEN: Final = MAX_LANES
ENDS: Final = TAKEN + MAX_LANES // GROUP
SLOTS: Final = ENDS + MAX_LANES // GROUP
SYMBOLS: Final = SLOTS + 256
"""Where a run has what, in words of 32 bits: see main_passes.wgsl. A frame has some 70 slots at most."""
ROUNDS_AT_ONCE: Final = 1 << 12
"""A dispatch decodes so many symbols of each lane, each with a search of 10 rounds at most: Mesa's software rasteriser
leaves the loops of an invocation after 65,535 rounds of all of them together."""
DENSITIES_OF_PLANE: Final = 40
CHROMA: Final = 1
SHAPES: Final = 3
"""The numbers of the first planes of colour and of shape."""
FIRST, BY_CHOICE, BY_ITEM = range(3)
NO_VECTORS: Final = np.zeros((0, 0, 2), np.int64)

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
"""The groups of differences: first component, and the one after the last; group i has bit i of a mode."""


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
    """Splats on the device, and the models after them.

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

    def carried(self, state: DeviceState, field: Field) -> DeviceState:
        """A layer without a chunk: motion without differences."""
        if state.count == 0:
            return state
        vectors, side = field
        motion, unchanged = self.accelerator.storage(8 * state.count), self.accelerator.storage(32 * state.count)
        splats, past = self.accelerator.storage(32 * state.count), self.accelerator.storage(4 * state.count)
        recording = self.accelerator.recording()
        if side:
            rows, columns, _ = vectors.shape
            buffers = {2: state.splats, 3: self.integers(vectors), 6: motion}
            numbers = [state.count, 0, 0, 0, columns, rows, side]
            recording.dispatch("main_splats", "motion_of_splats", groups(state.count), buffers, numbers)
        buffers = {1: self.tables, 2: state.splats, 3: motion, 4: unchanged, 6: splats}
        recording.dispatch("main_splats", "main_inter", groups(state.count), buffers, [state.count, step_of(0)])
        recording.submit()
        return DeviceState(self, state.count, splats, past, state.counts)

    def parameters(self, state: DeviceState | Array) -> Array:
        """The parameters f4 (N, 8) of a state."""
        buffer = state.splats if isinstance(state, DeviceState) else self.integers(state)
        return self.parameters_of(buffer, len(state))

    def work(self, state: DeviceState | Array, width: int, height: int, halvings: int) -> int:
        """The rendering work of states: (5-2)."""
        buffer = state.splats if isinstance(state, DeviceState) else self.integers(state)
        return self.work_of(buffer, len(state), width, height, halvings)

    def decode(self, state: DeviceState, body: MainBody) -> MainFrame:
        """A frame, from the state before it."""
        decoding = _Decoding(self, state, body)
        parts = []
        if state.count:
            parts.append(decoding.predict())
        if body.count:
            parts.append(decoding.add_splats())
        decoding.passes(parts)
        return decoding.finish()


@dataclass(frozen=True)
class _Raw:
    """Raw values of items: buffers of sizes, or of numbers that have a sign unless they are 0; and of the values."""

    numbers: Any
    count: int
    signs: bool
    values: Any
    offset: int = 0
    stride: int = 1


class _Decoding:
    """The dispatches of a frame."""

    def __init__(self, on: MainOperations, state: DeviceState, body: MainBody) -> None:
        self.on, self.state, self.body = on, state, body
        self.recording = on.accelerator.recording()
        self.lanes = len(body.lane_states)
        self.step = step_of(body.quantizer)
        inherited, side = body.inherited
        self.side = SIDES[body.motion_cell] or side
        self.columns = -(-body.width // self.side) if self.side else 0
        self.rows = -(-body.height // self.side) if self.side else 0
        self.run, self.words, self.text = self.on.accelerator.upload(self.run_at_the_start()), *self.payload()
        self.lengths = self.on.accelerator.storage(8)
        self.pass_number = self.slot = self.first_slot = 0
        self.splats = self.on.accelerator.storage(32 * (state.count + body.count))
        self.past = self.on.accelerator.storage(4 * (state.count + body.count))
        self.stays = self.on.accelerator.storage(4 * (state.count + 1))
        self.counts: Mapping[str, Any] = state.counts
        self.vectors = (
            self.on.accelerator.storage(8 * self.rows * self.columns)
            if body.motion_cell
            else self.on.integers(inherited)
        )
        self.modes = self.on.accelerator.storage(4 * state.count)
        self.differences = self.on.accelerator.storage(32 * state.count)
        self.unused = self.on.accelerator.storage(4)

    def run_at_the_start(self) -> Array:
        """The lane states, the words of each group, and room for as many symbols as there can be."""
        halves = sum(min(2**halving, self.body.count) for halving in range(len(self.body.alphas)))
        most = 2 * self.rows * self.columns + 9 * self.state.count + halves + 6 * self.body.count
        run = np.zeros(SYMBOLS + 2 * most, np.uint32)
        run[: self.lanes] = self.body.lane_states
        groups_there = len(self.body.words_of_groups) - 1
        run[TAKEN : TAKEN + groups_there] = self.body.words_of_groups[:-1]
        run[ENDS : ENDS + groups_there] = self.body.words_of_groups[1:]
        return run

    def payload(self) -> tuple[Any, Any]:
        """The buffers of the words, and of the raw bits with the length of their text in 32 bits."""
        data = self.body.data
        text = np.frombuffer(data[::-1] + bytes(-len(data) % 4), "<u4")
        words = np.frombuffer(data[: len(data) // 2 * 2] + bytes(2), "<u2")  # a buffer has at least 32 bits
        return self.on.accelerator.upload(words), self.on.accelerator.upload(np.array([len(text), *text], np.uint32))

    def passes(self, parts: Sequence[Generator[list[_Raw] | None, None, None]]) -> None:
        """Record the passes of both parts side by side, then their late values, and what follows from these."""
        left, late = list(parts), []
        while left:
            self.pass_number += 1
            self.first_slot = self.slot
            told = [next(part) for part in left]
            late += [(part, values) for part, values in zip(left, told, strict=True) if values is not None]
            left = [part for part, values in zip(left, told, strict=True) if values is None]
        late.sort(key=lambda found: parts.index(found[0]))
        everything = [(values, self.offsets(values, late=True)) for _, part in late for values in part]
        for values, places in everything:
            self.take(values, places, late=True)
        for part, _ in late:
            next(part, None)

    def finish(self) -> MainFrame:
        """Hand the frame to the device, and read what the host has to know."""
        self.recording.submit()
        download = self.on.accelerator.download
        run = download(self.run, np.uint32, SYMBOLS)
        before = self.state.count
        count = int(download(self.stays, np.uint32, 1)[0]) + self.body.count
        symbols = int(run[SLOTS + self.slot])
        early, late = download(self.lengths, np.uint32, 2)
        noted = download(self.run, np.uint32, SYMBOLS + 2 * symbols)[SYMBOLS:]
        return MainFrame(
            DeviceState(self.on, count, self.splats, self.past, self.counts),
            self.on.signed(self.vectors, self.rows, self.columns, 2) if self.body.motion_cell else NO_VECTORS,
            self.on.signed(self.modes, before),
            self.on.signed(self.differences, before, 8),
            [int(x) for x in run[: self.lanes]],
            [int(k) for k in run[TAKEN : TAKEN + len(self.body.words_of_groups) - 1]],
            int(early),
            int(late),
            np.stack([noted & 0xFFFF, noted >> 16], axis=1).reshape(-1, 4),
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
        self.recording.dispatch("main_splats", entry_point, groups(count, 256), buffers, values)

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

    def decode_symbols(self, entry_point: str, most: int, buffers: dict[int, Any], items: Any, **numbers: int) -> None:
        """Symbols of a pass: of all items from 0 to most - 1, or of those of a list."""
        fields = {
            "listed": int(items is not None),
            "count": most,
            "chosen_by": FIRST,
            "first_choice": 0,
            "symbols": 0,
            "magnitudes": 0,
        }
        values = [self.slot, self.first_slot, self.pass_number, *(fields | numbers).values()]
        bound = {2: self.run, 3: self.words, 4: self.unused if items is None else items, **buffers}
        rounds = -(-most // self.lanes) + 1  # the first one may be begun
        for first in range(0, rounds, ROUNDS_AT_ONCE):
            pieces = [self.lanes, first, min(rounds - first, ROUNDS_AT_ONCE), *values]
            self.recording.dispatch("main_passes", entry_point, -(-self.lanes // GROUP), bound, pieces)
        self.slot += 1

    def offsets(self, values: _Raw, *, late: bool) -> Any:
        """Where raw values begin in the early string or the late one, which they lengthen."""
        places = self.on.accelerator.storage(4 * values.count)
        numbers = [values.count, int(values.signs), int(late)]
        buffers = {1: values.numbers, 2: places, 3: self.lengths}
        self.recording.dispatch("main_raw", "offsets", int(values.count > 0), buffers, numbers)
        return places

    def take(self, values: _Raw, places: Any, *, late: bool) -> None:
        """The raw values at their places."""
        numbers = [values.count, int(values.signs), int(late), self.lanes, values.offset, values.stride]
        buffers = {1: values.numbers, 2: places, 3: self.lengths, 4: self.text, 5: self.run, 6: values.values}
        self.recording.dispatch("main_raw", "take", groups(values.count, 256), buffers, numbers)

    def early(self, numbers: Any, count: int, *, signs: bool = False) -> Any:
        """Raw values of items that are taken after their pass."""
        values = self.later(numbers, count, signs=signs)
        self.take(values, self.offsets(values, late=False), late=False)
        return values.values

    def later(self, numbers: Any, count: int, *, signs: bool = False) -> _Raw:
        """Raw values of items that are taken after the last pass."""
        return _Raw(numbers, count, signs, self.on.accelerator.storage(4 * count))

    def read_modeled(self, model: "_Model", contexts: Any, count: int, items: Any = None) -> tuple[Any, Any]:
        """The symbols of items by a model, and how many low bits follow each, if they are classes of magnitudes."""
        found, bits = self.on.accelerator.storage(4 * count), self.on.accelerator.storage(4 * count)
        buffers = {5: contexts, 6: model.cumulative, 7: found, 8: model.seen, 9: bits}
        numbers = {"chosen_by": BY_CHOICE, "symbols": model.symbols, "magnitudes": int(model.name != "mode")}
        self.decode_symbols("read_modeled", count, buffers, items, **numbers)
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
        self.decode_symbols("read_densities", count, buffers, items, **numbers)
        return found, bits

    # ---- Splats of the frame before

    def predict(self) -> Generator[list[_Raw] | None, None, None]:
        """The field, modes and differences, and the splats that stay."""
        count = self.state.count
        models = {name: _Model(self.on, name, counts, self.recording) for name, counts in self.state.counts.items()}
        motion = self.on.accelerator.storage(8 * count)
        if self.body.motion_cell:
            yield from self.read_field(models["vector"])
        else:
            yield None
            yield None
        if self.side:
            self.on_splats("motion_of_splats", count, {2: self.state.splats, 3: self.vectors, 6: motion})
        contexts = self.on.accelerator.storage(4 * count)
        buffers = {2: self.state.splats, 3: self.state.past, 4: motion, 5: self.vectors, 6: contexts}
        self.on_splats("mode_contexts", count, buffers)
        self.modes, _ = self.read_modeled(models["mode"], contexts, count)
        yield None
        yield from self.read_differences(models)
        self.chosen(self.modes, count, flipped=8, mask=8, into=self.stays)
        buffers = {1: self.on.tables, 2: self.state.splats, 3: motion, 4: self.differences, 5: self.stays}
        buffers |= {6: self.splats, 7: self.modes, 8: self.past}
        self.on_splats("stay", count, buffers)
        self.counts = {name: model.adapted(self.recording) for name, model in models.items()}

    def read_field(self, model: "_Model") -> Generator[None, None, None]:
        """The vectors of the field."""
        cells = self.rows * self.columns
        contexts, codes = self.on.accelerator.storage(4 * cells), self.on.accelerator.storage(8 * cells)
        for axis in range(2):
            found, bits = self.read_modeled(model, contexts, cells)
            low, signs = self.early(bits, cells), self.early(found, cells, signs=True)
            buffers = {2: found, 3: low, 4: signs, 6: codes}
            self.on_splats("signed_codes", cells, buffers, component=axis, components=2)
            contexts = self.on.accelerator.storage(4 * cells)
            self.on_splats("field_contexts", cells, {2: found, 6: contexts})
            yield
        self.on_splats("field_vectors", self.rows, {2: codes, 6: self.vectors})

    def read_differences(self, models: Mapping[str, "_Model"]) -> Generator[list[_Raw] | None, None, None]:
        """The differences of all groups: three passes, and late values."""
        count = self.state.count
        items = [self.chosen(self.modes, count, mask=1 << bit) for bit in range(len(GROUPS))]
        before, contexts = (
            [self.on.accelerator.storage(4 * count) for _ in GROUPS],
            [self.on.accelerator.storage(4 * count) for _ in GROUPS],
        )
        found: dict[int, tuple[Any, _Raw, _Raw]] = {}  # by component: classes, low bits and signs
        for i in range(3):
            for bit, (group, first, end) in enumerate(GROUPS):
                if first + i >= end:
                    continue
                classes, bits = self.read_modeled(models[group], contexts[bit], count, items[bit])
                present = self.on.accelerator.storage(4 * count)
                buffers = {2: classes, 4: self.modes, 6: present, 7: before[bit], 8: contexts[bit]}
                last = int(first + i == end - 1)
                self.on_splats("difference_contexts", count, buffers, first=3 * i + 1, last=last, bit=1 << bit)
                found[first + i] = classes, self.later(bits, count), self.later(present, count, signs=True)
            yield None
        yield [values for component in sorted(found) for values in found[component][1:]]
        for component, (classes, low, signs) in found.items():
            buffers = {2: classes, 3: low.values, 4: signs.values, 5: signs.numbers, 6: self.differences}
            self.on_splats("differences", count, buffers, component=component)

    # ---- New splats

    def add_splats(self) -> Generator[list[_Raw] | None, None, None]:
        """The splats of an I-frame, or the new ones of a P-frame."""
        count = self.body.count
        densities = self.on.accelerator.storage(DENSITY * DENSITIES_OF_PLANE * 6)
        told = [number for plane in self.body.planes for number in plane]
        buffers = {1: self.on.tables, 4: densities}
        self.recording.dispatch("main_frequencies", "plane_densities", 1, buffers, told)
        cells = yield from self.read_cells()
        magnitudes, colors, shapes, places = (
            self.on.accelerator.storage(12 * count),
            self.on.accelerator.storage(12 * count),
            self.on.accelerator.storage(12 * count),
            self.on.accelerator.storage(8 * count),
        )
        luma, bits = self.read_densities(densities, count, magnitudes=True)
        classes, low = [luma], [self.early(bits, count)]
        yield None
        chroma = [
            self.read_densities(densities, count, choices=luma, chosen_by=BY_CHOICE, plane=plane, magnitudes=True)
            for plane in range(CHROMA, SHAPES)
        ]
        classes += [found for found, _ in chroma]
        low += [self.early(bits, count) for _, bits in chroma]
        no_signs = self.on.accelerator.storage(4 * count)
        for plane in range(SHAPES):
            buffers = {2: classes[plane], 3: low[plane], 4: no_signs, 6: magnitudes}
            self.on_splats("signed_codes", count, buffers, component=plane, components=3)
        yield None
        j = self.on.accelerator.storage(4 * count)
        self.on_splats("code_classes", count, {3: magnitudes, 6: j})
        windows = [
            self.read_densities(densities, count, choices=j, chosen_by=BY_CHOICE, plane=SHAPES + component)
            for component in range(3)
        ]
        for component in range(2):
            bins, bits = windows[component]
            self.window_codes(component, bins, self.early(bits, count), j, densities, shapes)
        yield None
        of_places = []
        for axis in range(2):
            bits = self.on.accelerator.storage(4 * count)
            self.on_splats("place_bits", count, {2: j, 4: shapes, 6: bits}, component=axis)
            of_places.append(_Raw(bits, count, False, places, axis, 2))
        signs, shear = [self.later(found, count, signs=True) for found in classes], self.later(windows[2][1], count)
        yield [*signs, shear, *of_places]
        for plane in range(SHAPES):
            buffers = {2: classes[plane], 3: low[plane], 4: signs[plane].values, 6: colors}
            self.on_splats("signed_codes", count, buffers, component=plane, components=3)
        self.window_codes(2, windows[2][0], shear.values, j, densities, shapes)
        buffers = {2: cells, 3: colors, 4: shapes, 5: places, 6: self.splats, 7: self.stays, 8: self.past}
        self.on_splats("new_splats", count, buffers)

    def window_codes(self, component: int, bins: Any, low: Any, j: Any, densities: Any, shapes: Any) -> None:
        """The codes of size, aspect or shear."""
        buffers = {2: bins, 3: low, 4: j, 5: densities, 6: shapes}
        first = DENSITIES_OF_PLANE * (SHAPES + component)
        self.on_splats("window_codes", self.body.count, buffers, first=first, component=component, components=3)

    def read_cells(self) -> Generator[None, None, Any]:
        """The cell of each new splat, i4 (count, 2); each halving is a pass."""
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
            low = self.early(bits, most)
            buffers = {2: parts, 3: items, 4: densities, 6: bins, 7: low, 8: halves}
            self.recording.dispatch("main_cells", "halve", groups(most, 256), buffers, numbers)
            parts, items = halves, self.chosen(halves, 2 * most, offset=2, stride=3)
            yield
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
        """The buffer of the counts after the frame."""
        counts = self.on.accelerator.storage(4 * self.contexts * self.symbols)
        buffers = {2: self.counts, 3: counts, 5: self.seen}
        recording.dispatch("main_frequencies", "adapt_model", 1, buffers, [self.contexts, self.symbols])
        return counts
