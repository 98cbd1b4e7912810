"""Synthetic clips of known content, drawn frame by frame."""

from gsvc_ref.scenes.camera import Camera, view
from gsvc_ref.scenes.demo import DEMO_FRAME_RATE, demo_clip, demo_cut
from gsvc_ref.scenes.photographs import PHOTOGRAPHS, photograph
from gsvc_ref.scenes.shapes import Ball, paint_ball

__all__ = [
    "DEMO_FRAME_RATE",
    "PHOTOGRAPHS",
    "Ball",
    "Camera",
    "demo_clip",
    "demo_cut",
    "paint_ball",
    "photograph",
    "view",
]
