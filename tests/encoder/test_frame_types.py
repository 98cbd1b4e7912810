"""Which frames become I, P and R, how far an encoder looks ahead, and what it holds meanwhile."""

import weakref
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from codec_cases import Counting, encoded, flat, paper_fast, paper_quick, video_format, waves
from hypothesis import given
from hypothesis import strategies as st

from gsvc_ref.encoder import Effects, Settings, encode
from gsvc_ref.encoder.frame_types import typed_frames
from gsvc_ref.encoder.pretraining import Pretraining
from gsvc_ref.stream import Stream
from gsvc_ref.training.reduction import reduced
from gsvc_ref.video import VideoReader

RNG = np.random.default_rng(0)
TALL, WIDE = RNG.random((37, 5, 3), np.float32), RNG.random((8, 40, 3), np.float32)


def auto(**overrides) -> Settings:
    """Quick settings with automatic key frames; `detection` gives changes of its settings."""
    detection = replace(paper_quick().detection, **overrides.pop("detection", {}))
    return paper_fast(**{"key_frames": "auto", "detection": detection} | overrides)


def types(frames, settings) -> str:
    return "".join(item.type for item in typed_frames(frames, settings, 255))


def still(picture: np.ndarray, frames: int, rng: np.random.Generator) -> list[np.ndarray]:
    """A still picture with a sample changed here and there, so that no frame equals the one before."""
    clip = [picture.copy() for _ in range(frames)]
    for frame in clip:
        frame[rng.integers(len(frame)), rng.integers(frame.shape[1])] ^= 1
    return clip


@pytest.mark.parametrize("low_latency", [False, True])
@pytest.mark.parametrize("cut", [1, 3, 6])
def test_a_cut_between_two_still_pictures_is_found(cut, low_latency):
    rng = np.random.default_rng(cut)
    first, second = waves(40, 30, 2, cut=1)
    clip = still(first, cut, rng) + still(second, 7 - cut, rng)
    assert types(clip, auto(low_latency=low_latency)) == "I" + "P" * (cut - 1) + "I" + "P" * (6 - cut)


@pytest.mark.parametrize("low_latency", [False, True])
def test_a_clip_without_a_cut_has_one_key_frame(low_latency):
    assert types(waves(40, 30, 8), auto(low_latency=low_latency)) == "IPPPPPPP"
    rng = np.random.default_rng(0)
    assert types(still(waves(40, 30, 1)[0], 6, rng), auto(low_latency=low_latency)) == "IPPPPP"


def test_the_papers_rule_finds_a_cut():
    rng = np.random.default_rng(0)
    first, second = waves(40, 30, 2, cut=1)
    clip = still(first, 12, rng) + still(second, 11, rng)
    assert types(clip, auto(detection={"rule": "paper"})) == "I" + 11 * "P" + "I" + 10 * "P"


@pytest.mark.parametrize("key_frames", ["auto", ()])
def test_an_equal_frame_is_repeated(key_frames):
    a, b = waves(24, 16, 2)
    clip = [a, a, b, b, b, a]
    settings = auto(key_frames=key_frames)
    assert types(clip, settings) == "IRPRRP"
    assert types(clip, replace(settings, effects=Effects.parse("auto,frames=all"))) == "IPPPPP"
    assert types(flat(9, frames=5), settings) == "IRRRR"


def test_every_kth_frame_is_a_key_frame():
    clip = waves(24, 16, 7)
    assert types(clip, paper_fast(key_frames=3)) == "IPPIPPI"
    assert types(clip, paper_fast(key_frames=1)) == "IIIIIII"
    assert types(clip, paper_fast(key_frames=7)) == "IPPPPPP"


def test_listed_frames_are_key_frames():
    clip = waves(24, 16, 6)
    assert types(clip, paper_fast(key_frames=(2, 5))) == "IPIPPI"
    assert types(clip, paper_fast(key_frames=(0, 99))) == "IPPPPP"
    assert types(clip, paper_fast(key_frames=())) == "IPPPPP"


def test_key_frames_that_were_asked_for_come_even_if_nothing_changed():
    clip = flat(50, frames=5)
    assert types(clip, paper_fast(key_frames=2)) == "IRIRI"
    assert types(clip, paper_fast(key_frames=(3,))) == "IRRIR"


def test_the_reason_is_told():
    clip = waves(40, 30, 4, cut=2, speed=0.2)
    clip.append(clip[-1].copy())
    report, _ = encoded(clip, auto(iterations=60))
    reasons = [(frame.type, frame.reason) for frame in report.frames]
    assert [kind for kind, _ in reasons] == ["I", "P", "I", "P", "R"]
    assert len({reason for _, reason in reasons}) == 4
    assert "scene" in reasons[2][1]
    assert "3" in encoded(clip, paper_fast(key_frames=3))[0].frames[3].reason


@pytest.mark.parametrize(
    "settings",
    [
        paper_fast(),
        paper_fast(key_frames=2),
        paper_fast(key_frames=(1,)),
        auto(low_latency=True),
        paper_fast(low_latency=True),
    ],
    ids=["one", "every", "listed", "low latency", "low latency, one"],
)
def test_nothing_is_read_before_it_is_needed(settings):
    """While frame t is fitted, t + 1 frames have been taken: none ahead."""
    source, seen = Counting(waves(24, 16, 5)), []

    def watch(progress):
        if progress.stage == "fit":
            seen.append((progress.frame, source.taken))

    encode((source, video_format(24, 16)), BytesIO(), settings, progress=watch)
    assert set(seen) == {(t, t + 1) for t in range(5)}


def test_a_low_latency_stream_has_frame_t_before_frame_t_plus_1_is_read():
    file = BytesIO()
    written = []

    def frames():
        for frame in waves(24, 16, 4):
            written.append(file.tell())
            yield frame

    settings = auto(low_latency=True)
    encode((frames(), video_format(24, 16)), file, settings)
    with Stream(file.getvalue()) as stream:
        ends = [frame.offset + frame.size for frame in stream]
    assert written == [0, *ends[:3]]


@pytest.mark.parametrize("window", [0, 1, 3])
def test_automatic_key_frames_look_one_window_ahead(window):
    source = Counting(waves(16, 12, 9))
    settings = auto(detection={"window": window, "iterations": 1})
    taken = [(item.number, source.taken) for item in typed_frames(source, settings, 255)]
    assert taken[0] == (0, 1)
    assert taken[1:] == [(t, min(9, t + window + 1)) for t in range(1, 9)]


class Fresh(VideoReader):
    """Hands out frames of its own and counts how many of them are alive."""

    def __init__(self, frames: int) -> None:
        super().__init__()
        self.format, self.alive, self.most, self.count = video_format(8, 8), 0, 0, frames

    def _release(self) -> None:
        self.alive -= 1

    def _read(self):
        rng = np.random.default_rng(0)
        for _ in range(self.count):
            frame = rng.integers(0, 256, (8, 8, 3), np.uint8)
            self.alive += 1
            self.most = max(self.most, self.alive)
            weakref.finalize(frame, self._release)
            yield frame
            del frame


@pytest.mark.parametrize(
    ("settings", "held"),
    [(paper_fast(iterations=1), 0), (auto(iterations=1, detection={"iterations": 1, "window": 2}), 2)],
    ids=["one", "auto"],
)
def test_memory_does_not_grow_with_the_number_of_frames(settings, held):
    peaks = []
    for count in (10, 40):
        reader = Fresh(count)
        encode(reader, BytesIO(), settings)
        peaks.append(reader.most)
    assert peaks[0] == peaks[1]
    assert peaks[0] <= held + 3  # the present frame, the one before, and the one being read


def test_numbers_and_frames_pass_through_in_order():
    clip = waves(24, 16, 6)
    for settings in (auto(detection={"window": 2}), paper_fast(key_frames=2)):
        items = list(typed_frames(iter(clip), settings, 255))
        assert [item.number for item in items] == list(range(6))
        assert all(item.frame is frame for item, frame in zip(items, clip, strict=True))
    assert list(typed_frames([], auto(), 255)) == []


def test_every_frame_is_announced_before_it_is_pretrained():
    numbers = []
    list(typed_frames(waves(24, 16, 5), auto(), 255, numbers.append))
    assert numbers == [0, 1, 2, 3, 4]
    numbers.clear()
    list(typed_frames(waves(24, 16, 5), paper_fast(), 255, numbers.append))
    assert numbers == []


@pytest.mark.parametrize("preset", [paper_quick, Settings.paper])
def test_pretraining_repeats_itself(preset):
    detection = replace(preset().detection, iterations=5)
    settings = preset(threads=1, splats=20, detection=detection)
    pictures = [frame.astype(np.float32) / 255 for frame in waves(24, 16, 3)]
    runs = []
    for _ in range(2):
        pretraining = Pretraining(settings)
        runs.append([pretraining.losses(picture) for picture in pictures])
    assert runs[0] == runs[1]
    assert [loss is None for _, loss in runs[0]] == [True, False, False]
    assert all(0 < loss < 3 for pair in runs[0] for loss in pair if loss is not None)


@pytest.mark.parametrize("picture", [TALL, WIDE, TALL[:1], WIDE[:, :1]], ids=["tall", "wide", "row", "column"])
@pytest.mark.parametrize("longest", [1, 3, 7, 12, 36, 37, 40, 100])
def test_reduction_averages_blocks(picture, longest):
    small = reduced(picture, longest)
    assert max(small.shape[:2]) <= longest
    step = -(-max(picture.shape[:2]) // longest)
    rows, columns = (-(-side // step) for side in picture.shape[:2])
    assert small.shape == (rows, columns, 3)
    assert small.dtype == np.float32
    for i in range(rows):
        for j in range(columns):
            block = picture[i * step : (i + 1) * step, j * step : (j + 1) * step].astype(np.float64)
            np.testing.assert_allclose(small[i, j], block.mean(axis=(0, 1)), rtol=1e-7)


def test_pictures_that_are_small_enough_are_not_reduced():
    assert reduced(WIDE, None) is WIDE
    assert reduced(WIDE, 40) is WIDE


@given(st.integers(1, 30), st.integers(1, 30), st.integers(1, 30), st.floats(0, 1, width=32))
def test_even_pictures_stay_even(height, width, longest, value):
    small = reduced(np.full((height, width, 3), value, np.float32), longest)
    assert max(small.shape[:2]) <= longest
    np.testing.assert_allclose(small, value, rtol=1e-6)
