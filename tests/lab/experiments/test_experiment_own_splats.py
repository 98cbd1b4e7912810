"""Splats of a trainer as a stream: the least quality with the loss that is allowed, and the must."""

import pytest

from gsvc_lab.experiments import own_splats
from gsvc_lab.experiments.material import stills
from gsvc_lab.experiments.own_splats import Written, measure, verdict


@pytest.mark.parametrize(("bits", "holds"), [(44.9, "yes"), (45.1, "no")])
def test_the_must_is_about_photographs_at_their_own_size(bits, holds):
    found = [
        Written("a", (60, 40), 30.0, "main, all", 20, 0.3, bits),
        Written("a", (6, 4), 30.0, "main, all", 20, 0.3, 99.0),
    ]
    assert verdict([*found, Written("a", (60, 40), 30.0, "main, none", 20, 0.3, 99.0)]).holds == holds


def test_profile_main_takes_half_of_the_bits_at_the_loss_that_is_allowed(quiet, monkeypatch):
    monkeypatch.setattr(own_splats, "COUNT", 100)
    monkeypatch.setattr(own_splats, "ITERATIONS", 60)
    (still,) = stills(quiet, ("coffee",), 72, 48)
    paper, none, _, refitted = measure(still, quiet)
    assert paper.quality is None
    assert max(none.loss, refitted.loss) <= own_splats.MOST_LOSS
    assert refitted.bits <= none.bits
    assert refitted.bits < 0.6 * paper.bits
