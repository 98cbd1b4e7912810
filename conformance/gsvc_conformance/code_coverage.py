"""What the vectors reach of the code of spec.md: statements, branches, and the sides of choices.

A *choice* is a call of `where`, `clip`, `minimum`, `maximum`, `min` or `max`: it decides for each element without a
branch. A side of `minimum` is reached where one value is less than the other, not where they are equal.
"""

import ast
import builtins
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from gsvc_base.document import blocks
from gsvc_conformance.spec import SPEC, leads_to
from gsvc_conformance.vector import Vector

Kind = Literal["statement", "branch", "choice"]

SIDES: Final[dict[str, tuple[str, ...]]] = {
    "where": ("true", "false"),
    "clip": ("below", "inside", "above"),
    **dict.fromkeys(("minimum", "maximum", "min", "max"), ("the first is less", "the second is less")),
}
"""The sides of a choice, by the function that makes it."""


BRANCHES: Final = (ast.If, ast.While, ast.For)
"""Statements with two ways: into the body, and past it or out of it."""


@dataclass(frozen=True)
class Point:
    """A place of the code that can be reached.

    Attributes
    ----------
    kind
        What it is.
    home
        The function or class of the code that it stands in; empty outside of them.
    line
        Its line in spec.md.
    text
        Its code, of which a compound statement has the first line, and a second one that raises a fault.
    side
        Which way a branch goes, or which side of a choice it is; empty for a statement.
    """

    kind: Kind
    home: str
    line: int
    text: str
    side: str = ""

    @property
    def rule(self) -> str:
        """The rule that must be broken to get there, or ""."""
        raised = re.search(r"raise Fault\('(R-[^']*)'", self.text)
        return raised[1] if raised and self.side in ("", "true") and self.text.startswith(("if", "raise")) else ""


def reach(
    vectors: Mapping[str, str], read: Callable[[str], Vector], excused: Callable[[Point], bool]
) -> list[tuple[Point, str]]:
    """All points of the code, each with the first vector that reaches it: "" without one, "the module" where none need.

    Parameters
    ----------
    vectors
        The rule that each vector breaks, or "", by its id; the cheapest first. None is read that promises nothing new:
        its operation has to lead to a point that is missing, and it has to break the rule of a point that has one.
    read
        Reads a vector.
    excused
        Says of which points no vector is expected.
    """
    code = Instrumented()
    first = ["the module" if there else "" for there in code.reached]
    missing = {at for at, name in enumerate(first) if not name}
    hopes = {at: (code.points[at].home, code.points[at].rule) for at in missing if not excused(code.points[at])}
    left = Counter(hopes.values())
    for name, broken in vectors.items():
        operation = name.split("/")[1]
        homes = leads_to(operation)
        if any(home in homes and rule in ("", broken) for home, rule in left):
            with np.errstate(all="ignore"):
                code.names[operation](**read(name).inputs)
            for at in [at for at in missing if code.reached[at]]:
                missing.remove(at)
                first[at] = name
                left -= Counter([hopes[at]] if at in hopes else [])
    return list(zip(code.points, first, strict=True))


class Instrumented:
    """The code of spec.md that notes which of its points it reaches.

    Attributes
    ----------
    points
        All points, in the order of the text.
    reached
        A byte for each point: 1 where it was reached.
    names
        What the code defines.
    """

    def __init__(self) -> None:
        self.points: list[Point] = []
        trees = [_Notes(self.points).visit(ast.parse(block)) for block in blocks()]
        self.reached = bytearray(len(self.points))
        choices = {f"_{name}": self._choice(name) for name in SIDES}
        self.names: dict[str, Any] = {"__name__": "spec", "_reached": self.reached, "_way": self._way, **choices}
        for tree in trees:
            exec(compile(ast.fix_missing_locations(tree), str(SPEC), "exec"), self.names)

    def _way(self, number: int, test: Any) -> Any:
        """A condition of an expression: its point `number` is that of true, the next one that of false."""
        self.reached[number + (not test)] = 1
        return test

    def _choice(self, name: str) -> Callable[..., Any]:
        """A function that makes a choice and notes its sides, which are the points from `number` on."""
        function = getattr(builtins, name) if name in ("min", "max") else getattr(np, name)

        def choose(number: int, *values: Any) -> Any:
            end = number + len(SIDES[name])
            if 0 in self.reached[number:end]:
                for side, there in enumerate(TAKEN[name](*values)):
                    self.reached[number + side] |= bool(np.any(there))
            return function(*values)

        return choose


def _clipped(x: Any, lowest: Any, highest: Any) -> tuple[Any, ...]:
    below, above = np.less(x, lowest), np.greater(x, highest)
    return below, ~(below | above), above


def _less(a: Any, b: Any) -> tuple[Any, ...]:
    return np.less(a, b), np.less(b, a)


TAKEN: Final[dict[str, Callable[..., tuple[Any, ...]]]] = {
    "where": lambda mask, *_: (mask, np.logical_not(mask)),
    "clip": _clipped,
    "minimum": _less,
    "maximum": _less,
    "min": _less,
    "max": _less,
}
"""Where the sides of a choice are taken, by its arguments."""


class _Notes(ast.NodeTransformer):
    """Puts notes into a tree; `points` grows by what they are about."""

    def __init__(self, points: list[Point]) -> None:
        self.points = points
        self.home = ""

    def note(self, kind: Kind, node: ast.stmt | ast.expr, *sides: str) -> int:
        """The number of the first of new points, one for each side."""
        first, _, rest = ast.unparse(node).partition("\n")
        second = rest.partition("\n")[0].strip()
        text = f"{first} {second}" if second.startswith("raise Fault") else first
        self.points += [Point(kind, self.home, node.lineno, text, side) for side in sides]
        return len(self.points) - len(sides)

    def visit(self, node: ast.AST) -> Any:
        """A statement with a note in front of it, or an expression."""
        if not isinstance(node, ast.stmt):
            return super().visit(node)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):  # a docstring
            return node
        mark = _mark(self.note("statement", node, ""))
        before = self.home
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            self.home = before or node.name
        number = self.note("branch", node, "true", "false") if isinstance(node, BRANCHES) else None
        self.generic_visit(node)
        if isinstance(node, BRANCHES) and number is not None:
            node.body.insert(0, _mark(number))
            node.orelse.insert(0, _mark(number + 1))
        self.home = before
        return [mark, node]

    def visit_IfExp(self, node: ast.IfExp) -> ast.IfExp:
        """Both ways of `a if b else c`."""
        number = self.note("branch", node, "true", "false")
        self.generic_visit(node)
        node.test = _call("_way", number, [node.test])
        return node

    def visit_comprehension(self, node: ast.comprehension) -> ast.comprehension:
        """Both ways of each condition."""
        numbers = [self.note("branch", test, "true", "false") for test in node.ifs]
        self.generic_visit(node)
        node.ifs = [_call("_way", number, [test]) for number, test in zip(numbers, node.ifs, strict=True)]
        return node

    def visit_Call(self, node: ast.Call) -> ast.Call:
        """A choice; `min` and `max` of a single list are none."""
        name = ast.unparse(node.func).removeprefix("np.")
        if name not in SIDES or len(node.args) < 2:
            self.generic_visit(node)
            return node
        number = self.note("choice", node, *SIDES[name])
        self.generic_visit(node)
        return _call(f"_{name}", number, node.args)


def _call(name: str, number: int, arguments: Iterable[ast.expr]) -> ast.Call:
    return ast.Call(ast.Name(name, ast.Load()), [ast.Constant(number), *arguments], [])


def _mark(number: int) -> ast.stmt:
    return ast.parse(f"_reached[{number}] = 1").body[0]
