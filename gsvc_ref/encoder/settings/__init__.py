"""All that can be chosen about an encode, and the presets.

A stream is of profile `main` (spec.md section 15) or `paper`. `Settings` are what both have, `MainSettings` and
`PaperSettings` add what one has alone. Presets `quick` and `slow` write `main`; `paper` is what the paper did, in
profile `paper`, which `quick` can write as well.
"""

from gsvc_ref.encoder.settings.common import MIN_PIXELS_PER_SPLAT as MIN_PIXELS_PER_SPLAT
from gsvc_ref.encoder.settings.common import PIXELS_PER_SPLAT as PIXELS_PER_SPLAT
from gsvc_ref.encoder.settings.common import Settings as Settings
from gsvc_ref.encoder.settings.main import MainSettings as MainSettings
from gsvc_ref.encoder.settings.paper import PaperSettings as PaperSettings
