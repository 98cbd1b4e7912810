"""gsvc-conformance as others install it: from a wheel, an sdist or a checkout, with NumPy alone, in another folder."""

import ast
import os
import shutil
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

from gsvc_conformance.commands import sets

ROOT = Path(__file__).parents[2]
KIT = ROOT / "conformance" / "gsvc_conformance"
LARGEST_WHEEL = 10_000_000

pytest.importorskip("hatchling", reason="the build hook is one of hatchling")


HOSTED = {"fluster_decoder.py": "fluster", "pytest_vectors.py": "pytest"}
"""Modules that only their host loads."""


def imported_at_the_top(path):
    """The modules that a module imports at its top, as far as their names tell."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module


def test_what_judges_imports_numpy_alone():
    """Which packages of ours it imports is the concern of tests/test_arrows.py."""
    kit = [path for path in KIT.rglob("*.py") if "adapters" not in path.parts]
    ours = {"gsvc_base", "gsvc_ref", "gsvc_conformance"}
    others = {
        (path.name, name)
        for path in (*kit, *(ROOT / "gsvc_base").rglob("*.py"))
        for name in imported_at_the_top(path)
        if name.partition(".")[0] not in {"numpy", *ours, *sys.stdlib_module_names, HOSTED.get(path.name)}
    }
    assert others == set(), "import it in the function that needs it"


# What follows builds, and installs into fresh environments.

MINE = """
import numpy as np

CENTRE = {centre}

def render_sum(parameters, width, height):
    x, y = np.meshgrid(np.arange(width) + CENTRE, np.arange(height) + CENTRE)
    total = np.zeros((height, width, 3))
    for px, py, l11, l21, l22, *color in parameters.astype(float):
        if 2.0**-126 <= l11 < np.inf and 2.0**-126 <= l22 < np.inf:
            u1 = (x - px) / l11
            u2 = (y - py - l21 * u1) / l22
            sigma = (u1 * u1 + u2 * u2) / 2
            total += np.where(sigma <= np.log(255), np.exp(-sigma), 0)[..., None] * color
    return {{"sum": total.astype(np.float32)}}
"""


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A copy of what a build needs, with a set of the vectors."""
    home = tmp_path_factory.mktemp("checkout")
    leave_out = shutil.ignore_patterns("__pycache__", ".*", "sets")
    for name in ("conformance", "gsvc_base", "vectors"):
        shutil.copytree(ROOT / name, home / name, ignore=leave_out)
    for name in ("spec.md", "LICENSE"):
        shutil.copy(ROOT / name, home)
    sets.write_next(home / "vectors")
    return home


@pytest.fixture(scope="module")
def built(checkout, tmp_path_factory):
    """The sdist, and the wheel that is made of the checkout."""
    folder = tmp_path_factory.mktemp("built")
    for target in ("sdist", "wheel"):
        command = [sys.executable, "-m", "hatchling", "build", "-t", target, "-d", folder]
        subprocess.run(command, cwd=checkout / "conformance", check=True, capture_output=True)
    return {
        "wheel": next(folder.glob("*.whl")),
        "sdist": next(folder.glob("*.tar.gz")),
        "checkout": checkout / "conformance",
    }


class Elsewhere:
    """A fresh environment, and an empty folder but for one that is called as the kit's is."""

    def __init__(self, home: Path) -> None:
        venv.create(home / "environment", with_pip=True)
        self.bin = home / "environment" / ("Scripts" if os.name == "nt" else "bin")
        self.folder = home / "work"
        (self.folder / "conformance").mkdir(parents=True)
        (self.folder / "conformance" / "__init__.py").write_text("raise SystemExit('the wrong package')\n")

    def python(self, *words):
        """What Python says, with a status of 0."""
        done = self._run(self.bin / "python", *words)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    def kit(self, *words):
        """The exit status of the command, and all that it says."""
        done = self._run(self.bin / "gsvc-conformance", *words)
        return done.returncode, done.stdout + done.stderr

    def _run(self, *words):
        around = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONHOME")}
        return subprocess.run(
            [*map(str, words)], cwd=self.folder, env=around, capture_output=True, text=True, timeout=300
        )


@pytest.fixture(scope="module")
def elsewhere(built, tmp_path_factory):
    """An environment where the wheel is installed, with NumPy beside it."""
    found = Elsewhere(tmp_path_factory.mktemp("elsewhere"))
    found.python("-m", "pip", "install", "-q", "--disable-pip-version-check", built["wheel"])
    return found


@pytest.mark.exhaustive
def test_the_size_of_the_wheel_and_what_is_in_it(built):
    assert built["wheel"].stat().st_size <= LARGEST_WHEEL
    names = zipfile.ZipFile(built["wheel"]).namelist()
    assert {"vectors.zip", "protocol.md", "examples/minimal.c", "LICENSE", "bundled/gsvc_base/spec.md"} <= {
        name.removeprefix("gsvc_conformance/") for name in names
    }
    assert len(names) == len(set(names))
    assert not [name for name in names if "__pycache__" in name]


@pytest.mark.exhaustive
@pytest.mark.parametrize("source", ["sdist", "checkout"])
def test_what_pip_makes_of_others_is_the_wheel(built, source, tmp_path):
    words = ["wheel", "-q", "--no-deps", "--disable-pip-version-check", "-w", tmp_path, built[source]]
    subprocess.run([sys.executable, "-m", "pip", *words], check=True, capture_output=True)
    (made,) = tmp_path.glob("*.whl")
    assert contents(made) == contents(built["wheel"])


def contents(wheel):
    """The files of a wheel by name, the list of them as a set: it follows the order of the folder that was built."""
    with zipfile.ZipFile(wheel) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    return {name: set(data.splitlines()) if name.endswith("/RECORD") else data for name, data in files.items()}


@pytest.mark.exhaustive
def test_the_kit_elsewhere(elsewhere, built):
    work = elsewhere.folder
    listed = elsewhere.python("-m", "pip", "list", "--format", "freeze", "--disable-pip-version-check").split()
    assert {line.partition("==")[0] for line in listed} - {"pip", "setuptools", "wheel"} == {
        "gsvc-conformance",
        "numpy",
    }
    status, said = elsewhere.kit("--version")
    assert status == 0
    assert "GSVC vectors 1 (sha256 " in said
    assert "spec.md 1.0" in said

    (work / "mine.py").write_text(MINE.format(centre=0.5))
    (work / "half.py").write_text(MINE.format(centre=0.0))
    right = ["run", "--module", "mine", "--operation", "render_sum", "--json", "mine.json"]
    assert elsewhere.kit(*right)[0] == 0
    status, said = elsewhere.kit(
        "run", "--module", "half", "--operation", "render_sum", "--json", "half.json", "--html", "half.html",
        "--junit", "half.xml", "--keep", "kept",
    )  # fmt: skip
    assert status == 1
    assert "Probable cause: pixel centres at integer positions" in said
    assert 'src="data:image/png' in (work / "half.html").read_text()
    assert elsewhere.kit("report", "half.json", "--html", "again.html", "--keep", "kept")[0] == 1
    assert "| render_sum" in elsewhere.kit("compare", "--tables", "mine.json", "half.json")[1].replace("`", "")

    status, said = elsewhere.kit("run", "--spec", "--class", "metrics", "--class", "colour", "--set", "1")
    assert status == 0
    assert "passes GSVC vectors 1 (sha256 " in said
    assert elsewhere.kit("run", "--spec", "--set", "2")[0] == 2
    program = Path(elsewhere.python("-P", "-c", "import gsvc_conformance as k; print(k.__path__[0])").strip())
    command = f"{elsewhere.bin / 'python'} {program / 'examples' / 'minimal.py'}"
    assert elsewhere.kit("run", "--impl", command, "--operation", "from_half")[0] == 0

    assert "render_sum (rendering)" in elsewhere.kit("list")[1]
    assert "core/render_sum/no_splats: " in elsewhere.kit("list", "--cases", "--set", "1")[1]
    assert elsewhere.kit("sets")[1].startswith("set 1: ")
    assert elsewhere.kit("mutants", "--operation", "to_frame")[0] == 0
    assert str(program / "protocol.md") in "".join(elsewhere.kit("run", "--help")[1].split())

    needs_gsvc_ref = "needs gsvc_ref: in a checkout of the repository, pip install . './conformance[reference]'"
    for words, extra in (
        (["run", "--reference"], needs_gsvc_ref),
        (["streams", "nowhere"], needs_gsvc_ref),
        (["generate", "--vectors", "nowhere"], needs_gsvc_ref),
        (["verify"], "needs jsonschema: pip install 'gsvc-conformance[verify]'"),
        (["generate"], "vectors.zip is an archive: name a folder to write to, with --vectors DIR"),
    ):
        status, said = elsewhere.kit(*words)
        assert status == 2
        assert said.count("\n") == 1
        assert extra in said

    elsewhere.python("-m", "pip", "install", "-q", "--disable-pip-version-check", f"{built['wheel']}[verify]")
    status, said = elsewhere.kit("verify")
    assert status == 0, said
    assert said.endswith("nothing is wrong\n")


ONE_CLASS = """
import {first}, {second}
import gsvc_base.errors, gsvc_conformance.results, gsvc_ref
assert gsvc_ref.UsageError is gsvc_base.errors.UsageError
print(gsvc_base.__file__)
"""


@pytest.mark.exhaustive
def test_beside_gsvc_ref_no_file_and_no_class_stands_twice(built, tmp_path):
    build = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", tmp_path, ROOT]
    subprocess.run(build, check=True, capture_output=True)
    (reference,) = tmp_path.glob("gsvc_ref-*.whl")
    names = [set(zipfile.ZipFile(wheel).namelist()) for wheel in (built["wheel"], reference)]
    assert names[0].isdisjoint(names[1])
    bundled = {name.removeprefix("gsvc_conformance/bundled/") for name in names[0] if "/bundled/" in name}
    assert bundled == {name for name in names[1] if name.startswith("gsvc_base/")}

    both = Elsewhere(tmp_path)
    install = ("-m", "pip", "install", "-q", "--disable-pip-version-check")
    both.python(*install, built["wheel"])
    both.python(*install, "--no-deps", reference)
    for first, second in (("gsvc_conformance", "gsvc_ref"), ("gsvc_ref", "gsvc_conformance")):
        code = ONE_CLASS.format(first=first, second=second)
        assert Path("gsvc_conformance", "bundled", "gsvc_base") == Path(
            *Path(both.python("-P", "-c", code).strip()).parts[-4:-1]
        )
    remove = ("-m", "pip", "uninstall", "-q", "-y", "--disable-pip-version-check")
    both.python(*remove, "gsvc_ref")
    assert both.kit("run", "--spec", "--operation", "from_half")[0] == 0
    both.python(*install, "--no-deps", reference)
    both.python(*remove, "gsvc-conformance")
    assert "gsvc_base" in both.python("-P", "-c", "import gsvc_ref; print(gsvc_ref.UsageError.__module__)")
