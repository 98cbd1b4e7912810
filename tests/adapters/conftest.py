"""What all tests of adapters share: judging a module by an operation's vectors, and what must hold of its source."""

import ast
from pathlib import Path

import numpy as np
import pytest

from gsvc_conformance.implementations import load_module
from gsvc_conformance.results import FAULTS
from gsvc_conformance.runner import run_suite
from gsvc_conformance.vector import VECTORS
from gsvc_conformance.vector_folder import VectorFolder

ADAPTERS = Path(__file__).parents[2] / "conformance" / "gsvc_conformance" / "adapters"


@pytest.fixture(scope="module")
def on_fibers():
    """The kernels of the CUDA adapter, compiled by the C++ compiler; tests/gpu runs them on a GPU."""
    from gsvc_conformance.adapters.cuda import device

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("GSVC_CUDA", "fibers")
        device.machine.cache_clear()
        if not device.available():
            pytest.skip("there is no C++ compiler")
        yield
    device.machine.cache_clear()


@pytest.fixture(scope="session")
def vector_folder():
    return VectorFolder(VECTORS)


@pytest.fixture(scope="session")
def judge(vector_folder):
    """judge(module, operation): the results of a module for all vectors of an operation; it fails if one is wrong."""

    def judged(module, operation):
        names = [name for name in vector_folder.names if name.split("/")[1] == operation]
        assert names, f"there are no vectors of {operation}"
        results = run_suite(load_module(module), vector_folder.read(names))
        wrong = [f"{result.id}: {result.outcome}: {result.message}" for result in results if result.outcome in FAULTS]
        assert not wrong, "\n".join(wrong)
        return results

    return judged


@pytest.fixture
def pinpoints():
    """White splats far thinner than a pixel, each on a centre of one: u is 0 there, and only colours have gradients.

    Their factors l21 / (l11 l22) of (13-12) are in the range of binary32; some products of two of the three are not.
    """
    factors = [(1e-30, 0, 1e-30), (1e-30, 1e-30, 1e-30), (1e-30, 1e-25, 1e-3), (1e30, 1e25, 1e-25)]
    places = [(4 * n + 0.5, 4.5) for n in range(len(factors))]
    rows = [(*place, *factor, 1 / 3, 1 / 3, 1 / 3) for place, factor in zip(places, factors, strict=True)]
    return np.array(rows, np.float32)


@pytest.fixture(scope="session")
def imported_by():
    """imported_by(name): the modules that the Python files of an adapter import."""

    def imported(name):
        found = set()
        for path in (ADAPTERS / name).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Import):
                    found |= {alias.name for alias in node.names}
                elif isinstance(node, ast.ImportFrom):
                    assert node.level == 0, f"{path}: a relative import"
                    found.add(node.module)
        return found

    return imported
