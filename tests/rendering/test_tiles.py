"""The parts of the fast renderer: the exponential, the bins, and the machine code of the inner loops."""

import re

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from llvmlite import binding
from render_cases import EXAMPLES, HEIGHT, JIT, NAMED, WIDTH, extreme, ordinary, population, splat_sets

from gsvc_base.constants import SUPPORT_SQUARED
from gsvc_base.rendering.definition import footprint
from gsvc_base.rendering.error_models import EPS
from gsvc_ref.rendering.fast.batches import gather_batch, room_for_batch
from gsvc_ref.rendering.fast.exponential import exp_minus_half
from gsvc_ref.rendering.fast.jobs import LOSS_AND_GRADIENTS, Job, run_task, tiles_of_task
from gsvc_ref.rendering.fast.projection import row_range
from gsvc_ref.rendering.fast.rasterizer import Rasterizer
from gsvc_ref.rendering.fast.regions import Regions
from gsvc_ref.rendering.fast.sums import LANE_SUMS, add_batch, grad_add_batch
from gsvc_ref.rendering.fast.tiles import TILE_WIDTH, tile_count

pytestmark = [] if JIT else [pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning")]


def loaded(splats, width=WIDTH, height=HEIGHT):
    rasterizer = Rasterizer(width, height, threads=1)
    rasterizer.binning.load(splats.to_array())
    return rasterizer


def bins_of(splats):
    return loaded(splats).binning.bins


def test_the_exponential_is_within_its_error():
    s = np.concatenate([np.linspace(0, SUPPORT_SQUARED, 20001), np.geomspace(2.0**-40, 1, 3001)]).astype(np.float32)
    g = np.array([exp_minus_half(value) for value in s], np.float64)
    exact = np.exp(-s.astype(np.float64) / 2)
    assert np.all(abs(g / exact - 1) <= EPS * (4.5 + 2.2 * s))
    assert exp_minus_half(np.float32(0)) == 1


@settings(max_examples=EXAMPLES, deadline=None)
@given(splat_sets(st.one_of(ordinary, extreme)))
def test_the_bins_hold_every_covered_pixel(splats):
    """Each pixel that the definition covers lies in the rows of an intersection of its tile."""
    bins = bins_of(splats)
    for n, splat in enumerate(splats.to_array()):
        pixels = footprint(splat.astype(np.float64), WIDTH, HEIGHT)
        if pixels is None:
            continue
        rows, columns = np.nonzero(pixels.covered & (pixels.sigma < 5.541))
        for row, column in zip(rows + pixels.rows.start, columns + pixels.columns.start, strict=True):
            t = column // TILE_WIDTH
            assert n in bins.intersections[bins.tile_offsets[t] : bins.tile_offsets[t + 1], 0]
            first, end = row_range(bins.projected[n], t, HEIGHT)
            assert first <= row < end


@settings(max_examples=EXAMPLES, deadline=None)
@given(splat_sets(st.one_of(ordinary, extreme), largest=12))
def test_the_bins_are_consistent(splats):
    bins = bins_of(splats)
    assert bins.tile_offsets[-1] == bins.splat_offsets[-1]
    for tasks in (1, 2, 3, 7):
        runs = [tiles_of_task(task, tasks, bins) for task in range(tasks)]
        assert [t for first, end in runs for t in range(first, end)] == list(range(tile_count(WIDTH)))
    for t in range(tile_count(WIDTH)):
        own = bins.intersections[bins.tile_offsets[t] : bins.tile_offsets[t + 1]]
        touching = [n for n in range(len(splats)) if bins.tile_ranges[n, 0] <= t < bins.tile_ranges[n, 1]]
        assert own.tolist() == [[n, bins.splat_offsets[n] + t - bins.tile_ranges[n, 0]] for n in touching]


def test_a_splat_that_misses_all_centres_has_no_intersections():
    assert bins_of(NAMED["sub-pixel between centres"]).splat_offsets.tolist() == [0, 0]


@pytest.mark.skipif(not JIT, reason="there is no machine code without the JIT")
@pytest.mark.skipif(
    not binding.get_host_cpu_features().get("avx2", False), reason="packed instructions are looked for by AVX2's names"
)
@pytest.mark.parametrize(
    ("kernel", "strict"),
    [
        (add_batch, False),
        (grad_add_batch, False),
        pytest.param(run_task, False, marks=pytest.mark.exhaustive),  # which has both
        *(pytest.param(one, True, marks=pytest.mark.exhaustive) for one in (add_batch, grad_add_batch, run_task)),
    ],
)
def test_the_inner_loops_are_packed(kernel, strict):
    """Past some size of the loop body LLVM falls back to scalar code, ten times slower, without a word.

    A row takes a dozen packed multiplications of each kind; scalar fallbacks for overlapping arrays may stand beside.
    """
    rasterizer = loaded(population(5, 40, 20), 40, 20)
    bins, moments = rasterizer.binning.bins, rasterizer.moments
    buffers, lane_sums = rasterizer.buffers[0], np.zeros(LANE_SUMS, np.float32)
    batch = room_for_batch(0, tile_count(40), bins)
    count = gather_batch(0, 0, 20, bins, batch)
    target, losses = np.zeros((3, 20 * 48), np.float32), np.zeros(3)
    job = Job(40, 20, strict, LOSS_AND_GRADIENTS, target=target, losses=losses, moments=moments)
    arguments = {
        add_batch: (buffers, 0, 0, 20, batch, count, True, strict),
        grad_add_batch: (buffers, 0, batch, count, moments, lane_sums, strict),
        run_task: (0, 1, buffers, bins, Regions.all_of(3, 20, 20), job),
    }[kernel]
    # A compilation of its own, since code that comes from the cache cannot be looked at.
    fresh = numba.jit(**kernel.dispatcher().targetoptions)(kernel.__wrapped__)
    fresh(*arguments)
    (code,) = fresh.inspect_asm().values()
    packed = re.findall(r"\bv(?:mul|fn?m(?:add|sub)\d+)ps\b.*%[yz]mm", code)
    assert len(packed) >= 24
