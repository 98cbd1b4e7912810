"""What an encode is likely to take, by some of its frames."""

import pytest
from codec_cases import encoded, fast, flat, paper_fast, video_format, waves

from gsvc_base.errors import GsvcError
from gsvc_ref.encoder.source_and_target import FrameSource
from gsvc_tools.targets import trial
from gsvc_tools.targets.trial import FRAMES_OF_PLACE, PLACES, estimate

CLIP = waves(32, 24, 15)


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """However slow the machine is."""
    monkeypatch.setattr(trial, "BUDGET_S", 1e9)


def tried(frames, settings, **options):
    video = video_format(32, 24, frame_count=options.pop("count", len(frames)))
    return estimate(lambda: FrameSource(frames, video), settings, **options)


@pytest.mark.parametrize(
    "settings",
    [fast(splats=30, key_frames=5), paper_fast(splats=12, key_frames=5, iterations=80)],
    ids=["main", "paper"],
)
def test_the_whole_is_within_what_was_said(settings):
    said = tried(CLIP, settings)
    report, data = encoded(CLIP, settings)
    assert said.frames_tried == PLACES * FRAMES_OF_PLACE
    assert said.file_bytes.low <= len(data) <= said.file_bytes.high
    assert said.mean_psnr.low <= report.mean_psnr <= said.mean_psnr.high
    assert said.level == report.header.level
    assert said.frames == 15


def test_layers_count():
    settings = fast(splats=None, layer_splats=(10, 40), key_frames=5)
    said = tried(CLIP, settings)
    report, data = encoded(CLIP, settings)
    assert said.file_bytes.low <= len(data) <= said.file_bytes.high
    assert said.splats == pytest.approx(sum(layer.splats for layer in report.frames[0].layers), abs=5)
    assert said.file_bytes.likely > tried(CLIP, fast(splats=10, key_frames=5)).file_bytes.likely


def test_a_goal_is_taken_for_what_comes_out():
    said = tried(CLIP, fast(size=2000, key_frames=5))
    assert said.file_bytes.low < 2000 < said.file_bytes.high
    wanted = tried(CLIP, fast(mean_psnr=30.0, key_frames=5))
    assert wanted.mean_psnr.likely == 30
    assert wanted.file_bytes.low < wanted.file_bytes.likely < wanted.file_bytes.high
    out_of_reach = tried(CLIP, fast(size=10**7, key_frames=5))
    assert out_of_reach.file_bytes.high < 10**6


def test_equal_frames_are_repeated():
    said = tried(flat((9, 90, 200), frames=4), fast(splats=3))
    assert said.file_bytes.likely < 1000


@pytest.mark.parametrize(("jobs", "asked", "used"), [(1, None, None), (2, None, 1), (2, 3, 3)])
def test_threads_are_those_of_a_job(monkeypatch, jobs, asked, used):
    class SeenError(Exception):
        pass

    def seen(settings, video):
        raise SeenError(settings.threads)

    monkeypatch.setattr(trial, "coder_of", seen)
    with pytest.raises(SeenError, match=f"^{used}$"):
        tried(CLIP, fast(threads=asked), jobs=jobs)


def test_without_a_length_it_is_about_a_second():
    video = video_format(32, 24)
    said = estimate(lambda: FrameSource(CLIP, video), fast(splats=10))
    assert said.frames is None
    assert said.frames_tried == FRAMES_OF_PLACE


def test_a_source_without_frames_is_refused():
    with pytest.raises(GsvcError, match="no frames"):
        tried([], fast(), count=None)
