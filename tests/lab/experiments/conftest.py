"""What tests of experiments share."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))
pytest.importorskip("gsvc_lab.experiments.experiment", reason="gsvc_lab.experiments is only in a checkout")

from gsvc_lab.experiments.experiment import Run
from gsvc_lab.experiments.material import Still
from gsvc_ref.encoder import Settings


@pytest.fixture
def quiet(tmp_path):
    """A run that writes to a folder of its own and says nothing."""
    return Run(full=False, folder=tmp_path, say=lambda sentence: None, threads=1)


@pytest.fixture(scope="module")
def few_iterations():
    """Preset quick with 20 iterations."""
    quick = Settings.quick
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Settings, "quick", lambda **options: quick(**{"profile": "paper"} | options, iterations=20))
        yield


@pytest.fixture
def tiny():
    """A picture of 32x24 with a plain half and a half full of detail."""
    frame = np.full((24, 32, 3), 90, np.uint8)
    frame[:, 16:] = np.random.default_rng(0).integers(0, 256, (24, 16, 1))
    return Still("tiny", "a tiny picture", frame)
