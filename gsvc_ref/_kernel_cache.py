"""Compiled kernels on disk, in a folder that is named by a digest of all sources that they may come from.

Numba alone looks only at the file of the function that it loads: after a change to a kernel or a constant in another
file it would go on running the old one.
"""

import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Final

from numba import config, version_info
from numba.core import runtime as numba_runtime
from numba.core.caching import FunctionCache

import gsvc_base
from gsvc_base.errors import UsageError
from gsvc_base.folders import OwnFolder
from gsvc_base.sources import digest, digests

PACKAGE: Final = Path(__file__).resolve().parent
BASE: Final = Path(gsvc_base.__file__).resolve().parent
"""The package whose constants kernels hold."""
WITHOUT_KERNELS: Final = ("cli", "exact", "pages", "testing")
"""Folders of both that no kernel comes from, so that a change there costs no compilation."""

TESTED: Final = (0, 61) <= version_info.short <= (0, 68)
"""Whether Numba is one of those whose inside the tests have seen. Another reads its cache in its own way."""


def keep(dispatcher: Any) -> Any:
    """Let Numba keep what a dispatcher compiles in our folder; its own setting, of the whole process, stays."""
    settings: Any = config
    if settings.DISABLE_JIT:  # it is the function
        return dispatcher
    function = dispatcher.py_func
    folder = kernel_folder(function.__module__.partition(".")[0])
    if folder is None:
        return dispatcher
    cached: Any = KernelCache
    with suppress(OSError, RuntimeError):  # the folder went away, or the function stands in no file
        before, settings.CACHE_DIR = settings.CACHE_DIR, str(folder)
        try:
            kept: Any = cached(function)
        finally:
            settings.CACHE_DIR = before
        if Path(kept.cache_path).is_relative_to(folder):  # not elsewhere, where no digest tells of changes
            dispatcher._cache = kept
    return dispatcher


class KernelCache(FunctionCache):
    """Numba's cache of one function, whose faults are not those of the program that runs.

    What cannot be read is compiled anew, and what cannot be written, as on a full disk, is not kept.
    """

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Load the compiled form for a signature, or None.

        Numba would first make the tables of all functions that can be compiled, for which it imports SciPy's linear
        algebra too: a third of a second. Machine code needs its runtime alone; what is compiled makes the tables.
        """
        numbas: Any = super()
        runtime: Any = numba_runtime
        try:
            if TESTED:
                runtime.rtsys.initialize(target)
                found = numbas._load_overload(signature, target)
            else:
                found = numbas.load_overload(signature, target)
        except Exception:  # a damaged file may raise anything when it is unpickled
            with suppress(OSError):
                numbas.flush()
            return None
        # Numba's index and data are two files, which processes that write at the same time may mix.
        return found if found is not None and tuple(found.signature.args) == tuple(signature) else None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep a compiled form, if that can be done."""
        numbas: Any = super()
        with suppress(Exception):  # besides a full disk: an index that is damaged, and a kernel inside a function
            numbas.save_overload(signature, compiled)


@cache
def kernel_folder(package: str = "gsvc_ref") -> Path | None:
    """The folder for the kernels of a package, compiled from its present sources and those of gsvc_ref and gsvc_base.

    Folders for other sources of the same installation are removed. None if there is no place for a folder.
    """
    base = _base()
    if base is None:
        return None
    name = digest(*_sources(package))
    try:
        with OwnFolder(_home(base, package)) as own:
            if name not in own.names():
                own.remove_others(name)
            return own.path / name
    except (OSError, UsageError) as error:
        _warn(f"compiled kernels of {package} cannot be kept: {error}")
        return None


def _home(base: Path, package: str) -> Path:
    """The folder of a package of this installation, which only we write to: kernels from there are run."""
    return base / f"{package}-{digest(str(PACKAGE))}"


@cache
def _base() -> Path | None:
    """NUMBA_CACHE_DIR, or else the user's cache, or else a folder beside the sources.

    Warns where kernels cannot be kept, or not in the folder that the user chose.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen and _is_own(_home(Path(chosen), "gsvc_ref")):
        return Path(chosen).absolute()
    base = next(filter(_is_own, _usual_bases()), None)
    if base is None:
        advice = "set NUMBA_CACHE_DIR to a folder that only you can write to"
        _warn(f"compiled kernels cannot be kept, so each start takes half a minute: {advice}")
    elif chosen:
        _warn(f"compiled kernels cannot be kept in {chosen}, where NUMBA_CACHE_DIR says: they are kept in {base}")
    return base


def _usual_bases() -> Iterator[Path]:
    """The user's cache, and a folder beside the sources for those who have no home."""
    with suppress(RuntimeError):  # there is no home
        yield Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gsvc_ref"
    yield PACKAGE / "__pycache__" / "kernels"


def _is_own(folder: Path) -> bool:
    """Whether this user, and as far as the system tells nobody else, can put files into a folder, which is made."""
    try:
        OwnFolder(folder, parents=True).close()
    except (OSError, UsageError):
        return False
    return os.access(folder, os.W_OK)


def _sources(package: str) -> Iterator[str]:
    """Path and digest of each source that kernels, or constants in them, may come from."""
    main = getattr(sys.modules.get(package), "__file__", None)
    for root in sorted({PACKAGE / "__init__.py", BASE / "__init__.py"} | ({Path(main).resolve()} if main else set())):
        yield from digests(root, WITHOUT_KERNELS if root.parent in (PACKAGE, BASE) else ())


def _warn(sentence: str) -> None:
    """Warn; where warnings are errors (``python -W error``) only say it, for what is slow works all the same."""
    try:
        warnings.warn(sentence, stacklevel=2)
    except Warning:
        if sys.stderr is not None:
            print(sentence, file=sys.stderr)
