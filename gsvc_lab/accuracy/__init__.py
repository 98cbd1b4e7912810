"""The cost of accuracy in time, measured with the codec's own kernels on the machine that it runs on.

`groups` says what is varied, `work` what is timed for each setting and how its outcome is assessed, `measure` takes
times and errors, `runner` measures it all into `results`, and `tables` and `page` show them.
"""

from gsvc_lab.accuracy.groups import GROUP_NAMES, GROUPS
from gsvc_lab.accuracy.page import accuracy_html
from gsvc_lab.accuracy.results import AccuracyReport
from gsvc_lab.accuracy.runner import measure_accuracy
from gsvc_lab.accuracy.sources import SCENES, Source, clip_source, scene_source
from gsvc_lab.accuracy.tables import accuracy_object, markdown

__all__ = [
    "GROUPS",
    "GROUP_NAMES",
    "SCENES",
    "AccuracyReport",
    "Source",
    "accuracy_html",
    "accuracy_object",
    "clip_source",
    "markdown",
    "measure_accuracy",
    "scene_source",
]
