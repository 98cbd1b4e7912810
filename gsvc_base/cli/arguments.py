"""Types of arguments: text to value, with a message that says what is allowed."""

import math
import re
from argparse import ArgumentParser, ArgumentTypeError
from collections.abc import Callable
from fractions import Fraction
from typing import TypeVar

Number = TypeVar("Number", int, float)
"""What `numbers_of` gives a tuple of."""


def add_max_level(parser: ArgumentParser) -> None:
    """Add ``--max-level`` to a command that reads streams."""
    parser.add_argument(
        "--max-level", type=int, choices=range(1, 6), default=5, metavar="L",
        help="refuse streams of a level above L, 1 to 5 (default), before anything is taken for their frames",
    )  # fmt: skip


def add_layer(parser: ArgumentParser) -> None:
    """Add ``--layer`` to a command that decodes streams."""
    parser.add_argument(
        "--layer", type=whole, metavar="K",
        help="of a stream with quality layers: decode the base and the layers up to K; 0 is the base alone; default: "
        "all of them",
    )  # fmt: skip


def add_force(parser: ArgumentParser) -> None:
    """Add ``--force`` to a command that writes streams."""
    parser.add_argument(
        "--force", action="store_true", help="write a stream under a name that says another format, such as OUT.mp4"
    )


def frame_range(text: str) -> tuple[int, int | None]:
    """``30:60`` is (30, 60), ``30:`` is (30, None) and ``:60`` is (0, 60); the end is not included."""
    match = re.fullmatch(r"(\d{0,9}):(\d{0,9})", text, re.ASCII)
    if match is None:
        raise ArgumentTypeError(f"{text!r} is not A:B, such as 30:60 (frames 30 to 59), 30: or :60")
    start, stop = int(match[1] or 0), int(match[2]) if match[2] else None
    if stop is not None and stop <= start:
        raise ArgumentTypeError(f"{text!r} holds no frame: B must be greater than A, and frame B is not included")
    return start, stop


def key_frames(text: str) -> str | int | tuple[int, ...]:
    """``auto``, a number for every k frames, or a list such as ``0,12,40`` (``0,`` is a list of one)."""
    if text == "auto":
        return text
    if re.fullmatch(r"\d{1,9}", text, re.ASCII):
        return int(text)
    if re.fullmatch(r"\d{1,9}(,\d{1,9})*,?", text, re.ASCII):
        return tuple(int(number) for number in text.split(",") if number)
    raise ArgumentTypeError(f"{text!r} is none of: auto, K (every K frames), or frame numbers such as 0,12,40")


def lanes(text: str) -> str | int:
    """``by-size``, ``by-size:P%``, which the settings check, or a number."""
    return text if text.startswith("by-size") else whole(text)


def frame_rate(text: str) -> Fraction:
    """A number above 0 as a ratio: ``25``, ``29.97`` or ``30000/1001``."""
    match = re.fullmatch(r"\d{1,9}(\.\d{1,9}|/\d{1,9})?", text, re.ASCII)
    if match is None or re.search(r"/0+$", text) or Fraction(text) == 0:
        raise ArgumentTypeError(f"{text!r} is not a frame rate, such as 25, 29.97 or 30000/1001")
    return Fraction(text)


def finite(text: str) -> float:
    """A finite number."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ArgumentTypeError(f"{text!r} is not a finite number, such as 34.5")
    return value


def positive(text: str) -> float:
    """A finite number above 0."""
    if (value := finite(text)) <= 0:
        raise ArgumentTypeError(f"{text!r} is not above 0")
    return value


def amount(text: str) -> float:
    """A number above 0 with k, M or G for powers of 1000, or Ki, Mi or Gi for powers of 1024: ``500k`` is 500000."""
    match = re.fullmatch(r"(\d{1,15}(?:\.\d{1,9})?)(?:([kKMG])(i?))?", text, re.ASCII)
    if match is None or float(match[1]) == 0:
        raise ArgumentTypeError(f"{text!r} is not an amount above 0, such as 500k, 1.5M, 2Mi or 800000")
    power = "kMG".index(match[2].replace("K", "k")) + 1 if match[2] else 0
    unit: int = (1024 if match[3] else 1000) ** power
    return float(match[1]) * unit


def amount_of_bytes(text: str) -> int:
    """The same, rounded to whole bytes, at least 1."""
    return max(1, round(amount(text)))


def scale(text: str) -> float | tuple[int, int]:
    """``0.5`` is a factor, and ``640x360`` is (640, 360)."""
    if "x" in text:
        return size(text)
    try:
        return positive(text)
    except ArgumentTypeError:
        raise ArgumentTypeError(
            f"{text!r} is neither a factor above 0, such as 0.5, nor a size, such as 640x360"
        ) from None


def whole(text: str) -> int:
    """An integer; its range is the concern of whoever uses it."""
    if not re.fullmatch(r"[+-]?\d{1,18}", text, re.ASCII):
        raise ArgumentTypeError(f"{text!r} is not a whole number")
    return int(text)


def numbers_of(of: Callable[[str], Number]) -> Callable[[str], tuple[Number, ...]]:
    """Numbers with commas between, such as ``30,34,38``, each of them as `of` takes it."""

    def numbers(text: str) -> tuple[Number, ...]:
        return tuple(of(part) for part in text.split(","))

    return numbers


def size(text: str) -> tuple[int, int]:
    """``192x112`` is (192, 112), width and height."""
    match = re.fullmatch(r"([1-9]\d{0,4})x([1-9]\d{0,4})", text, re.ASCII)
    if match is None:
        raise ArgumentTypeError(f"{text!r} is not a size such as 192x112")
    return int(match[1]), int(match[2])
