"""gsvc_lab: what looks at the codec gsvc_ref.

`scenes` draws clips of known content, `bench` sets GSVC against other codecs, `report` looks into one file, `accuracy`
measures what accuracy costs in time, `experiments` are the paper's, `benchmarks` measure speed, and `pages` writes what
people read of all that. With gsvc_lab installed, gsvc_ref opens
``scene:NAME`` and the TOML files of scenes as videos, and ``gsvc`` has the commands ``report``, ``bench``,
``accuracy``, ``scene`` and ``demo``.
"""

from gsvc_lab.cli.accuracy import add_command as _add_accuracy
from gsvc_lab.cli.bench import add_command as _add_bench
from gsvc_lab.cli.demo import add_command as _add_demo
from gsvc_lab.cli.report import add_command as _add_report
from gsvc_lab.cli.report import after_encode as _after_encode
from gsvc_lab.cli.scene import add_command as _add_scene
from gsvc_lab.scenes.names import SCENES as _SCENES
from gsvc_ref import plugins as _plugins

_plugins.add_source(_SCENES)
_plugins.set_page_writer(_after_encode)
for _add in (_add_report, _add_bench, _add_accuracy, _add_scene, _add_demo):
    _plugins.add_command(_add)
