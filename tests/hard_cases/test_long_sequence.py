"""Ten thousand frames: the decoder has the encoder's bits to the last one, in constant memory."""

import gc
import tracemalloc
from itertools import islice

import numpy as np
import pytest

from gsvc_conformance.spec import namespace
from gsvc_ref.stream import StreamReader, StreamWriter, decode
from tests.hard_cases.long_sequence import FRAMES, HEADER, HEIGHT, SPLATS, WIDTH, closed_loop, decoded, source


class Nowhere:
    """A file that keeps nothing."""

    def seekable(self) -> bool:
        return False

    def write(self, data: bytes) -> int:
        return len(data)

    def flush(self) -> None:
        pass


@pytest.mark.exhaustive
def test_a_reader_has_the_writers_state_after_each_of_10000_frames():
    encoder, frames = closed_loop().parameters, decoded()[0]
    assert len(frames) == FRAMES
    assert frames.tobytes() == encoder.tobytes()
    types = [codes.type for codes in closed_loop().codes]
    assert types.count("I") == 1
    assert types.count("R") == FRAMES // 2 - 1
    moved = np.any(np.diff(frames, axis=0) != 0, axis=(1, 2))
    assert not moved[[type_ == "R" for type_ in types[1:]]].any()
    assert moved[[type_ == "P" for type_ in types[1:]]].mean() > 0.9


def test_the_decoder_of_the_spec_has_the_same_bits():
    found = namespace()["reconstruct_stream"](closed_loop(300).data)
    assert found["error"] == ""
    assert list(found["counts"]) == [SPLATS] * 300
    assert found["parameters"].tobytes() == closed_loop().parameters[:300].tobytes()


def test_the_source_is_followed_to_the_end():
    """Late frames are as close as early ones: nothing adds up."""
    error = abs(decoded()[0].astype(np.float64) - source()).max(axis=(1, 2))
    assert error[-1000:].max() < 1.5 * error[1000:2000].max()


def test_memory_does_not_grow_over_10000_frames():
    assert decoded()[1] < 200


@pytest.mark.exhaustive
def test_memory_does_not_grow_with_the_frames_that_are_read():
    assert grown(iter(StreamReader(closed_loop().data)), 100, 600) < 16_384


@pytest.mark.exhaustive
def test_memory_does_not_grow_with_the_frames_that_are_rendered():
    one_picture = WIDTH * HEIGHT * 3 * 4  # the renderer's lists grow and shrink with the splats, by half of that
    assert grown(decode(closed_loop().data, threads=1), 100, 400) < one_picture


@pytest.mark.exhaustive
def test_memory_does_not_grow_with_the_frames_that_are_written():
    writer = StreamWriter(Nowhere(), HEADER)
    assert grown((writer.write_frame(codes) for codes in closed_loop().codes), 100, 600) < 16_384


def grown(items, first, last):
    """The growth of the memory in use and of its peak between two stretches of an iterator, in bytes.

    After the item `first` come two stretches of `last` - `first` items. Each begins after a collection of garbage:
    Python leaves the rest of cycles that have grown old lying about until there are many.
    """
    tracemalloc.start()
    try:
        readings = []
        for count in (first, last - first, last - first):
            gc.collect()
            tracemalloc.reset_peak()
            kept = next(islice(items, count - 1, None))
            _, peak = tracemalloc.get_traced_memory()
            gc.collect()
            readings.append((tracemalloc.get_traced_memory()[0], peak))
            assert kept is not None
        _, early, late = readings
        return max(after - before for before, after in zip(early, late, strict=True))
    finally:
        tracemalloc.stop()
