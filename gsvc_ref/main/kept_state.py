"""What profile `main` carries from frame to frame (spec.md section 15.12)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gsvc_base.arrays import I8
from gsvc_base.splats import Splats
from gsvc_ref.bitstream.crc import parameter_checksum
from gsvc_ref.main.codes import NO_FIELD, Field
from gsvc_ref.main.densities import Densities
from gsvc_ref.main.models import Models
from gsvc_ref.main.state import no_splats, to_splats, work_of


@dataclass(frozen=True, eq=False)
class MainState:
    """All that profile `main` carries from frame to frame."""

    width: int  # of the coded frame in pixels
    height: int
    values: I8  # (N, 8), the state of the splats of the frame before, in integers
    past: I8  # (N,), what it did with each: 0 nothing, or it was in an I-frame, 1 it changed, 2 it was new
    models: Models
    densities: Densities | None = None  # those that are kept; None: there are none since the last I-frame
    inherited: Field = NO_FIELD  # what `motion_cell` 0 stands for: in a layer, while it is coded, the field of the base
    quantizer: int = 0  # that of the last I- or P-frame

    @classmethod
    def initial(cls, width: int, height: int) -> "MainState":
        """The state before the first frame of a sequence, and the one in which every I-frame is coded (R-15.11-1)."""
        return cls(width, height, no_splats(), np.zeros(0, np.int64), Models())

    @cached_property
    def splats(self) -> Splats:
        """The splats of the frame before, in binary32 (15-5)."""
        return to_splats(self.values)

    def work_at(self, halvings: int) -> int:
        """The rendering work of these splats, in pairs, on a frame that is halved so often (5-2); it is found once."""
        if halvings not in self._works:
            self._works[halvings] = work_of(self.values, self.width, self.height, halvings)
        return self._works[halvings]

    @cached_property
    def _works(self) -> dict[int, int]:
        return {}

    @cached_property
    def rests(self) -> bool:
        """Whether the frame before has done nothing with any splat."""
        return not self.past.any()

    @cached_property
    def checksum(self) -> int:
        """The `parameter_checksum` of these splats."""
        return parameter_checksum(self.splats)
