"""Codes refuse what has no meaning, and compare bit by bit."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gsvc_base.errors import UsageError
from gsvc_ref.paper import FrameCodes, Quantizer, SplatBlock
from gsvc_ref.testing import rich_frames

INTRA = rich_frames()[0].intra
assert INTRA is not None
TWO = np.ones(2, np.bool_)


@pytest.mark.parametrize(
    "changes",
    [
        {"positions": np.zeros((3, 3), np.uint16)},
        {"positions": np.zeros((3, 2), np.uint8)},
        {"positions": np.zeros((3, 2), np.uint16)},
        {"cholesky": np.zeros(60, np.uint16)},
        {"colors": np.zeros((60, 2), np.int64)},
        {"codebooks": (np.zeros((3, 3), np.float32),)},
        {"codebooks": (np.zeros((3, 2), np.float16),)},
    ],
)
def test_blocks_of_wrong_shape_or_type(changes: dict[str, Any]) -> None:
    with pytest.raises(UsageError):
        replace(INTRA, **changes)


def test_quantizers_have_three_channels() -> None:
    with pytest.raises(UsageError, match=r"Quantizer\.offset"):
        Quantizer(np.ones(3), np.ones(2))


@pytest.mark.parametrize(
    "make",
    [
        lambda: FrameCodes("B"),  # type: ignore[arg-type]
        lambda: FrameCodes("P"),
        lambda: FrameCodes("I", survivors=TWO),
        lambda: FrameCodes("I", inter=SplatBlock()),
        lambda: FrameCodes("R", intra=INTRA),
        lambda: FrameCodes("I", intra=SplatBlock()),
        lambda: FrameCodes.predicted_frame(TWO, None),
        lambda: FrameCodes.predicted_frame(~TWO, SplatBlock()),
        lambda: FrameCodes.predicted_frame(TWO, INTRA),
        lambda: FrameCodes.predicted_frame(np.ones(2), SplatBlock()),
        lambda: FrameCodes.predicted_frame(np.ones((1, 2), np.bool_), SplatBlock()),
    ],
)
def test_frames_that_contradict_themselves(make: Any) -> None:
    with pytest.raises(UsageError):
        make()


def test_counts() -> None:
    intra, predicted, repeated, *_ = rich_frames()
    assert [f.survivor_count for f in (intra, predicted, repeated)] == [0, 40, 0]
    assert [f.intra_count for f in (intra, predicted, repeated)] == [60, 2, 0]
    nothing = SplatBlock(np.zeros((0, 2), np.uint16), np.zeros((0, 3), np.uint16), np.zeros((0, 2), np.uint16))
    assert FrameCodes.intra_frame(nothing) == FrameCodes.intra_frame(None)


def test_equality_is_of_bits() -> None:
    assert rich_frames() == rich_frames()
    assert INTRA.quantizer is not None
    assert INTRA.codebooks is not None
    zero = Quantizer(np.ones(3), np.zeros(3))
    assert zero != Quantizer(np.ones(3), -np.zeros(3))
    books = (*INTRA.codebooks[:1], -INTRA.codebooks[1])
    for changed in (
        replace(INTRA, quantizer=None),
        replace(INTRA, quantizer=zero),
        replace(INTRA, codebooks=None),
        replace(INTRA, codebooks=books),
        replace(INTRA, codebooks=books[:1]),
        replace(INTRA, positions=INTRA.cholesky[:, :2]),
    ):
        assert changed != INTRA
    assert FrameCodes.repeated_frame() != FrameCodes.intra_frame(None)
