"""The operations of profile `main` that are a dispatch or two each (spec.md 15): the host's half of their kernels.

Kernels are known by a module, a name and numbered buffers, as the shaders of `webgpu` have them. Those of `opencl` have
the same names, and the buffers as arguments in the order of their numbers.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, Final, Protocol

import numpy as np
import numpy.typing as npt

from gsvc_conformance.adapters.main_tables import ALPHAS, exp2_table, families, halves, step_of

Array = npt.NDArray[Any]
Outputs = dict[str, Any]

SIDES: Final = (0, 64, 32, 16)
"""Side of the cells of a motion field in pixels, by `motion_cell`."""
WINDOW_MOST: Final = 520
"""Numbers of the frequencies of a window, at most."""
CELL: Final = 4
"""Side of a cell of an I-frame in pixels."""
PART: Final = 12
"""Bytes of a Part of main_cells.wgsl."""
DENSITY: Final = 36
"""Bytes of a Density of main_densities.wgsl."""
ALL_BITS: Final = 0xFFFFFFFF
SYMBOLS_AT_ONCE: Final = 1 << 15
"""A dispatch encodes so many symbols: Mesa's software rasteriser leaves loops after 65,535 rounds."""


class Recording(Protocol):
    """Dispatches that are handed to a device together; each sees what the ones before have written."""

    def dispatch(
        self, module: str, kernel: str, workgroups: int, buffers: Mapping[int, Any], numbers: Sequence[int]
    ) -> None:
        """Add a dispatch of so many workgroups; `numbers` are 32-bit integers, of which none may be given."""

    def submit(self) -> None:
        """Hand everything to the device."""


class Accelerator(Protocol):
    """A device that has the kernels of profile `main`."""

    def storage(self, size: int) -> Any:
        """A buffer of so many bytes, all 0."""

    def upload(self, data: Array) -> Any:
        """A buffer that holds an array."""

    def download(self, buffer: Any, dtype: npt.DTypeLike, count: int) -> Array:
        """The first `count` numbers of a buffer."""

    def recording(self) -> Recording:
        """An empty recording."""


def groups(things: int, size: int = 256) -> int:
    """The number of workgroups of a size that hold all things."""
    return -(-things // size)


class MainOperations:
    """The operations that one device does."""

    def __init__(self, accelerator: Accelerator) -> None:
        self.accelerator = accelerator

    @cached_property
    def tables(self) -> Any:
        """The buffer of EXP2, LOGISTIC and LAPLACE, (15-3), and of (15-8) for all n up to 15 and all α."""
        return self.accelerator.upload(np.array([*exp2_table(), *families()[0], *families()[1], *halves()], np.uint32))

    def integers(self, values: Array) -> Any:
        """A buffer of integers of 32 bits, signed ones as their two's complement."""
        return self.accelerator.upload(np.ascontiguousarray(values, np.int64).astype(np.uint32))

    def signed(self, buffer: Any, *shape: int) -> Array:
        """The integers of a buffer, i8."""
        count = int(np.prod(shape))
        return self.accelerator.download(buffer, np.int32, count).astype(np.int64).reshape(shape)

    def dispatch(
        self,
        module: str,
        kernel: str,
        threads: int,
        buffers: Mapping[int, Any],
        numbers: Sequence[int],
        size: int = 256,
    ) -> None:
        """A dispatch alone."""
        recording = self.accelerator.recording()
        recording.dispatch(module, kernel, groups(threads, size), buffers, numbers)
        recording.submit()

    def encode_run(
        self,
        starts: Array,
        frequencies: Array,
        lanes: Array,
        lane_count: int,
        early: Array,
        early_sizes: Array,
        late: Array,
        late_sizes: Array,
    ) -> Outputs:
        """The states u4 (lane_count,), words u2 (n,), how many each group has, and the raw bytes of a run: R-15.6-3."""
        count, late_bits = len(starts), _bits(late, late_sizes)
        carried = min(lane_count, len(late_bits) // 16)
        at_the_end = np.full(lane_count, 2**16)
        at_the_end[:carried] += late_bits[: 16 * carried].reshape(carried, 16) @ (1 << np.arange(16))
        states, emitted = self.integers(at_the_end), self.accelerator.storage(4 * count)
        symbols = {
            1: self.integers(starts),
            2: self.integers(frequencies),
            3: self.integers(lanes),
            4: states,
            5: emitted,
        }
        recording = self.accelerator.recording()
        for done in range(0, count, SYMBOLS_AT_ONCE):
            numbers = [count, count - 1 - done, min(count - done, SYMBOLS_AT_ONCE), lane_count]
            recording.dispatch("main_encode", "encode", groups(lane_count, 64), symbols, numbers)
        recording.submit()
        words = self.accelerator.download(emitted, np.uint32, count)
        there = np.flatnonzero(words)
        groups_of_words = lanes[there] // 32
        string = np.concatenate([_bits(early, early_sizes), late_bits[16 * carried :]])
        return {
            "lane_states": self.accelerator.download(states, np.uint32, lane_count),
            "word_counts": np.bincount(groups_of_words, minlength=max(1, lane_count // 32)),
            "words": words[there[np.argsort(groups_of_words, kind="stable")]].astype(np.uint16),
            "tail": np.packbits(string.astype(np.uint8), bitorder="little")[::-1],
        }

    def density_frequencies(
        self, edges: Array, centre: int, density_family: int, scale_code: int, unit_bits: int
    ) -> dict[str, Array]:
        """C of the bins between edges, i8 (bins + 1,): (15-6)."""
        bins = len(edges) + 1
        result = self.accelerator.storage(4 * (bins + 1))
        numbers = [bins, 0, centre, density_family, scale_code, unit_bits]
        buffers = {1: self.tables, 2: self.integers(edges), 3: result}
        self.dispatch("main_frequencies", "density_frequencies", bins + 1, buffers, numbers)
        return {"cumulative": self.signed(result, bins + 1)}

    def window_frequencies(self, centre: int, step: int, density_family: int, scale_code: int) -> Outputs:
        """C of the bins of a window, the first one, and how many low bits are raw: (15-6), (15-7)."""
        result, density = self.accelerator.storage(4 * WINDOW_MOST), self.accelerator.storage(36)
        numbers = [0, step, centre, density_family, scale_code]
        buffers = {1: self.tables, 3: result, 4: density}
        self.dispatch("main_frequencies", "window_frequencies", WINDOW_MOST, buffers, numbers)
        *_, first, _, _, bins, low_bits = self.signed(density, 9)
        return {"cumulative": self.signed(result, bins + 1), "first": first, "low_bits": low_bits}

    def half_frequencies(self, count: int, first_half: int, second_half: int, alpha: int) -> Outputs:
        """C of how many of `count` splats are in the first half, and how many low bits are raw: (15-8), (15-9)."""
        most = min(count, 2**9) + 2
        result, density = self.accelerator.storage(4 * most), self.accelerator.storage(36)
        numbers = [count, 0, 0, 0, 0, 0, first_half, second_half, ALPHAS.index(alpha)]
        self.dispatch("main_frequencies", "half_frequencies", most, {1: self.tables, 3: result, 4: density}, numbers)
        *_, bins, low_bits = self.signed(density, 9)
        return {"cumulative": self.signed(result, bins + 1), "low_bits": low_bits}

    def codes_of_classes(self, classes: Array, low: Array, negative: Array) -> Outputs:
        """The codes i8 (N,) of classes of magnitudes, low bits and signs: section 15.7."""
        buffers = {2: self.integers(classes), 3: self.integers(low), 4: self.integers(negative)}
        numbers = [0] * 8 + [1]  # one component of one
        return {"codes": self._on_splats("signed_codes", len(classes), 1, buffers, numbers)[:, 0]}

    def cells_of_halves(self, width: int, height: int, count: int, first_halves: Array) -> Outputs:
        """The cells i8 (count, 2) of splats by the numbers in first halves: section 15.8."""
        inside = -(-width // CELL), -(-height // CELL)
        halvings = (max(inside) - 1).bit_length()
        parts, items = self.integers(np.array([0, 0, count])), self.integers(np.array([1, 0]))
        at, storage = 0, self.accelerator.storage
        for halving in range(2 * halvings):
            axis, size = halving % 2, 2 ** (halvings - 1 - halving // 2)
            most = int(self.accelerator.download(items, np.uint32, 1)[0])
            numbers = [most, axis, size, inside[axis]]
            halves, after = storage(2 * PART * most), storage(4 * (2 * most + 1))
            buffers = {2: parts, 3: items, 4: storage(DENSITY * most), 7: storage(4 * most), 8: halves}
            buffers[6] = self.integers(first_halves[at : at + most])
            recording = self.accelerator.recording()
            recording.dispatch("main_cells", "halve", groups(most), buffers, numbers)
            recording.dispatch("main_lists", "choose", 1, {1: halves, 2: after}, [2 * most, 2, 3, 0, ALL_BITS, 0])
            recording.submit()
            parts, items, at = halves, after, at + most
        firsts, cells = storage(4 * count), storage(8 * count)
        recording = self.accelerator.recording()
        recording.dispatch("main_lists", "starts", 1, {1: parts, 2: items, 3: firsts}, [0, 2, 3])
        recording.dispatch("main_cells", "locate", groups(count), {2: parts, 3: items, 5: firsts, 6: cells}, [count])
        recording.submit()
        return {"cells": self.signed(cells, count, 2)}

    def field_vectors(self, differences: Array) -> Outputs:
        """The vectors i8 (r, c, 2) of a field by their differences: section 15.10."""
        rows, columns, _ = differences.shape
        result = self.accelerator.storage(8 * rows * columns)
        numbers = [rows, 0, 0, 0, columns, rows]
        self.dispatch("main_splats", "field_vectors", rows, {2: self.integers(differences), 6: result}, numbers)
        return {"vectors": self.signed(result, rows, columns, 2)}

    def model_frequencies(self, counts: Array) -> Outputs:
        """C of each context, i8 (contexts, symbols + 1): (15-14)."""
        contexts, symbols = counts.shape
        result = self.accelerator.storage(4 * contexts * (symbols + 1))
        buffers = {2: self.integers(counts), 3: result}
        self.dispatch("main_frequencies", "model_frequencies", contexts, buffers, [contexts, symbols])
        return {"cumulative": self.signed(result, contexts, symbols + 1)}

    def adapt_model(self, counts: Array, seen: Array) -> Outputs:
        """The counts i8 (contexts, symbols) after a P-frame: (15-11)."""
        contexts, symbols = counts.shape
        result = self.accelerator.storage(4 * counts.size)
        buffers = {2: self.integers(counts), 3: result, 5: self.integers(seen)}
        self.dispatch("main_frequencies", "adapt_model", contexts, buffers, [contexts, symbols])
        return {
            "counts": self.accelerator.download(result, np.uint32, counts.size).astype(np.int64).reshape(counts.shape)
        }

    def _on_splats(
        self, entry_point: str, count: int, columns: int, buffers: dict[int, Any], numbers: Sequence[int]
    ) -> Array:
        """The numbers i8 (count, columns) that a pass of main_splats.wgsl has for each splat."""
        result = self.accelerator.storage(4 * columns * count)
        self.dispatch("main_splats", entry_point, count, {**buffers, 6: result}, [count, *numbers])
        return self.signed(result, count, columns)

    def splat_classes(self, state: Array, quantizer: int) -> Outputs:
        """The class of each splat, i8 (N,): (15-4)."""
        classes = self._on_splats("splat_classes", len(state), 1, {2: self.integers(state)}, [step_of(quantizer)])
        return {"classes": classes[:, 0]}

    def main_intra(self, quantizer: int, cells: Array, colors: Array, shapes: Array, places: Array) -> Outputs:
        """The states i8 (N, 8) of codes: (15-10) and (15-15)."""
        buffers = {
            2: self.integers(cells),
            3: self.integers(colors),
            4: self.integers(shapes),
            5: self.integers(places),
        }
        return {"state": self._on_splats("main_intra", len(cells), 8, buffers, [step_of(quantizer)])}

    def motion_of_splats(self, state: Array, vectors: Array, motion_cell: int) -> Outputs:
        """The motion of each splat, i8 (N, 2): (15-12)."""
        rows, columns, _ = vectors.shape
        numbers = [0, 0, 0, columns, rows, SIDES[motion_cell]]
        buffers = {2: self.integers(state), 3: self.integers(vectors)}
        return {"motion": self._on_splats("motion_of_splats", len(state), 2, buffers, numbers)}

    def mode_contexts(
        self, width: int, height: int, state: Array, past: Array, motion: Array, vectors: Array, motion_cell: int
    ) -> Outputs:
        """The context of each splat's mode, i8 (N,)."""
        rows, columns, _ = vectors.shape
        buffers = {2: self.integers(state), 3: self.integers(past), 4: self.integers(motion), 5: self.integers(vectors)}
        numbers = [0, width, height, columns, rows, SIDES[motion_cell]]
        return {"contexts": self._on_splats("mode_contexts", len(state), 1, buffers, numbers)[:, 0]}

    def main_inter(self, quantizer: int, state: Array, motion: Array, differences: Array) -> Outputs:
        """The states i8 (N, 8) after motion and differences: (15-13)."""
        buffers = {1: self.tables, 2: self.integers(state), 3: self.integers(motion), 4: self.integers(differences)}
        return {"state": self._on_splats("main_inter", len(state), 8, buffers, [step_of(quantizer)])}

    def work_of(self, state: Any, count: int, width: int, height: int, halvings: int) -> int:
        """The rendering work of the states in a buffer: (5-2)."""
        result = self.accelerator.storage(4 * count)
        numbers = [count, width, height, halvings]
        self.dispatch("main_parameters", "main_work", count, {1: self.tables, 2: state, 3: result}, numbers)
        return int(np.sum(self.accelerator.download(result, np.uint32, count), dtype=np.int64))

    def main_work(self, state: Array, width: int, height: int, halvings: int) -> Outputs:
        """The rendering work of states, i8 (): (5-2)."""
        return {"work": np.array(self.work_of(self.integers(state), len(state), width, height, halvings))}

    def parameters_of(self, state: Any, count: int) -> Array:
        """The parameters f4 (count, 8) of the states in a buffer: (15-5)."""
        result = self.accelerator.storage(32 * count)
        self.dispatch("main_parameters", "state_parameters", count, {1: self.tables, 2: state, 3: result}, [count])
        return self.accelerator.download(result, np.float32, 8 * count).reshape(count, 8)

    def state_parameters(self, state: Array) -> Outputs:
        """The parameters f4 (N, 8) of states: (15-5)."""
        return {"parameters": self.parameters_of(self.integers(state), len(state))}


def _bits(values: Array, sizes: Array) -> Array:
    """The bits of raw values, of each the least significant one first."""
    owner = np.repeat(np.arange(len(sizes)), sizes)
    within = np.arange(len(owner)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    bits: Array = values[owner] >> within & 1
    return bits
