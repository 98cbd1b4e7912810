"""Scenes as sources of `gsvc_ref.video.open_video`, by name or file; what draws them is imported when one is opened."""

from typing import TYPE_CHECKING, Final

from gsvc_lab.scenes.built_in import SCENE_PREFIX, SCENE_SUFFIX
from gsvc_ref.plugins import NamedSource

if TYPE_CHECKING:
    from gsvc_ref.video import VideoReader


def _open(name: str) -> "VideoReader":
    from gsvc_lab.scenes.scene import Scene

    return Scene.find(name).open_video()


SCENES: Final = NamedSource(SCENE_PREFIX, SCENE_SUFFIX, _open)
