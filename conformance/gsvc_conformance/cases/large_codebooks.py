"""Vectors of many colours, many codewords and many users of one codeword, for residual vector quantisation."""

from typing import Final

import numpy as np

from gsvc_base.draws import Draws
from gsvc_conformance.case import Inputs, case
from gsvc_conformance.cases import CAPACITY
from gsvc_conformance.cases.codebooks import update_inputs
from gsvc_conformance.cases.large_rows import BOOKS, EDGES, FLAGS, PERIOD, ROWS, repeated
from gsvc_conformance.cases.rvq import assigned, clear_vectors, codebooks
from gsvc_conformance.cases.training import f4
from gsvc_conformance.operation import Values

FEW: Final = 41
"""Vectors where there are many codewords."""

PAIRS: Final = ((5, 37), (64, 95), (127, 128), (225, 768), (31, 999))
"""Codewords that are made equal: in neighbouring warps and far apart."""


def large_codebooks(rng: Draws) -> Values:
    """Eight codebooks of 1,024 codewords, whole numbers, so that no distance is rounded.

    In each, the last 20 are unlike all others, and most others come again, in other warps and blocks.
    """
    rows = repeated(rng.integers(-40, 41, (PERIOD, 3)).astype(np.float32), sum(BOOKS))
    for first in range(0, sum(BOOKS), 1024):
        most = 9 if first else 90  # what is left for later stages is small
        rows[first + 1004 : first + 1024] = rng.integers(-most, most + 1, (20, 3))
        for lower, higher in PAIRS:
            rows[first + higher] = rows[first + lower]
    return {"codebook_sizes": np.array(BOOKS, np.int64), "codebooks": rows}


@case("stress", "rvq_assign", flags=FLAGS)
def many_colours(rng: Draws) -> Inputs:
    """70,001 colours in two stages; those at the borders of blocks lie far from all others."""
    books = codebooks(rng, [8, 5])
    x = repeated(clear_vectors(rng, PERIOD, books))
    books["codebooks"][7] = 64, -64, 64
    x[EDGES] = books["codebooks"][7] + books["codebooks"][12]
    expected = yield {"x": x, **books}
    assert np.all(expected["indices"].value[EDGES] == [7, 4])


@case("stress", "rvq_assign", flags=[CAPACITY, "ties"])
def many_codewords(rng: Draws) -> Inputs:
    """Eight stages of 1,024 codewords, some twice in other warps: of equal ones the lower index is taken."""
    books = large_codebooks(rng)
    first = books["codebooks"][:1024]
    x = rng.integers(-60, 61, (FEW, 3)).astype(np.float32)
    x[: len(PAIRS)] = [first[lower] for lower, _ in PAIRS]
    x[len(PAIRS) :][:20] = first[1004:]
    expected = yield {"x": x, **books}
    indices = expected["indices"].value
    assert indices[: len(PAIRS), 0].tolist() == [lower for lower, _ in PAIRS]
    assert indices[:, 0].tolist()[len(PAIRS) :][:20] == list(range(1004, 1024))
    assert (indices.max(axis=0) > 1003).all()


@case("stress", "rvq_update", flags=FLAGS)
def many_users(rng: Draws) -> Inputs:
    """70,001 colours, nearly all of which use one codeword: more users than 16 bits count."""
    inputs = update_inputs(rng, PERIOD, [4, 3])
    for name in ("x", "indices"):
        inputs[name] = repeated(inputs[name])
    inputs["indices"][np.arange(ROWS) % PERIOD > 10, 0] = 2
    inputs["x"][EDGES] = 4096, 8192, 4096
    expected = yield inputs
    users = np.count_nonzero(inputs["indices"][:, 0] == 2)
    assert users > 66_000
    assert np.isclose(expected["counts"].value[2], 0.8 * inputs["counts"][2] + 0.2 * users)


@case("stress", "rvq_update", flags=[*FLAGS, "dead"])
def draw_of_one_in_many() -> Inputs:
    """A dead codeword is replaced by the 69,998th of 70,001 colours, the one that is met worst by far."""
    x = np.zeros((ROWS, 3), np.float32)
    x[:, 0] = np.resize([0.125, 0.25, 0.0], ROWS)
    x[69_997] = 1024, 2048, -512
    expected = yield {
        "x": x, "indices": np.zeros((ROWS, 1), np.uint16), "codebook_sizes": np.array([2], np.int64),
        "codebooks": f4([0, 0, 0], [64, 64, 64]), "counts": np.array([8.0, 0.25]), "sums": np.zeros((2, 3)),
        "uniforms": np.array([0.5]), "decay": 0.5, "smoothing": 0.0, "dead_count": 0.5,
    }  # fmt: skip
    assert expected["codebooks"].value[1].tolist() == [1024, 2048, -512]


@case("stress", "rvq_update", flags=[CAPACITY, "dead"])
def many_dead_codewords(rng: Draws) -> Inputs:
    """Eight stages of 1,024 codewords, of which 56 are used: all others are dead, and each is replaced by a draw.

    The uniform numbers lie in the middle of a colour's part of the errors, those of the first stage alike.
    """
    books = large_codebooks(rng)
    x = rng.integers(-60, 61, (FEW, 3)).astype(np.float32)
    indices = np.tile((np.arange(FEW) % 7 * 146 + 3).astype(np.uint16)[:, None], (1, 8))
    counts = np.full(8192, 0.25)
    used = np.unique(indices.astype(np.int64) + 1024 * np.arange(8))
    counts[used] = 4.0
    expected = yield {
        "x": x, "indices": indices, **books, "counts": counts,
        "sums": books["codebooks"] * counts[:, None], "uniforms": np.resize([0.13, 0.42, 0.71, 0.98], 8192 - len(used)),
        "decay": 0.8, "smoothing": 1e-5, "dead_count": 0.5,
    }  # fmt: skip
    assert np.count_nonzero(expected["counts"].value == 1) == 8192 - len(used)


@case("stress", "commitment", flags=FLAGS)
def commitment_of_many(rng: Draws) -> Inputs:
    """70,001 colours in two stages; 15 of them, at the borders of blocks, make nearly all of the loss."""
    inputs = assigned(rng, PERIOD, [8, 5])
    for name in ("x", "indices"):
        inputs[name] = repeated(inputs[name])
    inputs["x"][EDGES] = 300, -200, 100
    expected = yield inputs
    assert expected["loss"].value > 8


@case("stress", "commitment", flags=[CAPACITY])
def commitment_of_many_codewords(rng: Draws) -> Inputs:
    """41 colours and eight stages of 1,024 codewords, of which the last are used as well as the first."""
    books = large_codebooks(rng)
    x = rng.normal(0, 40, (FEW, 3)).astype(np.float32)
    indices = rng.integers(0, 1024, (FEW, 8)).astype(np.uint16)
    indices[0] = 1023
    expected = yield {"x": x, "indices": indices, **books}
    assert expected["loss"].value > 0
