"""How the benchmark of the effects finds an N of equal PSNR."""

import math

import pytest

from gsvc_lab.benchmarks import effects
from gsvc_lab.benchmarks.effects import EQUAL, MAX_TRIES, Measured, as_good, next_count


def point(splats: int, psnr: float) -> Measured:
    return Measured(splats, 8 * splats, psnr, 0.0, 0)


def test_the_next_count_lies_between_the_two_points_around_or_beyond_all() -> None:
    points = [point(400, 34.0), point(100, 30.0), point(200, 32.0)]
    assert next_count(points, 33.0) == 300
    assert next_count(points, 31.0) == 150
    assert next_count(points, 36.0) > 400
    assert next_count(points, 29.0) < 100


@pytest.mark.parametrize("goal", [20.0, 33.3, 45.0])
def test_an_equal_psnr_is_found_where_there_is_one(monkeypatch: pytest.MonkeyPatch, goal: float) -> None:
    def encoded(_: object, splats: int, mode: str, __: object) -> Measured:
        assert mode == "auto"
        return point(splats, 6 * math.log2(splats) - 20)

    monkeypatch.setattr(effects, "encoded", encoded)
    found = as_good([], goal, None)
    assert abs(found.psnr - goal) <= EQUAL


def test_the_search_ends_where_no_count_will_do(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[int] = []

    def encoded(_: object, splats: int, *__: object) -> Measured:
        tried.append(splats)
        return point(splats, 30.0 if splats < 500 else 40.0)

    monkeypatch.setattr(effects, "encoded", encoded)
    assert as_good([], 33.0, None).psnr in (30.0, 40.0)
    assert len(tried) <= MAX_TRIES
