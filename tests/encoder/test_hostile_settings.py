"""Every field of every settings dataclass against values that nobody means: they are taken as said, or refused."""

from dataclasses import fields, is_dataclass, replace
from decimal import Decimal
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from codec_cases import encoded, flat, paper_fast, paper_quick, waves

from gsvc_base.errors import UsageError
from gsvc_ref.encoder import Settings
from gsvc_ref.training import FitSettings

HOSTILE: list[Any] = [
    None, True, False, np.True_, -1, 0, 2, 2.5, -0.0, 1e300, 5e-324, 2**31, 2**63, 10**400, np.nan, np.inf, -np.inf,
    1j, "", "auto", "5", "paper", b"5", (), (3,), (3, 2), (0, None), (None, 1), ("a",), (True,), [], [1, 2], {}, {1: 2},
    set(), object(), int, len, np.int64(5), np.uint8(7), np.float32(0.5), np.float64("nan"), np.zeros(0), np.arange(3),
    np.array(5), np.array([5]), Decimal("0.5"), Decimal("NaN"), Fraction(1, 4), range(3), paper_quick(),
    FitSettings(), ((1, 2, 3),), ((1, 2),), ((99, 99, 99),), (-1, 5), (5, 10**30), (10**30, None), (0.5, None),
]  # fmt: skip


def parts(settings: Any) -> dict[str, Any]:
    """The dataclasses inside of one, and itself, one for each class."""
    found = {type(settings).__name__: settings}
    for field in fields(settings):
        if is_dataclass(value := getattr(settings, field.name)):
            found = parts(value) | found
    return found


PARTS = parts(Settings.quick()) | parts(Settings.paper())


def plain(value: Any) -> bool:
    """Whether a value is one of Python's own, all the way down."""
    if isinstance(value, tuple):
        return all(plain(item) for item in value)
    return value is None or type(value) in (bool, int, float, str) or is_dataclass(value) or callable(value)


@pytest.mark.parametrize("part", PARTS.values(), ids=PARTS)
def test_every_field_takes_what_it_says_or_refuses_it(part):
    taken = 0
    for field in fields(part):
        for value in HOSTILE:
            try:
                changed = replace(part, **{field.name: value})
            except UsageError:  # any other exception fails the test
                continue
            taken += 1
            kept = getattr(changed, field.name)
            assert plain(kept), (field.name, value)
            assert kept == value
            assert hash(changed) is not None
    assert taken >= len(fields(part))


NO_NUMBERS = [None, True, 2.5, "5", np.nan, np.inf, 10**400, np.array([5]), object(), (3,), [], b"5", 1j, 2**63]
NUMBERS = ("splats", "psnr", "iterations", "cholesky_bits", "color_stages", "color_codewords", "threads", "seed")


@pytest.mark.parametrize("value", NO_NUMBERS, ids=lambda value: type(value).__name__)
@pytest.mark.parametrize("name", NUMBERS)
def test_overrides_are_checked_before_anything_is_made_of_them(name, value):
    if value is None and name != "seed":
        return  # leaves the preset's value
    if (name, value) == ("psnr", 2.5):
        return
    for preset in (paper_quick, Settings.paper):
        with pytest.raises(UsageError, match=name):
            preset(**{name: value})


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"seed": None}, r"Settings\.seed is None; it must be a whole number"),
        ({"lane_count": None}, r"lane_count is None; it must be a whole number"),
        ({"frames": (3,)}, r"frames is \(3,\); it must be a tuple \(a whole number, a whole number or None\)"),
        ({"frames": (10**30, None)}, r"A below 4294967295"),
        ({"splats": 2.5}, r"splats is 2\.5; it must be a whole number or None"),
        ({"splats": 0}, r"splats is 0; it must be in 1\.\.4194304"),
        ({"psnr": np.nan}, r"psnr is nan; it must be a finite number or None"),
        ({"index": 1}, r"index is 1; it must be True or False"),
        ({"precision": "exact"}, r"precision is 'exact'; it must be one of fast, deterministic"),
        ({"precision": 5}, r"precision is 5; it must be 'fast' or 'deterministic' or 'exact'"),
        (
            {"key_frames": [1]},
            r"key_frames is \[1\]; it must be 'auto' or a whole number or a tuple, each",
        ),
        ({"intra": None}, r"intra is None; it must be a FrameSettings"),
    ],
)
def test_messages_say_what_is_allowed(wrong, message):
    with pytest.raises(UsageError, match=message):
        paper_quick(**wrong)


def test_numbers_of_numpy_are_numbers():
    settings = paper_fast(splats=np.int64(5), psnr=np.float32(30.5), key_frames=(np.int32(2),), seed=np.uint64(2**62))
    assert settings == paper_fast(splats=5, psnr=30.5, key_frames=(2,), seed=2**62)
    assert type(settings.splats) is int
    assert paper_fast(iterations=np.int16(3)) == paper_fast(iterations=3)
    assert (
        encoded(waves(16, 12, 2), paper_fast(splats=np.int64(5)))[1]
        == encoded(waves(16, 12, 2), paper_fast(splats=5))[1]
    )


def test_values_at_their_ends_encode():
    """What is accepted works: the smallest and largest of what costs no time."""
    for changes in (
        {"seed": 2**63 - 1},
        {"frames": (0, 2**40)},
        {"key_frames": 2**32 - 1},
        {"key_frames": (2**70,)},
        {"threads": 1024},
        {"lane_count": 64, "entropy_precision": 16},
        {"splats": 1, "cholesky_bits": 1, "color_stages": 8, "color_codewords": 1024},
        {"cholesky_bits": 12, "color_stages": 1, "color_codewords": 1},
        {"psnr": 100.0, "splats": 3},
        {"psnr": 1.0},
    ):
        report, data = encoded(flat(90, 16, 12, frames=2), paper_fast(**{"iterations": 1} | changes))
        assert report.file_bytes == len(data)


def test_the_search_for_splats_reports_its_progress():
    """Each try is a fit, counted from 1 without a gap, then fine-tuning; a frame has the iterations of all tries."""
    seen = []
    report, _ = encoded(waves(24, 16, 2), paper_fast(psnr=22.0, splats=60), progress=seen.append)
    assert {one.stage for one in seen} == {"fit", "quantize"}
    assert seen[-1].frame == 1
    for frame in report.frames:
        mine = [one for one in seen if one.frame == frame.number]
        fit, tune = ([one for one in mine if one.stage == stage] for stage in ("fit", "quantize"))
        assert fit[0].iteration == 1
        assert all(after.iteration in (1, before.iteration + 1) for before, after in pairwise(fit))
        assert all(1 <= one.iteration <= one.iterations for one in (*fit, *tune))
        tries = [one for one in fit if one.iteration == 1]
        assert frame.iterations == len(fit) + len(tune) - len(tries)  # fine-tuning ends with an evaluation and no step
        assert frame.psnr == pytest.approx(max(one.psnr for one in tune), abs=0.2)  # rounded to 8 bits


def test_iterations_leave_the_search_for_key_frames_as_it_is():
    assert Settings.paper(iterations=100).detection == Settings.paper().detection
    assert Settings.paper(iterations=100).inter.tune.iterations == 10
