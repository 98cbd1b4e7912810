"""Splats: three arrays that fit each other, hold numbers, and keep their bits."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gsvc_base.errors import UsageError
from gsvc_base.splats import Splats, scale_parameters, scale_parameters_filtered
from gsvc_ref.rendering import render_exact_with_bound, render_sum
from gsvc_ref.testing.strategies import splat_sets

COLUMNS = {"positions": 2, "cholesky": 3, "colors": 3}


def arrays(count=4) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    return {name: rng.normal(0, 1, (count, columns)).astype(np.float32) for name, columns in COLUMNS.items()}


@given(splat_sets(hard=True))
def test_an_array_of_all_parameters_and_back_keeps_all_bits(splats):
    packed = splats.to_array()
    assert packed.shape == (len(splats), 8)
    assert packed.dtype == np.float32
    again = Splats.from_array(packed)
    assert again == splats
    assert again.tobytes() == splats.tobytes()
    assert np.array_equal(packed[:, 2:5], splats.cholesky)


def test_splats_are_an_array_to_numpy():
    splats = Splats(**arrays())
    assert np.asarray(splats).tobytes() == splats.to_array().tobytes()
    assert np.asarray(splats, np.float64).dtype == np.float64
    assert Splats.of(splats) is splats
    assert Splats.of(splats.to_array()) == splats
    with pytest.raises(ValueError, match="copy"):
        splats.__array__(copy=False)


@given(splat_sets(min_count=1), st.data())
def test_take_and_append_keep_order_and_bits(splats, data):
    cut = data.draw(st.integers(0, len(splats)))
    numbers = np.arange(len(splats))
    assert splats.take(numbers[:cut]).append(splats.take(numbers[cut:])) == splats
    assert splats.take(numbers < cut) == splats.take(numbers[:cut])
    backwards = splats.take(numbers[::-1])
    assert np.array_equal(backwards.positions, splats.positions[::-1])
    assert backwards.take(numbers[::-1]) == splats


def test_the_bytes_are_positions_then_factors_then_colours():
    parts = arrays()
    splats = Splats(**parts)
    numbers = np.frombuffer(splats.tobytes(), "<f4")
    assert np.array_equal(numbers, np.concatenate([parts[name].ravel() for name in COLUMNS]))


def test_equality_is_that_of_bits():
    parts = arrays()
    splats = Splats(**parts)
    assert splats == Splats(**parts)
    assert splats != splats.take(np.arange(3))
    assert splats != parts
    zero, minus = (Splats.from_array(np.full((1, 8), value, np.float32)) for value in (0.0, -0.0))
    assert zero != minus
    with pytest.raises(TypeError, match="unhashable"):
        hash(splats)


def test_no_splats_are_splats_too():
    empty = Splats.empty()
    assert len(empty) == 0
    assert empty.tobytes() == b""
    assert empty == Splats.from_array(np.empty((0, 8)))
    splats = Splats(**arrays())
    assert empty.append(splats) == splats.append(empty) == splats
    assert splats.take(np.empty(0, np.int64)) == empty


def test_other_types_and_layouts_are_taken_as_binary32():
    parts = arrays()
    splats = Splats(**parts)
    lists = Splats(**{name: part.tolist() for name, part in parts.items()})
    turned = Splats(**{name: np.asfortranarray(part) for name, part in parts.items()})
    assert lists == turned == splats
    assert all(getattr(turned, name).flags.c_contiguous for name in COLUMNS)
    assert Splats.from_array(splats.to_array().astype(">f4")) == splats


@pytest.mark.parametrize("name", COLUMNS)
@pytest.mark.parametrize("shape", [(4,), (4, 4), (4, 1), (2, 2, 2), ()])
def test_wrong_shapes_are_refused_by_name(name, shape):
    with pytest.raises(UsageError, match=rf"Splats\.{name} has shape"):
        Splats(**arrays() | {name: np.zeros(shape)})


@pytest.mark.parametrize("name", COLUMNS)
def test_other_counts_are_refused(name):
    with pytest.raises(UsageError, match="counts must be equal"):
        Splats(**arrays() | {name: np.zeros((3, COLUMNS[name]))})


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("positions", np.nan, "NaN"),
        ("cholesky", np.nan, "NaN"),
        ("colors", np.nan, "NaN or infinite"),
        ("colors", np.inf, "NaN or infinite"),
        ("colors", -np.inf, "NaN or infinite"),
    ],
)
def test_what_is_no_number_is_refused_with_its_splat(name, value, said):
    parts = arrays()
    parts[name][2, 1] = value
    with pytest.raises(UsageError, match=rf"Splats\.{name} is {said} at splat 2"):
        Splats(**parts)


@pytest.mark.parametrize("shape", [(8,), (3, 7), (3, 9), (1, 3, 8)])
def test_wrong_shapes_of_a_packed_array_are_refused(shape):
    with pytest.raises(UsageError, match=r"must be \(N, 8\)"):
        Splats.from_array(np.zeros(shape))


def test_arrays_that_fit_are_not_copied():
    parts = arrays()
    assert Splats(**parts).positions is parts["positions"]


@given(splat_sets(width=24, height=16, max_count=8), st.sampled_from([0.5, 1, 3]), st.sampled_from([1, 3, 5]))
def test_a_scaled_set_shows_the_same_picture(splats, across, down):
    """Where a centre of the small picture lies on one of the large one, the sums agree but for the support's edge."""
    scaled = scale_parameters(splats, 24, 16, int(24 * across), 16 * down)
    assert np.array_equal(scaled.colors, splats.colors)
    if across == 0.5:
        assert (
            scale_parameters(scaled, 12, 16 * down, 24, 16).positions[:, 0].tobytes()
            == splats.positions[:, 0].tobytes()
        )
        return
    small = render_sum(splats, 24, 16, precision="exact")
    large = render_sum(scaled, int(24 * across), 16 * down, precision="exact")
    middle = large[down // 2 :: down, int(across) // 2 :: int(across)]
    edge = 1 / 255 * np.abs(splats.colors).sum() + 1e-6
    assert np.abs(middle - small).max(initial=0) <= edge
    assert np.median(np.abs(middle - small)) < 1e-5


def test_a_scale_of_one_keeps_all_bits():
    splats = Splats(**arrays())
    assert scale_parameters(splats, 24, 16, 24, 16) == splats


def test_a_product_beyond_binary32_is_infinite():
    far = Splats.from_array([[3e38, -3e38, 2e38, -1e38, 3e38, 1, -1, 3e38]])
    with np.errstate(all="raise"):
        scaled = scale_parameters(far, 24, 16, 96, 32).to_array()[0]
    assert scaled[[0, 1, 2, 4]].tolist() == [np.inf, -np.inf, np.inf, np.inf]
    assert scaled[3] == 2 * np.float32(-1e38)
    assert np.array_equal(scaled[5:], far.colors[0])


def test_an_application_that_traps_underflow_is_not_trapped():
    smallest = Splats.from_array(np.array([[4, 4, 2.0**-126, 0, 3, 1, 1, 1]], np.float32))
    with np.errstate(all="raise"):
        scaled = scale_parameters(smallest, 10, 10, 3, 3)
        assert 0 < scaled.cholesky[0, 0] < 2.0**-126
        assert np.isfinite(render_exact_with_bound(Splats.from_array(scaled.to_array() + np.float32(1)), 40, 8)).all()


@given(splat_sets(width=24, height=16, max_count=8))
def test_a_filtered_picture_has_the_means_of_the_large_one(splats):
    """Of splats of two pixels and more: kurtosis makes 0.2 %, the ends of supports 1/255."""
    entries = np.abs(splats.cholesky) * np.array([1, 0, 1], np.float32) + np.array([2, 0, 2], np.float32)
    wide = Splats(splats.positions, entries, splats.colors)
    large = render_sum(wide, 24, 16, precision="exact")
    small = render_sum(scale_parameters_filtered(wide, 24, 16, 12, 8), 12, 8, precision="exact")
    means = large.reshape(8, 2, 12, 2, 3).mean(axis=(1, 3))
    assert np.abs(small - means).max(initial=0) <= (0.002 + 1 / 255) * np.abs(splats.colors).sum() + 1e-6


def test_the_stated_precision_of_filtered_splats_holds_for_needles():
    """m22 of a needle that lies askew, against fractions: a difference of squares would lose all its digits."""
    needle = np.array([[500, 500, 100, 100, 1e-3, 1, 1, 1]], np.float32)
    l11, l21, l22 = (Fraction(float(entry)) for entry in needle[0, 2:5])
    v = Fraction(1000**2 - 999**2, 12 * 1000**2)
    a = Fraction(999, 1000)
    l11, l21, l22 = a * l11, a * l21, a * l22
    m22 = math.sqrt(l22**2 + v + l21**2 * v / (l11**2 + v))
    scaled = scale_parameters_filtered(needle, 1000, 1000, 999, 999)
    assert scaled.cholesky[0, 2] == np.float32(m22)
    assert 0.01 < m22 < 0.02


@pytest.mark.parametrize(
    "entries", [(0, 1, 2), (-2, 1, 2), (2, 1, -2), (2, 1, 2.0**-127), (np.inf, 1, 2), (2, np.inf, 2)]
)
def test_splats_that_cover_nothing_are_not_filtered(entries):
    splats = Splats.from_array([[4, 4, *entries, 1, -1, 1]])
    assert scale_parameters_filtered(splats, 16, 12, 8, 6) == scale_parameters(splats, 16, 12, 8, 6)


def test_filtered_splats_of_any_size_are_numbers():
    sizes = [2.0**-126, 2.0**-64, 1, 2.0**64, 3e38]
    rows = [[3e38, -3e38, across, shear, down, 3e38, -3e38, 1]
            for across in sizes for down in sizes for shear in (0, -3e38, 2.0**-149)]  # fmt: skip
    with np.errstate(all="raise"):
        for size in ((8, 6), (1, 65535), (65535, 1)):
            assert len(scale_parameters_filtered(rows, 16, 12, *size)) == len(rows)
