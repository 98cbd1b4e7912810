"""Expectations of an output, and the judgement of an actual one: the comparators of the conformance kit.

- `Exact`: the same numbers, type and shape; -0 and +0 are different where the output is of floating point.
- `Decision`: the same numbers, or the recorded alternative where the decision lies within its own rounding error.
- `Bounded`: within the bound of that very element, and finite unless the expected number is infinite; optionally the
  sums over groups of columns, too.
- `Interval`: within the lowest and the highest value that the bounded class implies.
- `Refusal`: the kind of error; its rule and bit offset where the implementation is asked for them.
- `Encoding`: a stream that the decoder inside spec.md decodes, with what an encoder was asked for.
- `Rate`: the size in bits of the stream beside it.

A judgement never depends on what was judged before. NaN, another type or another shape always fail.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Final, Literal, Self

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from gsvc_conformance.encoding import Task

Array = NDArray[Any]
CheckClass = Literal["exact", "decision", "bounded", "interval", "refusal", "encoding", "rate"]

RELATIVE_L2: Final = 1e-5
"""Maximum relative L2 error of a group of gradients: single elements may lose more, all together not."""

FEW_PLACES: Final = 64
"""Maximum error, in units in the last place, that is one of arithmetic and not of a wrong formula."""

APART: Final = 2.0
"""The largest error is told of, too, where it is this many times that of the element with the largest ratio."""

RELATIVE_BIAS: Final = 1e-6
"""Maximum signed sum of the errors of a group, as a fraction of the sum of magnitudes: finds a wrong factor."""


@dataclass(frozen=True)
class Judgement:
    """Whether an output is as expected.

    Attributes
    ----------
    passed
        The verdict.
    message
        A sentence for people: what differs, where, by how much; empty if passed.
    ratio
        The worst error as a multiple of what is allowed, or None for checks without a measure.
    place
        Index of the worst element, or None.
    wrong
        The number of wrong elements.
    """

    passed: bool
    message: str = ""
    ratio: float | None = None
    place: tuple[int, ...] | None = None
    wrong: int = 0


def _form(expected: Array, actual: object) -> Judgement | None:
    """The failure of something that is no array of the expected type and shape, or None."""
    if type(actual) is not np.ndarray:  # of subclasses, a masked array answers no comparison with True
        return Judgement(False, f"is {type(actual).__name__}, not an array of {expected.dtype} {expected.shape}")
    if actual.dtype != (dtype := expected.dtype.newbyteorder("=")):
        return Judgement(False, f"has type {actual.dtype}; it must be {dtype}")
    if actual.shape != expected.shape:
        return Judgement(False, f"has shape {actual.shape}; it must be {expected.shape}")
    return None


def _as_far(expectation: "OfArrays", failure: Judgement, actual: object) -> Judgement:
    """The failure of an array with another number of items, and whether those are right that both have."""
    right = expectation.value
    if not isinstance(actual, np.ndarray) or not 0 < actual.ndim == right.ndim or actual.shape[1:] != right.shape[1:]:
        return failure
    common = min(len(actual), len(right))
    if common == 0 or len(actual) == len(right):  # it has another type
        return failure
    parts = {name: part for name, part in vars(expectation).items() if isinstance(part, np.ndarray) and part.ndim}
    begin = replace(expectation, **{name: part[:common] for name, part in parts.items()})  # type: ignore[arg-type]
    verdict = begin.judge(np.ascontiguousarray(actual[:common]))
    said = "right" if verdict.passed else f"wrong: it {verdict.message}"
    return replace(failure, message=f"{failure.message}; the first {common} are {said}")


def _first(wrong: Array) -> tuple[int, ...]:
    return tuple(int(i) for i in np.argwhere(wrong)[0])


def _differing(expected: Array, actual: Array, wrong: Array) -> Judgement:
    place, count = _first(wrong), int(np.count_nonzero(wrong))
    at = f" at {list(place)}" if place else ""
    of = f" ({count} of {wrong.size} are wrong)" if wrong.size > 1 else ""
    by = _last_places(expected[wrong], actual[wrong])
    return Judgement(False, f"is {actual[place]!s}{at}, expected {expected[place]!s}{of}{by}", None, place, count)


def _last_places(expected: Array, actual: Array) -> str:
    """The difference of floating-point numbers in units in the last place, in words, if it is small."""
    if expected.dtype.kind != "f" or not (np.isfinite(expected).all() and np.isfinite(actual).all()):
        return ""
    with np.errstate(over="ignore"):
        apart = abs(actual.astype(np.float64) - expected) / np.spacing(abs(expected)).astype(np.float64)
    most = float(apart.max())
    if most == 0:
        return ": a zero has the other sign"
    if most > FEW_PLACES:
        return ""
    return (
        f": at most {most:.3g} units in the last place, so arithmetic is fused, reordered, flushed or rounded otherwise"
    )


def _bits(array: Array) -> Array:
    """The array as integers of the same size, so that NaN and zeros compare by their bits."""
    return array.view(f"u{array.dtype.itemsize}") if array.dtype.kind == "f" else array


@dataclass(frozen=True, eq=False)
class Exact:
    """An output that is fixed to the bit."""

    value: Array
    check: ClassVar[CheckClass] = "exact"

    def judge(self, actual: object) -> Judgement:
        """Compare bit for bit."""
        failure = _form(self.value, actual)
        if failure or not isinstance(actual, np.ndarray):
            return _as_far(self, failure or Judgement(False), actual)
        expected, given = (np.ascontiguousarray(a).reshape(a.shape) for a in (self.value, actual))
        wrong = _bits(expected) != _bits(given)
        return _differing(expected, given, wrong) if wrong.any() else Judgement(True)

    def parts(self) -> dict[str, Array]:
        """The arrays to store."""
        return {"": self.value}


@dataclass(frozen=True, eq=False)
class Decision:
    """Discrete results of comparisons with rounding errors.

    Attributes
    ----------
    value
        The decisions of exact arithmetic.
    alternative
        The other legal result of each element, equal to `value` where the margin exceeds the guard; None: nowhere.
    margin, guard
        The least margin of all decisions without an alternative, and the largest error that it had to exceed, in the
        unit of the decision; both for the reader.
    """

    value: Array
    alternative: Array | None = None
    margin: float | None = None
    guard: float | None = None
    check: ClassVar[CheckClass] = "decision"

    def judge(self, actual: object) -> Judgement:
        """Compare with both."""
        failure = _form(self.value, actual)
        if failure or not isinstance(actual, np.ndarray):
            return _as_far(self, failure or Judgement(False), actual)
        wrong = actual != self.value
        if self.alternative is not None:
            wrong = wrong & (actual != self.alternative)
        return _differing(self.value, actual, np.asarray(wrong)) if np.any(wrong) else Judgement(True)

    def parts(self) -> dict[str, Array]:
        """The arrays to store."""
        some = self.alternative is not None and not np.array_equal(self.alternative, self.value)
        return {"": self.value, "alternative": self.alternative} if some and self.alternative is not None else {
            "": self.value
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Bounded:
    """Numbers with an error bound of their own.

    Attributes
    ----------
    value
        The oracle's, f8; where it is infinite, nothing else is right.
    bound
        f8, the same shape; infinite where any finite number is allowed.
    dtype
        The type that an implementation returns.
    groups
        Columns (of the last axis) whose errors are judged together too: relative L2 and signed bias.
    may_overflow
        Whether an element with an infinite bound may be infinite or NaN.
    """

    value: Array
    bound: Array
    dtype: str = "<f4"
    groups: tuple[tuple[int, int], ...] = field(default=())
    may_overflow: bool = False
    check: ClassVar[CheckClass] = "bounded"

    def judge(self, actual: object) -> Judgement:
        """Compare each element with its bound, then the groups."""
        failure = _form(np.empty(self.value.shape, self.dtype), actual)
        if failure or not isinstance(actual, np.ndarray):
            return _as_far(self, failure or Judgement(False), actual)
        if actual.size == 0:
            return Judgement(True, ratio=0.0)
        wide = actual.astype(np.float64)
        same_infinity = np.isinf(wide) & (wide == self.value)
        finite = np.isfinite(wide) & np.isfinite(self.value)
        wrong_kind = ~(finite | same_infinity | (self.may_overflow & np.isinf(self.bound)))
        if wrong_kind.any():
            place = _first(wrong_kind)
            at = f" at {list(place)}" if place else ""
            message = f"is {actual[place]!s}{at}, expected {self.value[place]:.9g}"
            return Judgement(False, message, np.inf, place, int(np.sum(wrong_kind)))
        value = np.where(finite, self.value, 0.0)
        signed = np.where(finite, wide, 0.0) - value
        error = abs(signed)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            ratio = np.where(error == 0, 0.0, error / np.asarray(self.bound, np.float64))
        flat = int(np.argmax(ratio))
        place = tuple(int(i) for i in np.unravel_index(flat, ratio.shape))
        worst, wrong = float(ratio[place]), int(np.count_nonzero(~(ratio <= 1)))
        if wrong:
            return Judgement(False, self._sentence(actual, error, place, worst, wrong), worst, place, wrong)
        return self._judge_groups(value, signed, worst, place)

    def _sentence(self, actual: Array, error: Array, place: tuple[int, ...], worst: float, wrong: int) -> str:
        at = f" at {list(place)}" if place else ""
        of = f" ({wrong} of {actual.size} are wrong)" if actual.size > 1 else ""
        bound = np.asarray(self.bound)[place]
        by = f"{worst:.3g} times the bound {bound:.3g}" if bound > 0 else "and must be none"
        said = f"is {actual[place]!s}{at}, expected {self.value[place]:.9g}: the error is {error[place]:.3g}, {by}{of}"
        most = tuple(int(i) for i in np.unravel_index(int(np.argmax(error)), error.shape))
        if error[most] < APART * error[place]:
            return said
        there = f"{actual[most]!s} at {list(most)}, expected {self.value[most]:.9g}"
        return f"{said}; the largest error is {error[most]:.3g}: {there}"

    def _judge_groups(self, value: Array, signed: Array, worst: float, place: tuple[int, ...]) -> Judgement:
        for first, end in self.groups:
            expected, error = value[..., first:end], signed[..., first:end]
            measures = {
                "relative L2 error": (float(np.linalg.norm(error)), RELATIVE_L2 * float(np.linalg.norm(expected))),
                "signed bias": (abs(float(np.sum(error))), RELATIVE_BIAS * float(np.sum(abs(expected)))),
            }
            for name, (measured, allowed) in measures.items():
                if not measured <= allowed:
                    ratio = measured / allowed if allowed else np.inf
                    of = f"the {name} of columns {first}..{end - 1}"
                    message = f"is off as a whole: {of} is {ratio:.3g} times what is allowed"
                    return Judgement(False, message, ratio, place, 0)
        return Judgement(True, ratio=worst, place=place)

    def parts(self) -> dict[str, Array]:
        """The arrays to store; a bound is rounded up to binary32."""
        with np.errstate(over="ignore"):  # infinity is a larger bound
            narrow = np.asarray(self.bound).astype("<f4")
        low = narrow < self.bound
        narrow = np.where(low, np.nextafter(narrow, np.float32(np.inf)), narrow).astype("<f4")
        return {"": np.asarray(self.value, "<f8"), "bound": narrow}


@dataclass(frozen=True, eq=False)
class Interval:
    """Integers (frames) that may be anything from `lowest` to `highest`; `value` is what the definition gives."""

    value: Array
    lowest: Array
    highest: Array
    check: ClassVar[CheckClass] = "interval"

    def judge(self, actual: object) -> Judgement:
        """Compare with both ends."""
        failure = _form(self.value, actual)
        if failure or not isinstance(actual, np.ndarray):
            return _as_far(self, failure or Judgement(False), actual)
        wrong = (actual < self.lowest) | (actual > self.highest)
        if not np.any(wrong):
            return Judgement(True)
        error = abs(actual.astype(np.int64) - self.value.astype(np.int64))
        worst = tuple(int(i) for i in np.unravel_index(int(np.argmax(np.where(wrong, error, -1))), wrong.shape))
        rms = float(np.sqrt(np.mean(np.square(error, dtype=np.float64))))
        message = (
            f"is {actual[worst]} at {list(worst)}, expected {self.lowest[worst]} to {self.highest[worst]} "
            f"({int(np.count_nonzero(wrong))} of {wrong.size} are wrong; peak {int(error.max())}, RMS {rms:.3g} steps)"
        )
        return Judgement(False, message, None, worst, int(np.count_nonzero(wrong)))

    def parts(self) -> dict[str, Array]:
        """The arrays to store."""
        return {"": self.value, "lowest": self.lowest, "highest": self.highest}


@dataclass(frozen=True)
class Refusal:
    """The outcome of reading a stream: "" or "KIND RULE BIT".

    Attributes
    ----------
    value
        The whole text.
    in_full
        Whether rule and bit are compared as well as the kind; so for gsvc_ref and the decoder inside spec.md.
    """

    value: str
    in_full: bool = False
    check: ClassVar[CheckClass] = "refusal"

    def judge(self, actual: object) -> Judgement:
        """Compare kind, or everything."""
        if not isinstance(actual, str):
            return Judgement(False, f"is {type(actual).__name__}, not a text")
        expected, given = self.value.split(), actual.split()
        same = expected == given if self.in_full else expected[:1] == given[:1]
        if same:
            return Judgement(True)
        wanted = self.value or "no error"
        return Judgement(False, f"is {actual or 'no error'!r}, expected {wanted!r}", None, None, 1)


@dataclass(frozen=True, eq=False)
class Encoding:
    """A stream that an encoder makes: any one that does what the task says."""

    task: "Task"
    check: ClassVar[CheckClass] = "encoding"

    @property
    def value(self) -> Array:
        """The source frames, (T, H, W, 3) u1 or u2."""
        return self.task.frames

    def judge(self, actual: object) -> Judgement:
        """Decode it with the decoder inside spec.md."""
        from gsvc_conformance.encoding import judge

        if not isinstance(actual, bytes):
            return Judgement(False, f"is {type(actual).__name__}, not bytes")
        verdict = judge(actual, self.task)
        return Judgement(not verdict.message, verdict.message, verdict.ratio, wrong=int(bool(verdict.message)))

    def parts(self) -> dict[str, Array]:
        """The arrays to store: none, as the task is the inputs."""
        return {}


@dataclass(frozen=True)
class Rate:
    """The size of a stream that stands beside it, in bits: all of its bytes, with headers, index and end."""

    of: str = "stream"
    stream: object = None
    check: ClassVar[CheckClass] = "rate"

    @property
    def value(self) -> Array:
        """The bits of the stream, i8 (); 0 without one."""
        return np.array(8 * len(self.stream) if isinstance(self.stream, bytes) else 0, np.int64)

    def beside(self, outputs: Mapping[str, Any]) -> Self:
        """The expectation, now that the stream is there."""
        return replace(self, stream=outputs.get(self.of))

    def judge(self, actual: object) -> Judgement:
        """Compare with the size of the stream."""
        failure = _form(self.value, actual)
        if failure or not isinstance(actual, np.ndarray):
            return failure or Judgement(False)
        if not isinstance(self.stream, bytes):
            return Judgement(False, f"is {actual}, and there is no {self.of} beside it")
        if actual != self.value:
            whole = f"{self.value}: the file of {self.of} has {len(self.stream)} bytes"
            return Judgement(False, f"is {actual}, expected {whole}", wrong=1)
        return Judgement(True)

    def parts(self) -> dict[str, Array]:
        """The arrays to store: none."""
        return {}


OfArrays = Exact | Decision | Bounded | Interval
Expectation = OfArrays | Refusal | Encoding | Rate
EXPECTATIONS: Final = {kind.check: kind for kind in (Exact, Decision, Bounded, Interval, Refusal, Encoding, Rate)}
NO_ARRAYS: Final = (Refusal, Encoding, Rate)
"""Expectations without an expected number for each element."""
