"""No vector asks for more than the preconditions of spec.md section 4.3 allow, and what breaks one is seen."""

from typing import Any, Final

import numpy as np
import pytest

from gsvc_conformance.fitting import fit
from gsvc_conformance.operation import operations
from gsvc_conformance.preconditions import RANGES, ROWS, broken
from gsvc_conformance.vector import VECTORS, read


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", operations())
def test_vectors_keep_the_preconditions(name: str) -> None:
    operation = operations()[name]
    homes = sorted(VECTORS.glob(f"*/{name}/*"))
    assert homes
    for home in homes:
        inputs = read(home).inputs
        assert (home.name, broken(operation, inputs)) == (home.name, [])
        for port, value in fit(operation, inputs).items():
            assert type(value) is type(inputs[port])
            assert np.asarray(value).tobytes() == np.asarray(inputs[port]).tobytes()


def first_inputs(name: str, case: str = "*") -> dict[str, Any]:
    """The inputs of the first vector of an operation, as arrays of their own."""
    inputs = read(sorted(VECTORS.glob(f"core/{name}/{case}"))[0]).inputs
    return {port: np.array(value) if isinstance(value, np.ndarray) else value for port, value in inputs.items()}


BREAKS: Final = {
    "decode_stream": ({"stream": b"GSVC"}, "must be legal"),
    "seek": ({"first": 3, "last": 2}, "0 <= first <= last"),
    "decode_plane": ({"data": np.zeros(0, np.uint8)}, "without a fault"),
    "encode_plane": ({"symbols": np.zeros(0, np.uint16)}, "there must be a symbol"),
    "from_half": ({"bits": np.array([0x7C01], np.uint16)}, "NaN"),
    "to_half": ({"values": np.array([65520], np.float32)}, "finite binary16"),
    "reconstruct_intra": ({"scale": np.full(3, 2.0**-127, np.float32)}, "R-6.5-5"),
    "reconstruct_inter": ({"survivors": np.full(1, 2, np.uint8)}, "survivors must be 0 or 1"),
    "rendering_work": ({"width": 0}, "width must be 1 to 65535"),
    "render_sum": ({"parameters": np.full((1, 8), np.nan, np.float32)}, "parameters must be finite"),
    "render_frame": ({"bit_depth": 7}, "bit_depth must be 8 to 16"),
    "to_frame": ({"sum": np.full((1, 1, 3), np.nan, np.float32)}, "sum must be finite, but for infinities"),
    "loss": ({"picture": np.zeros((0, 4, 3), np.float32)}, "sides of picture"),
    "learning_rates": ({"factor": 1.5}, "factor must be"),
    "adan_step": ({"beta2": 1.0}, "beta2 must be at least 0 and below 1"),
    "pruning_plan": ({"fraction": 1.0}, "fraction must be"),
    "prune": ({"removed": 10**6}, "removed must be 0 to N"),
    "compact": ({"survivors": np.array([1, 1])}, "survivors must grow"),
    "select_key_frames": ({"window": -1}, "window and threshold"),
    "converged": ({"patience": 0}, "patience must be at least 1"),
    "lsq_quantize": ({"scale": np.zeros(3, np.float32)}, "scale must be above 0"),
    "rvq_assign": ({"codebook_sizes": np.array([1])}, "as many rows as codebook_sizes adds up to"),
    "rvq_update": ({"dead_count": 1e9, "uniforms": np.zeros(0)}, "as many as dead codewords"),
    "commitment": ({"codebook_sizes": np.array([1])}, "as many rows as codebook_sizes adds up to"),
    "planes_to_frame": ({"matrix_coefficients": 3}, "section 11.1"),
    "encode_video": ({"splats": 0}, "a splat"),
    "metrics": ({"a": np.full((1, 1, 3), 256, np.uint16), "bit_depth": 8}, "no sample of a may be above"),
}
"""By operation: inputs in place of those of its first vector, and words of the sentence that says what is wrong."""


@pytest.mark.parametrize("name", BREAKS)
def test_what_breaks_a_precondition_is_said(name: str) -> None:
    changes, words = BREAKS[name]
    (sentence,) = broken(operations()[name], {**first_inputs(name), **changes})
    assert words in sentence


def test_other_rules_of_a_row_are_seen_too() -> None:
    none = {"codebook_sizes": np.zeros(0, np.int64), "codewords": np.zeros((0, 3), np.uint16)}
    small = {"cb": np.zeros((1, 1), np.uint8), "cr": np.zeros((1, 1), np.uint8)}
    cases: list[tuple[str, dict[str, Any], str]] = [
        ("encode_plane", {"frequencies": np.ones(4096, np.int64)}, "add up to 2^entropy_precision"),
        ("reconstruct_intra", none, "1 to 8 stages"),
        ("planes_to_frame", {"chroma_format": 0}, "chroma_format must be 1 to 3"),
        ("planes_to_frame", small, "rounded up"),
        ("learning_rates", {"iterations": np.array([-1])}, "iterations must be at least 0"),
        ("adan_step", {"epsilon": 0.0}, "epsilon must be above 0"),
        (
            "lsq_dequantize",
            {"offset": np.full(1, 3e38, np.float32), "scale": np.full(1, 3e38, np.float32)},
            "values must be finite",
        ),
        ("lsq_quantize", {"bits": 17}, "bits must be 1 to 16"),
    ]
    for name, changes, words in cases:
        assert words in broken(operations()[name], {**first_inputs(name), **changes})[0]


def test_the_tables_name_what_exists() -> None:
    names = {port.name for operation in operations().values() for port in operation.inputs}
    assert ROWS.keys() <= operations().keys()
    assert RANGES.keys() <= names
