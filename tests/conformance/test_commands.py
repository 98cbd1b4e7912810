"""The commands of ``gsvc-conformance``: what they print, write and return."""

import html
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import toy_operations
from toy_operations import INPUTS, PROGRAM, good_program, write_program

from gsvc_base.interrupts import TERMINATION
from gsvc_conformance import reference
from gsvc_conformance.__main__ import COMMANDS, MAINTAINING, REFERENCE, USING, main
from gsvc_conformance.commands import list as listing
from gsvc_conformance.report.failures import NO_PICTURES
from gsvc_conformance.report.json import from_object
from gsvc_conformance.results import NOT_ASKED
from gsvc_conformance.vector import VECTORS, set_hash
from gsvc_conformance.vector_folder import VectorFolder

ROOT = Path(__file__).parents[2]
QUIET = ["--quiet", "--no-diagnosis"]


def wrong_halves(values):
    return {**toy_operations.halve(values), "count": np.asarray(0)}


def wrong_frames(width, height, bit_depth):
    return {"frame": toy_operations.paint(width, height, bit_depth)["frame"][::-1].copy()}


def run(folder, *words) -> int:
    return main(["run", *words, "--vectors", str(folder), *QUIET])


def test_every_command_has_help(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "300")  # a line for each command
    for name, sentence in COMMANDS.items():
        assert main([name, "--help"]) == 0
        out = capsys.readouterr().out
        assert sentence[1:] in " ".join(out.split())
    assert main(["--help"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert all(f"{name} for maintainers: {sentence}" in out for name, sentence in MAINTAINING.items())
    assert all(f"{name} {sentence}" in out for name, sentence in USING.items())
    start = out.partition("Start with: gsvc-conformance ")[2]
    assert main([*start.split(), *QUIET]) == 0  # with what a plain installation has


def test_wrong_use(capsys):
    for words in (
        [],
        ["fly"],
        ["run"],
        ["run", "--reference", "--spec"],
        ["--quiet", "run"],
        ["run", "--tier", "easy"],
    ):
        assert main(words) == 2
        assert "conformance" in capsys.readouterr().err


def test_only_the_module_of_the_command_is_imported():
    code = (
        "import sys; from gsvc_conformance.__main__ import build_parser; build_parser('streams'); print(*sys.modules)"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT).stdout
    assert "gsvc_conformance.commands.streams" in out
    assert "gsvc_conformance.commands.run" not in out
    assert "numba" not in out.split()


def test_a_run_that_passes(folder, toy_module, capsys):
    assert run(folder, "--module", toy_module()) == 0
    out = capsys.readouterr().out
    assert out.endswith("PASSED\n")
    assert "class training      passed: 3 vectors pass" in out


def test_the_reference_is_the_operations_own(folder, capsys):
    assert run(folder, "--reference") == 0
    assert reference.halve is toy_operations.halve
    with pytest.raises(AttributeError):
        reference.__getattr__("no_such_operation")


def test_a_run_that_fails_and_the_commands_that_run_one_vector_again(folder, toy_module, capsys):
    name = toy_module(halve=wrong_halves)
    assert run(folder, "--module", name) == 1
    out = capsys.readouterr().out
    assert "FAIL core/halve/one_to_six: The vector one_to_six." in out
    assert "count is 0, expected 6" in out
    (again,) = re.findall(r"again: gsvc-conformance (.*)", out)
    assert again == f"run --module {name} --vectors {folder} --case core/halve/one_to_six"
    assert main([*again.split(), *QUIET]) == 1
    out = capsys.readouterr().out
    assert "core/halve/one_to_six" in out
    assert re.search(r"class quantization\s+failed: ", out)
    assert "of case core/halve/one_to_six only" in out


def test_a_run_of_a_command(folder, tmp_path, capsys):
    assert (
        run(folder, "--impl", good_program(tmp_path), "--tier", "core", "--operation", "halve", "--timeout", "50") == 0
    )
    broken = write_program(tmp_path, "raise SystemExit(1)")
    assert run(folder, "--impl", broken, "--operation", "halve", "--timeout", "50") == 1
    assert f"--impl '{broken}' --timeout 50 --vectors" in capsys.readouterr().out


def test_missing_vectors_and_empty_selections_are_no_success(folder, toy_module, tmp_path, capsys):
    name = toy_module()
    assert run(tmp_path / "nowhere", "--module", name) == 2
    assert "there is no folder" in capsys.readouterr().err
    assert run(folder, "--module", name, "--case", "unicorn") == 2
    assert run(folder, "--module", name, "--operation", "unicorn") == 2
    assert "there is no operation 'unicorn'" in capsys.readouterr().err
    assert run(folder, "--module", "no_such_module") == 2
    assert run(folder, "--impl", "/no/such/program") == 2
    assert run(folder, "--module", name, "--html", str(tmp_path / "no" / "page.html")) == 2


def test_skips(folder, toy_module, capsys):
    assert run(folder, "--module", toy_module(halve=wrong_halves), "--skip", "core/halve/*") == 0
    assert re.search(r"class quantization\s+not claimed", capsys.readouterr().out)


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_time_that_is_used(folder, tmp_path, capsys, jobs):
    """The vectors with the least work are asked for, a rerun has the option, and nothing can be quoted."""
    slow = write_program(tmp_path, "import time\ntime.sleep(0.4)\n" + PROGRAM.format(home=str(Path(__file__).parent)))
    words = ["--impl", slow, "--json", str(tmp_path / "report.json"), "--jobs", jobs]
    assert run(folder, *words, "--seconds", "0.3") == 0
    value = json.loads((tmp_path / "report.json").read_text())
    asked = [result["id"] for result in value["results"] if result["outcome"] == "pass"]
    assert asked == (["uncommon/parse/empty"] if jobs == "1" else ["core/parse/three_bytes", "uncommon/parse/empty"])
    assert {result["message"] for result in value["results"] if result["outcome"] == "skipped"} == {NOT_ASKED}
    left = len(INPUTS) - len(asked)
    assert capsys.readouterr().out.endswith(f"; no class is complete; {left} vectors not asked\n")
    assert from_object(value).whole_command.endswith(" --seconds 0.3")
    assert from_object(value).quotes() == []
    assert main(["report", str(tmp_path / "report.json")]) == 0
    assert capsys.readouterr().out.endswith(f"; {left} vectors not asked\n")
    for other in (["--claim", "bitstream,paper,1"], ["--order", "1"]):
        assert run(folder, "--reference", "--seconds", "1", *other) == 2
        assert "--seconds runs small vectors first" in capsys.readouterr().err


def test_vectors_with_little_work_come_first():
    vectors = VectorFolder(VECTORS)
    names = (
        "core/render_sum/a_splat_in_the_middle",
        "core/render_sum/many_splats_400",
        "stress/render_sum/long_frame_wide",
    )
    simple, many, long = map(vectors.work, names)
    assert simple < 2000
    assert min(many, long) > 500_000


def test_files_of_a_run_and_the_report_again(folder, toy_module, tmp_path, capsys):
    name = toy_module(paint=wrong_frames, halve=wrong_halves)
    files = {kind: str(tmp_path / f"report.{kind}") for kind in ("json", "junit", "html")}
    kept = tmp_path / "kept"
    options = [word for kind, path in files.items() for word in (f"--{kind}", path)]
    assert run(folder, "--module", name, *options, "--keep", str(kept)) == 1
    printed = capsys.readouterr().out
    value = json.loads(Path(files["json"]).read_text())
    assert value["environment"]["vectors"] == set_hash(folder)
    assert value["environment"]["implementation"] == name
    assert len(from_object(value).results) == len(INPUTS)
    assert ET.parse(files["junit"]).getroot().get("tests") == str(len(INPUTS))
    page = Path(files["html"]).read_text()
    assert page.count('src="data:image/png') == 1 + 2 * 3  # the scale; expected, actual and error of both frames
    assert sorted(path.name for path in (kept / "core/paint/odd_size/in").iterdir()) == [
        "bit_depth.npy",
        "height.npy",
        "width.npy",
    ]
    kept_frame = np.load(kept / "core/paint/odd_size/out/frame.npy")
    assert np.array_equal(kept_frame, wrong_frames(7, 5, 8)["frame"])
    assert (kept / "core/paint/odd_size/expected/frame.lowest.npy").is_file()
    assert not (kept / "core/scale").exists()

    again = tmp_path / "again.html"
    assert main(["report", files["json"], "--html", str(again)]) == 1
    lines = printed.splitlines(keepends=True)
    written = [f"JSON: {files['json']}\n", f"JUnit XML: {files['junit']}\n", f"page: {files['html']}\n"]
    assert lines[-6:-3] == written
    assert lines[-3].endswith(f"{kept}\n")
    note = f"note: {NO_PICTURES}\n"
    assert capsys.readouterr().out == "".join([*lines[:-6], note, *lines[-2:]])
    assert html.escape(NO_PICTURES) in again.read_text()
    assert html.escape(NO_PICTURES) not in page
    assert "data:image/png" not in again.read_text()
    words = ["report", files["json"], "--html", str(again), "--junit", str(tmp_path / "again.xml")]
    assert main([*words, "--keep", str(kept), "--vectors", str(folder)]) == 1
    assert again.read_text() == page
    assert (tmp_path / "again.xml").read_text() == Path(files["junit"]).read_text()


@pytest.mark.skipif(os.name != "posix", reason="masks of signals of POSIX")
def test_a_signal_ends_the_run_and_not_the_compiler_of_a_driver(folder, toy_module, tmp_path, capsys):
    """A driver may abort the process whose compiler was ended, and nothing would be written."""
    code = "import signal; print(*map(int, signal.pthread_sigmask(signal.SIG_BLOCK, [])))"
    blocked = []

    def halve(values):
        compiler = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        blocked.extend(map(int, compiler.stdout.split()))
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(60)

    def mask():
        return signal.pthread_sigmask(signal.SIG_BLOCK, [])

    before, file = mask(), tmp_path / "report.json"
    assert run(folder, "--module", toy_module(halve=halve), "--json", str(file)) == 128 + signal.SIGTERM
    ignored = {number for number in TERMINATION if signal.getsignal(number) is signal.SIG_IGN}  # as under nohup
    assert set(TERMINATION) - ignored <= set(blocked)
    assert "ended early, after " in json.loads(file.read_text())["ended"]
    assert mask() == before
    assert capsys.readouterr().out.endswith("ENDED EARLY, before all vectors were judged\n")


def test_kept_files_of_an_earlier_run_are_removed(folder, toy_module, tmp_path):
    kept = tmp_path / "kept"
    assert run(folder, "--module", toy_module(halve=wrong_halves, paint=wrong_frames), "--keep", str(kept)) == 1
    (kept / "core/paint/mine.txt").write_text("not the kit's")
    assert (kept / "core/halve/one_to_six/out/count.npy").is_file()
    assert run(folder, "--module", toy_module(), "--operation", "halve", "--keep", str(kept)) == 0
    assert not (kept / "core/halve/one_to_six").exists()
    assert (kept / "core/paint/odd_size/out/frame.npy").is_file()
    assert run(folder, "--module", toy_module(), "--keep", str(kept)) == 0
    assert sorted(path.name for path in kept.rglob("*") if path.is_file()) == ["mine.txt"]


@pytest.mark.skipif(os.name != "posix", reason="links of POSIX")
def test_nothing_is_kept_or_removed_through_a_link_or_beside_files_of_others(folder, toy_module, tmp_path, capsys):
    victim, kept = tmp_path / "victim", tmp_path / "kept"
    (victim / "out").mkdir(parents=True)
    (victim / "out" / "frame.npy").write_bytes(b"precious")
    home = kept / "core/paint/odd_size"
    home.parent.mkdir(parents=True)
    home.symlink_to(victim)
    name = toy_module(paint=wrong_frames)
    assert run(folder, "--module", name, "--keep", str(kept)) == 2
    assert f"{home} is a link" in capsys.readouterr().err
    home.unlink()
    home.mkdir()
    (home / "notes.txt").touch()
    assert run(folder, "--module", name, "--keep", str(kept)) == 2
    assert f"{home} holds 'notes.txt' but no kept.json" in capsys.readouterr().err
    (tmp_path / "link").symlink_to(kept)
    assert run(folder, "--module", name, "--keep", str(tmp_path / "link")) == 2
    assert [path.name for path in victim.rglob("*") if path.is_file()] == ["frame.npy"]
    assert (victim / "out" / "frame.npy").read_bytes() == b"precious"
    assert [path.name for path in home.iterdir()] == ["notes.txt"]


def test_kept_refusals(folder, toy_module, tmp_path):
    accepting = toy_module(parse=lambda stream: {"count": np.asarray(0), "error": ""})
    assert run(folder, "--module", accepting, "--tier", "faulty", "--keep", str(tmp_path)) == 1
    home = tmp_path / "faulty/parse/bad_letter"
    assert (home / "expected/error.txt").read_text() == "malformed R-3.1-1 8"
    assert (home / "out/error.txt").read_text() == ""
    assert (home / "in/stream.gsvc").read_bytes() == b"xyz"


def test_what_a_module_runs_on_stands_in_every_report(folder, toy_module, tmp_path, capsys):
    name = toy_module(environment=lambda: {"device": "a  GPU\nof two lines", "driver": "1.2"})
    files = [tmp_path / "a.json", tmp_path / "a.xml", tmp_path / "a.html"]
    words = [
        word for option, file in zip(("--json", "--junit", "--html"), files, strict=True) for word in (option, file)
    ]
    assert run(folder, "--module", name, "--environment", "driver=1.3", *map(str, words)) == 0
    assert capsys.readouterr().out.startswith("device  a GPU of two lines\ndriver  1.3\n\n")
    assert json.loads(files[0].read_text())["runs_on"] == {"device": "a GPU of two lines", "driver": "1.3"}
    assert all("a GPU of two lines" in file.read_text() for file in files)


def test_what_a_command_runs_on_is_told_by_an_option(folder, tmp_path, capsys):
    words = ["--impl", good_program(tmp_path), "--operation", "halve", "--tier", "core", "--environment"]
    assert run(folder, *words, "device=NVIDIA=H200") == 0
    assert capsys.readouterr().out.startswith("device  NVIDIA=H200\n\n")
    for word, message in (
        ("device", "'device': ''; neither may be empty"),
        ("=H200", "'': 'H200'; neither may be empty"),
    ):
        assert run(folder, *words, word) == 2
        assert message in capsys.readouterr().err


def no_device():
    raise RuntimeError("there is no GPU")


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (no_device, "toy_implementation.environment() fails: RuntimeError: there is no GPU (test_commands.py, line "),
        (lambda: {"cores": 4}, "environment() must return a dict of texts by name, not {'cores': 4}"),
        (lambda: "a GPU", "environment() must return a dict of texts by name, not 'a GPU'"),
        (lambda: {"driver": " "}, "toy_implementation.environment() has 'driver': ''; neither may be empty"),
    ],
)
def test_an_environment_that_fails_is_told_before_any_work(folder, toy_module, capsys, function, message):
    assert run(folder, "--module", toy_module(environment=function)) == 2
    streams = capsys.readouterr()
    assert message in streams.err
    assert streams.out == ""


def test_a_part_of_a_class_is_no_failure(folder, toy_module, capsys):
    def even_sizes(width, height, bit_depth):
        if width % 2:
            raise NotImplementedError
        return toy_operations.paint(width, height, bit_depth)

    assert run(folder, "--module", toy_module(paint=even_sizes)) == 0
    out = capsys.readouterr().out
    without = "without part of paint (1 vector: core/paint/odd_size)"
    assert f"class rendering     incomplete: 1 vector pass, none is wrong; {without}\n" in out
    assert out.endswith("\nNOTHING IS WRONG, but incomplete: rendering\n")
    assert run(folder, "--module", toy_module(paint=even_sizes), "--operation", "paint") == 0
    assert capsys.readouterr().out.endswith("\nNOTHING IS WRONG; no class is complete\n")
    assert run(folder, "--module", toy_module(paint=even_sizes), "--operation", "paint", "--tier", "core") == 2
    out = capsys.readouterr().out
    assert "1 operation: unsupported (1 vector)\n" in out
    assert out.endswith("\nNOTHING WAS JUDGED: no vector passed, and none is wrong\n")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--show", "-1"], "'-1' is less than 0"),
        (["--operation", "halves"], "there is no operation 'halves'; did you mean halve?"),
        (["--case", "core/scale/by_tow"], "no vector matches --case core/scale/by_tow; did you mean core/scale/by_two"),
        (["--case", "by_two", "--case", "xyzzy"], "no vector matches --case xyzzy; see: "),
        (["--skip", "by_tow"], "no vector matches --skip by_tow; did you mean by_two"),
        (["--operation", "scale", "--case", "one_to_six"], "no vector is selected by operation scale, case one_to_six"),
        (["--tier", "full"], "gsvc-conformance generate --full DIR, then add --vectors DIR"),
        (["--rule", "R-13-33"], "no vector has R-13-33 among its rules; did you mean R-13-3"),
        (["--equation", "77-1"], "no vector has 77-1 among its equations; "),
        (["--flag", "needle"], "no vector has needle among its flags; "),
    ],
)
def test_a_selection_that_is_mistyped(folder, toy_module, capsys, words, message):
    assert run(folder, "--module", toy_module(), *words) == 2
    assert message in capsys.readouterr().err


def test_vectors_of_rules_and_equations(folder, toy_module, capsys):
    assert run(folder, "--module", toy_module(), "--rule", "R-13-3", "--equation", "(9-1)") == 0
    out = capsys.readouterr().out
    assert "class training  passed: 3 vectors pass\nof rule R-13-3, equation 9-1 only\n" in out
    assert main(["list", "--cases", "--vectors", str(folder), "--rule", "R-13-3", "--tier", "stress"]) == 0
    assert capsys.readouterr().out == "stress/scale/nothing: The vector nothing.\n"
    assert main(["list", "--vectors", str(folder), "--rule", "R-13-3"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()[::2]] == ["scale"]
    assert main(["list", "--class", "training"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()[::2]] == ["scale"]
    assert main(["list", "--cases", "--tier", "stress", "--operation", "halve"]) == 2


def test_a_module_without_operations(folder, monkeypatch, capsys):
    module = type(sys)("almost")
    module.scales, module.other = toy_operations.scale, toy_operations.paint
    monkeypatch.setitem(sys.modules, "almost", module)
    assert run(folder, "--module", "almost") == 2
    assert "is it scales for scale?" in capsys.readouterr().err
    assert run(folder, "--module", "almost.py") == 2
    assert "a module is given by its name: almost, not almost.py" in capsys.readouterr().err
    assert run(folder, "--module", "./almost.py") == 2
    assert "a module is given by its name: almost, not ./almost.py" in capsys.readouterr().err


def test_a_program_as_a_module(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("decoder.c").touch()
    assert run(folder, "--module", "decoder.c") == 2
    assert "decoder.c is not a module; a program is judged with --impl" in capsys.readouterr().err


def test_a_missing_package_is_named_before_any_work(folder, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "jsonschema", None)
    assert main(["verify", "--vectors", str(folder)]) == 2
    streams = capsys.readouterr()
    assert streams.err == "gsvc-conformance verify: needs jsonschema: pip install 'gsvc-conformance[verify]'\n"
    assert streams.out == ""


def test_a_package_that_an_adapter_misses_is_named(monkeypatch, folder, tmp_path, capsys):
    (tmp_path / "without_wgpu.py").write_text("import wgpu.utils\n")
    (tmp_path / "without_torch.py").write_text("import torch\n")
    monkeypatch.setitem(sys.modules, "wgpu", None)
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("gsvc_conformance.adapters.__path__", [str(tmp_path)])
    assert run(folder, "--module", "gsvc_conformance.adapters.without_wgpu") == 2
    assert capsys.readouterr().err.endswith("; pip install 'gsvc-conformance[adapters]'\n")
    assert run(folder, "--module", "gsvc_conformance.adapters.without_torch") == 2
    assert capsys.readouterr().err.endswith("; pip install torch\n")
    assert run(folder, "--module", "without_wgpu") == 2
    assert "[adapters]" not in capsys.readouterr().err


def test_the_package_of_the_authors_comes_from_elsewhere(monkeypatch, folder, capsys):
    pytest.importorskip("torch", reason="the adapter of the authors' rasteriser needs PyTorch")
    monkeypatch.setitem(sys.modules, "gsplat", None)
    monkeypatch.delitem(sys.modules, "gsvc_conformance.adapters.gsplat_cuda", raising=False)
    assert run(folder, "--module", "gsvc_conformance.adapters.gsplat_cuda") == 2
    assert capsys.readouterr().err.endswith("; its docstring says where to get it\n")


@pytest.mark.parametrize(
    ("package", "words"),
    [
        *(("numpy", words) for words in (["run", "--reference"], ["list"], ["spec"], ["streams", "nowhere"])),
        *(("numba", words) for words in (["run", "--reference"], ["generate"], ["streams", "nowhere"])),
    ],
)
def test_a_package_that_a_command_misses_is_named(package, words):
    code = (
        f"import sys; sys.modules[{package!r}] = None; import gsvc_conformance.__main__ as k; sys.exit(k.main({words}))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 2
    advice = {"numpy": "pip install gsvc-conformance", "numba": REFERENCE}[package]
    assert done.stderr.endswith(f"conformance {words[0]}: needs {package}: {advice}\n")
    assert done.stdout == ""


def test_what_judges_needs_no_package_of_gsvc_ref():
    words = ["run", "--spec", "--operation", "from_half"]
    code = f"import sys; sys.modules['numba'] = None; import gsvc_conformance.__main__ as k; sys.exit(k.main({words}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert (done.returncode, done.stderr) == (0, "")


def test_what_is_told_of_the_search_for_causes(folder, toy_module, monkeypatch, capsys):
    name = toy_module(scale=lambda values, factor: {"scaled": np.full_like(values, 9)}, halve=wrong_halves)
    toys = [ToyMutant(name, {"scale"}) for name in "abc"]
    monkeypatch.setattr("gsvc_conformance.diagnosis.mutants_for", lambda vector: toys)
    known = {"core/scale/by_two": ["a nine"], "core/scale/by_a_third": []}
    monkeypatch.setattr("gsvc_conformance.diagnosis.diagnose", lambda failures, passed, errors: known)
    assert main(["run", "--module", name, "--vectors", str(folder), "--quiet"]) == 1
    out = capsys.readouterr().out
    assert "Probable cause: a nine (scale: 1 of 2 examined)\n" in out
    assert "note: scale: no mutant gives exactly what 1 of 2 failures gave (3 tried)\n" in out
    assert "note: halve: no mutant gives exactly what 1 of 1 failure gave (3 tried)\n" in out
    assert main(["run", "--module", name, "--vectors", str(folder), *QUIET]) == 1
    assert "no mutant" not in capsys.readouterr().out


def test_arrays_of_another_type_are_not_taken_for_bad_arithmetic(folder, toy_module, capsys):
    name = toy_module(scale=lambda values, factor: {"scaled": values.astype("f8") * factor})
    assert main(["run", "--module", name, "--vectors", str(folder), "--quiet"]) == 1
    out = capsys.readouterr().out
    assert "output scaled has type float64; it must be float32" in out
    assert "Probable cause" not in out
    assert "no mutant" not in out


def test_a_report_of_something_else(tmp_path, capsys):
    for text in ("{}", "not json"):
        (tmp_path / "x.json").write_text(text)
        assert main(["report", str(tmp_path / "x.json")]) == 2
        assert "x.json" in capsys.readouterr().err
    assert main(["report", str(tmp_path / "none.json")]) == 2


def test_kept_files_of_a_module_that_returns_nonsense(folder, toy_module, tmp_path):
    nonsense = toy_module(halve=lambda values: {"half": [object()], "count": None})
    assert run(folder, "--module", nonsense, "--keep", str(tmp_path / "kept"), "--html", str(tmp_path / "p.html")) == 1
    assert (tmp_path / "kept/core/halve/one_to_six/in/values.npy").is_file()


def test_list(toys, folder, capsys):
    assert main(["list", "--operation", "paint"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "paint (rendering): The toy paint.",
        "    (width: int; height: int; bit_depth: int) -> frame: u1|u2 (H, W, 3)",
    ]


def test_list_of_cases_and_json(folder, capsys):
    assert main(["list", "--cases", "--tier", "faulty", "--vectors", str(folder)]) == 0
    assert capsys.readouterr().out == "faulty/parse/bad_letter: The vector bad_letter.\n"
    assert main(["list", "--json", "--vectors", str(folder)]) == 0
    value = json.loads(capsys.readouterr().out)
    assert [case["id"] for case in value["cases"]] == list(INPUTS)
    halve = next(operation for operation in value["operations"] if operation["name"] == "halve")
    assert [(port["name"], port["checks"]) for port in halve["outputs"]] == [
        ("half", ["decision"]),
        ("count", ["exact"]),
    ]


def test_list_of_a_flag_is_that_of_its_cases(capsys):
    assert main(["list", "--flag", "hard", "--operation", "render_sum"]) == 0
    plain = capsys.readouterr().out
    assert main(["list", "--flag", "hard", "--operation", "render_sum", "--cases"]) == 0
    assert capsys.readouterr().out == plain
    assert all("/render_sum/" in line.split(":")[0] for line in plain.splitlines())


def test_list_in_markdown(folder, tmp_path, capsys):
    assert main(["list", "--markdown", "--vectors", str(folder)]) == 0
    table = capsys.readouterr().out
    assert "`frame: u1\\|u2 (H, W, 3)`: interval |" in table
    page = tmp_path / "page.md"
    page.write_text(f"before\n{listing.BEGIN}\nold\n{listing.END}\nafter\n")
    for _ in range(2):
        assert main(["list", "--markdown", str(page), "--vectors", str(folder)]) == 0
        assert page.read_text() == f"before\n{listing.BEGIN}\n\n{table}\n{listing.END}\nafter\n"
    page.write_text("no markers")
    assert main(["list", "--markdown", str(page), "--vectors", str(folder)]) == 2


def test_verify(folder, monkeypatch, capsys):
    found: list[str] = []
    monkeypatch.setattr("gsvc_conformance.coverage.verify", lambda vectors, whole: found)
    assert main(["verify", "--vectors", str(folder)]) == 0
    out = capsys.readouterr().out
    assert out.splitlines()[0].split() == ["operation", "core", "uncommon", "stress", "faulty"]
    assert f"{len(INPUTS)} vectors, " in out
    assert set_hash(folder) in out
    assert out.endswith("nothing is wrong\n")
    found.append("a flag has no vector")
    assert main(["verify", "--vectors", str(folder)]) == 1
    assert "a flag has no vector\n1 problem\n" in capsys.readouterr().out


def test_generate(folder, monkeypatch, capsys):
    monkeypatch.setattr("gsvc_conformance.generate.generate", lambda folder, on_case, jobs: len(INPUTS))
    assert main(["generate", "--vectors", str(folder), "--quiet"]) == 0
    assert f"SHA-256 of SHA256SUMS: {set_hash(folder)}" in capsys.readouterr().out
    for found, status in (([], 0), (["core/x differs", "to write them again: ..."], 1)):
        monkeypatch.setattr("gsvc_conformance.generate.make", lambda on_case, jobs, kills_in: {})
        monkeypatch.setattr("gsvc_conformance.generate.differences", lambda folder, made, found=found: found)
        assert main(["generate", "--check", "--vectors", str(folder), "--quiet"]) == status
        assert all(line in capsys.readouterr().out for line in found[:1])
    assert main(["generate", "--check", "--vectors", str(folder / "none"), "--quiet"]) == 2


class ToyMutant:
    def __init__(self, name, functions) -> None:
        self.name, self.sentence, self._functions = name, f"a mutant called {name}", frozenset(functions)

    def touched(self) -> frozenset[str]:
        return self._functions


def test_mutants(folder, monkeypatch, capsys):
    mutants = (
        ToyMutant("found-early", {"scale"}),
        ToyMutant("found-late", {"halve", "parse"}),
        ToyMutant("alive", {"paint"}),
    )
    killed = {"found-early": "core/scale/by_two", "found-late": "faulty/parse/bad_letter"}
    monkeypatch.setattr("gsvc_conformance.mutants.MUTANTS", mutants)
    monkeypatch.setattr("gsvc_conformance.mutants.called", lambda operation, inputs: frozenset({operation.name}))
    monkeypatch.setattr("gsvc_conformance.mutants.kills", lambda vector, mutant: killed.get(mutant.name) == vector.id)
    words = ["mutants", "--vectors", str(folder), "--quiet"]
    assert main(words) == 1
    assert capsys.readouterr().out.splitlines() == [
        "alive SURVIVES: a mutant called alive",
        "found-early: core/scale/by_two",
        "found-late: faulty/parse/bad_letter",
        "",
        "3 mutants: 1 of 3 mutants survive",
    ]
    assert main([*words, "--mutant", "found-*"]) == 0
    assert "every mutant is found" in capsys.readouterr().out
    assert main([*words, "--mutant", "found-*", "--tier", "core", "--json"]) == 1
    assert json.loads(capsys.readouterr().out) == {"found-early": ["core/scale/by_two"], "found-late": []}
    assert main([*words, "--mutant", "none"]) == 2


def test_mutants_of_a_selection_are_those_that_it_is_to_find(folder, monkeypatch, capsys):
    """All others survived it, and the exit code was 1."""
    mutants = (
        ToyMutant("of-paint", {"paint"}),
        ToyMutant("of-both", {"paint", "halve"}),
        ToyMutant("claimed", {"halve"}),
        ToyMutant("alive", {"halve"}),
    )
    killed = {"of-both": "core/halve/one_to_six"}
    monkeypatch.setattr("gsvc_conformance.mutants.MUTANTS", mutants)
    monkeypatch.setattr("gsvc_conformance.mutants.called", lambda operation, inputs: frozenset({operation.name}))
    monkeypatch.setattr("gsvc_conformance.mutants.kills", lambda vector, mutant: killed.get(mutant.name) == vector.id)
    monkeypatch.setattr(
        VectorFolder, "killed_by", lambda self, names: {"claimed"} if "core/scale/by_two" in names else {}
    )
    words = ["mutants", "--vectors", str(folder), "--quiet", "--operation", "halve"]
    assert main([*words, "--mutant", "*[bd]*"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "of-both: core/halve/one_to_six",
        "",
        "1 mutant: every mutant is found",
        "1 mutant left out: the vectors that are not selected are to find them",
    ]
    assert main([*words]) == 1
    assert "alive SURVIVES" in capsys.readouterr().out
    assert main([*words, "--mutant", "of-paint"]) == 2
    assert "none of 1 mutant is one that the selected vectors are to find" in capsys.readouterr().err


def test_streams_asks_for_sensible_numbers(tmp_path):
    assert main(["streams", str(tmp_path), "--count", "0"]) == 2
    assert main(["streams", str(tmp_path), "--seed", "-1"]) == 2
