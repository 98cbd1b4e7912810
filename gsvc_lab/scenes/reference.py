"""The keys and values of a scene's description, taken from the declarations themselves."""

from dataclasses import MISSING
from textwrap import wrap
from typing import Any, Final

from gsvc_lab.scenes.base import Base, Checker, Gradient, Noise
from gsvc_lab.scenes.description import MAX_PIXELS
from gsvc_lab.scenes.effect import EFFECTS, effect_class
from gsvc_lab.scenes.parameters import Checked, key_of, parameters
from gsvc_lab.scenes.scene import Scene

TABLES: Final[dict[str, type[Checked]]] = {
    "base": Base, "base.gradient": Gradient, "base.checker": Checker, "base.noise": Noise,
}  # fmt: skip
WIDTH: Final = 116


def reference_object() -> dict[str, Any]:
    """The keys of a scene, its bases and effects with their parameters: meaning, what is allowed, default."""
    bases = {name: {"parameters": _parameters(kind)} for name, kind in TABLES.items()}
    effects = {}
    for name in EFFECTS:
        kind = effect_class(name)
        effects[name] = {"stage": kind.STAGE, "summary": kind.SUMMARY, "parameters": _parameters(kind)}
    return {"scene": _scene_keys(), "bases": bases, "effects": effects}


def _scene_keys() -> dict[str, Any]:
    """The keys at the top of a file; width and height stand there as one."""
    keys = _parameters(Scene)
    allowed = f"each {keys['width']['allowed']}, at most {MAX_PIXELS:,} pixels in all"
    size = {"meaning": "width and height of a frame in pixels, such as [352, 288]", "allowed": allowed}
    keys = {"title": keys["title"], "size": {**keys["width"], **size}, **keys}
    return {key: entry for key, entry in keys.items() if key not in ("width", "height")}


def _parameters(kind: type[Checked]) -> dict[str, Any]:
    return {
        key_of(item): {
            "meaning": item.metadata["meaning"],
            "allowed": item.metadata["rule"].allowed,
            "needed": item.default is MISSING,
            "default": None if item.default is MISSING else item.default,
        }
        for item in parameters(kind)
    }


def reference_lines() -> list[str]:
    """The same in lines to read."""
    known = reference_object()
    lines = ["# at the top of the file", *_parameter_lines(known["scene"]), ""]
    for name, table in known["bases"].items():
        lines += [f"[{name}]", *_parameter_lines(table["parameters"]), ""]
    for name, table in known["effects"].items():
        lines += ["[[effects]]", f'kind = "{name}"', *_wrapped(table["summary"], "  ")]
        lines += [*_parameter_lines(table["parameters"]), ""]
    return lines[:-1]


def _parameter_lines(table: dict[str, Any]) -> list[str]:
    lines = []
    for key, entry in table.items():
        default = entry["default"]
        ends = "; needed" if entry["needed"] else "" if default is None else f"; default {as_toml(default)}"
        lines += _wrapped(f"{key}: {entry['meaning']}; {entry['allowed']}{ends}", "    ")
    return lines


def _wrapped(sentence: str, indent: str) -> list[str]:
    return wrap(sentence, WIDTH, initial_indent=indent, subsequent_indent=f"{indent}  ", break_on_hyphens=False)


def as_toml(value: object) -> str:
    """A default as it would be written in a file."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple):
        return f"[{', '.join(as_toml(item) for item in value)}]"
    return f"{value:g}" if isinstance(value, float) else str(value)
