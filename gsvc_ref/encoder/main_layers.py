"""Encoding frame after frame in profile `main` with layers, each in a closed loop of its own (spec.md section 15.13).

Layer l is coded as the base is, with what is below it as a constant background: its splats are fitted to what the base
and the layers up to l - 1 leave of the frame. It is predicted from itself, so no layer depends on the bits of another.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from gsvc_ref.arrays import F4, Frame
from gsvc_ref.encoder.frame import EncodedFrame, EncodedLayer, OnStage
from gsvc_ref.encoder.main_frame import MainFrameEncoder
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.main_encoder.inter import InterSettings
from gsvc_ref.main_encoder.motion_field import Field, best_field, flow_at_points
from gsvc_ref.main_profile.frames import MainState
from gsvc_ref.main_profile.motion import field_motion
from gsvc_ref.main_profile.state import to_splats
from gsvc_ref.main_profile.tables import step_of
from gsvc_ref.reconstruction import FrameType
from gsvc_ref.rendering import Objective


class LayeredFrameEncoder:
    """Encodes frames with their layers in order.

    Parameters
    ----------
    settings
        All settings; `layers` or `layer_splats` says how many layers there are, and how good.
    width, height, bit_depth
        The size of the frames in pixels, and the bits of a sample.

    Attributes
    ----------
    settings
        The settings given.
    parts
        What encodes the base and each layer above it.
    """

    def __init__(self, settings: Settings, width: int, height: int, bit_depth: int) -> None:
        self.settings = settings
        self.parts = [MainFrameEncoder(one, width, height, bit_depth) for one in settings.of_layers()]
        self._peak = (1 << bit_depth) - 1
        self._before: F4 | None = None  # the source of the frame before
        self._field: Field | None = None
        self._quantizer = 0  # of the highest layer

    @property
    def state(self) -> MainState:
        """The decoder's state of the base after the frames so far."""
        return self.parts[0].state

    def elements(self) -> dict[str, Any]:
        """The elements of the sequence header that the profile has."""
        return {**self.parts[0].elements(), "layer_count": len(self.parts)}

    def encode(self, frame: Frame, frame_type: FrameType, number: int, progress: OnStage) -> EncodedFrame:
        """Encode a frame (H, W, 3) u1 or u2 and its layers; the next one is predicted from their reconstruction."""
        picture: F4 = frame.astype(np.float32) / np.float32(self._peak)
        moved = self._moved(picture) if frame_type == "P" and __import__("os").environ.get("BESIDE","1")=="1" else None
        below = np.zeros((0, 8), np.float32)
        seconds: dict[str, float] = {}
        encoded: list[EncodedFrame] = []
        for layer, part in enumerate(self.parts):
            part.below = below
            part.beside = None if moved is None else np.concatenate([below[:0], *moved[layer + 1 :]])
            encoded.append(part.encode(frame, frame_type, number, progress))
            below = np.concatenate([below, encoded[-1].state.splats.to_array()])
            for stage, spent in encoded[-1].seconds.items():
                seconds[stage] = seconds.get(stage, 0.0) + spent
        self._before, self._quantizer = picture, encoded[-1].codes.quantizer or self._quantizer
        layers = tuple(EncodedLayer(n, one.codes, one.state, one.psnr) for n, one in enumerate(encoded))
        return replace(encoded[0], psnr=encoded[-1].psnr, seconds=seconds, layers=layers)

    def _moved(self, picture: F4) -> list[F4]:
        """The splats (N, 8) of the base and of each layer, moved by the field that suits all of them together."""
        assert self._before is not None
        states = [part.state for part in self.parts]
        settings, step = InterSettings.quick(), step_of(self._quantizer) / 16
        objective = Objective(picture, self.settings.threads, precision=self.settings.precision)
        self._field = field = best_field(
            objective, np.concatenate([state.splats.to_array() for state in states]),
            flow_at_points(self._before, picture), self._field, settings.motion_price * step * step,
            settings.cell_gain, settings.cells, settings.motion_steps, settings.motion_rounds,
        )  # fmt: skip
        moved = []
        for state in states:
            values = state.values.copy()
            if field.cell:
                values[:, :2] += field_motion(values, field.vectors, field.cell)
            moved.append(to_splats(values).to_array())
        return moved
