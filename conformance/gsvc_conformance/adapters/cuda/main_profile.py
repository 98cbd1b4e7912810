"""Profile `main` (spec.md 15): a frame_body() is read by one kernel, `read_body`; states stay on the device.

The host tells the kernel what it knows of the frame, and how much room it has to have: the splats of the frame before
and the new ones, of which the head of a body says how many they are. A `Status` has the fault, if there is one, and the
number of splats; who does not ask for it does not wait.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from gsvc_conformance.adapters.cuda import device
from gsvc_conformance.adapters.cuda.device import Array, Buffer, Values, download, launch, storage, upload
from gsvc_conformance.adapters.host import Field
from gsvc_conformance.adapters.main_frames import COUNTS, symbols_of
from gsvc_conformance.adapters.main_operations import CELL, SIDES, MainOperations

RULES: Final = (
    "", "R-6.2-2", "R-6.2-3", "R-3.2-1", "R-15.5-1", "R-15.5-2", "R-15.5-5", "R-3.1-1", "R-5-2", "R-5-9", "R-15.5-3",
    "R-15.5-4", "R-3.1-4", "R-6.6-5", "R-15.6-5", "R-7-1", "R-5-4",
)  # fmt: skip
"""`Rule` of main_run.cuh, by number."""
THREADS: Final = 256
"""Threads of a block where each item has its own."""

TOLD: Final = np.dtype(
    [
        *((name, "u4") for name in ("body_at", "end", "checked", "intra", "width", "height", "max_lane_exponent")),
        ("splat_limits", "i4", 2),
        ("halvings", "u4"),
        ("work_limits", "u8", 2),
    ],
    align=True,
)
"""`Told` of main_body.cu."""
STATUS: Final = np.dtype(
    [
        *((name, "u4") for name in ("rule", "bit", "count", "before", "new_count", "quantizer", "lane_exponent")),
        *((name, "u4") for name in ("motion_cell", "densities_present", "symbols")),
        ("works", "u8", 2),
    ],
    align=True,
)
"""`Status` of main_body.cu."""
LAYER: Final = np.dtype(
    [("count", "u4"), ("quantizer", "u4"), ("has_densities", "u4"), ("densities", "u4", 56), ("counts", "u4", (33, 24))]
)
"""`Layer` of main_body.cu."""
FIELD_HEAD: Final = np.dtype([("side", "i4"), ("columns", "i4"), ("rows", "i4"), ("unused", "i4")])
NUMBERS: Final = np.dtype([("n", "i4", 24)])
"""`Numbers` of main_operations.cu."""


def reading_threads() -> int:
    """Threads of the block that reads a body: a fiber more costs time, a thread more saves some."""
    return 1024 if device.machine().__name__.endswith("gpu") else 32


class Recording:
    """Kernels in the order of a stream, which starts them as they come."""

    def dispatch(
        self, module: str, kernel: str, workgroups: int, buffers: Mapping[int, Any], numbers: Sequence[int]
    ) -> None:
        """Start a kernel of main_operations.cu; its module is a shader of another adapter."""
        told = np.zeros((), NUMBERS)
        told["n"][: len(numbers)] = np.array([number & 0xFFFFFFFF for number in numbers], np.uint32).view(np.int32)
        arguments = [buffers[number] for number in sorted(buffers)]
        launch(kernel, workgroups, 64 if kernel == "encode" else THREADS, *arguments, told[()])

    def submit(self) -> None:
        """Nothing waits to be handed over."""


class Cuda:
    """The device, as `gsvc_conformance.adapters.main_operations` asks for it."""

    def storage(self, size: int) -> Buffer:
        """A buffer of so many bytes, all 0."""
        return storage(size)

    def upload(self, data: Array) -> Buffer:
        """A buffer that holds an array."""
        return upload(data, data.dtype)

    def download(self, buffer: Buffer, dtype: npt.DTypeLike, count: int) -> Array:
        """The first `count` numbers of a buffer."""
        return download(buffer, (count,), dtype)

    def recording(self) -> Recording:
        """An empty recording."""
        return Recording()


class CudaOperations(MainOperations):
    """The operations of profile `main`, one by one."""

    def cells_of_halves(self, width: int, height: int, count: int, first_halves: Array) -> Values:
        """The cells i8 (count, 2) of splats by the numbers in first halves: section 15.8."""
        parts, other, packed, cells = storage(8 * count), storage(8 * count), storage(4 * count), storage(8 * count)
        first = self.integers(first_halves)
        launch(
            "cells_of_halves", 1, THREADS, first, width, height, np.uint32(count), parts, other, packed, cells,
        )  # fmt: skip
        return {"cells": self.signed(cells, count, 2)}


MAIN: Final = CudaOperations(Cuda())


@dataclass(frozen=True)
class Layer:
    """A layer after a frame, on the device. Frames make new ones and leave the old ones alone.

    Attributes
    ----------
    most
        The splats that it has at most, for which `states` and `past` have room; where the host has asked, it has them.
    head
        `Layer` of main_body.cu: models, densities and the number of splats.
    states, past
        i4 (most, 8), and what the frame did with each splat, u1 (most,).
    """

    most: int
    head: Buffer
    states: Buffer
    past: Buffer

    def __len__(self) -> int:
        return self.most

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        """The states, i8 (most, 8)."""
        found = MAIN.signed(self.states, self.most, 8)
        return found if dtype is None else found.astype(dtype)


@cache
def no_splats() -> Layer:
    """The layer before an I-frame (R-15.11-1)."""
    head = np.zeros((), LAYER)
    rows = [(name, row) for name, rows in COUNTS.items() for row in rows]
    for counts, (name, row) in zip(head["counts"], rows, strict=True):
        counts[: symbols_of(name)] = [*row, *[1] * (symbols_of(name) - len(row))]
    return Layer(0, upload(head, LAYER), storage(32), storage(1))


@dataclass(frozen=True)
class Reading:
    """What a launch of `read_body` leaves on the device."""

    layer: Layer
    field: Buffer
    modes: Buffer
    differences: Buffer
    symbols: Buffer | None
    status: Buffer


def new_splats(body: bytes, most: int) -> int:
    """How many new splats a frame_body() has, by its first bytes; 0 if more than are allowed, for then none is made."""
    if len(body) < 2 or not body[0] & 1:
        return 0
    splat_number = 0
    for place, byte in enumerate(body[1 + (body[0] >> 1 & 1) :][:5]):
        splat_number |= (byte & 0x7F) << 7 * place
        if byte < 0x80:
            break
    count = splat_number // 2 + 1
    return count if count <= most else 0


def field_cells(width: int, height: int) -> int:
    """The cells of a motion field at most."""
    return -(-width // SIDES[-1]) * -(-height // SIDES[-1])


def workspace_size(before: int, count: int, cells: int) -> int:
    """Bytes of the arrays of a frame: see `begin_frame` of main_body.cu."""
    return 29 * before + 64 * count + cells + 2**16


def most_symbols(before: int, count: int, width: int, height: int) -> int:
    """The symbols of a frame, at most."""
    halvings = 2 * (max(-(-width // CELL), -(-height // CELL)) - 1).bit_length()
    halves = sum(min(1 << halving, count) for halving in range(halvings))
    return 2 * field_cells(width, height) + 9 * before + halves + 6 * count


def uploaded_field(field: Field) -> Buffer:
    """A motion field with the side of its cells, as the kernels have it."""
    vectors, side = field
    head = np.zeros((), FIELD_HEAD)
    head["rows"], head["columns"], _ = vectors.shape
    head["side"] = side
    return upload(np.frombuffer(head.tobytes() + vectors.astype(np.int32).tobytes(), np.uint8), np.uint8)


def read_body(text: Buffer, told: Any, before: Layer, count: int, inherited: Buffer | None, traced: bool) -> Reading:
    """Start the kernel that reads a body.

    Parameters
    ----------
    text
        The bytes, of which `told` says where the body begins.
    told
        A number of `TOLD`.
    before
        The layer before the frame.
    count
        The new splats: see `new_splats`.
    inherited
        The field that `motion_cell` 0 stands for, if there can be one.
    traced
        Whether `symbols` are written down.
    """
    width, height = int(told["width"]), int(told["height"])
    cells, most = field_cells(width, height), before.most + count
    after = Layer(most, storage(LAYER.itemsize), storage(32 * most), storage(most))
    symbols = storage(8 * most_symbols(before.most, count, width, height)) if traced else None
    reading = Reading(
        after, storage(FIELD_HEAD.itemsize + 8 * cells), storage(before.most), storage(32 * before.most), symbols,
        storage(STATUS.itemsize),
    )  # fmt: skip
    launch(
        "read_body", 1, reading_threads(), text, told, MAIN.tables, before.head, before.states, before.past, inherited,
        after.head, after.states, after.past, reading.field, reading.modes, reading.differences,
        storage(workspace_size(before.most, count, cells)), symbols, reading.status,
    )  # fmt: skip
    return reading


def body_functions(names: dict[str, Any]) -> dict[str, Any]:
    """The functions of spec.md 15.12 and 15.13 whose work the device does; the kernels find the faults of a body.

    Parameters
    ----------
    names
        The names of the code that the functions are put into; it may be filled afterwards.
    """

    class MainState:
        """What the code of section 15.12 carries from frame to frame."""

        def __init__(self) -> None:
            self.forget()

        def forget(self) -> None:
            self.splats = no_splats()
            self.inherited: Field = np.zeros((0, 0, 2), np.int64), 0

    def copied(main: MainState) -> MainState:
        other = MainState()
        other.splats = main.splats
        return other

    def carried(main: MainState, moves: Field) -> MainState:
        other, layer = MainState(), main.splats
        vectors, side = moves
        states = storage(32 * layer.most)
        numbers = [layer.most, 0, 0, 0, vectors.shape[1], vectors.shape[0], side]
        MAIN.dispatch("", "carry", layer.most, {2: layer.states, 3: MAIN.integers(vectors), 6: states}, numbers)
        other.splats = Layer(layer.most, layer.head, states, storage(layer.most))
        return other

    def read_main_body(p: Any, frame_type: str, main: MainState, header: Any, limits: Any) -> dict[str, Any]:
        data, base = p.data[p.at // 8 :], p.position()
        told = np.zeros((), TOLD)
        told["end"], told["intra"], told["work_limits"] = len(data), frame_type == "I", 2**64 - 1
        told["splat_limits"] = limits["splats"], limits["own_splats"]
        for name in ("width", "height", "max_lane_exponent"):
            told[name] = header[name]
        before, count = main.splats, new_splats(data[:8], limits["splats"])
        text = upload(np.frombuffer(data, np.uint8), np.uint8)
        reading = read_body(text, told[()], before, count, uploaded_field(main.inherited), traced=True)
        status = download(reading.status, (), STATUS)
        if status["rule"] > 0:
            raise names["Fault"](RULES[status["rule"]], base + int(status["bit"]))
        p.at = 8 * len(p.data)
        main.splats = Layer(int(status["count"]), reading.layer.head, reading.layer.states, reading.layer.past)
        return _body(reading, status)

    def state_parameters(state: Any) -> Values:
        states = state.states if isinstance(state, Layer) else MAIN.integers(state)
        return {"parameters": MAIN.parameters_of(states, len(state))}

    def main_work(state: Any, width: int, height: int, halvings: int) -> Values:
        states = state.states if isinstance(state, Layer) else MAIN.integers(state)
        return {"work": np.array(MAIN.work_of(states, len(state), width, height, halvings), np.int64)}

    own = (MainState, copied, carried, read_main_body, state_parameters, main_work)
    return {function.__name__: function for function in own}


def _body(reading: Reading, status: Any) -> dict[str, Any]:
    """What section 15.12 says of a body."""
    named = ("quantizer", "lane_exponent", "motion_cell", "densities_present")
    body: dict[str, Any] = {name: int(status[name]) for name in named}
    head = download(reading.field, (), FIELD_HEAD)
    rows, columns = int(head["rows"]), int(head["columns"])
    vectors = download(reading.field[FIELD_HEAD.itemsize :], (rows, columns, 2), np.int32)
    before = int(status["before"])
    body["count"] = int(status["new_count"])
    body["field"] = vectors.astype(np.int64)
    body["modes"] = download(reading.modes, (before,), np.uint8).astype(np.int64)
    body["q"] = download(reading.differences, (8, before), np.int32).T.astype(np.int64)
    body["symbols"] = download(reading.symbols, (int(status["symbols"]), 4), np.uint16)
    return body
