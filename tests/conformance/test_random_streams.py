"""Random streams for soak tests: they use all of the syntax and come with what they decode to; a seed fixes them."""

import hashlib
import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import gsvc_ref
from gsvc_conformance.__main__ import main
from gsvc_conformance.element_values import IGNORED, values
from gsvc_conformance.elements import ELEMENTS
from gsvc_conformance.streams import MAX_PIXELS, stream_of, write_streams
from gsvc_ref import UsageError
from gsvc_ref.stream import StreamReader, reconstruct_layers
from gsvc_ref.testing import Wishes, random_stream, split_chunks
from gsvc_ref.testing.random_main_streams import random_main_stream


@pytest.fixture(scope="module")
def sixty():
    return [stream_of(0, number, profiles=["paper"]) for number in range(60)]


OF_MAIN = {
    "max_lane_exponent", "layer_count", "main_tools", "quality_level", "quality_halvings", "quality_reserved",
    "layer_mask", "lane_exponent", "motion_cell", "quantizer_present (frame_body)", "new_present", "quantizer",
    "splat_number", "lane_state (run)", "word_count (run)", "word (run)", "raw_byte", "density_family", "scale_code",
    "centre", "slope", "halving_code", "layer", "layer_type", "frame_low",
}  # fmt: skip
"""Elements of profile `main` alone."""


def all_values(streams):
    """The values of every element of the bases of streams."""
    found = {}
    for stream in streams:
        for name, (_, some) in values(stream.data).items():
            found.setdefault(name, set()).update(some)
    return found


@pytest.mark.exhaustive
def test_sixty_streams_of_profile_main_use_every_element():
    sixty = [random_main_stream(number) for number in range(60)]
    found = all_values(sixty)

    def note(element):
        if element.name in ("layer", "layer_type", "frame_low"):
            found.setdefault(element.name, set()).add(element.value)

    for stream in sixty:
        assert sum(1 for _ in StreamReader(stream.data, layer=None, trace=note)) == len(stream.frames)
    assert found.keys() >= OF_MAIN
    assert found["profile"] == {1}
    assert found["layer_count"] == {1, 2, 3, 4}
    assert found["layer"] == {1, 2, 3}
    assert found["layer_type"] == {0, 1, 2}
    assert found["frame_low"] >= {0, 1, 2, 3, 4}
    assert set(b"HIPRnxE") <= found["chunk_type"]
    assert found["motion_cell"] == {0, 1, 2, 3}
    assert found["lane_exponent"] >= set(range(6))  # 6 takes a lane_count of 64, which few have
    assert found["halving_code"] == set(range(8))
    assert found["scale_code"] == set(range(32))
    assert len(found["quantizer"]) > 50
    assert found["quantizer"] <= set(range(80))
    for name, ends in {"centre": (0, 1023), "slope": (0, 255)}.items():
        assert (min(found[name]), max(found[name])) == ends
    for flag in ("density_family", "quantizer_present (frame_body)", "new_present"):
        assert found[flag] == {0, 1}
    assert found["quality_halvings"] == {0, 1, 2, 3}


def test_sixty_streams_use_every_element(sixty):
    found = all_values(sixty)
    assert ELEMENTS.keys() - OF_MAIN <= found.keys()
    assert found["profile"] == {0}
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
    with ThreadPoolExecutor(2) as executor:  # as a cluster makes them
        write_streams(7, 2, tmp_path / "b", executor=executor)
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
        bounded = np.stack(list(gsvc_ref.decode(data, layer=0)))
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


DEFAULT_DIGESTS = {
    MAX_PIXELS: "a020c79af9adac4455170d61b260972d39834c43c04d3f3751bbd26931852355",
    1 << 17: "4f3f80ee6889e2dcf5d2d5aefc406c39a87a31a4e2410ff0ad78d73f25ae5af9",
}
"""SHA-256 of the streams of seeds 0 to 39, one after the other, by maximum number of pixels."""


@pytest.mark.exhaustive
def test_streams_of_profile_main_are_legal_in_every_quality(tmp_path):
    paced, ancillary = set(), set()
    for number in range(60):
        stream = stream_of(5, number, profiles=["main"])
        paced.add(stream.header.paced_flag)
        ancillary |= {chunk_type for chunk_type, _ in split_chunks(stream.data)}
        for quality in range(stream.header.layer_count):
            assert reconstruct_layers(stream.data, quality).error == ""
    assert paced == {False, True}
    assert ancillary >= {b"a", b"b", b"z", b"n", b"x"}


def test_processes_write_the_same_files_with_those_of_layers(tmp_path):
    words = ["--seed", "2", "--count", "3", "--layers", "3", "--size", "16x8", "--frames", "3", "--splats", "4"]
    for jobs in ("1", "2"):
        assert main(["streams", str(tmp_path / jobs), *words, "--jobs", jobs, "--quiet"]) == 0
    files = [path.name for path in sorted((tmp_path / "1").iterdir())]
    assert [path.name for path in sorted((tmp_path / "2").iterdir())] == files
    for name in files:
        assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "2" / name).read_bytes()
    data = (tmp_path / "1/stream-2-0001.gsvc").read_bytes()
    assert np.load(tmp_path / "1/stream-2-0001.counts.npy").tolist() == [4, 4, 4]
    for layer in (1, 2):
        counts, parameters = (
            np.load(tmp_path / f"1/stream-2-0001.layer_{layer}.{part}.npy") for part in ("counts", "parameters")
        )
        with StreamReader(data, layer=layer) as reader:
            shown = [frame.layers.splats for frame in reader]
        assert [len(splats) for splats in shown] == counts.tolist()
        assert np.array_equal(np.concatenate([splats.to_array() for splats in shown]), parameters)
    assert not list((tmp_path / "1").glob("*layer_3*"))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--lanes", "7", "--profile", "main"], "--lanes 7 is of profile paper, which does not go with profile main"),
        (["--layers", "2", "--codewords", "9"], "--layers 2 is of profile main, which does not go with the other"),
        (["--jobs", "5000"], "it must be a whole number in 1..1024"),
    ],
)
def test_what_no_profile_has_is_refused(tmp_path, capsys, words, message):
    assert main(["streams", str(tmp_path), *words]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize("max_pixels", DEFAULT_DIGESTS)
def test_what_is_drawn_without_wishes_never_changes(max_pixels):
    streams = b"".join(random_stream(seed, max_pixels=max_pixels).data for seed in range(40))
    assert hashlib.sha256(streams).hexdigest() == DEFAULT_DIGESTS[max_pixels]


SLOW = {"frame_rate_numerator": 1, "frame_rate_denominator": 1}
FEATURES = {"bit_depth": 10, "lane_count": 7, "cholesky_bits": 9, "color_stages": 3, "color_codewords": 20}


def test_wishes_of_profile_main_are_granted():
    wishes = Wishes(
        {"width": 24, "height": 18, "bit_depth": 10, "max_lane_exponent": 3, "layer_count": 2},
        frames=5,
        splats=30,
        types="PPPR",
        index=True,
        ancillary=True,
        paced=True,
    )
    removed = set()
    for seed in range(6):
        stream = random_main_stream(seed, wishes=wishes)
        assert [len(frame.splats) for frame in StreamReader(stream.data)] == [30] * 5
        assert {name: getattr(stream.header, name) for name in wishes.elements} == wishes.elements
        assert stream.header.paced_flag
        assert {chunk_type for chunk_type, _ in split_chunks(stream.data)} >= {b"x", b"n"}
        removed |= {len(codes.modes) - codes.survivor_count for codes in stream.frames if codes.type == "P"}
    assert {0, 30} < removed
    assert random_main_stream(1, wishes=Wishes({"width": 64, "height": 48}, frames=1, splats=20_000)).header.level >= 2


def test_wishes_are_granted():
    wishes = Wishes(
        {"width": 24, "height": 18, **FEATURES},
        frames=7,
        splats=30,
        types="PPPR",
        index=True,
        ancillary=True,
        paced=True,
    )
    found = set()
    for seed in range(12):
        stream = random_stream(seed, wishes=wishes)
        read = list(StreamReader(stream.data))
        assert [len(frame.splats) for frame in read] == [30] * 7
        assert [frame.splats for frame in read] == stream.splats
        assert read[0].type == "I"
        found |= {frame.type for frame in read[1:]}
        header = StreamReader(stream.data).header
        assert {name: getattr(header, name) for name in FEATURES} == FEATURES
        assert (header.width, header.height, header.paced_flag) == (24, 18, True)
        types = {chunk_type for chunk_type, _ in split_chunks(stream.data)}
        assert b"x" in types
        assert types & {b"a", b"b", b"z"}
    assert found == {"P", "R"}
    without = [random_stream(seed, wishes=Wishes(index=False, ancillary=False, paced=False)) for seed in range(12)]
    for stream in without:
        assert {chunk_type for chunk_type, _ in split_chunks(stream.data)} <= {b"H", b"I", b"P", b"R", b"E"}
        assert not stream.header.paced_flag


def test_a_letter_that_stands_there_more_often_is_drawn_more_often():
    drawn = [frame.type for frame in random_stream(1, wishes=Wishes(frames=200, splats=0, types="IRRRRRRRRR")).frames]
    assert drawn.count("R") > 150 > drawn.count("I") > 5


def test_the_level_is_raised_to_what_is_wished():
    size = {"width": 64, "height": 48}
    assert random_stream(0, wishes=Wishes({**size, "level": 1}, splats=10)).header.level == 1
    levels = {random_stream(seed, wishes=Wishes(size, frames=1, splats=20_000)).header.level for seed in range(3)}
    assert min(levels) >= 2
    with pytest.raises(UsageError, match="need level 2"):
        random_stream(0, wishes=Wishes({**size, "level": 1}, splats=20_000))


@pytest.mark.parametrize(
    ("wishes", "words"),
    [
        ({"types": "XY"}, "not letters of IPR"),
        ({"types": ""}, "not letters of IPR"),
        ({"frames": 0}, "at least one frame"),
        ({"splats": -1}, "at least 0 splats"),
        ({"elements": {"bit_deph": 8}}, "no element bit_deph"),
        ({"elements": {"bit_depth": 7}}, "bit_depth"),
        ({"elements": {"width": 65535, "height": 65535}}, "no level allows"),
        ({"elements": SLOW, "frames": 5, "types": "P", "paced": True}, "R-5-8"),
    ],
)
def test_what_no_stream_has_is_refused(wishes, words):
    with pytest.raises(UsageError, match=words):
        random_stream(0, max_pixels=64, wishes=Wishes(**wishes))


def test_a_folder_with_something_in_it_is_left_alone(tmp_path, capsys):
    """index.json would list the streams of the last call only."""
    write_streams(1, 1, tmp_path / "out", pictures=False)
    before = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert main(["streams", str(tmp_path / "out"), "--seed", "5", "--count", "1", "--quiet"]) == 2
    assert "out is not empty: give a new folder, or remove this one first" in capsys.readouterr().err
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == before
    with pytest.raises(UsageError, match="is a file; give a folder"):
        write_streams(1, 1, tmp_path / "out/index.json")


def test_the_command_passes_wishes_on(tmp_path, capsys):
    words = ["--count", "2", "--size", "16x8", "--frames", "3", "--splats", "5", "--bit-depth", "8", "--paced", "no"]
    whole, without = tmp_path / "whole", tmp_path / "without"
    without.mkdir()
    assert main(["streams", str(whole), *words, "--quiet"]) == 0
    assert np.load(whole / "stream-0-0001.frames.npy").shape == (3, 8, 16, 3)
    assert np.load(whole / "stream-0-0001.counts.npy").tolist() == [5, 5, 5]
    assert main(["streams", str(without), *words, "--lanes", "2", "--without-frames", "--quiet"]) == 0
    parts = {path.name.split(".", 1)[1] for path in without.glob("stream-0-0001.*")}
    assert parts == {"gsvc", "counts.npy", "parameters.npy"}
    paper, main_profile = (entry["header"] for entry in json.loads((without / "index.json").read_text()))
    assert (paper["lane_count"], main_profile["max_lane_exponent"]) == (2, 1)
    capsys.readouterr()
    assert main(["streams", str(tmp_path), "--lanes", "65"]) == 2
    assert "--lanes: 65 is not in 1 to 64" in capsys.readouterr().err
