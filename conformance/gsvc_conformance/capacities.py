"""Whether vectors are large enough: implementations that end at some capacity must fail, in every dimension.

A *dimension* is a symbol in the shapes of an operation's ports (N, H, W, ...), or one of `NAMED` that no shape shows.
An implementation *ends at k* in a dimension if it writes the first k elements and leaves the others zero, or, where an
output does not have the dimension, leaves inputs from k on out: then gsvc_ref answers for inputs that are zero there.
A dimension that cannot be large has a reason in `LIMITS`; any other must have vectors that catch every capacity. Of
operations on streams this holds for the vectors of each profile alone, since a claim of one is judged by no others.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_conformance import spec
from gsvc_conformance.expectations import NO_ARRAYS, Bounded
from gsvc_conformance.operation import Operation, Port, Values
from gsvc_conformance.profiles import PROFILES, of_main
from gsvc_conformance.vector import Vector

Array = NDArray[Any]

CAPACITIES: Final = tuple(1 << bits for bits in range(5, 17))
"""32 to 65,536."""

TILE: Final = 16
"""Maximum number of columns and rows of a frame that is one tile."""

PIXELS: Final = "pixels"
OF_A_TILE: Final = "splats of a tile"
USERS: Final = "users of a codeword"
WORDS: Final = "words"

_SIDES = (1 << 15, "a frame has at most 65,535 columns and rows")
_CODEWORDS = (1 << 12, "a block has at most 8 stages of 1,024 codewords")
_COLOR = (1 << 12, "plain code multiplies by matrices of a side by its chroma samples")
_STAGES = (0, "there are at most 8 stages of codebooks")
_RVQ = ("rvq_assign", "rvq_update", "commitment")
_ONE_BLOCK = (0, "those of all blocks, one after the other; a decoder needs those of one block at a time")
_PICTURES = (1 << 8, "each frame is a picture; `reconstruct_stream` has more frames")

_ENCODER = (0, "an encoder takes its time, and levels say how large its frames may be")

LIMITS: Final[Mapping[tuple[str, str], tuple[int, str]]] = {
    ("*", "H"): _SIDES,
    ("*", "W"): _SIDES,
    **{(name, "M"): _STAGES for name in ("reconstruct_intra", "reconstruct_inter", *_RVQ)},
    ("*", "B"): _CODEWORDS,
    **{(name, "K"): _CODEWORDS for name in _RVQ},
    ("rvq_update", "D"): _CODEWORDS,
    ("adan_step", "P"): (0, "a row has nine values"),
    **{(name, "C"): (0, "there are three channels") for name in ("lsq_quantize", "lsq_dequantize", "lsq_gradients")},
    ("encode_plane", "alphabet"): (1 << 11, "codes have at most 12 bits"),
    ("encode_plane", "lanes"): (0, "there are at most 64 lanes"),
    **{(name, side): _COLOR for name in ("planes_to_frame", "frame_to_planes") for side in ("H", "W")},
    **{(name, side): (1 << 11, _COLOR[1]) for name in ("planes_to_frame", "frame_to_planes") for side in ("h", "w")},
    ("decode_stream", "T"): _PICTURES,
    ("decode_stream_deterministic", "T"): _PICTURES,
    ("seek", "T"): (0, "`reconstruct_stream` has more frames"),
    ("seek", "N"): (0, "`reconstruct_stream` has more splats"),
    ("read_stream", "T"): (1 << 8, "`reconstruct_stream` has more frames"),
    ("read_stream", "K"): _ONE_BLOCK,
    ("read_stream", "Q"): _ONE_BLOCK,
    ("read_stream", "M"): _ONE_BLOCK,
    ("read_stream", "W"): _CODEWORDS,
    **{("density_frequencies", axis): (1 << 9, "there are at most 1,024 edges") for axis in "KM"},
    ("half_frequencies", "M"): (1 << 8, "halves have at most 512 bins"),
    **{(name, "C"): (0, "a model has at most 10 contexts") for name in ("model_frequencies", "adapt_model")},
    **{(name, "K"): (0, "a model has at most 24 symbols") for name in ("model_frequencies", "adapt_model")},
    ("model_frequencies", "M"): (0, "a model has at most 24 symbols"),
    **{
        (name, axis): (1 << 11, "a frame has at most 4,096 rows and columns of cells")
        for name in ("motion_of_splats", "mode_contexts", "field_vectors")
        for axis in "rc"
    },
    ("encode_run", "lane_count"): (0, "`encode_run` looks at one lane at a time"),
    **{("encode_run", axis): (0, "raw values are a string of bits, whose length K stands for") for axis in "EFt"},
    ("encode_run", "G"): (0, "there are at most 128 groups of lanes"),
    ("cells_of_halves", "K"): (1 << 12, "a part has a splat, and of these there are more"),
    ("window_frequencies", "M"): (1 << 8, "windows have at most 514 bins"),
    ("read_main_stream", "E"): (0, "a header has some 20 elements"),
    **{("read_main_stream", axis): (1 << 8, "`reconstruct_stream` has more frames") for axis in "TK"},
    ("reconstruct_layers", "T"): (1 << 8, "`reconstruct_stream` has more frames"),
    **{("decode_layers", axis): (0, "`decode_stream` has more frames, and larger ones") for axis in "THW"},
    **{("encode_video", axis): _ENCODER for axis in "THW"},
}
"""The largest capacity that is demanded of a dimension, of one operation or of any (*), and why no larger one is."""

LOCAL: Final[Mapping[tuple[str, str], tuple[str, ...]]] = {
    ("encode_plane", "count"): ("words",),  # the state of a lane forgets symbols that are far
    ("encode_run", "K"): ("words",),
    ("rvq_update", "D"): ("sums", "codebooks"),  # the count of a codeword that is replaced is 1 whatever is drawn
}
"""The outputs that depend on a dimension, where not all of them do."""


@dataclass(frozen=True)
class Row:
    """One dimension of an operation in its vectors.

    Attributes
    ----------
    profile
        The profile of the vectors, where the operation has vectors of streams; else empty.
    largest
        The largest size in any vector.
    demanded
        The capacities that must be caught.
    caught
        Those that are.
    reason
        Why the others are not demanded.
    """

    operation: str
    profile: str
    dimension: str
    largest: int
    demanded: tuple[int, ...]
    caught: tuple[int, ...]
    reason: str

    @property
    def missed(self) -> tuple[int, ...]:
        """The capacities that are demanded and that no vector catches."""
        return tuple(k for k in self.demanded if k not in self.caught)


def symbols(port: Port) -> list[str]:
    """The symbol of each axis of a port; empty for one of a fixed size."""
    axes = [axis for axis in port.shape.strip("()").split(",") if axis.strip()]
    found = [re.match(r"[A-Za-z]\w*", axis.strip()) for axis in axes]
    return [match[0] if match else "" for match in found]


def dimensions(operation: Operation) -> list[str]:
    """The dimensions of an operation, in the order of its ports, then those that shapes do not show."""
    found = [symbol for port in (*operation.inputs, *operation.outputs) for symbol in symbols(port) if symbol]
    return list(dict.fromkeys([*found, *(name for name, named in NAMED.items() if named.applies(operation))]))


def limit(operation: Operation, dimension: str) -> tuple[int, str]:
    """The largest capacity that is demanded, and the reason."""
    return LIMITS.get((operation.name, dimension)) or LIMITS.get(("*", dimension)) or (CAPACITIES[-1], "")


def profiles(operation: Operation) -> tuple[str, ...]:
    """The profiles for each of which the vectors of an operation must be large enough; ("",): for all together."""
    if not any(port.type == "stream" for port in operation.inputs):
        return ("",)
    if of_main(operation.name):
        return ("main",)
    return ("paper",) if operation.name == "read_stream" else PROFILES


def rows(operation: Operation, vectors: Iterable[Vector]) -> Iterator[Row]:
    """The dimensions of an operation, held against its vectors."""
    vectors = [vector for vector in vectors if vector.operation.name == operation.name and vector.tier != "faulty"]
    for profile in profiles(operation):
        yield from _rows_of(operation, profile, [v for v in vectors if profile in ("", v.manifest.get("profile"))])


def _rows_of(operation: Operation, profile: str, vectors: list[Vector]) -> Iterator[Row]:
    for dimension in dimensions(operation):
        most, reason = limit(operation, dimension)
        demanded = tuple(k for k in CAPACITIES if k <= most)
        sizes = {vector.id: size(vector, dimension) for vector in vectors}
        largest_first = sorted(vectors, key=lambda vector: -sizes[vector.id])
        caught = tuple(
            k for k in demanded
            if all(_is_caught(dimension, port, k, [v for v in largest_first if sizes[v.id] > k])
                   for port in _concerned(operation, dimension))
        )  # fmt: skip
        yield Row(operation.name, profile, dimension, max(sizes.values(), default=0), demanded, caught, reason)


def size(vector: Vector, dimension: str) -> int:
    """The size of a dimension in a vector."""
    if dimension in NAMED:
        return NAMED[dimension].size(vector)
    values = {**vector.inputs, **{name: e.value for name, e in vector.expected.items()}}
    found = [
        np.shape(values[port.name])[symbols(port).index(dimension)]
        for port in (*vector.operation.inputs, *vector.operation.outputs) if dimension in symbols(port)
    ]  # fmt: skip
    return max(found, default=0)


def _concerned(operation: Operation, dimension: str) -> list[Port]:
    """The outputs that depend on a dimension: those that have it, and if an input has it all others."""
    of_inputs = dimension in NAMED or any(dimension in symbols(port) for port in operation.inputs)
    local = LOCAL.get(
        (operation.name, dimension), tuple(port.name for port in operation.outputs if port.type != "text")
    )
    return [port for port in operation.outputs if port.name in local and (of_inputs or dimension in symbols(port))]


def _is_caught(dimension: str, port: Port, k: int, vectors: Iterable[Vector]) -> bool:
    """Whether a vector fails what ends at k, by one output."""
    for vector in vectors:
        expectation = vector.expected[port.name]
        if not isinstance(expectation, NO_ARRAYS):
            answer = truncated(vector, dimension, port, k)
            if answer is None or not expectation.judge(answer).passed:
                return True
    return False


def truncated(vector: Vector, dimension: str, port: Port, k: int) -> Array | None:
    """An output of an implementation that ends at k in a dimension; None if it finds nothing to answer."""
    expectation = vector.expected[port.name]
    dtype = expectation.dtype if isinstance(expectation, Bounded) else None
    whole = np.array(expectation.value, dtype)
    if dimension in symbols(port):
        whole[(slice(None),) * symbols(port).index(dimension) + (slice(k, None),)] = 0
        return whole
    if dimension == PIXELS and symbols(port)[:2] == ["H", "W"]:
        whole.reshape(-1, whole.shape[-1] if whole.ndim > 2 else 1)[k:] = 0
        return whole
    if (vector.operation.name, dimension) == ("select_key_frames", "T"):
        return whole[whole < k]
    return _answer(vector, dimension, k).get(port.name)


_ANSWERS: dict[tuple[str, str, int], Values] = {}


def _answer(vector: Vector, dimension: str, k: int) -> Values:
    """gsvc_ref's answer when inputs from k on are left out; None if it refuses them."""
    key = (vector.id, dimension, k)
    if key not in _ANSWERS:
        _ANSWERS.clear()  # only the outputs of one vector are asked for one after the other
        try:
            with np.errstate(all="ignore"):
                _ANSWERS[key] = (NAMED[dimension].answer if dimension in NAMED else _without)(vector, k, dimension)
        except Exception:  # whatever becomes of an implementation that reads zeros
            _ANSWERS[key] = {}
    return _ANSWERS[key]


def _without(vector: Vector, k: int, dimension: str) -> Values:
    """The answer for inputs that are zero from k on."""
    inputs = dict(vector.inputs)
    for port in vector.operation.inputs:
        if dimension in symbols(port):
            inputs[port.name] = inputs[port.name].copy()
            inputs[port.name][(slice(None),) * symbols(port).index(dimension) + (slice(k, None),)] = 0
    return vector.operation.reference(**inputs)


# --- Dimensions that no shape shows ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Named:
    """A dimension that no shape shows: the operations that have it, its size in a vector, and a truncated answer."""

    applies: Callable[[Operation], bool]
    size: Callable[[Vector], int]
    answer: Callable[[Vector, int, str], Values]


def _has_pixels(operation: Operation) -> bool:
    return any(symbols(port)[:2] == ["H", "W"] for port in (*operation.inputs, *operation.outputs))


def _pixels(vector: Vector) -> int:
    return size(vector, "H") * size(vector, "W")


def _without_pixels(vector: Vector, k: int, dimension: str) -> Values:
    """The answer for pictures that are black from pixel k on, in the order of rows."""
    inputs = dict(vector.inputs)
    for port in vector.operation.inputs:
        if symbols(port)[:2] == ["H", "W"]:
            whole = inputs[port.name] = inputs[port.name].copy()
            whole.reshape(-1, *whole.shape[2:])[k:] = 0
    return vector.operation.reference(**inputs)


def _draws_splats(operation: Operation) -> bool:
    return operation.name.startswith("render_")


def _on_one_tile(vector: Vector) -> int:
    """Splats of a frame that is one tile; 0 for a larger one."""
    if "residual" in vector.inputs:
        height, width = vector.inputs["residual"].shape[:2]
    else:
        width, height = vector.inputs["width"], vector.inputs["height"]
    return len(vector.inputs["parameters"]) if max(width, height) <= TILE else 0


def _without_splats(vector: Vector, k: int, dimension: str) -> Values:
    """The answer of a tile that holds the first k splats."""
    answer = vector.operation.reference(**{**vector.inputs, "parameters": vector.inputs["parameters"][:k]})
    if "gradients" in answer:
        left_out = len(vector.inputs["parameters"]) - k
        answer["gradients"] = np.concatenate([answer["gradients"], np.zeros((left_out, 8), np.float32)])
    return answer


def _most_users(vector: Vector) -> int:
    """Users of the codeword of the first stage that has most."""
    return int(np.bincount(vector.inputs["indices"][:, 0], minlength=1).max()) if len(vector.inputs["x"]) else 0


def _without_users(vector: Vector, k: int, dimension: str) -> Values:
    """The answer when the users of one codeword beyond the first k are forgotten."""
    indices = vector.inputs["indices"]
    beyond = np.flatnonzero(indices[:, 0] == np.bincount(indices[:, 0]).argmax())[k:]
    return vector.operation.reference(
        **{**vector.inputs, "x": np.delete(vector.inputs["x"], beyond, 0), "indices": np.delete(indices, beyond, 0)}
    )


@cache
def _original() -> Callable[..., Any]:
    function: Callable[..., Any] = spec.namespace()["decode_symbols"]
    return function


def _words(vector: Vector) -> int:
    """Words of a plane, of which spec.md's code tells."""
    found = [0]

    def counted(*arguments: Any) -> Any:
        found.append(len(arguments[4]))
        return _original()(*arguments)

    spec.namespace(functions={"decode_symbols": counted})["decode_plane"](**vector.inputs)
    return found[-1]


def _without_words(vector: Vector, k: int, dimension: str) -> Values:
    """The answer when words from k on are read as zero."""

    def shortened(*arguments: Any) -> Any:
        count, frequencies, precision, states, words, bit = arguments
        return _original()(count, frequencies, precision, states, words[:k] + [0] * (len(words) - k), bit)

    answer: Values = spec.namespace(functions={"decode_symbols": shortened})["decode_plane"](**vector.inputs)
    return answer


NAMED: Final[Mapping[str, Named]] = {
    PIXELS: Named(_has_pixels, _pixels, _without_pixels),
    OF_A_TILE: Named(_draws_splats, _on_one_tile, _without_splats),
    USERS: Named(lambda operation: operation.name == "rvq_update", _most_users, _without_users),
    WORDS: Named(lambda operation: operation.name == "decode_plane", _words, _without_words),
}
"""Dimensions without a symbol, by name; pixels are in the order of rows, and one splat may cover all."""
