"""docs/property-tests.md and the docstring of gsvc_ref.testing: every block runs as its reader would run it."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import gsvc_ref.testing
from gsvc_ref.testing import assert_within_bound

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "property-tests.md"
BLOCKS = re.findall(r"^```python\n# (\S+)\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
DOCSTRING = re.findall(r"::\n\n((?:    .*\n|\n)+)", gsvc_ref.testing.__doc__ or "")
STAND_INS = """
import mine

def my_decoder(data):
    return mine.decode(data)

def my_renderer(parameters, width, height):
    return mine.render(parameters, width, height)
"""


def lay_out(folder):
    """The files of the page, and one of the docstring's blocks."""
    for name in dict.fromkeys(name for name, _ in BLOCKS):
        (folder / name).write_text("\n".join(code for file, code in BLOCKS if file == name), encoding="utf-8")
    blocks = [re.sub("^    ", "", block, flags=re.MULTILINE) for block in DOCSTRING]
    (folder / "test_docstring.py").write_text("\n".join([STAND_INS, *blocks]), encoding="utf-8")


def run(folder, *arguments, cold):
    """Run pytest as if nobody had used gsvc_ref on this machine, or with the kernels that there are."""
    own = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA", "HYPOTHESIS", "CI"))}
    own["PYTHONPATH"] = os.pathsep.join(dict.fromkeys([str(ROOT), *sys.path[1:]]))
    if cold:
        own["NUMBA_CACHE_DIR"] = str(folder / "kernels")
    elif "NUMBA_CACHE_DIR" in os.environ:
        own["NUMBA_CACHE_DIR"] = os.environ["NUMBA_CACHE_DIR"]
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", os.devnull, "--rootdir", folder]
    return subprocess.run([*command, *arguments], cwd=folder, env=own, capture_output=True, text=True)


def test_every_block_belongs_to_a_file():
    assert PAGE.read_text(encoding="utf-8").count("```python") == len(BLOCKS) >= 7
    assert {name for name, _ in BLOCKS} == {"mine.py", "test_mine.py", "conftest.py"}
    assert len(DOCSTRING) == 3


@pytest.mark.exhaustive
def test_blocks_of_the_page_and_the_docstring_pass(tmp_path):
    lay_out(tmp_path)
    with (tmp_path / "conftest.py").open("a", encoding="utf-8") as conftest:
        conftest.write('settings.register_profile("few", settings.get_profile("ci"), max_examples=10)')
    done = run(tmp_path, "--hypothesis-profile=few", cold=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "9 passed" in done.stdout


@pytest.mark.exhaustive
def test_blocks_pass_on_a_cold_cache_under_the_default_settings(tmp_path):
    lay_out(tmp_path)
    (tmp_path / "conftest.py").unlink()
    done = run(tmp_path, cold=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "9 passed" in done.stdout
    assert any((tmp_path / "kernels").rglob("*.nbc"))


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("right", "wrong"),
    [("- l21 * u1) / l22", "- l21 * u1) / l11"), ("np.exp(-sigma)", "np.exp(-sigma) * np.float32(1.0001)")],
)
def test_a_fault_of_the_renderer_is_found(tmp_path, right, wrong):
    lay_out(tmp_path)
    text = (tmp_path / "mine.py").read_text(encoding="utf-8")
    assert text.count(right) == 1
    (tmp_path / "mine.py").write_text(text.replace(right, wrong), encoding="utf-8")
    done = run(tmp_path, "-k", "test_renderer and not again", "test_mine.py", "--hypothesis-seed=0", cold=False)
    assert done.returncode == 1
    assert "AssertionError: render_sum: " in done.stdout
    assert "splats=Splats(positions=array([[0., 0.]], dtype=float32)" in done.stdout  # one is left


@pytest.mark.parametrize("factors", [(-1, 0, 1), (1, 0, 0), (2.0**-127, 0, 1), (1, 0, np.inf), (np.nan, 0, 1)])
def test_the_renderer_of_the_page_leaves_out_what_covers_nothing(factors):
    mine = {}
    exec(dict(BLOCKS)["mine.py"], mine)
    splat = np.array([[4.5, 4.5, *factors, 1, 1, 1]], np.float32)
    assert not mine["render"](splat, 9, 9).any()
    assert not mine["gradients"](splat, np.ones((9, 9, 3), np.float32)).any()


def test_the_message_on_the_page_is_that_of_its_example():
    shown = re.search(r"^AssertionError: (.*)\.\.\.$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)[1]
    mine = {}
    exec(dict(BLOCKS)["mine.py"].replace("- l21 * u1) / l22", "- l21 * u1) / l11"), mine)
    splat = np.array([[0, 0, 1, 0, 0.5, 1, 0, 0]], np.float32)
    with pytest.raises(AssertionError) as failure:
        assert_within_bound("render_sum", mine["render"](splat, 32, 24), parameters=splat, width=32, height=24)
    assert str(failure.value).startswith(shown)
