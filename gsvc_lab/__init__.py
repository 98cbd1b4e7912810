"""gsvc_lab: what looks at the codec gsvc_ref.

`scenes` draws clips of known content, `bench` sets GSVC against other codecs, `report` looks into one file, `accuracy`
measures what accuracy costs in time, `experiments` are the paper's, `benchmarks` measure speed, and `pages` writes what
people read of all that. With gsvc_lab installed, gsvc_ref opens
``scene:NAME`` and the TOML files of scenes as videos, and ``gsvc`` has the commands ``report``, ``bench``,
``accuracy``, ``scene`` and ``demo``.
"""

from gsvc_lab.scenes.names import SCENES as _SCENES
from gsvc_ref import plugins as _plugins
from gsvc_tools.cli.encode_page import set_page_writer as _set_page_writer

_plugins.add_source(_SCENES)
_set_page_writer("gsvc_lab.cli.report")
for _command in ("report", "bench", "accuracy", "scene", "demo"):
    _plugins.add_command(_command, f"gsvc_lab.cli.{_command}")
