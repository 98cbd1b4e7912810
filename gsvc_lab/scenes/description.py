"""The description of a scene: size, frames, seed, base and effects."""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from reprlib import repr as short
from typing import Any, Final, Self

from gsvc_base.errors import UsageError
from gsvc_lab.scenes.base import Base
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.effect import Effect, effect_class
from gsvc_lab.scenes.parameters import (
    MAX_FRAMES,
    Checked,
    ParameterError,
    Rule,
    parameter,
    parameters,
    table,
    text,
    whole,
)

MAX_PIXELS: Final = 2**25
"""Maximum number of pixels of a frame: 8192 x 4096."""
MAX_SIDE: Final = 16384
MAX_EFFECTS: Final = 100
SLOWEST, FASTEST, MAX_TERM = Fraction(1, 1000), Fraction(10000), 10**6


def _frame_rate() -> Rule:
    def take(value: object) -> Fraction:
        if isinstance(value, str):  # an exponent could ask for a number of a billion digits
            match = re.fullmatch(r"(\d{1,9})(?:/(0*[1-9]\d{0,8}))?", value, re.ASCII)
            if match is None:
                raise ValueError
            rate = Fraction(int(match[1]), int(match[2] or 1))
        elif isinstance(value, int | Fraction) and not isinstance(value, bool):
            rate = Fraction(value)
        elif isinstance(value, float) and math.isfinite(value):
            rate = Fraction(str(value))  # 12.5 as written
        else:
            raise ValueError
        if not SLOWEST <= rate <= FASTEST or max(rate.numerator, rate.denominator) > MAX_TERM:
            raise ValueError
        return rate

    return Rule('a number from 0.001 to 10000 or a ratio such as "30000/1001", with terms up to a million', take)


def _effects() -> Rule:
    def take(value: object) -> tuple[Effect, ...]:
        if not isinstance(value, list | tuple) or len(value) > MAX_EFFECTS:
            raise ValueError
        return tuple(_effect(item, number) for number, item in enumerate(value, 1))

    return Rule(f"a list of at most {MAX_EFFECTS} effects, each a table [[effects]] with its kind", take)


def _effect(item: object, number: int) -> Effect:
    """An effect that is one already, or from its table; the number is for the message."""
    if isinstance(item, Effect):
        return item
    try:
        if not isinstance(item, Mapping) or "kind" not in item:
            raise ParameterError("kind", "is missing: the name of the effect, such as pan")
        try:
            kind = effect_class(item["kind"])
        except UsageError as error:
            raise ParameterError("kind", f"is {short(item['kind'])}; {error}") from None
        return kind.from_table({key: value for key, value in item.items() if key != "kind"})
    except ParameterError as error:
        raise error.within(f"[{number}]") from None


@dataclass(frozen=True, kw_only=True)
class Description(Checked):
    """The description of a synthetic clip; the same description gives the same bytes.

    A UsageError says that a value is out of range, there are two shutters, or an image file is missing.
    """

    title: str = parameter(text(200), "one sentence about what is to be seen")  # one sentence about what is to be seen
    # Size of a frame in pixels; at most `MAX_PIXELS` in all
    width: int = parameter(whole(1, MAX_SIDE), "of a frame in pixels")
    height: int = parameter(whole(1, MAX_SIDE), "of a frame in pixels")
    frames: int = parameter(whole(1, MAX_FRAMES), "how many frames")  # number of frames
    frame_rate: Fraction = parameter(_frame_rate(), "frames per second", Fraction(24))  # frames per second
    seed: int = parameter(whole(0, 2**63 - 1), "of all that is random", 0)  # seed of all that is random
    # The base picture, before any effect
    base: Base = parameter(table(Base), "what is seen before any effect, by exactly one of its keys")
    # Effects that change it; at most one shutter effect among them
    effects: tuple[Effect, ...] = parameter(_effects(), "what happens to it", ())
    folder: Path | None = None  # folder in which relative paths of images begin; None for the current one

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.width * self.height > MAX_PIXELS:
            raise ParameterError(
                "size", f"is [{self.width}, {self.height}]; it must be at most {MAX_PIXELS:,} pixels in all"
            )
        shutters = [number for number, effect in enumerate(self.effects, 1) if effect.STAGE == "shutter"]
        if len(shutters) > 1:
            raise ParameterError(
                f"effects[{shutters[1]}]", f"is a second shutter after effects[{shutters[0]}]; a scene has at most one"
            )
        for key, base in self.bases():
            if (path := base.path(self.folder)) is not None and not path.is_file():
                raise ParameterError(f"{key}.image", f"is {short(base.image)}, and there is no file {path}")

    @property
    def canvas(self) -> Canvas:
        """The clip as far as effects may know it."""
        return Canvas(self.width, self.height, self.frames)

    def bases(self) -> Iterator[tuple[str, Base]]:
        """Everything that is drawn as a base, by its key: the scene's own and those that effects put in its place."""
        yield "base", self.base
        for number, effect in enumerate(self.effects, 1):
            for item in parameters(type(effect)):
                if isinstance(value := getattr(effect, item.name), Base):
                    yield f"effects[{number}].{item.name}", value

    def resized(
        self,
        width: int | None = None,
        height: int | None = None,
        frames: int | None = None,
        seed: int | None = None,
    ) -> Self:
        """The same scene at another size, longer or shorter, or with another seed; None leaves it as it is.

        What happens at a certain frame still does; what spans the whole clip still spans it.
        """
        given = {"width": width, "height": height, "frames": frames, "seed": seed}
        changes: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
        return replace(self, **changes)
