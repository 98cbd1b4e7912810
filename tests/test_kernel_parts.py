"""Kernels that other kernels call are compiled as parts of these, and Numba is left as it was."""

import numba
import numpy as np
import pytest
from numba.core.types import functions

from gsvc_ref._jit import kernel


@kernel(inline=True)
def plus(x, step):
    return x + step


@kernel()
def filled(array, value):
    for i in range(len(array)):
        array[i] = plus(plus(array[i], value), 1)
    return plus(array[0], 2)


@kernel()
def allocated(n):
    array = np.zeros(n)
    filled(array, 1.5)
    return array


@pytest.fixture(autouse=True)
def compiled():
    if not hasattr(plus, "py_func"):
        pytest.skip("nothing is compiled")


def test_a_part_has_no_form_that_python_could_call_until_python_calls_it():
    assert filled(np.zeros(3), 1.5) == 4.5
    assert filled.signatures
    assert not plus.signatures
    assert plus(1, 2) == 3
    assert len(plus.signatures) == 1


def test_arrays_that_a_part_makes_belong_to_its_caller():
    array = allocated(3)
    assert array.tolist() == [2.5] * 3
    del array
    assert allocated(4).tolist() == [2.5] * 4


def test_written_numbers_make_no_forms_of_their_own():
    @kernel()
    def several(x):
        return plus(x, 1) + plus(x, 2) + plus(x, x)

    before = len(part_of(plus)._forms)
    assert several(np.int64(3)) == 15
    assert len(part_of(plus)._forms) <= before + 1


def test_an_error_of_types_in_a_part_names_it():
    @kernel()
    def wrong(x):
        return plus(x, "text")

    with pytest.raises(numba.TypingError, match="plus"):
        wrong(1)


def test_numba_looks_up_types_as_before_when_nothing_of_ours_is_compiled():
    before = functions.BaseFunction.get_call_type

    @kernel()
    def fails(x):
        return x.no_such_attribute

    with pytest.raises(numba.TypingError):
        fails(1)
    assert functions.BaseFunction.get_call_type is before
    assert numba.njit(lambda x: plus(x, 1.0) + 1)(2) == 4


def part_of(dispatcher):
    return dispatcher.get_call_template.__self__


def test_with_an_unknown_numba_kernels_have_no_parts(monkeypatch):
    monkeypatch.setattr("gsvc_ref._jit.PARTS", False)
    monkeypatch.setattr("gsvc_ref._kernel_cache.PARTS", False)

    @kernel()
    def twice(x):
        return 2 * x

    @kernel()
    def fourfold(x):
        return twice(twice(x))

    assert fourfold(3) == 12
    assert twice.signatures  # Numba made a form of its own, as ever
