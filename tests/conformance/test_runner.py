"""Implementations, results and verdicts: what must fail fails, and nothing that it does breaks the kit."""

import io
import json
import os
import signal
import sys
import types

import numpy as np
import pytest
import toy_stages
from toy_stages import INPUTS, REFERENCE, good_program, write_program

from conformance.expectations import Exact
from conformance.implementations import Failure, ModuleImplementation, Unsupported, from_namespace, load_module
from conformance.process import MOST_BYTES, ProcessImplementation, read_output
from conformance.results import Report
from conformance.runner import run_suite
from conformance.selection import Selection, VectorFolder, check_manifest
from conformance.stage import Port
from conformance.vectors import SUMS, files_of, from_files
from gsvc_ref.errors import UsageError


def judge(folder, implementation, selection=None, **options) -> Report:
    vectors = VectorFolder(folder)
    results = run_suite(implementation, vectors.read(vectors.select(selection or Selection())), **options)
    return Report({}, "run", "", [], results)


def module(**changes) -> ModuleImplementation:
    return ModuleImplementation("toy", {**REFERENCE, **changes})


def outcomes(report) -> dict:
    return {result.id: result.outcome for result in report.results}


def verdicts(report) -> dict:
    return {group.name: group.verdict for group in report.groups()}


def test_the_reference_passes(folder):
    report = judge(folder, module())
    assert set(outcomes(report).values()) == {"pass"}
    assert set(outcomes(report)) == set(INPUTS)
    assert set(verdicts(report).values()) == {"passed"}
    assert report.passed


def test_vectors_come_by_level_and_then_in_the_order_of_the_stages(folder):
    order = [result.id for result in judge(folder, module()).results]
    assert order[:2] == ["core/parse/three_bytes", "core/paint/odd_size"]
    assert [name.split("/")[0] for name in order] == ["core"] * 5 + ["uncommon"] * 2 + ["stress", "faulty"]


def test_the_reference_passes_as_a_process(folder, tmp_path):
    report = judge(folder, ProcessImplementation(good_program(tmp_path), 60))
    assert set(outcomes(report).values()) == {"pass"}


def test_an_implementation_that_accepts_everything_fails(folder):
    """It returns zeros of the right type and shape, and no error for any stream."""

    def zeros(stage):
        def answer(**inputs):
            given = REFERENCE[stage](**inputs)
            return {name: "" if isinstance(value, str) else np.zeros_like(value) for name, value in given.items()}

        return answer

    report = judge(folder, ModuleImplementation("zeros", {stage: zeros(stage) for stage in REFERENCE}))
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

    result = judge(folder, module(halve=broken), Selection(stages=("halve",))).results[0]
    assert result.outcome == "error"
    assert "KeyError: 'no such thing'" in result.message
    assert "test_runner.py" in result.message


@pytest.mark.parametrize(
    "function", [lambda values: 0, lambda values, factor, more: 0, lambda *values: 0, lambda values, /, factor: 0]
)
def test_a_function_with_other_parameters_is_told_which_it_must_have(folder, function):
    result = judge(folder, module(scale=function), Selection(stages=("scale",))).results[0]
    assert result.outcome == "error"
    assert result.message.startswith("scale must take (values, factor): ")


def test_a_function_that_does_not_tell_its_parameters_is_called(folder):
    class Silent:
        def __call__(self, **inputs):
            return toy_stages.scale(**inputs)

        @property
        def __signature__(self):
            raise ValueError("no signature found")

    for function in (lambda **inputs: toy_stages.scale(**inputs), Silent()):
        assert outcomes(judge(folder, module(scale=function)))["core/scale/by_two"] == "pass"


def test_sys_exit_of_a_module_does_not_end_the_kit(folder):
    report = judge(folder, module(halve=lambda values: sys.exit(0)))
    assert outcomes(report)["core/halve/one_to_six"] == "error"
    assert len(report.results) == len(INPUTS)


def test_not_implemented_is_unsupported(folder):
    def missing(values):
        raise NotImplementedError("on this GPU")

    result = judge(folder, module(halve=missing), Selection(stages=("halve",))).results[0]
    assert (result.outcome, result.message) == ("unsupported", "on this GPU")


def test_an_implementation_cannot_change_what_it_is_judged_by(folder):
    def spoil(values, factor):
        scaled = values * np.float32(factor)
        values[:] = 0
        return {"scaled": scaled}

    assert judge(folder, module(scale=spoil)).passed


def test_single_numbers_may_be_pythons(folder):
    report = judge(folder, module(parse=lambda stream: {**toy_stages.parse(stream), "count": len(stream) % 20}))
    assert outcomes(report)["core/parse/three_bytes"] == "pass"


def test_one_missing_core_vector_makes_a_class_incomplete_and_an_uncommon_one_does_not(folder):
    def few_bits(width, height, bit_depth):
        if bit_depth != 8:
            raise NotImplementedError
        return toy_stages.paint(width, height, bit_depth)

    def no_odd_sizes(width, height, bit_depth):
        if width % 2:
            raise NotImplementedError
        return toy_stages.paint(width, height, bit_depth)

    assert verdicts(judge(folder, module(paint=few_bits)))["rendering"] == "passed"
    report = judge(folder, module(paint=no_odd_sizes))
    assert verdicts(report)["rendering"] == "incomplete"
    assert "without part of paint (1 vector)" in next(g.reason for g in report.groups() if g.name == "rendering")
    assert not report.passed


def test_an_uncommon_stream_may_be_refused_as_unsupported_and_as_nothing_else(folder):
    for error, outcome in (("unsupported R-6.1-2 40", "unsupported"), ("malformed", "fail"), ("limit", "fail")):

        def parse(stream, error=error):
            return {"count": np.asarray(0), "error": error} if not stream else toy_stages.parse(stream)

        report = judge(folder, module(parse=parse))
        assert outcomes(report)["uncommon/parse/empty"] == outcome
        assert verdicts(report)["bitstream"] == ("passed" if outcome == "unsupported" else "failed")


def test_rule_and_bit_of_a_refusal_are_judged_for_the_projects_own_only(folder):
    def vague(stream):
        given = toy_stages.parse(stream)
        return {**given, "error": given["error"].partition(" ")[0]}

    assert judge(folder, module(parse=vague)).passed
    assert not judge(folder, from_namespace("own", {**REFERENCE, "parse": vague})).passed


def test_waivers(folder):
    wrong = module(halve=lambda values: {**toy_stages.halve(values), "count": np.asarray(0)})
    report = judge(folder, wrong, waivers={"core/halve/one_to_six": "bug 12"})
    assert outcomes(report)["core/halve/one_to_six"] == "waived"
    assert "bug 12" in next(r.message for r in report.results if r.outcome == "waived")
    assert report.passed
    assert not judge(folder, wrong, Selection(stages=("halve",)), waivers={"core/halve/one_to_six": "bug 12"}).passed


def test_a_skipped_vector_is_not_run_and_its_class_not_passed(folder):
    report = judge(folder, module(scale=None), skips={"core/scale/by_two": "slow"})
    assert outcomes(report)["core/scale/by_two"] == "skipped"
    report = judge(folder, module(), skips={"core/scale/by_two": "slow"})
    assert verdicts(report)["training"] == "waived"


def test_the_worst_ratio_and_its_place(folder):
    def off(values, factor):
        scaled = values * np.float32(factor)
        if len(scaled) == 3:
            scaled[2, 1] *= np.float32(1 + 2.0**-20)
        return {"scaled": scaled}

    report = judge(folder, module(scale=off), Selection(stages=("scale",)))
    (summary,) = report.stages()
    assert summary.ratio == pytest.approx(8, rel=0.2)
    assert summary.place == "core/scale/by_two scaled [2, 1]"
    assert summary.faults == 1


# Processes


def outcome_of(folder, tmp_path, text, timeout=60.0):
    command = write_program(tmp_path, text)
    report = judge(folder, ProcessImplementation(command, timeout), Selection(stages=("halve",)))
    assert not report.passed
    return report.results[0]


def test_a_process_that_crashes(folder, tmp_path):
    result = outcome_of(folder, tmp_path, "import os; print('so far', flush=True); os.kill(os.getpid(), 11)")
    assert (result.outcome, result.message) == ("crash", "killed by SIGSEGV")
    assert result.log == "so far"


def test_a_process_that_never_ends(folder, tmp_path):
    result = outcome_of(folder, tmp_path, "import time; print('zzz', flush=True); time.sleep(600)", timeout=1.0)
    assert (result.outcome, result.message) == ("timeout", "no end after 1 s")
    assert result.log == "zzz"


def test_no_process_outlives_its_vector(folder, tmp_path):
    note = tmp_path / "pid"
    text = (
        "import subprocess, sys, pathlib, time\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
        f"pathlib.Path({str(note)!r}).write_text(str(child.pid))\n"
        "time.sleep(600 if {} else 0)\n"
    )
    for sleeps in (True, False):
        outcome_of(folder, tmp_path, text.format(sleeps), timeout=3.0)
        pid = int(note.read_text())
        for _ in range(200):  # the kernel may take a moment to bury it
            if not _alive(pid):
                break
            signal.sigtimedwait([signal.SIGUSR2], 0.02)
        assert not _alive(pid)


def _alive(pid) -> bool:
    try:
        with open(f"/proc/{pid}/stat") as stat:
            return stat.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_exit_statuses(folder, tmp_path):
    assert outcome_of(folder, tmp_path, "raise SystemExit(77)").outcome == "unsupported"
    result = outcome_of(folder, tmp_path, "raise SystemExit(3)")
    assert (result.outcome, result.message) == ("error", "exit status 3")
    result = outcome_of(folder, tmp_path, "raise ValueError('something is wrong')")
    assert result.outcome == "error"
    assert result.log.endswith("ValueError: something is wrong")


def test_only_the_ends_of_what_is_printed_are_kept(folder, tmp_path):
    text = "print('the reason', 'x' * 10_000_000, 'the end', sep='\\n'); raise SystemExit(1)"
    result = outcome_of(folder, tmp_path, text)
    assert result.log.startswith("the reason\n")
    assert result.log.endswith("\nthe end")
    assert 4000 < len(result.log) <= 4096


WRITE = "import sys, os, pathlib; out = pathlib.Path(sys.argv[3])\n"
GARBAGE = {
    "nothing": "",
    "not-npy": "(out / 'half.npy').write_bytes(b'garbage')",
    "empty": "(out / 'half.npy').write_bytes(b'')",
    "folder": "(out / 'half.npy').mkdir()",
    "link": "os.symlink('/dev/zero', out / 'half.npy')",
    "pipe": "os.mkfifo(out / 'half.npy')",
    "huge": f"f = open(out / 'half.npy', 'wb'); f.truncate({MOST_BYTES + 1})",
}


@pytest.mark.parametrize("text", GARBAGE.values(), ids=GARBAGE)
def test_garbage_instead_of_outputs(folder, tmp_path, text):
    result = outcome_of(folder, tmp_path, WRITE + text)
    assert result.outcome == "error"
    assert "half.npy" in result.message


def test_other_files_are_ignored(folder, tmp_path):
    text = good_program(tmp_path).split()[1]
    with open(text, "a") as program:
        program.write("Path(outside, 'more.npy').write_bytes(b'garbage'); Path(outside, 'x').mkdir()\n")
    assert judge(folder, ProcessImplementation(f"{sys.executable} {text}", 60), Selection(stages=("halve",))).passed


def header(text, version=b"\x01\x00") -> bytes:
    return b"\x93NUMPY" + version + len(text).to_bytes(2 if version[0] == 1 else 4, "little") + text


GOOD = b"{'descr': '<i8', 'fortran_order': False, 'shape': (2,), }\n"
BAD_HEADERS = {
    "shape": header(GOOD.replace(b"2,", b"3,")) + bytes(16),
    "negative": header(GOOD.replace(b"2,", b"-1,-2")) + bytes(16),
    "no-length": header(GOOD.replace(b"2,", b"0,10**30")) + bytes(16),
    "giant": header(GOOD.replace(b"2,", b"0, 1" + b"0" * 30)),
    "short": header(GOOD) + bytes(15),
    "long": header(GOOD) + bytes(17),
    "objects": header(GOOD.replace(b"<i8", b"|O")) + bytes(16),
    "text": header(GOOD.replace(b"<i8", b"|S8")) + bytes(16),
    "code": header(b"__import__('os').abort()\n") + bytes(16),
    "nesting": header(b"(" * 9000 + b"\n"),
    "version": header(GOOD, b"\x07\x00") + bytes(16),
    "cut": header(GOOD)[:30],
}


@pytest.mark.parametrize("data", BAD_HEADERS.values(), ids=BAD_HEADERS)
def test_a_hostile_npy_file_is_refused(tmp_path, data):
    (tmp_path / "half.npy").write_bytes(data)
    with pytest.raises(ValueError, match=r"^half\.npy"):
        read_output(tmp_path, Port("half", "i8", "(N,)"))


@pytest.mark.parametrize("version", [b"\x01\x00", b"\x02\x00"])
def test_an_npy_file_is_read_as_numpy_reads_it(tmp_path, version):
    (tmp_path / "half.npy").write_bytes(header(GOOD, version) + np.array([5, -7], "<i8").tobytes())
    assert read_output(tmp_path, Port("half", "i8", "(N,)")).tolist() == [5, -7]


def test_arrays_by_columns_are_read(tmp_path):
    array = np.asfortranarray(np.arange(6.0).reshape(2, 3))
    np.save(tmp_path / "half.npy", array)
    read = read_output(tmp_path, Port("half", "f8", "(A, B)"))
    assert np.array_equal(read, array)
    assert read.flags.c_contiguous


def test_a_text_is_read_without_its_end_of_line_and_may_be_no_unicode(tmp_path):
    (tmp_path / "error.txt").write_bytes(b"malformed R-6.2-2 412\r\n")
    assert read_output(tmp_path, Port("error", "text")) == "malformed R-6.2-2 412"
    (tmp_path / "error.txt").write_bytes(b"\xff\xfe")
    assert read_output(tmp_path, Port("error", "text")) == "\ufffd\ufffd"


def test_inputs_as_files(toys, tmp_path):
    text = (
        "import sys, json, pathlib, numpy as np\n"
        "found = {p.name: p.read_bytes().hex() for p in pathlib.Path(sys.argv[2]).iterdir()}\n"
        f"pathlib.Path({str(tmp_path / 'found.json')!r}).write_text(json.dumps([sys.argv[1], found]))\n"
        "raise SystemExit(77)\n"
    )
    inputs = {"values": np.arange(3, dtype="<f4"), "width": 7, "factor": 0.5, "stream": b"\x00\xff"}
    answer = ProcessImplementation(write_program(tmp_path, text), 60).run(toys["halve"], inputs)
    assert isinstance(answer, Unsupported)
    stage, found = json.loads((tmp_path / "found.json").read_text())
    assert stage == "halve"
    assert sorted(found) == ["factor.npy", "stream.gsvc", "values.npy", "width.npy"]
    assert found["stream.gsvc"] == "00ff"
    for name, dtype in (("values", "<f4"), ("width", "<i8"), ("factor", "<f8")):
        array = np.load(io.BytesIO(bytes.fromhex(found[f"{name}.npy"])))
        assert array.dtype.str == dtype
        assert np.array_equal(array, inputs[name])


def test_a_program_that_is_not_there_or_cannot_be_started(toys, tmp_path):
    script = tmp_path / "script"
    script.write_text("not executable yet\n")
    wrong = {
        "": "--impl needs a command",
        "  ": "--impl needs a command",
        "/no/such/program": "there is no program '/no/such/program'",
        "'unfinished": "cannot be split into words",
        str(tmp_path): "is a folder",
        f"{script} --fast": rf"{script} cannot be executed: chmod \+x",
    }
    for command, message in wrong.items():
        with pytest.raises(UsageError, match=message):
            ProcessImplementation(command, 1)
    script.write_text("no interpreter is named here\n")
    script.chmod(0o755)
    answer = ProcessImplementation(str(script), 10).run(toys["halve"], {"values": np.arange(2)})
    assert isinstance(answer, Failure)
    assert answer.outcome == "error"


def test_no_shell_sees_a_command(folder, tmp_path):
    target = tmp_path / "made"
    command = f"{sys.executable} -c 'raise SystemExit(77)' ; touch {target}"
    judge(folder, ProcessImplementation(command, 60), Selection(stages=("halve",)))
    assert not target.exists()


def test_a_module_that_cannot_be_imported(toys, monkeypatch, tmp_path):
    (tmp_path / "broken_module_of_a_test.py").write_text("1 / 0")
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("broken_module_of_a_test", "no_such_module_of_a_test"):
        with pytest.raises(UsageError, match=name):
            load_module(name)
    monkeypatch.setitem(sys.modules, "module_of_a_test", types.SimpleNamespace(halve=toy_stages.halve))
    assert load_module("module_of_a_test").functions["halve"] is toy_stages.halve


# Vectors


def test_missing_or_empty_vectors_are_refused(toys, tmp_path):
    with pytest.raises(UsageError, match="there are no vectors"):
        VectorFolder(tmp_path)
    (tmp_path / SUMS).write_text("")
    with pytest.raises(UsageError, match="lists no vectors"):
        VectorFolder(tmp_path).select(Selection())


def test_selections(folder):
    vectors = VectorFolder(folder)
    assert len(vectors.select(Selection())) == len(INPUTS)
    assert len(vectors.select(Selection(levels=("uncommon",)))) == 2
    assert vectors.select(Selection(groups=("training",), levels=("stress",))) == ["stress/scale/nothing"]
    assert vectors.select(Selection(patterns=("by_*",))) == ["core/scale/by_a_third", "core/scale/by_two"]
    assert vectors.select(Selection(patterns=("*/halve/*",))) == ["core/halve/one_to_six"]
    with pytest.raises(UsageError, match="case nothing_like_it"):
        vectors.select(Selection(patterns=("nothing_like_it",)))


def test_a_vector_that_was_changed_or_lost_is_refused(folder):
    vectors = VectorFolder(folder)
    part = folder / "core/scale/by_two/values.npy"
    data = part.read_bytes()
    part.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    with pytest.raises(UsageError, match=r"values\.npy is not the file"):
        list(vectors.read(["core/scale/by_two"]))
    os.unlink(part)
    with pytest.raises(UsageError, match=r"values\.npy is missing"):
        list(vectors.read(["core/scale/by_two"]))


def test_a_vector_of_an_unknown_stage_is_refused(folder):
    sums = folder / SUMS
    sums.write_text(sums.read_text() + f"{'0' * 64}  core/teleport/far/manifest.json\n")
    with pytest.raises(UsageError, match="core/teleport/far"):
        VectorFolder(folder)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda m: m | {"tolerance": 3}, "the field tolerance"),
        (lambda m: m["inputs"]["factor"].update(unit="px"), "the field unit of factor"),
        (lambda m: m["outputs"]["scaled"].update(slack=2), "the field slack of scaled"),
        (lambda m: m["outputs"]["scaled"].update(check="fuzzy"), "check fuzzy"),
    ],
)
def test_unknown_manifest_fields_are_refused(folder, change, named):
    manifest = json.loads((folder / "core/scale/by_two/manifest.json").read_text())
    check_manifest(manifest["id"], manifest)
    with pytest.raises(UsageError, match=named):
        check_manifest(manifest["id"], change(manifest) or manifest)


def test_an_output_may_have_the_name_of_an_input(toys):
    inputs = INPUTS["core/scale/by_two"]
    expected = {"values": Exact(inputs["values"] * np.float32(2))}
    vector = from_files(files_of(toy_stages.case_of("core/scale/by_two"), inputs, expected))
    assert np.array_equal(vector.inputs["values"], inputs["values"])
    assert vector.expected["values"].judge(inputs["values"] * np.float32(2)).passed
