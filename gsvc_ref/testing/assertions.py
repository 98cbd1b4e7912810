"""Assertions: decoded splats are those of a stream; what was computed is within the bounds of fp32/1 (spec.md 13)."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gsvc_base.arrays import F4, F8
from gsvc_base.errors import UsageError
from gsvc_base.exact.training_bounds import (
    adan_step_with_bound,
    loss_with_bound,
    weighted_gradients_with_bound,
)
from gsvc_base.rendering.bounds import exact_gradients_with_bound, frame_limits, render_exact_with_bound
from gsvc_base.splats import Splats
from gsvc_ref.testing.random_streams import Stream

CHANNEL_NAMES: Final = ("R", "G", "B")
PARAMETERS: Final = ("x", "y", "l11", "l21", "l22", *CHANNEL_NAMES, "w")
"""Columns of splats, and of splats with weights."""

Namer = Callable[[tuple[int, ...]], str]
"""What an element of an output is, by its index."""


@dataclass(frozen=True)
class Legal:
    """What an output may be."""

    value: F8  # the true numbers
    lowest: F8  # limits of each element, of the same shape
    highest: F8
    name: Namer  # what an element is


def assert_within_bound(operation: str, given: Any, /, **inputs: Any) -> None:
    """Assert that what an implementation computed is within the bounds of a correct binary32 implementation.

    The operation is one of ``render_sum``, ``render_frame``, ``render_gradients``, ``loss``, ``weighted_gradients`` and
    ``adan_step`` (spec.md section 4.3), and the inputs have its names and shapes: ``parameters`` is `Splats` or (N, 8).
    The true numbers and the bound of every element are found from the inputs; nothing is compiled. Operations take
    binary32: inputs of float64 are rounded to it before, so give both sides the same float32. Elements are judged as
    `gsvc-conformance` judges them; the limits of groups of gradients (spec.md 13.5) are the kit's alone.

    What was computed has any type in the shape of the output, and is compared in binary64. Of an operation with several
    outputs it is a mapping of their names to arrays, or the arrays in the order of section 4.3. An AssertionError says
    which splat, or pixel and channel, is worst, what it is, what it should be, the bound, and the ratio of error and
    bound.
    """
    __tracebackhide__ = True  # pytest shows the test instead
    if operation not in OPERATIONS:
        raise UsageError(f"there are no bounds for {operation!r}: choose one of {', '.join(OPERATIONS)}")
    legal_outputs = OPERATIONS[operation]
    try:
        inspect.signature(legal_outputs).bind(**inputs)
    except TypeError as error:
        raise UsageError(f"{operation}: {error}; name its inputs as in spec.md section 4.3") from None
    with np.errstate(over="ignore", invalid="ignore"):  # huge splats
        expected = legal_outputs(**inputs)
    for output, actual in _named(operation, given, tuple(expected)).items():
        failure = _failure(actual, expected[output])
        if failure:
            raise AssertionError(f"{operation}: {failure if len(expected) == 1 else f'{output}: {failure}'}")


def assert_same_splats(given: Sequence[Splats | ArrayLike], stream: Stream) -> None:
    """Assert that a decoder reconstructed the splats of a stream, bit for bit (R-8-2).

    `given` has the splats of each frame, `Splats` or (N, 8) f4 in the columns of `Splats.to_array`. An AssertionError
    names the first frame and splat that differ, the parameter, what was given and what was expected, with their bits.
    """
    __tracebackhide__ = True  # pytest shows the test instead
    if len(given) != len(stream.splats):
        raise AssertionError(f"{len(given)} frames were given, expected {len(stream.splats)}")
    for frame, (splats, expected) in enumerate(zip(given, stream.splats, strict=True)):
        failure = _difference(splats, expected.to_array())
        if failure:
            raise AssertionError(f"frame {frame}{failure}")


def _difference(given: Splats | ArrayLike, expected: F4) -> str:
    """Where the splats of a frame differ first from (N, 8) f4, or nothing."""
    array = given.to_array() if isinstance(given, Splats) else np.asarray(given)
    if array.shape != expected.shape:
        return f": the shape is {array.shape}, expected {expected.shape}"
    if array.dtype != np.float32:
        return f": the type is {array.dtype}, expected float32"
    bits, expected_bits = (np.ascontiguousarray(numbers, "<f4").view("<u4") for numbers in (array, expected))
    differ = np.argwhere(bits != expected_bits)
    if not len(differ):
        return ""
    splat, column = (int(place) for place in differ[0])
    count = f" ({len(differ)} of {expected_bits.size} parameters differ)" if len(differ) > 1 else ""
    return (
        f", splat {splat}: {PARAMETERS[column]} is {array[splat, column]:.9g} (0x{bits[splat, column]:08x}), expected "
        f"{expected[splat, column]:.9g} (0x{expected_bits[splat, column]:08x}){count}"
    )


def _named(operation: str, given: Any, names: Sequence[str]) -> Mapping[str, Any]:
    if isinstance(given, Mapping):
        outputs: Mapping[str, Any] = given
    elif len(names) == 1:
        outputs = {names[0]: given}
    else:
        arrays = given if isinstance(given, tuple | list) else (given,)
        outputs = dict(zip(names, arrays, strict=False)) if len(arrays) == len(names) else {}
    if set(outputs) != set(names):
        raise AssertionError(
            f"{operation} has the outputs {', '.join(names)}; give all of them, in this order or by name"
        )
    return outputs


def _failure(actual: Any, legal: Legal) -> str:
    """What is wrong with an output, or nothing."""
    array = np.asarray(actual)
    if array.shape != legal.value.shape:
        return f"the shape is {array.shape}, expected {legal.value.shape}"
    if array.dtype.kind not in "fiu":
        return f"the type is {array.dtype}, expected numbers"
    wide = array.astype(np.float64)
    wrong = ~((wide >= legal.lowest) & (wide <= legal.highest))  # so a NaN is wrong
    wrong |= np.isinf(wide)
    if not wrong.any():
        return ""
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        error = abs(wide - legal.value)
        allowed = np.where(wide < legal.value, legal.value - legal.lowest, legal.highest - legal.value)
        ratio = np.where(wrong, np.where(np.isfinite(wide), error / allowed, np.inf), -1.0)
    among = np.where(ratio == ratio.max(), np.nan_to_num(error, nan=np.inf), -1.0)  # bounds of 0 have equal ratios
    place = tuple(int(i) for i in np.unravel_index(int(np.argmax(among)), ratio.shape))
    is_wrong = f"{legal.name(place)} is {wide[place]:.9g}, expected {legal.value[place]:.9g}"
    bound = f"{ratio[place]:.3g} times the bound {allowed[place]:.3g}" if allowed[place] else "and must be none"
    count = f" ({np.count_nonzero(wrong)} of {wrong.size} elements are wrong)" if wrong.size > 1 else ""
    return f"{is_wrong}: the error is {error[place]:.3g}, {bound}{count}"


def _within(value: F8, bound: F8, name: Namer) -> Legal:
    return Legal(value, value - bound, value + bound, name)


def _pixel(place: tuple[int, ...]) -> str:
    row, column, channel = place
    return f"{CHANNEL_NAMES[channel]} of the pixel in column {column}, row {row}"


def _gradient(place: tuple[int, ...]) -> str:
    return f"the gradient of {PARAMETERS[place[1]]} of splat {place[0]}"


def _of_row(place: tuple[int, ...]) -> str:
    return "[" + ", ".join(str(i) for i in place) + "]"


def _render_sum(parameters: Splats | ArrayLike, width: int, height: int) -> dict[str, Legal]:
    return {"sum": _within(*render_exact_with_bound(Splats.of(parameters), width, height), _pixel)}


def _render_frame(parameters: Splats | ArrayLike, width: int, height: int, bit_depth: int) -> dict[str, Legal]:
    C, bound = render_exact_with_bound(Splats.of(parameters), width, height)
    value = np.rint(np.clip(C, 0, 1) * (2**bit_depth - 1))
    return {"frame": Legal(value, *frame_limits(C, bound, bit_depth), _pixel)}


def _render_gradients(parameters: Splats | ArrayLike, residual: ArrayLike) -> dict[str, Legal]:
    return {"gradients": _within(*exact_gradients_with_bound(Splats.of(parameters), residual), _gradient)}


def _loss(picture: ArrayLike, target: ArrayLike) -> dict[str, Legal]:
    C, wanted = _narrow(picture), _narrow(target)
    if C.shape != wanted.shape or C.ndim != 3 or C.shape[2] != 3 or not C.size:
        raise UsageError(f"the picture has shape {C.shape} and the target {wanted.shape}; both must be (H, W, 3)")
    outputs = loss_with_bound(C, wanted)
    return {"loss": _within(*outputs["loss"], lambda _: "it"), "residual": _within(*outputs["residual"], _pixel)}


def _weighted_gradients(values: ArrayLike, gradients: ArrayLike) -> dict[str, Legal]:
    outputs = weighted_gradients_with_bound(_narrow(values), _narrow(gradients))
    return {"gradients": _within(*outputs["gradients"], _gradient)}


def _adan_step(
    parameters: ArrayLike,
    gradients: ArrayLike,
    m: ArrayLike,
    v: ArrayLike,
    n: ArrayLike,
    previous: ArrayLike,
    steps: ArrayLike,
    rates: ArrayLike,
    units: ArrayLike,
    beta1: float,
    beta2: float,
    beta3: float,
    epsilon: float,
) -> dict[str, Legal]:
    p, g, of_m, of_v, of_n, before = (_narrow(part) for part in (parameters, gradients, m, v, n, previous))
    taken = np.asarray(steps, np.int64)
    outputs = adan_step_with_bound(
        p, g, of_m, of_v, of_n, before, taken, _narrow(rates), _narrow(units), beta1, beta2, beta3, epsilon
    )
    outputs["steps"] = (taken.astype(np.float64) + 1, np.zeros(taken.shape, np.float64))
    return {name: _within(*output, _of_row) for name, output in outputs.items()}


def _narrow(values: ArrayLike) -> NDArray[np.float32]:
    return np.asarray(values, np.float32)


OPERATIONS: Final[dict[str, Callable[..., dict[str, Legal]]]] = {
    "render_sum": _render_sum,
    "render_frame": _render_frame,
    "render_gradients": _render_gradients,
    "loss": _loss,
    "weighted_gradients": _weighted_gradients,
    "adan_step": _adan_step,
}
"""The operations with bounds, and what gives the legal outputs of each."""
