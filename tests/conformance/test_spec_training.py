"""Sections 10 and 11 of spec.md against gsvc_ref: two implementations of each operation agree on painted inputs."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.random import Generator

from gsvc_base.rendering.definition import exact_gradients
from gsvc_base.splats import Splats
from gsvc_conformance import reference
from gsvc_conformance.spec import namespace

Values = dict[str, Any]
f4 = np.float32

SEEDS = range(60)
BINARY32 = 2.0**-20
"""Relative to an array's largest value: eight roundings to binary32, for sums of a few terms."""
BINARY64 = 1e-12


def normal(rng: Generator, *shape: int) -> np.ndarray:
    return rng.normal(size=shape).astype(f4)


# What each operation is asked.


def size(rng: Generator) -> tuple[int, int]:
    return int(rng.integers(1, 20)), int(rng.integers(1, 20))


def paint_render_gradients(rng: Generator) -> Values:
    height, width = size(rng)
    parameters = normal(rng, 12, 8)
    parameters[:, :2] = rng.uniform(-2, 21, (12, 2))
    parameters[:, [2, 4]] = np.exp(rng.uniform(-2, 2, (12, 2)))
    parameters[0, 2], parameters[1, 4], parameters[2, 2] = -1, 0, 1e-38  # degenerate
    parameters[3, :5] = 0.5, 0.5, 2.0**-126, 0, 1  # the thinnest that is not
    return {"parameters": parameters, "residual": normal(rng, height, width, 3)}


def paint_loss(rng: Generator) -> Values:
    height, width = size(rng)
    picture = rng.choice([0, 1, 0.5, -0.5, 1.5, 0.3], (height, width, 3)).astype(f4)
    return {"picture": picture, "target": rng.random((height, width, 3), f4)}


def paint_adan_step(rng: Generator) -> Values:
    shape = (7, 3)
    state = {name: normal(rng, *shape) for name in ("parameters", "gradients", "m", "v", "n", "previous")}
    state["n"] = np.abs(state["n"]) + f4(1)
    return state | {
        "steps": np.append(rng.integers(0, 30, 5), [0, 0]),
        "rates": rng.uniform(0.01, 0.1, 3).astype(f4),
        "units": rng.uniform(0.5, 4, 3).astype(f4),
        **dict(zip(("beta1", "beta2", "beta3"), rng.uniform(0, 0.99, 3).tolist(), strict=True)),
        "epsilon": float(rng.choice([1e-8, 0.1])),
    }


def paint_learning_rates(rng: Generator) -> Values:
    iterations = np.array([0, 6, 7, 13, 14, 700])
    return {"iterations": iterations, "rate": 1e-3, "factor": float(rng.random()), "interval": 7}


def paint_converged(rng: Generator) -> Values:
    losses = rng.choice([0.5, 0.5 + 2.0**-20, 0.5 + 2.0**-19, 0.75], rng.integers(1, 30))
    return {"losses": losses, "patience": int(rng.integers(1, 5)), "tolerance": float(rng.choice([0, 2.0**-20, 1e-7]))}


def paint_pruning_plan(rng: Generator) -> Values:
    first = int(rng.integers(1, 600))
    return {
        "splats": int(rng.integers(0, 500)),
        "iterations": int(rng.choice([0, 1, 5, 100, 999, 4000, 50_000])),
        "fraction": float(rng.choice([0, 0.05, 0.1, 0.5, rng.random()])),
        "first": first,
        "last": first + int(rng.integers(0, 4000)),
        "interval": int(rng.integers(1, 400)),
    }


def paint_prune(rng: Generator) -> Values:
    weights = rng.choice(np.array([-1, 1, 0, 0.5, -0.5, 2], f4), rng.integers(0, 20))
    return {"weights": weights, "removed": int(rng.integers(0, len(weights) + 1))}


def paint_augment(rng: Generator) -> Values:
    uniforms = rng.random((rng.integers(0, 9), 8), f4)
    return {"values": normal(rng, 4, 9), "uniforms": uniforms, "width": 123, "height": 77}


def paint_select_key_frames(rng: Generator) -> Values:
    frames = int(rng.integers(1, 40))
    return {
        "losses_i": rng.choice([0, 0.1, 0.25, 0.5], frames) if rng.integers(2) else np.full(frames, 0.25),
        "losses_p": rng.choice([0.1, 0.25, 0.25, 0.25, 0.25, 0.5], frames - 1),
        "window": int(rng.integers(0, 13)),
        "threshold": float(rng.choice([0, 1, 1, 2.5, 3])),
        "guard_ratio": float(rng.choice([0, 1.5, 2])),
        "robust": int(rng.integers(0, 2)),
    }


def paint_lsq_quantize(rng: Generator) -> Values:
    bits = int(rng.integers(1, 13))
    scale = (2.0 ** rng.integers(-8, 3, 3)).astype(f4)
    offset = rng.choice(np.array([-1, 0, 0.5], f4), 3)
    halves = rng.integers(-4, 2 ** (bits + 1) + 4, (20, 3)) / 2  # ties and ends
    x = offset + scale * np.concatenate([halves, rng.uniform(-2, 2**bits + 2, (20, 3))])
    return {"x": x.astype(f4), "scale": scale, "offset": offset, "bits": bits}


def paint_lsq_dequantize(rng: Generator) -> Values:
    codes = rng.integers(0, 4096, (20, 3)).astype(np.uint16)
    return {"codes": codes, "scale": np.abs(normal(rng, 3)) + f4(0.01), "offset": normal(rng, 3)}


def paint_lsq_gradients(rng: Generator) -> Values:
    return paint_lsq_quantize(rng) | {"grad_output": normal(rng, 40, 3)}


def paint_rvq_assign(rng: Generator) -> Values:
    sizes = rng.integers(1, 9, rng.integers(1, 4))
    books = rng.integers(-2, 3, (sizes.sum(), 3)) / 2 if rng.integers(2) else rng.normal(size=(sizes.sum(), 3))
    x = rng.integers(-4, 5, (rng.integers(0, 40), 3)) / 4  # with halves in the books: ties
    return {"x": x.astype(f4), "codebook_sizes": sizes, "codebooks": books.astype(np.float16).astype(f4)}


def paint_commitment(rng: Generator) -> Values:
    inputs = paint_rvq_assign(rng)
    indices = rng.integers(0, inputs["codebook_sizes"], (len(inputs["x"]), len(inputs["codebook_sizes"])))
    x, *books = inputs.values()
    return dict(
        zip(("x", "indices", "codebook_sizes", "codebooks"), (x, indices.astype(np.uint16), *books), strict=True)
    )


def paint_rvq_update(rng: Generator) -> Values:
    inputs = paint_commitment(rng)
    words = len(inputs["codebooks"])
    if len(inputs["x"]):  # met exactly by stage 1, so never drawn, not even by 0
        inputs["x"][0] = inputs["codebooks"][inputs["indices"][0, 0]]
    counts = rng.choice([0, 0.25, 1, 20], words)
    inputs |= {"counts": counts, "sums": rng.normal(size=(words, 3)) * counts[:, None]}  # full fractions: off any tie
    ends = np.append(rng.random(words), [0, np.nextafter(1, 0)])
    return inputs | {
        "uniforms": rng.choice(ends, words),
        "decay": float(rng.choice([0.5, 0.8])),  # a half of 1 is dead_count exactly
        "smoothing": 1e-5,
        "dead_count": float(rng.choice([0, 0.5, 3])),
    }


def paint_format(rng: Generator) -> Values:
    chroma = int(rng.integers(1, 4))
    matrices = [1, 2, 4, 5, 6, 7, 8, 9] + [0] * (chroma == 3)
    return {
        "chroma_format": chroma,
        "matrix_coefficients": int(rng.choice(matrices)),
        "video_full_range_flag": int(rng.integers(0, 2)),
        "chroma_sample_loc_type": int(rng.integers(0, 6)),
        "bit_depth": int(rng.choice([8, 9, 10, 16])),
    }


def samples(rng: Generator, bit_depth: int, shape: tuple[int, ...]) -> np.ndarray:
    return rng.integers(0, 2**bit_depth, shape).astype(np.uint8 if bit_depth == 8 else np.uint16)


def paint_frame_to_planes(rng: Generator) -> Values:
    options = paint_format(rng)
    height, width = size(rng)
    height = int(rng.choice([height, 576, 577]))  # either side of what matrix 2 depends on
    return {"frame": samples(rng, options["bit_depth"], (height, width, 3)), **options}


def paint_planes_to_frame(rng: Generator) -> Values:
    frame, *values = paint_frame_to_planes(rng).values()
    options = dict(zip(paint_format(rng), values, strict=True))
    rows, columns = ((side + 1) // 2 for side in frame.shape[:2])
    shape = {1: (rows, columns), 2: (frame.shape[0], columns), 3: frame.shape[:2]}[options["chroma_format"]]
    cb, cr = (samples(rng, options["bit_depth"], shape) for _ in range(2))
    return {"y": frame[:, :, 0].copy(), "cb": cb, "cr": cr} | options


def paint_metrics(rng: Generator) -> Values:
    bit_depth = int(rng.choice([8, 10, 16]))
    shape = (*rng.integers(1, 50, 2).tolist(), 3)
    return {"a": samples(rng, bit_depth, shape), "b": samples(rng, bit_depth, shape), "bit_depth": bit_depth}


# How far outputs may be off, relative to the largest value of each.


@dataclass(frozen=True)
class Check:
    """An operation, what paints its inputs, and how far an output may be off, relative to its largest value."""

    operation: str
    paint: Callable[[Generator], Values]
    tolerance: float = 0.0


CHECKS = [
    Check("render_gradients", paint_render_gradients, 2.0**-23),
    Check("loss", paint_loss, BINARY32),
    Check("weighted_parameters", lambda rng: {"values": normal(rng, 9, 9)}),
    Check("weighted_gradients", lambda rng: {"values": normal(rng, 9, 9), "gradients": normal(rng, 9, 8)}, BINARY32),
    Check("adan_step", paint_adan_step, BINARY32),
    Check("learning_rates", paint_learning_rates, BINARY64),
    Check("converged", paint_converged),
    Check("pruning_plan", paint_pruning_plan),
    Check("prune", paint_prune),
    Check("augment", paint_augment),
    Check("select_key_frames", paint_select_key_frames),
    Check("lsq_quantize", paint_lsq_quantize),
    Check("lsq_dequantize", paint_lsq_dequantize),
    Check("lsq_gradients", paint_lsq_gradients, 2.0**-23),
    Check("rvq_assign", paint_rvq_assign),
    Check("rvq_update", paint_rvq_update, BINARY64),
    Check("commitment", paint_commitment, BINARY32),
    Check("planes_to_frame", paint_planes_to_frame),
    Check("frame_to_planes", paint_frame_to_planes),
    Check("metrics", paint_metrics, BINARY64),
]


def exact_render_gradients(parameters: np.ndarray, residual: np.ndarray) -> Values:
    """The definition in gsvc_ref: its kernels may be off by the bounds of section 9.2."""
    return {"gradients": exact_gradients(Splats.from_array(parameters), residual).astype(f4)}


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.operation)
def test_spec_and_reference_agree(check: Check) -> None:
    answer = {"render_gradients": exact_render_gradients}.get(check.operation) or reference.namespace()[check.operation]
    for seed in SEEDS:
        inputs = check.paint(np.random.default_rng(seed))
        expected = answer(**inputs)
        kept = {name: np.array(value) for name, value in inputs.items()}
        found = namespace()[check.operation](**inputs)
        for name, value in inputs.items():
            np.testing.assert_array_equal(value, kept[name], err_msg=f"the input {name} was changed")
        assert list(found) == list(expected)
        for name, value in found.items():
            assert value.dtype == expected[name].dtype, name
            assert value.shape == expected[name].shape, name
            wide = expected[name].astype(np.float64)
            atol = check.tolerance * np.abs(wide).max(initial=0)
            np.testing.assert_allclose(value.astype(np.float64), wide, rtol=0, atol=atol, err_msg=f"{name}, {seed}")


def test_equal_frames_are_infinitely_good() -> None:
    frame = samples(np.random.default_rng(0), 8, (12, 13, 3))
    found = namespace()["metrics"](frame, frame, 8)
    assert found == {"mse": 0, "psnr": np.inf, "ms_ssim": 1}
