"""What plug-ins add to gsvc_ref, which therefore imports none of them.

A package names a module in the group of entry points "gsvc_ref.plugins". Importing that module registers what the
package offers, by the functions here:

- `add_command`: a command of ``gsvc``;
- `add_names`: names that `gsvc_ref` offers, such as ``gsvc_ref.concat``, and the module that each comes from;
- `add_source`: videos that are opened by a name, such as ``scene:pan``;
- `set_file_reader` and `add_target`: video files that gsvc_ref itself neither reads nor writes;
- `set_encoder`: encodes in several jobs, to a target of the whole clip, or that can be resumed;
- `set_vmaf_meter`: VMAF for `gsvc_ref.metrics.compare_frames`.

The modules of all plug-ins are imported when something is asked for that gsvc_ref lacks, so they should import little:
most is registered with the name of a module, which is imported when it is used.

A device on which losses and gradients can be computed is an entry point of its own, in the group "gsvc_ref.devices":
its name, such as ``cuda``, and a class that makes a `gsvc_ref.rendering.Evaluator` of a target and a background.

All rooms import this module, so it imports none of them, and their types are Any here.
"""

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from fractions import Fraction
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple, Protocol, cast

GROUP: Final = "gsvc_ref.plugins"
DEVICES: Final = "gsvc_ref.devices"

CPU: Final = "cpu"  # the device that no plug-in offers


class NamedSource(NamedTuple):
    """Videos that are opened by a name and drawn rather than read."""

    prefix: str
    """What the name of a built-in one begins with, such as ``scene:``."""
    suffix: str
    """What the name of a file ends with that describes one, such as ``.toml``."""
    open: Callable[[str], Any]
    """A new `VideoReader` by such a name."""


class Target(NamedTuple):
    """Files that a video is written to, by the ends of their names."""

    suffixes: tuple[str, ...]
    """In lower case, such as ``.mp4``."""
    takes_sound: bool
    """Whether `Extras.audio_from` is copied into such a file."""
    open: Callable[[Path, Any, Any], Any]
    """A new `VideoWriter` of such a file, given its `VideoFormat` and its `Extras`."""


class FileReader(Protocol):
    """Opens a video file that gsvc_ref cannot read."""

    def __call__(self, file: Path | BinaryIO, name: str, background: tuple[int, int, int] | None) -> Any:
        """A new `VideoReader` of a file that messages call `name`, what is transparent in it on R', G', B'."""


class MakeVmafMeter(Protocol):
    """Makes a meter of VMAF."""

    def __call__(self, peak: int, frame_rate: Fraction) -> AbstractContextManager[Any]:
        """A new `VmafMeter` for frames whose largest sample value is `peak`."""


_commands: Final[dict[str, str]] = {}
_names: Final[dict[str, str]] = {}
_sources: Final[list[NamedSource]] = []
_file_readers: Final[list[FileReader]] = []
_targets: Final[list[Target]] = []
_encoders: Final[list[str]] = []
_vmaf_meters: Final[list[str]] = []


def add_command(name: str, module: str) -> None:
    """Give ``gsvc`` a command.

    The module has a function ``add_command``, which takes the subparsers of argparse and adds a parser that sets
    ``run``. The order of ``gsvc --help`` is that of `gsvc_ref.cli.ORDER`, then that of registration.
    """
    _commands[name] = module


def add_names(homes: Mapping[str, str]) -> None:
    """Offer names of `gsvc_ref`, each from the module that it is mapped to; `gsvc_ref` lists those that it asks for."""
    _names.update(homes)


def add_source(source: NamedSource) -> None:
    """Let `gsvc_ref.video.open_video` open what bears such names."""
    _sources.append(source)


def set_file_reader(open_file: FileReader) -> None:
    """Let `gsvc_ref.video.open_video` open files that are neither y4m nor pictures."""
    _file_readers.append(open_file)


def add_target(target: Target) -> None:
    """Let `gsvc_ref.video.open_writer` write files with such names."""
    _targets.append(target)


def set_encoder(module: str) -> None:
    """Let `gsvc_ref.encode` hand over what it does not do itself to the function ``encode`` of a module."""
    _encoders.append(module)


def set_vmaf_meter(module: str) -> None:
    """Let `gsvc_ref.metrics.compare_frames` score VMAF by the class ``VmafMeter`` of a module."""
    _vmaf_meters.append(module)


def commands() -> Mapping[str, str]:
    """The module of each command that was given to `add_command`."""
    _load()
    return _commands


def offered(name: str) -> Any:
    """What a plug-in offers under a name of `gsvc_ref`; a UsageError says that none that is installed does."""
    _load()
    if name not in _names:
        from gsvc_base.errors import UsageError

        raise UsageError(f"gsvc_ref.{name} needs gsvc_tools, which comes with gsvc_ref: pip install .")
    return getattr(import_module(_names[name]), name)


def source_by_prefix(name: str) -> NamedSource | None:
    """The source whose built-in videos are named so, or None."""
    _load()
    return next((source for source in _sources if name.startswith(source.prefix)), None)


def source_by_suffix(name: str) -> NamedSource | None:
    """The source that files of such a name describe, or None."""
    _load()
    return next((source for source in _sources if name.lower().endswith(source.suffix)), None)


def file_reader() -> FileReader | None:
    """What was given to `set_file_reader` last, or None."""
    _load()
    return _file_readers[-1] if _file_readers else None


def targets() -> tuple[Target, ...]:
    """What was given to `add_target`, in that order."""
    _load()
    return tuple(_targets)


def encoder() -> Callable[..., Any]:
    """The function of the module that was given to `set_encoder` last; a UsageError says that no plug-in has one."""
    _load()
    if not _encoders:
        from gsvc_base.errors import UsageError

        raise UsageError(
            "jobs, an executor, resume and targets of a whole clip (bitrate, size, mean_psnr, vmaf) need gsvc_tools, "
            "which comes with gsvc_ref: pip install ."
        )
    return cast("Callable[..., Any]", import_module(_encoders[-1]).encode)


def vmaf_meter() -> MakeVmafMeter | None:
    """The meter of the module that was given to `set_vmaf_meter` last, or None."""
    _load()
    return cast("MakeVmafMeter", import_module(_vmaf_meters[-1]).VmafMeter) if _vmaf_meters else None


def check_device(name: str) -> None:
    """Refuse a device that is not there, with a UsageError that says which are."""
    if name != CPU and name not in devices():
        from gsvc_base.errors import UsageError

        more = "" if "cuda" in devices() else "; cuda comes with pip install 'gsvc-conformance[cuda]'"
        raise UsageError(f"there is no device {name!r}, only {', '.join((CPU, *devices()))}{more}")


@cache
def devices() -> Mapping[str, Any]:
    """The entry point of each device but the CPU; its `load` gives the class."""
    from importlib.metadata import entry_points

    return {entry.name: entry for entry in entry_points(group=DEVICES)}


@cache
def _load() -> None:
    from importlib.metadata import entry_points  # with the mail and sockets of Python's library: 15 ms

    for entry in entry_points(group=GROUP):
        entry.load()
