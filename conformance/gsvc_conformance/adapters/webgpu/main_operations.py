"""The operations of profile `main` that are one dispatch or two each (spec.md 15): the host's side of their shaders."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from gsvc_conformance.adapters.webgpu.entropy import ROUNDS_AT_ONCE
from gsvc_conformance.adapters.webgpu.gpu import Array, Recording, download, groups, storage, upload
from gsvc_conformance.adapters.webgpu.main_tables import ALPHAS, shader, step_of, tables

Outputs = dict[str, Any]

SIDES = (0, 64, 32, 16)
"""Side of the cells of a motion field in pixels, by `motion_cell`."""


def integers(values: Array) -> Any:
    """A buffer of integers of 32 bits, signed ones as their two's complement."""
    return upload(np.ascontiguousarray(values, np.int64).astype(np.uint32))


def signed(buffer: Any, *shape: int) -> Array:
    """The integers of a buffer, i8."""
    return download(buffer, np.int32, int(np.prod(shape))).astype(np.int64).reshape(shape)


def dispatch(
    name: str, entry_point: str, threads: int, buffers: dict[int, Any], numbers: Sequence[int], size: int = 256
) -> None:
    """A dispatch alone."""
    recording = Recording()
    recording.dispatch(shader(name), entry_point, groups(threads, size), buffers, numbers)
    recording.submit()


def encode_run(starts: Array, frequencies: Array, lanes: Array, lane_count: int) -> Outputs:
    """The states u4 (lane_count,) and words u2 (n,) of a run: R-15.6-3."""
    count = len(starts)
    states, emitted = integers(np.full(lane_count, 2**16)), storage(4 * count)
    symbols = {1: integers(starts), 2: integers(frequencies), 3: integers(lanes), 4: states, 5: emitted}
    recording = Recording()
    for done in range(0, count, ROUNDS_AT_ONCE):
        numbers = [count, count - 1 - done, min(count - done, ROUNDS_AT_ONCE)]
        recording.dispatch(shader("main_encode"), "encode", 1, symbols, numbers)
    found, words = storage(4 * (count + 1)), storage(4 * (count + 1))
    condition = [count, 0, 1, 0, 0xFFFFFFFF, 0]
    recording.dispatch(shader("main_lists"), "choose", 1, {1: emitted, 2: found}, condition)
    buffers = {1: emitted, 2: found, 3: words}
    recording.dispatch(shader("main_lists"), "words", groups(count, 512), buffers, [])
    recording.submit()
    given = int(download(found, np.uint32, 1)[0])
    return {"lane_states": download(states, np.uint32, lane_count), "words": download(words, np.uint16, given)}


def density_frequencies(
    edges: Array, centre: int, density_family: int, scale_code: int, unit_bits: int
) -> dict[str, Array]:
    """C of the bins between edges, i8 (bins + 1,): (15-6)."""
    bins = len(edges) + 1
    result = storage(4 * (bins + 1))
    numbers = [bins, 0, centre, density_family, scale_code, unit_bits]
    buffers = {1: tables(), 2: integers(edges), 3: result}
    dispatch("main_frequencies", "density_frequencies", bins + 1, buffers, numbers)
    return {"cumulative": signed(result, bins + 1)}


def half_frequencies(count: int, first_half: int, second_half: int, alpha: int) -> Outputs:
    """C of how many of `count` splats are in the first half, and how many low bits are raw: (15-8), (15-9)."""
    most = min(count, 2**9) + 2
    result, density = storage(4 * most), storage(36)
    numbers = [count, 0, 0, 0, 0, 0, first_half, second_half, ALPHAS.index(alpha)]
    dispatch("main_frequencies", "half_frequencies", most, {1: tables(), 3: result, 4: density}, numbers)
    *_, bins, low_bits = signed(density, 9)
    return {"cumulative": signed(result, bins + 1), "low_bits": low_bits}


def model_frequencies(counts: Array) -> Outputs:
    """C of each context, i8 (contexts, symbols + 1): (15-14)."""
    contexts, symbols = counts.shape
    result = storage(4 * contexts * (symbols + 1))
    buffers = {2: integers(counts), 3: result}
    dispatch("main_frequencies", "model_frequencies", contexts, buffers, [contexts, symbols])
    return {"cumulative": signed(result, contexts, symbols + 1)}


def adapt_model(counts: Array, seen: Array) -> Outputs:
    """The counts i8 (contexts, symbols) behind a P-frame: (15-11)."""
    contexts, symbols = counts.shape
    result = storage(4 * counts.size)
    buffers = {2: integers(counts), 3: result, 5: integers(seen)}
    dispatch("main_frequencies", "adapt_model", contexts, buffers, [contexts, symbols])
    return {"counts": download(result, np.uint32, counts.size).astype(np.int64).reshape(counts.shape)}


def _on_splats(entry_point: str, count: int, columns: int, buffers: dict[int, Any], numbers: Sequence[int]) -> Array:
    """The numbers i8 (count, columns) that a pass of main_splats.wgsl has for each splat."""
    result = storage(4 * columns * count)
    dispatch("main_splats", entry_point, count, {**buffers, 6: result}, [count, *numbers])
    return signed(result, count, columns)


def splat_classes(state: Array, quantizer: int) -> Outputs:
    """The class of each splat, i8 (N,): (15-4)."""
    classes = _on_splats("splat_classes", len(state), 1, {2: integers(state)}, [step_of(quantizer)])
    return {"classes": classes[:, 0]}


def main_intra(quantizer: int, cells: Array, colors: Array, shapes: Array, places: Array) -> Outputs:
    """The states i8 (N, 8) of codes: (15-10) and (15-15)."""
    buffers = {2: integers(cells), 3: integers(colors), 4: integers(shapes), 5: integers(places)}
    return {"state": _on_splats("main_intra", len(cells), 8, buffers, [step_of(quantizer)])}


def motion_of_splats(state: Array, vectors: Array, motion_cell: int) -> Outputs:
    """The motion of each splat, i8 (N, 2): (15-12)."""
    rows, columns, _ = vectors.shape
    numbers = [0, 0, 0, columns, rows, SIDES[motion_cell]]
    buffers = {2: integers(state), 3: integers(vectors)}
    return {"motion": _on_splats("motion_of_splats", len(state), 2, buffers, numbers)}


def mode_contexts(
    width: int, height: int, state: Array, past: Array, motion: Array, vectors: Array, motion_cell: int
) -> Outputs:
    """The context of each splat's mode, i8 (N,)."""
    rows, columns, _ = vectors.shape
    buffers = {2: integers(state), 3: integers(past), 4: integers(motion), 5: integers(vectors)}
    numbers = [0, width, height, columns, rows, SIDES[motion_cell]]
    return {"contexts": _on_splats("mode_contexts", len(state), 1, buffers, numbers)[:, 0]}


def main_inter(quantizer: int, state: Array, motion: Array, differences: Array) -> Outputs:
    """The states i8 (N, 8) after motion and differences: (15-13)."""
    buffers = {1: tables(), 2: integers(state), 3: integers(motion), 4: integers(differences)}
    return {"state": _on_splats("main_inter", len(state), 8, buffers, [step_of(quantizer)])}


def parameters_of(state: Any, count: int) -> Array:
    """The parameters f4 (count, 8) of the states in a buffer: (15-5)."""
    result = storage(32 * count)
    dispatch("main_parameters", "state_parameters", count, {1: tables(), 2: state, 3: result}, [count])
    return download(result, np.float32, 8 * count).reshape(count, 8)


def state_parameters(state: Array) -> Outputs:
    """The parameters f4 (N, 8) of states: (15-5)."""
    return {"parameters": parameters_of(integers(state), len(state))}
