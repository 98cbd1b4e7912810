"""Exact knowledge about a frame of a scene, because it was drawn: motion, what was hidden, masks, cuts.

`truth` and the NPZ file of `write_truth` (there with one more axis in front, the frames) have these keys:

``motion``
    (2, H, W) f4: how far right and down what is seen in each pixel has moved since the frame before, in pixels. So
    frame t shows at (x, y) what frame t - 1 showed at (x - motion[0], y - motion[1]), if it was to be seen there, but
    for light, highlights, the shutter and noise; the first pixel has its centre at (0.5, 0.5). NaN where there is no
    such thing: in frame 0, after a cut, while a moving camera sees a mixture of pictures of two sizes, and in objects
    that have just appeared.
``visible_before``
    (H, W) bool: whether what is seen in each pixel was to be seen in the frame before; false where it was outside of
    the frame, behind an object, or not there at all.
``cut``
    bool: no base that the frame before showed is left, whatever stays in front.
``camera``
    (4,) f8: x, y, span and roll of `gsvc_lab.scenes.camera.Camera`.
``NAME.mask``, ``NAME.seen``
    (H, W) f4: how much of each pixel an object covers, 0..1, with what is hidden by others in front of it and without.
``NAME.VALUE``
    Knowledge of an effect itself; see `truth` of its class. NAME is its kind and number, such as ``noise-1``.

A pixel belongs to what covers at least half of it. With a shutter all this is true of the middle of the time in which
it is open.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F8
from gsvc_base.errors import UsageError
from gsvc_base.files import check_parent, complete_file
from gsvc_lab.scenes.canvas import Canvas
from gsvc_lab.scenes.clip import Clip
from gsvc_lab.scenes.description import Description

Move = Callable[[F8, F8, Canvas, int], tuple[F8, F8] | None]

TOLERANCE: Final = 1e-9
"""Tolerance in pixels of a place before a warp."""
MAX_STEPS: Final = 200
MAX_TRUTH_BYTES: Final = 2**31


def truth(scene: Description | Clip, frame: int) -> dict[str, Any]:
    """The ground truth of a frame; the module's docstring names the keys.

    Parameters
    ----------
    scene
        A scene, or a Clip of it, which does not prepare anything twice.
    frame
        Its number, 0 or more.
    """
    clip = scene if isinstance(scene, Clip) else Clip(scene)
    camera = clip.camera(frame)
    known: dict[str, Any] = {
        "camera": np.array([camera.x, camera.y, camera.span, camera.roll]),
        "cut": frame > 0 and not set(clip.shown(frame)) & set(clip.shown(frame - 1)),
        **_masks(clip, frame),
        **_motion(clip, frame),
    }
    for name, effect in clip.effects.items():
        known |= {f"{name}.{key}": value for key, value in effect.truth(clip.canvas, frame).items()}
    return known


def _masks(clip: Clip, frame: int) -> dict[str, Any]:
    """The part of each pixel that the objects cover."""
    masks: dict[str, Any] = {}
    left: Any = np.float64(1)  # of a pixel, by what stands in front
    for name, item in reversed(clip.objects.items()):
        part = item.coverage(*_grid(clip), clip.canvas, frame)
        if part is not None:
            masks[f"{name}.mask"], masks[f"{name}.seen"] = part.astype(np.float32), (part * left).astype(np.float32)
            left = left * (1 - part)
    return masks


def _motion(clip: Clip, frame: int) -> dict[str, Any]:
    """Motion, and what was visible before."""
    x, y = _grid(clip)
    motion = np.full((2, *x.shape), np.nan)
    visible = np.zeros(x.shape, np.bool_)
    if frame > 0:
        owner = _owner(clip, x, y, frame)
        moves: list[Move] = [partial(_background, clip), *(item.motion for item in clip.objects.values())]
        for number, move in enumerate(moves):
            mine = owner == number
            if mine.any() and (moved := move(x[mine], y[mine], clip.canvas, frame)) is not None:
                motion[:, mine] = moved
        x_before, y_before = x - motion[0], y - motion[1]
        inside = (x_before >= 0) & (x_before <= x.shape[1]) & (y_before >= 0) & (y_before <= x.shape[0])
        shown = set(clip.shown(frame)) <= set(clip.shown(frame - 1))
        visible = inside & (_owner(clip, x_before, y_before, frame - 1) == owner) & (shown | (owner > 0))
    return {"motion": motion.astype(np.float32), "visible_before": visible}


def _owner(clip: Clip, x: F8, y: F8, time: float) -> NDArray[np.intp]:
    """The thing seen at points of the frame: 0 the background, else the number of an object, counted from 1."""
    owner = np.zeros(x.shape, np.intp)
    for number, item in enumerate(clip.objects.values(), 1):
        part = item.coverage(x, y, clip.canvas, time)
        if part is not None:
            owner[part >= 0.5] = number
    return owner


def _background(clip: Clip, x: F8, y: F8, canvas: Canvas, frame: int) -> tuple[F8, F8] | None:
    """The motion of the base by the camera and the warps in points of the frame; None where there is not one answer."""
    if not set(clip.shown(frame)) & set(clip.shown(frame - 1)):
        return None
    now, before = clip.camera(frame), clip.camera(frame - 1)
    right, below = clip.displacement(x, y, frame)
    x_read, y_read = x + right, y + below
    if now != before:
        size, *others = {clip.view(base).sizes for base in clip.shown(frame)}
        if others:  # a mixture of pictures that move differently
            return None
        x_read, y_read = size.to_frame(before, *size.to_picture(now, x_read, y_read))
    x_before, y_before = _unwarped(clip, x_read, y_read, frame - 1)
    return x - x_before, y - y_before


def _unwarped(clip: Clip, x_read: F8, y_read: F8, time: float) -> tuple[F8, F8]:
    """The points of a frame that read at given points, by fixed-point iteration; NaN where it does not settle."""
    x, y = x_read, y_read
    if not clip.warps:
        return x, y
    change = np.full(x.shape, np.inf)
    for _ in range(MAX_STEPS):
        right, below = clip.displacement(x, y, time)
        change = np.maximum(np.abs(x_read - right - x), np.abs(y_read - below - y))
        x, y = x_read - right, y_read - below
        if change.max() <= TOLERANCE:
            break
    settled = change <= TOLERANCE
    return np.where(settled, x, np.nan), np.where(settled, y, np.nan)


def _grid(clip: Clip) -> tuple[F8, F8]:
    """The centres of all pixels, (H, W) f8 each."""
    x, y = np.broadcast_arrays(*clip.canvas.centres())
    return x, y


def check_truth_size(scene: Description) -> None:
    """Refuse a scene of which too much is known to write it.

    A UsageError says that it would take more than `MAX_TRUTH_BYTES`.
    """
    arrays = [np.asarray(value) for value in truth(scene.resized(width=1, height=1), 0).values()]
    fields = sum(array.nbytes for array in arrays if array.shape[-2:] == (1, 1))  # bytes of each pixel
    others = sum(array.nbytes for array in arrays) - fields
    size = scene.frames * (scene.width * scene.height * fields + others)
    if size > MAX_TRUTH_BYTES:
        raise UsageError(
            f"what is known about {scene.frames:,} frames of {scene.width}x{scene.height} would take "
            f"{size / 2**30:.1f} GiB; at most {MAX_TRUTH_BYTES // 2**30} are written: take fewer or smaller frames"
        )


def write_truth(
    scene: Description, path: str | Path, on_frame: Callable[[int], None] = lambda number: None
) -> list[str]:
    """Write what is known about all frames of a scene as one NPZ file, which stands under its name once it is complete.

    `scene`: the scene. `path`: the file. `on_frame`: called with the number of each frame before it is looked at.
    Returns the keys in the file. `check_truth_size` raises a UsageError. A FileNotFoundError says that the
    folder of the file does not exist.
    """
    check_parent(Path(path))
    check_truth_size(scene)
    clip = Clip(scene)
    known = []
    for number in range(scene.frames):
        on_frame(number)
        known.append(truth(clip, number))
    arrays: dict[str, Any] = {key: np.stack([frame.pop(key) for frame in known]) for key in sorted(known[0])}
    with complete_file(Path(path)) as file:
        np.savez_compressed(file, **arrays)
    return list(arrays)
