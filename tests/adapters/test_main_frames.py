"""Profile `main` on devices: streams that no vector has, against the code of the specification."""

import importlib

import numpy as np
import pytest

from gsvc_base.draws import Draws
from gsvc_conformance import spec
from gsvc_conformance.adapters import main_frames, main_operations
from gsvc_conformance.cases.main_streams import Plan, main_stream
from gsvc_ref.testing.random_main_streams import random_main_stream


@pytest.fixture(params=["webgpu", "opencl"])
def adapter(request):
    """The adapters that decode profile `main` on a device; skipped where there is none."""
    pytest.importorskip({"webgpu": "wgpu", "opencl": "pyopencl"}[request.param], reason="one of the extra adapters")
    module = importlib.import_module(f"gsvc_conformance.adapters.{request.param}")
    try:
        module.environment()
    except RuntimeError as error:
        pytest.skip(str(error))
    return module


def same_outputs(found, expected):
    return all(np.array_equal(found[name], expected[name]) for name in expected)


@pytest.mark.parametrize("seed", range(12))
def test_random_streams_of_main_say_what_the_code_of_the_specification_finds(adapter, seed):
    stream = random_main_stream(seed).data
    assert same_outputs(adapter.read_main_stream(stream), spec.namespace()["read_main_stream"](stream))


def test_a_pass_of_main_may_take_several_dispatches(adapter, monkeypatch):
    plans = Plan("I", 300, lane_exponent=2), Plan("P", 40, lane_exponent=1, motion_cell=3), Plan("P", kind="any")
    stream = main_stream(Draws(1), *plans, width=150, height=70)
    whole = adapter.read_main_stream(stream)
    monkeypatch.setattr(main_frames, "ROUNDS_AT_ONCE", 7)
    parts = adapter.read_main_stream(stream)
    assert len(whole["modes"]) > 600
    assert same_outputs(parts, whole)


def test_one_lane_of_main_decodes_more_symbols_than_a_dispatch_takes(adapter):
    count = main_frames.ROUNDS_AT_ONCE + 1000
    stream = main_stream(Draws(2), Plan("I", count), Plan("P", motion_cell=1), width=352, height=288, level=4)
    assert same_outputs(adapter.read_main_stream(stream), spec.namespace()["read_main_stream"](stream))


def test_an_encoded_run_of_more_symbols_than_a_dispatch_takes(adapter):
    rng = np.random.default_rng(5)
    count = main_operations.SYMBOLS_AT_ONCE + 1000
    frequencies = rng.integers(1, 2**14, count)
    starts = rng.integers(0, 2**14 - frequencies + 1)
    lanes = rng.integers(0, 5, count)
    found = adapter.encode_run(starts, frequencies, lanes, 5)
    assert same_outputs(found, spec.namespace()["encode_run"](starts, frequencies, lanes, 5))


def test_a_missing_word_and_one_too_many_are_found_behind_the_frame(adapter):
    """R-7-1: the lanes go on with zeros, and the host sees how many words were needed."""
    stream = main_stream(Draws(3), Plan("I", 200, lane_exponent=3), width=64, height=64, lane_count=8)
    names = spec.namespace()
    frame = stream.index(b"I", 8)
    for change in (-2, 2):
        length = stream[frame + 1] & 127 | (stream[frame + 2] & 127) << 7
        payload = stream[frame + 3 : frame + 3 + length]
        payload = payload[:change] if change < 0 else payload + bytes(change)
        head = b"I" + bytes([len(payload) & 127 | 128, len(payload) >> 7])
        changed = head + payload + names["crc32c"](head + payload).to_bytes(4, "little")
        faulty = stream[:frame] + changed + stream[frame + 3 + length + 4 :]
        expected = names["reconstruct_stream"](faulty)["error"]
        assert "R-7-1" in expected
        assert adapter.reconstruct_stream(faulty)["error"] == expected
