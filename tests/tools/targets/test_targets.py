"""Goals of a whole clip: what is asked for comes out, the same for any number of jobs, or what binds is said."""

import io
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from codec_cases import fast, paper_fast, video_format, waves

from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.encoder import IncompleteEncodeError, Settings, encode
from gsvc_ref.stream import decode
from gsvc_tools import libvmaf
from gsvc_tools.targets import targets
from gsvc_tools.targets.targets import NEAR_TARGET

CLIP = waves(32, 24, 6, cut=3)
FORMAT = video_format(frame_count=6)


def to_goal(settings: Settings, frames=CLIP, target=None, **options):
    file = io.BytesIO() if target is None else target
    report = encode((frames, FORMAT), file, settings, **options)
    return report, None if target is not None else file.getvalue()


@pytest.fixture(scope="module")
def one():
    """Two groups of pictures in 900 bytes."""
    return to_goal(fast(size=900, key_frames=3, decisions=False))


def test_a_size_is_met_with_all_that_a_file_has(one):
    report, data = one
    assert report.file_bytes == len(data)
    assert abs(len(data) / 900 - 1) <= NEAR_TARGET
    assert [frame.type for frame in report.frames] == ["I", "P", "P", "I", "P", "P"]
    assert len(list(decode(data))) == 6
    assert report.settings.size == 900
    assert f"asked for 900 bytes, got {len(data)}" in report.notes[-1]


@pytest.mark.parametrize("jobs", [2, 5])
def test_the_bytes_do_not_depend_on_the_jobs(one, jobs):
    with ThreadPoolExecutor(jobs) as executor:
        _, data = to_goal(fast(size=900, key_frames=3, decisions=False), jobs=jobs, executor=executor)
    assert data == one[1]


def test_frames_that_come_once_are_kept_for_the_second_pass(one):
    _, data = to_goal(fast(size=900, key_frames=3, decisions=False), frames=iter(CLIP))
    assert data == one[1]


def test_a_file_gets_the_same(one, tmp_path):
    path = tmp_path / "clip.gsvc"
    to_goal(fast(size=900, key_frames=3, decisions=False), target=path)
    assert path.read_bytes() == one[1]
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("count", [1, 3])
def test_one_group_is_corrected_within_itself(count):
    report, data = to_goal(fast(bitrate=800 * 8 * 25 / count, decisions=False), CLIP[:count])
    assert abs(len(data) / 800 - 1) <= NEAR_TARGET
    assert f"asked for {160 / count:,.1f} kbit/s" in report.notes[-1]


@pytest.mark.parametrize(("size", "why"), [(20, "does not get smaller"), (10**7, "does not get larger")])
def test_a_goal_out_of_reach_gives_the_nearest_and_what_binds(size, why):
    report, data = to_goal(fast(size=size), CLIP[:2])
    assert any(why in note for note in report.notes)
    assert len(list(decode(data))) == 2
    splats = [frame.splats for frame in report.frames]
    assert max(splats) <= 2 if size == 20 else max(splats) > 60


def test_a_mean_psnr_is_reached_with_few_splats():
    report, data = to_goal(fast(mean_psnr=26.0), CLIP[:3])
    reached = report.mean_psnr
    assert 26 <= reached < 29
    assert any(f"got {reached:.2f} dB" in note for note in report.notes)
    pairs = zip(CLIP, decode(data), strict=False)
    peaks = [10 * np.log10(255**2 / np.mean((a - b.astype(float)) ** 2)) for a, b in pairs]
    assert np.mean(peaks) == pytest.approx(reached, abs=0.01)


def test_profile_paper_has_its_splats_for_a_knob():
    _, data = to_goal(paper_fast(size=1500, key_frames=2, decisions=False), CLIP[:4])
    assert abs(len(data) / 1500 - 1) <= 2 * NEAR_TARGET


@pytest.mark.parametrize("kind", ["file", "no file"])
def test_ctrl_c_while_the_size_is_corrected_keeps_the_whole_stream_before(monkeypatch, tmp_path, kind):
    steps = []

    def stop(progress):
        if progress.step not in steps:
            steps.append(progress.step)
        if progress.step == "correcting the size again":
            raise KeyboardInterrupt

    monkeypatch.setattr(targets, "NEAR_TARGET", -1.0)  # nothing is near enough
    target = tmp_path / "clip.gsvc" if kind == "file" else io.BytesIO()
    report, _ = to_goal(fast(size=700, decisions=False), CLIP[:3], target, progress=stop)
    data = target.read_bytes() if kind == "file" else target.getvalue()
    assert report.interrupted
    assert steps[-3:] == ["second pass", "correcting the size", "correcting the size again"]
    assert report.file_bytes == len(data)
    assert len(list(decode(data))) == len(report.frames) == 3
    assert f"asked for 700 bytes, got {len(data)}" in report.notes[-1]


@pytest.mark.parametrize("kind", ["file", "no file"])
def test_a_source_that_breaks_off_is_planned_as_far_as_it_goes(tmp_path, kind):
    def frames():
        yield from CLIP[:3]
        raise GsvcError("malformed", "frame 3 is torn")

    with pytest.raises(IncompleteEncodeError, match="frame 3 is torn") as caught:
        to_goal(fast(size=700, decisions=False), frames(), tmp_path / "clip.gsvc" if kind == "file" else io.BytesIO())
    report = caught.value.report
    assert len(report.frames) == 3
    assert report.settings.size == 700
    assert f"asked for 700 bytes, got {report.file_bytes}" in report.notes[-1]
    if kind == "file":
        assert len(list(decode(tmp_path / "clip.gsvc"))) == 3


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"bitrate": 1e5, "psnr": 30.0}, "bitrate is a goal of the whole clip, and psnr is another"),
        ({"bitrate": 1e5, "size": 1000}, "bitrate .* size"),
        ({"mean_psnr": 30.0, "vmaf": 90.0}, "mean_psnr .* vmaf"),
        ({"size": 1000, "quality": 20}, "size .* quality"),
        ({"size": 1000, "layers": (20.0, 30.0)}, "size .* layers"),
        ({"bitrate": 0.0}, "bitrate is 0.0"),
        ({"size": -4}, "size is -4"),
        ({"mean_psnr": 101.0}, "mean_psnr is 101.0"),
        ({"vmaf": 0.5}, "vmaf is 0.5"),
    ],
)
def test_goals_that_contradict_or_cannot_be_are_refused(wrong, message):
    with pytest.raises(UsageError, match=message):
        Settings.quick(**wrong)


def test_what_cannot_be_done_is_refused_before_any_work(monkeypatch, tmp_path):
    with pytest.raises(UsageError, match="live stream"):
        to_goal(fast(size=1000), live=True, target=tmp_path / "live.gsvc")
    with pytest.raises(UsageError, match="splats are more than"):
        to_goal(fast(size=1000, splats=5000))
    monkeypatch.setattr("gsvc_tools.targets.targets.ffmpeg_with_libvmaf", lambda: (None, "there is no ffmpeg"))
    with pytest.raises(UsageError, match="a VMAF cannot be held: there is no ffmpeg"):
        to_goal(fast(vmaf=90.0))
    monkeypatch.setattr("gsvc_tools.targets.targets.ffmpeg_with_libvmaf", lambda: ("ffmpeg", None))
    assert libvmaf.MIN_SIDE > 24
    with pytest.raises(UsageError, match="at least"):
        to_goal(fast(vmaf=90.0))
