"""The coders that are ours: the profiles and presets of GSVC that are compared, with their numbers of splats."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from gsvc_lab.bench.planes import PlanarClip
from gsvc_ref.encoder import Settings


@dataclass(frozen=True)
class Coder:
    """One way to code a clip by GSVC."""

    name: str  # name for tables
    preset: str  # `Settings.quick` and the like, by its name
    pixels_per_splat: tuple[int, ...]  # n is the area of the picture over each of these, from coarse to fine
    overrides: Mapping[str, Any] = field(default_factory=dict)  # what it takes as arguments beside N

    def settings(self, **others: Any) -> Settings:
        """The settings: those of the preset but for the overrides; whole files without notes of the encoder."""
        make: Callable[..., Settings] = getattr(Settings, self.preset)
        return make(**{"decisions": False, **self.overrides, **others})

    def counts(self, clip: PlanarClip) -> tuple[int, ...]:
        """The numbers of splats for a clip."""
        area = clip.format.width * clip.format.height
        return tuple(max(1, area // pixels) for pixels in self.pixels_per_splat)


DENSITIES: Final = (200, 100, 50, 25)
"""The paper's 10,000 to 50,000 splats at 1920x1080 are 207 to 41 pixels a splat; one step more towards quality."""

WIDER: Final = (400, *DENSITIES, 12)
"""Those of `main`: a step more towards quality, since its splats take about a quarter of the bits, and a step less.

On plain pictures its coarser points are as good as the best of `paper`, and without the first they had nothing in
common."""

MAIN: Final = Coder("GSVC main, quick", "quick", WIDER, {"profile": "main"})
SLOW: Final = Coder("GSVC main, slow", "slow", DENSITIES, {"profile": "main"})
PAPER: Final = Coder("GSVC paper, quick", "quick", DENSITIES, {"profile": "paper"})
LONG: Final = Coder(
    "GSVC paper, quick with 600 iterations", "quick", DENSITIES[1:], {"profile": "paper", "iterations": 600}
)
ALONE: Final = Coder(
    "every frame alone (paper, quick)", "quick", DENSITIES[1::2], {"profile": "paper", "key_frames": 1}
)
OWN: Final = Coder("GSVC paper, the paper's settings", "paper", DENSITIES, {"profile": "paper"})
OWN_ALONE: Final = Coder(
    "every frame alone, the paper's settings", "paper", DENSITIES, {"profile": "paper", "key_frames": 1}
)

CODERS: Final = tuple(coder for coder in (PAPER, MAIN, SLOW, LONG, ALONE) if hasattr(Settings, coder.preset))
"""The coders of every clip; `paper` and `main` stand next to each other, since their seconds are compared."""

LONG_RUNS: Final = (OWN, OWN_ALONE)
"""Those of the few frames that are also coded with the paper's 50,000 iterations."""
