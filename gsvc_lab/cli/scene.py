"""``gsvc scene``: draw a synthetic clip from its description."""

import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from gsvc_base.cli.arguments import size, whole
from gsvc_base.cli.errors import EXIT_INTERRUPTED, say
from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import print_json, show, table
from gsvc_base.errors import UsageError
from gsvc_ref.cli.files import STDIO, check_output, describe_format, display_name

if TYPE_CHECKING:
    from gsvc_lab.scenes import Scene
    from gsvc_ref.video import VideoWriter

COMMAND: Final = "gsvc scene"
GALLERY: Final = "gallery.html"


def add_command(commands: Any) -> None:
    """Add the command to the subparsers of ``gsvc``."""
    parser = commands.add_parser(
        "scene",
        help="draw a synthetic clip with known motion, cuts, light and noise",
        description="Draw a synthetic clip from its description: a built-in one by name, or a TOML file. "
        "scene:NAME and FILE.toml also stand for a video wherever one is read: gsvc encode scene:pan pan.gsvc.",
        allow_abbrev=False,
    )
    parser.set_defaults(run=run)
    scene = parser.add_argument("scene", metavar="NAME|FILE.toml", help="the scene; --list shows the built-in ones")
    output = parser.add_argument(
        "output", metavar="OUT",
        help="OUT.y4m; a folder, for PNG files; OUT.mp4, .mkv, .mov or .webm for a lossy copy to look at; "
        "or - for y4m on standard output",
    )  # fmt: skip
    # What stands instead of a clip needs neither. With nargs="?" no option could stand between the two.
    scene.required = output.required = False
    clip = parser.add_argument_group("the clip")
    clip.add_argument("--size", type=size, metavar="WxH", help="draw it at this size instead of its own")
    clip.add_argument("--frames", type=whole, metavar="K", help="draw K frames; what spans the whole clip spans those")
    clip.add_argument("--seed", type=whole, metavar="S", help="seed of all that is random")
    clip.add_argument(
        "--chroma", choices=("rgb", "420", "422", "444"), default="rgb",
        help="chroma format to write; default: rgb, which is 444 in y4m",
    )  # fmt: skip
    clip.add_argument(
        "--truth", metavar="FILE.npz",
        help="also write what is exactly known: motion, what was hidden, masks, cuts; "
        "python -m pydoc gsvc_lab.scenes.ground_truth says what the keys mean",
    )  # fmt: skip
    other = parser.add_argument_group("instead of a clip")
    other.add_argument("--list", action="store_true", help="list the built-in scenes")
    other.add_argument("--print", action="store_true", help="print the TOML of a built-in scene, to start one's own")
    other.add_argument("--effects", action="store_true", help="list all that can be written in a scene's file")
    other.add_argument(
        "--gallery", nargs="?", const=GALLERY, metavar="FILE.html|FOLDER",
        help=f"write a page with pictures of all built-in scenes (default: {GALLERY})",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print as JSON, and only that")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")


def run(arguments: Namespace) -> int:
    """Draw or show; 0, or 130 when interrupted."""
    modes = [name for name in ("list", "print", "effects", "gallery") if getattr(arguments, name)]
    if len(modes) > 1:
        raise UsageError(f"--{modes[0]} and --{modes[1]} do not go together; give one of them")
    if not modes:
        return _draw(arguments)
    surplus = arguments.output if modes[0] == "print" else arguments.scene
    if surplus is not None:
        raise UsageError(f"--{modes[0]} draws no clip, so it does not take {surplus!r}; give the one or the other")
    return {"list": _list, "print": _print, "effects": _effects, "gallery": _gallery}[modes[0]](arguments)


def _list(arguments: Namespace) -> int:
    from gsvc_lab.scenes import Scene, scene_names

    scenes = {name: Scene.named(name) for name in scene_names()}
    if arguments.json:
        print_json({name: scene_object(scene) for name, scene in scenes.items()})
        return 0
    rows = [
        [name, f"{scene.width}x{scene.height}", str(scene.frames), f"{float(scene.frame_rate):.5g}"]
        for name, scene in scenes.items()
    ]
    lines = table(["scene", "size", "frames", "1/s"], rows)
    titles = ["", *(scene.title for scene in scenes.values())]
    show(*(f"{line}  {title}" for line, title in zip(lines, titles, strict=True)))
    return 0


def scene_object(scene: "Scene") -> dict[str, Any]:
    """A scene for ``--json``."""
    from gsvc_lab.scenes.effect import kind_of

    return {
        "title": scene.title,
        "width": scene.width,
        "height": scene.height,
        "frames": scene.frames,
        "frame_rate": scene.frame_rate,
        "seed": scene.seed,
        "base": scene.base.name,
        "effects": [kind_of(effect) for effect in scene.effects],
    }


def _print(arguments: Namespace) -> int:
    from gsvc_lab.scenes.built_in import SCENE_PREFIX, SCENE_SUFFIX, scene_text

    if arguments.scene is None or arguments.scene.endswith(SCENE_SUFFIX):
        raise UsageError("--print needs the name of a built-in scene, such as gsvc scene --print pan")
    show(scene_text(arguments.scene.removeprefix(SCENE_PREFIX)).removesuffix("\n"))
    return 0


def _effects(arguments: Namespace) -> int:
    from gsvc_lab.scenes.reference import reference_lines, reference_object

    if arguments.json:
        print_json(reference_object())
    else:
        show(*reference_lines())
    return 0


def _gallery(arguments: Namespace) -> int:
    from gsvc_lab.scenes.gallery import write_gallery

    path = Path(arguments.gallery)
    if path.is_dir():
        path /= GALLERY
    elif path.suffix.lower() not in (".html", ".htm"):
        raise UsageError(f"--gallery {path}: give a folder that exists, or a file whose name ends in .html")
    check_output(str(path), STDIO)
    with ProgressDisplay(quiet=arguments.quiet) as display:
        write_gallery(path, on_progress=display.update)
    if not arguments.quiet:
        show(f"{path}: pictures and descriptions of all built-in scenes; open it in a browser")
    return 0


def _draw(arguments: Namespace) -> int:
    from gsvc_lab.scenes import Scene

    if arguments.scene is None or arguments.output is None:
        raise UsageError("give a scene and where to draw it, such as gsvc scene pan pan.y4m; --list shows the scenes")
    if arguments.json and arguments.output == STDIO:
        raise UsageError("--json needs standard output, which carries the clip: write to a file, or drop --json")
    scene = Scene.find(arguments.scene)
    images = [str(path) for _, base in scene.bases() if (path := base.path(scene.folder)) is not None]
    for source in (arguments.scene, *images):
        check_output(arguments.output, source, folder_allowed=True)
    width, height = arguments.size or (None, None)
    scene = scene.resized(width, height, arguments.frames, arguments.seed)
    if arguments.truth is not None:
        _check_truth(scene, arguments.truth)
    writer = None
    try:
        with ProgressDisplay(quiet=arguments.quiet) as display:
            writer = _write(scene, arguments, display)
            keys = _write_truth(scene, arguments, display) if arguments.truth is not None else []
    except KeyboardInterrupt:
        lost = arguments.output if writer is None else arguments.truth
        say(COMMAND, f"interrupted; {'the output ends early' if lost == STDIO else f'{lost} was not written'}")
        return EXIT_INTERRUPTED
    _report(scene, arguments, writer, keys)
    return 0


def _check_truth(scene: "Scene", name: str) -> None:
    """Refuse a file for what is known that cannot be one, or would be too large."""
    from gsvc_lab.scenes.ground_truth import check_truth_size

    if name == STDIO or Path(name).suffix.lower() != ".npz":
        raise UsageError(f"--truth {name}: what is known goes to a file whose name ends in .npz")
    check_output(name, STDIO)
    check_truth_size(scene)


def _write(scene: "Scene", arguments: Namespace, display: ProgressDisplay) -> "VideoWriter":
    """Write the clip; the closed writer."""
    from gsvc_ref.cli.decode import with_chroma
    from gsvc_ref.video import open_writer

    with (
        scene.open_video() as reader,
        open_writer(arguments.output, with_chroma(reader.format, arguments.chroma)) as writer,
    ):
        for count, frame in enumerate(reader, 1):
            writer.write(frame)
            display.update(f"frame {count}/{scene.frames}", count, scene.frames)
    return writer


def _write_truth(scene: "Scene", arguments: Namespace, display: ProgressDisplay) -> list[str]:
    """Write what is known; the keys of the file."""
    from gsvc_lab.scenes.ground_truth import write_truth

    return write_truth(
        scene, arguments.truth,
        lambda number: display.update(f"what is known of frame {number + 1}/{scene.frames}", number, scene.frames),
    )  # fmt: skip


def _report(scene: "Scene", arguments: Namespace, writer: "VideoWriter", keys: list[str]) -> None:
    """Say what was written."""
    if arguments.json:
        files = {"output": arguments.output, "format": writer.format, "truth": arguments.truth, "truth_keys": keys}
        print_json({**scene_object(scene), **files})
        return
    if arguments.quiet:
        return
    out = sys.stderr if arguments.output == STDIO else sys.stdout
    show(f"{display_name(arguments.output, 'standard output')}: {describe_format(writer.format)}", file=out)
    show(f"  {scene.title}", file=out)
    for note in writer.notes:
        show(f"  note: {note}", file=out)
    if arguments.truth is not None:
        show(f"{arguments.truth}: {', '.join(keys)}", file=out)
