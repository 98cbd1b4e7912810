"""The public functions: any size, any number of threads, any splats; what they refuse."""

import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from render_cases import (
    DEGENERATE,
    EXAMPLES,
    HEIGHT,
    JIT,
    NAMED,
    WIDTH,
    ordinary,
    population,
    single,
    splat_sets,
)  # fmt: skip

from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats
from gsvc_ref.rendering import (
    Renderer,
    covered_pixels,
    render,
    render_exact_with_bound,
    render_frame,
    render_gradients,
    render_sum,
    to_frame,
)  # fmt: skip

pytestmark = [] if JIT else [pytest.mark.filterwarnings("ignore:.*encountered:RuntimeWarning")]

SIZES = [(1, 1), (1, 23), (23, 1), (15, 2), (16, 3), (17, 5), (33, 31)]


@pytest.mark.parametrize(("width", "height"), SIZES)
@pytest.mark.parametrize("count", [0, 1, 7])
def test_any_size_and_number(width, height, count):
    splats = population(7, width, height).take(np.arange(count))
    C, bound = render_exact_with_bound(splats, width, height)
    actual = render_sum(splats, width, height)
    assert actual.dtype == np.float32
    assert actual.shape == (height, width, 3)
    assert np.all(abs(actual - C) <= bound)
    residual = np.ones((height, width, 3), np.float32)
    exact = render_gradients(splats, residual, precision="exact")
    gradients = render_gradients(splats, residual)
    assert gradients.dtype == np.float32
    np.testing.assert_allclose(gradients, exact, rtol=1e-3, atol=1e-4 * max(abs(exact).max(initial=0), 1e-30))


@settings(max_examples=EXAMPLES // 2, deadline=None)
@given(splat_sets(ordinary), st.sampled_from(SIZES))
def test_bits_do_not_depend_on_the_number_of_threads(splats, size):
    width, height = size
    residual = np.random.default_rng(0).normal(0, 1, (height, width, 3)).astype(np.float32)
    for function in (
        lambda threads: render(splats, width, height, threads=threads),
        lambda threads: render_sum(splats, width, height, threads=threads),
        lambda threads: render_frame(splats, width, height, 8, threads=threads),
        lambda threads: render_gradients(splats, residual, threads=threads),
        lambda threads: covered_pixels(splats, width, height, threads=threads),
    ):
        one, two, five = (function(threads).tobytes() for threads in (1, 2, 5))
        assert one == two == five


@pytest.mark.skipif(not JIT, reason="10,000 splats take minutes without the JIT; the small sets above run")
def test_bits_do_not_depend_on_the_number_of_threads_with_many_splats():
    splats = population(10_000, 300, 200)
    residual = np.random.default_rng(0).normal(0, 1, (200, 300, 3)).astype(np.float32)
    one, two = (render_gradients(splats, residual, threads=threads) for threads in (1, 2))
    assert one.tobytes() == two.tobytes()
    one, two = (render(splats, 300, 200, threads=threads) for threads in (1, 2))
    assert one.tobytes() == two.tobytes()


@pytest.mark.parametrize("name", [*DEGENERATE, "all outside", "millions of pixels away", "further than any integer"])
def test_what_covers_nothing_changes_nothing(name):
    others = population(6, WIDTH, HEIGHT)
    both = others.append(NAMED[name])
    assert np.array_equal(render_sum(both, WIDTH, HEIGHT), render_sum(others, WIDTH, HEIGHT))
    gradients = render_gradients(both, np.ones((HEIGHT, WIDTH, 3), np.float32))
    assert gradients[-1].tolist() == [0] * 8
    assert covered_pixels(both, WIDTH, HEIGHT)[-1] == 0


def test_a_frame_that_a_splat_covers_whole():
    assert covered_pixels(NAMED["larger than any integer"], WIDTH, HEIGHT).tolist() == [WIDTH * HEIGHT]
    C = render_sum(NAMED["larger than any integer"], WIDTH, HEIGHT)
    assert np.all(NAMED["larger than any integer"].colors == C)


@settings(max_examples=EXAMPLES // 2, deadline=None)
@given(splat_sets(ordinary))
def test_covered_pixels_count_what_is_drawn(splats):
    counts = covered_pixels(splats, WIDTH, HEIGHT)
    for n in range(len(splats)):
        white = Splats(splats.positions[n : n + 1], splats.cholesky[n : n + 1], np.ones((1, 3)))
        assert counts[n] == np.count_nonzero(render_sum(white, WIDTH, HEIGHT)[..., 0])


def test_covered_pixels_equal_the_definition():
    splats = population(30, WIDTH, HEIGHT)
    assert np.array_equal(
        covered_pixels(splats, WIDTH, HEIGHT), covered_pixels(splats, WIDTH, HEIGHT, precision="exact")
    )


@settings(max_examples=EXAMPLES // 2, deadline=None)
@given(splat_sets(ordinary), st.integers(8, 16))
def test_a_frame_in_one_pass_has_the_same_bits(splats, bit_depth):
    frame = render_frame(splats, WIDTH, HEIGHT, bit_depth)
    expected = to_frame(render(splats, WIDTH, HEIGHT), bit_depth)
    assert frame.dtype == expected.dtype
    assert np.array_equal(frame, expected)


def test_a_renderer_keeps_nothing_but_its_buffers():
    renderer = Renderer(WIDTH, HEIGHT)
    for count in (3, 12, 0, 1, 12):
        splats = population(count, WIDTH, HEIGHT, seed=count)
        assert np.array_equal(renderer.picture(splats), render(splats, WIDTH, HEIGHT))
        assert np.array_equal(renderer.picture(splats, clamp=False), render_sum(splats, WIDTH, HEIGHT))
        assert np.array_equal(renderer.frame(splats, 8), render_frame(splats, WIDTH, HEIGHT, 8))


def test_a_frame_without_splats_is_black():
    assert not render_frame(Splats.empty(), 5, 4, 8).any()


def test_the_clamp():
    splats = single(5.5, 5.5, 2.0, 0.0, 2.0, (3.0, -1.0, 0.5))
    assert np.array_equal(render(splats, 11, 11), np.clip(render_sum(splats, 11, 11), 0, 1))


def test_calls_from_several_threads_do_not_disturb_each_other():
    sets = [population(20, WIDTH, HEIGHT, seed) for seed in range(4)]
    expected = [render(splats, WIDTH, HEIGHT, threads=1) for splats in sets]
    results = [[] for _ in sets]

    def work(n):
        for _ in range(20 if JIT else 1):
            results[n].append(render(sets[n], WIDTH, HEIGHT, threads=2))

    workers = [threading.Thread(target=work, args=(n,)) for n in range(len(sets))]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    for pictures, picture in zip(results, expected, strict=True):
        assert pictures
        assert all(np.array_equal(other, picture) for other in pictures)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"width": 0}, "each side must be 1 to 65536"),
        ({"height": -3}, "each side must be 1 to 65536"),
        ({"width": 65537}, "each side must be 1 to 65536"),
        ({"precision": "half"}, "must be one of fast, deterministic, exact"),
        ({"threads": 0}, "at least 1"),
    ],
)
@pytest.mark.parametrize("function", [render, render_sum, covered_pixels])
def test_wrong_arguments_are_refused(function, arguments, message):
    with pytest.raises(UsageError, match=message):
        function(population(3, 8, 8), **{"width": 8, "height": 8, **arguments})


@pytest.mark.parametrize("bit_depth", [7, 17])
def test_a_wrong_bit_depth_is_refused(bit_depth):
    with pytest.raises(UsageError, match="must be 8 to 16"):
        render_frame(Splats.empty(), 4, 4, bit_depth)
