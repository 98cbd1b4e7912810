"""The material of the benchmarks: trained populations and encoded streams, made once and kept in its cache.

`python -m gsvc_lab.benchmarks.material` makes all of it (some minutes); the benchmarks make what is missing. Nothing is
drawn again when the training changes: remove the folder for that.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

import gsvc_ref
from gsvc_base.arrays import F4
from gsvc_base.files import complete_file
from gsvc_lab.benchmarks.pictures import mosaic
from gsvc_ref import Settings, Splats
from gsvc_ref.encoder.main.target import Target
from gsvc_ref.encoder.quick import grown
from gsvc_ref.encoder.settings import PaperSettings
from gsvc_ref.rendering import covered_pixels
from gsvc_ref.video import ColorDescription, VideoFormat

CACHE: Final = Path(__file__).parent / "cache"

SIZES: Final = {(1920, 1080): (10_000, 20_000, 50_000), (352, 288): (1000, 2000, 3000, 4000, 5000)}
"""N of the populations of each frame size."""

SEED: Final = 0

Profile = Literal["paper", "main"]
PROFILES: Final[tuple[Profile, ...]] = get_args(Profile)

STREAM_SPLATS: Final = (10_000, 50_000)
STREAM_FRAMES: Final = 4
"""An I-frame and three P-frames."""

PAN: Final = (2, 1)
"""Motion of the streams' picture in pixels per frame."""

LIMIT_TRAINED: Final = ((1920, 1080, 10_000), (1920, 1080, 50_000), (352, 288, 2000))
"""Populations that come with the C++ limit."""


@dataclass(frozen=True)
class Case:
    """A trained population."""

    origin: str  # name of who trained it
    # The frame size, the splats, and the picture (H, W, 3) f4 that they were trained on,
    # or random numbers
    width: int
    height: int
    splats: Splats
    target: F4

    @property
    def name(self) -> str:
        """Such as ``1920x1080, N = 10,000, ours``."""
        return f"{self.width}x{self.height}, N = {len(self.splats):,}, {self.origin}"

    def covering(self) -> float:
        """The mean number of splats that cover a pixel."""
        return float(covered_pixels(self.splats, self.width, self.height).sum()) / (self.width * self.height)


def picture(width: int, height: int, x: int = 0, y: int = 0) -> F4:
    """A part of a mosaic of photographs at native resolution, (H, W, 3) f4; at most 24 pixels from its corner."""
    return np.ascontiguousarray(mosaic(np.random.default_rng(SEED))[y : y + height, x : x + width])


def trained(width: int, height: int, count: int) -> Case:
    """A population trained with the I-frame fit of the preset `quick`."""
    target = picture(width, height)
    path = trained_path(width, height, count)
    if not path.exists():
        _say(f"training {count:,} splats on {width}x{height} pixels, once")
        _save(path, _train(target, count))
    return Case("ours", width, height, Splats.from_array(np.load(path)), target)


def trained_path(width: int, height: int, count: int) -> Path:
    """The file of a population, which holds (N, 8) f4 in the columns of `Splats.to_array`."""
    return CACHE / f"trained_{width}x{height}_{count}.npy"


def cases(width: int, height: int) -> Iterator[Case]:
    """All populations of a frame size."""
    for count in SIZES[width, height]:
        yield trained(width, height, count)


def limit_cases(limit: Any) -> Iterator[Case]:
    """The populations that come with the C++ limit, whose pixels have their centres at integers."""
    for width, height, count in LIMIT_TRAINED:
        parameters = limit.trained(width, height, count)
        parameters[:, :2] += np.float32(0.5)
        yield Case("limit's", width, height, Splats.from_array(parameters), picture(width, height))


def changed(splats: Splats) -> Splats:
    """The same population with every colour a little different, so that no renderer may reuse what it has."""
    return replace(splats, colors=splats.colors * np.float32(0.999))


def stream(count: int, profile: Profile) -> Path:
    """A stream of 1920x1080 pixels as `gsvc encode` writes it with the preset `quick`: I P P P."""
    width, height = 1920, 1080
    path = CACHE / f"stream_{profile}_{count}.gsvc"
    if not path.exists():
        _say(f"encoding {STREAM_FRAMES} frames of {width}x{height} with {count:,} splats, profile {profile}, once")
        CACHE.mkdir(exist_ok=True)
        color = ColorDescription(primaries=1, transfer=1, matrix=0, full_range=True, chroma_location=0)
        video = VideoFormat(width, height, Fraction(25), 8, "rgb", color, frame_count=STREAM_FRAMES)
        settings = Settings.quick(splats=count, key_frames=(0,), seed=SEED, profile=profile)
        gsvc_ref.encode((_frames(width, height), video), path, settings)
    return path


def _frames(width: int, height: int) -> Iterator[NDArray[np.uint8]]:
    for number in range(STREAM_FRAMES):
        yield np.rint(picture(width, height, PAN[0] * number, PAN[1] * number) * 255).astype(np.uint8)


def _train(target: F4, count: int) -> F4:
    iterations = PaperSettings.quick().intra.fit.iterations
    return grown(Target(target), count, iterations, np.random.default_rng(SEED))


def _save(path: Path, array: F4) -> None:
    CACHE.mkdir(exist_ok=True)
    with complete_file(path) as file:
        np.save(file, array)


def _say(what: str) -> None:
    print(f"{what} ...", file=sys.stderr, flush=True)


def main() -> None:
    """Make everything that is missing."""
    for width, height in SIZES:
        for case in cases(width, height):
            print(f"{case.name}: {case.covering():.1f} splats cover a pixel")
    for count in STREAM_SPLATS:
        for profile in PROFILES:
            print(f"stream of {profile} with N = {count:,}: {stream(count, profile).stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
