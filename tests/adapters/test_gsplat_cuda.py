"""The adapter of the authors' rasteriser, tested with a double of it (gsplat_double): no GPU is needed."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="the double of the rasteriser needs PyTorch, of the extra peers")

import gsplat_double as double  # noqa: E402

from gsvc_base.errors import UsageError  # noqa: E402
from gsvc_conformance.implementations import load_module  # noqa: E402
from gsvc_conformance.results import FAULTS  # noqa: E402
from gsvc_conformance.runner import run_suite  # noqa: E402
from gsvc_conformance.waivers import read_waivers  # noqa: E402


@pytest.fixture(autouse=True)
def _one_thread():
    """Small tensors: threads would only wait for each other."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(scope="module")
def vectors():
    """All but the one that takes minutes: the adapter's waivers have it, too."""
    return [vector for vector in double.vectors() if double.pairs(vector) <= double.PAIRS]


@pytest.fixture(scope="module")
def waivers(vectors):
    return read_waivers(double.EXPECTED).reasons(vector.id for vector in vectors)


def sum_of(implementation, splats, width, height):
    parameters = np.array(splats, "<f4").reshape(-1, 8)
    return implementation.functions["render_sum"](parameters=parameters, width=width, height=height)["sum"]


def test_with_every_fault_mended_all_vectors_pass(monkeypatch, vectors):
    """So the adapter's conventions are right: half a pixel, normalised positions, background, degenerate splats."""
    assert list(double.failures(monkeypatch, vectors, double.FAULTS)) == []


def test_the_expected_failures_are_those_of_the_double(monkeypatch, vectors, waivers):
    again = "write it again: PYTHONPATH=. python tests/adapters/gsplat_double.py"
    assert list(double.failures(monkeypatch, vectors)) == list(waivers), again


def test_measured_are_the_failures_of_the_gpu(vectors):
    _, outcomes = double.measured()
    assert len(outcomes) > 200
    reasons = read_waivers(double.EXPECTED).reasons(outcomes)
    assert all(reason.startswith("measured: ") for reason in reasons.values())
    assert {name for name, outcome in outcomes.items() if outcome != "pass"} == reasons.keys()


def test_each_expected_failure_passes_when_what_its_reason_names_is_mended(monkeypatch, vectors, waivers):
    faults_of = {
        double.reason(faults, how): faults for how in ("measured", "predicted") for faults in double.sets_of_faults()
    }
    assert set(waivers.values()) <= faults_of.keys()
    for reason in dict.fromkeys(waivers.values()):
        chosen = [vector for vector in vectors if waivers.get(vector.id) == reason]
        assert list(double.failures(monkeypatch, chosen, faults_of[reason])) == []


def test_a_run_with_the_waivers_has_nothing_wrong(monkeypatch, vectors, waivers):
    results = run_suite(double.adapter(monkeypatch), vectors, waivers=waivers)
    assert not [result.id for result in results if result.outcome in FAULTS]
    assert {result.outcome for result in results} == {"pass", "waived"}
    waived = [result for result in results if result.outcome == "waived"]
    assert all(result.message.startswith(("measured: ", "predicted: ")) for result in waived)


@pytest.mark.parametrize("fault", double.FAULTS)
def test_every_fault_is_found_alone(monkeypatch, vectors, fault):
    """With all others mended: the suite finds each fault of the rasteriser by itself, in gradients alone."""
    others = double.FAULTS.keys() - {fault}
    chosen = [vector for vector in vectors if vector.id.startswith("core/render_gradients/")]
    assert double.failures(monkeypatch, chosen, others)


def test_a_splat_is_where_it_belongs(monkeypatch):
    """Round, of one pixel, in the middle of the pixel in column 5 and row 2."""
    picture = sum_of(double.adapter(monkeypatch), [5.5, 2.5, 1, 0, 1, 1, 0.5, -1], 19, 7)
    assert np.array_equal(picture[2, 5], np.array([1, 0.5, -1], "<f4"))
    assert np.array_equal(picture[2, 4], picture[2, 6])
    assert np.array_equal(picture[1, 5], picture[3, 5])


def test_no_splat_is_black_and_a_degenerate_one_is_none(monkeypatch):
    implementation = double.adapter(monkeypatch)
    assert not sum_of(implementation, [], 33, 17).any()
    assert not sum_of(implementation, [8, 8, -2, 0, 2, 1, 1, 1], 33, 17).any()
    gradients = implementation.functions["render_gradients"]
    nothing = gradients(parameters=np.zeros((0, 8), "<f4"), residual=np.ones((17, 33, 3), "<f4"))["gradients"]
    assert nothing.shape == (0, 8)


def test_it_has_only_what_the_rasteriser_has(monkeypatch):
    functions = double.adapter(monkeypatch).functions
    assert [name for name in functions if name.startswith(("render_", "decode_", "reconstruct_"))] == list(
        double.OPERATIONS
    )


def test_without_a_gpu_nothing_is_judged(monkeypatch):
    double.adapter(monkeypatch)
    monkeypatch.undo()
    double.stand_ins(monkeypatch, double.Double())
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(UsageError, match=r"environment\(\) fails: RuntimeError: the rasteriser needs an NVIDIA GPU"):
        load_module(double.ADAPTER)


def test_it_imports_nothing_of_the_project(imported_by):
    assert imported_by("gsplat_cuda") == {
        "typing", "numpy", "torch", "gsplat.project_gaussians_2d", "gsplat.rasterize_sum",
        "gsvc_conformance.adapters",
    }  # fmt: skip
