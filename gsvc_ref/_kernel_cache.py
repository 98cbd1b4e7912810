"""Compiled kernels on disk, in a folder that is named by a digest of all sources that they may come from.

Numba alone looks only at the file of the function that it loads: after a change to a kernel or a constant in another
file it would go on running the old one.
"""

import os
import pickle
import shutil
import stat
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache, cached_property
from glob import glob
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

from numba.core import codegen, config
from numba.core import runtime as numba_runtime
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.environment import Environment, _rebuild_env

import gsvc_base
from gsvc_ref._kernel_parts import PARTS

PACKAGE: Final = Path(__file__).resolve().parent
BASE: Final = Path(gsvc_base.__file__).resolve().parent
"""The package whose constants kernels hold."""
WITHOUT_KERNELS: Final = ("cli", "exact", "pages", "testing")
"""Folders of both that no kernel comes from, so that a change there costs no compilation."""


class KernelCache:
    """What Numba asks for the compiled forms of one function; its faults are not those of the program that runs.

    What cannot be read is compiled anew, and what cannot be written, as on a full disk, is not kept. Numba's own cache
    stands behind it. It is made when a form is first asked for, since it looks at files and tries to write: most
    kernels are part of others, or are never called.
    """

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._function, self._folder = function, folder

    @cached_property
    def _numbas(self) -> Any:
        """Numba's cache in our folder; its own setting, which belongs to the whole process, stays."""
        settings: Any = config
        before, settings.CACHE_DIR = settings.CACHE_DIR, str(self._folder)
        try:
            return _FunctionCache(self._function)
        except (OSError, RuntimeError):  # the folder went away, or the function stands in no file
            return None
        finally:
            settings.CACHE_DIR = before

    @property
    def cache_path(self) -> str | None:
        """The folder in which Numba keeps the forms of this function; None if it cannot."""
        return None if self._numbas is None else str(self._numbas.cache_path)

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Load the compiled form for a signature, or None.

        Numba would first make the tables of all functions that can be compiled, for which it imports SciPy's linear
        algebra too: a third of a second. Machine code needs its runtime alone; what is compiled makes the tables.
        """
        if self._numbas is None:
            return None
        runtime: Any = numba_runtime
        load = getattr(self._numbas, "_load_overload", self._numbas.load_overload)
        try:
            runtime.rtsys.initialize(target)
            found = load(signature, target)
        except Exception:  # a damaged file may raise anything when it is unpickled
            self.flush()
            return None
        # Numba's index and data are two files, which processes that write at the same time may mix.
        return found if found is not None and tuple(found.signature.args) == tuple(signature) else None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep a compiled form, if that can be done.

        Numba would keep the code for LLVM too, for other kernels that call this one, and parse it at each start. Ours
        compile what they call themselves (`_kernel_parts`), so only the name stays by which Python's entry is found.
        """
        if self._numbas is None:
            return
        if PARTS:
            library, entry = compiled.library, compiled.fndesc.llvm_cpython_wrapper_name
            numbas: Any = codegen
            names = numbas.ll.parse_assembly(f'define void @"{entry}"() {{ ret void }}').as_bitcode()
            library.serialize_using_object_code = lambda: (
                library.name, "object", (library._get_compiled_object(), names)
            )  # fmt: skip
        with suppress(OSError):
            self._numbas.save_overload(signature, compiled)

    def flush(self) -> None:
        """Forget all forms."""
        if self._numbas is not None:
            with suppress(OSError):
                self._numbas.flush()


class _FunctionCache(FunctionCache):
    """Numba's cache of one function, with files that are read by `_Loader`."""

    def __init__(self, function: Callable[..., Any]) -> None:
        numba_cache: Any = super()
        numba_cache.__init__(function)
        file: Any = _KernelFile
        self._cache_file: Any = file(
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=self._impl.locator.get_source_stamp(),
        )


class _KernelFile(IndexDataCacheFile):
    def _load_data(self, name: str) -> Any:
        numbas: Any = self
        with open(numbas._data_path(name), "rb") as file:
            return _Loader(file).load()


class _Loader(pickle.Unpickler):
    """Reads a compiled form without importing the modules of Numba whose functions are part of it.

    Of such a module the machine code needs nothing: an *environment* holds constants, and the module's globals for
    code that is interpreted, which kernels are not. Numba would import its arrays for every ``np.empty``, and with them
    its strings: 0.1 seconds.
    """

    def find_class(self, module: str, name: str) -> Any:
        """The class or function of a name in the file."""
        found = super().find_class(module, name)
        return _rebuilt_environment if found is _rebuild_env else found


def _rebuilt_environment(module: str, constants: list[Any], name: str) -> Any:
    """Numba's environment of this name, or a new one that holds constants."""
    rebuild: Any = _rebuild_env
    if not module.startswith("numba.") or module in sys.modules:
        return rebuild(module, constants, name)
    environment: Any = Environment
    if (made := environment._memo.get(name)) is not None:
        return made
    made = environment({"__name__": module})
    made.consts[:] = constants
    made.env_name = name
    environment._memo[name] = made
    return made


@cache
def kernel_folder(package: str = "gsvc_ref") -> Path | None:
    """The folder for the kernels of a package, compiled from its present sources and those of gsvc_ref and gsvc_base.

    Folders for other sources of the same installation are removed. None if there is no place for a folder.
    """
    base = _base()
    if base is None:
        return None
    folder = base / f"{package}-{_digest(str(PACKAGE))}" / _digest(*_sources(package))
    if not folder.is_dir() and folder.parent.is_dir():
        for other in folder.parent.iterdir():
            if other != folder:  # another process may just have made it
                shutil.rmtree(other, ignore_errors=True)
    return folder


@cache
def _base() -> Path | None:
    """NUMBA_CACHE_DIR, or else a place that only this user can write to: kernels from there are run.

    Warns where kernels cannot be kept, or not in the folder that the user chose.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen and _can_be_written(Path(chosen)):
        return Path(chosen).absolute()
    base = next(filter(_is_private, _usual_bases()), None)
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


def _can_be_written(folder: Path) -> bool:
    """Whether files can be put into a folder, which is made."""
    with suppress(OSError):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    return folder.is_dir() and os.access(folder, os.W_OK)


def _is_private(folder: Path) -> bool:
    """Whether this user, and as far as the system tells nobody else, can put files into a folder."""
    if not _can_be_written(folder):
        return False
    if not hasattr(os, "geteuid"):
        return True
    found = folder.lstat()
    others = stat.S_IWGRP | stat.S_IWOTH
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.geteuid() and not found.st_mode & others


def _sources(package: str) -> Iterator[str]:
    """Path and digest of each source that kernels, or constants in them, may come from."""
    main = getattr(sys.modules.get(package), "__file__", None)
    for root in sorted({PACKAGE / "__init__.py", BASE / "__init__.py"} | ({Path(main).resolve()} if main else set())):
        folder, whole = str(root.parent), root.name == "__init__.py"
        for name in sorted(glob("**/*.py", root_dir=folder, recursive=True)) if whole else [root.name]:
            if root.parent not in (PACKAGE, BASE) or name.split(os.sep)[0] not in WITHOUT_KERNELS:
                with open(os.path.join(folder, name), "rb") as file:
                    yield f"{name} {sha256(file.read()).hexdigest()}"


def _digest(*parts: str) -> str:
    return sha256("\n".join(parts).encode()).hexdigest()[:12]


def _warn(sentence: str) -> None:
    """Warn; where warnings are errors (``python -W error``) only say it, for what is slow works all the same."""
    try:
        warnings.warn(sentence, stacklevel=2)
    except Warning:
        if sys.stderr is not None:
            print(sentence, file=sys.stderr)
