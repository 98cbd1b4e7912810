"""Bits of three layers against those of one at the same quality."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Final

from gsvc_lab.bench.bd_rate import rate_at
from gsvc_lab.bench.coders import MAIN
from gsvc_lab.bench.measure import Curve, gsvc_point
from gsvc_lab.bench.planes import PlanarClip
from gsvc_ref.encoder.settings import MainSettings

WRITTEN: Final = "layer_splats" in {field.name for field in fields(MainSettings)}
"""Whether this encoder writes layers."""

COUNT: Final = 3


@dataclass(frozen=True)
class Layered:
    """A clip in layers."""

    clip: str  # title of the clip
    splats: tuple[int, ...]  # n of a frame with the base, with layer 1, ..., growing
    psnr: float  # PSNR of all layers together in dB, the mean over frames
    bytes: int  # size of the file
    # Size of a file of one layer of that PSNR, read off its curve; None where the curve does not reach it
    single_bytes: float | None

    @property
    def ratio(self) -> float | None:
        """Bits of the layers over those of a single one."""
        return None if self.single_bytes is None else self.bytes / self.single_bytes


def layered(clip: PlanarClip, single: Curve, folder: Path, threads: int | None) -> Layered:
    """Code a clip in layers with the numbers of splats of a single layer's curve, those before its finest point."""
    splats = tuple(point.splats for point in single.points[-COUNT - 1 : -1] if point.splats is not None)
    made, _ = gsvc_point(clip, MAIN.settings(layer_splats=splats, threads=threads), folder)
    rate = rate_at(single.pairs("psnr"), made.psnr)
    return Layered(clip.title, splats, made.psnr, made.bytes, None if rate is None else rate * clip.pixels / 8)
