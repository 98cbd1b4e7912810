"""Drawing a scene: frame by frame, each when it is asked for, and what is exactly known about it."""

from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from gsvc_base.arrays import F4, F8, U1
from gsvc_lab.scenes.base import Base
from gsvc_lab.scenes.description import Description
from gsvc_lab.scenes.effect import (
    CameraEffect,
    Effect,
    LightEffect,
    ObjectEffect,
    SensorEffect,
    ShutterEffect,
    Stage,
    TransitionEffect,
    WarpEffect,
    kind_of,
)
from gsvc_lab.scenes.seeds import generator

if TYPE_CHECKING:
    from gsvc_lab.scenes.camera import Camera, View


MAX_VIEWS: Final = 4
"""Bases that a clip keeps: pictures can be large, and a slide show has many."""


class Clip:
    """A scene ready to be drawn: its effects prepared, its bases drawn when they are first seen; the last few are kept.

    Attributes
    ----------
    scene, canvas
        The scene, and its frame.
    effects
        The prepared effects by name: the kind and a number that counts those of its kind, such as ``shape-2``.
    """

    def __init__(self, scene: Description) -> None:
        self.scene, self.canvas = scene, scene.canvas
        self.effects: dict[str, Effect] = {}
        counts = Counter[str]()
        for effect in scene.effects:
            kind = kind_of(effect)
            counts[kind] += 1
            name = f"{kind}-{counts[kind]}"
            self.effects[name] = effect.prepare(self.canvas, partial(generator, scene.seed, name))
        self.cameras: dict[str, CameraEffect] = self._of("camera")
        self.warps: dict[str, WarpEffect] = self._of("warp")
        self.transitions: dict[str, TransitionEffect] = self._of("transition")
        self.objects: dict[str, ObjectEffect] = self._of("object")
        self.lights: dict[str, LightEffect] = self._of("light")
        self.shutters: dict[str, ShutterEffect] = self._of("shutter")
        self.sensors: dict[str, SensorEffect] = self._of("sensor")
        self._views: dict[Base, View] = {}
        self._last: tuple[F4, U1] | None = None

    def _of(self, stage: Stage) -> dict[str, Any]:
        return {name: effect for name, effect in self.effects.items() if stage == effect.STAGE}

    def __iter__(self) -> Iterator[U1]:
        return map(self.frame, range(self.scene.frames))

    def frame(self, number: int) -> U1:
        """Draw a frame, (height, width, 3) u1; any at any time."""
        picture = self._exposed(number)
        for name, effect in self.sensors.items():
            # `prepare` has the generator without a number, and frames those with a number from 1 on.
            picture = effect.develop(picture, self.canvas, number, generator(self.scene.seed, name, number + 1))
        if self._last is None or self._last[0] is not picture:
            self._last = picture, np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8)
        return self._last[1].copy()

    def _exposed(self, number: int) -> F4:
        """The light on the sensor while the shutter is open."""
        for shutter in self.shutters.values():  # one at most
            moments = shutter.moments(number)
            first = picture = self.picture(moments[0])
            total, moved = first.astype(np.float64), False
            for time in moments[1:]:
                picture = self.picture(time)
                total += picture
                moved = moved or picture is not first
            return (total / len(moments)).astype(np.float32) if moved else first
        return self.picture(number)

    def picture(self, time: float) -> F4:
        """The picture at a moment, (height, width, 3) f4; not to be changed."""
        camera = self.camera(time)
        displacement = None
        if self.warps:
            displacement = self.displacement(*self.canvas.centres(), time)

        def see(base: Base) -> F4:
            return self.view(base).see(camera, displacement)

        draw: Callable[[], F4] = partial(see, self.scene.base)
        for transition in self.transitions.values():
            draw = partial(transition.replace, draw, see, self.canvas, time)
        picture = draw()
        for warp in self.warps.values():
            picture = warp.shade(picture, self.canvas, time)
        for item in self.objects.values():
            picture = item.paint(picture, self.canvas, time)
        for light in self.lights.values():
            picture = light.light(picture, self.canvas, time)
        return picture

    def camera(self, time: float) -> "Camera":
        """The camera at a moment; without a camera effect it sees the largest part that fits."""
        from gsvc_lab.scenes.camera import Camera

        camera = Camera(0.5, 0.5, 1.0)
        for effect in self.cameras.values():
            camera = effect.move(camera, self.canvas, time)
        return camera

    def displacement(self, x: F8, y: F8, time: float) -> tuple[F8, F8]:
        """Distances right and below of themselves at which points of the frame read, in pixels: all warps in turn."""
        x_read, y_read = x, y
        for warp in self.warps.values():
            right, below = warp.displacement(x_read, y_read, self.canvas, time)
            x_read, y_read = x_read + right, y_read + below
        return x_read - x, y_read - y

    def shown(self, time: float) -> tuple[Base, ...]:
        """The bases that are to be seen at a moment."""
        bases: tuple[Base, ...] = (self.scene.base,)
        for transition in self.transitions.values():
            bases = transition.shown(bases, self.canvas, time)
        return bases

    def view(self, base: Base) -> "View":
        """The base, ready to be looked at; drawn the first time, and again if others have taken its room."""
        if base not in self._views:
            from gsvc_lab.scenes.camera import View

            if len(self._views) == MAX_VIEWS:
                del self._views[next(iter(self._views))]
            picture = base.picture(self.canvas, self.scene.seed, self.scene.folder)
            self._views[base] = View(picture, self.canvas.width, self.canvas.height)
        return self._views[base]


def frames(scene: Description) -> Iterator[U1]:
    """Draw a scene: (height, width, 3) u1 frames, each when it is asked for, rounded half to even."""
    return iter(Clip(scene))
