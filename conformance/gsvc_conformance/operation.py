"""Operations: all that an implementation can be asked to do, each a function of named inputs to named outputs."""

import importlib
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, Literal

import numpy as np

from gsvc_base.errors import UsageError
from gsvc_base.rendering.error_models import ErrorModel
from gsvc_conformance.expectations import Exact, Expectation
from gsvc_conformance.pairs import PAIRS, answer
from gsvc_conformance.spelling import question

Values = dict[str, Any]
"""Inputs or outputs of an operation by name: arrays, int, float, bytes (streams) or str (errors)."""

Group = Literal[
    "bitstream", "reconstruction", "rendering", "deterministic", "gradients", "training", "quantization", "colour",
    "metrics", "seeking", "sizes", "layers", "encoder",
]  # fmt: skip
"""The conformance class that an operation belongs to (spec.md section 13); `OPTIONS` are options of a claim."""

ByModel = Callable[[ErrorModel, Mapping[str, Expectation], Values], Mapping[str, Expectation]]

OPTIONS: Final = ("seeking", "sizes", "layers")
"""Classes that a claim names as options."""
DRAWING: Final = ("rendering", "deterministic")
"""Classes of which a decoder that draws has one at least."""
DRAWN: Final = ("decode_layers",)
"""Operations of other classes that only a decoder that draws needs (R-13-1)."""

MODULES: Final = (
    "bitstream",
    "reconstruction",
    "rendering",
    "training",
    "selection",
    "quantization",
    "color",
    "metrics",
    "main_profile",
    "encoding",
)
"""Where operations are defined, in gsvc_conformance.operations."""

DTYPES: Final = ("u1", "u2", "u4", "i8", "f4", "f8")
"""Types of arrays by NumPy's names, which mean the byte order of the machine; in files all are little-endian."""


@dataclass(frozen=True)
class Port:
    """An input or output.

    Attributes
    ----------
    name
        As in spec.md.
    type
        ``int``, ``float``, ``stream``, ``text``, or the type of an array: ``u1`` .. ``f8``, or ``u1|u2`` for frames.
    shape
        Text such as ``(N, 8)``; empty for what is no array, ``()`` for a single number as an array.
    """

    name: str
    type: str
    shape: str = ""


@dataclass(frozen=True)
class Operation:
    """One operation.

    Attributes
    ----------
    name
        The name of its function everywhere.
    group
        The conformance class.
    title
        A sentence that says what it does.
    inputs, outputs
        Their ports, in order.
    equations
        Numbered equations of spec.md that it computes, such as ``9-2``.
    rules
        Requirement ids that every case of it exercises.
    reference
        gsvc_ref's answer.
    oracle
        The function from the inputs to the expectations of the outputs.
    by_model
        The function from an error model, the expectations of fp32/1 and the inputs to the expectations of the model
        (R-13.3-1); None where these are the same.
    """

    name: str
    group: Group
    title: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    equations: tuple[str, ...]
    rules: tuple[str, ...]
    reference: Callable[..., Values]
    oracle: Callable[..., Mapping[str, Expectation]]
    by_model: ByModel | None = None


_OPERATIONS: dict[str, Operation] = {}


def operation(
    group: Group,
    *,
    inputs: str,
    outputs: str,
    equations: tuple[str, ...] = (),
    rules: tuple[str, ...] = (),
    oracle: Callable[..., Mapping[str, Expectation]] | None = None,
    by_model: ByModel | None = None,
) -> Callable[[Callable[..., Values]], Callable[..., Values]]:
    """Define an operation by gsvc_ref's answer, whose docstring begins with the title.

    Parameters
    ----------
    group
        The conformance class.
    inputs, outputs
        Ports, separated by semicolons: ``parameters: f4 (N, 8); width: int``.
    equations, rules
        The equations and rules that every case of the operation exercises.
    oracle
        The function from inputs to expectations; None: exactly gsvc_ref's answer, which the code inside spec.md checks.
    by_model
        As in `Operation`.
    """

    def define(reference: Callable[..., Values]) -> Callable[..., Values]:
        name = reference.__name__
        title = (reference.__doc__ or "").partition("\n")[0]
        _OPERATIONS[name] = Operation(
            name, group, title, _ports(inputs), _ports(outputs), equations, rules, reference,
            oracle or exactly(reference), by_model,
        )  # fmt: skip
        return reference

    return define


def paired(
    name: str,
    group: Group,
    title: str,
    *,
    inputs: str,
    outputs: str,
    equations: tuple[str, ...] = (),
    rules: tuple[str, ...] = (),
    oracle: Callable[..., Mapping[str, Expectation]] | None = None,
    by_model: ByModel | None = None,
) -> None:
    """Define an operation that gsvc_ref has by its name (`gsvc_conformance.pairs`), as `operation` does."""
    of_outputs = {port.name: port.type for port in _ports(outputs)}

    def reference(**given: Any) -> Values:
        return answer(name, of_outputs, given)

    reference.__name__, reference.__doc__ = name, title
    operation(
        group, inputs=inputs, outputs=outputs, equations=equations, rules=rules, oracle=oracle, by_model=by_model
    )(reference)


def numbered(section: int, first: int, last: int) -> tuple[str, ...]:
    """The equations of a section from the first to the last."""
    return tuple(f"{section}-{number}" for number in range(first, last + 1))


def is_needed(operation: Operation, classes: Collection[str]) -> bool:
    """Whether a claim of some classes needs an operation (R-13-1)."""
    return operation.group in classes and (operation.name not in DRAWN or not {*DRAWING}.isdisjoint(classes))


def exactly(function: Callable[..., Values]) -> Callable[..., dict[str, Expectation]]:
    """The oracle of an operation whose outputs are fixed to the bit: those of a function."""

    def oracle(**inputs: Any) -> dict[str, Expectation]:
        return {name: Exact(np.asarray(value)) for name, value in function(**inputs).items()}

    return oracle


def input_size(inputs: Values) -> int:
    """The bytes of a vector's inputs, by which the simplest one is found."""
    return sum(
        value.nbytes if isinstance(value, np.ndarray) else len(value) if isinstance(value, bytes) else 8
        for value in inputs.values()
    )


SMALLEST: Final = 2.0**-10
LARGEST: Final = 2.0**12
"""The factors of a plain splat lie between these."""

NEEDLE: Final = 32.0
"""A splat whose factors differ by more than this is no plain one."""


def is_unusual(inputs: Values) -> bool:
    """Whether any splat of a vector is degenerate, a needle, or very small or large."""
    for name in ("parameters", "values"):
        table = inputs.get(name)
        if isinstance(table, np.ndarray) and table.ndim == 2 and table.shape[1] >= 8 and len(table):
            factors = table[:, 2:5].astype(np.float64)
            ends = factors[:, [0, 2]]
            with np.errstate(all="ignore"):
                plain = (ends >= SMALLEST) & (ends.max(axis=1) <= LARGEST)[:, None]
                plain &= (abs(factors).max(axis=1) <= NEEDLE * ends.min(axis=1))[:, None]
            if not plain.all() or not np.isfinite(table).all():
                return True
    return False


@cache
def operations() -> Mapping[str, Operation]:
    """All operations by name, in the order of spec.md."""
    for module in MODULES:
        importlib.import_module(f"gsvc_conformance.operations.{module}")
    places = {name: place for place, name in enumerate(PAIRS)}
    return dict(sorted(_OPERATIONS.items(), key=lambda item: places[item[0]]))


def checked_operations(names: Iterable[str]) -> tuple[str, ...]:
    """Names of operations.

    Raises
    ------
    UsageError
        One does not exist.
    """
    chosen = tuple(names)
    for name in chosen:
        if name not in operations():
            near = question(name, operations()) or f"; the operations are {', '.join(operations())}"
            raise UsageError(f"there is no operation {name!r}{near}")
    return chosen


def _ports(text: str) -> tuple[Port, ...]:
    ports = []
    for part in text.split(";"):
        name, _, rest = part.strip().partition(": ")
        kind, _, shape = rest.partition(" ")
        if kind not in ("int", "float", "stream", "text", "u1|u2") and kind not in DTYPES:
            raise ValueError(f"a port of type {kind!r} in {text!r}")
        ports.append(Port(name, kind, shape))
    return tuple(ports)
