"""gsvc_base.spec runs from spec.md itself: its names, where its source is found, and that a wheel carries it."""

import importlib.util
import inspect
import pickle
import posixpath
import pydoc
import re
import subprocess
import sys
import traceback
import zipfile
from pathlib import Path

import numpy as np
import pytest

from gsvc_base import document, spec

ROOT = Path(__file__).parents[1]
DOCUMENT = ROOT / "spec.md"

CALL = """
import sys
import numpy as np
from gsvc_base import spec
print(spec.__file__)
print(spec.lsq_quantize(np.full((1, 1), 0.5, np.float32), np.float32([0.1]), np.float32([0]), bits=8)["codes"].item())
"""


def defined():
    """The functions and classes of the document, by name."""
    return {name: value for name, value in vars(spec).items() if name in spec.__all__ and callable(value)}


def test_all_names_are_those_of_the_document():
    text = document.PATH.read_text(encoding="utf-8")
    given = set(re.findall(r"\w+", " ".join(re.findall(r"^((?:\w+, )*\w+) = ", text, re.MULTILINE))))
    assert all(name in given or f"\ndef {name}(" in text or f"\nclass {name}" in text for name in spec.__all__)
    assert len(defined()) >= 100
    assert {"lsq_quantize", "Fault", "SUPPORT_RADIUS"} <= set(dir(spec))
    assert not {"np", "math", "Fraction"} & set(dir(spec))


def test_functions_and_classes_are_of_the_module():
    for name, value in defined().items():
        assert value.__module__ == "gsvc_base.spec"
        assert pickle.loads(pickle.dumps(value)) is getattr(spec, name)


def test_source_is_that_of_the_document():
    lines = DOCUMENT.read_text(encoding="utf-8").splitlines(keepends=True)
    for name, value in defined().items():
        source, first = inspect.getsourcelines(value)
        assert inspect.getsourcefile(value) == str(DOCUMENT)
        assert lines[first - 1 : first - 1 + len(source)] == source
        assert source[0].startswith((f"def {name}(", f"class {name}"))
        compile("".join(source), name, "exec")  # nothing of the text that follows it


def test_a_traceback_has_the_line_of_the_document():
    with pytest.raises(AttributeError) as caught:
        spec.loss(None, None)
    last = traceback.extract_tb(caught.value.__traceback__)[-1]
    lines = DOCUMENT.read_text(encoding="utf-8").splitlines()
    assert (last.filename, last.name) == (str(DOCUMENT), "loss")
    assert last.line == lines[last.lineno - 1].strip() == "clamped = np.clip(picture.astype(np.float64), 0.0, 1.0)"


def test_help_tells_of_the_document():
    text = pydoc.plain(pydoc.render_doc(spec))
    assert "the plain form of everything" in text
    assert "lsq_gradients(x, scale, offset, bits, grad_output)" in text
    assert "The first rule that a stream breaks" in text


def test_text_around_the_code_stands_in_comments():
    lines, code = DOCUMENT.read_text(encoding="utf-8").split("\n"), document.as_python()
    assert len(lines) == len(code)
    compile("".join(code), "spec.md", "exec")
    assert all(new in (f"{old}\n", f"# {old}\n") for old, new in zip(lines, code, strict=True) if new != "\n")


def test_it_is_loaded_on_demand():
    ask = "import sys, gsvc_ref, gsvc_ref.encoder; sys.exit('gsvc_base.spec' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", ask], cwd=ROOT, check=False).returncode == 0


@pytest.mark.skipif(importlib.util.find_spec("hatchling") is None, reason="a wheel needs hatchling to be built")
def test_a_wheel_carries_the_document(tmp_path):
    build = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", tmp_path, ROOT]
    subprocess.run(build, check=True, cwd=tmp_path)
    (wheel,) = tmp_path.glob("*.whl")
    home = tmp_path / "installed"
    with zipfile.ZipFile(wheel) as archive:
        assert archive.read("gsvc_base/spec.md") == DOCUMENT.read_bytes()
        page = archive.read("gsvc_tools/web/viewer/index.html").decode()
        loaded = re.findall(r'(?:src|href)="([^":#]+)"', page)
        places = [posixpath.normpath(f"gsvc_tools/web/viewer/{name}") for name in loaded]
        assert len(places) > 20
        assert set(places) <= set(archive.namelist()), "the viewer lacks a script"
        archive.extractall(home)
    run = [sys.executable, "-P", "-c", f"import sys; sys.path.insert(0, {str(home)!r})\n{CALL}"]
    found = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True, check=True).stdout.splitlines()
    assert found == [str(home / "gsvc_base" / "spec.md"), "5"]


def test_a_package_with_the_document_inside_runs_from_it(tmp_path):
    home = tmp_path / "gsvc_base"
    home.mkdir()
    for name in ("__init__.py", "document.py", "spec.py"):
        (home / name).write_bytes((ROOT / "gsvc_base" / name).read_bytes())
    (home / "spec.md").write_bytes(DOCUMENT.read_bytes())
    run = [sys.executable, "-P", "-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n{CALL}"]
    found = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True, check=True).stdout.splitlines()
    assert found == [str(home / "spec.md"), "5"]


def test_one_number_by_hand():
    picture, target = np.full((1, 2, 3), 0.5, np.float32), np.full((1, 2, 3), 0.25, np.float32)
    found = spec.loss(picture, target)
    assert found["loss"] == 3 / 16
    assert (found["residual"] == 0.25).all()
