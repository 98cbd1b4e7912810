"""``gsvc demo``: encode the built-in clip, decode it in a second process, compare, and write a report."""

import subprocess
import sys
import time
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from gsvc_base.cli.arguments import size, whole
from gsvc_base.cli.errors import EXIT_DATA, EXIT_INTERRUPTED, say
from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import decibel, duration, show
from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.folders import prepare_folder
from gsvc_ref.cli.encode_text import summary
from gsvc_ref.cli.files import describe_format
from gsvc_tools.cli.encode_progress import progress_callback
from gsvc_tools.cli.info import bit_lines

if TYPE_CHECKING:
    from gsvc_lab.pages.data import ReportData
    from gsvc_ref.cli.compilation import CompilationNotice
    from gsvc_ref.encoder import EncodeReport
    from gsvc_ref.stream import StreamSummary

COMMAND: Final = "gsvc demo"
DECODE: Final = "decode in a second process"
RECORD: Final = "demo.json"
"""The file that lists the pictures of the last demo."""

INTRODUCTION: Final = (
    "The built-in clip: a hand-held camera over two photographs, with a ball in front and one cut. It was encoded with "
    "the preset quick, and a second process made the same pictures of the file alone."
)


def add_command(commands: Any) -> None:
    """Add the command to the subparsers of ``gsvc``."""
    parser = commands.add_parser(
        "demo",
        help="encode, decode and compare a built-in clip; start here",
        description="Encode a built-in clip, decode it in a second process, compare, and write a report to look at.",
        allow_abbrev=False,
    )
    parser.set_defaults(run=run)
    parser.add_argument("--output", default="demo", metavar="FOLDER", help="where to write (default: demo)")
    parser.add_argument("--splats", type=whole, metavar="N", help="splats of a frame (default: one for 40 pixels)")
    parser.add_argument("--size", type=size, default=(192, 112), metavar="WxH", help="of the clip (default: 192x112)")
    parser.add_argument("--length", type=whole, default=40, metavar="K", help="frames of the clip (default: 40)")
    parser.add_argument("--threads", type=whole, metavar="T", help="threads to compute with")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")


def run(arguments: Namespace) -> int:
    """Run the demo; 0, or 1 when something does not come out as it must."""
    folder = Path(arguments.output)
    if not folder.parent.is_dir():
        raise UsageError(f"the folder {folder.parent} does not exist; create it first (mkdir -p {folder.parent})")
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder} is a file; give another folder with --output")
    from gsvc_ref.cli.compilation import compilation_notice

    try:
        with compilation_notice(COMMAND, silent=arguments.quiet) as notice:
            return Demo(folder, arguments, notice).run()
    except KeyboardInterrupt:
        say(COMMAND, f"interrupted; {folder} holds what was complete")
        return EXIT_INTERRUPTED


class Demo:
    """One run of the demo: files in a folder, and the seconds of each step."""

    def __init__(self, folder: Path, arguments: Namespace, notice: "CompilationNotice") -> None:
        self.folder, self.arguments, self.notice = folder, arguments, notice
        self.original = folder / "original.y4m"
        self.clip = folder / "clip.gsvc"
        self.decoded = folder / "decoded"
        self.report = folder / "report.html"
        self.seconds: dict[str, float] = {}

    def run(self) -> int:
        """Do all steps; an exit code."""
        from gsvc_lab.pages.report import write_report

        begin = time.perf_counter()
        frames = (f"{self.decoded.name}/frame_{number:06}.png" for number in range(self.arguments.length))
        prepare_folder(self.folder, RECORD, frames)
        self._draw()
        encoded = self._encode()
        if encoded.interrupted:
            raise KeyboardInterrupt
        self._decode_in_second_process()
        stream = self._inspect()
        data = self._compare(encoded)
        write_report(data, self.report)
        if faults := check(encoded, data, stream, self.clip.stat().st_size) + self._strange_pictures():
            for fault in faults:
                say(COMMAND, fault)
            return EXIT_DATA
        self._conclude(data, stream, time.perf_counter() - begin)
        return 0

    def _options(self) -> list[str]:
        """Options that go to other commands as they came."""
        given = (("--splats", self.arguments.splats), ("--threads", self.arguments.threads))
        return ["--checksums", *(text for name, value in given if value is not None for text in (name, str(value)))]

    def _draw(self) -> None:
        """Write the clip as a y4m file, so that the demo begins with a file like any other encode."""
        from gsvc_lab.scenes import DEMO_FRAME_RATE, demo_clip
        from gsvc_ref.video import ColorDescription, VideoFormat, open_writer

        (width, height), length = self.arguments.size, self.arguments.length
        color = ColorDescription(primaries=1, transfer=1, matrix=1, full_range=False, chroma_location=0)
        video = VideoFormat(width, height, DEMO_FRAME_RATE, 8, "420", color, frame_count=length)
        with self._timed("draw the clip"), open_writer(self.original, video) as writer:
            for frame in demo_clip(width, height, length):
                writer.write(frame)
        self._print(f"{self.original}: {describe_format(video)}")

    def _encode(self) -> "EncodeReport":
        from gsvc_ref import Settings, encode

        settings = Settings.quick(splats=self.arguments.splats, threads=self.arguments.threads, checksums=True)
        with self._timed("encode"), ProgressDisplay(quiet=self.arguments.quiet) as display:
            report = encode(self.original, self.clip, settings, progress=progress_callback(display))
        self._print(*summary(str(self.clip), report, compiled=self.notice.said))
        return report

    def _decode_in_second_process(self) -> None:
        """Run ``gsvc decode`` as a program of its own, which knows nothing but the file."""
        command = [sys.executable, "-m", "gsvc_ref", "decode", str(self.clip), str(self.decoded), "--quiet"]
        if self.arguments.threads is not None:
            command += ["--threads", str(self.arguments.threads)]
        with self._timed(DECODE), ProgressDisplay(quiet=self.arguments.quiet) as display:
            display.status("decoding in a second process …")
            result = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
        if result.returncode:
            raise GsvcError("malformed", f"the second process could not decode {self.clip}: {result.stderr.strip()}")
        self._print(f"{self.decoded}: decoded in a second process in {duration(self.seconds[DECODE])}")

    def _compare(self, encoded: "EncodeReport") -> "ReportData":
        """The page's contents, as gsvc report makes them of any file."""
        from gsvc_lab.report.contents import Wanted, report_data

        command = " ".join(["gsvc encode", str(self.original), str(self.clip), *self._options()])
        wanted = Wanted(
            self.clip, str(self.original), encoded=encoded, command=command, title="GSVC demo",
            introduction=INTRODUCTION, seconds=self.seconds, threads=self.arguments.threads,
        )  # fmt: skip
        with ProgressDisplay(quiet=self.arguments.quiet) as display:
            return report_data(wanted, on_step=display.update)

    def _strange_pictures(self) -> list[str]:
        """A sentence if the second process decoded other pictures than this one does."""
        import gsvc_ref
        from gsvc_ref.video import open_video

        with open_video(self.decoded) as reader:
            pairs = zip_longest(reader, gsvc_ref.decode(self.clip, threads=self.arguments.threads))
            for number, (theirs, ours) in enumerate(pairs):
                if theirs is None or ours is None or (theirs != ours).any():
                    return [f"the second process decoded other pictures than this one, first in frame {number}"]
        return []

    def _inspect(self) -> "StreamSummary":
        import gsvc_ref

        with gsvc_ref.open(self.clip) as stream:
            return stream.info()

    def _conclude(self, data: "ReportData", stream: "StreamSummary", seconds: float) -> None:
        scores = [f"PSNR {decibel(data.mean_psnr)}", f"MS-SSIM {data.ms_ssim:.4f}"]
        scores += [f"VMAF {data.vmaf:.1f}"] if data.vmaf is not None else []
        self._print(
            f"  {', '.join(scores)}; the checksum of each frame's splats held, and so did its PSNR",
            *(f"  {line}" for line in bit_lines(stream)),
            f"  which is 8 x {stream.file_bytes:,}, the size of the file",
            f"Done in {duration(seconds)}. Open {self.report} in a browser, or try:",
            f"  gsvc info {self.clip} --frames-table",
            f"  gsvc info {self.clip} --decisions",
            f"  gsvc report {self.clip} {self.original}",
            f"  gsvc compare {self.original} {self.clip}",
            f"  gsvc decode {self.clip} {self.folder / 'large.y4m'} --scale 3",
        )

    def _print(self, *lines: str) -> None:
        if not self.arguments.quiet:
            show(*lines)

    @contextmanager
    def _timed(self, step: str) -> Iterator[None]:
        begin = time.perf_counter()
        yield
        self.seconds[step] = time.perf_counter() - begin


def check(encoded: "EncodeReport", data: "ReportData", stream: "StreamSummary", file_bytes: int) -> list[str]:
    """One sentence for each thing that does not come out as it must: frames, bits, and the decoder's pictures.

    `encoded`: the report of the encoder. `data`: the contents of the page, with the PSNR of the decoded frames.
    `stream`: the bits of the file by their use. `file_bytes`: size of the file as the file system tells it.
    """
    faults = []
    if stream.error is not None:
        faults.append(f"the file is damaged: {stream.error}")
    if not len(encoded.frames) == len(data.frames) == len(stream.frames):
        counts = f"{len(encoded.frames)}, {len(stream.frames)} and {len(data.frames)}"
        faults.append(f"{counts} frames were encoded, found in the file and decoded; the counts must be equal")
    if (total := sum(stream.bits.values())) != 8 * file_bytes or encoded.file_bytes != file_bytes:
        faults.append(f"the parts have {total} bits, the file of {file_bytes} bytes has {8 * file_bytes}")
    pairs = zip(encoded.frames, data.frames, strict=False)
    if different := [frame.number for frame, decoded in pairs if frame.psnr != decoded.psnr]:
        faults.append(f"the decoder made other pictures than the encoder had, first in frame {different[0]}")
    return faults
