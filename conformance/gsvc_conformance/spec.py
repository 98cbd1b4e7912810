"""The code inside spec.md: as `gsvc_base.spec` runs it, patched for mutants, or with other functions in it."""

import types
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import Any, Final

from gsvc_base import spec
from gsvc_base.document import PATH, blocks

SPEC: Final = PATH
SLOW: Final = "[nearest_exp2(i) for i in range(1024)]"
"""What makes EXP2."""

Patch = tuple[str, str]
"""A text of the code, which occurs exactly once, and what stands there instead."""


def source() -> str:
    """All blocks, one after the other."""
    return "\n\n".join(block.lstrip("\n") for block in blocks())


def namespace(
    patches: Iterable[Patch] = (), functions: Mapping[str, Callable[..., Any]] | None = None
) -> dict[str, Any]:
    """The names that the code defines, with their values.

    Parameters
    ----------
    patches
        Changes, made in order; without any it is the code as it stands, whose functions are those of `gsvc_base.spec`.
    functions
        Functions that take the place of the code's own, which then calls these.

    Raises
    ------
    LookupError
        The text of a patch does not occur exactly once, or there is no function of a name.
    """
    patches = tuple(patches)
    if not patches and not functions:
        return _original()
    names: dict[str, Any] = {"__name__": spec.__name__}
    for block in _patched(patches):
        exec(_compiled(block), names)
    if strange := (functions or {}).keys() - names.keys():
        raise LookupError(f"the code of spec.md has no {', '.join(sorted(strange))}")
    names.update(functions or {})
    return names


def header_rows(profile: str = "") -> tuple[tuple[str, int, int, int], ...]:
    """The elements of the sequence header of a profile, or of all: name, bytes, lowest and highest accepted value."""
    names = _original()
    tools = {"paper": names["PAPER_HEADER"], "main": names["MAIN_HEADER"]}
    rows = [*names["HEADER"], *(row for name, some in tools.items() if profile in ("", name) for row in some)]
    return tuple({row[0]: row for row in rows}.values())


def complexity(function: str) -> int:
    """The number of the code's functions that a function leads to, itself among them; 0 if it is none of them."""
    return len(leads_to(function))


@cache
def leads_to(function: str) -> frozenset[str]:
    """The code's functions that a function leads to, itself among them; none if it is none of them."""
    names = _original()
    found: set[str] = set()
    waiting = [function]
    while waiting:
        name = waiting.pop()
        value = names.get(name)
        members = list(vars(value).values()) if isinstance(value, type) else [value]
        codes = [member.__code__ for member in members if isinstance(member, types.FunctionType)]
        if name not in found and codes:
            found.add(name)
            waiting += [used for code in codes for used in _used(code)]
    return frozenset(found)


def _used(code: types.CodeType) -> set[str]:
    """The global names that a function uses."""
    inner = [constant for constant in code.co_consts if isinstance(constant, types.CodeType)]
    return set(code.co_names).union(*(_used(constant) for constant in inner))


def _patched(patches: tuple[Patch, ...]) -> list[str]:
    code = list(blocks())
    for old, new in patches:
        homes = [place for place, block in enumerate(code) for _ in range(block.count(old))]
        if len(homes) != 1:
            raise LookupError(f"{old!r} occurs {len(homes)} times in the code of spec.md, not once")
        code[homes[0]] = code[homes[0]].replace(old, new)
    return [_with_table(block) if block == before else block for block, before in zip(code, blocks(), strict=True)]


@cache
def _with_table(block: str) -> str:
    """A block with the numbers of EXP2 in place of what makes them, which takes longer than all the other code."""
    return block.replace(SLOW, str(spec.EXP2.tolist()))


@cache
def _compiled(block: str) -> types.CodeType:
    return compile(block, str(SPEC), "exec")


@cache
def _original() -> dict[str, Any]:
    return {name: value for name, value in vars(spec).items() if not name.startswith("_")}
