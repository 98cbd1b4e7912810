"""The picture at the top of README.md: ``python -m gsvc_lab.site.picture`` writes docs/splats.webp again.

A frame of the demo's clip, twice its size, as `gsvc encode --splats 2000 --precision deterministic` codes it: the
decoded frame, the outline of every splat at one standard deviation, and a part of it drawn six times as large.
"""

import io
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image

import gsvc_ref
from gsvc_base.arrays import U1
from gsvc_base.cli.text import show
from gsvc_lab.pages.pictures import splat_outlines_picture
from gsvc_lab.scenes import DEMO_FRAME_RATE, demo_clip
from gsvc_ref.video import ColorDescription, VideoFormat

OUTPUT: Final = Path("docs") / "splats.webp"
WIDTH, HEIGHT = 384, 224
SPLATS: Final = 2000
ZOOM: Final = 6
CORNER: Final = (90, 36)
"""The upper left pixel, x and y, of the part that is drawn larger: an eye."""
GAP: Final = 12
"""White pixels between the panels."""


def main() -> None:
    """Encode the frame, draw the three panels beside each other and write them."""
    color = ColorDescription(primaries=1, transfer=1, matrix=1, full_range=False, chroma_location=0)
    video = VideoFormat(WIDTH, HEIGHT, DEMO_FRAME_RATE, 8, "rgb", color, frame_count=1)
    data = io.BytesIO()
    settings = gsvc_ref.Settings.quick(profile="paper", splats=SPLATS, precision="deterministic")
    report = gsvc_ref.encode((iter(demo_clip(WIDTH, HEIGHT, 1)), video), data, settings)
    frame = next(gsvc_ref.decode(data.getvalue()))
    large = next(gsvc_ref.decode(data.getvalue(), scale=ZOOM))
    splats = next(gsvc_ref.open(data.getvalue()).frames()).splats
    (x, y), size = CORNER, (2 * WIDTH, 2 * HEIGHT)
    panels = [
        np.asarray(Image.fromarray(frame).resize(size, Image.Resampling.NEAREST)),
        splat_outlines_picture(frame, splats, scale=2),
        large[ZOOM * y : ZOOM * y + size[1], ZOOM * x : ZOOM * x + size[0]],
    ]
    Image.fromarray(side_by_side(panels)).save(OUTPUT, quality=82, method=6)
    show(f"{OUTPUT}: {report.mean_psnr:.2f} dB, {report.bits_per_pixel:.2f} bits a pixel")


def side_by_side(panels: list[U1]) -> U1:
    """Pictures of one height beside each other, with white between them, as (H, W, 3) u1."""
    gap = np.full((panels[0].shape[0], GAP, 3), 255, np.uint8)
    return np.concatenate([panels[0], *(part for panel in panels[1:] for part in (gap, panel))], axis=1)


if __name__ == "__main__":
    main()
