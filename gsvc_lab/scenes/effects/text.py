"""A line of text in front, still or scrolling, with or without a box behind it."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gsvc_base.arrays import F4, F8
from gsvc_base.errors import UsageError
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.distances import Box, centres_in, inside, polygon_distance, window
from gsvc_lab.scenes.effect import ObjectEffect
from gsvc_lab.scenes.keyframes import is_shown
from gsvc_lab.scenes.parameters import ParameterError, choice, frame_number, number, pair, parameter
from gsvc_lab.scenes.parameters import color as rgb
from gsvc_lab.scenes.parameters import text as one_line
from gsvc_lab.scenes.paths import check_order
from gsvc_lab.scenes.stroke_font import check_text, text_distance, text_width


@dataclass(frozen=True)
class Text(ObjectEffect):
    """A line of capitals in a font of strokes; sharp, with its edges antialiased by distance."""

    SUMMARY: ClassVar[str] = "Text stands or scrolls in front: sharp edges that belong to nothing in the picture."

    text: str = parameter(one_line(200), "what is written; small letters are written as capitals")
    place: tuple[float, float] = parameter(
        pair(-10, 10), "where it stands in the first frame in which it is seen, as fractions of width and height",
        (0.5, 0.85),
    )  # fmt: skip
    anchor: str = parameter(choice("left", "middle", "right"), "which part of the text's line stands there", "middle")
    speed: tuple[float, float] = parameter(
        pair(-1, 1), "how far it goes in a frame, as fractions of width and height", (0.0, 0.0)
    )
    size: float = parameter(number(0.01, 2), "height of a letter, as a fraction of the frame's shorter side", 0.1)
    weight: float = parameter(number(0.02, 0.4), "thickness of the strokes, as a part of that height", 0.14)
    color: tuple[float, float, float] = parameter(rgb(), "its colour", (1.0, 1.0, 1.0))
    box: tuple[float, float, float] | None = parameter(rgb(), "the colour of a box behind it; without it, no box", None)
    margin: float = parameter(number(0, 10), "from the text to the box's edge, in heights of a letter", 0.5)
    start: int = parameter(frame_number(), "the first frame in which it is seen", 0)
    end: int | None = parameter(frame_number(beyond=True), "the first frame in which it is no longer seen", None)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_order(self.start, self.end)
        try:
            check_text(self.text)
        except UsageError as error:
            raise ParameterError("text", f"is wrong: {error}") from None

    def paint(self, picture: F4, canvas: Canvas, time: float) -> F4:
        """The picture with the text in front of it; the same array where it is not to be seen."""
        if not is_shown(self.start, self.end, time):
            return picture
        part = window(self._box(canvas, time), canvas)
        x, y = centres_in(part, canvas)
        seen = picture[part].astype(np.float64)  # (h, w, 3)
        if self.box is not None:
            share = inside(self._box_distance(x, y, canvas, time))[..., None]
            seen = seen * (1 - share) + np.asarray(self.box) * share
        share = inside(self._letter_distance(x, y, canvas, time))[..., None]
        painted = picture.copy()
        painted[part] = seen * (1 - share) + np.asarray(self.color) * share
        return painted

    def coverage(self, x: F8, y: F8, canvas: Canvas, time: float) -> F8:
        """The part of the pixels with centres (x, y) that the text and its box hide, 0 to 1."""
        x, y = np.broadcast_arrays(x, y)
        if not is_shown(self.start, self.end, time):
            return np.zeros(x.shape)
        share = inside(self._letter_distance(x, y, canvas, time))
        if self.box is None:
            return share
        return np.asarray(1 - (1 - share) * (1 - inside(self._box_distance(x, y, canvas, time))))

    def motion(self, x: F8, y: F8, canvas: Canvas, time: float) -> tuple[F8, F8] | None:
        """The motion of the text in the last frame, right and down; None if it just appeared."""
        if not (is_shown(self.start, self.end, time) and is_shown(self.start, self.end, time - 1)):
            return None
        shape = np.broadcast_shapes(x.shape, y.shape)
        return np.full(shape, self.speed[0] * canvas.width), np.full(shape, self.speed[1] * canvas.height)

    def truth(self, canvas: Canvas, time: float) -> dict[str, Any]:
        """``box`` (4,) f8: left, top, right and bottom of what it may touch, in pixels; NaN when unseen."""
        shown = is_shown(self.start, self.end, time)
        return {"box": np.array(self._box(canvas, time)) if shown else np.full(4, np.nan)}

    def _strokes(self, canvas: Canvas, time: float) -> Box:
        """Left, top, right and bottom of the strokes of capitals, in pixels."""
        height = self.size * canvas.shorter
        width = text_width(self.text, self.weight) * height
        gone = time - self.start
        x = (self.place[0] + self.speed[0] * gone) * canvas.width
        y = (self.place[1] + self.speed[1] * gone) * canvas.height
        left = x - {"left": 0.0, "middle": 0.5, "right": 1.0}[self.anchor] * width
        return left, y - height / 2, left + width, y + height / 2

    def _box(self, canvas: Canvas, time: float) -> Box:
        """Left, top, right and bottom of all that the text and its box touch, in pixels."""
        left, top, right, bottom = self._strokes(canvas, time)
        # Without a box there must be room below for commas and tails.
        margin = (self.margin if self.box is not None else 0.25) * self.size * canvas.shorter
        return left - margin, top - margin, right + margin, bottom + margin

    def _letter_distance(self, x: F8, y: F8, canvas: Canvas, time: float) -> F8:
        left, top, _, _ = self._strokes(canvas, time)
        return text_distance(x, y, self.text, left, top, self.size * canvas.shorter, self.weight)

    def _box_distance(self, x: F8, y: F8, canvas: Canvas, time: float) -> F8:
        left, top, right, bottom = self._box(canvas, time)
        return polygon_distance(x, y, np.array([(left, top), (right, top), (right, bottom), (left, bottom)]))


EFFECT = Text
