"""The kind of error that each rule of spec.md stands for (section 12)."""

from typing import Final

from gsvc_base.errors import ErrorKind, GsvcError

KINDS: Final[dict[ErrorKind, tuple[str, ...]]] = {
    "malformed": (
        "R-3.1-1", "R-3.1-3", "R-6.1-1", "R-6.2-1", "R-6.2-2", "R-6.2-3", "R-6.2-4", "R-6.6-6", "R-7-1", "R-15.6-5"
    ),
    "unsupported": ("R-3.2-1", "R-5-6", "R-6.1-2", "R-6.5-1", "R-6.6-1"),
    "limit": ("R-5-1", "R-5-2", "R-5-3", "R-5-4", "R-5-7", "R-5-8", "R-5-9", "R-5-11", "R-9.4-2"),
}  # fmt: skip
"""Rules by the kind of their error; all others are ``invalid``."""

_KIND_OF: Final = {rule: kind for kind, rules in KINDS.items() for rule in rules}


def kind_of(rule: str) -> ErrorKind:
    """The kind that an error about a rule has: ``invalid`` for all rules that section 12 does not list elsewhere."""
    return _KIND_OF.get(rule, "invalid")


def broken(rule: str, message: str, bit: int) -> GsvcError:
    """The error of a rule that the element at `bit` of a stream breaks."""
    return GsvcError(kind_of(rule), message, rule=rule, bit=bit)
