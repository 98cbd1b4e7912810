"""The width of a tile may be any power of two: the same picture, and gradients within the bound of the definition."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LAYOUT = "gsvc_ref/rendering/fast/tiles.py"
TILES = (ROOT / LAYOUT).read_text(encoding="utf-8")

PROGRAM = """
import sys
import numpy as np
sys.path.append(sys.argv[1])
from render_cases import population
from gsvc_ref.rendering import exact_gradients_with_bound, render_gradients, render_sum
from gsvc_ref.rendering.deterministic import gradients_plain, sum_plain
from gsvc_ref.rendering.fast.tiles import TILE_WIDTH
assert TILE_WIDTH == int(sys.argv[2])
splats = population(6, 45, 19)
e = np.random.default_rng(2).normal(0, 1, (19, 45, 3)).astype(np.float32)
exact, bound = exact_gradients_with_bound(splats, e)
gradients = render_gradients(splats, e, precision="deterministic")
assert np.all(abs(gradients - exact) <= bound)
assert np.array_equal(gradients, gradients_plain(splats, e))
assert np.array_equal(render_sum(splats, 45, 19, precision="deterministic"), sum_plain(splats, 45, 19))
"""


def run_with_tiles_of(width, folder):
    """The program with a copy of the package whose tiles have another width, interpreted."""
    shutil.copytree(ROOT / "gsvc_ref", folder / "gsvc_ref", ignore=shutil.ignore_patterns("__pycache__"))
    text, found = re.subn(r"^TILE_WIDTH: Final = \d+$", f"TILE_WIDTH: Final = {width}", TILES, flags=re.MULTILINE)
    assert found == 1
    (folder / LAYOUT).write_text(text)
    return subprocess.run(
        [sys.executable, "-W", "ignore", "-c", PROGRAM, str(Path(__file__).parent), str(width)],
        cwd=folder, env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.mark.parametrize("width", [2, 8, 32])
def test_a_tile_of_another_width_gives_the_same_gradients(width, tmp_path):
    result = run_with_tiles_of(width, tmp_path)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize("width", [1, 24])
def test_a_width_that_is_no_power_of_two_is_refused(width, tmp_path):
    result = run_with_tiles_of(width, tmp_path)
    assert "AssertionError: lanes are added half to half" in result.stderr
