"""Packages whose names are loaded when they are first used, so that a command waits for what it needs alone."""

import re
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from sys import modules
from typing import Any, Final

_IMPORT: Final = re.compile(r"^from (\S+) import (\w+)", re.MULTILINE)
_ALIAS: Final = re.compile(r"^(\w+) = (\w+)$", re.MULTILINE)


def lazily(
    package: str, **offered: Callable[[str], Any]
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` of a package, from its stub ``__init__.pyi``, which type checkers read.

    A line ``from MODULE import NAME as NAME`` of the stub is a name and its home; ``PUBLIC = NAME`` renames it.
    `offered` has, by a package that plugs itself in, what gives its names: this one must not import it.
    """
    file = modules[package].__file__
    assert file is not None
    stub = Path(file).with_suffix(".pyi").read_text(encoding="utf-8")
    homes = {name: (module, name) for module, name in _IMPORT.findall(stub)}
    homes |= {public: homes.pop(name) for public, name in _ALIAS.findall(stub)}

    def get(name: str) -> Any:
        if name not in homes:
            if name.isidentifier() and name[0] != "_" and find_spec(f"{package}.{name}"):  # a module of the package
                return import_module(f"{package}.{name}")
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, attribute = homes[name]
        if (plugged := offered.get(module.partition(".")[0])) is not None:
            value = plugged(name)
        else:  # a name of the module, or a module of the package
            value = getattr(import_module(module), attribute, None) or import_module(f"{module}.{attribute}")
        setattr(modules[package], name, value)
        return value

    names = sorted(homes)
    return get, lambda: sorted({*vars(modules[package]), *names}), names
