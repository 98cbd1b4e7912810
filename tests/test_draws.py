"""Random numbers and elementary functions that are the same everywhere: known values, and their properties."""

import math

import numpy as np
import pytest

from gsvc_base import portable
from gsvc_base.draws import Draws

MASK = (1 << 64) - 1


def splitmix64(state):
    """The words of SplitMix64 from a state on, in Python's integers."""
    while True:
        state = state + 0x9E3779B97F4A7C15 & MASK
        word = state
        word = (word ^ word >> 30) * 0xBF58476D1CE4E5B9 & MASK
        word = (word ^ word >> 27) * 0x94D049BB133111EB & MASK
        yield word ^ word >> 31


def test_the_words_are_those_of_splitmix64():
    draws = Draws(7)
    words = splitmix64(draws._state)
    assert draws.words(3).tolist() + draws.words(4).tolist() == [next(words) for _ in range(7)]


def test_published_words_of_splitmix64():
    draws = Draws(0)
    draws._state = 1234567
    known = [6457827717110365317, 3203168211198807973, 9817491932198370423, 4593380528125082431, 16408922859458223821]
    assert draws.words(5).tolist() == known


def test_numbers_of_a_seed_are_known():
    """Whoever changes these changes the golden vectors, the scenes and the random streams of every seed."""
    draws = Draws(0)
    assert draws.words(2).tolist() == [18159682518515982810, 5274705146620883111]
    assert draws.integers(0, 1000, 5).tolist() == [567, 503, 908, 734, 5]
    assert [value.hex() for value in draws.random(2)] == ["0x1.cf92cbee1f9e0p-2", "0x1.2870b3c08b76cp-2"]
    assert [value.hex() for value in draws.normal(1, 2, 2)] == ["0x1.c688528800000p-2", "0x1.4b9293cd00000p+2"]
    assert [value.hex() for value in draws.lognormal(0, 1, 2)] == ["0x1.100f0e12fab16p-1", "0x1.2ad774a0167a5p-1"]
    assert draws.permutation(6).tolist() == [1, 5, 3, 2, 0, 4]


def test_every_number_of_a_seed_counts_and_their_order():
    seeds = (0, 1, 2**64, 2**64 + 1, [0, 0], [0, 1], [1, 0], [0, 0, 0], [2**64], [1, 1])
    firsts = {Draws(seed).words(1)[0] for seed in seeds}
    assert len(firsts) == len(seeds) - 1  # [2**64] is 2**64
    with pytest.raises(ValueError, match="-1; it must not be negative"):
        Draws([3, -1])


def test_numbers_at_once_are_those_one_by_one():
    at_once, one_by_one = Draws(3), Draws(3)
    assert at_once.random(9).tolist() == [one_by_one.uniform() for _ in range(9)]
    assert at_once.integers(0, 99, (3, 3)).ravel().tolist() == [one_by_one.integers(0, 99) for _ in range(9)]
    assert at_once.standard_normal((3, 3)).ravel().tolist() == [one_by_one.standard_normal(1)[0] for _ in range(9)]
    many = at_once.standard_normal(10_000)  # more than a block
    assert many.tolist() == [*one_by_one.standard_normal(9_000), *one_by_one.standard_normal(1_000)]


def test_integers_are_alike_and_within_their_limits():
    drawn = Draws(1).integers(np.array([-3, 0, 250]), np.array([4, 1, 257]), (7000, 3))
    assert drawn.min(axis=0).tolist() == [-3, 0, 250]
    assert drawn.max(axis=0).tolist() == [3, 0, 256]
    assert np.all(abs(np.bincount(drawn[:, 0] + 3) - 1000) < 5 * math.sqrt(1000))
    assert Draws(1).integers(5, 6) == 5
    assert type(Draws(1).integers(9)) is int
    assert 0 <= Draws(1).integers(0, 2**32) < 2**32
    for low, high in ((3, 3), (0, 2**32 + 1)):
        with pytest.raises(ValueError, match=r"from 1 to 2\^32 integers"):
            Draws(1).integers(low, high)


def test_uniform_numbers_fill_their_interval():
    drawn = Draws(2).uniform([-1, 10], [1, 20], (5000, 2))
    assert np.all((drawn >= [-1, 10]) & (drawn < [1, 20]))
    assert np.allclose(drawn.mean(axis=0), [0, 15], atol=0.2)
    assert Draws(2).uniform([1, 2], [1, 2]).tolist() == [1, 2]
    assert Draws(2).random(9, np.float32).dtype == np.float32
    assert Draws(2).random(5000, np.float32).max() < 1


def test_normal_numbers_are_nearly_normal():
    drawn = Draws(4).standard_normal(200_000)
    assert abs(drawn.mean()) < 0.01
    assert abs(drawn.std() - 1) < 0.01
    for limit, share in ((1, 0.3173), (2, 0.0455), (3, 0.0020)):
        assert abs(np.mean(abs(drawn) > limit) - share) < 0.005
    assert Draws(4).standard_normal((2, 3), np.float32).dtype == np.float32


def test_a_permutation_has_everything_once_and_choices_only_what_there_is():
    assert sorted(Draws(5).permutation(99)) == list(range(99))
    assert set(Draws(5).choice(np.array([3, 9], np.uint16), 50)) == {3, 9}


ANGLES = np.concatenate([np.linspace(-7, 7, 2001), np.linspace(-1e8, 1e8, 999)])
POSITIVE = np.concatenate([np.exp2(np.linspace(-500, 500, 999)), np.linspace(0.5, 2, 2001)])
SMALL = np.concatenate([np.linspace(-700, 700, 999), np.linspace(-2, 2, 2001)])


@pytest.mark.parametrize(
    ("function", "known", "places", "absolute"),
    [
        (portable.exp, math.exp, (SMALL,), 0),
        (portable.log, math.log, (POSITIVE,), 2**-51),
        (portable.log2, math.log2, (POSITIVE,), 2**-50),
        (portable.log10, math.log10, (POSITIVE,), 2**-50),
        (portable.sin, math.sin, (ANGLES,), 2**-51),
        (portable.cos, math.cos, (ANGLES,), 2**-51),
        (portable.arctan2, math.atan2, (ANGLES, ANGLES[::-1]), 2**-50),
        (portable.hypot, math.hypot, (ANGLES, ANGLES[::-1]), 0),
        (portable.power, math.pow, (np.linspace(0.1, 10, 999), np.linspace(-2, 2, 999)), 2**-43),
    ],
)
def test_functions_have_their_values(function, known, places, absolute):
    wanted = np.array([known(*map(float, place)) for place in zip(*places, strict=True)])
    allowed = np.maximum(4 * np.spacing(abs(wanted)), absolute)
    assert np.all(abs(function(*places) - wanted) <= allowed)
    assert function(*(float(place[7]) for place in places)) == function(*places)[7]
    assert type(function(*(float(place[7]) for place in places))) is float


def test_values_that_must_be_exact():
    assert (portable.exp(0), portable.log(1), portable.sin(0), portable.cos(0)) == (1, 0, 0, 1)
    assert portable.power(3.0, 0) == 1
    assert [portable.whole_power(0.5, k) for k in (0, 1, 7, 1074)] == [1, 0.5, 2**-7, 2**-1074]
    assert portable.whole_power(0.9, 10) == pytest.approx(0.9**10, rel=1e-14)
    assert portable.exp(-1e4) == 0
    assert portable.arctan2([0, 0, 1, -1, 0], [0, 1, 0, 0, -1]).tolist() == [
        0, 0, math.pi / 2, -math.pi / 2, math.pi,
    ]  # fmt: skip
    assert portable.hypot(3, 4) == 5


def test_nan_and_infinity_give_no_warning():
    for function in (portable.exp, portable.log, portable.sin, portable.cos, lambda x: portable.arctan2(x, 1)):
        assert math.isnan(function(math.nan))
    assert portable.exp([-math.inf, -1e300]).tolist() == [0, 0]
    assert math.isinf(portable.hypot(math.inf, 1))
