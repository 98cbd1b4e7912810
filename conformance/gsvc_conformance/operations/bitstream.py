"""Streams: what their bytes say, the splats that they stand for, and their frames (spec.md sections 5 to 9 and 12)."""

from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

from gsvc_base.rendering.error_models import ErrorModel
from gsvc_conformance.expectations import Exact, Expectation, Interval, Refusal
from gsvc_conformance.operation import Values, operations, paired
from gsvc_conformance.operations.rendering import frame_by_model
from gsvc_conformance.pairs import twin

CONTAINER_RULES: Final = ("R-6.1-1", "R-6.1-2", "R-6.1-3", "R-6.1-4", "R-6.1-5", "R-6.2-1", "R-6.2-2", "R-6.2-3",
                          "R-6.2-4", "R-6.3-1", "R-6.3-2", "R-6.4-1", "R-6.4-2", "R-6.8-1", "R-6.8-2")  # fmt: skip
"""Rules that every stream exercises."""


paired(
    "read_stream",
    "bitstream",
    "What the bytes of a legal stream say: header, frame types, survivors, and the codes of all splat blocks.",
    inputs="stream: stream",
    outputs="header: i8 (22,); frame_types: u1 (T,); counts: i8 (T,); survivors: u1 (S,); blocks: i8 (K, 8); "
    "positions: u2 (P, 2); cholesky: u2 (C, 3); quantizers: f4 (Q, 3, 2); codebook_sizes: i8 (M,); "
    "codewords: u2 (W, 3); color_indices: u2 (I,)",
    rules=("R-3.1-5", *CONTAINER_RULES),
)


paired(
    "decode_plane",
    "bitstream",
    "The symbols of one plane, from the bytes of plane().",
    inputs="data: u1 (n,); count: int; alphabet: int; entropy_precision: int; lane_count: int",
    outputs="symbols: u2 (count,)",
    equations=("7-1",),
    rules=("R-3.1-5", "R-6.6-2", "R-7-2"),
)


paired(
    "encode_plane",
    "bitstream",
    "The states and words with which a decoder finds the symbols again, by the encoder of section 7.",
    inputs="symbols: u2 (count,); frequencies: i8 (alphabet,); entropy_precision: int; lane_count: int",
    outputs="lane_states: u4 (lanes,); words: u2 (n,)",
    equations=("7-2",),
    rules=("R-6.6-5", "R-7-1", "R-7-3"),
)


def _refused(name: str) -> Callable[..., dict[str, Expectation]]:
    """The oracle of an operation that does not fail: gsvc_ref's parameters exactly; its error in full."""

    def oracle(**inputs: Any) -> dict[str, Expectation]:
        counts, parameters, error = twin(name)(**inputs)
        return {"counts": Exact(counts), "parameters": Exact(parameters), "error": Refusal(error, in_full=True)}

    return oracle


paired(
    "reconstruct_stream",
    "bitstream",
    "The splats of all complete frames of a stream, and what is wrong with it.",
    inputs="stream: stream",
    outputs="counts: i8 (T,); parameters: f4 (N, 8); error: text",
    equations=("8-1", "8-2", "8-3", "8-4"),
    rules=("R-3.1-5", "R-6.1-1", "R-6.1-2", "R-8-2"),
    oracle=_refused("reconstruct_stream"),
)


paired(
    "seek",
    "seeking",
    "The splats of some frames of a stream, decoded from the last I-frame at or before them.",
    inputs="stream: stream; first: int; last: int",
    outputs="counts: i8 (T,); parameters: f4 (N, 8); error: text",
    rules=("R-6.7-3", "R-12.6-2", "R-12.6-3", "R-12.6-4", "R-12.6-5"),
    oracle=_refused("seek"),
)


def frame_intervals(stream: bytes, layer: int = 0) -> dict[str, Expectation]:
    """Each frame's interval, derived from the exact sum and its bound."""
    rendered = operations()["render_frame"].oracle
    return _of_frames(stream, layer, lambda _, given: rendered(**given)["frame"])


def frame_intervals_by_model(
    model: ErrorModel, expected: Mapping[str, Expectation], inputs: Values
) -> dict[str, Expectation]:
    """Each frame's interval by another error model."""
    frames = np.asarray(expected["frames"].value)
    return _of_frames(
        inputs["stream"], inputs.get("layer", 0),
        lambda number, given: frame_by_model(model, {"frame": Exact(frames[number])}, given)["frame"],
    )  # fmt: skip


def _of_frames(stream: bytes, layer: int, interval: Callable[[int, Values], Any]) -> dict[str, Expectation]:
    """The intervals of all frames, from the number and the inputs of each; equal splats repeat the one before."""
    from gsvc_ref.stream import StreamReader

    reader = StreamReader(stream, layer=layer)
    size = {"width": reader.header.width, "height": reader.header.height, "bit_depth": reader.header.bit_depth}
    found: list[Any] = []
    before = None
    for number, frame in enumerate(reader):
        parameters = frame.splats.to_array()
        again = before is not None and parameters.tobytes() == before.tobytes()
        found.append(found[-1] if again else interval(number, {"parameters": parameters, **size}))
        before = parameters
    parts = (np.stack([getattr(one, part) for one in found]) for part in ("value", "lowest", "highest"))
    return {"frames": Interval(*parts)}


paired(
    "decode_stream",
    "rendering",
    "The frames of a legal stream.",
    inputs="stream: stream",
    outputs="frames: u1|u2 (T, H, W, 3)",
    equations=("9-1", "9-2"),
    rules=("R-9.1-1", "R-9.1-4", "R-9.2-1"),
    oracle=frame_intervals,
    by_model=frame_intervals_by_model,
)


paired(
    "decode_stream_deterministic",
    "deterministic",
    "The frames of a legal stream, rendered deterministically.",
    inputs="stream: stream",
    outputs="frames: u1|u2 (T, H, W, 3)",
    equations=("9-3", "9-4", "9-5", "9-6", "9-7"),
    rules=("R-9.1-4", "R-9.3-1"),
)
