"""Numba's cache of compiled kernels, in a folder of ours, where damage or a second process does no harm."""

import errno
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, Final

from numba.core import sigutils
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    _CacheLocator,
    _SourceFileBackedLocatorMixin,
)

from gsvc_ref._kernel_folder import kernel_folder

FOLDER: Final = kernel_folder()
"""Where kernels are kept, if anywhere."""

LOCK_NAME: Final = "lock"
PATIENCE_S: Final = 5.0
"""How long to wait for another process that saves a kernel; then this one is not kept."""


def _untyped(function: Any) -> Any:
    """A function of Numba's, which has no types."""
    return function


class _Locator(_SourceFileBackedLocatorMixin, _CacheLocator):
    """Names the kernel folder, so that `numba.config`, which belongs to the whole process, stays as it is."""

    def __init__(self, function: Any, file: str) -> None:
        if FOLDER is None:
            raise OSError("there is no folder for kernels")
        self._py_file, self._lineno = file, function.__code__.co_firstlineno
        self._path = os.path.join(FOLDER, _untyped(self.get_suitable_cache_subpath)(file))

    def get_cache_path(self) -> str:
        """The folder of the kernels of one source file."""
        return self._path


class _Implementation(CompileResultCacheImpl):
    _locator_classes = [_Locator]  # noqa: RUF012


class KernelCache(FunctionCache):
    """The compiled forms of one function on disk.

    Whatever cannot be read is compiled anew, and whatever cannot be written is not kept: neither is a fault of the
    program that runs. One process writes at a time, since Numba's index and its data are two files.

    Raises
    ------
    RuntimeError, OSError
        There is no folder to keep kernels in.
    """

    _impl_class = _Implementation

    def load_overload(self, signature: Any, target: Any) -> Any:
        """The compiled form for a signature, or None."""
        try:
            found = _untyped(super().load_overload)(signature, target)
        except Exception:  # a damaged file may raise anything when it is unpickled
            self._forget()
            return None
        wanted, _ = _untyped(sigutils.normalize_signature)(signature)
        return found if found is not None and tuple(found.signature.args) == tuple(wanted) else None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep a compiled form, if that can be done."""
        with suppress(OSError), self._alone():
            _untyped(super().save_overload)(signature, compiled)

    def _forget(self) -> None:
        """Begin a new index."""
        with suppress(OSError), self._alone():
            _untyped(self.flush)()

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Hold back other processes, where the system has locks.

        Raises
        ------
        OSError
            The folder cannot be written, or another process does not let go.
        """
        try:
            import fcntl
        except ImportError:
            yield
            return
        os.makedirs(self.cache_path, exist_ok=True)
        with open(os.path.join(self.cache_path, LOCK_NAME), "ab") as file:
            end = time.monotonic() + PATIENCE_S
            while True:
                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                except OSError as error:
                    if error.errno not in (errno.EAGAIN, errno.EACCES) or time.monotonic() > end:
                        raise
                time.sleep(0.02)
            yield
