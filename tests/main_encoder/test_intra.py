"""I-frames of profile main: what is coded is what was fitted, and choices are those of the code length."""

import numpy as np
import pytest

codec = pytest.importorskip("codec")

from gsvc_ref.main_encoder import intra  # noqa: E402
from gsvc_ref.main_encoder.coordinates import to_coordinates  # noqa: E402
from gsvc_ref.main_encoder.density_choice import choose_alphas, choose_densities  # noqa: E402
from gsvc_ref.main_encoder.rounding import coordinates_of_state, rounded  # noqa: E402

FEW = intra.IntraSettings(grow=20, weigh=12, settle=3)


def a_picture(height: int = 40, width: int = 56) -> np.ndarray:
    """Smooth shapes, an edge and some texture."""
    y, x = np.mgrid[:height, :width] / 16.0
    grey = 0.4 + 0.2 * np.sin(x) * np.cos(0.7 * y) + 0.2 * (x + 0.5 * y > 2.5) + 0.05 * np.sin(9 * x)
    return np.clip(np.stack([grey, 0.9 * grey + 0.05, 1 - grey], axis=2), 0, 1).astype(np.float32)


def written(frame: intra.IntraFrame, width: int, height: int) -> tuple[np.ndarray, float]:
    """The state that the codec makes of a frame's codes, and its bits."""
    coder = codec.Write()
    coder.part = "parameters"
    codec.density_parameters(coder, frame.densities, None)
    step = codec.step_D(frame.quantizer)
    state = codec.code_splats(coder, len(frame.state), step, width, height, frame.codes, frame.densities)
    return state, coder.total()


def test_a_frame_is_what_a_decoder_has() -> None:
    picture = a_picture()
    frame = intra.encode_intra(picture, 60, np.random.default_rng(1), settings=FEW, threads=1)
    state, _ = written(frame, 56, 40)
    assert np.array_equal(state, frame.state)
    assert np.array_equal(codec.to_binary32(state), frame.parameters)
    assert intra.Target(picture, threads=1).psnr(frame.parameters) > 28


def test_threads_do_not_matter() -> None:
    frames = [
        intra.encode_intra(
            a_picture(), 30, np.random.default_rng(2), settings=FEW, threads=threads, precision="deterministic"
        )
        for threads in (1, 2)
    ]
    assert np.array_equal(frames[0].state, frames[1].state)
    assert frames[0].densities == frames[1].densities


def test_settling_beats_rounding() -> None:
    picture = a_picture()
    target = intra.Target(picture, threads=1)
    rng = np.random.default_rng(3)
    z = intra.grow(target, 60, rng, FEW)
    step = codec.step_D(intra.quantizer_for(z))
    z = intra.weigh(target, z, step / 16, rng, FEW)
    plain = target.psnr(rounded(z, step, 56, 40).parameters)
    target.hold(np.zeros((0, 8), np.float32))
    settled = target.psnr(intra.settle(target, z, step, rng, FEW).parameters)
    assert settled > plain + 0.2


def test_a_layer_adds_to_its_base() -> None:
    picture = a_picture()
    base = intra.encode_intra(picture, 20, np.random.default_rng(4), settings=FEW, threads=1)
    layer = intra.encode_intra(picture, 30, np.random.default_rng(5), settings=FEW, base=base.parameters, threads=1)
    alone = intra.Target(picture, threads=1).psnr(base.parameters)
    both = intra.Target(picture, base.parameters, threads=1).psnr(layer.parameters)
    assert both > alone + 1


def test_a_quality_is_reached() -> None:
    picture = a_picture()
    frame = intra.encode_intra_psnr(picture, 34.0, np.random.default_rng(6), FEW, splats=30, most_splats=200, threads=1)
    assert 34.0 <= intra.Target(picture, threads=1).psnr(frame.parameters) < 37


@pytest.mark.parametrize("shape", [(1, 1), (3, 50), (24, 24)])
def test_black_and_tiny_pictures(shape: tuple[int, int]) -> None:
    for value in (0.0, 0.5):
        picture = np.full((*shape, 3), value, np.float32)
        frame = intra.encode_intra(picture, 1, np.random.default_rng(9), settings=FEW, threads=1)
        assert len(frame.state) <= 1
        if len(frame.state):
            assert np.array_equal(written(frame, shape[1], shape[0])[0], frame.state)


def test_rounding_is_close_and_keeps_its_limits() -> None:
    rng = np.random.default_rng(7)
    z = np.column_stack([
        rng.uniform(-3, 60, 500), rng.uniform(-3, 44, 500), rng.normal(1, 1, 500), rng.normal(0, 1, 500),
        rng.normal(0, 9, 500), rng.normal(0, 300, (500, 3)),
    ])  # fmt: skip
    result = rounded(z, 320, 56, 40)
    assert (np.abs(result.state[:, 4]) <= codec.S_MOST).all()
    assert (result.cell >= 0).all()
    assert (result.cell < (14, 10)).all()
    assert np.abs(result.state[:, 5:] / 16 - z[:, 5:]).max() <= 0.6 * 20
    back = np.empty(z.shape)
    coordinates_of_state(result.state, back)
    assert back[:, [2, 3, 4]] == pytest.approx(to_coordinates(result.parameters)[:, [2, 3, 4]], abs=2e-3)


@pytest.mark.parametrize("size", [1, 40, 700])
def test_densities_are_at_least_as_good_as_their_neighbours(size: int) -> None:
    rng = np.random.default_rng(size)
    k = np.round(rng.laplace(0, (30, 6, 4), (size, 3))).astype(np.int64)
    level = codec.level(k * 320, 320)
    g = np.round(rng.logistic(0, 0.6, (size, 3)) * 2.0 ** level[:, None]).astype(np.int64)
    chosen = choose_densities(k, g, 320)
    codes = {"cx": np.zeros(size, np.int64), "cy": np.zeros(size, np.int64), "k": k, "g": g}
    codes |= {"px": np.zeros(size, np.int64), "py": np.zeros(size, np.int64)}

    def bits(densities: dict[str, tuple[int, int, int, int]]) -> float:
        coder = codec.Write()
        codec.code_splats(coder, size, 320, 4, 4, codes, densities)
        return float(coder.total())

    least = bits(chosen)
    for name in ("luma", "chroma1", "size", "shear"):
        centre, sigma, family, slope = chosen[name]
        for trial in ((centre, min(sigma + 2, 31), family, slope), (centre, sigma, 1 - family, slope)):
            assert bits({**chosen, name: trial}) >= least - 1e-6


def test_alphas_are_those_of_the_least_length() -> None:
    rng = np.random.default_rng(8)
    cells = np.sort(codec.morton(rng.integers(0, 14, 300) ** 2 // 14, rng.integers(0, 10, 300), 14, 10))
    written: list[int] = []

    class Counting(codec.Write):  # type: ignore[misc, name-defined]
        def raw(self, size: int, value: int) -> int:
            written.append(value)
            return value

    codec.cells_pass(Counting(), len(cells), 14, 10, cells)
    assert choose_alphas(cells, 14, 10) == written
