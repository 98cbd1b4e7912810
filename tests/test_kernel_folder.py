"""Compiled kernels never outlive the sources that they came from."""

import os
import subprocess
import sys

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
        "from gsvc_ref.rendering.lists import prepare\n"
        "print(prepare._cache.cache_path.startswith(str(kernel_folder())) and not numba.config.CACHE_DIR)"
    )
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, env=environment)
    assert run.stdout.strip() == "True"
