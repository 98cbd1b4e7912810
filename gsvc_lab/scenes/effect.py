"""An effect of a scene: a frozen dataclass of parameters with the hook of the stage at which it takes part.

A frame is drawn in this order, and a stage without an effect does nothing:

1. *camera*: where the virtual camera stands (pan, zoom, rotation).
2. *warp*: from where each pixel of the frame reads the base picture (water, sway).
3. *transition*: what stands in the base picture's place (cut, cross-fade).
4. *object*: what is painted in front, in the order of the description (shapes, text, highlight).
5. *light*: how bright it is (flash, brightness).
6. *shutter*: which moments a frame is the mean of (motion blur); stages 1 to 5 are drawn once for each.
7. *sensor*: what the camera adds to a frame (grain, noise).

Time is counted in frames and need not be whole. Pictures are (H, W, 3) f4 R'G'B', 1.0 = full scale; lengths on the
frame are fractions of its shorter side and places fractions of its width and height, so that a scene may be drawn at
any size. Effects of one stage act in the order of the description. Only an effect that is named is imported. Only
sensor effects and those that ask in `prepare` get a random generator, each one of its own, seeded by the scene's seed
and the effect's name, its kind and its number among those of its kind: adding an effect after those of its kind
changes nothing that the others draw.

What begins with frame k begins at time k - 1/2: a shutter, which is open around time k, never shows both sides of it.
A shutter may ask for times up to 1/2 before the first frame and after the last one.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from reprlib import repr as short
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np

from gsvc_base.arrays import F4, F8
from gsvc_base.draws import Draws
from gsvc_base.errors import UsageError
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.parameters import Checked

if TYPE_CHECKING:  # an effect that needs neither imports neither
    from gsvc_lab.scenes.base import Base
    from gsvc_lab.scenes.camera import Camera

Stage = Literal["camera", "warp", "transition", "object", "light", "shutter", "sensor"]


@dataclass(frozen=True)
class Effect(Checked, ABC):
    """Any effect; its fields are declared by `gsvc_lab.scenes.parameters.parameter`."""

    SUMMARY: ClassVar[str] = ""  # one sentence for the gallery
    STAGE: ClassVar[Stage]  # stage at which it takes part

    def prepare(self, canvas: Canvas, rng: Callable[[], Draws]) -> Self:
        """The effect, ready for a clip; `rng()` makes its generator, for those that draw something once."""
        return self

    def truth(self, canvas: Canvas, time: float) -> dict[str, Any]:
        """Exact knowledge about a frame: arrays and numbers by name, of the same shape and type in all frames."""
        return {}


class CameraEffect(Effect):
    """Moves the virtual camera."""

    STAGE = "camera"

    @abstractmethod
    def move(self, camera: "Camera", canvas: Canvas, time: float) -> "Camera":
        """The camera at a time, given that of the effects before."""


class WarpEffect(Effect):
    """Bends what the camera sees."""

    STAGE = "warp"

    @abstractmethod
    def displacement(self, x: F8, y: F8, canvas: Canvas, time: float) -> tuple[F8, F8]:
        """Distances right and below at which pixels with centres (x, y) read, in pixels, (H, W) f8 each."""

    def shade(self, picture: F4, canvas: Canvas, time: float) -> F4:
        """The picture, brighter and darker as by the warp's relief, a new array; the same array where there is none."""
        return picture

    def truth(self, canvas: Canvas, time: float) -> dict[str, Any]:
        """``displacement`` (2, H, W) f4: how far right and below of itself each pixel reads, in pixels."""
        return {"displacement": np.stack(self.displacement(*canvas.centres(), canvas, time)).astype(np.float32)}


class TransitionEffect(Effect):
    """Puts other pictures in the base picture's place."""

    STAGE = "transition"

    @abstractmethod
    def replace(self, picture: Callable[[], F4], see: Callable[["Base"], F4], canvas: Canvas, time: float) -> F4:
        """The picture at a time, given how to draw that of before, and how to draw another base by the same camera.

        A picture that is not shown is not drawn.
        """

    @abstractmethod
    def shown(self, bases: "tuple[Base, ...]", canvas: Canvas, time: float) -> "tuple[Base, ...]":
        """The bases that are to be seen at a time, given those that are without this effect."""


class ObjectEffect(Effect):
    """Something in front."""

    STAGE = "object"

    @abstractmethod
    def paint(self, picture: F4, canvas: Canvas, time: float) -> F4:
        """The picture with the object in front, a new array; the same array where it is not to be seen."""

    def coverage(self, x: F8, y: F8, canvas: Canvas, time: float) -> F8 | None:
        """The part of a pixel with its centre at (x, y) that the object hides, 0..1; None: light, hides nothing.

        (0.5, 0.5) is the centre of the first pixel. Any points may be asked for, whole arrays of them.
        """
        return None

    def motion(self, x: F8, y: F8, canvas: Canvas, time: float) -> tuple[F8, F8] | None:
        """The motion of the object's points at (x, y) since time - 1, right and down in pixels; None: unknown."""
        return None


class LightEffect(Effect):
    """Changes the brightness of all."""

    STAGE = "light"

    @abstractmethod
    def light(self, picture: F4, canvas: Canvas, time: float) -> F4:
        """The picture in another light, a new array; the same array where nothing changes."""


class ShutterEffect(Effect):
    """Gives a frame a duration; a scene has at most one."""

    STAGE = "shutter"

    @abstractmethod
    def moments(self, frame: int) -> tuple[float, ...]:
        """The times whose pictures a frame is the mean of."""


class SensorEffect(Effect):
    """Adds what a film or sensor adds, the same way in any order of frames."""

    STAGE = "sensor"

    @abstractmethod
    def develop(self, picture: F4, canvas: Canvas, frame: int, rng: Draws) -> F4:
        """The picture with it, a new array; `rng` is of this frame and this effect alone."""


def effect_class(kind: str) -> type[Effect]:
    """The class of an effect by its kind, such as ``pan``: `EFFECT` of the module of that name, imported now.

    Raises
    ------
    UsageError
        There is no such effect.
    """
    if kind not in EFFECTS:
        raise UsageError(f"there is no effect {short(kind)}; there are {', '.join(EFFECTS)}")
    module = import_module(f"gsvc_lab.scenes.effects.{kind.replace('-', '_')}")
    effect: type[Effect] = module.EFFECT
    return effect


def kind_of(effect: Effect) -> str:
    """The kind of an effect, such as ``cross-fade``: the name of its module."""
    return type(effect).__module__.rpartition(".")[2].replace("_", "-")


EFFECTS = (
    "pan", "zoom", "rotation", "water", "sway", "cut", "cross-fade", "shape", "text", "highlight", "flash",
    "brightness", "motion-blur", "grain", "noise",
)  # fmt: skip
"""The kinds of effects, in the order of their stages."""
