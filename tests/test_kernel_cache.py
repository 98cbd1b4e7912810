"""The cache of kernels bears damage, a full disk, several processes at once, and folders that others may write to."""

import importlib
import os
import signal
import stat
import sys
import time
import traceback
import warnings
from pathlib import Path

import numpy as np
import pytest
from numba.core.caching import IndexDataCacheFile

from gsvc_ref import _jit, _kernel_cache, _kernel_folder

pytestmark = pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT", "0") != "0", reason="nothing is compiled")

KERNELS = """
from gsvc_ref._jit import kernel
@kernel()
def double(x):
    return x + x
"""

MODULE = "kernels_of_a_test"
ARGUMENTS = {"i": 3, "f": 1.5, "c": 2j, "a": np.arange(3)}


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    (tmp_path / f"{MODULE}.py").write_text(KERNELS)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(_kernel_cache, "FOLDER", tmp_path / "cache")
    return tmp_path


def start(folder: Path, kinds: str) -> tuple[int, int]:
    """Load the kernel as a new process would, and call it: how many forms were found, and how many made."""
    sys.modules.pop(MODULE, None)
    module = importlib.import_module(MODULE)
    for kind in kinds:
        assert np.all(module.double(ARGUMENTS[kind]) == 2 * ARGUMENTS[kind]), kind
    return sum(module.double._cache_hits.values()), sum(module.double._cache_misses.values())


def cached(folder: Path, suffix: str) -> list[Path]:
    return sorted((folder / "cache").rglob(f"*{suffix}"))


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("how", ["empty", "cut", "zeros", "text"])
def test_a_damaged_file_is_made_again(folder, suffix, how):
    assert start(folder, "i") == (0, 1)
    [path] = cached(folder, suffix)
    data = path.read_bytes()
    path.write_bytes({"empty": b"", "cut": data[: len(data) // 2], "zeros": bytes(len(data)), "text": b"no"}[how])
    assert start(folder, "i") == (0, 1)
    assert start(folder, "i") == (1, 0)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="only POSIX can fork")
def test_processes_that_start_at_once_do_not_mix_their_kernels(folder, monkeypatch):
    """Numba's index and data are two files; without a lock, one process's name for a form could get another's code."""

    def slow(self, load=IndexDataCacheFile._load_index):
        index = load(self)
        time.sleep(0.2)  # for the others to load the same
        return index

    monkeypatch.setattr(IndexDataCacheFile, "_load_index", slow)
    children = []
    for kinds in ("i", "f", "c"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of a fork while there are threads
            child = os.fork()
        if child == 0:
            try:
                start(folder, kinds)
                os._exit(0)
            except BaseException:
                traceback.print_exc()
                os._exit(1)
        children.append(child)
    assert [os.waitpid(child, 0)[1] for child in children] == [0] * 3
    assert start(folder, "fic") == (3, 0)


def test_a_form_under_the_wrong_name_is_not_used(folder):
    assert start(folder, "if") == (0, 2)
    integers, floats = cached(folder, ".nbc")
    floats.write_bytes(integers.read_bytes())
    start(folder, "if")
    assert start(folder, "if") == (2, 0)


@pytest.mark.skipif(os.name != "posix", reason="limits of POSIX")
def test_a_full_disk_costs_only_the_next_start(folder):
    import resource

    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        assert start(folder, "i") == (0, 1)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, ignored)
    assert cached(folder, ".nbc") == []
    assert start(folder, "i") == (0, 1)
    assert start(folder, "i") == (1, 0)


@pytest.mark.parametrize("place", [None, "file"])
def test_without_a_folder_kernels_are_compiled_each_time(folder, monkeypatch, place):
    (folder / "file").touch()  # which is no folder, for root either
    monkeypatch.setattr(_kernel_cache, "FOLDER", place and folder / place)
    for _ in range(2):
        assert start(folder, "i") == (0, 1)


def test_somebody_who_does_not_let_go_is_not_waited_for(folder, monkeypatch):
    monkeypatch.setattr(_kernel_cache, "PATIENCE_S", 0.05)
    start(folder, "i")
    with cached(folder, _kernel_cache.LOCK_NAME)[0].open("rb") as file:
        fcntl = pytest.importorskip("fcntl")
        fcntl.flock(file, fcntl.LOCK_EX)
        assert start(folder, "f") == (0, 1)
    assert start(folder, "if") == (1, 1)


def test_the_user_is_told_when_kernels_cannot_be_kept(monkeypatch):
    monkeypatch.setattr(_jit, "FOLDER", None)
    with pytest.warns(UserWarning, match="compiled kernels cannot be kept.*set NUMBA_CACHE_DIR"):
        _jit.prepare_kernel_folder()


def base(monkeypatch: pytest.MonkeyPatch, package: Path, cache: Path | None) -> Path | None:
    """Where kernels of a package go whose own folder is closed."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(_kernel_folder, "PACKAGE", package)
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    if cache is None:
        monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    else:
        monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    found = _kernel_folder.kernel_folder()
    return found and found.parent


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_a_users_cache_is_used_only_if_nobody_else_can_write_to_it(monkeypatch, tmp_path):
    package = tmp_path / "package"
    package.mkdir()
    assert base(monkeypatch, package, tmp_path / "new") == tmp_path / "new" / "gsvc_ref"
    made = tmp_path / "new" / "gsvc_ref"
    assert stat.S_IMODE(made.stat().st_mode) == 0o700
    for mode, trusted in ((0o755, True), (0o770, False), (0o757, False), (0o777, False)):
        made.chmod(mode)
        assert (base(monkeypatch, package, tmp_path / "new") == made) == trusted
        assert (_kernel_folder.stale_folders() == []) or trusted
    made.chmod(0o700)
    (tmp_path / "link").mkdir()
    (tmp_path / "link" / "gsvc_ref").symlink_to(made)
    assert base(monkeypatch, package, tmp_path / "link") is None
    monkeypatch.setattr(os, "geteuid", lambda: made.stat().st_uid + 1)  # as if another user had made it
    assert base(monkeypatch, package, tmp_path / "new") is None


def test_without_a_home_there_is_no_folder(monkeypatch, tmp_path):
    (tmp_path / "file").touch()
    assert base(monkeypatch, tmp_path, tmp_path / "file") is None
    monkeypatch.setattr(Path, "home", lambda: (_ for _ in ()).throw(RuntimeError("no home")))
    assert base(monkeypatch, tmp_path, None) is None


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_a_package_folder_that_everybody_may_write_to_is_not_used(monkeypatch, tmp_path):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    monkeypatch.setattr(_kernel_folder, "PACKAGE", tmp_path)
    for mode, inside in ((0o755, True), (0o777, False)):
        tmp_path.chmod(mode)
        assert (_kernel_folder.kernel_folder().parent == tmp_path / "__pycache__") == inside
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__").chmod(0o757)
    assert _kernel_folder.kernel_folder().parent == tmp_path / "user" / "gsvc_ref"


def test_a_chosen_folder_leaves_the_others_alone(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "of" / "chosen"))
    monkeypatch.setattr(_kernel_folder, "_base", lambda: tmp_path)
    (tmp_path / f"{_kernel_folder._prefix()}000000000000").mkdir()
    assert _kernel_folder.kernel_folder() == tmp_path / "of" / "chosen"
    assert _kernel_folder.stale_folders() == []
