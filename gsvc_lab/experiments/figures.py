"""The one style of all figures, and how they are written: SVG that is the same for the same numbers."""

import base64
import importlib.util
import io
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.arrays import F4
from gsvc_base.errors import UsageError
from gsvc_lab.clips import as_frame, as_picture, resized
from gsvc_lab.pages.schemes import in_both_schemes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#7F7F7F")
"""Okabe and Ito's palette, which the colour-blind can tell apart; in the order to take them."""

MARKERS: Final = ("o", "s", "^", "D", "v", "P", "X", "*")
"""Marks of lines, which so differ by more than colour."""

STYLE: Final[Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": "#5b6570",
    "axes.grid": True,
    "axes.labelcolor": "#1a1e23",
    "axes.prop_cycle": f"cycler('color', {list(COLORS)!r})",
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 10,
    "figure.facecolor": "white",
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Helvetica", "Arial"],
    "font.size": 9,
    "grid.color": "#dfe2e5",
    "grid.linewidth": 0.6,
    "legend.edgecolor": "#dfe2e5",
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.6,
    "lines.markersize": 4.5,
    "svg.fonttype": "none",
    "svg.hashsalt": "gsvc_ref",
    "xtick.color": "#5b6570",
    "ytick.color": "#5b6570",
}

JPEG_QUALITY: Final = 65
"""Quality of pictures inside figures, so that a figure stays small enough to keep."""

LARGEST_PICTURE: Final = 400
"""Pixels on the longer side of pictures inside figures; larger ones are resampled."""

DOTS_PER_INCH: Final = 160
"""Resolution of dots, which are drawn as pixels and take less room so."""

DOT_COLORS: Final = 8
"""Shades of what is drawn as pixels on nothing."""

_EMBEDDED_PNG: Final = re.compile(r"data:image/png;base64,([A-Za-z0-9+/=\s]+)")


def check_figures() -> None:
    """Refuse to begin where figures cannot be drawn.

    A UsageError says that matplotlib is not installed.
    """
    if importlib.util.find_spec("matplotlib") is None:
        raise UsageError("figures are drawn by matplotlib; pip install 'gsvc_ref[experiments]'")


def new_figure(
    width: float, height: float, rows: int = 1, columns: int = 1, **options: Any
) -> tuple["Figure", NDArray[Any]]:
    """A figure of this size in inches with its axes, always (rows, columns); options as of `Figure.subplots`."""
    import matplotlib
    from matplotlib.figure import Figure

    matplotlib.rcParams.update(STYLE)  # for all that is drawn, also after this
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def save_figure(figure: "Figure", folder: Path, name: str) -> str:
    """Write a figure as ``folder/name.svg``; returns its name."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", dpi=DOTS_PER_INCH, metadata={"Date": None, "Creator": None})
    folder.mkdir(parents=True, exist_ok=True)
    svg = in_both_schemes(_EMBEDDED_PNG.sub(_smaller, buffer.getvalue()))
    (folder / f"{name}.svg").write_text(svg, encoding="utf-8")
    return name


def _smaller(match: re.Match[str]) -> str:
    """An embedded PNG as JPEG where it is opaque, and as a PNG of few colours where it has dots on nothing."""
    from PIL import Image

    encoded = re.sub(r"\s", "", match[1])
    picture = Image.open(io.BytesIO(base64.b64decode(encoded))).convert("RGBA")
    buffer = io.BytesIO()
    if picture.getchannel("A").getextrema() == (255, 255):
        kind = "jpeg"
        picture.convert("RGB").save(buffer, "JPEG", quality=JPEG_QUALITY, optimize=True, progressive=True)
    else:
        kind = "png"
        picture.quantize(DOT_COLORS, Image.Quantize.FASTOCTREE).save(buffer, "PNG", optimize=True)
    made = base64.b64encode(buffer.getvalue()).decode()
    return f"data:image/{kind};base64,{made}" if len(made) < len(encoded) else f"data:image/png;base64,{encoded}"


def show_picture(axes: "Axes", picture: NDArray[Any], title: str) -> None:
    """A picture (H, W, 3), f4 with 1.0 = full scale or u1, with a title above."""
    samples = as_picture(picture) if picture.dtype == np.uint8 else np.asarray(picture, np.float32)
    height, width = samples.shape[:2]
    if (longest := max(width, height)) > LARGEST_PICTURE:
        samples = resized(
            samples, max(1, width * LARGEST_PICTURE // longest), max(1, height * LARGEST_PICTURE // longest)
        )
    axes.imshow(as_frame(samples), interpolation="none")
    axes.set_title(title)
    axes.set_axis_off()


def show_centers(axes: "Axes", positions: F4, width: int, height: int, title: str, *, color: str = COLORS[0]) -> None:
    """The centres of splats, (N, 2) in pixels, as dots on an empty frame; those outside of it are not shown."""
    inside = ((positions >= 0) & (positions <= [width, height])).all(axis=1)
    size = float(np.clip(3000 / max(len(positions), 1), 0.25, 4))
    x, y = positions[inside].T
    axes.scatter(x, y, s=size, color=color, linewidths=0, rasterized=True)
    axes.set(xlim=(0, width), ylim=(height, 0), aspect="equal", xticks=[], yticks=[], title=title)
    axes.spines[:].set_visible(True)
    axes.grid(visible=False)


def line(axes: "Axes", x: Sequence[float], y: Sequence[float], number: int, label: str, **options: Any) -> None:
    """A line with marks in the colour and with the mark of a number."""
    axes.plot(x, y, color=COLORS[number % 8], marker=MARKERS[number % 8], label=label, **options)


def log_axis(axes: "Axes", values: Sequence[float], which: str = "x") -> None:
    """Make an axis logarithmic with marks at these values alone."""
    axis = getattr(axes, f"{which}axis")
    axes.set(**{f"{which}scale": "log"})
    axis.set_ticks(sorted(set(values)), labels=[f"{value:,g}" for value in sorted(set(values))])
    axis.set_ticks([], minor=True)
