"""Cut streams and flipped bits: all complete frames, then the error that spec.md section 12 demands.

Here a part of all truncations and flips of the core streams is tried; ``python -m tests.hostile damage`` tries all.
"""

import pytest

from gsvc_base.errors import GsvcError
from gsvc_ref.stream import StreamReader
from gsvc_ref.testing import OVERVIEW_HEADER, overview_frames, write_stream
from tests.hostile.damage import LibraryDecoder, SpecDecoder, core_streams, damages, said

STEP = 23
"""Of so many damages one is tried; a prime, so that every bit of a byte has its turn."""

SPEC_STEP = 197


@pytest.mark.parametrize("name", core_streams())
def test_library(name: str) -> None:
    data = core_streams()[name]
    decoder = LibraryDecoder(data)
    for damage in damages(data, STEP, first=len(data) % STEP):
        assert decoder.outcome(damage.data, damage.offset) == damage.error, damage.name


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", core_streams())
def test_decoder_of_the_spec(name: str) -> None:
    data = core_streams()[name]
    if len(data) < 700:
        decoder = SpecDecoder(data)
        for damage in damages(data, SPEC_STEP, first=len(data) % SPEC_STEP):
            assert decoder.outcome(damage.data, damage.offset) == damage.error, damage.name


def test_whole_decodes_agree() -> None:
    """What begins at the damaged chunk stands for a decode of all: same frames before the fault, same error."""
    data = write_stream(OVERVIEW_HEADER, overview_frames())
    decoder = LibraryDecoder(data)
    frames, error = whole_decode(data)
    assert (len(frames), error, frames) == (3, "", decoder.frames)
    for damage in damages(data):
        frames, error = whole_decode(damage.data)
        assert error == damage.error == decoder.outcome(damage.data, damage.offset), damage.name
        complete = 3 if error == "" else decoder.frames_before(damage.offset)
        assert frames == decoder.frames[:complete], damage.name


def whole_decode(data: bytes) -> tuple[list[bytes], str]:
    frames = []
    try:
        for frame in StreamReader(data):
            frames.append(frame.splats.tobytes())
    except GsvcError as error:
        return frames, said(error)
    return frames, ""
