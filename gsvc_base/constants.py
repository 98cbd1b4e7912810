"""Constants of Annex A of spec.md that several rooms of the package need; each of the others stands where it is used.

A name of Annex A has one value in the whole package, that of spec.md: a test holds them together.
"""

from typing import Final

import numpy as np

LN_255: Final = 5.541263545158426
"""ln 255: a splat covers a pixel iff sigma <= LN_255, that is, iff its weight is at least one step of 8 bits (R-9.1-3).
The paper says "splats covering the pixel" without a number; its authors' code cuts at exp(-sigma) < 1/255."""

SUPPORT_SQUARED: Final = np.float32(2 * LN_255)
"""K of (9-5): u1^2 + u2^2 at the edge of the support, rounded to binary32."""

SUPPORT_RADIUS: Final = 3.3290429691304455
"""rho = sqrt(2 ln 255), the radius of the support in standard deviations: covered iff |u| <= SUPPORT_RADIUS."""

REACH: Final = SUPPORT_RADIUS * (1 + 2.0**-17)
"""rho', the radius of the support with room for the roundings of a renderer.

No renderer finds a pixel covered outside of the boxes of (5-1), which have this radius.
"""

SMALLEST_NORMAL: Final = 2.0**-126
"""The smallest positive normal binary32: a splat with l11 or l22 below it (zero, negative or less) is degenerate and
covers nothing (R-9.1-2), and no `cholesky_scale` is below it (R-6.5-5)."""

HALF: Final = np.float32(0.5)
"""From the corner of a pixel to its centre."""

ONE: Final = np.float32(1)

LUMA_WEIGHTS: Final = {
    1: (0.2126, 0.0722),
    4: (0.30, 0.11),
    5: (0.299, 0.114),
    6: (0.299, 0.114),
    7: (0.212, 0.087),
    9: (0.2627, 0.0593),
}
"""K_R and K_B by `matrix_coefficients` (ITU-T H.273, table 4; section 11.1)."""
