"""Synthetic clips of known content, drawn frame by frame, from a description that names what is to happen.

    from gsvc_lab.scenes import Scene, frames, truth

    scene = Scene.named("pan")                     # or Scene.from_toml("my.toml"), or Scene(...)
    for frame in frames(scene.resized(frames=10)):  # (H, W, 3) u1, each drawn when asked for
        ...
    truth(scene, 5)["motion"]                      # (2, H, W) f4, in pixels since frame 4
    gsvc_ref.encode(scene, "pan.gsvc")

What is not named is not imported: everything here is loaded on first use.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from gsvc_lab.scenes.base import Base as Base
    from gsvc_lab.scenes.built_in import scene_names as scene_names
    from gsvc_lab.scenes.camera import Camera as Camera
    from gsvc_lab.scenes.camera import view as view
    from gsvc_lab.scenes.clip import Clip as Clip
    from gsvc_lab.scenes.clip import frames as frames
    from gsvc_lab.scenes.demo import DEMO_FRAME_RATE as DEMO_FRAME_RATE
    from gsvc_lab.scenes.demo import demo_clip as demo_clip
    from gsvc_lab.scenes.demo import demo_cut as demo_cut
    from gsvc_lab.scenes.effect import EFFECTS as EFFECTS
    from gsvc_lab.scenes.effect import effect_class as effect_class
    from gsvc_lab.scenes.ground_truth import truth as truth
    from gsvc_lab.scenes.photographs import PHOTOGRAPHS as PHOTOGRAPHS
    from gsvc_lab.scenes.photographs import photograph as photograph
    from gsvc_lab.scenes.scene import Scene as Scene
    from gsvc_lab.scenes.shapes import Ball as Ball
    from gsvc_lab.scenes.shapes import paint_ball as paint_ball

_HOMES: Final = {
    "Ball": "shapes",
    "Base": "base",
    "Camera": "camera",
    "Clip": "clip",
    "DEMO_FRAME_RATE": "demo",
    "EFFECTS": "effect",
    "PHOTOGRAPHS": "photographs",
    "Scene": "scene",
    "demo_clip": "demo",
    "demo_cut": "demo",
    "effect_class": "effect",
    "frames": "clip",
    "paint_ball": "shapes",
    "photograph": "photographs",
    "scene_names": "built_in",
    "truth": "ground_truth",
    "view": "camera",
}
"""The module of each public name."""

__all__ = [
    "DEMO_FRAME_RATE",
    "EFFECTS",
    "PHOTOGRAPHS",
    "Ball",
    "Base",
    "Camera",
    "Clip",
    "Scene",
    "demo_clip",
    "demo_cut",
    "effect_class",
    "frames",
    "paint_ball",
    "photograph",
    "scene_names",
    "truth",
    "view",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'gsvc_lab.scenes' has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(f"gsvc_lab.scenes.{_HOMES[name]}"), name)
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
