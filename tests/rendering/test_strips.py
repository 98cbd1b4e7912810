"""The parts of the fast renderer: the exponential, the lists of entries, and the machine code of the inner loops."""

import re

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from llvmlite import binding
from render_cases import EXAMPLES, HEIGHT, JIT, NAMED, WIDTH, extreme, ordinary, population, splat_sets

from gsvc_ref.constants import SUPPORT_SQUARED
from gsvc_ref.rendering.bounds import EPS
from gsvc_ref.rendering.definition import footprint
from gsvc_ref.rendering.fast.exponential import exp_minus_half
from gsvc_ref.rendering.fast.lists import row_range, select_strip
from gsvc_ref.rendering.fast.strip_sums import add_tile, grad_add_strip
from gsvc_ref.rendering.fast.strips import BLACK, STRIP_WIDTH, strip_count
from gsvc_ref.rendering.fast.tasks import objective_task, room_for_selection, run_of_strips
from gsvc_ref.rendering.fast.workspace import Workspace

pytestmark = [] if JIT else [pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning")]


def loaded(splats, width=WIDTH, height=HEIGHT, threads=1):
    work = Workspace(width, height, threads)
    work.load(splats.to_array())
    return work


def test_the_exponential_is_within_its_error():
    s = np.concatenate([np.linspace(0, SUPPORT_SQUARED, 20001), np.geomspace(2.0**-40, 1, 3001)]).astype(np.float32)
    g = np.array([exp_minus_half(value) for value in s], np.float64)
    exact = np.exp(-s.astype(np.float64) / 2)
    assert np.all(abs(g / exact - 1) <= EPS * (4.5 + 2.2 * s))
    assert exp_minus_half(np.float32(0)) == 1


@settings(max_examples=EXAMPLES, deadline=None)
@given(splat_sets(st.one_of(ordinary, extreme)))
def test_the_lists_hold_every_covered_pixel(splats):
    """Each pixel that the definition covers lies in the rows of an entry of its strip."""
    lists = loaded(splats).lists
    for n, splat in enumerate(splats.to_array()):
        pixels = footprint(splat.astype(np.float64), WIDTH, HEIGHT)
        if pixels is None:
            continue
        rows, columns = np.nonzero(pixels.covered & (pixels.sigma < 5.541))
        for row, column in zip(rows + pixels.rows.start, columns + pixels.columns.start, strict=True):
            s = column // STRIP_WIDTH
            assert n in lists.entries[lists.offsets[s] : lists.offsets[s + 1], 0]
            first, end = row_range(lists.records[n], s, HEIGHT)
            assert first <= row < end


@settings(max_examples=EXAMPLES, deadline=None)
@given(splat_sets(st.one_of(ordinary, extreme), largest=12))
def test_the_lists_are_consistent(splats):
    lists = loaded(splats).lists
    assert lists.offsets[-1] == lists.base[-1]
    for tasks in (1, 2, 3, 7):
        runs = [run_of_strips(task, tasks, lists) for task in range(tasks)]
        assert [s for first, end in runs for s in range(first, end)] == list(range(strip_count(WIDTH)))
    for s in range(strip_count(WIDTH)):
        own = lists.entries[lists.offsets[s] : lists.offsets[s + 1]]
        touching = [p for p in range(len(splats)) if lists.strips[p, 0] <= s < lists.strips[p, 1]]
        assert own.tolist() == [[p, lists.base[p] + s - lists.strips[p, 0]] for p in touching]


def test_a_splat_that_misses_all_centres_has_no_entries():
    lists = loaded(NAMED["sub-pixel between centres"]).lists
    assert lists.base.tolist() == [0, 0]


@pytest.mark.skipif(not JIT, reason="there is no machine code without the JIT")
@pytest.mark.skipif(
    not binding.get_host_cpu_features().get("avx2", False), reason="packed instructions are looked for by AVX2's names"
)
@pytest.mark.parametrize("strict", [False, True])
@pytest.mark.parametrize("kernel", [add_tile, grad_add_strip, objective_task])
def test_the_inner_loops_are_packed(kernel, strict):
    """Past some size of the loop body LLVM falls back to scalar code, ten times slower, without a word.

    A row takes a dozen packed multiplications of each kind; scalar fallbacks for overlapping arrays may stand beside.
    """
    work = loaded(population(5, 40, 20), 40, 20)
    strip, moments = work.buffers[0], np.zeros(96, np.float32)
    selection = room_for_selection(0, strip_count(40), work.lists)
    count = select_strip(0, 0, 20, work.lists, selection)
    target, losses = np.zeros((3, 20 * 48), np.float32), np.zeros(3)
    arguments = {
        add_tile: (strip, 0, 0, 20, selection, count, strict),
        grad_add_strip: (strip, 0, selection, count, work.slots, moments, strict),
        objective_task: (0, 1, strip, work.lists, strict, work.slots, target, BLACK, 40, losses, True),
    }[kernel]
    # A compilation of its own, since code that comes from the cache cannot be looked at.
    fresh = numba.jit(**kernel.targetoptions)(kernel.py_func)
    fresh(*arguments)
    (code,) = fresh.inspect_asm().values()
    packed = re.findall(r"\bv(?:mul|fn?m(?:add|sub)\d+)ps\b.*%[yz]mm", code)
    assert len(packed) >= 24
