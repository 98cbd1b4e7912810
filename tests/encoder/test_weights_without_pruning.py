"""Weights w are learnt only for pruning: where nothing is pruned, no splat may keep one that hides it."""

from dataclasses import replace

import pytest
from codec_cases import waves

from gsvc_ref.encoder import Settings, paper
from gsvc_ref.encoder.paper import FrameEncoder


@pytest.mark.parametrize(("effects", "visible"), [("all,gsp=off", True), ("all,gsp=auto", True), ("all", False)])
def test_a_random_start_is_visible_where_nothing_is_pruned(effects, visible):
    settings = Settings.paper(splats=60, iterations=1, threads=1, effects=effects)
    encoded = FrameEncoder(settings, 32, 24, 8).encode(waves(frames=1)[0], "I", 0, lambda *_: None)
    assert (encoded.state.splats.colors.mean() > 0.3) == visible


def test_new_splats_are_faint_but_not_held_back_where_nothing_is_pruned():
    settings = Settings.paper(splats=60, iterations=1, threads=1, effects="all,gsp=off")
    settings = replace(settings, splats=50, inter=replace(settings.inter, new_fraction=0.12))
    frames, encoder = waves(frames=2), FrameEncoder(settings, 32, 24, 8)
    encoder.encode(frames[0], "I", 0, lambda *_: None)
    encoder.most = 70
    work = paper._PaperFrame(encoder, frames[1], 1, lambda *_: None)
    work._fitted = lambda population, settings: population
    population = work._fitted_inter(50)
    assert len(population) == 56
    assert (population.weights == 1).all()
    assert population.parameters()[50:, 5:8].max() <= 0.01
