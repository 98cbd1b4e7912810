"""A scene as a source of frames, like a video file."""

from collections.abc import Iterator

from gsvc_base.arrays import Frame
from gsvc_lab.scenes.clip import Clip
from gsvc_lab.scenes.description import Description
from gsvc_ref.video.format import ColorDescription, VideoFormat
from gsvc_ref.video.stream import VideoReader


class SceneReader(VideoReader):
    """Draws the frames of a scene as they are read: 8 bits, R'G'B' with the primaries and transfer of BT.709."""

    def __init__(self, scene: Description) -> None:
        super().__init__()
        self.scene = scene
        color = ColorDescription(primaries=1, transfer=1, matrix=0, full_range=True, chroma_location=0)
        self.format = VideoFormat(
            scene.width, scene.height, scene.frame_rate, 8, "rgb", color, frame_count=scene.frames
        )

    def _read(self) -> Iterator[Frame]:
        return iter(Clip(self.scene))
