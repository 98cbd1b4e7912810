"""The benchmark of the adapters: what it calls, what it leaves out, and the form of its file."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))
adapters = pytest.importorskip("gsvc_lab.benchmarks.adapters", reason="gsvc_lab.benchmarks is only in a checkout")

MODULE = '''
"""An implementation of little."""

import os


def environment():
    return {"device": os.environ.get("DEVICE_OF_THE_TEST", "none")}


def adan_step(**state):
    return state


def decode_stream(stream):
    raise NotImplementedError("there is no room for streams")
'''


@pytest.fixture
def module(tmp_path, monkeypatch):
    (tmp_path / "an_implementation.py").write_text(MODULE)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.chdir(ROOT)
    return "an_implementation"


def test_the_first_calls_do_not_count_and_none_sees_what_another_did_to_its_inputs():
    seen = []

    def stage(numbers):
        seen.append(numbers.tolist())
        numbers += 1

    times = adapters.seconds_of(stage, {"numbers": np.zeros(2)}, seconds=0)
    assert len(times) == adapters.FEWEST
    assert seen == [[0, 0]] * (adapters.WARM_UP + adapters.FEWEST)


def test_it_goes_on_for_some_time_but_not_for_ever():
    assert len(adapters.seconds_of(lambda: None, {}, seconds=60)) == adapters.MOST


def test_every_work_is_measured_or_missing_with_its_reason():
    def fails(number):
        raise ValueError("too small")

    def is_not_there(number):
        raise NotImplementedError

    functions = {"good": lambda number: number, "fails": fails, "is_not_there": is_not_there}
    works = {name: adapters.Work("", name, lambda: {"number": 1}) for name in (*functions, "other")}
    result = adapters.Measured("mine", {}, {})
    adapters.measure(functions, works, 0, result)
    assert list(result.seconds) == ["good"]
    assert 0 <= result.seconds["good"]["low"] <= result.seconds["good"]["median"] <= result.seconds["good"]["high"]
    assert result.missing == {
        "fails": "ValueError: too small",
        "is_not_there": "is_not_there raises NotImplementedError",
        "other": "there is no function other",
    }


@pytest.mark.exhaustive
def test_the_file_and_the_table_have_what_could_be_measured(module, tmp_path, capsys):
    numbers = tmp_path / "speeds" / "numbers.json"
    works = ["--work", "adan_step", "--work", "decode_stream_small"]
    adapters.main([module, "gsvc_ref", "nothing_of_the_kind", *works, "--seconds", "0", "--json", str(numbers)])
    kept = json.loads(numbers.read_text())
    assert kept["form"] == "speeds/1"
    assert list(kept["works"]) == ["adan_step", "decode_stream_small"]
    ours, mine = kept["implementations"]
    assert set(ours["seconds"]) == set(kept["works"])
    assert (mine["implementation"], list(mine["seconds"])) == (module, ["adan_step"])
    assert mine["missing"] == {"decode_stream_small": "there is no room for streams"}
    printed = capsys.readouterr()
    assert "| work " in printed.out
    assert "nothing_of_the_kind is left out: ModuleNotFoundError: No module named" in printed.err


def test_settings_reach_the_implementation(module):
    settings = {"DEVICE_OF_THE_TEST": "a lamp"}
    result = adapters.measure_apart(module, settings, ["adan_step"], 0)
    assert (result.settings, result.environment) == (settings, {"device": "a lamp"})
    assert result.name == "an_implementation (a lamp)"


def test_an_unmeasured_cell_is_empty():
    result = adapters.Measured("a.b", {}, {}, {"x": {"low": 0.1, "median": 0.2, "high": 0.3, "calls": 5}})
    works = {name: adapters.Work(name, name, dict) for name in ("x", "y")}
    machine = {"cpu": "c", "cores": 2, "system": "s", "python": "3"}
    assert adapters.table(machine, works, [result]).rows == [["x", "200 (100–300)"], ["y", "–"]]
