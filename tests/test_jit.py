"""Kernels that other kernels call are compiled as parts of these, and have no form of their own."""

import numba
import numpy as np
import pytest
from numba.core import event

from gsvc_ref._jit import are_plain, kernel, plain_kernels


@kernel(inline=True)
def plus(x, step):
    """Add."""
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


@kernel(inline=True)
def twice(x, step):
    return x + step + step


@kernel()
def several(x):
    return twice(x, 1) + twice(x, 2) + twice(x, x)


@pytest.fixture(autouse=True)
def compiled():
    if numba.config.DISABLE_JIT:
        pytest.skip("nothing is compiled")


def test_a_part_has_no_form_that_python_could_call_until_python_calls_it():
    assert filled(np.zeros(3), 1.5) == 4.5
    assert filled.dispatcher().signatures
    assert not plus.dispatcher().signatures
    assert plus(1, step=2) == 3
    assert len(plus.dispatcher().signatures) == 1


def test_a_kernel_is_described_as_its_function():
    assert (plus.__name__, plus.__doc__, plus.__module__) == ("plus", "Add.", __name__)


def test_kernels_are_plain_python_where_that_is_asked_for():
    with plain_kernels():
        assert are_plain()
        assert filled([1, 2**70], 2**70) == 2**70 + 4
        assert plus(np.int64(2**63 - 1), np.int64(1)) == -(2**63)  # as compiled, without a warning
    assert not are_plain()


def test_arrays_that_a_part_makes_belong_to_its_caller():
    array = allocated(3)
    assert array.tolist() == [2.5] * 3
    del array
    assert allocated(4).tolist() == [2.5] * 4


def test_written_numbers_make_no_forms_of_their_own():
    listener = event.RecordingListener()
    with event.install_listener("numba:compile", listener):
        several.dispatcher().recompile()
        assert several(np.int64(3)) == 21
    compiled = [found.data["dispatcher"].py_func.__name__ for _, found in listener.buffer if found.is_start]
    assert compiled.count("twice") == 1


def test_an_error_of_types_in_a_part_names_it():
    @kernel()
    def wrong(x):
        return plus(x, "text")

    with pytest.raises(numba.TypingError, match="plus"):
        wrong(1)


def test_a_kernel_in_a_function_works_and_is_not_kept():
    @kernel()
    def part(x):
        return 2 * x

    @kernel()
    def whole(x):
        return part(part(x))

    assert whole(3) == 12
    assert not whole.dispatcher().stats.cache_hits


def test_kernels_are_parts_of_functions_that_others_compile():
    plus.dispatcher()
    assert numba.njit(lambda x: plus(x, 1.0) + 1)(2) == 4
