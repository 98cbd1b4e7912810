"""Pictures at half and a quarter of the size: sampled, filtered, and the means of the full picture."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from gsvc_base.arrays import F4, F8
from gsvc_base.splats import Splats, scale_parameters, scale_parameters_filtered
from gsvc_lab.clips import Clip, as_picture, packaged_clip, scene_clip
from gsvc_lab.experiments.encodes import encoded, excerpt
from gsvc_lab.experiments.experiment import Experiment, Result, Run, Table, Verdict
from gsvc_lab.experiments.figures import new_figure, save_figure, show_picture
from gsvc_lab.experiments.material import given_clips
from gsvc_ref.encoder import Settings
from gsvc_ref.metrics import psnr_from_mse
from gsvc_ref.rendering import render
from gsvc_ref.stream import Stream

FRAMES: Final = 4
"""Frames of each clip in the small version: an I-frame and P-frames."""

PIXELS_PER_SPLAT: Final = (100, 25)
"""Pixels of a frame for each splat: few splats and many."""

HALVINGS: Final = (1, 2)
WAYS: Final = ("sampled", "filtered", "means")
"""(9-8), (9-9), and the means of the pixels of the full picture."""

MOST_BELOW: Final = 1.6
"""Must: at half size, how many dB filtered pictures may be below means at most."""


@dataclass(frozen=True)
class Measured:
    """A clip at one number of splats and one size: PSNR in dB of the mean squared error, by way."""

    clip: str
    count: int
    halvings: int
    psnr: dict[str, float]
    pictures: dict[str, F4]  # the source's means and each way, of the first frame

    @property
    def below(self) -> float:
        """How far filtered pictures are below means."""
        return self.psnr["means"] - self.psnr["filtered"]


def means(picture: F4, side: int) -> F8:
    """The means of squares of side x side pixels of a picture (H, W, 3), of whole such squares: (H/side, W/side, 3)."""
    height, width = (length // side * side for length in picture.shape[:2])
    squares = picture[:height, :width].reshape(height // side, side, width // side, side, 3)
    return np.asarray(squares.mean(axis=(1, 3), dtype=np.float64))


def smaller(splats: Splats, way: str, width: int, height: int, side: int) -> F4:
    """The picture of a frame's splats, (H/side, W/side, 3), rendered as it is, unquantised."""
    size = width // side, height // side
    if way == "means":
        return np.asarray(means(render(splats, width, height), side), np.float32)
    scaled = scale_parameters if way == "sampled" else scale_parameters_filtered
    return render(scaled(splats, width, height, *size), *size)


def measure(clip: Clip, share: int, run: Run) -> list[Measured]:
    """A clip at a number of splats, at every size."""
    width, height = clip.format.width, clip.format.height
    count = width * height // share
    settings = Settings.quick(profile="main", splats=count, threads=run.threads)
    stream = encoded(clip, settings, run.say, f"{clip.name}, N {count:,}").stream
    with Stream(stream) as opened:
        splats = [frame.splats for frame in opened]
    sources = [as_picture(frame, clip.format.peak) for frame in clip.frames()]
    found = []
    for halvings in HALVINGS:
        side = 2**halvings
        wanted = [means(source, side) for source in sources]
        shown = {way: [smaller(one, way, width, height, side) for one in splats] for way in WAYS}
        errors = {
            way: np.mean([np.mean((a - b) ** 2) for a, b in zip(shown[way], wanted, strict=True)]) for way in WAYS
        }
        pictures = {"source": np.asarray(wanted[0], np.float32)} | {way: shown[way][0] for way in WAYS}
        psnr = {way: psnr_from_mse(float(error), 1) for way, error in errors.items()}
        found.append(Measured(clip.name, count, halvings, psnr, pictures))
    return found


def clips(run: Run) -> list[Clip]:
    """What the user gave, or else two recordings and two scenes, of sides that four divides."""
    frames = 4 * FRAMES if run.full else FRAMES
    named = given_clips(run) or [
        packaged_clip("carphone_pristine"), packaged_clip("bikes").scaled(320, 136),
        scene_clip("talking-head", 160, 128, frames), scene_clip("pan", 176, 144, frames),
    ]  # fmt: skip
    return [
        excerpt(clip, 0, frames, *(length // 4 * 4 for length in (clip.format.width, clip.format.height)))
        for clip in named
    ]


def verdict(all_of: Sequence[Measured]) -> Verdict:
    """The must at half size, and how far sampling is below."""
    half = [one for one in all_of if one.halvings == 1]
    worst = max(half, key=lambda one: one.below)
    gains = [one.psnr["filtered"] - one.psnr["sampled"] for one in all_of]
    sentence = (
        f"At half size filtered pictures are at most {worst.below:.2f} dB below the means of the full picture "
        f"({worst.clip}, N {worst.count:,}; must: at most {MOST_BELOW} dB); they are {min(gains):+.2f} to "
        f"{max(gains):+.2f} dB from sampled ones."
    )
    return Verdict("yes" if worst.below <= MOST_BELOW else "no", sentence)


def draw(all_of: Sequence[Measured], run: Run) -> dict[str, str]:
    """A figure for each clip with the most splats at half size: the source and each way."""
    captions = {}
    for one in all_of:
        if one.halvings != 1 or one.count != max(other.count for other in all_of if other.clip == one.clip):
            continue
        figure, axes = new_figure(9, 2.4, 1, len(one.pictures))
        for place, (name, picture) in zip(axes.flat, one.pictures.items(), strict=True):
            title = name if name == "source" else f"{name}, {one.psnr[name]:.1f} dB"
            show_picture(place, picture, title)
        name = save_figure(figure, run.folder, f"sizes-{one.clip}")
        captions[name] = (
            f"{one.clip}, N {one.count:,}, first frame at half size: means of the source, and of the stream."
        )
    return captions


def run(settings: Run) -> Result:
    """Encode each clip with few and with many splats, and show it smaller."""
    chosen = clips(settings)
    all_of = [one for clip in chosen for share in PIXELS_PER_SPLAT for one in measure(clip, share, settings)]
    rows = [
        (one.clip, f"{one.count:,}", f"1/{2**one.halvings}", *(f"{one.psnr[way]:.2f}" for way in WAYS),
         f"{one.below:.2f}")
        for one in all_of
    ]  # fmt: skip
    columns = ("clip", "N", "size", *WAYS, "filtered below means")
    numbers: dict[str, Any] = {
        f"{one.clip}, N {one.count}, 1/{2**one.halvings}": one.psnr | {"below": one.below} for one in all_of
    }
    setting = (
        f"On {'; '.join(clip.about for clip in chosen)}. Profile main, preset quick, one I-frame. PSNR in dB "
        "against the means of the source's pixels, of pictures that are clamped and not rounded: sampled is (9-8), "
        "filtered (9-9), means those of the pixels of the picture at full size."
    )
    return Result(setting, numbers, (Table("Smaller pictures, PSNR in dB", columns, tuple(rows)),),
                  draw(all_of, settings), verdict(all_of))  # fmt: skip


EXPERIMENT: Final = Experiment(
    "sizes",
    "Smaller pictures",
    "It says nothing about other sizes than that of the video, though splats have no resolution.",
    run,
)
