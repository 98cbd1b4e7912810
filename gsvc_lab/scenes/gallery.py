"""The gallery of `gsvc scene --gallery`: a page with pictures and descriptions of all built-in scenes and effects."""

import html
import inspect
import re
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

import numpy as np

from gsvc_base.arrays import U1
from gsvc_base.files import write_text
from gsvc_base.pages.page import document
from gsvc_lab.pages.pictures import animation_uri, png_uri
from gsvc_lab.scenes.built_in import SCENE_PREFIX, scene_names, scene_text
from gsvc_lab.scenes.clip import Clip
from gsvc_lab.scenes.effect import EFFECTS, effect_class, kind_of
from gsvc_lab.scenes.gallery_pictures import (
    changing_frames,
    motion_wheel,
    shows_something,
    telling_frames,
    truth_picture,
)
from gsvc_lab.scenes.ground_truth import truth
from gsvc_lab.scenes.parameters import key_of, parameters
from gsvc_lab.scenes.reference import as_toml, reference_object
from gsvc_lab.scenes.scene import Scene

Progress = Callable[[str, float, float | None], None]

WIDTH: Final = 192
"""Width of the pictures in pixels: scenes are drawn small, which a description allows."""
MAX_CLIP_BYTES: Final = 140_000
"""Size of the moving picture of one scene at most, before base64 adds a third of it."""
STRIP: Final = 6
"""Frames in the strip of a scene."""

_WHEEL: Final = 96
_LOOKS: Final = 3
_FEW: Final = 3  # effects that there is room for beside the pictures

_MOTION: Final = (
    "Beside each clip stands what is known about one of its frames. The colour is the direction in which each pixel "
    "has moved since the frame before, as in this wheel, and its strength the speed, full at the fastest; white "
    "stands still. Nearly black was not to be seen before, grey has no known motion, and lines are the outlines of "
    "objects."
)


def write_gallery(path: str | Path, on_progress: Progress = lambda text, done, total: None) -> None:
    """Write the gallery as one HTML file that needs nothing else: no network, no scripts.

    `path`: the file. `on_progress`: called with what is drawn next, how many scenes are done, and how many there are.
    An OSError says that the file cannot be written.
    """
    scenes = gallery_scenes()
    thumbs, sections = [], []
    for done, (name, scene) in enumerate(scenes.items()):
        on_progress(f"scene {name}", done, len(scenes))
        clip = Clip(scene.resized(width=WIDTH, height=round(scene.height * WIDTH / scene.width)))
        frames = list(clip)
        chosen = telling_frames(frames, STRIP)
        thumbs.append(_thumb(name, frames[chosen[len(chosen) // 2]]))
        sections.append(_scene_section(name, scene, clip, frames, chosen))
    page = document(
        "Scenes of GSVC",
        [
            "<h1>Scenes</h1>",
            "<p>Synthetic clips of known content. Each is a short description: a base, such as a photograph, and the "
            "effects that it calls for. An effect that is not named is not there and costs nothing, and adding one "
            "leaves the others as they are. The same description gives the same bytes.</p>",
            f"<p>{len(scenes)} scenes are built in, and {len(EFFECTS)} kinds of effects to make others of: print one "
            "with <code>gsvc scene --print NAME &gt; my.toml</code>, change it, and use <code>my.toml</code> wherever "
            "a video may stand.</p>",
            f'<div class="thumbs">{"".join(thumbs)}</div>',
            f'<div class="legend wheel">{_image(motion_wheel(_WHEEL), "a wheel of colours")}<p>{_MOTION}</p></div>',
            *sections,
            _effects_section(scenes),
            "<h2>Made by</h2><pre>gsvc scene --gallery</pre>",
        ],
    )
    write_text(page, path)


def gallery_scenes() -> dict[str, Scene]:
    """The built-in scenes by name, in the order of the effects that they are named after or begin with."""
    scenes = {name: Scene.named(name) for name in scene_names()}

    def rank(name: str) -> tuple[bool, int, int, str]:
        kinds = [kind_of(effect) for effect in scenes[name].effects]
        first = EFFECTS.index(name if name in kinds else kinds[0]) if kinds else -1
        return len(set(kinds)) > _FEW, first, len(kinds), name

    return {name: scenes[name] for name in sorted(scenes, key=rank)}


def _thumb(name: str, frame: U1) -> str:
    """A small picture that leads to a scene."""
    small = frame[::2, ::2]
    return f'<a href="#{name}">{_image(small, f"a frame of the scene {name}")}{name}</a>'


def _scene_section(name: str, scene: Scene, clip: Clip, frames: list[U1], chosen: list[int]) -> str:
    """All about one scene."""
    facts = f"{scene.width} × {scene.height} pixels, {scene.frames} frames, {float(scene.frame_rate):.5g} per second"
    strip = "".join(
        f"<figure>{_image(frames[number], f'frame {number}')}<figcaption>frame {number}</figcaption></figure>"
        for number in chosen
    )
    number, known = _telling_truth(clip, frames)
    still = frames[chosen[len(chosen) // 2]]
    effects, crowd = _effect_items(scene), ""
    if len(scene.effects) > _FEW:
        effects, crowd = "", f'<div class="effects">{effects}</div>'
    rows = "".join(
        f'<tr><td class="text"><code>{html.escape(key)}</code></td><td class="text">{_value(value)}</td></tr>'
        for key, value in known.items()
    )
    return (
        f'<h2 id="{name}">{name}</h2><p>{html.escape(scene.title)}.</p><div class="scene"><figure>'
        f"{_moving(frames, still, scene.frame_rate, f'the scene {name}')}<figcaption>{facts}</figcaption></figure>"
        f"{_truth_figure(known, number, scene.width / WIDTH)}<div>{effects}"
        f"<pre>gsvc scene {name} {name}.y4m</pre><pre>gsvc encode {SCENE_PREFIX}{name} {name}.gsvc</pre></div></div>"
        f'<div class="strip">{strip}</div>{crowd}'
        f'<details><summary>Its description</summary><pre class="file">{html.escape(scene_text(name))}</pre></details>'
        f"<details><summary>What is known about each frame</summary>"
        f"<pre>gsvc scene {name} {name}.y4m --truth {name}.npz</pre>"
        f'<p class="caption">Of frame {number}, {WIDTH} pixels wide:</p>'
        f'<div class="scroll"><table><tbody>{rows}</tbody></table></div></details>'
    )


def _effect_items(scene: Scene) -> str:
    """The kinds of effects of a scene, each with the parameters that are given."""
    given: dict[str, list[str]] = {}
    for effect in scene.effects:
        parts = [
            f"{key_of(item)} = {_short(getattr(effect, item.name))}"
            for item in parameters(type(effect))
            if getattr(effect, item.name) != item.default
        ]
        code = f"<br><code>{html.escape(', '.join(parts))}</code>" if parts else ""
        given.setdefault(kind_of(effect), []).append(code)
    items = (
        f'<p><a href="#effect-{kind}"><b>{kind}</b></a>: {html.escape(effect_class(kind).SUMMARY)}{"".join(codes)}</p>'
        for kind, codes in given.items()
    )
    return "".join(items) or "<p>No effects.</p>"


def _short(value: Any) -> str:
    """A parameter as in a file; of a table what is given in it."""
    if hasattr(value, "__dataclass_fields__"):
        given = {key_of(item): getattr(value, item.name) for item in parameters(type(value))}
        entries = (f"{key} = {_short(entry)}" for key, entry in given.items() if entry is not None)
        return f"{{ {', '.join(entries)} }}"
    return as_toml(value)


def _telling_truth(clip: Clip, frames: list[U1]) -> tuple[int, dict[str, Any]]:
    """A frame with much change, and what is known about it; one after a cut only if there is no other to look at."""
    known = {number: truth(clip, number) for number in changing_frames(frames, _LOOKS)}
    for number, facts in known.items():
        if shows_something(facts) and not facts["cut"]:
            return number, facts
    return next(iter(known.items()))


def _truth_figure(known: dict[str, Any], number: int, scale: float) -> str:
    """Motion and objects of a frame as a picture, or nothing; `scale` is how many times larger the scene itself is."""
    if not shows_something(known):
        return ""
    speed = scale * np.hypot(*known["motion"])
    fastest = np.max(speed, initial=0.0, where=np.isfinite(speed))
    what = "a cut; nothing of the frame before is left" if known["cut"] else "objects, none of which moves"
    what = f"motion of up to {fastest:.1f} pixels" if fastest > 0 else what
    caption = f"Known about frame {number}: {what}"
    return f"<figure>{_image(truth_picture(known), caption)}<figcaption>{caption}</figcaption></figure>"


def _value(value: Any) -> str:
    """A number as it is, an array by its shape and type."""
    array = np.asarray(value)
    if array.size > 4:
        return f"{' × '.join(map(str, array.shape))}, {array.dtype.kind}{array.dtype.itemsize}"
    if array.dtype.kind == "b":
        return "yes" if array else "no"
    return html.escape(", ".join(f"{number:.4g}" for number in array.ravel()))


def _effects_section(scenes: dict[str, Scene]) -> str:
    """Every kind of effect with its parameters and the scenes that have it."""
    known = reference_object()["effects"]
    users = {name: {kind_of(effect) for effect in scene.effects} for name, scene in scenes.items()}
    parts = []
    for kind, entry in known.items():
        links = ", ".join(f'<a href="#{name}">{name}</a>' for name, kinds in users.items() if kind in kinds)
        rows = "".join(
            f'<tr><td class="text"><code>{html.escape(key)}</code></td>'
            f'<td class="text long">{html.escape(item["meaning"])}</td>'
            f'<td class="text long">{html.escape(item["allowed"])}</td><td class="text">{_default(item)}</td></tr>'
            for key, item in entry["parameters"].items()
        )
        parts.append(
            f'<h3 id="effect-{kind}">{kind}</h3><p>{html.escape(entry["summary"])}</p>'
            f'<p class="caption">Stage: {entry["stage"]}. Scenes: {links or "none"}.</p>'
            f"{_known_truth(kind)}<details><summary>{len(entry['parameters'])} parameters</summary>"
            '<div class="scroll"><table><thead><tr><th class="text">key</th><th class="text">meaning</th>'
            f'<th class="text">what it may be</th><th class="text">without it</th></tr></thead><tbody>{rows}</tbody>'
            "</table></div></details>"
        )
    return f"<h2>Effects</h2>{''.join(parts)}"


def _default(item: dict[str, Any]) -> str:
    if item["needed"]:
        return "must be given"
    return "–" if item["default"] is None else f"<code>{html.escape(as_toml(item['default']))}</code>"


def _known_truth(kind: str) -> str:
    """The knowledge of an effect besides motion and masks: the first sentence of its `truth`."""
    method = effect_class(kind).truth
    if method.__qualname__ == "Effect.truth":
        return ""
    words = html.escape((inspect.getdoc(method) or "").partition("\n\n")[0])
    marked = re.sub("``(.+?)``", r"<code>\1</code>", words)
    return f'<p class="caption">Known: {marked}</p>' if words else ""


def _moving(frames: list[U1], still_frame: U1, frame_rate: Fraction, alt: str) -> str:
    """A moving picture; a still one for those who want no motion, or where Pillow cannot write WebP."""
    still, moving = _uri(still_frame), animation_uri(frames, frame_rate, MAX_CLIP_BYTES)
    height, width = frames[0].shape[:2]
    return (
        f'<picture><source media="(prefers-reduced-motion: reduce)" srcset="{still}">'
        f'<img src="{moving or still}" alt="{html.escape(alt)}" width="{width}" height="{height}"></picture>'
    )


def _image(picture: U1, alt: str) -> str:
    height, width = picture.shape[:2]
    return f'<img src="{_uri(picture)}" alt="{html.escape(alt)}" width="{width}" height="{height}" loading="lazy">'


def _uri(picture: U1) -> str:
    """A picture that may be lossy, as a data URI."""
    return animation_uri([picture], Fraction(1)) or png_uri(picture)
