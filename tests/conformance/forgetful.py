"""Readers of profile `main` that forget checks: spec.md's code for that profile, whose refusals can be left out."""

import ast
import operator
import re
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Final

from gsvc_base.document import blocks
from gsvc_conformance.spec import SLOW, SPEC, namespace

OPERATIONS: Final = ("reconstruct_stream", "seek", "reconstruct_layers")
"""The operations with an error, which the faulty vectors are of."""
LIMITS: Final = "R-5-"
"""What the rules begin with that R-5-9 says again of an operating point, and so of a stream without layers."""
SIGNS: Final = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
"""The signs of inequalities."""
INEQUALITIES: Final = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
"""What they say."""
RESERVED: Final = {"quality_reserved != 0": (0, 1, 2), "frame['layer_mask'] & ~14 != 0": (0, 4, 5, 6, 7)}
"""Checks of reserved bits, and these bits."""
PATIENCE: Final = 10_000
"""Refusals in one stream that a reader leaves out before it is taken for one that never ends."""


@dataclass(frozen=True)
class Check:
    """A check of the reader.

    Attributes
    ----------
    line
        Its line in spec.md.
    function
        The function that it is in.
    rules
        The rules by which a stream is refused there.
    """

    line: int
    function: str
    rules: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.function}-{self.line}"

    @property
    def section(self) -> str:
        """The section of spec.md that it is in."""
        lines = SPEC.read_text(encoding="utf-8").splitlines()[: self.line]
        return next(found[1] for line in reversed(lines) if (found := re.match(r"#{2,3} (\d[\d.]*) ", line)))


class _OfMain(ast.NodeTransformer):
    """Leaves out what profile `main` does not do, and lets `refuse` and `within` decide, which know the line."""

    def visit_If(self, node: ast.If) -> Any:
        self.generic_visit(node)
        if any(any(_calls(part, "refuse")) for part in node.body if isinstance(part, ast.Expr)):
            node.test = _Inequalities().visit(_Conditions().visit(node.test))
        asked = ast.unparse(node.test)
        if "['profile'] != MAIN" in asked:
            return node.orelse
        return node.body if isinstance(node.test, ast.Compare) and "['profile'] == MAIN" in asked else node

    def visit_IfExp(self, node: ast.IfExp) -> Any:
        self.generic_visit(node)
        return node.body if "['profile'] == MAIN" in ast.unparse(node.test) else node

    def visit_Raise(self, node: ast.Raise) -> Any:
        if not isinstance(node.exc, ast.Call) or ast.unparse(node.exc.func) != "Fault":
            return node
        return ast.Expr(_call("refuse", node.lineno, *node.exc.args))

    def visit_Expr(self, node: ast.Expr) -> Any:
        self.generic_visit(node)
        if not (isinstance(node.value, ast.Call) and _name(node.value.func).startswith("check_")):
            return node
        return ast.Expr(_call("within", node.lineno, _later(node.value)))


class _Conditions(ast.NodeTransformer):
    """Lets `holds` decide about each of several conditions any of which is enough, and `are_set` about bits."""

    def __init__(self) -> None:
        self.negated = False

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Any:
        if not isinstance(node.op, ast.Not):
            return node
        self.negated = not self.negated
        self.generic_visit(node)
        self.negated = not self.negated
        return node

    def visit_BoolOp(self, node: ast.BoolOp) -> Any:
        named = [ast.Constant(ast.unparse(value)) for value in node.values]
        self.generic_visit(node)
        if isinstance(node.op, ast.And) != self.negated:
            return node
        node.values = [
            _call("holds", node.lineno, name, _later(value), ast.Constant(self.negated))
            for name, value in zip(named, node.values, strict=True)
        ]
        return node

    def visit_Compare(self, node: ast.Compare) -> Any:
        if ast.unparse(node) not in RESERVED:
            return node
        return _call("are_set", node.lineno, node.left)


class _Inequalities(ast.NodeTransformer):
    """Lets `compares` decide about each chain of inequalities."""

    def visit_Compare(self, node: ast.Compare) -> Any:
        signs = [SIGNS[type(sign)] for sign in node.ops if type(sign) in SIGNS]
        if len(signs) < len(node.ops):
            return node
        return _call("compares", node.lineno, ast.Constant(" ".join(signs)), node.left, *node.comparators)


def _call(name: str, line: int, *arguments: ast.expr) -> ast.Call:
    return ast.Call(ast.Name(name, ast.Load()), [ast.Constant(line), *arguments], [])


def _later(value: ast.expr) -> ast.Lambda:
    return ast.Lambda(ast.arguments([], [], None, [], [], None, []), value)


def _name(node: ast.AST) -> str:
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


@cache
def _code() -> tuple[ast.Module, ...]:
    """The blocks of the reader of `main`, with the lines of spec.md."""
    table = str(namespace()["EXP2"].tolist())
    trees = (_OfMain().visit(ast.parse(block.replace(SLOW, table))) for block in blocks())
    return tuple(ast.fix_missing_locations(tree) for tree in trees)


@cache
def _functions() -> tuple[ast.FunctionDef, ...]:
    """The functions that the operations lead to; a method is reached by its name alone."""
    there = [node for tree in _code() for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    found, waiting = list[ast.FunctionDef](), {*OPERATIONS, "__init__"}
    while waiting:
        new = [node for node in there if node.name in waiting and node not in found]
        found += new
        waiting = {_name(part) for node in new for part in ast.walk(node)}
    return tuple(found)


@cache
def refusals() -> tuple[Check, ...]:
    """Each place where the reader refuses a stream."""
    return tuple(
        Check(_line(call), function.name, tuple(sorted(_rules(function, call.args[1]))))
        for function in _functions()
        for call in _calls(function, "refuse")
    )


@cache
def calls_of_checks() -> tuple[Check, ...]:
    """Each place where the reader calls a function that refuses, and does nothing else there."""
    return tuple(
        Check(_line(call), function.name, tuple(sorted(_rules_inside(call.args[1].body))))
        for function in _functions()
        for call in _calls(function, "within")
        if isinstance(call.args[1], ast.Lambda)
    )


@cache
def inequalities() -> tuple[tuple[Check, int], ...]:
    """Each inequality on which a refusal depends, by its number on its line; the rules are those of the refusal."""
    return tuple(
        (Check(_line(call), function.name, _rules_of(function, node.body)), number)
        for function in _functions()
        for node in ast.walk(function)
        if isinstance(node, ast.If)
        for call in _calls(node.test, "compares")
        for number in range(len(ast.literal_eval(call.args[1]).split()))
    )


@cache
def conditions() -> tuple[tuple[Check, str], ...]:
    """Each condition that is enough for a refusal and not the only one there is."""
    return tuple(
        (Check(_line(call), function.name, _rules_of(function, node.body)), str(ast.literal_eval(call.args[1])))
        for function in _functions()
        for node in ast.walk(function)
        if isinstance(node, ast.If)
        for call in _calls(node.test, "holds")
    )


@cache
def reserved_bits() -> tuple[tuple[Check, int], ...]:
    """Each bit in the body of a chunk, or in operating points, that must be 0."""
    lines = SPEC.read_text(encoding="utf-8").splitlines()
    return tuple(
        (Check(_line(call), function.name, _rules_of(function, node.body)), bit)
        for function in _functions()
        for node in ast.walk(function)
        if isinstance(node, ast.If)
        for call in _calls(node.test, "are_set")
        for said, bits in RESERVED.items()
        if said in lines[_line(call) - 1].replace('"', "'")
        for bit in bits
    )


def _rules_of(function: ast.FunctionDef, body: Iterable[ast.stmt]) -> tuple[str, ...]:
    refused = (call.args[1] for part in body for call in _calls(part, "refuse"))
    return tuple(sorted({rule for stated in refused for rule in _rules(function, stated)}))


def _rules_inside(call: ast.expr) -> set[str]:
    """The rules of the function that is called, of which the arguments may name some."""
    (named,) = (_name(node.func) for node in [call] if isinstance(node, ast.Call))
    rules = {rule for check in refusals() if check.function == named for rule in check.rules}
    refused = (one for function in _functions() if function.name == named for one in _calls(function, "refuse"))
    own = {rule for one in refused for rule in _stated(one.args[1])}
    return rules & _stated(call) | own if rules & _stated(call) else rules


def _line(call: ast.Call) -> int:
    return int(ast.literal_eval(call.args[0]))


def _calls(node: ast.AST, name: str) -> Iterator[ast.Call]:
    return (n for n in ast.walk(node) if isinstance(n, ast.Call) and _name(n.func) == name)


def _rules(function: ast.FunctionDef, rule: ast.expr) -> set[str]:
    """The rules that an expression stands for: those that it names, or that its variable is given anywhere."""
    if stated := _stated(rule):
        return stated
    name, place = _name(rule), [argument.arg for argument in function.args.args]
    given: list[ast.AST] = []
    for node in _parts():
        if isinstance(node, ast.keyword) and node.arg == name:
            given.append(node.value)
        if isinstance(node, ast.Assign) and any(_name(target) == name for target in node.targets):
            given.append(node.value)
        if isinstance(node, ast.FunctionDef) and name in (argument.arg for argument in node.args.args):
            given += node.args.defaults
        if isinstance(node, ast.Call) and _name(node.func) == function.name and name in place:
            given.append(node.args[place.index(name)])
    given += [
        loop.iter for loop in ast.walk(function) if isinstance(loop, ast.For) and name in ast.unparse(loop.target)
    ]
    return {found for part in given for found in _stated(part)}


@cache
def _parts() -> tuple[ast.AST, ...]:
    return tuple(part for tree in _code() for part in ast.walk(tree))


def _stated(node: ast.AST) -> set[str]:
    texts = (str(part.value) for part in ast.walk(node) if isinstance(part, ast.Constant))
    return {text for text in texts if re.fullmatch(r"R-[\d.]+-\d+", text)}


@dataclass
class Reader:
    """A reader of `main` that leaves some checks out.

    Attributes
    ----------
    forgotten
        Lines and rules of the refusals that it leaves out; None: all.
    inside
        Lines and rules of the refusals that it leaves out in a check that it calls there.
    untold
        The line and text of a condition that it does not look at.
    unseen
        The line and number of a reserved bit that it does not look at.
    one_off
        The line and number of an inequality that it has the neighbour of: `>` for `>=`, and the other way round.
    names
        What the code defines.
    left_out
        How many refusals it left out in the stream that it was asked last.
    """

    forgotten: set[tuple[int, str]] | None = field(default_factory=set)
    inside: set[tuple[int, str]] = field(default_factory=set)
    untold: tuple[int, str] | None = None
    unseen: tuple[int, int] | None = None
    one_off: tuple[int, int] | None = None
    names: dict[str, Any] = field(default_factory=dict)
    left_out: int = 0
    _calls: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.names |= {"__name__": "reader", "refuse": self._refuse, "compares": self._compares}
        self.names |= {"holds": self._holds, "are_set": self._are_set, "within": self._within}
        for tree in _compiled():
            exec(tree, self.names)

    def _refuse(self, line: int, rule: str, bit: int) -> None:
        places = {line, *self._calls}
        left_out = self.forgotten is None or (line, rule) in self.forgotten
        if not left_out and self.inside.isdisjoint((place, rule) for place in places):
            raise self.names["Fault"](rule, bit)
        self.left_out += 1
        if self.left_out > PATIENCE:
            raise RecursionError("it never ends")

    def _within(self, line: int, check: Callable[[], object]) -> None:
        self._calls.append(line)
        try:
            check()
        finally:
            self._calls.pop()

    def _holds(self, line: int, text: str, condition: Callable[[], bool], negated: bool) -> bool:
        return negated if (line, text) == self.untold else condition()

    def _are_set(self, line: int, bits: int) -> bool:
        return any(bits >> bit & 1 and (line, bit) != self.unseen for bit in range(8))

    def _compares(self, line: int, signs: str, *values: Any) -> bool:
        for number, (sign, left, right) in enumerate(zip(signs.split(), values, values[1:], strict=False)):
            if (line, number) == self.one_off:
                sign = sign[0] if len(sign) == 2 else f"{sign}="
            if not INEQUALITIES[sign](left, right):
                return False
        return True

    def forget(self, checks: Collection[tuple[int, str]] | None, inside: Iterable[tuple[int, str]] = ()) -> None:
        """Leave these checks out, and no others; a limit with R-5-9, which says the same where there are no layers."""
        self.inside, self.untold, self.unseen, self.one_off = set(inside), None, None, None
        self.forgotten = None if checks is None else set(checks)
        if checks is not None and any(rule.startswith(LIMITS) and rule != "R-5-9" for _, rule in checks):
            self.forgotten = {*self.forgotten, *_stand_ins()}  # type: ignore[misc]

    def answer(self, operation: str, inputs: dict[str, Any]) -> dict[str, Any] | None:
        """Its answer; None if it has none."""
        self.left_out = 0
        try:
            return dict(self.names[operation](**inputs))
        except Exception:
            return None


@cache
def _stand_ins() -> frozenset[tuple[int, str]]:
    return frozenset((check.line, "R-5-9") for check in refusals() if "R-5-9" in check.rules)


@cache
def _compiled() -> tuple[Any, ...]:
    return tuple(compile(tree, str(SPEC), "exec") for tree in _code())
