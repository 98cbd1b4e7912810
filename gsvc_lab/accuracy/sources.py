"""The picture that accuracy is measured on: a frame of a clip, or of a scene by name."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Final

import numpy as np

from gsvc_base.arrays import F4, Frame
from gsvc_base.errors import UsageError
from gsvc_lab.scenes import PHOTOGRAPHS, demo_clip, photograph
from gsvc_ref.video import open_video

DEFAULT_SCENE: Final = "chelsea"


@dataclass(frozen=True, eq=False)
class Source:
    """A picture and where it comes from."""

    name: str  # name of the clip or scene
    number: int  # number of the frame, from 0
    frame: Frame  # (H, W, 3) u1 or u2
    bit_depth: int = 8  # bits of a sample

    @property
    def picture(self) -> F4:
        """The frame as (H, W, 3) f4, 1.0 = full scale."""
        return self.frame.astype(np.float32) / np.float32((1 << self.bit_depth) - 1)


def _photograph(name: str) -> Callable[[], Iterator[Frame]]:
    return lambda: iter([np.rint(photograph(name) * 255).astype(np.uint8)])


SCENES: Final[dict[str, Callable[[], Iterator[Frame]]]] = {
    "demo": demo_clip,
    **{name: _photograph(name) for name in PHOTOGRAPHS},
}
"""Name -> what draws the frames, 8 bits: the clip of `gsvc demo`, and photographs of scikit-image."""


def scene_source(name: str, number: int = 0) -> Source:
    """A frame of a scene.

    A UsageError says that there is no such scene or frame.
    """
    if name not in SCENES:
        raise UsageError(f"there is no scene {name!r}; there are {', '.join(SCENES)}")
    return Source(name, number, _pick(SCENES[name](), name, number))


def clip_source(path: str, number: int = 0) -> Source:
    """A frame of a video, a folder of pictures or a picture.

    A UsageError says that there is no such frame, or that the file is not one that is encoded. A GsvcError says
    that it cannot be read as video.
    """
    with open_video(path) as reader:
        return Source(path, number, _pick(reader, path, number), reader.format.bit_depth)


def _pick(frames: Iterator[Frame], name: str, number: int) -> Frame:
    if number < 0:
        raise UsageError(f"the frame is {number}; frames are counted from 0")
    frame = next(islice(frames, number, None), None)
    if frame is None:
        raise UsageError(f"{name} has no frame {number}; frames are counted from 0, so give a smaller number")
    return frame
