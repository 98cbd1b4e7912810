"""PNG files by NumPy and zlib alone."""

import base64
import struct
import zlib
from typing import Final

import numpy as np
from numpy.typing import NDArray

U1 = NDArray[np.uint8]

SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
MAX_COLORS: Final = 256
"""Maximum number of colours of a palette."""
WITH_PALETTE: Final = 3
TRUE_COLOR: Final = 2


def png(pixels: U1) -> bytes:
    """An (H, W, 3) u1 picture of at least one pixel as a PNG file: with a palette where its colours fit into one."""
    height, width = pixels.shape[:2]
    colors, places = np.unique(pixels.reshape(-1, 3), axis=0, return_inverse=True)
    few = len(colors) <= MAX_COLORS
    samples = places.astype(np.uint8).reshape(height, width) if few else pixels.reshape(height, -1)
    rows = np.concatenate([np.zeros((height, 1), np.uint8), samples], axis=1)  # each row begins with its filter: none
    header = struct.pack(">IIBBBBB", width, height, 8, WITH_PALETTE if few else TRUE_COLOR, 0, 0, 0)
    palette = _chunk(b"PLTE", colors.tobytes()) if few else b""
    data = _chunk(b"IDAT", zlib.compress(rows.tobytes(), 9))
    return SIGNATURE + _chunk(b"IHDR", header) + palette + data + _chunk(b"IEND", b"")


def png_uri(pixels: U1) -> str:
    """An (H, W, 3) u1 picture as the data URI of a PNG."""
    return f"data:image/png;base64,{base64.b64encode(png(pixels)).decode('ascii')}"


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
