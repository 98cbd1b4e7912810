"""Compiled kernels never outlive the sources that they came from."""

import os
import subprocess
import sys

import pytest

from gsvc_ref import _kernel_folder


def test_the_folder_changes_with_any_source(monkeypatch, tmp_path):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(_kernel_folder, "PACKAGE", tmp_path)
    source = tmp_path / "rendering" / "tasks.py"
    source.parent.mkdir()
    source.touch()
    first = _kernel_folder.kernel_folder()
    assert _kernel_folder.kernel_folder() == first
    os.utime(source, ns=(1, 1))
    second = _kernel_folder.kernel_folder()
    assert second != first
    assert second.parent == first.parent


def test_packages_without_kernels_have_none():
    package = _kernel_folder.PACKAGE
    sources = {path: path.read_text(encoding="utf-8") for path in package.rglob("*.py")}
    users = {path.relative_to(package).parts[0] for path, text in sources.items() if "gsvc_ref._jit" in text}
    assert {"rendering", "quantization"} <= users
    assert not users & set(_kernel_folder.WITHOUT_KERNELS)


def test_only_folders_of_the_same_installation_are_stale(monkeypatch, tmp_path):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(_kernel_folder, "PACKAGE", tmp_path / "package")
    monkeypatch.setattr(_kernel_folder, "_base", lambda: tmp_path)
    (tmp_path / "package").mkdir()
    present = _kernel_folder.kernel_folder()
    old = present.with_name(present.name[:-1] + ("0" if present.name[-1] != "0" else "1"))
    other = tmp_path / "kernels-000000000000-111111111111"
    for folder in (present, old, other):
        folder.mkdir()
    assert _kernel_folder.stale_folders() == [old]


def test_kernels_are_kept_there_and_numba_keeps_its_own_settings():
    script = (
        "import numba\nfrom gsvc_ref._kernel_folder import kernel_folder\n"
        "from gsvc_ref.rendering.fast.projection import project_task\n"
        "print(project_task._cache.cache_path.startswith(str(kernel_folder())) and not numba.config.CACHE_DIR)"
    )
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, env=environment)
    assert run.stdout.strip() == "True"


def started(tmp_path, *options, **variables) -> subprocess.CompletedProcess[str]:
    """The import of what is compiled, in a process whose home and cache are no folders."""
    base = "None" if variables.pop("BASE", "") == "none" else f"f.Path({str(tmp_path / 'base')!r})"
    nowhere = tmp_path / "file"
    nowhere.touch()
    environment = {"PATH": os.environ["PATH"], "HOME": str(nowhere), "XDG_CACHE_HOME": str(nowhere), **variables}
    code = (
        "import gsvc_ref._kernel_folder as f\nf._base = lambda: {base}\nfrom gsvc_ref import _jit\nprint(_jit.FOLDER)"
    )
    return subprocess.run(
        [sys.executable, *options, "-c", code.format(base=base)],
        capture_output=True,
        text=True,
        env=environment,
        timeout=100,
    )


@pytest.mark.parametrize("options", [(), ("-W", "error")])
def test_without_a_folder_it_is_told_and_nothing_fails(tmp_path, options):
    """Where warnings are errors each command ended as by a fault."""
    run = started(tmp_path, *options, BASE="none")
    assert (run.returncode, run.stdout) == (0, "None\n")
    assert run.stderr.count("compiled kernels cannot be kept, so each start takes half a minute") == 1


@pytest.mark.parametrize("options", [(), ("-W", "error")])
def test_a_folder_that_cannot_be_used_is_told_and_replaced(tmp_path, options):
    """It cost half a minute at each start, without a word."""
    run = started(tmp_path, *options, NUMBA_CACHE_DIR="/dev/null")
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith(f"{tmp_path / 'base'}{os.sep}kernels-")
    assert "cannot be kept in /dev/null, where NUMBA_CACHE_DIR says: they are kept in" in run.stderr
    assert len(run.stderr.splitlines()) <= 2


def test_a_folder_that_can_be_used_is_used_in_silence(tmp_path):
    for folder in (tmp_path / "new" / "folder", tmp_path / "new"):
        run = started(tmp_path, NUMBA_CACHE_DIR=str(folder))
        assert (run.returncode, run.stdout, run.stderr) == (0, f"{folder}\n", "")
        assert folder.is_dir()


def test_a_folder_of_kernels_that_is_only_read_is_used(tmp_path, monkeypatch):
    """As in an image of a container."""
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    monkeypatch.setattr(_kernel_folder, "_base", lambda: None)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert _kernel_folder.kernel_folder() is None
    (tmp_path / "lists").mkdir()
    assert _kernel_folder.kernel_folder() == tmp_path


@pytest.mark.parametrize("command", ["encode", "compare", "run"])
def test_a_number_of_threads_that_is_none_is_wrong_use(tmp_path, command):
    """It was told as a fault of gsvc_ref, to be reported."""
    video = tmp_path / "x.y4m"
    video.write_bytes(b"YUV4MPEG2 W16 H16 F25:1 Ip C444\nFRAME\n" + bytes(range(256)) * 3)
    arguments = {
        "encode": ["gsvc_ref", "encode", str(video), str(tmp_path / "x.gsvc")],
        "compare": ["gsvc_ref", "compare", str(video), str(video), "--no-vmaf"],
        "run": ["conformance", "run", "--reference", "--case", "core/render_sum/a_splat_in_the_middle"],
    }
    environment = {**os.environ, "NUMBA_NUM_THREADS": "0"}
    run = subprocess.run([sys.executable, "-m", *arguments[command]], capture_output=True, text=True, env=environment)
    assert run.returncode == 2, run.stderr
    assert "Numba does not start (Number of threads specified must be > 0): correct or unset" in run.stderr
    assert "NUMBA_NUM_THREADS" in run.stderr


LAYER = """
from gsvc_ref.cli.errors import guarded
from gsvc_ref.rendering.fast.threads import parallel_region
def work():
    with parallel_region(1):
        return 0
raise SystemExit(guarded("gsvc", work))
"""


@pytest.mark.parametrize(("layer", "words"), [("bogus", "'bogus' is unknown to Numba"), ("workqueue", "")])
def test_a_threading_layer_that_is_none_is_wrong_use(layer, words):
    environment = {**os.environ, "NUMBA_THREADING_LAYER": layer}
    run = subprocess.run([sys.executable, "-c", LAYER], capture_output=True, text=True, env=environment)
    assert run.returncode == (2 if words else 0), run.stderr
    assert words in run.stderr
    assert ("unset NUMBA_THREADING_LAYER" in run.stderr) == bool(words)
