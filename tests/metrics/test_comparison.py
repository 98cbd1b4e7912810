import json
import math
import tracemalloc
from fractions import Fraction

import numpy as np
import pytest

from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.metrics import compare_frames, ms_ssim, psnr
from gsvc_tools.libvmaf import ffmpeg_with_libvmaf


def clip(count, height=24, width=40, seed=0):
    rng = np.random.default_rng(seed)
    return [rng.integers(0, 256, (height, width, 3), dtype=np.uint8) for _ in range(count)]


def test_every_frame_and_the_means_are_those_of_the_metrics():
    a, b = clip(3), clip(3, seed=1)
    seen = []
    result = compare_frames(iter(a), iter(b), 255, on_frame=seen.append)
    assert [f.psnr for f in result.frames] == [psnr(x, y, 255) for x, y in zip(a, b, strict=True)]
    assert [f.ms_ssim for f in result.frames] == [ms_ssim(x, y, 255) for x, y in zip(a, b, strict=True)]
    assert [f.number for f in result.frames] == [0, 1, 2]
    assert seen == list(result.frames)
    assert result.mean_psnr == pytest.approx(sum(f.psnr for f in result.frames) / 3, rel=1e-15)
    assert result.mean_ms_ssim == pytest.approx(sum(f.ms_ssim for f in result.frames) / 3, rel=1e-15)
    assert result.psnr_of_mean_mse == pytest.approx(psnr(np.concatenate(a), np.concatenate(b), 255), abs=1e-10)
    assert result.vmaf is None
    assert (result.width, result.height, result.peak) == (40, 24, 255)


def test_an_identical_frame_is_null_in_strict_json_and_marked():
    a, b = clip(3), clip(3, seed=1)
    b[1] = a[1]
    result = compare_frames(a, b, 255)
    parsed = json.loads(json.dumps(result.to_json(), allow_nan=False))
    assert [f["identical"] for f in parsed["frames"]] == [False, True, False]
    assert parsed["frames"][1]["psnr"] is None
    assert parsed["frames"][0]["psnr"] == result.frames[0].psnr
    assert parsed["mean"]["psnr"] is None
    assert result.mean_psnr == math.inf
    assert parsed["identical_frames"] == 1
    assert parsed["mean"]["psnr_of_mean_mse"] == result.psnr_of_mean_mse < math.inf
    assert parsed["ms_ssim_scales"] == 2


def test_videos_of_different_length_say_so():
    a, b = clip(3), clip(5)
    result = compare_frames(a, b, 255)
    assert len(result.frames) == 3
    assert (result.frames_missing_a, result.frames_missing_b) == (2, 0)
    assert result.notes[0] == (
        "the first video ends 2 frames before the other one: only the first 3 frames of both are compared"
    )
    assert compare_frames(b, a, 255).to_json()["frames_missing"] == {"a": 0, "b": 2}


def test_equal_videos_of_a_large_size_need_no_note():
    a = clip(1, 161, 161)
    assert compare_frames(a, a, 255).notes == ()


@pytest.mark.parametrize(("a", "b", "which"), [(0, 2, "first"), (2, 0, "second"), (0, 0, "first and the second")])
def test_nothing_to_compare(a, b, which):
    with pytest.raises(GsvcError, match=f"the {which} video has no frames") as caught:
        compare_frames(clip(a), clip(b), 255)
    assert caught.value.kind == "invalid"


def test_sizes_that_differ_say_what_to_do():
    with pytest.raises(GsvcError, match=r"frame 0 is 40x24 in the first video and 80x48 in the second.*scale 1"):
        compare_frames(clip(1), clip(1, 48, 80), 255)


def test_a_size_that_changes_is_found():
    a = [*clip(1), *clip(1, 10, 10)]
    with pytest.raises(GsvcError, match="change size from 40x24 to 10x10 at frame 1"):
        compare_frames(a, a, 255)


def test_a_wrong_frame_is_named_by_its_number():
    a = clip(2)
    with pytest.raises(UsageError, match=r"frame 1: .*float64"):
        compare_frames(a, [a[0], a[1].astype(float)], 255)


def test_frames_are_not_kept():
    frame = clip(1, 256, 256)[0]

    def peak_of(count):
        tracemalloc.start()
        compare_frames((frame.copy() for _ in range(count)), (frame.copy() for _ in range(count)), 255)
        used = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return used

    peak_of(1)
    assert peak_of(12) < peak_of(2) + frame.nbytes


def test_vmaf_stands_in_the_frames_or_its_absence_in_the_notes():
    a, b = clip(2, 40, 40), clip(2, 40, 40, seed=1)
    result = compare_frames(a, b, 255, frame_rate=Fraction(24), with_vmaf=True)
    if ffmpeg_with_libvmaf()[0] is None:
        assert result.vmaf.reason in result.notes
        assert result.to_json()["frames"][0]["vmaf"] is None
    else:
        assert tuple(f["vmaf"] for f in result.to_json()["frames"]) == result.vmaf.scores
        assert result.to_json()["mean"]["vmaf"] == result.vmaf.mean
    tiny = compare_frames(clip(1, 8, 8), clip(1, 8, 8), 255, with_vmaf=True)
    assert tiny.vmaf.reason in tiny.notes
