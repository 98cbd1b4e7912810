"""A small font of strokes, drawn by distance: the same on every machine, sharp at any size and place.

A letter is a list of lines between points of a grid, 12 steps from the top of a capital to its foot. In the table a
point is two hexadecimal digits, x to the right and y down; lines of one letter are parted by commas. After a ``~`` the
points are those of parabolas, each beginning where the last one ended: end, control, end, control, end and so on.
"""

from collections.abc import Sequence
from functools import cache
from typing import Final

import numpy as np

from gsvc_base.arrays import F8
from gsvc_base.errors import UsageError
from gsvc_lab.scenes.distances import segment_distance

Line = tuple[tuple[float, float], ...]

_STEPS: Final = 12
_PARABOLA_PIECES: Final = 6
_GAP: Final = 2.8  # steps between the edges of two letters

_GLYPHS: Final[dict[str, tuple[int, str]]] = {  # width in steps, lines
    " ": (3, ""),
    "A": (8, "0c 40 8c, 18 78"),
    "B": (7, "40 00 0c 4c, 06 46, ~40 70 73 76 46, ~46 76 79 7c 4c"),
    "C": (8, "~83 80 40 00 06 0c 4c 8c 89"),
    "D": (8, "30 00 0c 3c, ~30 80 86 8c 3c"),
    "E": (7, "70 00 0c 7c, 06 56"),
    "F": (7, "70 00 0c, 06 56"),
    "G": (8, "~83 80 40 00 06 0c 4c 8c 87, 87 47"),
    "H": (8, "00 0c, 80 8c, 06 86"),
    "I": (0, "00 0c"),
    "J": (6, "60 68, ~68 6c 3c 0c 09"),
    "K": (7, "00 0c, 70 07, 34 7c"),
    "L": (7, "00 0c 7c"),
    "M": (10, "0c 00 58 a0 ac"),
    "N": (8, "0c 00 8c 80"),
    "O": (8, "~40 80 86 8c 4c 0c 06 00 40"),
    "P": (7, "0c 00 40, 07 47, ~40 70 73 77 47"),
    "Q": (8, "~40 80 86 8c 4c 0c 06 00 40, 59 8d"),
    "R": (8, "0c 00 40, 07 47, ~40 70 73 77 47, 47 8c"),
    "S": (8, "~82 80 40 00 03 06 46 86 89 8c 4c 0c 0a"),
    "T": (8, "00 80, 40 4c"),
    "U": (8, "00 07, ~07 0c 4c 8c 87, 87 80"),
    "V": (8, "00 4c 80"),
    "W": (12, "00 3c 61 9c c0"),
    "X": (8, "00 8c, 80 0c"),
    "Y": (8, "00 46 80, 46 4c"),
    "Z": (8, "00 80 0c 8c"),
    "0": (6, "~30 60 66 6c 3c 0c 06 00 30"),
    "1": (6, "13 40 4c"),
    "2": (6, "~03 00 30 60 63 66 39, 39 0c 6c"),
    "3": (6, "~02 00 30 60 63 66 36, 26 36, ~36 66 69 6c 3c 0c 0a"),
    "4": (6, "5c 50 08 68"),
    "5": (6, "50 00 05, 05 25, ~25 65 69 6c 3c 0c 0a"),
    "6": (6, "~62 60 30 00 06, 06 09, ~36 66 69 6c 3c 0c 09 06 36"),
    "7": (6, "00 60 2c"),
    "8": (6, "~30 60 63 66 36 06 03 00 30, ~36 66 69 6c 3c 0c 09 06 36"),
    "9": (6, "~36 06 03 00 30 60 63 66 36, 63 66, ~66 6c 3c 0c 0a"),
    ".": (0, "0c"),
    ",": (1, "1c 0e"),
    ":": (0, "04, 0c"),
    ";": (1, "14, 1c 0e"),
    "!": (0, "00 08, 0c"),
    "?": (6, "~02 00 30 60 63 66 38, 3c"),
    "'": (0, "00 03"),
    '"': (3, "00 03, 30 33"),
    "-": (4, "06 46"),
    "_": (8, "0d 8d"),
    "+": (6, "06 66, 33 39"),
    "=": (6, "04 64, 08 68"),
    "*": (6, "31 37, 02 66, 62 06"),
    "/": (6, "0c 60"),
    "(": (3, "~3e 06 30"),
    ")": (3, "~0e 36 00"),
    "<": (6, "62 06 6a"),
    ">": (6, "02 66 0a"),
    "#": (8, "30 2c, 70 6c, 14 84, 08 78"),
    "%": (9, "0c 90, ~20 40 42 44 24 04 02 00 20, ~78 98 9a 9c 7c 5c 5a 58 78"),
    "&": (9, "9c 23, ~23 00 40 60 63 66 16, ~16 06 09 0c 4c 8c 87"),
}

CHARACTERS: Final = "".join(_GLYPHS)
"""All that can be written; small letters are written as capitals."""


def check_text(text: str) -> None:
    """Refuse characters that have no strokes.

    A UsageError names them, and those that there are.
    """
    if unknown := sorted(set(text.upper()) - set(_GLYPHS)):
        raise UsageError(
            f"{text!r} has {' '.join(unknown)}, which can't be drawn; there are the space, {CHARACTERS[1:]}"
        )


def text_width(text: str, weight: float) -> float:
    """Width from the left edge of the first stroke to the right edge of the last, in heights of a capital.

    `text`: checked. `weight`: thickness of the strokes in heights of a capital.
    """
    letters = text.upper()
    steps = sum(_GLYPHS[letter][0] for letter in letters) + _GAP * (len(letters) - 1)
    return steps / _STEPS * (1 - weight) + weight * len(letters)


def text_distance(x: F8, y: F8, text: str, left: float, top: float, height: float, weight: float) -> F8:
    """Signed distance to the strokes of a text, negative inside, in pixels; as an f8 array.

    Farther away than half a capital's height, and than a pixel, it is only known to be that far.

    `x` and `y`: (H, W) f8 places in pixels, any. `text`: checked. `left` and `top`: size of the text with its strokes,
    in pixels. `height`: height of a capital with its strokes, in pixels. `weight`: thickness of the strokes as a part
    of that.
    """
    half = 0.5 * weight * height
    step = (height - 2 * half) / _STEPS
    reach = max(0.5 * height, 1.0)
    distance = np.full(x.shape, reach)
    pen = left + half
    for letter in text.upper():
        width, lines = _GLYPHS[letter][0], _lines(letter)
        near = np.abs(x - pen - width * step / 2) < width * step / 2 + half + reach
        if lines and near.any():
            nearest = [
                segment_distance(x[near], y[near], [(pen + step * px, top + half + step * py) for px, py in line])
                for line in lines
            ]
            distance[near] = np.minimum(distance[near], np.min(nearest, axis=0) - half)
        pen += width * step + _GAP * step + 2 * half
    return distance


@cache
def _lines(letter: str) -> tuple[Line, ...]:
    """A letter's lines of straight pieces in steps of the grid."""
    return tuple(_line(words) for words in _GLYPHS[letter][1].split(", ") if words)


def _line(words: str) -> Line:
    points = [(float(int(word[0], 16)), float(int(word[1], 16))) for word in words.lstrip("~").split()]
    return _parabolas(points) if words.startswith("~") else tuple(points)


def _parabolas(points: Sequence[tuple[float, float]]) -> Line:
    """Points along parabolas from end to end."""
    line = [points[0]]
    for (ax, ay), (bx, by), (cx, cy) in zip(points[:-2:2], points[1::2], points[2::2], strict=True):
        for piece in range(1, _PARABOLA_PIECES + 1):
            t = piece / _PARABOLA_PIECES
            p, q, r = (1 - t) * (1 - t), 2 * t * (1 - t), t * t
            line.append((p * ax + q * bx + r * cx, p * ay + q * by + r * cy))
    return tuple(line)
