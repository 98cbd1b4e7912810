"""What a scene is made of: size, frames, seed, base and effects; from Python, from TOML, or built in."""

import math
import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from reprlib import repr as short
from typing import TYPE_CHECKING, Any, Final, Self

from gsvc_lab.scenes.base import Base
from gsvc_lab.scenes.effect import Canvas, Effect, effect_class
from gsvc_lab.scenes.names import SCENE_PREFIX, SCENE_SUFFIX, scene_names, scene_text
from gsvc_lab.scenes.parameters import (
    MAX_FRAMES,
    Checked,
    ParameterError,
    Rule,
    key_of,
    parameter,
    parameters,
    table,
    text,
    whole,
)
from gsvc_ref.errors import UsageError

if TYPE_CHECKING:
    from gsvc_ref.video import VideoReader

MAX_PIXELS: Final = 2**25
"""Of a frame: 8192 x 4096."""
MAX_SIDE: Final = 16384
MAX_EFFECTS: Final = 100
MAX_FILE_BYTES: Final = 2**20
"""Of a TOML file; descriptions take a few kilobytes."""
SLOWEST, FASTEST, MAX_TERM = Fraction(1, 1000), Fraction(10000), 10**6
KEYS: Final = ("title", "size", "frames", "frame_rate", "seed", "base", "effects")


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
class Scene(Checked):
    """The description of a synthetic clip; the same description gives the same bytes.

    Attributes
    ----------
    title
        One sentence about what is to be seen.
    width, height
        Of a frame in pixels; at most `MAX_PIXELS` in all.
    frames
        How many.
    frame_rate
        Frames per second.
    seed
        Of all that is random.
    base
        What is seen before any effect.
    effects
        What happens to it; at most one shutter effect among them.
    folder
        Where relative paths of images begin; None for the current folder.

    Raises
    ------
    UsageError
        A value is out of range, there are two shutters, or an image file is missing.
    """

    title: str = parameter(text(200), "one sentence about what is to be seen")
    width: int = parameter(whole(1, MAX_SIDE), "of a frame in pixels")
    height: int = parameter(whole(1, MAX_SIDE), "of a frame in pixels")
    frames: int = parameter(whole(1, MAX_FRAMES), "how many frames")
    frame_rate: Fraction = parameter(_frame_rate(), "frames per second", Fraction(24))
    seed: int = parameter(whole(0, 2**63 - 1), "of all that is random", 0)
    base: Base = parameter(table(Base), "what is seen before any effect, by exactly one of its keys")
    effects: tuple[Effect, ...] = parameter(_effects(), "what happens to it", ())
    folder: Path | None = None

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
        """What effects may know."""
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

    def open_video(self) -> "VideoReader":
        """A reader of its frames, which makes a scene a source like any other."""
        from gsvc_lab.scenes.reader import SceneReader

        return SceneReader(self)

    @classmethod
    def from_dict(cls, data: object, folder: Path | None = None) -> Self:
        """A scene from the contents of a TOML file.

        Raises
        ------
        ParameterError
            It is none: the key, what is wrong with its value, and what is allowed.
        """
        if not isinstance(data, Mapping):
            raise ParameterError("", f"is {short(data)}; it must be a table with the keys {', '.join(KEYS)}")
        for key in data:
            if key not in KEYS:
                raise ParameterError(str(key), f"is unknown here; there are {', '.join(KEYS)}")
        for key in ("title", "size", "frames", "base"):
            if key not in data:
                raise ParameterError(key, "is missing; a scene needs a title, size = [W, H], frames and a [base]")
        size = data["size"]
        if not isinstance(size, list | tuple) or len(size) != 2:
            raise ParameterError("size", f"is {short(size)}; it must be [width, height] in pixels, such as [352, 288]")
        rest = {key: value for key, value in data.items() if key != "size"}
        try:
            scene = cls(width=size[0], height=size[1], folder=folder, **rest)
        except ParameterError as error:
            if error.key in ("width", "height"):
                raise ParameterError(f"size ({error.key})", error.problem) from None
            raise
        _check_frame_numbers(scene)
        return scene

    @classmethod
    def from_toml(cls, path: str | Path) -> Self:
        """A scene from a TOML file; paths in it begin in its folder.

        Raises
        ------
        FileNotFoundError
            There is no such file.
        UsageError
            It is no description of a scene; the message names the file, the key and what is allowed.
        """
        path = Path(path)
        if not path.is_file():
            raise FileNotFoundError(f"there is no file {path}; check the name of the scene")
        if path.stat().st_size > MAX_FILE_BYTES:
            raise UsageError(f"{path} has {path.stat().st_size:,} bytes; a scene takes at most {MAX_FILE_BYTES:,}")
        return cls._parse(path.read_bytes(), str(path), path.parent)

    @classmethod
    def named(cls, name: str) -> Self:
        """A built-in scene, such as ``pan``.

        Raises
        ------
        UsageError
            There is none of that name.
        """
        return cls._parse(scene_text(name).encode(), f"{SCENE_PREFIX}{name}", None)

    @classmethod
    def find(cls, name: str) -> Self:
        """A built-in scene by its name, with or without ``scene:`` before it, or one from a ``.toml`` file."""
        if name.startswith(SCENE_PREFIX):
            return cls.named(name.removeprefix(SCENE_PREFIX))
        if name.endswith(SCENE_SUFFIX) or (name not in scene_names() and Path(name).is_file()):
            return cls.from_toml(name)
        return cls.named(name)

    @classmethod
    def _parse(cls, data: bytes, name: str, folder: Path | None) -> Self:
        try:
            return cls.from_dict(tomllib.loads(data.decode("utf-8-sig")), folder)
        except ParameterError as error:
            raise UsageError(f"{name}: {error}") from None
        except RecursionError:
            raise UsageError(f"{name} is nested too deeply for the description of a scene") from None
        except ValueError as error:  # neither UTF-8 nor TOML; both are ValueErrors that tell the place
            raise UsageError(
                f"{name} is not TOML: {error}; gsvc scene --print static shows a scene to start from"
            ) from None


def _check_frame_numbers(scene: Scene) -> None:
    """Refuse what would never happen; `resized` may cut off what happens later."""
    for number, effect in enumerate(scene.effects, 1):
        for item in parameters(type(effect)):
            value = getattr(effect, item.name)
            if not item.metadata["rule"].is_frame or value is None:
                continue
            latest = max(value) if isinstance(value, tuple) else value
            if latest >= scene.frames:
                raise ParameterError(
                    f"effects[{number}].{key_of(item)}", f"is {latest}; the clip has frames 0 to {scene.frames - 1}"
                )
