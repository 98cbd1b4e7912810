"""Peak memory of decoding: at most 64 MiB and four times the declared frame, whatever a stream asks for.

The declared frame is what `memory.declared_frame` says. Here streams of the second level, whose frames are as small as
they are demanding; ``python -m tests.hostile memory LEVEL`` measures the others.
"""

from pathlib import Path

import numpy as np
import pytest

from gsvc_base.splats import Splats
from gsvc_ref.bitstream import LEVELS
from gsvc_ref.rendering import Objective, Renderer, SequenceRenderer
from gsvc_ref.rendering.fast.batches import bytes_of_thread
from gsvc_ref.rendering.fast.binning import LISTED, Binning, windows_of
from gsvc_ref.rendering.fast.rasterizer import BUFFERS_BYTES, Rasterizer
from tests.hostile.__main__ import main
from tests.hostile.memory import SUPPORTED, measure_level

LEVEL = 2


@pytest.mark.exhaustive
@pytest.mark.skipif(not SUPPORTED, reason="the system does not tell the peak memory of a part of a run")
def test_peak_memory(tmp_path: Path) -> None:
    entries = ("StreamReader of a pipe", "decode", "frames(1)", "gsvc decode", "gsvc dump")
    names = (
        "main, splats in few bytes",
        "splats in few bytes",
        "splats on a picture",
        "rows through all strips",
        "tall picture",
        "index",
        "words",
    )
    for name, entry, peak, allowed, error, rule in measure_level(LEVEL, tmp_path, entries, names):
        assert peak <= allowed, (name, entry)
        assert bool(error) == bool(rule), (name, entry, error)
        assert (rule or "") in error, (name, entry)


@pytest.mark.parametrize(("peak", "good"), [(5, True), (11, False)])
def test_the_table_ends_with_a_verdict(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], peak: int, good: bool
) -> None:
    def measured(level: int, folder: Path, entries: list[str], names: list[str]) -> list[tuple[object, ...]]:
        return [(names[0], entries[0], peak << 20, 10 << 20, "R-1", "R-1")]

    monkeypatch.setattr("tests.hostile.memory.measure_level", measured)
    monkeypatch.setattr("tests.hostile.memory.cases", lambda level: {"words": None})
    assert main(["memory", "1", "decode"]) == (0 if good else 1)
    head, row, verdict = capsys.readouterr().out.splitlines()
    assert row.index("words") == head.index("case")
    assert row.index("decode") == head.index("entry")
    assert verdict == "level 1: 1 measured, " + (
        "all below what is allowed, with the errors that must come" if good else "1 WRONG"
    )


@pytest.mark.parametrize(
    ("words", "status", "told"),
    [
        (["memory", "--help"], 0, "\n  'decode, deterministic'\n"),
        (["memory", "9"], 2, "argument LEVEL: invalid choice: 9"),
        (["memory", "1", "decode,"], 2, "there is no entry 'decode,'; --help lists them"),
        ([], 2, "the following arguments are required: command"),
    ],
)
def test_wrong_use_is_told(capsys: pytest.CaptureFixture[str], words: list[str], status: int, told: str) -> None:
    with pytest.raises(SystemExit) as end:
        main(words)
    assert end.value.code == status
    said = capsys.readouterr()
    assert told in said.out + said.err


def test_bytes_a_splat_at_each_level() -> None:
    """What is promised beside the picture: a payload, which is two sets of parameters, and one set, four times."""
    for limits in LEVELS.values():
        assert limits.payload == 2 * 32 * limits.splats


def crowd(count: int, width: int, height: int) -> Splats:
    """Splats of a few rows through all tiles, and some small ones, of all colours."""
    rng = np.random.default_rng(count)
    packed = np.empty((count, 8), np.float32)
    packed[:, 0] = rng.uniform(0, width, count)
    packed[:, 1] = rng.uniform(0, height, count)
    packed[:, 2] = rng.choice([0.3, 2, width], count)
    packed[:, 3] = rng.uniform(-1, 1, count)
    packed[:, 4] = rng.uniform(0.2, 1, count)
    packed[:, 5:] = rng.normal(0, 0.01, (count, 3))
    return Splats.from_array(packed)


@pytest.fixture
def short_lists(monkeypatch: pytest.MonkeyPatch) -> None:
    """Windows of few tiles, such as hostile streams lead to."""
    monkeypatch.setattr("gsvc_ref.rendering.fast.binning.LISTED", 1)


def renderings(splats: Splats, width: int, height: int, threads: int) -> list[bytes]:
    """Everything that goes over tiles, as bytes."""
    residual = np.linspace(-1, 1, 3 * width * height, dtype=np.float32).reshape(height, width, 3)
    results = []
    for precision in ("fast", "deterministic"):
        renderer = Renderer(width, height, precision=precision, threads=threads)
        results += [renderer.picture(splats), renderer.frame(splats, 8), renderer.gradients(splats, residual)]
        objective = Objective(abs(residual), threads, precision=precision)
        loss, gradient = objective.evaluate(splats.to_array())
        results += [np.array(loss), gradient, objective.picture()]
        sequence = SequenceRenderer(width, height, precision=precision, threads=threads)
        sequence.next_frame(splats, 8)
        moved = splats.to_array()
        moved[0, 0] += 3
        results.append(sequence.next_frame(Splats.from_array(moved), 8, np.arange(len(splats))).copy())
    return [np.ascontiguousarray(result).tobytes() for result in results]


def test_windows_and_blocks_change_no_bit(request: pytest.FixtureRequest) -> None:
    """5000 splats: more than a window has intersections, and in each tile more than a batch has."""
    splats, width, height = crowd(5000, 90, 70), 90, 70
    whole = renderings(splats, width, height, threads=1)
    request.getfixturevalue("short_lists")
    assert renderings(splats, width, height, threads=1) == whole
    assert renderings(splats, width, height, threads=2) == whole


def test_windows() -> None:
    offsets = np.array([0, 3, 3, 8, 9, 20, 21])
    assert windows_of(offsets, 100) == [(0, 6)]
    assert windows_of(offsets, 5) == [(0, 2), (2, 3), (3, 4), (4, 5), (5, 6)]
    assert windows_of(offsets, 8) == [(0, 3), (3, 4), (4, 5), (5, 6)]
    assert windows_of(np.zeros(4, np.int64), 1) == [(0, 3)]


def test_intersections_that_are_held() -> None:
    """A megabyte of parameters would have 16 million intersections."""
    splats = Splats.from_array(np.tile(np.array([2048, 1.5, 4096, 0, 0.1, 1, 1, 1], np.float32), (1 << 15, 1)))
    binning = Binning(4096, 4, threads=1)
    binning.load_splats(splats)
    assert binning.intersection_count == 4096 // 16 << 15
    assert len(binning.bins.intersections) <= LISTED


@pytest.mark.parametrize("height", [1, 1080, 65535])
def test_buffers_of_many_threads(height: int) -> None:
    rasterizer = Rasterizer(65535, height, threads=1000)
    held = sum(buffers.tile.nbytes + buffers.weights.nbytes for buffers in rasterizer.buffers)
    assert held < rasterizer.threads * bytes_of_thread(height) <= BUFFERS_BYTES
    assert rasterizer.threads >= (60 if height < 2000 else 3)
