"""``gsvc export``: a `.gsvc` file in, its splats out."""

from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from gsvc_base.cli.arguments import add_max_level, frame_range
from gsvc_base.cli.errors import EXIT_DATA, EXIT_INTERRUPTED, say
from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import plural, print_json, show
from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.cli.files import check_input, check_output, open_stream
from gsvc_tools.cli.splats_in import add_units

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from gsvc_base.arrays import F4, I8
    from gsvc_ref.stream import DecodedFrame, Stream

GSVC_EXPORT: Final = "gsvc export"


def add_command(commands: Any) -> None:
    """Add the command to the subparsers of ``gsvc``."""
    parser = commands.add_parser(
        "export",
        help="write the splats of a .gsvc file as NPZ or PLY",
        description="Write the splats of a .gsvc file: all frames as one NPZ file, or each as a PLY file as 3DGS has "
        "it. Standard error lists what is lost.",
        allow_abbrev=False,
    )
    parser.set_defaults(run=run)
    parser.add_argument("input", metavar="IN.gsvc", help="a .gsvc file, or - for standard input")
    parser.add_argument(
        "output",
        metavar="OUT",
        help="OUT.npz for all frames, OUT.ply for a single one, or a folder for a PLY file each",
    )
    parser.add_argument("--frames", type=frame_range, default=(0, None), metavar="A:B", help="frames A to B-1 only")
    add_max_level(parser)
    add_units(parser)
    parser.add_argument("--json", action="store_true", help="print the report as JSON, and only that")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors, and what gets lost")


def run(arguments: Namespace) -> int:
    """Export; 0, 1 if the stream is damaged after the first frame, or 130 when it was interrupted."""
    check_input(arguments.input)
    check_output(arguments.output, arguments.input, folder_allowed=True)
    suffix = Path(arguments.output).suffix.lower()
    if suffix not in (".npz", ".ply", "") and not Path(arguments.output).is_dir():
        raise UsageError(f"cannot tell what to write as {arguments.output}; give OUT.npz, OUT.ply or a folder")
    from gsvc_ref.cli.compilation import compilation_notice

    try:
        with (
            compilation_notice(GSVC_EXPORT, silent=arguments.quiet or arguments.json),
            open_stream(arguments.input, max_level=arguments.max_level) as stream,
        ):
            return _export(arguments, stream)
    except KeyboardInterrupt:
        say(GSVC_EXPORT, "interrupted")
        return EXIT_INTERRUPTED


def _export(arguments: Namespace, stream: "Stream") -> int:
    frames = ExportedFrames(stream.frames(*arguments.frames))
    output = Path(arguments.output)
    with ProgressDisplay(quiet=arguments.quiet) as display:
        shown = _shown(frames, display, stream.frame_count)
        if output.suffix.lower() == ".npz" and not output.is_dir():
            from gsvc_tools.splat_files import write_npz

            counts = write_npz(output, shown, stream.header.width, stream.header.height, stream.header.frame_rate)
            lost = []
        else:
            counts = _write_plys(output, shown, arguments)
            lost = [
                "the size of the frames, their rate, and which splat continues which: PLY has no place for them",
                "the sum: viewers of PLY files blend splats from front to back, and do not add them up as GSVC does",
            ]
    if frames.removed:
        lost.append(f"{plural(frames.removed, 'splat')} that cover nothing were left out")
    if arguments.json:
        print_json({"input": arguments.input, "output": arguments.output, "splats": counts, "lost": lost})
    else:
        for sentence in lost:
            say(GSVC_EXPORT, f"lost: {sentence}")
        if not arguments.quiet:
            show(f"{output}: {plural(len(counts), 'frame')}, {plural(sum(counts), 'splat')}")
    if frames.damage is not None:
        say(GSVC_EXPORT, f"{frames.damage}; the frames before it were written")
        return EXIT_DATA
    return 0


def _shown(frames: "ExportedFrames", display: ProgressDisplay, count: int | None) -> Iterator[tuple["F4", "I8"]]:
    for done, frame in enumerate(frames):
        display.update(f"frame {done + 1}", done, count)
        yield frame


def _write_plys(output: Path, frames: Iterator[tuple["F4", "I8"]], arguments: Namespace) -> list[int]:
    """Write a PLY file for each frame; the number of splats of each."""
    from gsvc_tools.splat_files import to_gaussians, write_ply

    single = output.suffix.lower() == ".ply" and not output.is_dir()
    if single:
        first = next(frames)
        if next(frames, None) is not None:
            raise UsageError("there is more than one frame, and a PLY file holds one; choose it with --frames A:B")
        frames = iter([first])
    elif any(output.glob("*.ply")):
        raise UsageError(f"{output} holds PLY files already; give another folder")
    else:
        output.mkdir(exist_ok=True)
    counts: list[int] = []
    for parameters, _ in frames:
        columns = to_gaussians(parameters, pixels_per_unit=arguments.pixels_per_unit, origin=arguments.origin)
        write_ply(output if single else output / f"frame_{arguments.frames[0] + len(counts):06}.ply", columns)
        counts.append(len(parameters))
    return counts


class ExportedFrames:
    """The visible splats of frames with their ids; a fault after the first frame is kept instead of raised."""

    def __init__(self, frames: Iterator["DecodedFrame"]) -> None:
        self._frames = frames
        self.removed = 0  # splats left out so far because they cover nothing
        self.damage: GsvcError | None = None  # the fault, once all frames before it have been taken

    def __iter__(self) -> Iterator[tuple["F4", "I8"]]:
        import numpy as np

        from gsvc_base.constants import SMALLEST_NORMAL

        ids, next_id = np.empty(0, np.int64), 0
        frame: DecodedFrame | None = None
        while True:
            before = frame
            try:
                frame = next(self._frames, None)
            except GsvcError as error:
                if before is None:
                    raise
                self.damage = error
                return
            if frame is None:
                if before is None:
                    raise UsageError("there is no such frame in the stream; gsvc info says how many it has")
                return
            if before is None or not frame.repeats(before):
                origins = None if before is None else frame.origins(before)
                ids, next_id = continued(ids, next_id, len(frame.splats), origins)
            parameters = frame.splats.to_array()
            visible = (parameters[:, [2, 4]] >= SMALLEST_NORMAL).all(axis=1)
            self.removed += int((~visible).sum())
            yield parameters[visible], ids[visible]


def continued(
    ids: "NDArray[np.int64]", next_id: int, count: int, origins: "NDArray[np.int64] | None"
) -> tuple["NDArray[np.int64]", int]:
    """The ids of a frame's splats: those of the splats that they continue, and new ones; then the next id."""
    import numpy as np

    if origins is None:
        origins = np.full(count, -1)
    is_new = origins < 0
    new = int(is_new.sum())
    result = np.empty(count, np.int64)
    result[~is_new] = ids[origins[~is_new]]
    result[is_new] = np.arange(next_id, next_id + new)
    return result, next_id + new
