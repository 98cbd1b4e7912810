"""A bright spot that moves over the scene, as the reflection of a lamp does."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gsvc_base.arrays import F4, F8
from gsvc_base.portable import exp
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effect import ObjectEffect
from gsvc_lab.scenes.keyframes import check_keys, frames, is_shown, key_before, places, value_at, values
from gsvc_lab.scenes.parameters import choice, flag, frame_number, number, parameter
from gsvc_lab.scenes.parameters import color as rgb
from gsvc_lab.scenes.paths import check_order


@dataclass(frozen=True)
class Highlight(ObjectEffect):
    """A specular highlight: light that is added to the picture and clipped at full scale."""

    SUMMARY: ClassVar[str] = "A bright reflection wanders over the scene, whatever the things below it do."

    path: tuple[tuple[float, float], ...] = parameter(
        places(), "where its centre is, as fractions of the frame's width and height: one place, or one for each of at",
        ((0.25, 0.35), (0.75, 0.55)),
    )  # fmt: skip
    at: tuple[float, ...] = parameter(
        frames(), "the frames at which path and strength hold; without it, evenly over the whole clip", ()
    )
    pace: str = parameter(choice("even", "gentle", "jump"), "how it gets there: evenly, gently or all at once", "even")
    repeat: bool = parameter(flag(), "whether it starts again from the first place when it comes to the last", False)
    lobe: str = parameter(
        choice("gaussian", "glossy"),
        "how it falls off at a distance r: exp(-r^2 / 2 radius^2), or 1 / (1 + r^2 / radius^2)^2 with its faint halo",
        "glossy",
    )
    radius: float = parameter(number(1e-4, 10), "as a fraction of the frame's shorter side", 0.12)
    strength: tuple[float, ...] = parameter(values(0, 100), "what is added at its centre, over time", (0.8,))
    color: tuple[float, float, float] = parameter(rgb(), "the colour of the light", (1.0, 0.98, 0.92))
    start: int = parameter(frame_number(), "the first frame in which it is seen", 0)
    end: int | None = parameter(frame_number(beyond=True), "the first frame in which it is no longer seen", None)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_keys(self.at, path=self.path, strength=self.strength)
        check_order(self.start, self.end)

    def paint(self, picture: F4, canvas: Canvas, time: float) -> F4:
        """The picture with the light added and clipped; the same array where there is none."""
        if not is_shown(self.start, self.end, time):
            return picture
        added = self._light(canvas, time)[..., None] * np.asarray(self.color)  # (H, W, 3) f8
        return np.asarray(np.clip(picture + added, 0, 1), np.float32)

    def truth(self, canvas: Canvas, time: float) -> dict[str, Any]:
        """``light`` (H, W) f4: what white light adds before clipping; ``center`` (2,) f8: x and y in pixels, or NaN."""
        if not is_shown(self.start, self.end, time):
            return {"light": np.zeros((canvas.height, canvas.width), np.float32), "center": np.full(2, np.nan)}
        x, y, _ = self._spot(canvas, time)
        return {"light": self._light(canvas, time).astype(np.float32), "center": np.array([x, y])}

    def _spot(self, canvas: Canvas, time: float) -> tuple[float, float, float]:
        """Its centre in pixels and its strength."""
        count = len(self.at) or max(len(self.path), len(self.strength))
        key, part = key_before(self.at, count, canvas, time, self.pace, self.repeat)
        return (
            value_at([x for x, _ in self.path], key, part) * canvas.width,
            value_at([y for _, y in self.path], key, part) * canvas.height,
            value_at(self.strength, key, part),
        )

    def _light(self, canvas: Canvas, time: float) -> F8:
        """The (H, W) f8 light."""
        x, y, strength = self._spot(canvas, time)
        across, down = canvas.centres()
        across, down = (across - x) / (self.radius * canvas.shorter), (down - y) / (self.radius * canvas.shorter)
        square = across * across + down * down
        if self.lobe == "gaussian":
            return np.asarray(strength * exp(-square / 2))
        return np.asarray(strength / ((1 + square) * (1 + square)))


EFFECT = Highlight
