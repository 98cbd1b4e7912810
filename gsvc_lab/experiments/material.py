"""The clips and pictures that an experiment measures on: what the user gave, or else what is at hand."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from gsvc_base.arrays import Frame
from gsvc_lab.clips import Clip, as_frame, file_clip, resized, uvg_clip, uvg_paths
from gsvc_lab.experiments.experiment import Run
from gsvc_lab.scenes import photograph


def given_clips(run: Run) -> list[Clip]:
    """The clips that the user gave by --clip and --uvg, each with a name of its own; empty if neither."""
    clips = [file_clip(path) for path in run.clips]
    if run.uvg is not None:
        clips += [uvg_clip(path, run.say) for path in uvg_paths(run.uvg)]
    named: list[Clip] = []
    for clip in clips:
        same = sum(other.name == clip.name for other in clips[: len(named)])
        named.append(replace(clip, name=f"{clip.name} ({same + 1})") if same else clip)
    return named


@dataclass(frozen=True)
class Still:
    """One picture to fit."""

    name: str  # Name and description, as of a clip
    about: str
    frame: Frame  # (H, W, 3) u1

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        height, width = self.frame.shape[:2]
        return width, height


def stills(run: Run, names: Sequence[str], width: int, height: int) -> list[Still]:
    """The first frames of what the user gave, or else photographs of scikit-image, as 8 bits.

    The small version resamples them to width x height; the large one takes them as they are.
    """
    found = [(clip.name, f"the first frame of {clip.about}", clip.picture()) for clip in given_clips(run)]
    for name in () if found else names:
        picture = photograph(name)
        size = f"{picture.shape[1]}x{picture.shape[0]}"
        found.append((name, f"the photograph {name} of scikit-image, {size}", picture))
    small = "" if run.full else f", resampled to {width}x{height}"
    return [
        Still(name, about + small, as_frame(picture if run.full else resized(picture, width, height)))
        for name, about, picture in found
    ]


def preferred(pictures: Sequence[Still], name: str) -> Still:
    """The picture of this name, or else the first."""
    return next((still for still in pictures if still.name == name), pictures[0])
