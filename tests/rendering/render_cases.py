"""Splats for the renderer's tests: Hypothesis strategies, named cases, and a dense random population."""

import numba
import numpy as np
from hypothesis import strategies as st

from gsvc_base.splats import Splats

JIT = not numba.config.DISABLE_JIT
EXAMPLES = 60 if JIT else 4
"""Hypothesis examples per property; interpreted kernels take seconds each."""


def single(x, y, l11, l21, l22, color=(0.7, -0.4, 1.1)):
    """One splat."""
    return Splats.from_array(np.array([[x, y, l11, l21, l22, *color]], np.float32))


# The frame is 45 x 37 (no multiple of 16, coprime). Each case has a reason to go wrong.
WIDTH, HEIGHT = 45, 37
NAMED = {
    "inside, round": single(20.3, 17.8, 3.0, 0.0, 3.0),
    "strong shear": single(22.1, 18.4, 2.5, 9.0, 1.5),
    "negative shear": single(22.1, 18.4, 4.0, -7.5, 2.0),
    "needle": single(22.4, 18.2, 6.0, 30.0, 0.6),
    "over the left edge": single(-2.0, 12.0, 4.0, 2.0, 3.0),
    "over the corner": single(44.0, 36.5, 5.0, -3.0, 4.0),
    "on a tile edge": single(16.0, 16.0, 2.0, 1.0, 2.0),
    "sub-pixel near a centre": single(10.53, 10.46, 0.2, 0.1, 0.15),
    "sub-pixel off centre": single(10.8, 10.2, 0.35, 0.1, 0.3),
    "sub-pixel between centres": single(11.0, 10.0, 0.1, 0.0, 0.1),
    "frame-sized": single(20.0, 20.0, 60.0, 25.0, 50.0),
    "all outside": single(500.0, -300.0, 4.0, 1.0, 4.0),
    "millions of pixels away": single(3e9, -2e12, 4.0, 1.0, 4.0),
    "further than any integer": single(1e38, -3e38, 5.0, 0.0, 5.0),
    "larger than any integer": single(10.0, 10.0, 1e30, 0.0, 1e32),
    "largest factors": single(10.0, 10.0, 3e38, -3e38, 3e38),
    "smallest factors on a centre": single(10.5, 10.5, 2.0**-126, 0.0, 2.0**-126),
    "vertical line": single(10.5, 18.0, 1e-20, 5.0, 4.0),
    "horizontal line": single(20.0, 18.5, 6.0, 0.0, 1e-30),
    "l11 zero": single(20.0, 20.0, 0.0, 0.0, 3.0),
    "l22 zero": single(20.0, 20.0, 3.0, 0.0, 0.0),
    "l11 negative": single(20.0, 20.0, -3.0, 0.0, 3.0),
    "l22 subnormal": single(20.0, 20.0, 3.0, 0.0, 2.0**-127),
}
DEGENERATE = ["l11 zero", "l22 zero", "l11 negative", "l22 subnormal"]
SMOOTH = [*list(NAMED)[:9], "frame-sized"]
"""Cases with gradients of ordinary size, for central differences."""

f4 = {"width": 32, "allow_nan": False, "allow_infinity": False}


def _packed(*columns):
    return st.tuples(*columns).map(lambda values: np.array(values, np.float32))


ordinary = _packed(
    st.floats(-30, WIDTH + 30, **f4),
    st.floats(-30, HEIGHT + 30, **f4),
    st.floats(0.125, 64, **f4),
    st.floats(-40, 40, **f4),
    st.floats(0.125, 64, **f4),
    *[st.floats(-2, 2, **f4)] * 3,
)

centers = st.one_of(
    st.integers(-3, 48).map(lambda i: i / 2),  # pixel centres and edges: exact zeros and ties
    st.floats(-50, 100, **f4),
    st.floats(-(2.0**100), 2.0**100, **f4),
)
factors = st.one_of(
    st.floats(2.0**-10, 2.0**10, **f4),
    st.integers(-126, 100).map(lambda e: 2.0**e),
    st.floats(-1.0, 2.0**-120, **f4),  # degenerate or nearly
)
shears = st.one_of(st.just(0.0), st.floats(-100, 100, **f4), st.floats(-(2.0**60), 2.0**60, **f4))
extreme = _packed(centers, centers, factors, shears, factors, *[st.floats(-100, 100, **f4)] * 3)


def splat_sets(splat, largest=6):
    """Up to `largest` splats."""
    return st.lists(splat, max_size=largest).map(
        lambda rows: Splats.from_array(np.array(rows, np.float32).reshape(-1, 8))
    )


def population(count, width, height, seed=0):
    """Splats of natural sizes all over a frame: about ten on a pixel, as after training."""
    rng = np.random.default_rng(seed)
    radius = np.sqrt(width * height / max(count, 1))
    packed = np.concatenate(
        [
            rng.random((count, 2)) * (width + 8, height + 8) - 4,
            np.stack(
                [
                    radius * rng.lognormal(-0.4, 0.5, count),
                    radius * rng.normal(0, 0.7, count),
                    radius * rng.lognormal(-0.4, 0.5, count),
                ],
                axis=1,
            ),
            rng.normal(0.1, 0.25, (count, 3)),
        ],
        axis=1,
    )
    return Splats.from_array(packed.astype(np.float32))
