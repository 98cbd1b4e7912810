"""Hard cases of gradients: `tests/hard_cases` measures them against 60 digits."""

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.gradients import noise
from gsvc_conformance.cases.hard_shapes import (
    HEIGHT,
    NOT_QUITE,
    SHAPES,
    TARGETS,
    WIDTH,
    Shape,
    at_the_edge,
    odd_numbers,
)
from gsvc_conformance.cases.hard_splats import SIDES, WHAT_THEY_ARE, WHERE
from gsvc_conformance.cases.splat_sets import COLOR, splat, splats


@case("stress", "render_gradients", flags=["hard", "needle", "cancellation"], each=SHAPES, said=WHAT_THEY_ARE)
def hard(value: tuple[Shape, Shape, Shape], rng: Draws) -> Inputs:
    """Three splats: {key}."""
    parameters = splats(*(splat(*shape) for shape in value))
    expected = yield {"parameters": parameters, "residual": noise(rng, WIDTH, HEIGHT)}
    assert expected["gradients"].value[:, 5:].all()


@case("stress", "render_gradients", flags=["hard", "support", "nan"])
def hard_ends_before_the_frame(rng: Draws) -> Inputs:
    """Splats a million pixels away that end before the frame, by little: their gradients are zero."""
    parameters = splats(*(splat(*shape, (1e3, 1e3, 1e3)) for shape in NOT_QUITE))
    expected = yield {"parameters": parameters, "residual": noise(rng, WIDTH, HEIGHT)}
    assert not expected["gradients"].value.any()


@case("stress", "render_gradients", flags=["hard", "support"], each=SIDES, said=WHERE)
def hard_coverage(value: int) -> Inputs:
    """Three splats, each with a pixel whose sigma is {key}; which alone has a residual in its channel."""
    residual = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    for k, (i, j) in enumerate(TARGETS):
        residual[j, i, k] = 100.0
    expected = yield {"parameters": at_the_edge(value), "residual": residual}
    of_own_color = np.diagonal(expected["gradients"].value[:, 5:])
    assert value == 0 or (of_own_color > 0).tolist() == [value < 0] * 3


@case("stress", "render_gradients", flags=["hard", "subnormal", "signed-zero", "degenerate"])
def hard_parameters(rng: Draws) -> Inputs:
    """Each parameter in turn is minus zero, subnormal, negative and subnormal; where it is l11 or l22, all are zero."""
    expected = yield {"parameters": odd_numbers(), "residual": noise(rng, 2, 2)}
    drawn = ~np.isin(np.arange(24) % 8, (2, 4))
    assert np.array_equal(expected["gradients"].value.any(axis=1), drawn)


@case("stress", "render_gradients", flags=["hard", "cancellation"])
def hard_colours_of_10000(rng: Draws) -> Inputs:
    """Colours of 10000, 10000 and -20000 under a grey residual, which their scalar product cancels but for little."""
    rows = [
        splat(3.5 + rng.uniform(-1, 1), 2.5 + rng.uniform(-1, 1), 2.5, 0.7, 2.0, (1e4, 1e4, -2e4 + k)) for k in range(4)
    ]
    residual = noise(rng, WIDTH, HEIGHT)[..., :1].repeat(3, axis=2)
    expected = yield {"parameters": splats(*rows), "residual": residual}
    assert abs(expected["gradients"].value[0, :5]).max() < 1e-9


@case("stress", "render_gradients", flags=["hard", "cancellation"])
def hard_residual_that_cancels() -> Inputs:
    """A large residual that is antisymmetric around round splats: the positive and negative halves cancel."""
    i, j = np.arange(WIDTH) - 3.0, np.arange(HEIGHT)[:, None] - 2.0
    residual = (1e4 * i * (1 + j * j))[..., None].repeat(3, axis=2).astype(np.float32)
    parameters = splats(
        *(splat(3.5, 2.5, *factors) for factors in ((1.5, 0.0, 2.0), (0.75, 0.0, 0.5), (40.0, 0.0, 40.0)))
    )
    expected = yield {"parameters": parameters, "residual": residual}
    gradients, bound = expected["gradients"].value, expected["gradients"].bound
    assert np.all(abs(gradients[:, [1, 2, 4, 5, 6, 7]]) <= 2.0**-29 * bound[:, [1, 2, 4, 5, 6, 7]])
    assert gradients[:, 0].all()


@case("stress", "render_gradients", flags=["hard", "overflow", "subnormal"], each={"1e30": 1e30, "1e-30": 1e-30})
def hard_products(value: float, rng: Draws) -> Inputs:
    """Residuals of {key} over colours of the inverse order: the product is of the order of 1."""
    rows = [
        splat(3.3, 2.6, 1.5, 0.7, 1.25, [c / value for c in COLOR]),
        splat(2.3, 3.6, 0.5, -0.7, 2.25, (1 / value,) * 3),
    ]
    expected = yield {"parameters": splats(*rows), "residual": noise(rng, WIDTH, HEIGHT) * np.float32(value)}
    assert 1e-3 < abs(expected["gradients"].value[:, :5]).max() < 1e3


@case("stress", "render_gradients", flags=["hard", "nan", "overflow"])
def hard_shear_that_overflows(rng: Draws) -> Inputs:
    """Factors near the largest number: l21 times u1 overflows binary32 at pixels that are far outside of the splat."""
    parameters = splats(splat(6.2, 5.1, 5.0, 2e38, 1e38, (0.5, 0.3, -0.2)))
    expected = yield {"parameters": parameters, "residual": noise(rng, 13, 11)}
    assert expected["gradients"].value.any()


@case("stress", "render_gradients", flags=["hard", "nan", "needle"])
def hard_far_thinner_than_a_pixel(rng: Draws) -> Inputs:
    """Splats far thinner than a pixel, each on the centre of one: only colours have gradients.

    l21 / l22 and the factors l21 / (l11 l22) of (13-12) are in the range of binary32; 1 / (l11 l22) is not.
    """
    factors = [(1e-30, 0, 1e-30), (1e-30, 1e-30, 1e-30), (1e-30, 1e-25, 1e-12)]
    rows = [splat(4 * n + 0.5, 1.5, *factor) for n, factor in enumerate(factors)]
    expected = yield {"parameters": splats(*rows), "residual": noise(rng, 11, 3)}
    assert not expected["gradients"].value[:, :5].any()
    assert expected["gradients"].value[:, 5:].all()
