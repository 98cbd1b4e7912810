"""The conformance kit of GSVC: golden vectors, and what judges an implementation by them.

    gsvc-conformance run --impl "my-decoder --conformance"      # any language: see protocol.md
    gsvc-conformance run --module mypackage.gsvc                # Python
    pytest --gsvc-module mypackage.gsvc                         # Python, one test a vector
    gsvc-conformance --help

Python programs use `vectors`, `judge`, `assert_vector` and `diagnose`, and `make_vector` and `add_vectors` for vectors
of their own; they are imported when they are asked for.

Whatever an implementation can be asked is an *operation* (`operation`, `operations/`): a function of named inputs. A
*case* (`case`, `cases/`) gives inputs and asserts what must hold of the outputs; written to `vectors/` it is a *vector*
(`vector`). What an output must be is an *expectation* (`expectations`), derived from an oracle and not from
gsvc_ref's output where rounding is left free. `runner` and `report` judge, `mutants` judges the judge. What
judges needs gsvc_base and NumPy alone; `cases` and `streams`, which make vectors and streams, need gsvc_ref.

A checkout and gsvc_ref's wheel have `gsvc_base` as a package of its own; a wheel of the kit carries the same files in
`bundled`. They are used under the same name, so that an error or a `Splats` of gsvc_ref is one of the kit's.
"""

import importlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from gsvc_conformance.interface import assert_vector, diagnose, judge, vectors
    from gsvc_conformance.making import add_vectors, make_vector
    from gsvc_conformance.results import Result
    from gsvc_conformance.vector import Vector

__version__ = "0.1.0"
__all__ = ["Result", "Vector", "add_vectors", "assert_vector", "diagnose", "judge", "make_vector", "vectors"]

EXPORTS: Final = {
    "Result": "results",
    "Vector": "vector",
    "add_vectors": "making",
    "assert_vector": "interface",
    "diagnose": "interface",
    "judge": "interface",
    "make_vector": "making",
    "vectors": "interface",
}
"""The module of each exported name."""

BUNDLED: Final = Path(__file__).parent / "bundled"
if BUNDLED.is_dir():  # first, so that a kit judges by what it carries
    sys.path.insert(0, str(BUNDLED))


def __getattr__(name: str) -> Any:
    if name not in EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{EXPORTS[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *EXPORTS})
