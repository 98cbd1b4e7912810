"""The code of spec.md, to be called: the plain form of everything that gsvc_ref does.

    from gsvc_base import spec

    spec.lsq_quantize(x, scale, offset, bits=6)["codes"]            # x (N, 3) f4, scale and offset (3,) f4
    spec.decode_stream(Path("clip.gsvc").read_bytes())["frames"]    # (T, H, W, 3) u1

This is the document, not a copy of it: the module runs the Python blocks of spec.md in their order, and tracebacks,
debuggers and `inspect.getsource` show the lines of spec.md. An operation of the document is a function of its named
inputs, and returns a dict of its named outputs; section 4.3 has their types and shapes. The code is slow, checks
nothing that the document does not ask to be checked, and shares no line with the rest of gsvc_ref, which has the
operations again as functions that are fast.
"""

import linecache as _linecache
import types as _types
from typing import TYPE_CHECKING as _TYPE_CHECKING
from typing import Any as _Any

from gsvc_base import document as _document

if _TYPE_CHECKING:

    def __getattr__(name: str) -> _Any: ...


__file__ = str(_document.PATH)  # where `inspect` looks for the source of classes
_lines = _document.as_python()
# An entry without a time stands for good. Its text can be parsed as Python, which `inspect` wants of a class's file.
_linecache.cache[__file__] = (sum(map(len, _lines)), None, _lines, __file__)

for _block in _document.blocks():
    exec(compile(_block, __file__, "exec"), globals())


def _is_defined(name: str, value: object) -> bool:
    """Whether the document defines a name, and does not import it."""
    imported = isinstance(value, _types.ModuleType) or (isinstance(value, type) and value.__module__ != __name__)
    return not name.startswith("_") and not imported


__all__ = [name for name, value in globals().copy().items() if _is_defined(name, value)]


def __dir__() -> list[str]:
    return __all__
