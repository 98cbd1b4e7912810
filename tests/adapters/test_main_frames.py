"""Profile `main` on devices: streams that no vector has, against the code of the specification."""

import importlib

import numpy as np
import pytest

from gsvc_base.draws import Draws
from gsvc_conformance import spec
from gsvc_conformance.adapters import main_frames, main_operations
from gsvc_conformance.cases.main_streams import Plan, main_stream
from gsvc_ref.testing.random_main_streams import random_main_stream


@pytest.fixture(params=["webgpu", "opencl", "cuda"])
def adapter(request, monkeypatch):
    """The adapters that decode profile `main` on a device; skipped where there is none."""
    needed = {"webgpu": "wgpu", "opencl": "pyopencl", "cuda": "numpy"}[request.param]
    pytest.importorskip(needed, reason="one of the extra adapters")
    monkeypatch.setenv("GSVC_CUDA", "fibers")
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


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("layer", range(4))
def test_layers_of_random_streams_are_those_of_the_code_of_the_specification(adapter, seed, layer):
    stream = random_main_stream(seed).data
    assert same_outputs(
        adapter.reconstruct_layers(stream, layer), spec.namespace()["reconstruct_layers"](stream, layer)
    )


@pytest.mark.parametrize("lane_exponent", [5, 6, 12])
def test_groups_of_lanes_have_words_of_their_own(adapter, lane_exponent):
    plans = Plan("I", 400, lane_exponent=lane_exponent), Plan("P", 90, lane_exponent=lane_exponent, motion_cell=2)
    stream = main_stream(Draws(6), *plans, width=352, height=288, level=4, max_lane_exponent=12)
    assert same_outputs(adapter.read_main_stream(stream), spec.namespace()["read_main_stream"](stream))


@pytest.mark.parametrize("lane_count", [4, 64])
def test_an_encoded_run_of_more_symbols_than_a_dispatch_takes(adapter, lane_count):
    rng = np.random.default_rng(5)
    count = main_operations.SYMBOLS_AT_ONCE + 1000
    frequencies = rng.integers(1, 2**14, count)
    starts = rng.integers(0, 2**14 - frequencies + 1)
    lanes = rng.integers(0, lane_count, count)
    sizes = rng.integers(0, 29, (2, 30))
    early, late = rng.integers(0, 2**sizes)
    given = starts, frequencies, lanes, lane_count, early, sizes[0], late, sizes[1]
    assert same_outputs(adapter.encode_run(*given), spec.namespace()["encode_run"](*given))


def test_what_breaks_a_run_is_found_behind_the_frame(adapter):
    """R-15.6-2: lanes go on with zeros, and the host sees how many words and raw bits were needed."""
    names = spec.namespace()
    stream = main_stream(Draws(3), Plan("I", 200, lane_exponent=6), width=64, height=64, level=2, max_lane_exponent=6)
    frame = stream.index(b"I", 8)
    length = stream[frame + 1] & 127 | (stream[frame + 2] & 127) << 7
    payload = stream[frame + 3 : frame + 3 + length]
    changed = [payload[:-2], payload + bytes(2), *(_flipped(payload, at) for at in range(20, length, 7))]
    found = set()
    for other in changed:
        head = b"I" + bytes([len(other) & 127 | 128, len(other) >> 7])
        whole = head + other + names["crc32c"](head + other).to_bytes(4, "little")
        faulty = stream[:frame] + whole + stream[frame + 3 + length + 4 :]
        expected = names["reconstruct_stream"](faulty)["error"]
        assert adapter.reconstruct_stream(faulty)["error"] == expected
        found.add(expected)
    assert sum("R-7-1" in error for error in found) >= 3  # at the first word, at a lane, at the end


def _flipped(payload, at):
    return payload[:at] + bytes([payload[at] ^ 1]) + payload[at + 1 :]
