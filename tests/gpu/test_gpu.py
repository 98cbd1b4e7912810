"""`make gpu` without a GPU: what it compares, what becomes of parts that go wrong, and the files that it leaves."""

import json
import os
import shutil
import subprocess
import sys
import tarfile
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gsvc_base.pages.markers import replaced
from gsvc_conformance.adapters.cuda.device import Launch
from gsvc_conformance.adapters.cuda.sources import KERNELS
from tests.gpu import golden, page, results, sanitized, sums, survey
from tests.gpu.__main__ import main
from tests.gpu.advice import advice
from tests.gpu.golden import BLOCK, digest, made
from tests.gpu.outcome import Outcome, Record
from tests.gpu.parts import Part, sums_told
from tests.gpu.running import results_of
from tests.gpu.speeds import KINDS, measured, timeline, wall
from tests.gpu.splats import SMALL, drawn

ROOT = Path(__file__).parents[2]

RENDERER = """
import numpy as np
import gsvc_ref

def render_sum_deterministic(parameters, width, height):
    total = gsvc_ref.render_sum_deterministic(parameters, width, height)
    if (width, height) in {wrong}:
        total.view("u1")[-1, -1, -2:] ^= 1
    return {{"sum": total}}

def decode_stream_deterministic(stream):
    return {{"frames": np.frombuffer(stream[:12], np.uint8) + (1 if {wrong} else 0)}}
"""


def test_draws_are_the_same_everywhere():
    splats, *size = drawn(7)
    assert (splats.shape, splats.dtype, size) == ((117, 8), np.float32, [102, 63])
    assert digest(splats) == "98f79ded4f72911ea301c66a5eecbde7cd458315aaa27bf448e61270d103668d"


def test_draws_are_of_many_sizes_and_scales():
    draws = [drawn(number) for number in range(300)]
    counts, sides = [len(splats) for splats, _, _ in draws], np.ravel([size for _, *size in draws])
    assert (min(counts), max(counts) > 1024, max(counts) <= 2048) == (1, True, True)
    assert (sides.min(), sides.max()) == (1, 129)
    factors = np.abs(np.concatenate([splats[:, 2:5].ravel() for splats, _, _ in draws]))
    assert factors.min() < 2.0**-35
    assert factors.max() > 2.0**35
    assert all(np.isfinite(splats).all() for splats, _, _ in draws)


@pytest.mark.parametrize("wrong", [[], [drawn(41)[1:], (SMALL[0].width, SMALL[0].height)]], ids=["none", "some"])
def test_every_byte_that_differs_is_counted(wrong, tmp_path, monkeypatch):
    (tmp_path / "a_renderer.py").write_text(RENDERER.format(wrong=wrong))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    sums.renderer.cache_clear()
    monkeypatch.delitem(sys.modules, "a_renderer", raising=False)
    for module in (golden, sums):  # decoding compiles for long
        monkeypatch.setattr(module, "decode_stream_deterministic", lambda data: np.frombuffer(data[:12], np.uint8))
    digests = made(tmp_path / "golden.json", SMALL, [sums.VECTOR], BLOCK)
    record = Record(tmp_path / "found.json")
    sums.compared("a_renderer", SMALL, [sums.VECTOR], BLOCK, digests, 1, record)
    kept = json.loads(record.path.read_text())
    assert kept["differing"] == ({SMALL[0].name: 2, "stream": 12, "draw 41": 2} if wrong else {})
    assert (kept["wrong"], kept["whole"], kept["draws"]) == (bool(wrong), True, BLOCK)
    assert sums_told(record.path, kept)[0] == ("wrong" if wrong else "right")


def test_another_digest_is_wrong_even_where_this_processor_agrees(monkeypatch):
    monkeypatch.setattr(sums, "renderer", lambda module: sums.render_sum_deterministic)
    assert sums.wrong_in_block("gsvc_ref", 0, "another digest") == {"draws from 0": 0}


def part(name, code, limit=30.0, alone=False):
    def told(path, values):
        return ("right" if values.get("whole") else "stopped"), f"found {values['found']}"

    return Part(name, name, ("-c", code), limit, told, alone=alone)


KEEP = "import json, sys; open(sys.argv[1], 'w').write(json.dumps({values})); "


def test_whatever_becomes_of_a_part_the_others_go_on(tmp_path):
    good = KEEP.format(values='{"found": 3, "whole": True}')
    some = KEEP.format(values='{"found": 2}')
    deaf = "import signal, subprocess, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); "
    parts = [
        part("good", good),
        part("hangs", some + deaf + "subprocess.Popen(['sleep', '97.25']); time.sleep(97.25)", limit=3),
        part("memory", "raise MemoryError('CUDA_ERROR_OUT_OF_MEMORY: out of memory')"),
        part("watchdog", some + "raise RuntimeError('CUDA_ERROR_LAUNCH_TIMEOUT: the launch timed out')"),
        part("killed", "import os; os.kill(os.getpid(), 9)"),
        part("crashes", "import os; print('kernel 7'); os.kill(os.getpid(), 11)"),
        part("alone", good, alone=True),
        Part("absent", "absent", (), 1, lambda path, values: ("right", ""), missing="there is none"),
    ]
    found = {one.name: one for one in results_of(parts, tmp_path, 60, 6)}
    assert {name: one.state for name, one in found.items()} == {
        "good": "right", "hangs": "stopped", "memory": "failed", "watchdog": "failed", "killed": "failed",
        "crashes": "failed", "alone": "right", "absent": "skipped",
    }  # fmt: skip
    assert found["hangs"].told == "stopped after 8 s; until then: found 2"
    assert found["memory"].told.startswith("the GPU has no memory left: end what else runs there")
    assert found["watchdog"].told.startswith("the watchdog of the display ended a kernel")
    assert found["watchdog"].told.endswith("; until then: found 2")
    assert found["killed"].told.startswith("the system killed it")
    assert found["crashes"].told == "it ended by SIGSEGV, after: kernel 7"
    assert found["absent"].told == "there is none"
    assert "sleep 97.25" not in subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True).stdout


def test_there_is_time_for_what_has_to_be_alone(tmp_path):
    parts = [
        part("together", KEEP.format(values='{"found": 1}') + "import time; time.sleep(60)"),
        part("alone", KEEP.format(values='{"found": 1, "whole": True}'), limit=4, alone=True),
    ]
    found = {one.name: one for one in results_of(parts, tmp_path, 6, 2)}
    assert (found["together"].state, found["alone"].state) == ("stopped", "right")
    assert found["together"].seconds < 5


def test_as_many_run_at_the_same_time_as_there_is_room_for(tmp_path):
    code = KEEP.format(values='{"found": 1, "whole": True}') + "import time; time.sleep(1.2)"
    found = list(results_of([part(f"p{k}", code) for k in range(4)], tmp_path, 3.5, 2))
    assert [one.state for one in found] == ["right", "right", "right", "right"]
    found = list(results_of([part(f"p{k}", code) for k in range(4)], tmp_path, 1, 2))
    assert [one.told for one in found] == ["there was no time left"] * 2 + [
        "stopped after 1 s; until then: found 1"
    ] * 2
    card = {"memory": "24576 MiB"}
    assert survey.Survey("a card", "", card, {}).width == min(6, os.cpu_count())


@pytest.mark.parametrize(
    ("log", "code", "sentence"),
    [
        ("ModuleNotFoundError: No module named 'gsplat'", 1, "gsplat is not installed: pip install it"),
        ("cudaErrorInsufficientDriver: CUDA driver version is insufficient for CUDA runtime version", 1, "too old"),
        ("cudaErrorNoDevice: no CUDA-capable device is detected", 1, "CUDA finds no GPU"),
        ("cudaErrorIllegalAddress: an illegal memory access was encountered", 1, "a kernel left its memory"),
        ("", 3, "it ended with code 3 and said nothing"),
        ("Traceback\nValueError: x is 3", 1, "ValueError: x is 3"),
    ],
)
def test_a_failure_is_a_sentence_that_says_what_to_do(log, code, sentence):
    assert sentence in advice(log, code, "it")


def test_without_a_gpu_the_command_says_so(tmp_path, monkeypatch, capsys):
    nothing = survey.Survey("", "", {}, {}, {}, {"cuda": "CUDA finds no GPU: see whether `nvidia-smi` lists one"})
    monkeypatch.setattr("tests.gpu.__main__.surveyed", lambda *_, **__: nothing)
    assert main(["--work", str(tmp_path)]) == 2
    printed = capsys.readouterr()
    assert "cuda is left out: CUDA finds no GPU" in printed.out
    assert "No adapter finds a GPU here." in printed.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("answer", "is_processor"),
    [
        ({"device": "NVIDIA H200", "back end": "Vulkan (DiscreteGPU)"}, False),
        ({"device": "NVIDIA H200", "driver": "580.159.04", "opencl_c": "OpenCL C 1.2"}, False),
        ({"device": "pthread-skylake-avx512-AMD EPYC", "opencl_c": "OpenCL C 1.2 PoCL"}, True),
        ({"device": "llvmpipe (LLVM 15.0.6, 256 bits)", "back end": "Vulkan (CPU)"}, True),
        ({"device": "cpu (x86_64)", "CUDA": "not used"}, True),
        ({"device": "CPU: every thread a fiber (GSVC_CUDA=fibers)"}, True),
    ],
)
def test_an_adapter_that_would_run_on_a_processor_is_left_out(answer, is_processor):
    assert any(survey.PROCESSORS.search(text) for text in answer.values()) == is_processor


def test_nvidias_driver_is_registered_for_opencl_in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.delenv("OCL_ICD_VENDORS", raising=False)
    monkeypatch.setattr(survey, "DRIVERS", (str(tmp_path),))
    assert "OCL_ICD_VENDORS" not in survey.loaders(tmp_path / "loaders")
    (tmp_path / survey.OPENCL).touch()
    assert survey.loaders(tmp_path / "loaders")["OCL_ICD_VENDORS"] == str(tmp_path / "loaders")
    assert (tmp_path / "loaders" / "nvidia.icd").read_text() == f"{tmp_path / survey.OPENCL}\n"


@pytest.mark.parametrize(
    ("line", "count"),
    [
        ("========= RACECHECK SUMMARY: 9 hazards displayed (9 errors, 0 warnings)", "9"),
        ("========= ERROR SUMMARY: 0 errors", "0"),
        ("========= ERROR SUMMARY: 1 error", "1"),
    ],
)
def test_reports_of_the_sanitizer_are_counted(line, count):
    assert sanitized.SUMMARY.findall(f"before\n{line}\n") == [count]


@pytest.mark.skipif(not shutil.which("g++"), reason="a C++ compiler shows what is compiled")
def test_a_planted_race_takes_a_barrier_away():
    words = ["g++", "-x", "c++", "-std=c++17", "-E", "-P", "-I", KERNELS, "-"]
    code = "from gsvc_conformance.adapters.cuda.sources import PLANTED; print(*PLANTED)"
    environment = {**os.environ, "GSVC_CUDA_PLANTED_RACE": "1"}
    option = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    ).stdout

    def barriers(*options):
        return subprocess.run(
            [*words, *options], input='#include "rendering.cu"', capture_output=True, text=True, check=True
        ).stdout.count("__syncthreads();")

    assert barriers(*option.split()) == barriers() - 1 > 0


@pytest.mark.parametrize("case", sanitized.CASES)
def test_vectors_for_the_sanitizer_are_there(case):
    assert (ROOT / "vectors" / case).is_dir()


def test_a_time_is_that_of_one_call():
    calls = []
    spread = measured(lambda: calls.append(1), wall(lambda: None))
    assert 0 < spread["low"] <= spread["median"] <= spread["high"] < 1e-3
    assert len(calls) == 4 + spread["calls"]


def test_a_time_line_has_every_kernel_in_order(monkeypatch):
    class Event:
        def record(self):
            self.time = time.perf_counter()

    cuda = SimpleNamespace(
        Event=Event,
        get_current_stream=lambda: SimpleNamespace(synchronize=lambda: None),
        get_elapsed_time=lambda first, last: 1000 * (last.time - first.time),
    )
    monkeypatch.setitem(sys.modules, "cupy", SimpleNamespace(cuda=cuda))
    started = []

    class Kernel(Launch):
        def __init__(self, name):
            self.kernel, self.blocks, self.threads, self._where = name, (1, 1, 1), (1, 1, 1), 0
            self._function = lambda *_: started.append(name)

    def work():
        Kernel("first")()
        Kernel("second")()

    spans = timeline(work)
    assert started == ["first", "second"] * 2
    assert [name for name, _, _ in spans] == ["first", "second"]
    times = [time for _, *both in spans for time in both]
    assert times == sorted(times)
    work()
    assert len(started) == 6


SPEEDS = {
    "works": {"picture_a": "picture, f4 sums, bounded, a scene", "adan_step": "adan_step", "frame_a": "unmeasured"},
    "rates": ["picture_a", "frame_a"],
    "implementations": [
        {"implementation": "x.cuda", "settings": {}, "environment": {}, "seconds": {"picture_a": {"median": 0.0005}}}
    ],
}


def test_speeds_of_an_implementation_are_put_together():
    other = {"implementation": "x.cuda", "settings": {}, "environment": {}, "seconds": {"adan_step": {"median": 0.25}}}
    both = results.merged([SPEEDS, {"works": {}, "implementations": [other]}])
    assert list(both["works"]) == ["picture_a", "adan_step"]
    assert both["rates"] == ["picture_a"]
    assert both["implementations"][0]["seconds"] == {"picture_a": {"median": 0.0005}, "adan_step": {"median": 0.25}}
    file = {"date": "2026-11-28", "machine": {"card": "A card", "driver": "580"}, **both}
    text = "\n".join(page.speed_parts(file))
    assert "### A card, 2026-11-28\ndriver 580." in text
    assert "| picture, f4 sums, bounded, frames/s | cuda | 2,000 |" in text
    assert "| adan_step | 250 |" in text
    decoded = {**other, "seconds": {"decode": {"median": 0.0004}}}
    file |= {"works": {"decode": "a frame"}, "rates": ["decode"], "implementations": [decoded]}
    assert "| a frame | 2,500 /s |" in "\n".join(page.speed_parts(file))


def test_files_of_a_run_have_what_was_found_so_far(tmp_path):
    here = survey.Survey(
        "A card 2", "580", {"date": "2026-11-28", "driver": "580"}, {}, {"cuda": {"device": "A card 2"}}
    )
    for suffix in (".json", ".html"):
        (tmp_path / f"cuda{suffix}").write_text("a report")
    kept = results.Results(here, tmp_path, tmp_path / "reports")
    kept.add(Outcome("cuda", "kit", "right", "0 wrong", 3.14159))
    kept.add(Outcome("repeat-cuda", "kit three times", "stopped", "stopped after 9 s"))
    kept.add(Outcome("speeds-cuda", "speeds", "measured", "", values={**SPEEDS, "timeline": {"a": [["k", 0.0, 0.5]]}}))
    assert sorted(path.name for path in (tmp_path / "reports").iterdir()) == [
        "cuda.html", "cuda.json", "gpu", "speeds-a-card-2.json",
    ]  # fmt: skip
    card = json.loads((tmp_path / "reports" / "gpu" / "a-card-2.json").read_text())
    assert [one["state"] for one in card["parts"]] == ["right", "stopped", "measured"]
    assert card["timeline"] == {"a": [["k", 0.0, 0.5]]}
    assert results.summary(kept.outcomes)[0].startswith("stopped   kit three times")


def test_the_page_is_that_of_the_reports(tmp_path, monkeypatch):
    document, drawing = tmp_path / "gpu.md", tmp_path / "gpu-frame.svg"
    document.write_text(replaced(page.DOCUMENT.read_text(), page.BEGIN, page.END, "nothing"))
    monkeypatch.setattr(page, "DOCUMENT", document)
    monkeypatch.setattr(page, "TIMELINE", drawing)
    page.write_page(ROOT / "docs" / "reports")
    made_again = "python -m tests.gpu.page"
    assert document.read_text() == (ROOT / "docs" / "gpu.md").read_text(), made_again
    assert drawing.read_text() == (ROOT / "docs" / "gpu-frame.svg").read_text(), made_again


@pytest.mark.skipif(not shutil.which("g++"), reason="a C++ compiler makes fibers of the CUDA kernels")
def test_a_processor_plays_the_gpu(tmp_path, capsys):
    assert main(["--cpu", "--work", str(tmp_path), "--only", "cuda", "--only", "speeds-cuda"]) == 0
    printed = capsys.readouterr().out
    assert "cuda runs on CPU: every thread a fiber" in printed
    assert "kit, cuda: right, 0 wrong, " in printed
    (speeds,) = (tmp_path / "reports").glob("speeds-*.json")
    (measured,) = json.loads(speeds.read_text())["implementations"]
    assert [*measured["seconds"]] == [f"{kind}_{SMALL[0].id}" for kind in KINDS]
    assert json.loads((tmp_path / "reports" / "cuda.json").read_text())["results"]


@pytest.mark.exhaustive
def test_a_bundle_runs_where_it_is_unpacked(tmp_path):
    archive = tmp_path / "bundle.tar.xz"
    subprocess.run([ROOT / "tests/gpu/bundle.sh", archive], env={**os.environ, "BARE": "1"}, check=True)
    with tarfile.open(archive) as packed:
        packed.extractall(tmp_path, filter="data")
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment["PYTHON"] = sys.executable
    tree, words = (
        tmp_path / "gsvc-gpu",
        ["--cpu", "--work", tmp_path / "work", "--only", "cuda", "--only", "speeds-cuda"],
    )
    run = subprocess.run(
        [tree / "tests/gpu/run.sh", *words], env=environment, capture_output=True, text=True, check=False, timeout=300
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert f"commit: {survey.commit()}" in run.stdout
    assert (tmp_path / "work" / "reports" / "gpu").is_dir()
    modules = [path.stem for path in (tree / "tests/gpu").glob("*.py") if not path.stem.startswith(("test_", "__"))]
    imports = f"from tests.gpu import {', '.join(modules)}; import importlib.metadata as m"
    code = f"{imports}; print([one.value for one in m.entry_points(group='gsvc_ref.devices')])"
    words = [sys.executable, "-c", code]
    run = subprocess.run(
        words, cwd=tree, env={**environment, "PYTHONPATH": "conformance"}, capture_output=True, text=True
    )
    assert "gsvc_conformance.adapters.cuda.fitting:Evaluator" in run.stdout, run.stderr
