"""That a setting changes what it says and nothing else."""

from dataclasses import fields, is_dataclass, replace

import numba
import numpy as np
import pytest

from gsvc_base.errors import UsageError
from gsvc_lab.accuracy.groups import ENCODING, GROUP_NAMES, GROUPS, check_names, thread_counts
from gsvc_lab.accuracy.sources import scene_source
from gsvc_lab.accuracy.work import QUICK_FIT, Coding, Rendering, SourcePicture, Training
from gsvc_ref.encoder.initialization import image_start
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.rendering import PRECISIONS
from gsvc_ref.training import NEW, FitSettings, Population, fine_tune

JIT = not numba.config.DISABLE_JIT

VARIED = {
    "precision": {"precision"},
    "threads": {"threads"},
    "cutoff": {"cutoff"},
    "position": {"position_bits"},
    "cholesky": {"cholesky_bits"},
    "color": {"stages", "codewords"},
    "gradients": {"precision"},
    "splats": {"pixels_per_splat"},
    "iterations": {"fit.iterations", "fit.schedule.steps"},
    "start": {"start"},
    "rates": {"fit.rates.position", "fit.rates.cholesky", "fit.rates.color", "fit.rates.weight", "fit.schedule",
              "fit.learn_pixels", "fit.relative_steps"},
}  # fmt: skip
"""What each group varies, as the paths of the fields that its settings may differ in."""


def differences(a, b, path=""):
    """The paths of the fields in which two values differ."""
    if type(a) is not type(b) or not is_dataclass(a):
        return set() if a == b else {path}
    found = set()
    for field in fields(a):
        found |= differences(getattr(a, field.name), getattr(b, field.name), f"{path}.{field.name}".lstrip("."))
    return found


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: group.name)
def test_settings_of_a_group_differ_in_one_thing(group):
    names = [setting.name for setting in group.settings]
    assert len(set(names)) == len(names) >= 2
    assert sum(setting.base for setting in group.settings) == 1
    first, *others = [setting.work for setting in group.settings]
    assert len({first, *others}) == len(names)
    for work in others:
        assert differences(first, work) <= VARIED[group.name]
        assert differences(first, work)


def test_every_precision_is_measured():
    assert [setting.work for setting in GROUPS[0].settings] == [Rendering(precision) for precision in PRECISIONS]


@pytest.mark.parametrize(("most", "counts"), [(1, (1, 2)), (2, (1, 2)), (6, (1, 2, 4, 6)), (8, (1, 2, 4, 8))])
def test_threads_go_up_to_all_processors(monkeypatch, most, counts):
    monkeypatch.setattr("gsvc_lab.accuracy.groups.processors", lambda: most)
    assert thread_counts() == counts


@pytest.mark.parametrize("group", [group for group in GROUPS if group.kind == "training"], ids=lambda group: group.name)
def test_the_setting_called_quick_is_the_preset(group):
    quick = [setting.work for setting in group.settings if setting.usual == "quick"]
    assert quick == [Training()]
    assert Training().fit == QUICK_FIT  # by Adan, whose parts the groups compare


@pytest.mark.parametrize("coding", [Coding(), Coding(position_bits=9), Coding(cholesky_bits=5), Coding(stages=2)])
def test_coding_is_that_of_the_preset_but_for_its_quantisers(coding):
    changed = differences(Settings.quick(profile="paper"), coding.settings(40, 30))
    assert changed == {
        "intra.quantizer.position_step", "intra.quantizer.cholesky_bits", "inter.quantizer.cholesky_bits",
        "intra.quantizer.colors.codewords",
    }  # fmt: skip


@pytest.fixture(scope="module")
def picture():
    rows, columns = (64, 80) if JIT else (20, 24)  # interpreted kernels are slow
    return SourcePicture(scene_source("chelsea").picture[100 : 100 + rows, 200 : 200 + columns])


@pytest.mark.parametrize("bits", [6, 9])
def test_positions_have_the_bits_that_the_setting_says(picture, bits):
    _, state, size = Coding(position_bits=bits).run(picture, 0)
    half = np.array([picture.width / 2, picture.height / 2])
    steps = (state.splats.positions.astype(np.float64) / half - 1) * 2 ** (bits - 1)
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-3)
    finer = np.rint(steps) % 2
    assert finer.any()  # and not fewer
    assert size > 0


def test_coarser_settings_cost_fewer_bytes(monkeypatch):
    def untuned(values, quantizer, objective, settings):
        return fine_tune(values, quantizer, objective, replace(settings, iterations=0))

    monkeypatch.setattr("gsvc_lab.accuracy.work.fine_tune", untuned)
    picture = SourcePicture(scene_source("chelsea").picture[100:164, 200:280])
    splats = image_start(picture.picture, 300, np.random.default_rng(0))
    picture.population = Population(splats, 1.0, np.full(300, NEW))
    usual = Coding().run(picture, 0)[2]
    for coarser in (Coding(position_bits=7), Coding(cholesky_bits=4), Coding(stages=1)):
        assert coarser.run(picture, 0)[2] < usual


def test_fewer_cholesky_bits_leave_positions_and_colours_to_the_same_quantisers(picture):
    coarse, fine = (Coding(cholesky_bits=bits).run(picture, 0)[0].intra for bits in (4, 12))
    assert coarse.cholesky.max() < 16 <= fine.cholesky.max()
    assert len(coarse.codebooks) == len(fine.codebooks) == 3
    assert [len(book) for book in coarse.codebooks] == [len(book) for book in fine.codebooks]


def test_seeds_give_other_splats_and_the_same_seed_the_same(picture):
    first, again, other = (Training().run(picture, seed).splats() for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_a_random_start_begins_dark(picture):
    start = Training(start="random", growth=None, fit=FitSettings(iterations=0, pruning=None)).run(picture, 0)
    assert abs(start.parameters()[:, 5:8]).max() < 0.01
    assert len(start) == picture.width * picture.height // 40


def test_names():
    check_names(GROUP_NAMES)
    assert GROUP_NAMES[-1] == ENCODING
    with pytest.raises(UsageError, match="'speed'; there are precision, threads"):
        check_names(("cutoff", "speed"))
    with pytest.raises(UsageError, match="no group"):
        check_names(())
