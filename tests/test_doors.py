"""Arguments of a wrong type are refused by name at every public function, not by an error from inside."""

import numpy as np
import pytest

import gsvc_ref
from gsvc_base.checks import door
from gsvc_conformance.pairs import PAIRS, Twin
from gsvc_conformance.vector import VECTORS, read

WRONG = (None, "text", object(), {}, np.array(["a"]), np.array([None, None]))
SPLATS = np.array([[5, 5, 2, 0, 2, 0.5, 0.5, 0.5]])


def vector_of(name):
    homes = (VECTORS / tier / name for tier in ("core", "uncommon"))
    return read(next(home for tier in homes if tier.exists() for home in sorted(tier.iterdir())))


@pytest.mark.parametrize("name", [name for name, pair in PAIRS.items() if isinstance(pair, Twin)])
def test_operations_refuse_arguments_of_a_wrong_type(name):
    """NumPy reads None as NaN and anything as a truth value, so that some are taken; none fails from inside."""
    function, inputs = getattr(gsvc_ref, name), vector_of(name).inputs
    refused = 0
    for argument in inputs:
        for wrong in WRONG:
            try:
                with np.errstate(all="ignore"):
                    function(**{**inputs, argument: wrong})
            except (gsvc_ref.UsageError, gsvc_ref.GsvcError, FileNotFoundError):
                refused += 1
    assert refused >= len(inputs)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: gsvc_ref.render(None, 8, 8),
            r"the splats cannot be of type NoneType; give Splats or an array \(N, 8\)",
        ),
        (lambda: gsvc_ref.render([[1, 2], [3]], 8, 8), "cannot be of type list"),
        (lambda: gsvc_ref.render(SPLATS + 1j, 8, 8), "cannot be of type ndarray of complex128"),
        (lambda: gsvc_ref.render(SPLATS[:, :7], 8, 8), r"shape \(1, 7\); it must be \(N, 8\)"),
        (lambda: gsvc_ref.render(SPLATS, 8.5, 8), "width is 8.5; it must be a whole number"),
        (lambda: gsvc_ref.render(SPLATS, 8, "8"), "height is '8'; it must be a whole number"),
        (lambda: gsvc_ref.render_exact_with_bound("a", 8, 8), "the splats cannot be of type str"),
        (lambda: gsvc_ref.Splats("a", "b", "c"), r"Splats.positions cannot be of type str; give an array \(N, 2\)"),
        (lambda: gsvc_ref.open(5), "a int is no source"),
        (lambda: next(gsvc_ref.decode(None)), "a NoneType is no source"),
        (lambda: gsvc_ref.concat(None, "x"), "give a list of one stream or more"),
        (lambda: gsvc_ref.lsq_quantize(SPLATS, SPLATS[0], SPLATS[0], "6"), "bits is '6'; it must be a whole number"),
    ],
)
def test_the_sentence_names_the_argument(call, message):
    with pytest.raises(gsvc_ref.UsageError, match=message):
        call()


def test_render_takes_an_array():
    splats = gsvc_ref.Splats.from_array(SPLATS)
    assert np.array_equal(gsvc_ref.render(SPLATS, 8, 8), gsvc_ref.render(splats, 8, 8))
    assert np.array_equal(*(gsvc_ref.render_exact_with_bound(s, 8, 8)[1] for s in (SPLATS, splats)))


def test_a_fault_of_the_function_itself_passes_a_door():
    @door
    def faulty(x: int) -> int:
        return x + None  # type: ignore[operator]

    with pytest.raises(TypeError, match="unsupported operand"):
        faulty(1)
    with pytest.raises(gsvc_ref.UsageError, match="x is 'a'; it must be a whole number"):
        faulty("a")
    with pytest.raises(TypeError, match="missing"):
        faulty()
