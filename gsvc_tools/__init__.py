"""gsvc_tools: what makes the codec gsvc_ref pleasant to use, a plug-in of the same distribution.

gsvc_ref has what a decoder, the paper's training, or one readable encoder needs. What people want beside that stands
here: `listing` names every element of a stream, `editing` joins and cuts streams, `writing` makes one of splats that
were found elsewhere, `splat_files` has splats in files of other formats, `viewing` is the server of ``gsvc view``,
`video` reads and writes video files beyond y4m and pictures, `jobs` encodes on many processors, and so that an encode
can be resumed, `targets` encodes to a bit rate, a size or a mean PSNR, and `libvmaf` measures VMAF. With gsvc_tools
installed, gsvc_ref has the functions ``concat``, ``cut`` and ``write``, its ``encode`` takes jobs, resume and targets,
and ``gsvc`` has the commands ``view``, ``info``, ``dump``, ``compare``, ``concat``, ``cut``, ``import`` and ``export``
and all options of ``encode``.

This module registers all of it through `gsvc_ref.plugins`. gsvc_tools imports gsvc_ref, and gsvc_ref nothing from here.
"""

from gsvc_ref import plugins as _plugins
from gsvc_tools.video.opening import TARGETS as _TARGETS
from gsvc_tools.video.opening import open_file as _open_file

_plugins.add_names({"concat": "gsvc_tools.editing", "cut": "gsvc_tools.editing", "write": "gsvc_tools.writing"})

_plugins.set_file_reader(_open_file)
for _target in _TARGETS:
    _plugins.add_target(_target)

_plugins.set_vmaf_meter("gsvc_tools.libvmaf")
_plugins.set_encoder("gsvc_tools.encode_video")

_plugins.add_command("encode", "gsvc_tools.cli.encode")
_plugins.add_command("view", "gsvc_tools.cli.view")
_plugins.add_command("info", "gsvc_tools.cli.info")
_plugins.add_command("dump", "gsvc_tools.cli.dump")
_plugins.add_command("compare", "gsvc_tools.cli.compare")
_plugins.add_command("concat", "gsvc_tools.cli.concat")
_plugins.add_command("cut", "gsvc_tools.cli.cut")
_plugins.add_command("import", "gsvc_tools.cli.splats_in")
_plugins.add_command("export", "gsvc_tools.cli.splats_out")
