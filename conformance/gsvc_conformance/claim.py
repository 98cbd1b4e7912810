"""Claims of conformance: classes, a profile, a level and options (spec.md section 13.1)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, get_args

from gsvc_base.errors import UsageError
from gsvc_base.rendering.error_models import ERROR_MODELS, FP32, ErrorModel
from gsvc_conformance.level import LEVELS
from gsvc_conformance.operation import OPTIONS, Group
from gsvc_conformance.profiles import PROFILES
from gsvc_conformance.spelling import question

DECLARED: Final = ("live",)
"""Options that no vector judges: an implementation declares them."""
FORM: Final = "CLASS[+CLASS...],PROFILE,LEVEL[,OPTION...][,MODEL]"


@dataclass(frozen=True)
class Claim:
    """What an implementation says that it does.

    Attributes
    ----------
    classes
        Classes of conformance, at least one.
    profile
        The name of a profile.
    level
        The highest level of spec.md section 5 that it is ready for.
    options
        Classes that are options (`OPTIONS`), and options that are only declared (`DECLARED`).
    model
        The error model.
    """

    classes: tuple[str, ...]
    profile: str
    level: int
    options: tuple[str, ...] = ()
    model: ErrorModel = FP32

    @property
    def judged(self) -> tuple[str, ...]:
        """The classes that vectors judge, options among them."""
        return tuple(dict.fromkeys((*self.classes, *(option for option in self.options if option in OPTIONS))))

    @property
    def declared(self) -> tuple[str, ...]:
        """The options that no vector judges."""
        return tuple(option for option in self.options if option in DECLARED)

    def __str__(self) -> str:
        model = [self.model.name] * (self.model is not FP32)
        return ",".join(["+".join(self.classes), self.profile, str(self.level), *self.options, *model])


def read_claim(text: str) -> Claim:
    """A claim in words, such as ``bitstream+rendering,paper,2,sizes``.

    Raises
    ------
    UsageError
        It has another form, or names what spec.md does not know.
    """
    parts = [part.strip() for part in text.split(",")]
    if len(parts) < 3:
        raise UsageError(f"the claim {text!r} must have the form {FORM}: bitstream+rendering,paper,2")
    classes, profile, level = parts[0].split("+"), parts[1], parts[2]
    models = [part for part in parts[3:] if "/" in part]
    options = [part for part in parts[3:] if part not in models]
    _check("class", classes, get_args(Group))
    _check("profile", [profile], PROFILES)
    _check("level", [level], [str(number) for number in LEVELS])
    _check("option", options, (*OPTIONS, *DECLARED))
    if len(models) > 1:
        raise UsageError(f"the claim names several error models: {', '.join(models)}")
    return Claim(tuple(classes), profile, int(level), tuple(options), read_model(models[0]) if models else FP32)


def read_model(name: str) -> ErrorModel:
    """An error model of spec.md section 13.3 by its name.

    Raises
    ------
    UsageError
        There is none of that name.
    """
    if name not in ERROR_MODELS:
        near = question(name, ERROR_MODELS) or f"; it is {_one_of([*ERROR_MODELS])}"
        raise UsageError(f"there is no error model {name!r}{near}")
    return ERROR_MODELS[name]


def _check(what: str, given: Sequence[str], known: Sequence[str]) -> None:
    """Refuse what a claim cannot name, and what it names twice."""
    for name in given:
        if name not in known:
            raise UsageError(f"a claim knows no {what} {name!r}{question(name, known) or f'; it is {_one_of(known)}'}")
        if given.count(name) > 1:
            raise UsageError(f"the claim names the {what} {name} twice")


def _one_of(names: Sequence[str]) -> str:
    return f"one of {', '.join(names)}" if len(names) > 1 else names[0]
