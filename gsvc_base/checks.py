"""Checks at the doors: the fields of settings dataclasses hold what their annotations say, arrays hold numbers."""

import math
import operator
import sys
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import cache, wraps
from inspect import signature
from numbers import Real
from types import NoneType, UnionType
from typing import Any, Final, Literal, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from gsvc_base.errors import UsageError

P = ParamSpec("P")
R = TypeVar("R")

_REFUSED: Final = object()

_TYPE_NAMES: Final[Mapping[Any, str]] = {
    bool: "True or False",
    int: "a whole number",
    float: "a finite number",
    str: "a string",
    NoneType: "None",
}


def numbers(value: Any, name: str, remedy: str) -> NDArray[np.float32]:
    """An array of real numbers, or what NumPy makes one of, as f4; numbers beyond binary32 become infinite.

    `name` and `remedy` are the subject of a UsageError and what to do, such as "the splats" and "give Splats or an
    array (N, 8)".
    """
    check_unmasked(name, value)
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):  # rows of several lengths, a tensor of a GPU
        array = np.asarray(None)
    if array.dtype.kind not in "biuf":
        raise UsageError(f"{name} cannot be of type {described_type(value)}; {remedy}")
    with np.errstate(over="ignore", under="ignore"):
        return array.astype(np.float32, copy=False)


def described_type(value: Any) -> str:
    """The type of a value, of an array with that of its elements."""
    return type(value).__name__ + (f" of {value.dtype}" if isinstance(value, np.ndarray) else "")


def check_unmasked(name: str, value: Any) -> None:
    """Refuse a masked array, also in a list: its masked elements would be used like the others."""
    if (masked := sys.modules.get("numpy.ma")) is None:  # so no such array exists
        return
    parts = value if isinstance(value, list | tuple) else (value,)
    if any(isinstance(part, masked.MaskedArray) for part in parts):
        raise UsageError(f"{name} cannot be a masked array, whose mask would be lost; give array.filled(0), say")


def check_whole(name: str, value: Any) -> None:
    """Refuse what is no whole number, by the name of the argument; True is none, and nothing is parsed."""
    if _whole(value) is _REFUSED:
        raise UsageError(f"{name} is {value!r}; it must be a whole number")


def check_range(name: str, value: float | None, low: float, high: float) -> None:
    """Refuse a number that is not in low..high; None is none."""
    if value is not None and not low <= value <= high:
        raise UsageError(f"{name} is {value}; it must be in {low}..{high}")


def check_types(settings: Any) -> None:
    """Refuse fields of a frozen dataclass that are not what is stated, by their names; NumPy's numbers become Python's.

    A whole number counts as a number, but True is no number, NaN and infinity are none either, and nothing is parsed.
    """
    kind: Any = type(settings)
    hints = _hints(kind)
    for field in fields(settings):
        value = getattr(settings, field.name)
        fitted = _fitted(value, hints[field.name])
        if fitted is _REFUSED:
            name = f"{type(settings).__name__}.{field.name}"
            raise UsageError(f"{name} is {value!r}; it must be {_described(hints[field.name])}")
        object.__setattr__(settings, field.name, fitted)


@cache
def _hints(kind: type) -> dict[str, Any]:
    """The annotations of a class, evaluated."""
    return get_type_hints(kind)


def _fitted(value: Any, hint: Any) -> Any:
    """The value as the type that an annotation names, or _REFUSED."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return next((v for v in (_fitted(value, option) for option in arguments) if v is not _REFUSED), _REFUSED)
    if origin is Literal:
        return value if isinstance(value, str) and value in arguments else _REFUSED
    if origin is tuple:
        return _fitted_tuple(value, arguments)
    if hint is bool:
        return bool(value) if isinstance(value, bool | np.bool_) else _REFUSED
    if hint is int:
        return _whole(value)
    if hint is float:
        return _finite(value)
    if not isinstance(hint, type) or getattr(hint, "_is_protocol", False):
        return value if callable(value) else _REFUSED
    return value if isinstance(value, hint) else _REFUSED


def _fitted_tuple(value: Any, hints: tuple[Any, ...]) -> Any:
    if not isinstance(value, tuple):
        return _REFUSED
    if len(hints) == 2 and hints[1] is Ellipsis:
        hints = (hints[0],) * len(value)
    if len(hints) != len(value):
        return _REFUSED
    fitted = tuple(_fitted(item, hint) for item, hint in zip(value, hints, strict=True))
    return _REFUSED if any(item is _REFUSED for item in fitted) else fitted


def _whole(value: Any) -> Any:
    if isinstance(value, bool | np.bool_ | np.ndarray):  # arrays and old NumPy's bools count as indices
        return _REFUSED
    try:
        return operator.index(value)
    except TypeError:
        return _REFUSED


def _finite(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, Real):
        return _REFUSED
    try:
        number = float(value)
    except OverflowError:
        return _REFUSED
    return number if math.isfinite(number) else _REFUSED


def _described(hint: Any) -> str:
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return " or ".join(_described(option) for option in arguments)
    if origin is Literal:
        return " or ".join(repr(argument) for argument in arguments)
    if origin is tuple and arguments[-1] is Ellipsis:
        return f"a tuple, each item {_described(arguments[0])}"
    if origin is tuple:
        return f"a tuple ({', '.join(_described(item) for item in arguments)})"
    return _TYPE_NAMES.get(hint, f"a {getattr(hint, '__name__', hint)}")


def door(function: Callable[P, R]) -> Callable[P, R]:
    """A public function of numbers and arrays whose arguments of another type are refused by their names.

    Masked arrays are refused first. Nothing else is looked at before something goes wrong: where the function raises an
    error of types or shapes, the first argument that is no number, or no array of numbers, is named. If there is none,
    the error passes through.
    """
    names = (*signature(function).parameters,)

    @wraps(function)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> R:
        for name, value in (*zip(names, args, strict=False), *kwargs.items()):
            check_unmasked(name, value)
        try:
            return function(*args, **kwargs)
        except UsageError:
            raise
        except _errors_of_types() as error:
            try:
                given = signature(function).bind(*args, **kwargs).arguments
            except TypeError:  # a name too many or missing: Python says it well
                raise error from None
            for name, value in given.items():
                _check_argument(function, name, value, error)
            raise

    return guarded


def _errors_of_types() -> tuple[type[Exception], ...]:
    """What Python, NumPy and, if it is loaded, Numba raise where a type does not fit."""
    numba = sys.modules.get("numba.core.errors")
    return (TypeError, ValueError, AttributeError, IndexError, *(() if numba is None else (numba.NumbaError,)))


def _check_argument(function: Callable[..., Any], name: str, value: Any, error: Exception) -> None:
    """Refuse an argument that is no whole number, number or array of numbers, whichever its annotation asks for."""
    parameter = signature(function).parameters[name]
    if value is parameter.default or isinstance(value, bytes):
        return
    if parameter.annotation in (int, float):
        if (_whole if parameter.annotation is int else _finite)(value) is _REFUSED:
            raise UsageError(f"{name} is {value!r}; it must be {_TYPE_NAMES[parameter.annotation]}") from error
        return
    try:
        numbers(value, name, "give numbers, or an array of them")
    except UsageError as refusal:
        raise refusal from error
