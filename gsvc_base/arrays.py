"""Names of array types by the kind and the bytes of their elements, as NumPy writes them: F4 is ``<f4``."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.errors import UsageError

F2 = NDArray[np.float16]
F4 = NDArray[np.float32]
F8 = NDArray[np.float64]
I2 = NDArray[np.int16]
I4 = NDArray[np.int32]
I8 = NDArray[np.int64]
U1 = NDArray[np.uint8]
U2 = NDArray[np.uint16]
U4 = NDArray[np.uint32]

Frame = NDArray[np.unsignedinteger[Any]]
"""(H, W, 3) full-range R'G'B', u1 for 8 bits, else u2."""
Plane = NDArray[np.unsignedinteger[Any]]
"""(rows, columns) of one component, u1 for 8 bits, else u2."""

MIN_BIT_DEPTH: Final = 8
MAX_BIT_DEPTH: Final = 16


def frame_type(bit_depth: int) -> type[np.uint8] | type[np.uint16]:
    """The integer type of a frame: u1 for 8 bits, u2 for 9 to 16; a UsageError refuses others."""
    if not MIN_BIT_DEPTH <= bit_depth <= MAX_BIT_DEPTH:
        raise UsageError(f"the bit depth is {bit_depth}; it must be {MIN_BIT_DEPTH} to {MAX_BIT_DEPTH}")
    return np.uint8 if bit_depth == MIN_BIT_DEPTH else np.uint16
