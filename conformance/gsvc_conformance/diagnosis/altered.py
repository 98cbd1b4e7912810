"""Right arithmetic on inputs that were taken for something else: the code of spec.md, with one input altered."""

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from typing import Any, Final

import numpy as np

from gsvc_conformance import spec
from gsvc_conformance.diagnosis.failures import Array, Failure, Part, wrong_outputs
from gsvc_conformance.diagnosis.regions import Candidate
from gsvc_conformance.mutants import time_limit
from gsvc_conformance.operation import Values
from gsvc_conformance.vector import Vector

Change = Callable[[Mapping[str, Any]], Mapping[str, Any]]
"""From the inputs those that are altered."""

MAX_BYTES: Final = 1_000_000
"""Larger inputs are not tried again and again."""

SMALL: Final = 64
"""Outputs of fewer integers agree with some altered input by chance: then all failures must show it."""

ALL: Final = 0.9
"""All failures, or nearly so."""

SECONDS: Final = 2.0
"""A trial that takes longer is given up."""


def altered_candidates(failure: Failure, part: Part) -> list[Candidate]:
    """Which altered inputs give a wrong output."""
    least = ALL if part.given.dtype.kind in "iu" and part.right.size < SMALL else 0.0
    counts = 1.0 if part.right.size > 1 else 0.5 if part.mine.any() else 0.0
    return [
        Candidate(sentence, None, least, counts)
        for sentence, theirs in _tried(failure.vector)
        if _same(part, theirs.get(part.name))
    ]


def altered_form(failure: Failure) -> list[str]:
    """Which altered inputs give outputs of just the shapes and values that were given, where these have wrong shapes."""
    wrong = wrong_outputs(failure.vector, failure.outputs)
    return [
        sentence for sentence, theirs in _tried(failure.vector)
        if wrong and all(_equal_arrays(theirs.get(name), failure.outputs.get(name)) for name in wrong)
    ]  # fmt: skip


def _tried(vector: Vector) -> list[tuple[str, Values]]:
    size = sum(value.nbytes for value in vector.inputs.values() if isinstance(value, np.ndarray))
    return _trials(vector) if size <= MAX_BYTES else []


def _same(part: Part, theirs: Any) -> bool:
    """Whether an output agrees; what is the same everywhere accounts for nothing."""
    if not isinstance(theirs, np.ndarray) or theirs.shape != part.right.shape or theirs.dtype != part.given.dtype:
        return False
    varied = theirs.size == 1 or bool((theirs != theirs.flat[0]).any())
    return varied and part.agrees(theirs.astype(np.float64))


def _equal_arrays(theirs: Any, mine: Any) -> bool:
    return isinstance(theirs, np.ndarray) and isinstance(mine, np.ndarray) and np.array_equal(theirs, mine)


@lru_cache(maxsize=128)
def _trials(vector: Vector) -> list[tuple[str, Values]]:
    """The outputs of spec.md's code for each altered input of a vector that it can take."""
    tried = [
        (sentence, _outputs(vector.operation.name, vector.inputs, change))
        for sentence, change in _changes(vector.inputs)
    ]
    return [(sentence, theirs) for sentence, theirs in tried if theirs is not None]


def _outputs(operation: str, inputs: Values, change: Change) -> Values | None:
    try:
        with np.errstate(all="ignore"), time_limit(SECONDS):
            new = change(inputs)
            if all(_equal(new[name], inputs[name]) for name in new):
                return None
            given: Values = spec.namespace()[operation](**{**inputs, **new})
            return given
    except Exception:  # what the code of spec.md makes of such inputs is its own affair
        return None


def _equal(a: Any, b: Any) -> bool:
    return np.array_equal(a, b) if isinstance(a, np.ndarray) else bool(a == b)


def _changes(inputs: Mapping[str, Any]) -> Iterator[tuple[str, Change]]:
    for name, value in inputs.items():
        for sentence, change in OF_INPUTS.get(name, ()):
            yield sentence, _of(name, change)
        if name in TABLES and isinstance(value, np.ndarray):
            for sentence, splats in SPLATS:
                yield sentence, _of_splats(name, splats)
    for names, sentence, together in TOGETHER:
        if all(name in inputs for name in names):
            yield sentence, together


def _of(name: str, change: Callable[[Any], Any]) -> Change:
    return lambda inputs: {name: change(inputs[name])}


def _of_splats(name: str, change: Callable[[Array, Mapping[str, Any]], None]) -> Change:
    return lambda inputs: {name: _splats(inputs, name, change)}


TABLES: Final = ("parameters", "values")


def _splats(inputs: Mapping[str, Any], name: str, change: Callable[[Array, Mapping[str, Any]], None]) -> Array:
    table: Array = inputs[name].copy()
    if table.ndim == 2 and table.shape[1] in (8, 9):
        change(table, inputs)
    return table


def _at(columns: Any, function: Callable[[Array], Array]) -> Callable[[Array, Mapping[str, Any]], None]:
    """A change of some columns of a table of splats."""

    def change(table: Array, inputs: Mapping[str, Any]) -> None:
        with np.errstate(all="ignore"):
            table[:, columns] = function(table[:, columns]).astype(table.dtype)

    return change


def _inside(table: Array, inputs: Mapping[str, Any]) -> None:
    """Centres held in the frame."""
    height, width = inputs["residual"].shape[:2] if "residual" in inputs else (inputs["height"], inputs["width"])
    table[:, 0], table[:, 1] = np.clip(table[:, 0], 0, width), np.clip(table[:, 1], 0, height)


def _low_pass(table: Array, inputs: Mapping[str, Any]) -> None:
    """0.3 added to the variances in x and y, as 3D splatting does."""
    with np.errstate(all="ignore"):
        a, b, c = (table[:, column].astype(np.float64) for column in (2, 3, 4))
        l11 = np.sqrt(a * a + 0.3)
        l21 = a * b / l11
        l22 = np.sqrt(b * b + c * c + 0.3 - l21 * l21)
        drawn = (a > 0) & (c > 0)
        table[drawn, 2:5] = np.stack([l11, l21, l22], axis=1)[drawn].astype(table.dtype)


def _half(values: Array) -> Array:
    return values.astype(np.float16).astype(np.float32)


def _brain(values: Array) -> Array:
    """bfloat16, cut."""
    return (np.ascontiguousarray(values).view(np.uint32) & np.uint32(0xFFFF0000)).view(np.float32)


MU, L, C = slice(0, 2), slice(2, 5), slice(5, 8)

SPLATS: Final[tuple[tuple[str, Callable[[Array, Mapping[str, Any]], None]], ...]] = (
    ("pixel centres at integer positions (mu half a pixel too far)", _at(MU, lambda v: v + 0.5)),
    ("pixel centres at integer columns (x half a pixel too far)", _at(0, lambda v: v + 0.5)),
    ("pixel centres at integer rows (y half a pixel too far)", _at(1, lambda v: v + 0.5)),
    ("pixel centres half a pixel too far, at i + 1 (mu half a pixel too small)", _at(MU, lambda v: v - 0.5)),
    ("pixel centres half a pixel too far in the columns, at i + 1", _at(0, lambda v: v - 0.5)),
    ("pixel centres half a pixel too far in the rows, at j + 1", _at(1, lambda v: v - 0.5)),
    ("positions cut to whole pixels", _at(MU, np.floor)),
    ("positions rounded to whole pixels", _at(MU, np.rint)),
    ("x and y of the centres exchanged", _at([0, 1], lambda v: v[:, ::-1])),
    ("centres outside of the frame moved to its edge", _inside),
    ("0.3 added to both variances, the low-pass filter of 3D splatting", _low_pass),
    ("positions in binary16", _at(MU, _half)),
    ("Cholesky factors in binary16", _at(L, _half)),
    ("colours in binary16", _at(C, _half)),
    ("all parameters in binary16", _at(slice(0, 8), _half)),
    ("all parameters in bfloat16", _at(slice(0, 8), _brain)),
    ("l21 with the wrong sign", _at(3, np.negative)),
    ("l21 left out", _at(3, np.zeros_like)),
    ("l11 and l22 exchanged", _at([2, 4], lambda v: v[:, ::-1])),
    ("the factors in the order l11, l22, l21", _at([3, 4], lambda v: v[:, ::-1])),
    ("factors squared: l11 and l22 taken for standard deviations where variances are", _at([2, 4], np.square)),
    ("the roots of factors: l11 and l22 taken for variances", _at([2, 4], np.sqrt)),
    ("exp(-u.u/4) in place of exp(-u.u/2)", _at(L, lambda v: v * np.float32(2**0.5))),
    ("exp(-u.u) in place of exp(-u.u/2)", _at(L, lambda v: v / np.float32(2**0.5))),
    ("magnitudes of the colours: negative ones made positive", _at(C, np.abs)),
    ("negative colours taken as zero", _at(C, lambda v: np.maximum(v, 0))),
    ("colours above 1 taken as 1", _at(C, lambda v: np.minimum(v, 1))),
    ("colours clamped to 0..1 (negative ones, and those above 1)", _at(C, lambda v: np.clip(v, 0, 1))),
    ("channels of the colours in the order B, G, R", _at([5, 6, 7], lambda v: v[:, ::-1])),
    ("negative weights made positive", _at(slice(8, 9), np.abs)),
)
"""Tables that the table of splats may be taken for."""


def _reshaped(array: Array) -> Array:
    return np.ascontiguousarray(array.transpose(1, 0, 2)).reshape(array.shape)


PICTURES: Final[tuple[tuple[str, Callable[[Array], Array]], ...]] = (
    ("transposed (rows and columns exchanged)", _reshaped),
    ("upside down (the y axis upwards)", lambda a: a[::-1]),
    ("with the x axis to the left", lambda a: a[:, ::-1]),
    ("with channels in the order B, G, R", lambda a: a[:, :, ::-1]),
    ("clamped to 0..1", lambda a: np.clip(a, 0, 1)),
    ("clamped to -1..1", lambda a: np.clip(a, -1, 1)),
    ("of red alone", lambda a: a * np.array([1, 0, 0], a.dtype)),
    ("of green alone", lambda a: a * np.array([0, 1, 0], a.dtype)),
    ("of blue alone", lambda a: a * np.array([0, 0, 1], a.dtype)),
    ("of the mean of the channels", lambda a: np.repeat(a.mean(axis=2, keepdims=True), 3, axis=2).astype(a.dtype)),
    ("in binary16", lambda a: a.astype(np.float16).astype(a.dtype)),
    *(
        (f"one pixel too far {words}", lambda a, step=step, axis=axis: np.roll(a, step, axis))
        for words, step, axis in (("down", 1, 0), ("up", -1, 0), ("to the right", 1, 1), ("to the left", -1, 1))
    ),
)
"""Pictures that a picture among the inputs may be taken for."""


def _numbers(name: str, *values: float) -> tuple[tuple[str, Callable[[Any], Any]], ...]:
    """As if a number had another value."""
    return tuple((f"{name} taken as {value}", lambda _, value=value: value) for value in values)


def _next(name: str) -> tuple[tuple[str, Callable[[Any], Any]], ...]:
    return (f"{name} taken as one more", lambda v: v + 1), (f"{name} taken as one less", lambda v: v - 1)


def _columns(name: str, labels: str) -> tuple[tuple[str, Callable[[Array], Array]], ...]:
    return ((f"{labels} of {name} in reverse order", lambda a: a[..., ::-1].copy()),)


OF_INPUTS: Final[Mapping[str, tuple[tuple[str, Callable[[Any], Any]], ...]]] = {
    **{name: tuple((f"the {name} {words}", change) for words, change in PICTURES)
       for name in ("residual", "picture", "target")},
    "bit_depth": _numbers("bit_depth", 8), "bits": _next("bits"), "removed": _next("the number removed"),
    "patience": _next("patience"), "window": _next("window"), "iterations": _next("the iteration"),
    "threshold": (("the threshold squared", lambda v: v * v), ("the root of the threshold", lambda v: v**0.5),
                  *_next("the threshold")),
    "guard_ratio": _numbers("guard_ratio", 0.0, 1.0),
    "losses_p": (("losses P from the frame after", lambda v: np.roll(v, -1)),),
    "tolerance": _numbers("the tolerance", 0.0),
    "decay": (("the decay taken as 1 - decay", lambda v: 1 - v), ("the decay squared", lambda v: v * v)),
    "smoothing": _numbers("smoothing", 0.0), "dead_count": _numbers("dead_count", 0.0),
    "epsilon": _numbers("epsilon", 0.0),
    **{f"beta{j}": ((f"beta{j} taken as 1 - beta{j}", lambda v: 1 - v),) for j in (1, 2, 3)},
    "units": (("units left out (taken as 1)", np.ones_like), ("units inverted", lambda v: 1 / v)),
    "rates": (("the learning rate left out (taken as 1)", np.ones_like), ("the first rate for all columns", lambda v: np.full_like(v, v[0]))),
    "steps": (("steps taken as 0: the bias corrections of the first step", np.zeros_like),
              ("bias corrections by one step too many", lambda v: np.where(v >= 0, v + 1, v)),
              ("bias corrections by one step too few", lambda v: np.maximum(v - 1, 0))),
    "previous": (("the previous gradient taken as 0", np.zeros_like), ("the previous gradient with the other sign", np.negative)),
    "weights": (("weights by their size, with the sign, in place of their magnitude", lambda v: v - v.min() + 1),),
    "scale": (("the first scale for all columns (one scale per tensor)", lambda v: np.full_like(v, v[0])),
              ("the largest scale for all columns (one scale per tensor)", lambda v: np.full_like(v, v.max())),
              ("scales inverted", lambda v: 1 / v), *_columns("scale", "columns")),
    "offset": (("the offset left out", np.zeros_like), ("the offset with the other sign", np.negative),
               ("the first offset for all columns", lambda v: np.full_like(v, v[0])), *_columns("offset", "columns")),
    "cholesky": (("Cholesky codes of 8 bits (the others cut off)", lambda v: v & 255), *_columns("the codes", "columns"),
                 ("Cholesky codes in the order l11, l22, l21", lambda v: v[:, [0, 2, 1]])),
    "positions": (("bytes of the positions in the other order", lambda v: v.byteswap()), *_columns("the positions", "x and y")),
    "survivors": (("survivors ignored: the first splats of the reference in place of those that survive",
                   lambda v: np.sort(v)[::-1].copy()),
                  ("the survivor map from the last splat on", lambda v: v[::-1].copy())),
    "codebook_sizes": (("the stages' codebooks in reverse order", lambda v: v[::-1].copy()),),
    "indices": (("indices of the first stage for all stages", lambda v: np.repeat(v[:, :1], v.shape[1], axis=1)),
                *_columns("the indices", "stages")),
    "color_indices": (("indices of the first stage for all stages", lambda v: np.repeat(v[:, :1], v.shape[1], axis=1)),
                      *_columns("the colour indices", "stages")),
    "x": (("inputs in binary16", _half), ("the vectors' channels in reverse order", lambda v: v[:, ::-1].copy())),
    "grad_output": (("the gradient from above taken as 1", np.ones_like),),
    "matrix_coefficients": _numbers("matrix_coefficients", 1, 6, 9, 5, 4, 7, 8, 0),
    "video_full_range_flag": (("full range where the header says limited, and the other way round", lambda v: 1 - v),
                              *_numbers("video_full_range_flag", 0, 1)),
    "chroma_sample_loc_type": _numbers("chroma_sample_loc_type", 0, 1, 2, 3, 4, 5),
    "lane_count": _numbers("lane_count", 1), "entropy_precision": _numbers("entropy_precision", 12, 16),
    "robust": (("the robust rule where the plain one is asked for, and the other way round", lambda v: 1 - v),),
    "factor": _numbers("the factor", 1.0, 0.5), "interval": _next("the interval"), "fraction": _numbers("fraction", 0.1),
    "symbols": (("symbols in reverse order", lambda v: v[::-1].copy()),),
    "uniforms": (("columns of the uniform numbers in reverse order", lambda v: v[..., ::-1].copy()),),
}  # fmt: skip
"""Values that single inputs may be taken for, by name."""


def _exchanged(a: str, b: str) -> Change:
    return lambda i: {a: i[b], b: i[a]}


TOGETHER: Final[tuple[tuple[tuple[str, ...], str, Change], ...]] = (
    (("weights", "removed"), "as many kept as are to be removed", lambda i: {"removed": len(i["weights"]) - i["removed"]}),
    (("beta1", "beta2"), "beta1 and beta2 exchanged", _exchanged("beta1", "beta2")),
    (("beta2", "beta3"), "beta2 and beta3 exchanged", _exchanged("beta2", "beta3")),
    (("beta1", "beta3"), "beta1 and beta3 exchanged", _exchanged("beta1", "beta3")),
    (("width", "height", "scale"), "width and height exchanged", _exchanged("width", "height")),
    (("width", "scale"), "the width for both axes, in y too", lambda i: {"height": i["width"]}),
    (("height", "scale"), "the height for both axes, in x too", lambda i: {"width": i["height"]}),
    (("new_width", "uniforms"), "the width for both axes, in y too", lambda i: {"height": i["width"]}),
    (("uniforms", "width"), "the width for both axes, in y too", lambda i: {"height": i["width"]}),
    (("new_width", "new_height"), "width and height exchanged in the factors", lambda i: {
        "width": i["height"], "height": i["width"], "new_width": i["new_height"], "new_height": i["new_width"]}),
    (("scale", "offset"), "scale and offset exchanged", _exchanged("scale", "offset")),
    (("cb", "cr"), "Cb and Cr exchanged", _exchanged("cb", "cr")),
    *(
        (("picture", "target"), f"the {name} channel alone",
         lambda i, c=c: {name: i[name] * np.eye(3, dtype=i[name].dtype)[c] for name in ("picture", "target")})
        for c, name in enumerate(("red", "green", "blue"))
    ),
    *(
        (("x", "codebooks"), f"{name} left out of the distances",
         lambda i, c=c: {name: i[name] * (1 - np.eye(3, dtype=i[name].dtype)[c]) for name in ("x", "codebooks")})
        for c, name in enumerate(("red", "green", "blue"))
    ),
    (("first", "last"), "first and last exchanged", _exchanged("first", "last")),
)  # fmt: skip
"""Values that several inputs may be taken for together."""
