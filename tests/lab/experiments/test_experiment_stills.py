"""The experiments on one picture: splats, iterations, pruning."""

import numpy as np
import pytest

from gsvc_lab.experiments import iterations, pruning, splats
from gsvc_lab.experiments.change import Change
from gsvc_lab.experiments.detail import detail, places, ranks
from gsvc_lab.experiments.fitting import Picture, Quality, pruned_to
from gsvc_ref.encoder.settings import Settings

matplotlib = pytest.importorskip("matplotlib", reason="figures are drawn by matplotlib")

NOTHING = np.zeros((1, 1, 3), np.uint8)


def fits(*qualities):
    return [splats.Fit(10**n, 10**n, 1, Quality(*pair), NOTHING) for n, pair in enumerate(qualities)]


def test_splats_in_a_tiny_version(tiny, quiet):
    found = splats.measure(tiny, (4, 40), 60, quiet)
    assert [[fit.left for fit in found[name]] for name in ("paper", "quick")] == [[4, 40], [4, 40]]
    assert found["quick"][1].quality.psnr > found["quick"][0].quality.psnr + 1
    assert found["paper"][0].frame.shape == (24, 32, 3)
    assert len(splats.table(found).rows) == 4
    for name in splats.draw(tiny, found, quiet):
        assert (quiet.folder / f"{name}.svg").is_file()


def test_the_verdict_on_splats():
    rising, falling = fits((20, 0.5), (30, 0.9)), fits((20, 0.5), (30, 0.4))
    assert splats.verdict({"paper": rising, "quick": rising}).holds == "yes"
    partly = splats.verdict({"paper": falling, "quick": rising})
    assert partly.holds == "partly"
    assert "only with start and schedule of quick" in partly.sentence
    assert splats.verdict({"paper": falling, "quick": falling}).holds == "no"


def test_reach_is_the_sum_of_the_steps():
    assert splats.reach(2000) == pytest.approx(2)
    assert splats.reach(50_000) == pytest.approx(20 + 10 + 2.5)


def test_iterations_in_a_tiny_version(tiny, quiet):
    picture = Picture(tiny.frame, 1)
    long = iterations.PaperRun(picture, Settings.paper().intra, 30, (10, 40), quiet)
    assert [(m.iterations, m.splats) for m in long.moments] == [(10, 33), (40, 30)]
    assert long.converged is None
    quick = iterations.quick_moments(picture, 30, (5, 20), quiet)
    assert quick[1].quality.psnr > quick[0].quality.psnr
    assert len(iterations.table(long.moments, quick).rows) == 4
    for name in iterations.draw(tiny, long.moments, quick, quiet):
        assert (quiet.folder / f"{name}.svg").is_file()


def moments(*qualities):
    return [iterations.Moment(10**n, 5, Quality(*pair), NOTHING) for n, pair in enumerate(qualities)]


def test_the_verdict_on_iterations():
    quick = moments((25, 0.8), (31, 0.9))
    yes = iterations.verdict(moments((20, 0.5), (30, 0.9)), quick)
    assert yes.holds == "yes"
    assert "as good after 10 iterations (31.0 dB)" in yes.sentence
    partly = iterations.verdict(moments((20, 0.9), (35, 0.5)), quick)
    assert (partly.holds, "Only PSNR rises" in partly.sentence) == ("partly", True)
    assert "stay below that, at 31.0 dB" in partly.sentence
    assert iterations.verdict(moments((20, 0.9), (10, 0.5)), quick).holds == "no"


def test_pruning_in_a_tiny_version(tiny, quiet, monkeypatch):
    monkeypatch.setattr(pruning, "splat_count", lambda width, height: 36)
    found = pruning.measure([tiny], 30, (0, 1), quiet)
    assert {way: [len(one.splats) for one in row] for way, row in found.items()} == {
        way: [36, 36] for way in pruning.WAYS
    }
    assert len(pruning.table(found).rows) == 6
    for name in pruning.draw([tiny], found, quiet):
        assert (quiet.folder / f"{name}.svg").is_file()
    change = pruning.changes(found)
    means = [np.mean([one.quality.psnr for one in found[way]]) for way in ("without", "with")]
    assert change["psnr"].mean == pytest.approx(means[1] - means[0])


def test_as_many_splats_for_each_pixel_as_in_the_paper():
    assert pruning.splat_count(1920, 1080) == 45_000
    assert pruned_to(45_000, Settings.paper().intra) == 50_000
    assert pruned_to(45_000, pruning.way_settings("without", 10)) == 45_000


def test_a_change_is_clear_beyond_twice_its_error():
    assert Change.of([1, 2, 3], [2, 3, 4]) == Change(1.0, 0.0, 3)
    spread = Change.of([0, 0], [0, 2])
    assert (spread.mean, spread.error, spread.pairs) == (1.0, pytest.approx(1.0), 2)
    assert not spread.raises
    assert (Change(0.5, 0.2, 9).raises, Change(0.5, 0.2, 9).lowers) == (True, False)
    assert (Change(-0.5, 0.2, 9).raises, Change(-0.5, 0.2, 9).lowers) == (False, True)
    assert Change(0.5, 0.2, 9).text(1, " dB") == "+0.5 ± 0.2 dB"


def test_one_pair_tells_nothing_about_chance():
    alone = Change.of([1], [2])
    assert (alone.mean, alone.error, alone.raises, alone.lowers) == (1, None, False, False)
    assert alone.text(1, " dB") == "+1.0 dB"


@pytest.mark.parametrize(
    ("rank", "detail_psnr", "holds"),
    [(0.1, 0.5, "yes"), (0.1, -0.5, "partly"), (0.0, 0.5, "partly"), (-0.1, 0, "no"), (0, 0, "cannot be compared")],
)
def test_the_verdict_on_pruning(rank, detail_psnr, holds):
    change = {name: Change(value, 0.01, 9) for name, value in
              {"mean_rank": rank, "psnr": 0.0, "detail_psnr": detail_psnr}.items()}  # fmt: skip
    verdict = pruning.verdict(change, Change(0, 0, 9))
    assert verdict.holds == holds
    assert "over 9 pairs" in verdict.sentence


def test_detail_is_where_the_picture_changes(tiny):
    values = detail(tiny.frame / 255, 1.0)
    assert values[:, 20:].min() > 10 * values[:, :10].max()
    rank = ranks(values)
    assert rank[:, 20:].min() > rank[:, :10].max()
    assert rank.mean() == pytest.approx(0.5)


def test_places_of_centres():
    rank = ranks(np.arange(100.0).reshape(10, 10))
    everywhere = np.stack(np.meshgrid(np.arange(10) + 0.5, np.arange(10) + 0.5), axis=-1).reshape(-1, 2)
    even = places(everywhere, rank)
    assert even.mean_rank == pytest.approx(0.5)
    assert even.density == pytest.approx((1,) * 10)
    assert even.divergence == pytest.approx(0)
    last = places(np.array([[3.0, 9.9], [5, 9.5], [-1, 0], [3, 10]], np.float32), rank)
    assert last.density == (0,) * 9 + (10,)
    assert (last.divergence, last.outside) == (pytest.approx(np.log2(10)), 0.5)
    assert last.mean_rank > 0.9
