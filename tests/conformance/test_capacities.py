"""Vectors are large enough: an implementation that ends at any capacity in any dimension fails one of its operation."""

import pytest

from gsvc_conformance.__main__ import main
from gsvc_conformance.capacities import CAPACITIES, LIMITS, dimensions, profiles, rows, symbols
from gsvc_conformance.operation import Port, operations
from gsvc_conformance.profiles import PROFILES
from gsvc_conformance.vector import VECTORS, read


def vectors_of(name):
    """All vectors of an operation."""
    return [read(path.parent) for path in sorted(VECTORS.glob(f"*/{name}/*/manifest.json"))]


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", operations())
def test_every_capacity_is_caught(name):
    missed = {row.dimension: row.missed for row in rows(operations()[name], vectors_of(name)) if row.missed}
    assert missed == {}


def test_the_command_prints_the_table(capsys):
    assert main(["capacities", "--operation", "to_half"]) == 0
    out = capsys.readouterr().out
    assert "| `to_half` |  | N | 70,001 | 32 to 65,536 | all |" in out
    assert out.endswith("every capacity is caught\n")


def test_the_command_says_what_is_missed(capsys):
    assert main(["capacities", "--case", "core/to_half/largest_half"]) == 1
    assert "| not 32, 64," in capsys.readouterr().out


def test_limits_are_those_of_dimensions_that_exist_and_have_a_reason():
    there = {(name, dimension) for name, operation in operations().items() for dimension in dimensions(operation)}
    for (name, dimension), (most, reason) in LIMITS.items():
        assert (name, dimension) in there or (name == "*" and dimension in {other for _, other in there})
        assert reason
        assert most == 0 or most in CAPACITIES


def test_streams_are_held_against_each_profile_alone():
    of_streams = {name: profiles(operation) for name, operation in operations().items() if profiles(operation) != ("",)}
    both = ("reconstruct_stream", "seek", "decode_stream", "decode_stream_deterministic")
    main = ("read_main_stream", "reconstruct_layers", "decode_layers")
    assert of_streams == {"read_stream": ("paper",), **dict.fromkeys(both, PROFILES), **dict.fromkeys(main, ("main",))}


@pytest.mark.exhaustive
def test_without_its_large_streams_a_profile_is_found_wanting():
    vectors = [v for v in vectors_of("decode_stream") if v.manifest["profile"] == "paper" or v.tier == "core"]
    missed = {(row.profile, row.dimension): len(row.missed) for row in rows(operations()["decode_stream"], vectors)}
    assert missed.pop(("main", "W")) > 0
    assert missed.pop(("main", "H")) > 0
    assert not any(missed.values())


def test_symbols_of_shapes():
    shapes = {"(N, 8)": ["N", ""], "(n or 0, M)": ["n", "M"], "(T-1,)": ["T"], "()": [], "": [], "(22,)": [""]}
    for shape, expected in shapes.items():
        assert symbols(Port("port", "f4", shape)) == expected


def test_without_its_large_vectors_an_operation_is_found_wanting():
    small = [vector for vector in vectors_of("weighted_gradients") if "capacity" not in vector.manifest["flags"]]
    (row,) = rows(operations()["weighted_gradients"], small)
    assert row.missed == CAPACITIES
