"""Small clips, a source that counts, and settings that take a blink: what the tests of the codec share."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from fractions import Fraction
from io import BytesIO

import numpy as np

from gsvc_base.errors import GsvcError
from gsvc_ref.encoder import EncodeReport, Settings, encode
from gsvc_ref.encoder.log import read_log
from gsvc_ref.encoder.main.settings import InterSettings, IntraSettings
from gsvc_ref.stream import Stream, decode
from gsvc_ref.training import AdanSettings, Cosine, FitSettings, Rates
from gsvc_ref.video import ColorDescription, VideoFormat


def video_format(width=32, height=24, bit_depth=8, frame_count=None) -> VideoFormat:
    color = ColorDescription(primaries=1, transfer=13, matrix=0, full_range=True, chroma_location=0)
    return VideoFormat(width, height, Fraction(25), bit_depth, "rgb", color, frame_count=frame_count)


def waves(width=32, height=24, frames=4, *, bit_depth=8, cut=None, speed=1.3) -> list[np.ndarray]:
    """Moving coloured waves; from the frame `cut` on, other waves."""
    y, x = np.mgrid[:height, :width]
    clip = []
    for t in range(frames):
        if cut is None or t < cut:
            planes = [np.sin((x + speed * t + 3 * c) / 5) * np.cos((y - 0.5 * t) / 4 + c) for c in range(3)]
        else:
            planes = [np.cos((x - speed * t) / 8 + 2 * c) * np.sin(y / 6 - c) for c in range(3)]
        picture = 0.5 + 0.4 * np.stack(planes, axis=2)
        clip.append(np.rint(picture * (2**bit_depth - 1)).astype(np.uint8 if bit_depth == 8 else np.uint16))
    return clip


def flat(value, width=32, height=24, frames=1, dtype=np.uint8) -> list[np.ndarray]:
    """The same even picture again and again; `value` is a sample or (R, G, B)."""
    return [np.full((height, width, 3), value, dtype) for _ in range(frames)]


def faint_splats(count: int, seed: int, side: int) -> np.ndarray:
    """Parameters (count, 8) f4 of splats a few pixels wide on a square, so faint that few pixels are clamped."""
    rng = np.random.default_rng(seed)
    p = np.empty((count, 8), np.float32)
    p[:, :2] = rng.uniform(4, side - 4, (count, 2))
    p[:, 2], p[:, 4] = rng.uniform(1.5, 4, (2, count))
    p[:, 3] = rng.normal(0, 1, count)
    p[:, 5:] = rng.uniform(0, 0.2, (count, 3))
    return p


def fast(**overrides) -> Settings:
    """Quick settings that are over in a blink: few evaluations, one key frame."""
    intra = IntraSettings(initialization=8, refinement=6, rounding=1)
    inter = InterSettings(motion_steps=1, motion_rounds=1, iterations=4, rounded_iterations=3)
    return Settings.quick(**{"intra": intra, "inter": inter, "key_frames": (), "threads": 1} | overrides)


def paper_fast(**overrides) -> Settings:
    """The same for profile `paper`: few iterations, b given, one key frame."""
    return paper_quick(**{"iterations": 4, "cholesky_bits": 8, "key_frames": (), "threads": 1} | overrides)


def adan_fast(iterations=4, **overrides) -> Settings:
    """The same, fitted and fine-tuned by Adan with few and well-sized steps."""
    settings = paper_fast(**overrides)
    few = FitSettings(
        iterations=iterations, schedule=Cosine(iterations, 0.02), optimizer=AdanSettings(0.9, 0.92, 0.99),
        learn_pixels=True, relative_steps=True, convergence=None, pruning=None,
    )  # fmt: skip
    tune = few.with_(iterations=max(1, round(0.4 * iterations)), rates=Rates(0.1, 0.05, 0.01))
    intra = few.with_(rates=Rates(1.0, 0.5, 0.05, 0.05))
    inter = few.with_(iterations=max(1, round(0.4 * iterations)), rates=Rates(0.2, 0.08, 0.008, 0.008))
    return replace(
        settings,
        intra=replace(settings.intra, fit=intra, tune=tune),
        inter=replace(settings.inter, fit=inter, tune=tune.with_(iterations=max(1, round(0.2 * iterations)))),
    )


def paper_quick(**overrides) -> Settings:
    """Preset `quick` in profile `paper`."""
    return Settings.quick(profile="paper", **overrides)


def encoded(frames: Iterable[np.ndarray], settings: Settings, bit_depth=8, **options) -> tuple[EncodeReport, bytes]:
    """The report and the bytes of an encode of a list of frames."""
    frames = list(frames)
    height, width = frames[0].shape[:2]
    file = BytesIO()
    report = encode((frames, video_format(width, height, bit_depth)), file, settings, **options)
    return report, file.getvalue()


def complete_frames(data: bytes) -> tuple[list[np.ndarray], str | None]:
    """What can be decoded of a stream, and the rule that its end breaks."""
    frames = []
    try:
        for frame in decode(data):
            frames.append(frame)
    except GsvcError as error:
        return frames, error.rule
    return frames, None


def same(a: list[np.ndarray], b: list[np.ndarray]) -> bool:
    """Whether two clips are equal."""
    return len(a) == len(b) and all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))


class Counting:
    """An iterable of frames that counts how many were taken, and can end with an exception."""

    def __init__(self, frames: Iterable[np.ndarray], error: BaseException | None = None) -> None:
        self.frames, self.error, self.taken = frames, error, 0

    def __iter__(self) -> Iterator[np.ndarray]:
        for frame in self.frames:
            self.taken += 1
            yield frame
        if self.error is not None:
            raise self.error


def logged_types(data):
    """What the log in a stream says of each frame's type."""
    with Stream(data) as stream:
        log = read_log(stream.info().ancillary, sum(1 for _ in stream.frames()))
    return [next(one.reason for one in frame if one.effect == "frames") for frame in log]
