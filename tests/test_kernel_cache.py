"""Kernels never outlive their sources, and damage, full disks, other processes and closed folders cost time only."""

import importlib
import os
import signal
import stat
import subprocess
import sys
import time
import traceback
import warnings
from pathlib import Path

import numpy as np
import pytest
from numba.core.caching import IndexDataCacheFile

from gsvc_ref import _kernel_cache

posix = pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")

KERNELS = """
from gsvc_ref._jit import kernel
@kernel()
def double(x):
    return x + x
"""

MODULE = "kernels_of_a_test"
ARGUMENTS = {"i": 3, "f": 1.5, "c": 2j, "a": np.arange(3)}


@pytest.fixture
def compiler() -> None:
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        pytest.skip("nothing is compiled")


@pytest.fixture
def folder(compiler, tmp_path, monkeypatch) -> Path:
    (tmp_path / f"{MODULE}.py").write_text(KERNELS)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(_kernel_cache, "kernel_folder", lambda package: tmp_path / "cache")
    return tmp_path


def start(kinds: str) -> tuple[int, int]:
    """Load the kernel as a new process would, and call it: how many forms were found, and how many made."""
    sys.modules.pop(MODULE, None)
    module = importlib.import_module(MODULE)
    for kind in kinds:
        assert np.all(module.double(ARGUMENTS[kind]) == 2 * ARGUMENTS[kind]), kind
    stats = module.double.dispatcher().stats
    return sum(stats.cache_hits.values()), sum(stats.cache_misses.values())


def cached(folder: Path, suffix: str) -> list[Path]:
    return sorted((folder / "cache").rglob(f"*{suffix}"))


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("how", ["empty", "cut", "zeros", "text"])
def test_a_damaged_file_is_made_again(folder, suffix, how):
    assert start("i") == (0, 1)
    [path] = cached(folder, suffix)
    data = path.read_bytes()
    path.write_bytes({"empty": b"", "cut": data[: len(data) // 2], "zeros": bytes(len(data)), "text": b"no"}[how])
    assert start("i") == (0, 1)
    assert start("i") == (1, 0)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="only POSIX can fork")
def test_processes_that_start_at_once_do_not_mix_their_kernels(folder, monkeypatch):
    """Numba's index and data are two files, so one process's name for a form may lead to another's code."""

    def slow(self, load=IndexDataCacheFile._load_index):
        index = load(self)
        time.sleep(0.2)  # for the others to load the same
        return index

    children = []
    with monkeypatch.context() as patch, warnings.catch_warnings():
        patch.setattr(IndexDataCacheFile, "_load_index", slow)
        warnings.simplefilter("ignore", DeprecationWarning)  # a fork while there are threads
        for kinds in ("i", "f", "c"):
            child = os.fork()
            if child == 0:
                try:
                    start(kinds)
                    os._exit(0)
                except BaseException:
                    traceback.print_exc()
                    os._exit(1)
            children.append(child)
    assert [os.waitpid(child, 0)[1] for child in children] == [0] * 3
    start("fic")  # what is missing, or not what its name says, is made again
    assert start("fic") == (3, 0)


def test_a_form_under_the_wrong_name_is_not_used(folder):
    assert start("if") == (0, 2)
    integers, floats = cached(folder, ".nbc")
    floats.write_bytes(integers.read_bytes())
    start("if")
    assert start("if") == (2, 0)


@posix
def test_a_full_disk_costs_only_the_next_start(folder):
    import resource

    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        assert start("i") == (0, 1)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, ignored)
    assert cached(folder, ".nbc") == []
    assert start("i") == (0, 1)
    assert start("i") == (1, 0)


def test_a_kernel_that_is_not_called_looks_at_no_file(folder):
    sys.modules.pop(MODULE, None)
    importlib.import_module(MODULE)
    assert not (folder / "cache").exists()
    assert sys.modules[MODULE].double.dispatcher().stats.cache_path.startswith(str(folder / "cache"))


def test_without_a_folder_kernels_are_compiled_each_time(folder, monkeypatch):
    monkeypatch.setattr(_kernel_cache, "kernel_folder", lambda package: None)
    for _ in range(2):
        assert start("i") == (0, 1)


def test_a_folder_that_went_away_is_not_replaced_by_one_that_knows_of_no_other_sources(folder, monkeypatch):
    """Numba would go on to keep kernels beside their source, and look at that alone."""
    monkeypatch.setattr(_kernel_cache, "kernel_folder", lambda package: folder / f"{MODULE}.py" / "cache")
    for _ in range(2):
        assert start("i") == (0, 1)
    assert list(folder.rglob("*.nb?")) == []


def test_another_numba_loads_kernels_in_its_own_way(folder, monkeypatch):
    monkeypatch.setattr(_kernel_cache, "TESTED", False)
    assert start("i") == (0, 1)
    assert start("i") == (1, 0)


def run(folder: Path, *options: str, code: str = f"import {MODULE}", **variables: str) -> subprocess.CompletedProcess:
    """A new process in a folder, with a home and a cache that are no folders unless they are given."""
    (folder / "file").touch()
    nowhere = str(folder / "file")
    inherited = {name: os.environ[name] for name in ("PATH", "PYTHONPATH", "SYSTEMROOT") if name in os.environ}
    environment = {**inherited, "HOME": nowhere, "XDG_CACHE_HOME": nowhere, **variables}
    command = [sys.executable, *options, "-c", code]
    return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=100, cwd=folder)


PACKAGE_CODE = """
import sys
sys.path.insert(0, '')
import numba
from gsvc_ref import _kernel_cache
from package.main import total
before = numba.config.CACHE_DIR
print(total(1), sum(total.dispatcher().stats.cache_hits.values()), not before)
print(_kernel_cache.kernel_folder("package"))
"""


@pytest.fixture
def package(compiler, tmp_path) -> Path:
    """Another package with a kernel that calls one of another file."""
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "__init__.py").touch()
    (tmp_path / "package" / "parts.py").write_text(
        "from gsvc_ref._jit import kernel\n@kernel(inline=True)\ndef part(x):\n    return x + 1\n"
    )
    (tmp_path / "package" / "main.py").write_text(
        "from gsvc_ref._jit import kernel\nfrom package.parts import part\n"
        "@kernel()\ndef total(x):\n    return 10 * part(x)\n"
    )
    return tmp_path


@pytest.mark.parametrize("variable", ["XDG_CACHE_HOME", pytest.param("NUMBA_CACHE_DIR", marks=pytest.mark.exhaustive)])
def test_a_second_start_compiles_nothing_and_a_changed_source_anew(package, variable):
    """Numba alone looks only at the file of the function that it loads."""
    variables = {variable: str(package / "new" / "cache")}

    def start() -> tuple[str, Path]:
        found = run(package, code=PACKAGE_CODE, **variables)
        assert (found.returncode, found.stderr) == (0, "")
        values, folder = found.stdout.splitlines()
        return values, Path(folder)

    first = start()
    numbas_own = variable == "XDG_CACHE_HOME"  # which stays as the user set it
    assert first == (f"20 0 {numbas_own}", first[1])
    assert package / "new" / "cache" in first[1].parents
    assert start() == (f"20 1 {numbas_own}", first[1])
    parts = package / "package" / "parts.py"
    parts.write_text(parts.read_text().replace("x + 1", "x + 2.0"))  # a .pyc knows its source by size and second
    second = start()
    assert second == (f"30.0 0 {numbas_own}", second[1])
    assert second[1].parent == first[1].parent
    assert list(first[1].parent.iterdir()) == [second[1]]  # the kernels of the old sources are gone


LOADED_THEN_COMPILED = """
import sys
sys.path.insert(0, '')
import numba
import numpy as np
from package.main import total
print(total(1), sum(total.dispatcher().stats.cache_hits.values()), "numba.np.linalg" in sys.modules)
print(total(1.5), total(np.arange(2)))  # other forms, of which the second allocates
print(numba.njit(lambda x: np.linalg.norm(np.ones(x)))(4))  # one of the user
"""


def test_what_is_loaded_needs_none_of_the_compilers_tables_and_what_is_compiled_makes_them(package):
    variables = {"XDG_CACHE_HOME": str(package / "cache")}
    run(package, code=PACKAGE_CODE, **variables)
    found = run(package, code=LOADED_THEN_COMPILED, **variables)
    assert (found.returncode, found.stderr) == (0, "")
    assert found.stdout.splitlines() == ["20 1 False", "25.0 [10 20]", "2.0"]


@pytest.fixture
def places(monkeypatch, tmp_path) -> Path:
    """A package, a home and a cache in a folder of the test."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    monkeypatch.setattr(_kernel_cache, "PACKAGE", tmp_path / "package")
    (tmp_path / "package").mkdir()
    return tmp_path


def kernel_folder() -> Path | None:
    _kernel_cache._base.cache_clear()
    _kernel_cache.kernel_folder.cache_clear()
    try:
        return _kernel_cache.kernel_folder()
    finally:
        _kernel_cache._base.cache_clear()
        _kernel_cache.kernel_folder.cache_clear()


def test_the_folder_changes_with_the_contents_of_any_source(places):
    source = places / "package" / "rendering" / "tasks.py"
    source.parent.mkdir()
    source.touch()
    first = kernel_folder()
    os.utime(source, ns=(1, 1))
    assert kernel_folder() == first
    source.write_text("EDITED = 1\n")
    second = kernel_folder()
    assert second != first
    assert second.parent == first.parent
    (places / "package" / "cli").mkdir()
    (places / "package" / "cli" / "text.py").touch()
    assert kernel_folder() == second


def test_folders_without_kernels_have_none():
    package = _kernel_cache.PACKAGE
    sources = {path: path.read_text(encoding="utf-8") for path in package.rglob("*.py")}
    users = {path.relative_to(package).parts[0] for path, text in sources.items() if "@kernel(" in text}
    assert {"rendering", "paper"} <= users
    assert not users & set(_kernel_cache.WITHOUT_KERNELS)


def test_only_folders_of_the_same_installation_are_removed(places):
    present = kernel_folder()
    old, other = present.with_name("111111111111"), present.parent.parent / "gsvc_ref-000000000000" / "111111111111"
    for folder in (old, other):
        folder.mkdir(parents=True)
    assert kernel_folder() == present
    assert not old.exists()
    assert other.is_dir()


@posix
def test_a_users_cache_is_used_only_if_nobody_else_can_write_to_it(places, monkeypatch):
    monkeypatch.setattr(_kernel_cache, "_warn", lambda sentence: None)
    (places / "package" / "__pycache__").touch()  # so that there is no other place
    made = places / "user" / "gsvc_ref"
    assert made in kernel_folder().parents
    assert stat.S_IMODE(made.stat().st_mode) == 0o700
    for mode, trusted in ((0o755, True), (0o770, False), (0o757, False), (0o777, False)):
        made.chmod(mode)
        assert (kernel_folder() is not None) == trusted
    made.chmod(0o700)
    (places / "link").mkdir()
    (places / "link" / "gsvc_ref").symlink_to(made)
    with monkeypatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(places / "link"))
        assert kernel_folder() is None
    monkeypatch.setattr(os, "geteuid", lambda: made.stat().st_uid + 1)  # as if another user had made it
    assert kernel_folder() is None


@posix
def test_in_a_chosen_folder_of_all_users_kernels_are_read_only_from_our_own(places, monkeypatch):
    """What is in it is run: it was taken from a folder that somebody else had made there."""
    monkeypatch.setattr(_kernel_cache, "_warn", lambda sentence: None)
    shared = places / "shared"
    shared.mkdir()
    shared.chmod(0o1777)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(shared))
    own = kernel_folder().parent
    assert own.parent == shared
    assert stat.S_IMODE(own.stat().st_mode) == 0o700
    own.chmod(0o777)
    assert places / "user" in kernel_folder().parents
    own.rmdir()
    own.symlink_to(places / "package")
    assert places / "user" in kernel_folder().parents


def test_without_a_home_kernels_are_kept_beside_the_package(places, monkeypatch):
    (places / "file").touch()
    beside = places / "package" / "__pycache__" / "kernels"
    monkeypatch.setenv("XDG_CACHE_HOME", str(places / "file"))
    assert beside in kernel_folder().parents
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(Path, "home", lambda: (_ for _ in ()).throw(RuntimeError("no home")))
    assert beside in kernel_folder().parents


CLOSED = """
import sys
sys.path.insert(0, '')
from gsvc_ref import _kernel_cache
_kernel_cache.PACKAGE = _kernel_cache.Path({package!r})
import kernels_of_a_test
print(kernels_of_a_test.double(3), sum(kernels_of_a_test.double.dispatcher().stats.cache_misses.values()))
print(_kernel_cache.kernel_folder())
"""


@pytest.mark.parametrize("options", [(), ("-W", "error")])
def test_without_a_place_a_warning_says_so_and_the_program_works(folder, options):
    """Where warnings are errors each command ended as by a fault."""
    found = run(folder, *options, code=CLOSED.format(package=str(folder / "file")))
    assert (found.returncode, found.stdout) == (0, "6 1\nNone\n"), found.stderr
    assert found.stderr.count("compiled kernels cannot be kept, so each start takes half a minute: set NUM") == 1


@pytest.mark.exhaustive
@pytest.mark.parametrize("options", [(), ("-W", "error")])
def test_a_folder_that_cannot_be_used_is_replaced_with_a_warning(folder, options):
    """It cost half a minute at each start, without a word."""
    cache = folder / "user"
    code = CLOSED.format(package=str(folder / "file"))
    for misses in (1, 0):
        found = run(folder, *options, code=code, NUMBA_CACHE_DIR="/dev/null", XDG_CACHE_HOME=str(cache))
        assert found.returncode == 0, found.stderr
        assert found.stdout.startswith(f"6 {misses}\n{cache}{os.sep}gsvc_ref{os.sep}")
        warning = f"cannot be kept in /dev/null, where NUMBA_CACHE_DIR says: they are kept in {cache / 'gsvc_ref'}"
        assert found.stderr.count(warning) == 1
        assert len(found.stderr.splitlines()) <= 2


def test_a_chosen_folder_stays_the_same_wherever_the_program_goes(places, monkeypatch):
    monkeypatch.chdir(places)
    monkeypatch.setenv("NUMBA_CACHE_DIR", "chosen")
    assert places / "chosen" in kernel_folder().parents


def test_a_folder_that_is_only_read_is_not_used(places, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(places))
    with pytest.warns(UserWarning, match="compiled kernels cannot be kept.*set NUMBA_CACHE_DIR"):
        assert kernel_folder() is None
