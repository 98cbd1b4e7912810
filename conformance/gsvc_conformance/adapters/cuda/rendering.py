"""Rendering and its gradients (spec.md 9 and 10.3): splats go to the device once, a picture comes back."""

import math
from typing import Final

import numpy as np

from gsvc_conformance.adapters.cuda.device import (
    Buffer,
    Floats,
    Values,
    address,
    clear,
    download,
    launch,
    storage,
    upload,
)

BLOCK: Final = 32
"""Width and height of a block of threads in pixels, four tiles: tiles.cuh."""
PICTURE_WARPS: Final = 8
"""Warps of such a block, and tiles, in rendering.cu."""
GRADIENT_WARPS: Final = 4
"""The same in gradients.cu."""
SPLATS_OF_BLOCK: Final = 8
"""Splats of a block of the kernels that have a warp for each: lists.cu and gradients.cu."""
SPLAT_BYTES: Final = 48
"""Size of Splat in splats.cuh."""
SLOT_BYTES: Final = 128
"""The moments of a splat in four tiles: gradients.cu."""
MAX_LISTS: Final = 2**28
"""The lists of all regions take so many bytes together; regions are made larger until they do."""

SCENE: Final = np.dtype(
    [("splats", "u8"), ("lists", "u8"),
     ("list_size", "i4"), ("width", "i4"), ("height", "i4"), ("side", "i4"), ("columns", "i4")],
    align=True,
)  # fmt: skip
"""Scene of tiles.cuh."""


class Scene:
    """The splats of a frame and the lists of its regions, which stay on the device: rendering without a round trip.

    What it needs is allocated here; `fill` and what draws only launch, so `device.replay` may record them. A picture
    goes into a buffer that begins at a multiple of 16 bytes, as every whole buffer does.

    Parameters
    ----------
    width, height
        Of the frame in pixels.
    most_splats
        There is room for so many.
    slots
        There is room for the moments of so many pairs of a splat and a block of its box, for gradients.
    exact
        Whether all of it is compiled for identical bytes.
    """

    def __init__(self, width: int, height: int, most_splats: int, *, slots: int = 0, exact: bool = False) -> None:
        self.width, self.height, self.most_splats, self.exact = width, height, most_splats, exact
        self.list_size = -(-most_splats // 128)  # of 128 bits
        self.side = BLOCK
        while self._list_bytes > MAX_LISTS and self.side < max(width, height):
            self.side *= 2
        self.splats = storage(SPLAT_BYTES * most_splats)
        self._cleared = storage(self._list_bytes + 8)
        self.slots_needed = self._cleared[self._list_bytes :]
        self.slots = slots
        self.moments = storage(SLOT_BYTES * slots)

    @property
    def _list_bytes(self) -> int:
        return 16 * self.list_size * self._columns * -(-self.height // self.side)

    @property
    def _columns(self) -> int:
        return -(-self.width // self.side)

    @property
    def blocks(self) -> tuple[int, int]:
        """The blocks of kernels that draw."""
        return -(-self.width // BLOCK), -(-self.height // BLOCK)

    @property
    def told(self) -> np.void:
        """What the kernels are told of it."""
        where = address(self.splats), address(self._cleared)
        sizes = self.list_size, self.width, self.height, self.side, self._columns
        return np.void((*where, *sizes), dtype=SCENE)

    def fill(self, parameters: Buffer, splat_count: int) -> None:
        """List the splats with these parameters, f4 (splat_count, 8)."""
        clear(self._cleared)
        frame = self.width, self.height, self.side, self._columns, self.list_size
        launch(
            "list_intersections", -(-splat_count // SPLATS_OF_BLOCK), 32 * SPLATS_OF_BLOCK, parameters, splat_count,
            *frame, self.splats, self._cleared, self.slots, self.slots_needed, exact=self.exact,
        )  # fmt: skip

    def draw(self, kernel: str, warps: int, *arguments: object) -> None:
        """Start a kernel that has so many warps for each block of pixels."""
        launch(kernel, self.blocks, 32 * warps, self.told, *arguments, exact=self.exact)

    def sum(self, into: Buffer, base: Buffer | None = None) -> None:
        """The sum (9-2) on top of a picture, (H, W, 3) f4."""
        self.draw("render_sum", PICTURE_WARPS, base, into)

    def frame(self, into: Buffer, bit_depth: int) -> None:
        """The frame, (H, W, 3) u1 or u2: R-13-4, and (9-7) where it is exact."""
        self.draw("render_frame", PICTURE_WARPS, bit_depth, into)

    def gradients(self, parameters: Buffer, splat_count: int, scale: float, into: Buffer) -> None:
        """The gradients, (splat_count, 8) f4, times `scale`, of the moments that a kernel has left."""
        launch(
            "grad_splats", -(-splat_count // SPLATS_OF_BLOCK), 32 * SPLATS_OF_BLOCK, self.told, parameters,
            splat_count, self.moments, np.float64(scale), into,
        )  # fmt: skip


def filled(parameters: Floats, width: int, height: int, *, exact: bool = False) -> Scene:
    """A scene of these splats, (N, 8) f4."""
    scene = Scene(width, height, len(parameters), exact=exact)
    scene.fill(upload(parameters, "f4"), len(parameters))
    return scene


def _sum(parameters: Floats, width: int, height: int, exact: bool) -> Values:
    picture = storage(12 * width * height)
    filled(parameters, width, height, exact=exact).sum(picture)
    return {"sum": download(picture, (height, width, 3), "f4")}


def render_sum(parameters: Floats, width: int, height: int) -> Values:
    """The sum of the splats over a frame, (H, W, 3) f4, compiled for speed: R-13-3."""
    return _sum(parameters, width, height, exact=False)


def render_sum_deterministic(parameters: Floats, width: int, height: int) -> Values:
    """The sum of the splats over a frame, (H, W, 3) f4, of the operations of 9.3: R-9.3-1."""
    return _sum(parameters, width, height, exact=True)


def render_frame(parameters: Floats, width: int, height: int, bit_depth: int) -> Values:
    """The frame of a set of splats, (H, W, 3) u1 or u2, whose sum stays in registers: R-13-4."""
    dtype = np.dtype("u1" if bit_depth == 8 else "u2")
    frame = storage(3 * width * height * dtype.itemsize)
    filled(parameters, width, height).frame(frame, bit_depth)
    return {"frame": download(frame, (height, width, 3), dtype)}


def to_frame(sum: Floats, bit_depth: int) -> Values:
    """The samples of a sum, (H, W, 3) u1 or u2: R-9.1-1."""
    dtype = np.dtype("u1" if bit_depth == 8 else "u2")
    frame = storage(sum.size * dtype.itemsize)
    launch("to_frame", -(-sum.size // 256), 256, upload(sum, "f4"), np.int64(sum.size), bit_depth, frame, exact=True)
    return {"frame": download(frame, sum.shape, dtype)}


def to_frame_deterministic(sum: Floats, bit_depth: int) -> Values:
    """The kernel of `to_frame`, which is that of (9-7)."""
    return to_frame(sum, bit_depth)


def scale_parameters(parameters: Floats, width: int, height: int, new_width: int, new_height: int) -> Values:
    """The splats of a frame for one of another size, (N, 8) f4: R-9.4-1."""
    count, scaled = len(parameters), storage(parameters.nbytes)
    sizes = map(float, (width, height, new_width, new_height))
    launch("scale_parameters", -(-count // 256), 256, upload(parameters, "f4"), count, *sizes, scaled, exact=True)
    return {"parameters": download(scaled, parameters.shape, "f4")}


def scale_parameters_filtered(parameters: Floats, width: int, height: int, new_width: int, new_height: int) -> Values:
    """The splats of a frame for a smaller one, (N, 8) f4: R-9.4-3."""
    count, filtered = len(parameters), storage(parameters.nbytes)
    sides = ((width, new_width), (height, new_height))
    ratios = [new / old for old, new in sides]
    deviations = [math.sqrt(max(0, old - new) * (old + new) / 12) / old for old, new in sides]
    launch(
        "scale_parameters_filtered", -(-count // 256), 256, upload(parameters, "f4"), count, *ratios, *deviations,
        filtered,
    )  # fmt: skip
    return {"parameters": download(filtered, parameters.shape, "f4")}


def render_gradients(parameters: Floats, residual: Floats) -> Values:
    """dL/dparameters, (N, 8) f4, of dL/dC, (H, W, 3) f4: R-10.3-1."""
    height, width = residual.shape[:2]
    there, count = upload(parameters, "f4"), len(parameters)
    scene = Scene(width, height, count, slots=1)
    scene.fill(there, count)
    scene = Scene(width, height, count, slots=int(download(scene.slots_needed, (), "u8")))
    scene.fill(there, count)
    gradients = storage(parameters.nbytes)
    scene.draw("render_gradients", GRADIENT_WARPS, upload(residual, "f4"), scene.moments)
    scene.gradients(there, count, 1, gradients)
    return {"gradients": download(gradients, parameters.shape, "f4")}
