"""Random streams for soak tests: they use all of the syntax and come with what they decode to; a seed fixes them."""

import hashlib
import json

import numpy as np
import pytest

import gsvc_ref
from gsvc_conformance.element_values import IGNORED, values
from gsvc_conformance.elements import ELEMENTS
from gsvc_conformance.streams import stream_of, write_streams
from gsvc_ref.stream import StreamReader
from gsvc_ref.testing import split_chunks


@pytest.fixture(scope="module")
def sixty():
    return [stream_of(0, number) for number in range(60)]


def test_sixty_streams_use_every_element(sixty):
    found = {}
    for stream in sixty:
        for name, (_, some) in values(stream.data).items():
            found.setdefault(name, set()).update(some)
    assert ELEMENTS.keys() <= found.keys()
    assert found["plane_mode"] == {0, 1, 2}
    for flag in ("positions", "cholesky", "quantizer", "colors", "codebooks"):
        assert found[f"{flag}_present"] == {0, 1}
    assert found["flags"] == {0, 1, 2, 3}
    assert found["level"] == {1, 2, 3, 4, 5}
    assert found["chroma_format"] == {0, 1, 2, 3}
    assert found["bit_depth"] == set(range(8, 17))
    assert set(b"HIPRxE") < found["chunk_type"]
    assert found["chunk_type"] & set(b"abz")
    assert 0 in found["frame_count"]
    assert max(found["frame_count"]) > 0
    assert max(found["version_minor"]) > 0


def test_some_have_an_index_and_some_elements_of_a_later_version(sixty):
    indices = [any(chunk_type == b"x" for chunk_type, _ in split_chunks(stream.data)) for stream in sixty]
    assert set(indices) == {False, True}
    later = []
    for stream in sixty:
        StreamReader(stream.data, trace=lambda element: later.append(element.name))
    assert "unknown" in later
    assert "unknown" in IGNORED


def test_they_stand_for_what_they_say(sixty):
    for stream in sixty:
        assert [frame.splats for frame in StreamReader(stream.data)] == stream.splats


def test_written_streams(tmp_path):
    begun = []
    write_streams(7, 3, tmp_path / "a", begun.append)
    assert begun == [0, 1, 2]
    write_streams(7, 2, tmp_path / "b")
    index = json.loads((tmp_path / "a" / "index.json").read_text())
    assert len(index) == 3
    for entry in index:
        data = (tmp_path / "a" / f"{entry['name']}.gsvc").read_bytes()
        assert hashlib.sha256(data).hexdigest() == entry["sha256"]
        assert entry["header"]["width"] == StreamReader(data).header.width
        assert entry["elements"]["magic"] == 1
        counts, parameters, frames = (
            np.load(tmp_path / "a" / f"{entry['name']}.{part}.npy") for part in ("counts", "parameters", "frames")
        )
        lowest, highest = (np.load(tmp_path / "a" / f"{entry['name']}.{end}.npy") for end in ("lowest", "highest"))
        assert lowest.dtype == highest.dtype == frames.dtype
        bounded = np.stack(list(gsvc_ref.decode(data)))
        for within in (frames, bounded):
            assert ((lowest <= within) & (within <= highest)).all()
        assert (highest - lowest.astype(int)).max() < 3
        assert counts.sum() == len(parameters)
        assert frames.shape == (len(counts), entry["header"]["height"], entry["header"]["width"], 3)
    for path in (tmp_path / "b").iterdir():
        if path.name != "index.json":
            assert path.read_bytes() == (tmp_path / "a" / path.name).read_bytes()
    assert json.loads((tmp_path / "b" / "index.json").read_text()) == index[:2]


def test_another_seed_gives_other_streams():
    assert stream_of(0, 1).data != stream_of(1, 0).data
