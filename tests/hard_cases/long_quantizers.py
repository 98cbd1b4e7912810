"""Quantisers that are trained for thousands of steps: a scale that is pulled below 0, and averages of codebooks."""

from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gsvc_ref.paper import Kept, LsqParameters, RvqSettings, RvqState, rvq_training
from gsvc_ref.training import Adan, BlockSettings
from gsvc_ref.training.block_quantizer import BlockQuantizer, Learned

F4 = NDArray[np.float32]
F8 = NDArray[np.float64]

RATE: Final = 0.01
DOWN: Final = 4000
"""Steps that pull the scale down, to 2^-24 from 0.05 and on: by half the rate, since its gradient shrinks with it."""
UP: Final = 300

UPDATES: Final = 5000
RVQ: Final = RvqSettings((3,), decay=0.999, dead_count=0.0)
VECTORS: Final = np.array([[0.1, 0.2, 0.3], [0.7, 0.1, 0.9], [0.7, 0.2, 0.9], [0.3, 0.3, 0.3]], np.float32)
CHOSEN: Final = np.array([[0], [1], [1], [0]], np.uint16)


@cache
def scales() -> F4:
    """A learned scale before and after each step, (DOWN + UP + 1, 3) f4.

    All values lie above the range of codes, so that the scale's gradient is p times theirs; it turns round at last.
    """
    values = np.random.default_rng(0).uniform(10, 20, (8, 8)).astype(np.float32)
    size = np.array([16, 12], np.float32)
    kept = Kept(codebooks=(np.zeros((1, 3), np.float16),))  # no codebooks to learn
    block = BlockQuantizer(values, None, None, size, BlockSettings(quantizer_rate=RATE), np.random.default_rng(1), kept)
    start = LsqParameters(np.full(3, 0.05, np.float32), np.zeros(3, np.float32))
    block.learned = Learned(start, block.rvq)
    decoded = np.empty_like(values)
    path = [block.lsq.scale]
    for step in range(DOWN + UP):
        gradient = np.full_like(values, 1 if step < DOWN else -1)
        done = block.forward(values, decoded)
        block.backward(done, gradient)
        block.learn(done, 1.0)
        path.append(block.lsq.scale)
    return np.stack(path)


def scale_learned_itself() -> F4:
    """The scale when Adan moves it and not its logarithm, after DOWN steps, (3,) f4."""
    state, scale = Adan(1, 3), np.full((1, 3), 0.05, np.float32)
    for _ in range(DOWN):
        state.step(scale, np.ones((1, 3), np.float32), RATE)
    return np.asarray(scale[0])


def begun() -> RvqState:
    """Codebooks whose averages are far from where they will go."""
    book = np.array([[0, 0, 0], [1, 1, 1], [0.5, 0.5, 0.5]], np.float32)
    return RvqState((book,), (np.array([100.0, 7.0, 3.0]),), (100 * book.astype(np.float64),))


@cache
def averages() -> tuple[F8, F8]:
    """Counts (3,) and sums (3, 3) after UPDATES updates by the same vectors."""
    state = begun()
    for _ in range(UPDATES):
        state = rvq_training.update(state, VECTORS, CHOSEN, RVQ, np.random.default_rng(2))
    return state.counts[0], state.sums[0]


def averages_in_binary32() -> tuple[F4, F4]:
    """The averages in binary32, with decay and its complement rounded each for itself."""
    a, rest = np.float32(RVQ.decay), np.float32(1 - RVQ.decay)
    state = begun()
    counts, sums = state.counts[0].astype(np.float32), state.sums[0].astype(np.float32)
    users = CHOSEN[:, 0][None, :] == np.arange(3)[:, None]
    batch_counts, batch_sums = users.sum(1).astype(np.float32), (users[..., None] * VECTORS).sum(1, dtype=np.float32)
    for _ in range(UPDATES):
        counts, sums = a * counts + rest * batch_counts, a * sums + rest * batch_sums
    return counts, sums
