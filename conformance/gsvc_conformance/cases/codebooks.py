"""Cases of codebook updates: moving averages, and what replaces dead codewords."""

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases.rvq import assigned
from gsvc_conformance.cases.training import f4
from gsvc_conformance.operation import Values


def update_inputs(rng: Draws, count: int, sizes: list[int], **settings: float) -> Values:
    """A state whose averages belong roughly to its codebooks, and a batch of vectors; no codeword is dead."""
    inputs = assigned(rng, count, sizes)
    counts = rng.uniform(2, 9, sum(sizes))
    sums = (inputs["codebooks"] + 0.1 * rng.normal(size=(sum(sizes), 3))) * counts[:, None]
    return {
        **inputs, "counts": counts, "sums": sums, "uniforms": np.zeros(0), "decay": 0.8, "smoothing": 1e-5,
        "dead_count": 0.5, **settings,
    }  # fmt: skip


@case("core", "rvq_update", flags=["stages"], each={"one_stage": [8], "three_stages": [5, 3, 6]})
def averages_of_a_batch(rng: Draws, value: list[int]) -> Inputs:
    """The authors' settings, no codeword dead, {key}: every stage averages what reaches it, with counts of its own."""
    inputs = update_inputs(rng, 40, value)
    expected = yield inputs
    first = inputs["indices"][:, 0] == 0
    assert np.isclose(expected["counts"].value[0], 0.8 * inputs["counts"][0] + 0.2 * first.sum())
    sums = 0.8 * inputs["sums"][0] + 0.2 * inputs["x"][first].astype(np.float64).sum(0)
    assert np.allclose(expected["sums"].value[0], sums, rtol=1e-12)


@case("core", "rvq_update", flags=["smoothing"])
def smoothing_that_matters(rng: Draws) -> Inputs:
    """A smoothing of a quarter of a splat, two stages: counts are smoothed over those of their own stage.

    Without smoothing, with the counts of both stages, or without the factor n, codewords are off by more than 1 %.
    """
    inputs = update_inputs(rng, 24, [4, 7], smoothing=0.25)
    expected = yield inputs
    counts = expected["counts"].value[:4]
    smoothed = (counts + 0.25) / (counts.sum() + 1) * counts.sum()
    assert np.allclose(expected["codebooks"].value[:4], expected["sums"].value[:4] / smoothed[:, None], rtol=1e-3)


@case("core", "rvq_update", flags=["factor"])
def averages_by_hand() -> Inputs:
    """One stage in small numbers with a decay of 3/4: counts 4 and 2 with 2 and 6 users become 3.5 and 3."""
    x = f4([1, 0, 0], [3, 0, 0], *[[8, 4, 0]] * 6)
    expected = yield {
        "x": x, "indices": np.array([[0]] * 2 + [[1]] * 6, np.uint16), "codebook_sizes": np.array([2], np.int64),
        "codebooks": f4([1, 0, 0], [8, 8, 0]), "counts": np.array([4.0, 2.0]),
        "sums": np.array([[8.0, 0, 0], [16, 16, 0]]), "uniforms": np.zeros(0), "decay": 0.75, "smoothing": 0.0,
        "dead_count": 0.5,
    }  # fmt: skip
    assert expected["counts"].value.tolist() == [3.5, 3]
    assert expected["sums"].value.tolist() == [[7, 0, 0], [24, 18, 0]]
    assert expected["codebooks"].value.tolist() == [[2, 0, 0], [8, 6, 0]]


@case("core", "rvq_update", flags=["ties"])
def codewords_in_binary16(rng: Draws) -> Inputs:
    """Codewords are rounded to binary16 at the end, while counts and sums are not."""
    inputs = update_inputs(rng, 30, [6])
    expected = yield inputs
    books = expected["codebooks"].value
    assert np.array_equal(books, books.astype(np.float16))
    assert np.mean(expected["codebooks"].bound == 0) > 0.9
    assert not np.array_equal(expected["sums"].value, expected["sums"].value.astype(np.float16))


@case("core", "rvq_update", flags=["dead"])
def dead_codewords(rng: Draws) -> Inputs:
    """One dead codeword in the first stage and two in the second, each replaced by a vector of its stage.

    Uniform numbers go to dead codewords in order; what is drawn is the vector that reaches the stage, in proportion to
    the square of what the stage leaves over.
    """
    inputs = with_dead(update_inputs(rng, 30, [6, 5]), [2, 6, 9])
    inputs["uniforms"] = np.array([0.21, 0.93, 0.47])
    expected = yield inputs
    assert np.flatnonzero(expected["counts"].value == 1).tolist() == [2, 6, 9]
    place = np.flatnonzero(np.all(expected["sums"].value[2] == inputs["x"], axis=1))
    assert len(place) == 1


def with_dead(inputs: Values, dead: list[int]) -> Values:
    """The inputs with counts near 0 for codewords that no vector is assigned to any more."""
    stages = np.repeat(np.arange(len(inputs["codebook_sizes"])), inputs["codebook_sizes"])
    firsts = np.cumsum(inputs["codebook_sizes"]) - inputs["codebook_sizes"]
    for place in dead:
        k = stages[place]
        column = inputs["indices"][:, k]
        neighbour = next(b for b in range(inputs["codebook_sizes"][k]) if b + firsts[k] not in dead)
        column[column == place - firsts[k]] = neighbour
    inputs["counts"][dead], inputs["sums"][dead] = 0.3, 0.3 * inputs["codebooks"][dead]
    return inputs


@case("core", "rvq_update", flags=["dead", "ties"])
def draws_in_proportion() -> Inputs:
    """Four vectors that are met with squared errors 0, 1, 4 and 3: draws at 0, 1/8, 21/32 and 7/8 of their sum.

    They hit vectors 1, 2, 3 and 3: never the one that is met exactly, and at a border what lies beyond it. In
    proportion to the error itself they would hit others.
    """
    x = f4([0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 1])
    counts = np.array([8.0, 0.25, 0.25, 0.25, 0.25])
    expected = yield {
        "x": x, "indices": np.zeros((4, 1), np.uint16), "codebook_sizes": np.array([5], np.int64),
        "codebooks": f4([0, 0, 0], *[[64, 64, 64]] * 4), "counts": counts, "sums": np.zeros((5, 3)),
        "uniforms": np.array([0, 0.125, 0.65625, 0.875]), "decay": 0.5, "smoothing": 0.0, "dead_count": 0.5,
    }  # fmt: skip
    assert expected["codebooks"].value[1:].tolist() == x[[1, 2, 3, 3]].tolist()
    assert expected["counts"].value.tolist() == [6, 1, 1, 1, 1]
    assert np.array_equal(expected["sums"].value[1:], x[[1, 2, 3, 3]])


@case("core", "rvq_update", flags=["dead", "stages"])
def draws_by_what_a_stage_leaves() -> Inputs:
    """Two stages, one dead codeword in each, and vectors that each stage meets differently.

    The first stage leaves (1, 0, 0) and (0, 3, 0) and draws the second vector; the second leaves (2, 0, 0) and
    (0, 1, 0) and draws the first, as it was handed on.
    """
    expected = yield {
        "x": f4([5, 0, 0], [4, 3, 0]), "indices": np.zeros((2, 2), np.uint16),
        "codebook_sizes": np.array([2, 3], np.int64),
        "codebooks": f4([4, 0, 0], [9, 9, 9], [-1, 2, 0], [7, 7, 7], [8, 8, 8]),
        "counts": np.array([4.0, 0.25, 4, 4, 0.25]), "sums": np.array([[16.0, 0, 0], *[[1, 1, 1]] * 4]),
        "uniforms": np.array([0.25, 0.5]), "decay": 0.5, "smoothing": 0.0, "dead_count": 0.5,
    }  # fmt: skip
    assert expected["codebooks"].value[[1, 4]].tolist() == [[4, 3, 0], [1, 0, 0]]


@case("core", "rvq_update", flags=["dead", "ties"])
def a_count_at_the_threshold() -> Inputs:
    """A count of exactly `dead_count` after averaging lives; one of half of it dies. 1 before, none now: 1/2."""
    expected = yield {
        "x": f4([4, 0, 0], [4, 1, 0]), "indices": np.zeros((2, 1), np.uint16),
        "codebook_sizes": np.array([3], np.int64), "codebooks": f4([4, 0, 0], [1, 2, 3], [5, 6, 7]),
        "counts": np.array([2.0, 1, 0.5]),
        "sums": np.array([[8.0, 0, 0], [1, 2, 3], [2.5, 3, 3.5]]), "uniforms": np.array([0.5]), "decay": 0.5,
        "smoothing": 0.0, "dead_count": 0.5,
    }  # fmt: skip
    assert expected["counts"].value.tolist() == [2, 0.5, 1]
    assert expected["codebooks"].value.tolist() == [[4, 0.25, 0], [1, 2, 3], [4, 1, 0]]


@case("core", "rvq_update", flags=["dead"])
def every_vector_is_met() -> Inputs:
    """A dead codeword where every vector is met exactly: there is nothing to draw, and it fades instead."""
    expected = yield {
        "x": f4([1, 2, 4], [1, 2, 4]), "indices": np.zeros((2, 1), np.uint16),
        "codebook_sizes": np.array([2], np.int64), "codebooks": f4([1, 2, 4], [8, 0, 0]),
        "counts": np.array([2.0, 0.5]), "sums": np.array([[2.0, 4, 8], [4, 0, 0]]),
        "uniforms": np.array([0.5]), "decay": 0.5, "smoothing": 0.0, "dead_count": 0.5,
    }  # fmt: skip
    assert expected["counts"].value.tolist() == [2, 0.25]
    assert expected["codebooks"].value.tolist() == [[1, 2, 4], [8, 0, 0]]


@case("core", "rvq_update", flags=["smoothing", "dead"])
def codewords_without_users() -> Inputs:
    """Counts of 0 with nothing ever dead: without smoothing the codeword stays, since 0 / 0 is no codeword."""
    expected = yield {
        "x": f4([2, 2, 2]), "indices": np.zeros((1, 1), np.uint16), "codebook_sizes": np.array([2], np.int64),
        "codebooks": f4([2, 2, 2], [3, 2, 1]), "counts": np.array([1.0, 0]), "sums": np.array([[2.0, 2, 2], [0, 0, 0]]),
        "uniforms": np.zeros(0), "decay": 0.75, "smoothing": 0.0, "dead_count": 0.0,
    }  # fmt: skip
    assert expected["codebooks"].value.tolist() == [[2, 2, 2], [3, 2, 1]]


@case("uncommon", "rvq_update", flags=["smoothing"])
def averages_without_memory(rng: Draws) -> Inputs:
    """A decay of 0: counts and sums are those of the batch."""
    inputs = update_inputs(rng, 50, [3], decay=0.0, dead_count=0.0)
    expected = yield inputs
    assert expected["counts"].value.tolist() == np.bincount(inputs["indices"][:, 0], minlength=3).tolist()


@case("core", "rvq_update", flags=["empty"])
def no_splats(rng: Draws) -> Inputs:
    """Without splats nothing changes: averages do not fade, and nothing dies."""
    inputs = update_inputs(rng, 1, [3, 2])
    inputs |= {"x": inputs["x"][:0], "indices": inputs["indices"][:0], "counts": np.full(5, 0.25)}
    expected = yield inputs
    assert np.array_equal(expected["counts"].value, inputs["counts"])
    assert np.array_equal(expected["codebooks"].value, inputs["codebooks"])


@case("stress", "rvq_update", flags=["overflow"])
def large_codewords() -> Inputs:
    """Codewords at the ends of binary16 with large counts: sums reach 1e9 and do not overflow."""
    x = f4(*[[65000, -65000, 64000]] * 3, [-60000, 100, 65000])
    counts = np.array([5000.0, 20_000.0])
    rows = f4([65024, -65024, 64000], [-60000, 0, 65024])
    expected = yield {
        "x": x, "indices": np.array([[0], [0], [0], [1]], np.uint16), "codebook_sizes": np.array([2], np.int64),
        "codebooks": rows, "counts": counts, "sums": counts[:, None] * rows.astype(np.float64),
        "uniforms": np.zeros(0), "decay": 0.8, "smoothing": 1e-5, "dead_count": 0.5,
    }  # fmt: skip
    assert np.all(abs(expected["codebooks"].value) <= 65504)
