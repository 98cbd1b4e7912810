import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage.metrics import structural_similarity

from gsvc_base.errors import UsageError
from gsvc_ref import spec
from gsvc_ref.metrics import ms_ssim, ms_ssim_scales
from gsvc_ref.metrics.ssim import SCALE_WEIGHTS, gaussian_window, halve, mean_similarity

PLANES = st.tuples(st.integers(1, 30), st.integers(1, 30), st.integers(0, 2**32 - 1))


def smooth_frame(height, width, seed=0, peak=255):
    """A frame with structure at every scale: random steps, summed up along both axes."""
    rng = np.random.default_rng(seed)
    walk = rng.normal(size=(height, width, 3)).cumsum(axis=0).cumsum(axis=1)
    walk = (walk - walk.min()) / max(np.ptp(walk), 1)
    return np.rint(walk * peak).astype(np.uint8 if peak <= 255 else np.uint16)


def noisy(frame, deviation, peak=255, seed=1):
    noise = np.random.default_rng(seed).normal(size=frame.shape) * deviation
    return np.clip(np.rint(frame + noise), 0, peak).astype(frame.dtype)


@pytest.mark.parametrize(
    ("size", "scales"),
    [((1, 1), 1), ((11, 500), 1), ((20, 20), 1), ((21, 21), 2), ((112, 192), 4), ((160, 999), 4), ((161, 161), 5),
     ((1080, 1920), 5)],
)  # fmt: skip
def test_number_of_scales(size, scales):
    assert ms_ssim_scales(*size) == scales


def test_weights_are_those_of_the_paper_of_2003():
    assert SCALE_WEIGHTS == (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)


def test_window_is_a_centred_gaussian():
    window = gaussian_window(11)
    assert window.sum() == pytest.approx(1, abs=1e-15)
    assert window[5] / window[8] == pytest.approx(math.exp(9 / 4.5))
    np.testing.assert_array_equal(window, window[::-1])
    np.testing.assert_array_equal(gaussian_window(1), [1.0])


def test_halving_keeps_the_mean_of_blocks_and_repeats_an_odd_edge():
    plane = np.arange(15.0).reshape(3, 5)
    np.testing.assert_array_equal(halve(plane), [[3, 5, 6.5], [10.5, 12.5, 14]])


@given(PLANES, st.sampled_from([1, 255, 65535]))
def test_kernel_equals_the_code_of_spec_md(plane, peak):
    height, width, seed = plane
    x, y = np.random.default_rng(seed).integers(0, peak, (2, height, width), endpoint=True).astype(np.float64)
    arguments = (
        gaussian_window(min(11, height)),
        gaussian_window(min(11, width)),
        (0.01 * peak) ** 2,
        (0.03 * peak) ** 2,
    )
    expected = spec.mean_similarities(x, y, peak)
    assert mean_similarity(x, y, *arguments) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_one_scale_is_the_ssim_of_scikit_image():
    x, y = smooth_frame(40, 53)[..., 0], noisy(smooth_frame(40, 53), 12)[..., 0]
    ours, _ = mean_similarity(
        x.astype(float), y.astype(float), gaussian_window(11), gaussian_window(11), 2.55**2, 7.65**2
    )
    theirs = structural_similarity(x, y, data_range=255, gaussian_weights=True, sigma=1.5, use_sample_covariance=False)
    assert ours == pytest.approx(theirs, abs=1e-12)


@pytest.mark.parametrize("size", [(176, 208), (112, 192), (27, 64)])
@pytest.mark.parametrize("peak", [255, 1023])
def test_equals_an_independent_one_in_pytorch(size, peak):
    torch = pytest.importorskip("torch")
    a = smooth_frame(*size, peak=peak)
    b = noisy(a, peak / 20, peak)

    def blur(planes):
        offsets = torch.arange(11, dtype=torch.float64) - 5
        window = torch.exp(-(offsets**2) / 4.5)
        square = torch.outer(window, window) / window.sum() ** 2
        return torch.nn.functional.conv2d(planes, square[None, None])

    x, y = (torch.tensor(f.astype(np.float64)).permute(2, 0, 1)[:, None] / peak for f in (a, b))
    weights = SCALE_WEIGHTS[: ms_ssim_scales(*size)]
    product = torch.ones(3, dtype=torch.float64)
    for scale, weight in enumerate(weights):
        mu_x, mu_y = blur(x), blur(y)
        covariance = blur(x * y) - mu_x * mu_y
        spread = blur(x * x) - mu_x**2 + blur(y * y) - mu_y**2
        term = (2 * covariance + 0.0009) / (spread + 0.0009)
        if scale == len(weights) - 1:
            term = term * (2 * mu_x * mu_y + 0.0001) / (mu_x**2 + mu_y**2 + 0.0001)
        product *= torch.relu(term.mean(dim=(1, 2, 3))) ** (weight / sum(weights))
        pad = (0, x.shape[3] % 2, 0, x.shape[2] % 2)
        x, y = (torch.nn.functional.avg_pool2d(torch.nn.functional.pad(p, pad, mode="replicate"), 2) for p in (x, y))
    assert ms_ssim(a, b, peak) == pytest.approx(float(product.mean()), abs=1e-9)


def test_flat_frames_differ_by_their_luminance_alone():
    a, b = (np.full((64, 64, 3), value, np.uint8) for value in (100, 150))
    luminance = (2 * 100 * 150 + 2.55**2) / (100**2 + 150**2 + 2.55**2)
    weights = SCALE_WEIGHTS[:3]
    assert ms_ssim(a, b, 255) == pytest.approx(luminance ** (weights[-1] / sum(weights)), abs=1e-9)


def test_inverted_structure_counts_as_zero_and_is_no_nan():
    stripes = np.zeros((64, 64, 3), np.uint8)
    stripes[::2] = 255
    assert ms_ssim(stripes, 255 - stripes, 255) == 0.0


def test_a_single_pixel_is_compared_by_its_luminance():
    a, b = np.full((1, 1, 3), 0, np.uint8), np.full((1, 1, 3), 255, np.uint8)
    assert ms_ssim(a, b, 255) == pytest.approx(2.55**2 / (255**2 + 2.55**2), rel=1e-9)


@settings(max_examples=40)
@given(PLANES, st.sampled_from([(1, np.uint8), (255, np.uint8), (1023, np.uint16), (65535, np.uint16)]))
def test_in_range_symmetric_and_one_for_identical_frames(plane, depth):
    height, width, seed = plane
    peak, dtype = depth
    rng = np.random.default_rng(seed)
    a, b = rng.integers(0, peak, (2, height, width, 3), dtype=dtype, endpoint=True)
    value = ms_ssim(a, b, peak)
    assert 0 <= value <= 1
    assert value == ms_ssim(b, a, peak)
    assert ms_ssim(a, a, peak) == 1.0


@given(st.integers(0, 1000))
def test_more_noise_never_scores_higher(seed):
    frame = smooth_frame(48, 48, seed)
    scores = [ms_ssim(frame, noisy(frame, deviation), 255) for deviation in (0, 4, 16, 64)]
    assert scores == sorted(scores, reverse=True)


def test_frames_that_do_not_fit_are_refused():
    with pytest.raises(UsageError, match="one size"):
        ms_ssim(np.zeros((4, 4, 3), np.uint8), np.zeros((4, 5, 3), np.uint8), 255)
