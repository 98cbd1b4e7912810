"""A quicker first compilation of kernels: those that only other kernels call, and types that Numba finds again.

Both lean on Numba's inside, so tests run them on the oldest and the newest Numba, and an unknown one goes without.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import numba
from numba.core import compiler, types, typing
from numba.core.codegen import JITCodeLibrary
from numba.core.types import functions

PARTS: Final = (0, 61) <= numba.version_info.short <= (0, 68)
"""Whether kernels have parts: with the versions of Numba that the tests have seen. Without parts only time is lost."""

_FOUND: Final[dict[tuple[Any, ...], Any]] = {}
"""The signature of a function of Numba, such as ``+``, for the types of its arguments."""


class Part:
    """The forms of a kernel that other kernels call, beside those that its dispatcher makes for Python.

    Numba itself would make of each kernel, before it is compiled once more as part of its callers, a function that
    takes Python's objects, optimised code and machine code, and keep them on disk. A part is only code for LLVM, which
    is optimised in the kernel that Python calls. A number that is written in a call gives no form of its own.
    """

    def __init__(self, dispatcher: Any) -> None:
        self._dispatcher = dispatcher
        self._forms: dict[tuple[Any, ...], Any] = {}

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """What Numba asks a dispatcher for when it finds the type of a call."""
        pysig, args = self._dispatcher.fold_argument_types(args, kws)
        args = tuple(map(types.unliteral, args))
        if args not in self._forms:
            self._forms[args] = self._compiled(args)
        numbas: Any = typing
        name, signatures = self._dispatcher.py_func.__name__, [self._forms[args].signature]
        template = numbas.make_concrete_template(f"Part({name})", key=name, signatures=signatures)
        return template, pysig, args, {}

    def get_overload(self, args: Any) -> Any:
        """What Numba asks a dispatcher for when it writes a call: the key under which it knows the code."""
        return self._forms[tuple(args)].library

    def _compiled(self, args: tuple[Any, ...]) -> Any:
        """Compile the form for types of arguments, and tell Numba of its code."""
        numbas: Any = compiler
        function, target = self._dispatcher.py_func, self._dispatcher._compiler.targetdescr
        types_of, context = target.typing_context, target.target_context
        flags = numbas.Flags()
        target.options.parse_as_flags(flags, self._dispatcher.targetoptions)
        flags.no_cpython_wrapper = flags.no_cfunc_wrapper = flags.no_compile = True
        code: Any = _PartLibrary
        library = code(context.codegen(), function.__qualname__)
        form = numbas.compile_extra(
            types_of, context, function, args, None, flags, {}, library=library, pipeline_class=RememberingCompiler
        )
        context.insert_user_function(library, form.fndesc, [library])
        return form


class _PartLibrary(JITCodeLibrary):
    """The code of a part: not optimised as a whole, and no machine code is made of it."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        library: Any = self
        library._finalize_dynamic_globals()
        library._verify_declare_only_symbols()
        library._finalized = True


class RememberingCompiler(compiler.Compiler):
    """Numba's compiler, which while it works does not look twice for the type of the same operation.

    For each ``+`` it would ask the additions of all its types, and NumPy's, which of them it is.
    """

    def compile_extra(self, function: Any) -> Any:
        """Compile a function of Python."""
        numbas: Any = super()
        with _remembered_types():
            return numbas.compile_extra(function)


@contextmanager
def _remembered_types() -> Iterator[None]:
    """Have Numba's functions remember their types; Numba compiles in one thread at a time."""
    base: Any = functions.BaseFunction
    numbas = base.get_call_type

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        key = self, context, tuple(args)
        signature = None if kws else _FOUND.get(key)
        if signature is None:
            signature = numbas(self, context, args, kws)
            if signature is not None and not kws:
                _FOUND[key] = signature
        return signature

    base.get_call_type = get_call_type
    try:
        yield
    finally:
        base.get_call_type = numbas
