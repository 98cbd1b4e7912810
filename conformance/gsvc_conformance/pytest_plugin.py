"""The pytest plug-in: ``pytest --gsvc-module mine`` has a test for each golden vector (protocol.md, "From pytest").

pytest imports this module in every session of every project, so it imports nothing: `pytest_vectors` is imported when
an option of ours is given.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pytest

OPTIONS = {
    "module": ("NAME", "judge a Python module (mine, not mine.py) by the golden vectors, a test each"),
    "impl": ("CMD", "judge a command, started as: CMD OPERATION IN_DIR OUT_DIR"),
    "serve": ("CMD", "judge a command that is started once, and answers vector after vector"),
    "timeout": ("S", "seconds for one vector, with --gsvc-impl and --gsvc-serve (60)"),
    "seconds": ("S", "small vectors first, and no more once these seconds are used: for what is slow"),
    "operation": ("NAME", "only vectors of this operation; may be given several times"),
    "class": ("NAME", "only vectors of this conformance class; may be given several times"),
    "case": ("GLOB", "only vectors whose id, or its last part, matches; may be given several times"),
    "waivers": ("FILE", "known failures (TOML), as strict xfail"),
    "features": ("FILE", "what it is made for (TOML): all that is inside is required, all else may be refused"),
    "model": ("MODEL", "the error model that bounds are derived from, such as tf32/1 (default: fp32/1)"),
    "set": ("N", "the vectors of this set (default: the newest)"),
    "vectors": ("DIR", "the vectors (default: those of the kit)"),
}
"""The options, without ``--gsvc-``, with what they take and their help."""
SEVERAL = ("operation", "class", "case")
JUDGED = ("module", "impl", "serve")
"""The options that say what is judged."""
NODE = "gsvc::"
"""The beginning of the node ids of vectors."""


def pytest_addoption(parser: "pytest.Parser") -> None:
    """The options, all called ``--gsvc-...``."""
    group = parser.getgroup("gsvc", "golden vectors of GSVC")
    for name, (metavar, sentence) in OPTIONS.items():
        action = "append" if name in SEVERAL else "store"
        group.addoption(f"--gsvc-{name}", action=action, metavar=metavar, help=sentence)


def pytest_configure(config: "pytest.Config") -> None:
    """Do nothing, unless an option is given or a vector is named."""
    given = any(config.getoption(f"--gsvc-{name}") for name in OPTIONS)
    if given or any(map(is_vector, config.args)):
        importlib.import_module("gsvc_conformance.pytest_vectors").configure(config)


def is_vector(argument: str) -> bool:
    """Whether an argument names vectors: ``gsvc::...``, or ``../gsvc::...`` as pytest shows it in another folder."""
    return argument.lstrip("./").startswith(NODE)
