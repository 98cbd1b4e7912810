"""The catalogue of hard cases: each is named, says what could go wrong, and can be measured.

A hard case is a case of the conformance kit (`gsvc_conformance.cases`), so that its inputs are a golden vector as
well, and beside it

- the *truth*: the same outputs from the same inputs in 60 digits, written from the equations of spec.md, which shares
  nothing with gsvc_ref nor with the kit's own oracles (`tests.hard_cases.oracle`);
- a *naive* formula that loses the case, as proof that the bound is not idle: one of the kit's mutants
  (`gsvc_conformance.mutants`) where there is one, else a formula of `tests.hard_cases.naive`, because it needs binary32
  or binary16 throughout, or another algorithm, which no patch of spec.md's code makes.

What no vector can hold, such as a hundred thousand steps, is a `LongRun`. Each module of `tests.hard_cases.fields` has
a tuple CASES of both.
"""

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from gsvc_conformance.case import Case, cases
from gsvc_conformance.operation import operations
from tests.hard_cases.measuring import Measurement, Truth, Variant, implementations, measure


@dataclass(frozen=True)
class HardCase:
    """A vector whose arithmetic is hard.

    Attributes
    ----------
    vector
        Its id, ``tier/operation/slug``.
    danger
        What could go wrong: one sentence.
    condition
        The condition number, or why the result cannot be accurate, and how the code behaves then: a sentence or two.
    truth
        The inputs of the operation (by name) to the true outputs.
    naive
        A formula that fails, and what it does in a few words.
    also
        Further implementations that have to be within the bounds, by name.
    """

    vector: str
    danger: str
    condition: str
    truth: Callable[..., Mapping[str, Truth]]
    naive: tuple[str, Variant]
    also: Mapping[str, Variant] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The name in the table: the slug of its vector."""
        return self.vector.rpartition("/")[2]

    @property
    def operation(self) -> str:
        """The operation of its vector."""
        return self.vector.split("/")[1]

    @property
    def naive_name(self) -> str:
        """The naive formula in words."""
        return self.naive[0]

    def case(self) -> Case:
        """The case of the kit."""
        return cases()[self.vector]

    def measure(self) -> Measurement:
        """The errors of all implementations, of the kit's oracle and of the naive formula."""
        inputs, expected = self.case().run()
        ours = {**implementations(self.operation), **self.also}
        return measure(inputs, expected, self.truth(**inputs), ours, self.naive[1])


@dataclass(frozen=True)
class LongRun:
    """A run that is hard because it lasts, and has no vector.

    Attributes
    ----------
    name, operation, danger, condition
        As for `HardCase`.
    naive_name
        The naive formula in words.
    run
        Measures everything.
    """

    name: str
    operation: str
    danger: str
    condition: str
    naive_name: str
    run: Callable[[], Measurement]

    def measure(self) -> Measurement:
        """The measurement of the run."""
        return self.run()


Entry = HardCase | LongRun


@cache
def catalogue() -> Mapping[str, Entry]:
    """All entries by ``operation/name``, in the order of the operations and then of their modules."""
    found: dict[str, Entry] = {}
    for path in sorted(Path(__file__).with_name("fields").glob("*.py")):
        module: Any = importlib.import_module(f"tests.hard_cases.fields.{path.stem}")
        for entry in module.CASES:
            name = f"{entry.operation}/{entry.name}"
            if name in found:
                raise ValueError(f"two hard cases are called {name}")
            found[name] = entry
    order = list(operations())
    return dict(sorted(found.items(), key=lambda item: order.index(item[1].operation)))
