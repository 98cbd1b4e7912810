"""What the package offers, by the module that each name comes from: type checkers read this, and so does `lazily`."""

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

__all__: list[str]
