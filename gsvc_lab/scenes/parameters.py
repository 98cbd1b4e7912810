"""Parameters of scenes: what each may be, checked once, whether it comes from Python or from a file.

A frozen dataclass that inherits from `Checked` declares its fields with `parameter`:

    @dataclass(frozen=True)
    class Zoom(CameraEffect):
        to: float = parameter(number(0.01, 4), "how much of the picture is seen at the end")
        at: tuple[float, float] | None = parameter(pair(0, 1), "where the camera looks", None)

A field without a default must be given. The key in a file is the field's name without underscores at its end (`from_`).
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from reprlib import repr as short
from typing import Any, Final, Self

import numpy as np

from gsvc_base.errors import UsageError

MAX_FRAMES: Final = 1_000_000
"""Frames of a scene at most: more than nine hours at 30 frames per second."""


class ParameterError(UsageError):
    """A wrong value: `key` tells where it stands, such as ``effects[2].from``, `problem` what is wrong and allowed."""

    def __init__(self, key: str, problem: str) -> None:
        self.key, self.problem = key, problem
        super().__init__(key, problem)

    def __str__(self) -> str:
        return f"{self.key} {self.problem}"

    def within(self, outer: str) -> "ParameterError":
        """The same error, seen from the table that holds the one at fault."""
        dot = "." if self.key and not self.key.startswith("[") else ""
        return ParameterError(f"{outer}{dot}{self.key}", self.problem)


@dataclass(frozen=True)
class Rule:
    """The values that a parameter may have."""

    allowed: str  # the allowed values in words: "a number from 0 to 1"
    take: Callable[[Any], Any]  # gives the value as it is kept; raises ValueError for what is not allowed
    is_frame: bool = False  # whether it is the number of a frame that the clip must have, or a tuple of such


def parameter(rule: Rule, meaning: str, default: Any = MISSING) -> Any:
    """A field with its rule and its meaning in a few words; a default of None may stay None."""
    metadata = {"rule": rule, "meaning": meaning}
    return field(metadata=metadata) if default is MISSING else field(default=default, metadata=metadata)


def key_of(item: "Field[Any]") -> str:
    """A field's key in a file: ``from`` for `from_`, which Python would not take as a name."""
    return item.name.rstrip("_")


@dataclass(frozen=True)
class Checked:
    """A frozen dataclass whose parameters are checked when it is made.

    A ParameterError says that a value is not allowed; for `from_table` also a key that is unknown or missing.
    """

    def __post_init__(self) -> None:
        for item in parameters(type(self)):
            value = getattr(self, item.name)
            if value is None and item.default is None:
                continue
            rule: Rule = item.metadata["rule"]
            try:
                kept = rule.take(value)
            except ParameterError as error:
                raise error.within(key_of(item)) from None
            except ValueError:
                raise ParameterError(key_of(item), f"is {short(value)}; it must be {rule.allowed}") from None
            object.__setattr__(self, item.name, kept)

    @classmethod
    def from_table(cls, table: object) -> Self:
        """One from a table of a file."""
        if not isinstance(table, Mapping):
            raise ParameterError("", f"is {short(table)}; it must be a table with keys such as {_some_keys(cls)}")
        items = {key_of(item): item for item in parameters(cls)}
        for key in table:
            if key not in items:
                raise ParameterError(
                    short(key).strip("'"), f"is unknown here; there are {', '.join(items) or 'no keys'}"
                )
        for key, item in items.items():
            if item.default is MISSING and key not in table:
                raise ParameterError(key, f"is missing: {item.metadata['meaning']}, {item.metadata['rule'].allowed}")
        return cls(**{items[key].name: value for key, value in table.items()})


def parameters(kind: type[Checked]) -> "list[Field[Any]]":
    """The fields that were declared by `parameter`."""
    return [item for item in fields(kind) if "rule" in item.metadata]


def _some_keys(kind: type[Checked]) -> str:
    return ", ".join(key_of(item) for item in parameters(kind)[:6])


def _float(value: object) -> float:
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | float | np.integer | np.floating):
        raise ValueError
    try:
        result = float(value)
    except OverflowError:
        raise ValueError from None
    if not math.isfinite(result):
        raise ValueError
    return result


def _within(value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ValueError


def _items(value: object, count: int) -> list[Any]:
    if not isinstance(value, list | tuple | np.ndarray) or len(value) != count:
        raise ValueError
    return list(value)


def number(low: float, high: float) -> Rule:
    """A finite number in a range, kept as a float."""

    def take(value: object) -> float:
        result = _float(value)
        _within(result, low, high)
        return result

    return Rule(f"a number from {low:g} to {high:g}", take)


def whole(low: int, high: int) -> Rule:
    """A whole number in a range, kept as an int."""

    def take(value: object) -> int:
        if isinstance(value, bool | np.bool_) or not isinstance(value, int | np.integer):
            raise ValueError
        _within(int(value), low, high)
        return int(value)

    return Rule(f"a whole number from {low:,} to {high:,}", take)


def frame_number(*, beyond: bool = False) -> Rule:
    """The number of a frame, counted from 0; in a description one of the clip's frames, unless it may lie beyond."""
    return Rule("the number of a frame, counted from 0", whole(0, MAX_FRAMES).take, is_frame=not beyond)


def pair(low: float, high: float) -> Rule:
    """Two numbers in a range, across and down, kept as a tuple of floats."""
    one = number(low, high)

    def take(value: object) -> tuple[float, ...]:
        return tuple(one.take(item) for item in _items(value, 2))

    return Rule(f"two numbers from {low:g} to {high:g}, such as [{low:g}, {high:g}]", take)


def color() -> Rule:
    """Three numbers from 0 to 1, red, green and blue, kept as a tuple of floats."""
    one = number(0, 1)

    def take(value: object) -> tuple[float, ...]:
        return tuple(one.take(item) for item in _items(value, 3))

    return Rule("three numbers from 0 to 1: red, green and blue, such as [1, 0.5, 0]", take)


def choice(*names: str) -> Rule:
    """One of some words."""

    def take(value: object) -> str:
        if not isinstance(value, str) or value not in names:
            raise ValueError
        return value

    return Rule(f"one of {', '.join(names)}", take)


def flag() -> Rule:
    """True or false."""

    def take(value: object) -> bool:
        if not isinstance(value, bool | np.bool_):
            raise ValueError
        return bool(value)

    return Rule("true or false", take)


def text(most: int) -> Rule:
    """A text of one line that is not empty."""

    def take(value: object) -> str:
        if not isinstance(value, str) or not 1 <= len(value) <= most or not value.isprintable():
            raise ValueError
        return value

    return Rule(f"a text of one line with 1 to {most} characters", take)


def several(rule: Rule, least: int, most: int) -> Rule:
    """A list, kept as a tuple."""

    def take(value: object) -> tuple[Any, ...]:
        if not isinstance(value, list | tuple) or not least <= len(value) <= most:
            raise ValueError
        return tuple(rule.take(item) for item in value)

    return Rule(f"a list of {least} to {most}, each {rule.allowed}", take, rule.is_frame)


def table(kind: type[Checked]) -> Rule:
    """A table of parameters, kept as one of `kind`."""

    def take(value: object) -> Checked:
        return value if isinstance(value, kind) else kind.from_table(value)

    return Rule(f"a table with {_some_keys(kind)}", take)
