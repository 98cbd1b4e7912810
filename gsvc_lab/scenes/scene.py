"""A scene from Python, from TOML or built in, which is a source of frames like a video file."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from reprlib import repr as short
from typing import TYPE_CHECKING, Final, Self

from gsvc_base.errors import UsageError
from gsvc_lab.scenes.built_in import SCENE_PREFIX, SCENE_SUFFIX, scene_names, scene_text
from gsvc_lab.scenes.description import Description
from gsvc_lab.scenes.parameters import ParameterError, key_of, parameters

if TYPE_CHECKING:
    from gsvc_ref.video import VideoReader

MAX_FILE_BYTES: Final = 2**20
"""Size of a TOML file at most; descriptions take a few kilobytes."""
KEYS: Final = ("title", "size", "frames", "frame_rate", "seed", "base", "effects")


@dataclass(frozen=True, kw_only=True)
class Scene(Description):
    """A synthetic clip: a `Description`, which has all attributes, with the ways to read and to draw it.

    The same description gives the same bytes.
    """

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
