"""Profile `main`: integers from the bits to the splats, exactly (spec.md section 15).

The oracles are the code of spec.md; gsvc_ref answers by arrays and compiled kernels.
"""

from collections.abc import Callable
from typing import Any, Final

from gsvc_base import spec
from gsvc_conformance.expectations import Exact, Expectation, Refusal
from gsvc_conformance.operation import exactly, paired
from gsvc_conformance.operations.bitstream import CONTAINER_RULES, frame_intervals, frame_intervals_by_model

MAIN_RULES: Final = ("R-15.5-1", "R-15.5-2", "R-15.5-3", "R-15.5-4", "R-15.5-5", "R-15.6-1", "R-15.6-2", "R-15.6-4",
                     "R-15.6-5", "R-15.11-1", "R-15.11-2")  # fmt: skip
"""Rules of profile `main` that every legal stream of it exercises."""


def _plain(name: str) -> Callable[..., dict[str, Expectation]]:
    """The oracle of an operation that the code of spec.md has."""
    return exactly(getattr(spec, name))


paired(
    "read_main_stream",
    "bitstream",
    "What a legal stream of profile `main` says: header, bodies, fields, modes, differences, symbols and states.",
    inputs="stream: stream",
    outputs="header: i8 (E,); frame_types: u1 (T,); counts: i8 (T,); bodies: i8 (K, 6); fields: i8 (V, 2); "
    "modes: i8 (M,); differences: i8 (M, 8); symbols: u2 (S, 4); states: i8 (N, 8)",
    equations=("15-2", "15-3", "15-6", "15-7", "15-8", "15-10"),
    rules=("R-3.1-5", *CONTAINER_RULES, *MAIN_RULES),
    oracle=_plain("read_main_stream"),
)


def _layers(**inputs: Any) -> dict[str, Expectation]:
    """The parameters exactly; the error in full."""
    found = spec.reconstruct_layers(**inputs)
    return {
        "counts": Exact(found["counts"]),
        "parameters": Exact(found["parameters"]),
        "error": Refusal(found["error"], in_full=True),
    }


paired(
    "reconstruct_layers",
    "layers",
    "The splats of all complete frames of a stream in the quality of a layer, and what is wrong with it.",
    inputs="stream: stream; layer: int",
    outputs="counts: i8 (T,); parameters: f4 (N, 8); error: text",
    rules=("R-5-9", *(f"R-15.13-{n}" for n in range(1, 7))),
    oracle=_layers,
)


paired(
    "decode_layers",
    "layers",
    "The frames of a stream in the quality of a layer.",
    inputs="stream: stream; layer: int",
    outputs="frames: u1|u2 (T, H, W, 3)",
    equations=("9-1", "9-2"),
    rules=("R-9.1-1", "R-9.1-4", "R-9.2-1", "R-15.13-3"),
    oracle=frame_intervals,
    by_model=frame_intervals_by_model,
)


paired(
    "encode_run",
    "bitstream",
    "The states, words and raw bits in which a decoder finds the symbols and raw values of a frame again.",
    inputs="starts: i8 (K,); frequencies: i8 (K,); lanes: i8 (K,); lane_count: int; early: i8 (E,); "
    "early_sizes: i8 (E,); late: i8 (F,); late_sizes: i8 (F,)",
    outputs="lane_states: u4 (lane_count,); word_counts: i8 (G,); words: u2 (n,); tail: u1 (t,)",
    equations=("7-2",),
    rules=("R-7-3", "R-15.6-2", "R-15.6-3", "R-15.6-4"),
    oracle=_plain("encode_run"),
)


paired(
    "density_frequencies",
    "bitstream",
    "Cumulative frequencies of the bins of a density.",
    inputs="edges: i8 (K,); centre: int; density_family: int; scale_code: int; unit_bits: int",
    outputs="cumulative: i8 (M,)",
    equations=("15-3", "15-6"),
    oracle=_plain("density_frequencies"),
)


paired(
    "window_frequencies",
    "bitstream",
    "Cumulative frequencies of the window of a code of size, aspect or shear.",
    inputs="centre: int; step: int; density_family: int; scale_code: int",
    outputs="cumulative: i8 (M,); first: i8 (); low_bits: i8 ()",
    equations=("15-2", "15-6", "15-7"),
    oracle=_plain("window_frequencies"),
)


paired(
    "codes_of_classes",
    "reconstruction",
    "The codes that classes of magnitudes, low bits and signs stand for.",
    inputs="classes: i8 (N,); low: i8 (N,); negative: i8 (N,)",
    outputs="codes: i8 (N,)",
    oracle=_plain("codes_of_classes"),
)


paired(
    "half_frequencies",
    "bitstream",
    "Cumulative frequencies of how many of a part's splats are in its first half.",
    inputs="count: int; first_half: int; second_half: int; alpha: int",
    outputs="cumulative: i8 (M,); low_bits: i8 ()",
    equations=("15-8", "15-9"),
    oracle=_plain("half_frequencies"),
)


paired(
    "cells_of_halves",
    "reconstruction",
    "The cells of splats, by how many are in the first half of each part.",
    inputs="width: int; height: int; count: int; first_halves: i8 (K,)",
    outputs="cells: i8 (count, 2)",
    oracle=_plain("cells_of_halves"),
)


paired(
    "field_vectors",
    "reconstruction",
    "The vectors of a motion field, by the differences that are coded.",
    inputs="differences: i8 (r, c, 2)",
    outputs="vectors: i8 (r, c, 2)",
    oracle=_plain("field_vectors"),
)


paired(
    "model_frequencies",
    "bitstream",
    "Cumulative frequencies of each context of a model.",
    inputs="counts: i8 (C, K)",
    outputs="cumulative: i8 (C, M)",
    equations=("15-14",),
    oracle=_plain("model_frequencies"),
)


paired(
    "adapt_model",
    "bitstream",
    "The counts of a model after a P-frame.",
    inputs="counts: i8 (C, K); seen: i8 (C, K)",
    outputs="counts: i8 (C, K)",
    equations=("15-11",),
    oracle=_plain("adapt_model"),
)


paired(
    "mode_contexts",
    "bitstream",
    "The context of the mode of each splat of a P-frame.",
    inputs="width: int; height: int; state: i8 (N, 8); past: i8 (N,); motion: i8 (N, 2); vectors: i8 (r, c, 2); "
    "motion_cell: int",
    outputs="contexts: i8 (N,)",
    oracle=_plain("mode_contexts"),
)


paired(
    "splat_classes",
    "reconstruction",
    "The class of each splat.",
    inputs="state: i8 (N, 8); quantizer: int",
    outputs="classes: i8 (N,)",
    equations=("15-4",),
    oracle=_plain("splat_classes"),
)


paired(
    "main_intra",
    "reconstruction",
    "The state that the codes of an I-frame, or of new splats, stand for.",
    inputs="quantizer: int; cells: i8 (N, 2); colors: i8 (N, 3); shapes: i8 (N, 3); places: i8 (N, 2)",
    outputs="state: i8 (N, 8)",
    equations=("15-4", "15-10", "15-15"),
    rules=("R-15.4-1",),
    oracle=_plain("main_intra"),
)


paired(
    "motion_of_splats",
    "reconstruction",
    "By how much each splat moves with the motion field.",
    inputs="state: i8 (N, 8); vectors: i8 (r, c, 2); motion_cell: int",
    outputs="motion: i8 (N, 2)",
    equations=("15-12",),
    oracle=_plain("motion_of_splats"),
)


paired(
    "main_inter",
    "reconstruction",
    "The state of the splats that stay, after motion and differences.",
    inputs="quantizer: int; state: i8 (N, 8); motion: i8 (N, 2); differences: i8 (N, 8)",
    outputs="state: i8 (N, 8)",
    equations=("15-2", "15-4", "15-13"),
    rules=("R-15.4-1", "R-15.11-2"),
    oracle=_plain("main_inter"),
)


paired(
    "state_parameters",
    "reconstruction",
    "The parameters of splats, bit for bit those of every decoder.",
    inputs="state: i8 (N, 8)",
    outputs="parameters: f4 (N, 8)",
    equations=("15-5",),
    rules=("R-15.4-2",),
    oracle=_plain("state_parameters"),
)
