"""Weights w are learnt only for pruning: where nothing is pruned, no splat may keep one that hides it."""

import numpy as np
import pytest
from codec_cases import waves

from gsvc_ref.encoder import Settings
from gsvc_ref.encoder.blocks import block_errors
from gsvc_ref.encoder.frame import FrameEncoder
from gsvc_ref.encoder.log import FrameLog
from gsvc_ref.encoder.prediction import Past, PFrame, predict
from gsvc_ref.rendering import Objective
from gsvc_ref.training import random_splats, uniform_numbers
from gsvc_ref.training.coarse import Sizes


@pytest.mark.parametrize(("effects", "visible"), [("all,gsp=off", True), ("all,gsp=auto", True), ("all", False)])
def test_a_random_start_is_visible_where_nothing_is_pruned(effects, visible):
    settings = Settings.paper(splats=60, iterations=1, threads=1, effects=effects)
    encoded = FrameEncoder(settings, 32, 24, 8).encode(waves(frames=1)[0], "I", 0, lambda *_: None)
    assert (encoded.state.splats.colors.mean() > 0.3) == visible


def test_new_splats_are_faint_but_not_held_back_where_nothing_is_pruned():
    settings = Settings.paper(splats=60, threads=1, effects="all,gsp=off")
    picture = waves(frames=1)[0].astype(np.float32) / np.float32(255)
    objective = Objective(picture, 1)
    rng = np.random.default_rng(0)
    reference = random_splats(uniform_numbers(50, rng), 32, 24)
    objective.loss(reference.to_array())
    left = block_errors(objective.residual())
    past = Past(picture, left, float(left.sum()))
    frame = PFrame(settings, picture, objective, reference, past, 60, 70, rng, Sizes(picture, 1))
    population = predict(frame, FrameLog()).population
    assert len(population) == 56
    assert (population.weights == 1).all()
    assert population.parameters()[50:, 5:8].max() <= 0.01
