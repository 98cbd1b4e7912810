"""The built-in scenes by name: TOML files in the folder `library`."""

from typing import Final

from gsvc_base.errors import UsageError

SCENE_PREFIX: Final = "scene:"
"""The beginning of a built-in scene's name where a video file might be named as well: ``scene:pan``."""
SCENE_SUFFIX: Final = ".toml"


def scene_names() -> tuple[str, ...]:
    """The names of the built-in scenes, in the order of the alphabet."""
    from importlib.resources import files

    library = files("gsvc_lab.scenes") / "library"
    return tuple(
        sorted(item.name.removesuffix(SCENE_SUFFIX) for item in library.iterdir() if item.name.endswith(SCENE_SUFFIX))
    )


def scene_text(name: str) -> str:
    """The description of a built-in scene as it stands in its file.

    A UsageError says that there is none of that name.
    """
    from importlib.resources import files

    names = scene_names()
    if name not in names:
        from difflib import get_close_matches

        close = get_close_matches(name, names, n=1)
        guess = f" (did you mean {close[0]}?)" if close else ""
        raise UsageError(f"there is no scene {name!r}{guess}; there are {', '.join(names)}, or give a FILE.toml")
    return (files("gsvc_lab.scenes") / "library" / f"{name}{SCENE_SUFFIX}").read_text(encoding="utf-8")
