"""The ladder: what each choice of accuracy costs in time, measured on the machine that it runs on.

`rungs` says what is varied, `choices` what a rung does, `variants` renders with the choices that the reference does
not leave open, `measure` takes times and errors, `ladder` runs it all into `results`, and `cells` and `page` show them.
"""

from gsvc_lab.accuracy.cells import ladder_object, markdown
from gsvc_lab.accuracy.ladder import measure_ladder
from gsvc_lab.accuracy.page import ladder_html
from gsvc_lab.accuracy.results import Ladder
from gsvc_lab.accuracy.rungs import GROUP_NAMES, GROUPS
from gsvc_lab.accuracy.sources import SCENES, Source, clip_source, scene_source

__all__ = [
    "GROUPS",
    "GROUP_NAMES",
    "SCENES",
    "Ladder",
    "Source",
    "clip_source",
    "ladder_html",
    "ladder_object",
    "markdown",
    "measure_ladder",
    "scene_source",
]
