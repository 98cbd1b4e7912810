"""Error models (R-13.3-1): what does as a model allows passes, what has fewer digits or a fault does not."""

import json
from functools import cache

import numpy as np
import pytest
from narrow import (
    DOWN,
    NEAREST,
    RANDOM,
    ROUNDINGS,
    Flushing,
    FlushingTermByTerm,
    Narrow,
    TermByTerm,
    in_the_frame,
    shifted,
    tinted,
)

from gsvc_base.errors import UsageError
from gsvc_base.rendering.bounds import render_exact_with_bound
from gsvc_base.rendering.error_models import ERROR_MODELS, FP32
from gsvc_conformance.__main__ import main
from gsvc_conformance.case import cases, of_operation
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.cases.gradients import noise
from gsvc_conformance.cases.rendering import FAINT
from gsvc_conformance.cases.splat_sets import population, splat, splats
from gsvc_conformance.claim import read_claim
from gsvc_conformance.expectations import Bounded
from gsvc_conformance.operation import operations
from gsvc_conformance.report.json import from_object
from gsvc_conformance.results import Result
from gsvc_conformance.verdicts import Report

OPERATIONS = ("render_sum", "render_frame", "render_gradients", "loss")
NARROW = [model for model in ERROR_MODELS.values() if model.narrow]

pytestmark = pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning")  # what binary16 cannot hold


@cache
def judged(name, inputs_of, model):
    """Inputs and expectations of an operation by a model, of what a function makes."""
    inputs = inputs_of()
    expected = operations()[name].oracle(**inputs)
    return inputs, expected if model is FP32 else operations()[name].by_model(model, expected, inputs)


def faults(double, name, inputs, expected):
    """What is wrong with an answer of a double."""
    outputs = getattr(double, name)(**inputs)
    verdicts = {output: expectation.judge(outputs[output]) for output, expectation in expected.items()}
    return [f"{output} {verdict.message}" for output, verdict in verdicts.items() if not verdict.passed]


def picture():
    """Splats of natural sizes over a frame of several tiles."""
    return {"parameters": population(np.random.default_rng(1), 70, 45, 34), "width": 45, "height": 34}


def hard():
    """Needles, splats beyond the edges, opposite colours and a pixel on the edge of a splat."""
    rng = np.random.default_rng(2)
    parameters = population(rng, 40, 70, 21)
    parameters[::3, 3] *= 8
    parameters[::4, 4] = 0.05
    parameters[::5, :2] -= 30
    on_the_edge = splat(10.5, 3.5, 4 / np.sqrt(2 * np.log(255)), 0.0, 0.5)
    return {"parameters": splats(parameters, on_the_edge), "width": 70, "height": 21}


def far_away():
    """Small splats at the right of a wide frame."""
    parameters = population(np.random.default_rng(3), 20, 30, 6)
    parameters[:, 0] += 1900
    return {"parameters": parameters, "width": 1930, "height": 6}


def residual():
    """Splats and noise as the residual."""
    return {"parameters": picture()["parameters"], "residual": noise(np.random.default_rng(4), 45, 34)}


def hard_residual():
    """Hard splats and noise as the residual."""
    return {"parameters": hard()["parameters"], "residual": noise(np.random.default_rng(4), 70, 21)}


def pair():
    """A picture that leaves 0..1, and its target."""
    rng = np.random.default_rng(5)
    return {
        "picture": rng.uniform(-0.2, 1.2, (20, 30, 3)).astype(np.float32),
        "target": rng.uniform(0, 1, (20, 30, 3)).astype(np.float32),
    }


def samples():
    """Splats as a frame of 10 bits."""
    return {**picture(), "bit_depth": 10}


ASKED = {
    "render_sum": (picture, hard, far_away),
    "render_frame": (samples,),
    "render_gradients": (residual, hard_residual),
    "loss": (pair,),
}


@pytest.mark.parametrize("rounding", ROUNDINGS)
@pytest.mark.parametrize("model", ERROR_MODELS.values(), ids=ERROR_MODELS)
def test_what_a_model_allows_is_within_its_bounds(model, rounding):
    for name, makers in ASKED.items():
        for maker in makers:
            for backwards in (False, True):
                double = Narrow(model, rounding, backwards, flushed=backwards, seed=backwards)
                assert faults(double, name, *judged(name, maker, model)) == [], f"{name} {maker.__name__}"


@pytest.mark.exhaustive
@pytest.mark.parametrize("rounding", ROUNDINGS)
@pytest.mark.parametrize("model", NARROW, ids=str)
def test_what_a_model_allows_is_within_the_bounds_of_every_vector(model, rounding):
    for name in OPERATIONS:
        for number, case in enumerate(of_operation(name)):
            if case.tier == "full" or CAPACITY in case.flags:
                continue
            inputs, expected = case.run()
            by_model = operations()[name].by_model(model, expected, inputs)
            double = Narrow(model, rounding, backwards=number % 2 == 1, flushed=rounding in (NEAREST, RANDOM))
            assert faults(double, name, inputs, by_model) == [], case.id


UNDERFLOW = "stress/render_gradients/terms_that_underflow", "stress/render_gradients/moments_that_underflow"


@pytest.mark.parametrize("double", [Narrow, Flushing, TermByTerm, FlushingTermByTerm])
def test_who_flushes_adds_moments_and_not_terms_of_gradients(double):
    for case in (cases()[name] for name in UNDERFLOW):
        wrong = faults(double(FP32), "render_gradients", *case.run())
        assert bool(wrong) == (double is FlushingTermByTerm and "terms" in case.id), wrong


@pytest.mark.parametrize("rounding", ROUNDINGS)
def test_flushing_is_within_the_bounds_of_binary32(rounding):
    for name, makers in ASKED.items():
        for maker in makers:
            assert faults(Flushing(FP32, rounding), name, *judged(name, maker, FP32)) == [], f"{name} {maker.__name__}"


STRICTER = [("tf32/1", "fp32/1"), ("fp16/1", "fp32/1"), ("bf16/1", "tf32/1"), ("bf16/1", "fp16/1")]


@pytest.mark.parametrize(("double", "model"), STRICTER)
def test_the_next_stricter_model_is_missed(double, model):
    inputs, expected = judged("render_sum", picture, ERROR_MODELS[model])
    assert faults(Narrow(ERROR_MODELS[double], DOWN), "render_sum", inputs, expected)
    inputs, expected = judged("render_gradients", residual, FP32)
    assert faults(Narrow(ERROR_MODELS[double]), "render_gradients", inputs, expected)


def faint():
    """The inputs of the case `faint_after_bright`."""
    rows = [splat(8.5, 8.5, 4.0, 0.0, 4.0, (color,) * 3) for color in (1.0, *[FAINT] * 15)]
    return {"parameters": splats(*rows), "width": 17, "height": 17}


def test_sums_of_16_terms_in_binary16_are_found_by_fp16():
    double = Narrow(ERROR_MODELS["fp16-sums/1"])
    assert faults(double, "render_sum", *judged("render_sum", faint, ERROR_MODELS["fp16-sums/1"])) == []
    assert faults(double, "render_sum", *judged("render_sum", faint, ERROR_MODELS["fp16/1"]))


@pytest.mark.parametrize("model", NARROW, ids=str)
def test_half_a_pixel_is_found_by_every_model(model):
    double = shifted(Narrow(model), 0.5)
    assert faults(double, "render_sum", *judged("render_sum", far_away, model))
    if model.name != "bf16/1":  # whose bounds of gradients say next to nothing
        assert faults(double, "render_gradients", *judged("render_gradients", residual, model))


@pytest.mark.parametrize("model", [model for model in NARROW if model.name != "bf16/1"], ids=str)
def test_a_colour_that_is_off_by_two_percent_is_found(model):
    assert faults(tinted(Narrow(model), 0.02), "render_sum", *judged("render_sum", picture, model))


def test_positions_stored_in_the_frame_are_found():
    inputs, expected = judged("render_sum", far_away, ERROR_MODELS["fp16/1"])
    assert faults(in_the_frame(Narrow(ERROR_MODELS["fp16/1"])), "render_sum", inputs, expected)
    inputs, expected = judged("render_sum", far_away, ERROR_MODELS["bf16/1"])
    assert faults(in_the_frame(Narrow(ERROR_MODELS["bf16/1"])), "render_sum", inputs, expected)


LOOSER = [("fp32/1", "tf32/1"), ("fp32/1", "fp16/1"), ("fp16/1", "fp16-sums/1"), ("tf32/1", "bf16/1")]


@pytest.mark.parametrize("operation", OPERATIONS)
@pytest.mark.parametrize(("stricter", "looser"), LOOSER)
def test_a_looser_model_has_larger_bounds(operation, stricter, looser):
    (maker, *_) = ASKED[operation]
    of_both = (judged(operation, maker, ERROR_MODELS[name])[1].values() for name in (stricter, looser))
    for strict, loose in zip(*of_both, strict=True):
        (low, high), (lower, higher) = ends(strict), ends(loose)
        assert np.all(lower <= low)
        assert np.all(higher >= high)


def ends(expectation):
    """The least and the largest value that is right."""
    if isinstance(expectation, Bounded):
        return expectation.value - expectation.bound, expectation.value + expectation.bound
    return expectation.lowest.astype(int), expectation.highest.astype(int)


@pytest.mark.parametrize("model", NARROW, ids=str)
def test_nothing_is_judged_beyond_what_can_be_stored(model):
    parameters = splats(splat(4.5, 4.5, 2.0, 0.0, 2.0, (1e5, 1.0, 1.0)))
    _, bound = render_exact_with_bound(parameters, 9, 9, model)
    assert np.isinf(bound[4, 4, 0]) == (model.largest < np.inf)
    assert np.isfinite(bound[4, 4, 1:]).all()
    inputs = {"parameters": parameters, "width": 9, "height": 9}
    expected = operations()["render_sum"].by_model(model, operations()["render_sum"].oracle(**inputs), inputs)
    assert faults(Narrow(model), "render_sum", inputs, expected) == []


def test_an_infinite_bound_of_fp32_allows_finite_numbers_alone():
    assert not Bounded(np.zeros(1), np.array([np.inf])).judge(np.array([np.inf], np.float32)).passed
    assert Bounded(np.zeros(1), np.array([np.inf]), may_overflow=True).judge(np.array([np.nan], np.float32)).passed


# The kit


def run(*words):
    return main(["run", "--reference", "--quiet", *words])


def test_a_run_by_a_model_names_it(tmp_path):
    path = tmp_path / "report.json"
    assert run("--case", "core/loss/loss_of_one_pixel", "--model", "tf32/1", "--json", str(path)) == 0
    written = json.loads(path.read_text(encoding="utf-8"))
    assert written["model"] == "tf32/1"
    assert written["notes"] == ["the bounds are those of the error model tf32/1"]
    assert "--model tf32/1" in written["command"]
    assert from_object(written).model == "tf32/1"


def test_a_verdict_names_the_model_where_bounds_depend_on_it():
    results = [Result(f"core/{name}/x", "", operations()[name].group, "pass") for name in ("render_sum", "to_half")]
    report = Report({}, "", "", [], results, whole=True, model="fp16/1")
    about = {quote.partition("class ")[2].partition(",")[0]: quote for quote in report.quotes()}
    assert ", profile paper, model fp16/1, level 5, 0 waivers" in about["rendering"]
    assert "model" not in about["reconstruction"]


def test_a_run_by_fp32_names_no_model(tmp_path):
    report = tmp_path / "report.json"
    run("--case", "core/loss/loss_of_one_pixel", "--json", str(report))
    assert "model" not in json.loads(report.read_text(encoding="utf-8"))


def test_a_claim_names_a_model():
    claim = read_claim("rendering,main,2,sizes,tf32/1")
    assert claim.model is ERROR_MODELS["tf32/1"]
    assert claim.options == ("sizes",)
    assert str(claim) == "rendering,main,2,sizes,tf32/1"
    assert read_claim("rendering,main,2").model is FP32


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("rendering,main,2,tf23/1", "no error model 'tf23/1'; did you mean tf32/1"),
        ("rendering,main,2,tf32/1,bf16/1", "several error models"),
    ],
)
def test_a_claim_of_an_unknown_model_is_refused(text, message):
    with pytest.raises(UsageError, match=message):
        read_claim(text)


def test_a_claim_and_another_model_contradict_each_other(capsys):
    assert run("--claim", "gradients,main,1,tf32/1", "--model", "bf16/1") == 2
    assert "is one of the error model tf32/1, and --model is bf16/1" in capsys.readouterr().err
