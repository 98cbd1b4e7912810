"""The oracles of metrics and colour: binary32 computations in several arrangements are judged as right."""

import numpy as np
import pytest
from oracle_checks import assert_legal, in_blocks, runs

from gsvc_conformance.operations.color_map import ColorMap

F4 = np.float32


def windowed(plane, window, *, in_one_pass):
    views = np.lib.stride_tricks.sliding_window_view(plane, [len(w) for w in window])
    if in_one_pass:
        return np.einsum("ijkl,kl->ij", views, np.multiply.outer(*window).astype(F4), dtype=F4)
    return np.einsum("ijkl,k,l->ij", views, *(w.astype(F4) for w in window), dtype=F4, optimize=True)


def ms_ssim_in_binary32(a, b, bit_depth, *, by_sums, normalised, in_one_pass):
    peak = F4(1 if normalised else 2**bit_depth - 1)
    planes = [np.moveaxis(frame.astype(F4) / F4(2**bit_depth - 1) * peak, -1, 0) for frame in (a, b)]
    weights = np.array([0.0448, 0.2856, 0.3001, 0.2363, 0.1333], F4)
    side, scales = min(a.shape[:2]), 1
    while scales < 5 and (side := (side + 1) // 2) >= 11:
        scales += 1
    results = []
    for x, y in zip(*planes, strict=True):
        product = F4(1)
        for scale in range(scales):
            taps = [np.exp(-((np.arange(n) - (n - 1) / 2) ** 2) / 4.5) for n in (min(11, s) for s in x.shape)]
            window = [w / w.sum() for w in taps]

            def mean(plane, window=window):
                return windowed(plane, window, in_one_pass=in_one_pass)

            c1, c2 = (F4(0.01) * peak) ** 2, (F4(0.03) * peak) ** 2
            mu_x, mu_y = mean(x), mean(y)
            if by_sums:
                plus, minus = mean((x + y) ** 2) - mean(x + y) ** 2, mean((x - y) ** 2) - mean(x - y) ** 2
                twice_covariance, variances = (plus - minus) / 2, (plus + minus) / 2
            else:
                twice_covariance = 2 * (mean(x * y) - mu_x * mu_y)
                variances = mean(x * x) - mu_x**2 + mean(y * y) - mu_y**2
            cs = (twice_covariance + c2) / (variances + c2)
            ssim = (2 * mu_x * mu_y + c1) / (mu_x**2 + mu_y**2 + c1) * cs
            factor = ssim if scale == scales - 1 else cs
            exponent = weights[scale] / weights[:scales].sum(dtype=F4)
            product *= max(factor.mean(dtype=F4), F4(0)) ** exponent
            x, y = (np.pad(p, [(0, n % 2) for n in p.shape], mode="edge") for p in (x, y))
            x, y = ((p[::2, ::2] + p[1::2, ::2] + p[::2, 1::2] + p[1::2, 1::2]) / F4(4) for p in (x, y))
        results.append(product)
    return float(np.mean(results, dtype=F4))


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("by_sums", "normalised", "in_one_pass"),
    [(False, False, False), (False, True, True), (True, False, True), (True, True, False)],
)
def test_ms_ssim_in_binary32_uses_a_sixth_of_its_limit(by_sums, normalised, in_one_pass):
    ratios = {}
    for case, inputs, expected in runs("metrics"):
        actual = ms_ssim_in_binary32(**inputs, by_sums=by_sums, normalised=normalised, in_one_pass=in_one_pass)
        ratios[case.id] = abs(actual - expected["ms_ssim"].value) / expected["ms_ssim"].bound
    assert max(ratios.values()) < 1 / 6, ratios


def psnr_in_binary32(a, b, bit_depth, *, normalised):
    peak = F4(2**bit_depth - 1)
    x, y = (frame.astype(F4) / peak if normalised else frame.astype(F4) for frame in (a, b))
    mse = in_blocks((x - y) ** 2) / F4(a.size)
    if normalised:
        psnr, mse = F4(-10) * np.log10(mse), mse * peak * peak
    else:
        psnr = F4(20) * np.log10(peak) - F4(10) * np.log10(mse)
    return {"mse": np.array(float(mse)), "psnr": np.array(float(psnr))}


@pytest.mark.exhaustive
@pytest.mark.parametrize("normalised", [False, True])
def test_psnr_in_binary32_is_legal(normalised):
    assert_legal("metrics", lambda **v: psnr_in_binary32(**v, normalised=normalised))


def color_in_binary32(size, elements):
    """The map of a format, and its coefficients rounded to binary32; its filters are exact."""
    color = ColorMap(size, *elements)
    gains = np.array([gain for gain, _ in color.scales], F4)
    offsets = np.array([offset for _, offset in color.scales], F4)
    matrices = [np.array([[float(c) for c in row] for row in rows]) for rows in (color.forward, color.inverse)]
    return color, F4(color.peak), gains, offsets, matrices


def narrowed(values, peak):
    return np.rint(np.clip(values, F4(0), peak)).astype(np.uint8 if peak == 255 else np.uint16)


def frame_in_binary32(y, cb, cr, *elements, normalised):
    color, peak, gains, offsets, (_, inverse) = color_in_binary32(y.shape, elements)
    planes = np.stack([y, color.up(cb), color.up(cr)], axis=-1).astype(F4)
    if normalised:
        frame = (planes - offsets) / gains @ inverse.T.astype(F4) * peak
    else:
        matrix = (inverse * (float(peak) / gains.astype(np.float64))).astype(F4)
        frame = planes @ matrix.T - matrix @ offsets
    return {"frame": narrowed(frame, peak)}


def planes_in_binary32(frame, *elements, normalised):
    color, peak, gains, offsets, (forward, _) = color_in_binary32(frame.shape[:2], elements)
    means = np.stack([color.down(frame[..., c]) for c in range(3)], axis=-1).astype(F4)
    results = {}
    for i, (name, source) in enumerate(zip(("y", "cb", "cr"), (frame.astype(F4), means, means), strict=True)):
        if normalised:
            values = source / peak @ forward[i].astype(F4) * gains[i] + offsets[i]
        else:
            row = (forward[i] * (float(gains[i]) / float(peak))).astype(F4)
            values = offsets[i] + source[..., 2] * row[2] + source[..., 1] * row[1] + source[..., 0] * row[0]
        results[name] = narrowed(values, peak)
    return results


EXACT_TIES = ("ties_of", "impulse", "edges", "ycgco")
"""Cases with exact ties or exact coefficients, which numbers that were brought to 0..1 do not keep."""


@pytest.mark.parametrize("operation", ["planes_to_frame", "frame_to_planes"])
@pytest.mark.parametrize("normalised", [False, True])
def test_colour_in_binary32_is_legal(operation, normalised):
    variant = frame_in_binary32 if operation == "planes_to_frame" else planes_in_binary32
    open_decisions = 0
    for case, inputs, expected in runs(operation):
        if normalised and any(part in case.id for part in EXACT_TIES):
            continue
        outputs = variant(*inputs.values(), normalised=normalised)
        for name, expectation in expected.items():
            assert expectation.judge(outputs[name]).passed, f"{case.id}: {expectation.judge(outputs[name]).message}"
            open_decisions += np.count_nonzero(expectation.alternative != expectation.value)
    assert open_decisions > 0
