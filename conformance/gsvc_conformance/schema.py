"""JSON objects: a table of fields says what an object may have, and one function checks the object against it."""

from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

from gsvc_base.errors import UsageError

SHOWN: Final = 100
"""Characters of a value that a message shows."""


class Kind(NamedTuple):
    """What a field may be, in words and as a function."""

    words: str
    holds: Callable[[Any], bool]


def _list_of(words: str, holds: Callable[[Any], bool]) -> Kind:
    return Kind(f"a list of {words}", lambda value: isinstance(value, list) and all(map(holds, value)))


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_count(value: Any) -> bool:
    return type(value) is int and 0 <= value <= LARGEST


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and 0 <= value <= LARGEST


LARGEST: Final = 1 << 53
"""The largest number that is read; above it not every whole number is a floating-point number."""
TEXT: Final = Kind("a text", _is_text)
TEXTS: Final = _list_of("texts", _is_text)
NAMED_TEXTS: Final = Kind(
    "an object of texts", lambda value: isinstance(value, dict) and all(map(_is_text, value.values()))
)
OBJECT: Final = Kind("an object", lambda value: isinstance(value, dict))
OBJECT_OR_NOT: Final = Kind("an object", lambda value: value is None or isinstance(value, dict))
TEXT_OR_NOT: Final = Kind("a text", lambda value: value is None or isinstance(value, str))
LIST: Final = Kind("a list", lambda value: isinstance(value, list))
ROWS: Final = _list_of("lists of texts", TEXTS.holds)
FLAG: Final = Kind("true or false", lambda value: isinstance(value, bool))
COUNT: Final = Kind("a whole number from 0 to 2^53", _is_count)
NUMBER: Final = Kind("a number from 0 to 2^53", _is_number)
COUNTS: Final = _list_of("whole numbers", _is_count)

Schema = Mapping[str, tuple[Kind, Any]]
NEEDED: Final = object()
"""In place of a default: the field must not be left out."""


def checked(value: Any, schema: Schema, name: str, source: str = "") -> dict[str, Any]:
    """The fields of an object that a schema has; other fields are ignored.

    Raises
    ------
    UsageError
        It is not an object, or a field is missing or of another kind; the message names the field.
    """
    if not isinstance(value, dict):
        raise UsageError(f"{name} is {shown(value)}; it must be an object{source}")
    found = {}
    for field, (kind, default) in schema.items():
        found[field] = value.get(field, default)
        if not kind.holds(found[field]):
            given = shown(value[field]) if field in value else "missing"
            raise UsageError(f"{field} of {name} is {given}; it must be {kind.words}{source}")
    return found


def shown(value: Any) -> str:
    """The beginning of a value, for a message."""
    try:
        return cut(repr(value))
    except RecursionError:
        return f"{type(value).__name__} that is nested too deep"


def cut(text: str) -> str:
    """The beginning of a text, for a message."""
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."
