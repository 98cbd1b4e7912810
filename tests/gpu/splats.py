"""Splats to render: trained sets in frames of two sizes, and random ones by their number."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from gsvc_base.arrays import F4
from gsvc_base.draws import Draws
from gsvc_lab.benchmarks.material import picture, trained, trained_path

DRAWS: Final = 20_000
"""Random sets of splats that deterministic sums are compared on."""

STREAM: Final = 10_000
"""Splats of a frame of the stream that is decoded (`material.stream`)."""

WILD: Final = 0.4
"""Part of the draws whose factors and colours span many powers of two."""


@dataclass(frozen=True)
class Scene:
    """Splats and their frame."""

    width: int
    height: int
    count: int

    @property
    def id(self) -> str:
        """Such as ``1920x1080_10000``."""
        return f"{self.width}x{self.height}_{self.count}"

    @property
    def name(self) -> str:
        """Such as ``1920x1080, 10,000 splats``."""
        return f"{self.width}x{self.height}, {self.count:,} splats"

    def splats(self) -> F4:
        """(N, 8) f4, in the columns of `Splats.to_array`."""
        if self in TRAINED:
            path = trained_path(self.width, self.height, self.count)
            if not path.exists():
                trained(self.width, self.height, self.count)
            splats: F4 = np.load(path)
            return splats
        return random_splats(Draws(self.count), self.width, self.height, self.count, 1)

    def target(self) -> F4:
        """The picture that they should be, (H, W, 3) f4."""
        return picture(self.width, self.height)


TRAINED: Final = (Scene(352, 288, 2000), *(Scene(1920, 1080, count) for count in (10_000, 20_000, 50_000)))
SMALL: Final = (Scene(48, 32, 60),)
"""For a processor that plays a GPU."""


def drawn(number: int) -> tuple[F4, int, int]:
    """The splats of a number, 1 to 2,048, and a frame of 1x1 to 129x129 for them; stated operations only."""
    rng = Draws((0, number))
    least = 2 ** rng.integers(0, 11)
    count = rng.integers(least, 2 * least + 1)
    width, height = rng.integers(1, 130), rng.integers(1, 130)
    return random_splats(rng, width, height, count, 40 if rng.uniform() < WILD else 1), width, height


def random_splats(rng: Draws, width: int, height: int, count: int, span: int) -> F4:
    """(N, 8) f4; some factors are scaled by 2^-`span` to 2^`span`, some colours by 2^-3`span` to 2^`span`."""
    values = np.empty((count, 8))
    values[:, :2] = rng.uniform(-20, np.add((width, height), 20), (count, 2))
    values[:, [2, 4]] = rng.lognormal(1, 1, (count, 2))
    values[:, 3] = rng.normal(0, 3, count)
    values[:, 5:] = rng.normal(0, 1, (count, 3))
    exponents = np.concatenate(
        [rng.integers(-span, span + 1, (count, 3)), rng.integers(-3 * span, span + 1, (count, 3))], axis=1
    )
    scaled = rng.random((count, 6)) < np.repeat((0.3, 0.2), 3)
    values[:, 2:] = np.ldexp(values[:, 2:], np.where(scaled, exponents, 0))
    return values.astype(np.float32)
