"""The places of wrong elements and of failing vectors in the inputs: only ties, only degenerate splats."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from gsvc_conformance.diagnosis.coded import SYMBOLS
from gsvc_conformance.diagnosis.failures import EXPLAINED, Failure, Mask, Part, parts, wrong_outputs
from gsvc_conformance.diagnosis.regions import Candidate, content
from gsvc_conformance.names import columns
from gsvc_conformance.vector import Vector

Conditions = Iterator[tuple[str, Any]]

COMMON: Final = 0.75
"""A condition that more of all elements meet says nothing."""

FEWEST: Final = 3
"""Minimum number of vectors that must fail, and that must pass, before what they have in common is reported."""

MIN_OF_TWO: Final = 4
"""Minimum number of vectors for two things that they have in common only together."""

NEARLY_ALL: Final = 0.9
"""Where more of the vectors that expect anything fail, what they have in common says nothing."""

SHARED: Final = 0.4
"""Minimum fraction of the failures in which a column is wrong before it is named."""

RAW: Final = ": raw bits, early or late, or what is made of them"
"""What is left to be wrong where the symbols of a stream are right."""

CODED: Final = frozenset({"bodies"})
"""Outputs whose columns set streams apart."""

OTHER_THAN: Final = " other than "
"""Words of a condition that says too little to be one of two."""

Meets = Callable[[Mapping[str, Any]], bool]
Shared = tuple[str, Meets]
"""A condition in words, and as a function of a vector's features."""


def place_candidates(failure: Failure, part: Part) -> Iterator[Candidate]:
    """Conditions that all wrong elements meet and, where they can, most of those that meet them are wrong."""
    shape = part.right.shape
    if not shape or part.wrong.all():
        return
    with np.errstate(all="ignore"):
        for words, met in _conditions(part.operation.name, part.name, failure.vector.inputs, part):
            mask = _spread(np.asarray(met), shape)
            if mask is None or not 0 < mask.mean() <= COMMON or not mask[part.wrong].all():
                continue
            able = mask & (part.wrong | content(part)[1])
            if _lines(part.wrong, able) >= EXPLAINED:
                yield Candidate(f"errors only {words}")


def _lines(wrong: Mask, mask: Mask) -> float:
    """The fraction that is wrong of the items that meet a condition: an item with any wrong element counts."""
    if wrong.ndim == 2:
        wrong, mask = np.asarray(wrong.any(axis=1)), np.asarray(mask.any(axis=1))
    return float(wrong[mask].mean())


def _spread(met: Any, shape: tuple[int, ...]) -> Mask | None:
    """A condition on elements, or on items, as a mask of the output."""
    if met.shape == shape:
        return np.asarray(met, np.bool_)
    if met.ndim < len(shape) and met.shape == shape[: met.ndim]:
        return np.broadcast_to(met.reshape(met.shape + (1,) * (len(shape) - met.ndim)), shape).copy()
    return None


def _conditions(operation: str, output: str, inputs: Mapping[str, Any], part: Part) -> Conditions:
    yield from OF_OPERATIONS.get(operation, _nothing)(inputs)
    yield from _of_numbers(inputs, part)
    right = part.right
    if right.min() < 0:
        yield "where the right number is negative", right < 0
    if part.given.dtype.kind == "f":
        yield "where the right number is infinite", np.isinf(right)
        yield "where the right number is subnormal", (right != 0) & (abs(right) < 2.0**-126)
        yield "where the right number is 0", right == 0
        yield "where the right number is above 1", right > 1
    elif right.max() > 0:
        yield "where the right number is the largest", right == right.max()
        yield "where the right number is 0", right == 0
        yield "where the right number is 256 or more", right >= 256


def _of_numbers(inputs: Mapping[str, Any], part: Part) -> Conditions:
    """The numbers that a list of integers, one of each item of the output, has at all wrong items."""
    wrong = part.wrong.reshape(len(part.wrong), -1).any(axis=1)
    for name, value in inputs.items():
        if isinstance(value, np.ndarray) and value.dtype.kind in "iu" and value.shape == wrong.shape:
            least, most = value[wrong].min(), value[wrong].max()
            numbers = f"{least}" if least == most else f"{least} to {most}"
            yield f"where {name} is {numbers}", (value >= least) & (value <= most)


def _nothing(inputs: Mapping[str, Any]) -> Conditions:
    return iter(())


def _splats(inputs: Mapping[str, Any]) -> Conditions:
    table = inputs.get("parameters", inputs.get("values")).astype(np.float64)
    x, y, l11, l21, l22 = table[:, :5].T
    size = inputs["residual"].shape[:2] if "residual" in inputs else (inputs.get("height", 0), inputs.get("width", 0))
    yield "in degenerate splats (l11 or l22 not a normal positive number)", ~(
        (l11 >= 2.0**-126) & (l22 >= 2.0**-126) & np.isfinite(l11) & np.isfinite(l22))  # fmt: skip
    if any(size):
        yield "in splats whose centre lies outside the frame", (x < 0) | (y < 0) | (x > size[1]) | (y > size[0])
    yield "in splats with a negative l21", l21 < 0
    yield "in splats with l21 other than 0", l21 != 0
    yield "in splats smaller than a pixel", (l11 < 1) | (l22 < 1)
    yield "in splats with a negative colour", (table[:, 5:8] < 0).any(axis=1)
    yield "in splats with a colour above 1", (table[:, 5:8] > 1).any(axis=1)


def _samples(inputs: Mapping[str, Any]) -> Conditions:
    total = inputs["sum"].astype(np.float64)
    scaled = np.clip(total, 0, 1) * (2 ** inputs["bit_depth"] - 1)
    yield "where the sum is below 0", total < 0
    yield "where the sum is above 1", total > 1
    yield "where the sum is outside of 0 to 1", (total < 0) | (total > 1)
    yield "where the sum is not a number", np.isnan(total)
    yield "in ties (a fraction of exactly 1/2)", scaled % 1 == 0.5


def _rows(inputs: Mapping[str, Any]) -> Conditions:
    steps = inputs["steps"]
    yield "in rows that have taken no step before", steps == 0
    yield "in rows that have taken steps before", steps > 0


def _lsq(inputs: Mapping[str, Any]) -> Conditions:
    if "x" in inputs:
        t = ((inputs["x"] - inputs["offset"]) / inputs["scale"]).astype(np.float64)
        largest = 2 ** inputs["bits"] - 1
        yield "below the range", t < 0
        yield "above the range", t > largest
        yield "outside of the range", (t < 0) | (t > largest)
        yield "at the ends of the range", (t == 0) | (t == largest)
        yield "in ties (a fraction of exactly 1/2)", t % 1 == 0.5
        yield "in ties above an even number", t % 2 == 0.5


def _halves(inputs: Mapping[str, Any]) -> Conditions:
    if "bits" in inputs:
        bits = inputs["bits"].astype(np.int64)
        yield "in subnormal numbers", (bits >> 10 & 31 == 0) & (bits & 1023 > 0)
        yield "in infinities and NaN", bits >> 10 & 31 == 31
        yield "in negative numbers", bits >> 15 == 1
        yield "in zeros", bits & 0x7FFF == 0
    elif "values" in inputs:
        size = abs(inputs["values"].astype(np.float64))
        steps = np.ldexp(size, 10 - np.maximum(np.frexp(size)[1] - 1, -14))
        yield "in numbers that are subnormal in binary16", (size < 2.0**-14) & (size > 0)
        yield "in ties (a fraction of exactly 1/2)", steps % 1 == 0.5
        yield "in negative numbers", np.signbit(inputs["values"])
        yield "in numbers that are rounded up", steps % 1 > 0.5


def _losses(inputs: Mapping[str, Any]) -> Conditions:
    picture = inputs["picture"].astype(np.float64)
    yield "where the picture is clamped", (picture < 0) | (picture > 1)


def _weights(inputs: Mapping[str, Any]) -> Conditions:
    yield "in splats with a negative weight", inputs["values"][:, 8] < 0


OF_OPERATIONS: Final[Mapping[str, Callable[[Mapping[str, Any]], Conditions]]] = {
    "render_gradients": _splats, "scale_parameters": _splats, "scale_parameters_filtered": _splats,
    "to_frame": _samples, "to_frame_deterministic": _samples,
    "adan_step": _rows, "lsq_quantize": _lsq, "lsq_gradients": _lsq, "from_half": _halves, "to_half": _halves,
    "loss": _losses, "weighted_parameters": _weights, "weighted_gradients": _weights,
}  # fmt: skip


def output_sentences(failures: Sequence[Failure]) -> dict[str, str]:
    """Which outputs are wrong, and which of their columns in most failures, by id; '' where all are, or one is all."""
    masks = {failure.vector.id: dict(_wrong_columns(failure)) for failure in failures}
    count = Counter(pair for own in masks.values() for table in own.items() for pair in _places(*table))
    total = Counter(name for own in masks.values() for name in own)
    said = {}
    for failure in failures:
        vector, outputs, _ = failure
        wrong = [name for name in wrong_outputs(vector, outputs) if name != "error"]
        right = [name for name in vector.expected if name not in wrong and name != "error"]
        told = []
        for name in wrong:
            names = columns(vector.operation, name)
            most = [column for place, column in enumerate(names) if count[name, place] >= SHARED * max(1, total[name])]
            told.append(f"{name} ({', '.join(most)})" if 0 < len(most) < len(names) else name)
        are = "are" if len(right) > 1 else "is"
        raw = RAW if SYMBOLS in right else ""
        said[vector.id] = (
            f"errors in {', '.join(told)} alone{raw}; {', '.join(right)} {are} right" if told and right else ""
        )
    return said


def _wrong_columns(failure: Failure) -> Iterator[tuple[str, Mask]]:
    """The columns of each table that have something wrong."""
    for part in parts(failure):
        if part.right.ndim == 2:
            yield part.name, np.asarray(part.wrong.any(axis=0))


def _places(name: str, mask: Mask) -> list[tuple[str, int]]:
    return [(name, int(place)) for place in np.flatnonzero(mask)]


def common_condition(failed: Sequence[Vector], passed: Sequence[Vector]) -> str:
    """The numbers and elements that all failing vectors have and no passing one has, in words; '' if there are none.

    One condition if there is one, or two together where vectors are many.
    """
    telling = len(failed) + sum(map(_varied, passed))
    if min(len(failed), len(passed)) < FEWEST or len(failed) > NEARLY_ALL * telling:
        return ""
    bad, good = ([_features(vector) for vector in vectors] for vectors in (failed, passed))
    met = [(words, {place for place, features in enumerate(good) if meets(features)})
           for words, meets in _shared_conditions(bad, good)]  # fmt: skip
    if alone := [words for words, others in met if not others]:
        return f"only vectors {alone[0]} fail"
    if min(len(failed), len(passed)) >= MIN_OF_TWO:
        met = [(words, others) for words, others in met if OTHER_THAN not in words]
        for place, (a, others) in enumerate(met):
            for b, more in met[place + 1 :]:
                if not others & more:
                    return f"only vectors {a} and {b} fail"
    return ""


def _varied(vector: Vector) -> bool:
    """Whether any array that a vector expects has different elements."""
    arrays = [expectation.value for expectation in vector.expected.values()]
    return any(isinstance(array, np.ndarray) and array.size > 0 and (array != array.flat[0]).any() for array in arrays)


def _shared_conditions(bad: Sequence[Mapping[str, Any]], good: Sequence[Mapping[str, Any]]) -> Iterator[Shared]:
    """The numbers and elements that all failing vectors have and some passing ones lack."""
    for name in sorted(set.intersection(*(set(features) for features in bad))):
        here = {features[name] for features in bad}
        there = [features[name] for features in good if name in features]
        if len(there) < len(good) and not name.startswith("whose stream"):
            continue
        if len(here) == 1:
            value = next(iter(here))
            if len(there) < len(good) or set(there) != here:
                yield (name if value is True else f"with {name} = {value}"), _equals(name, value)
        lower = [value for value in there if not isinstance(value, bool) and value < min(here)]
        higher = [value for value in there if not isinstance(value, bool) and value > max(here)]
        if lower:
            yield f"with {name} above {max(lower)}", _above(name, max(lower))
        if higher:
            yield f"with {name} below {min(higher)}", _below(name, min(higher))
        if there and len(here) > 1 and (rest := Counter(value for value in there if value not in here)):
            value = rest.most_common(1)[0][0]
            yield f"with {name}{OTHER_THAN}{value}", _differs(name, value)


def _equals(name: str, value: Any) -> Meets:
    return lambda features: name in features and features[name] == value


def _differs(name: str, value: Any) -> Meets:
    return lambda features: name in features and features[name] != value


def _above(name: str, value: Any) -> Meets:
    return lambda features: name in features and features[name] > value


def _below(name: str, value: Any) -> Meets:
    return lambda features: name in features and features[name] < value


def _features(vector: Vector) -> dict[str, Any]:
    """Numbers that may set a vector apart: its scalar inputs, the sizes of arrays, the elements of its stream."""
    found: dict[str, Any] = {}
    for name, value in vector.inputs.items():
        if isinstance(value, int | float):
            found[name] = value
        elif isinstance(value, np.ndarray) and value.ndim:
            found[f"the number of {name}" if value.ndim < 3 else f"the height of {name}"] = value.shape[0]
            if value.ndim == 3:
                found[f"the width of {name}"] = value.shape[1]
                found[f"the evenness (0) or oddness (1) of the sides of {name}"] = (value.shape[0] | value.shape[1]) & 1
    if "data" in vector.inputs and len(vector.inputs["data"]):
        found["plane_mode"] = int(vector.inputs["data"][0]) >> 6
    for name in CODED & vector.expected.keys():
        table = np.asarray(vector.expected[name].value)
        for place, column in enumerate(columns(vector.operation, name)[1:], 1):
            if len(table):
                found[f"the largest {column}"], found[f"the smallest {column}"] = (
                    int(extreme) for extreme in (table[:, place].max(), table[:, place].min())
                )
    found |= {f"whose stream has {element}": True for element in vector.manifest.get("elements", ())}
    return found
