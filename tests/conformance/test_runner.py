"""Judging: what must fail fails, and nothing that an implementation does breaks the kit."""

import sys
import types
from dataclasses import replace

import numpy as np
import pytest
import toy_operations
from toy_operations import INPUTS, REFERENCE, good_program, judge, module, outcomes, verdicts

from gsvc_base.errors import UsageError
from gsvc_conformance.implementations import ModuleImplementation, from_namespace, load_module
from gsvc_conformance.process import ProcessImplementation
from gsvc_conformance.runner import judge_outputs
from gsvc_conformance.vector import VECTORS
from gsvc_conformance.vector_folder import Selection, VectorFolder


def test_the_reference_passes(folder):
    report = judge(folder, module())
    assert set(outcomes(report).values()) == {"pass"}
    assert set(outcomes(report)) == set(INPUTS)
    assert set(verdicts(report).values()) == {"passed"}
    assert report.passed


def test_vectors_come_by_tier_and_then_in_the_order_of_the_operations(folder):
    order = [result.id for result in judge(folder, module()).results]
    assert order[:2] == ["core/parse/three_bytes", "core/paint/odd_size"]
    assert [name.split("/")[0] for name in order] == ["core"] * 5 + ["uncommon"] * 2 + ["stress", "faulty"]


@pytest.mark.exhaustive
def test_the_reference_passes_as_a_process(folder, tmp_path):
    report = judge(folder, ProcessImplementation(good_program(tmp_path), 60))
    assert set(outcomes(report).values()) == {"pass"}


def test_an_implementation_that_accepts_everything_fails(folder):
    """It returns zeros of the right type and shape, and no error for any stream."""

    def zeros(operation):
        def answer(**inputs):
            given = REFERENCE[operation](**inputs)
            return {name: "" if isinstance(value, str) else np.zeros_like(value) for name, value in given.items()}

        return answer

    report = judge(folder, ModuleImplementation("zeros", {operation: zeros(operation) for operation in REFERENCE}))
    assert not report.passed
    assert set(verdicts(report).values()) == {"failed"}
    assert outcomes(report)["faulty/parse/bad_letter"] == "fail"


def test_an_implementation_that_refuses_everything_fails(folder):
    report = judge(folder, ModuleImplementation("nothing", {}))
    assert set(outcomes(report).values()) == {"unsupported"}
    assert set(verdicts(report).values()) == {"not claimed"}
    assert not report.passed


def test_an_implementation_to_which_every_stream_is_an_error_fails(folder):
    for error in ("malformed R-3.1-1 8", "unsupported"):
        report = judge(folder, module(parse=lambda stream, error=error: {"count": np.asarray(0), "error": error}))
        assert verdicts(report)["bitstream"] == "failed"
        assert outcomes(report)["core/parse/three_bytes"] == "fail"
        assert not report.passed


@pytest.mark.parametrize(
    "value",
    [None, (), [], {}, "x", 3, np.float32(1), np.array([None]), np.array("text"), np.full((7, 2), np.nan, "<f4")],
)
def test_an_output_of_any_other_kind_fails(folder, value):
    report = judge(folder, module(scale=lambda **_: {"scaled": value}))
    assert verdicts(report)["training"] == "failed"
    assert {o for name, o in outcomes(report).items() if "/scale/" in name} == {"fail"}


def test_a_module_that_returns_no_dict_or_not_all_outputs_is_in_error(folder):
    for value in (None, np.zeros(3), [1], {}, {"half": np.zeros(6, "<i8")}):
        report = judge(folder, module(halve=lambda values, value=value: value))
        assert outcomes(report)["core/halve/one_to_six"] == "error"
        assert not report.passed


def test_an_exception_is_an_error_with_its_last_line(folder):
    def broken(values):
        raise KeyError("no such thing")

    result = judge(folder, module(halve=broken), Selection(operations=("halve",))).results[0]
    assert result.outcome == "error"
    assert "KeyError: 'no such thing'" in result.message
    assert "test_runner.py" in result.message


@pytest.mark.parametrize(
    "function", [lambda values: 0, lambda values, factor, more: 0, lambda *values: 0, lambda values, /, factor: 0]
)
def test_a_function_with_other_parameters_is_told_which_it_must_have(folder, function):
    result = judge(folder, module(scale=function), Selection(operations=("scale",))).results[0]
    assert result.outcome == "error"
    assert result.message.startswith("scale must take (values, factor): ")


def test_a_function_that_does_not_tell_its_parameters_is_called(folder):
    class Silent:
        def __call__(self, **inputs):
            return toy_operations.scale(**inputs)

        @property
        def __signature__(self):
            raise ValueError("no signature found")

    for function in (lambda **inputs: toy_operations.scale(**inputs), Silent()):
        assert outcomes(judge(folder, module(scale=function)))["core/scale/by_two"] == "pass"


def test_a_module_that_makes_the_processor_flush_subnormal_numbers_is_in_error(folder):
    torch = pytest.importorskip("torch", reason="PyTorch (extra peers) can switch flushing on")

    def halve(**inputs):
        torch.set_flush_denormal(True)
        return REFERENCE["halve"](**inputs)

    try:
        report = judge(folder, module(halve=halve))
    finally:
        torch.set_flush_denormal(False)
    wrong = [result for result in report.results if result.operation == "halve"]
    assert {result.outcome for result in wrong} == {"error"}
    assert "subnormal" in wrong[0].message


def test_sys_exit_of_a_module_does_not_end_the_kit(folder):
    report = judge(folder, module(halve=lambda values: sys.exit(0)))
    assert outcomes(report)["core/halve/one_to_six"] == "error"
    assert len(report.results) == len(INPUTS)


def test_not_implemented_is_unsupported(folder):
    def missing(values):
        raise NotImplementedError("on this GPU")

    result = judge(folder, module(halve=missing), Selection(operations=("halve",))).results[0]
    assert (result.outcome, result.message) == ("unsupported", "on this GPU")


def test_an_implementation_cannot_change_what_it_is_judged_by(folder):
    def spoil(values, factor):
        scaled = values * np.float32(factor)
        values[:] = 0
        return {"scaled": scaled}

    assert judge(folder, module(scale=spoil)).passed


def test_single_numbers_may_be_pythons(folder):
    report = judge(folder, module(parse=lambda stream: {**toy_operations.parse(stream), "count": len(stream) % 20}))
    assert outcomes(report)["core/parse/three_bytes"] == "pass"


def test_one_missing_vector_of_any_tier_makes_a_class_incomplete(folder):
    def few_bits(width, height, bit_depth):
        if bit_depth != 8:
            raise NotImplementedError
        return toy_operations.paint(width, height, bit_depth)

    def no_odd_sizes(width, height, bit_depth):
        if width % 2:
            raise NotImplementedError
        return toy_operations.paint(width, height, bit_depth)

    for paint in (few_bits, no_odd_sizes):
        report = judge(folder, module(paint=paint))
        assert verdicts(report)["rendering"] == "incomplete"
        reason = next(group.reason for group in report.groups() if group.name == "rendering")
        assert "without part of paint (1 vector: " in reason
        assert not report.passed


@pytest.mark.parametrize(
    ("level", "error", "count", "outcome"),
    [
        (2, "unsupported R-5-6 88", 0, "unsupported"),
        (3, "unsupported R-5-6 88", 0, "fail"),
        (2, "unsupported R-5-6 88", 3, "fail"),
        (2, "limit R-5-1 88", 0, "fail"),
        (2, "malformed", 0, "fail"),
    ],
)
def test_only_a_stream_above_the_level_may_be_refused_as_unsupported_and_without_frames(
    folder, level, error, count, outcome
):
    vector = next(VectorFolder(folder).read(["core/parse/three_bytes"]))
    vector = replace(vector, manifest={**vector.manifest, "level": 3})
    result = judge_outputs(vector, {"count": np.asarray(count, "<i8"), "error": error}, level=level)
    assert result.outcome == outcome
    assert (result.level, result.tier) == (3, "core")


@pytest.mark.parametrize(
    ("case", "bit", "outcome"),
    [
        ("header_of_1024_bytes", 104, "unsupported"),
        ("header_of_1024_bytes", 96, "fail"),
        ("empty_frames", 96, "unsupported"),
    ],
)
def test_a_stream_of_another_profile_is_refused_where_that_element_stands(case, bit, outcome):
    vector = next(VectorFolder(VECTORS).read([f"core/reconstruct_stream/{case}"]))
    nothing = {"counts": np.zeros(0, np.int64), "parameters": np.zeros((0, 8), np.float32)}
    assert judge_outputs(vector, {**nothing, "error": f"unsupported R-5-6 {bit}"}).outcome == outcome


def test_a_faulty_stream_of_another_profile_that_is_refused_for_it_is_no_answer():
    vector = next(VectorFolder(VECTORS).read(["faulty/reconstruct_stream/r_3_2_1_flags_4"]))
    nothing = {"counts": np.zeros(0, np.int64), "parameters": np.zeros((0, 8), np.float32)}
    given = {"unsupported R-5-6 96": "unsupported", "unsupported R-3.2-1 96": "pass", "unsupported": "pass"}
    assert {error: judge_outputs(vector, {**nothing, "error": error}).outcome for error in given} == given


def test_a_right_answer_above_the_level_is_a_pass(folder):
    vector = next(VectorFolder(folder).read(["faulty/parse/bad_letter"]))
    vector = replace(vector, manifest={**vector.manifest, "level": 3})
    assert judge_outputs(vector, toy_operations.parse(b"xyz")).outcome == "pass"


def test_rule_and_bit_of_a_refusal_are_judged_for_the_projects_own_only(folder):
    def vague(stream):
        given = toy_operations.parse(stream)
        return {**given, "error": given["error"].partition(" ")[0]}

    assert judge(folder, module(parse=vague)).passed
    assert not judge(folder, from_namespace("own", {**REFERENCE, "parse": vague})).passed


def test_waivers(folder):
    wrong = module(halve=lambda values: {**toy_operations.halve(values), "count": np.asarray(0)})
    report = judge(folder, wrong, waivers={"core/halve/one_to_six": "bug 12"})
    assert outcomes(report)["core/halve/one_to_six"] == "waived"
    assert "bug 12" in next(r.message for r in report.results if r.outcome == "waived")
    assert report.passed
    assert not judge(
        folder, wrong, Selection(operations=("halve",)), waivers={"core/halve/one_to_six": "bug 12"}
    ).passed


def test_a_skipped_vector_is_not_run_and_its_class_not_passed(folder):
    report = judge(folder, module(scale=None), skips={"core/scale/by_two": "slow"})
    assert outcomes(report)["core/scale/by_two"] == "skipped"
    report = judge(folder, module(), skips={"core/scale/by_two": "slow"})
    assert verdicts(report)["training"] == "incomplete"


def test_the_worst_ratio_and_its_place(folder):
    def off(values, factor):
        scaled = values * np.float32(factor)
        if len(scaled) == 3:
            scaled[2, 1] *= np.float32(1 + 2.0**-20)
        return {"scaled": scaled}

    report = judge(folder, module(scale=off), Selection(operations=("scale",)))
    (summary,) = report.operations()
    assert summary.ratio == pytest.approx(8, rel=0.2)
    assert summary.place == "core/scale/by_two scaled splat 2, column 1"
    assert summary.faults == 1


def test_a_module_that_cannot_be_imported(toys, monkeypatch, tmp_path):
    (tmp_path / "broken_module_of_a_test.py").write_text("1 / 0")
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("broken_module_of_a_test", "no_such_module_of_a_test"):
        with pytest.raises(UsageError, match=name):
            load_module(name)
    (tmp_path / "leaving_module_of_a_test.py").write_text("import sys\nsys.exit(0)")
    with pytest.raises(UsageError, match="leaving_module_of_a_test ended while it was imported: SystemExit: 0"):
        load_module("leaving_module_of_a_test")
    monkeypatch.setitem(sys.modules, "module_of_a_test", types.SimpleNamespace(halve=toy_operations.halve))
    assert load_module("module_of_a_test").functions["halve"] is toy_operations.halve
