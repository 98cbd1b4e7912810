"""Several threads at once get what one alone gets: nothing in the library is shared but what says so."""

import asyncio
import io
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import gsvc_ref
from gsvc_lab.scenes import demo_clip
from gsvc_ref.metrics import compare_frames
from gsvc_ref.rendering import Objective, render_sum
from gsvc_ref.stream import DecodedFrame
from gsvc_ref.testing import random_stream
from gsvc_ref.video import ColorDescription, VideoFormat

COLOR = ColorDescription(1, 1, 0, True, 0)
THREADS = 3
JOBS: dict[str, Callable[[int], Any]] = {}


def job(function: Callable[[int], Any]) -> Callable[[int], Any]:
    JOBS[function.__name__] = function
    return function


def size(seed: int) -> tuple[int, int]:
    return 40 + 24 * (seed % 4), 30 + 10 * (seed % 3)


def splats(seed: int, count: int = 9000) -> gsvc_ref.Splats:
    """More than a task for each thread takes."""
    rng = np.random.default_rng(seed)
    width, height = size(seed)
    columns = [rng.uniform(0, side, count) for side in (width, height)]
    columns += [rng.uniform(low, 4, count) for low in (0.4, -1, 0.4)]
    parameters = np.column_stack([*columns, rng.normal(0, 0.05, (count, 3))])
    return gsvc_ref.Splats.from_array(parameters.astype(np.float32))


def clip(seed: int) -> tuple[list[np.ndarray], VideoFormat]:
    width, height = size(seed)
    return list(demo_clip(width, height, 2, seed=seed)), VideoFormat(width, height, Fraction(25), 8, "rgb", COLOR)


@job
def encode(seed: int) -> bytes:
    file = io.BytesIO()
    gsvc_ref.encode(clip(seed), file, gsvc_ref.Settings.quick(splats=20, seed=seed))
    return file.getvalue()


@job
def decode(seed: int) -> list[bytes]:
    return [frame.tobytes() for frame in gsvc_ref.decode(random_stream(seed).data)]


@job
def render(seed: int) -> list[bytes]:
    precisions = ("fast", "deterministic")
    return [gsvc_ref.render(splats(seed), *size(seed), precision=precision).tobytes() for precision in precisions]


@job
def sums(seed: int) -> bytes:
    return render_sum(splats(seed, 40), *size(seed), precision="exact").tobytes()


@job
def gradients(seed: int) -> bytes:
    width, height = size(seed)
    residual = np.random.default_rng(seed).normal(size=(height, width, 3))
    return gsvc_ref.render_gradients(splats(seed), residual).tobytes()


@job
def objective(seed: int) -> list[float]:
    frames, _ = clip(seed)
    objective = Objective(frames[0] / np.float32(255))
    parameters = splats(seed).to_array()
    losses = []
    for _ in range(3):
        loss, gradient = objective.evaluate(parameters)
        parameters[:, 5:] -= 0.1 * gradient[:, 5:]
        losses.append(loss)
    return losses


@job
def comparison(seed: int) -> list[Any]:
    frames, video = clip(seed)
    other = [np.roll(frame, 1, axis=0) for frame in frames]
    return [(frame.psnr, frame.ms_ssim) for frame in compare_frames(frames, other, video.peak).frames]


@pytest.fixture(scope="module")
def alone() -> dict[tuple[str, int], Any]:
    """What each job gives when nothing else runs."""
    return {(name, seed): work(seed) for name, work in JOBS.items() for seed in range(THREADS)}


@pytest.mark.exhaustive
def test_jobs_of_every_kind_at_the_same_time(alone):
    with ThreadPoolExecutor(THREADS) as pool:
        order = sorted(alone, key=lambda key: key[1])  # kinds and sizes mixed
        results = {key: pool.submit(JOBS[key[0]], key[1]) for key in order}
        assert {key for key in alone if results[key].result() != alone[key]} == set()


def test_jobs_of_one_kind_at_the_same_moment(alone):
    for name, work in JOBS.items():
        barrier = threading.Barrier(THREADS)

        def begin(seed: int, work=work, barrier=barrier) -> Any:
            barrier.wait(30)
            return work(seed)

        with ThreadPoolExecutor(THREADS) as pool:
            assert list(pool.map(begin, range(THREADS))) == [alone[name, seed] for seed in range(THREADS)], name


def test_asyncio_to_thread(alone):
    async def gather() -> list[Any]:
        return await asyncio.gather(*(asyncio.to_thread(work, 0) for work in JOBS.values()))

    assert asyncio.run(gather()) == [alone[name, 0] for name in JOBS]


@pytest.fixture(scope="module")
def stream() -> bytes:
    """Twelve frames, four of them I-frames."""
    frames = list(demo_clip(24, 16, 12))
    file = io.BytesIO()
    settings = gsvc_ref.Settings.quick(splats=9, key_frames=3, threads=1)
    gsvc_ref.encode((frames, VideoFormat(24, 16, Fraction(25), 8, "rgb", COLOR)), file, settings)
    return file.getvalue()


@pytest.mark.parametrize("where", ["file", pytest.param("memory", marks=pytest.mark.exhaustive)])
def test_one_open_stream_read_by_many_threads(stream, where, tmp_path):
    path = tmp_path / "clip.gsvc"
    path.write_bytes(stream)
    with gsvc_ref.open(path if where == "file" else stream) as shared:
        expected = [frame.splats.tobytes() for frame in shared]

        def read(begin: int) -> bool:
            frames = [frame.splats.tobytes() for frame in shared.frames(begin)]
            pictures = list(gsvc_ref.decode(shared, start=begin, stop=begin + 2))
            salvaged = [part.splats.tobytes() for part in shared.salvage() if isinstance(part, DecodedFrame)]
            whole = len(pictures) == min(2, 12 - begin) and shared.format.frame_count == 12 and salvaged == expected
            return whole and frames == expected[begin:]

        with ThreadPoolExecutor(8) as pool:
            assert all(pool.map(read, [*range(12)] * 4))


def test_a_stream_closed_by_another_thread_says_so(stream, tmp_path):
    path = tmp_path / "clip.gsvc"
    path.write_bytes(stream)
    shared = gsvc_ref.open(path)
    frames = shared.frames()
    next(frames)
    thread = threading.Thread(target=shared.close)
    thread.start()
    thread.join()
    with pytest.raises(gsvc_ref.UsageError, match="was closed"):
        list(frames)
    with pytest.raises(gsvc_ref.UsageError, match="was closed"):
        list(shared.frames(6))
