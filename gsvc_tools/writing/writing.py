"""Writing splats that somebody else has found: frames of splats in, a `.gsvc` stream out."""

from collections.abc import Iterable, Iterator, Mapping, Sized
from contextlib import contextmanager, nullcontext
from shutil import copyfileobj
from tempfile import TemporaryFile
from typing import Any, BinaryIO, Final, cast, get_args

from gsvc_base.errors import UsageError
from gsvc_ref.bitstream import LEVELS, level_for
from gsvc_ref.encoder.frame_types import TypedFrame
from gsvc_ref.encoder.loop import encode_frames
from gsvc_ref.encoder.recording import Recording, StreamPlan, record
from gsvc_ref.encoder.report import EncodeReport, OnProgress, ProgressReporter
from gsvc_ref.encoder.settings import MainSettings, PaperSettings
from gsvc_ref.encoder.settings.common import KeyFrames, ProfileName
from gsvc_ref.encoder.settings.paper import FrameSettings
from gsvc_ref.encoder.source_and_target import SoundFrames, Target
from gsvc_ref.paper import RvqSettings
from gsvc_ref.rendering import Precision
from gsvc_ref.stream.writer import can_go_back
from gsvc_ref.training import BlockSettings, FitSettings
from gsvc_ref.video.format import FrameRate, array_format
from gsvc_tools.writing.given_splats import Degenerate, FrameOfSplats, GivenFrames, GivenSplats, Limits
from gsvc_tools.writing.main_coder import MainSplatCoder
from gsvc_tools.writing.main_codes import Refit
from gsvc_tools.writing.splat_coder import SplatCoder

PSNR: Final = 48.0
"""PSNR in dB against the picture of the splats given that frames of profile `main` hold where nothing else is asked
for: splats that come to 35 dB of a photograph then come to 34.8, and those at 38 dB to 37.6."""

CHOLESKY_BITS: Final = 12
"""b of a stream of profile `paper`, the most that there is: nothing makes up for an error by fitting."""

COLORS: Final = (32,) * 6
"""Codewords of the stages where one number of them is given alone, and the other is not."""

POSITION_STEP: Final = 1 / 64
"""Step of positions in pixels: bits beyond it cost as much as any other and nobody sees them."""

DIFFERENCE_STEP: Final = 0.1
"""Steps of differences in pixels at 35 dB; up to 4 times finer after a better I-frame (`with_steps_for`)."""


def write(
    target: Target,
    frames_of_splats: Iterable[FrameOfSplats],
    width: int,
    height: int | None = None,
    frame_rate: FrameRate = 25,
    *,
    profile: ProfileName | None = None,
    quality: int | None = None,
    psnr: float | None = None,
    refit: Refit | None = None,
    bit_depth: int = 8,
    level: int | None = None,
    key_frames: KeyFrames = "auto",
    degenerate: Degenerate = "refuse",
    cholesky_bits: int | None = None,
    color_stages: int | None = None,
    color_codewords: int | None = None,
    lane_count: int | str | None = None,
    index: bool = True,
    checksums: bool = False,
    seed: int = 0,
    threads: int | None = None,
    precision: Precision = "fast",
    progress: OnProgress | None = None,
) -> EncodeReport:
    """Write splats of any trainer as a stream: no picture is needed, and each splat stays near the one that was given.

    Frames are taken one by one, so that an iterator may have any number of them. Whatever ends it early after at least
    one complete frame, the frames so far become a valid stream in the target's place, as with `encode`.

    Parameters
    ----------
    target
        A path, ``-`` for standard output, or a binary file, as for `encode`.
    frames_of_splats
        For each frame its splats: `Splats`, or an array (N, 8) with columns x, y, l11, l21, l22, R, G, B as in spec.md
        sections 8 and 9.1: pixels with the centre of the first one at (0.5, 0.5), and colours with 1 as full scale. N
        may vary. Or a pair (splats, ids), ids being (N,) integers: splats of the same id in successive frames are one
        splat. Without ids, rows are taken as the same splats wherever a frame has as many as the one before.
    width, height
        Size of the frames in pixels.
    frame_rate
        Frames per second: a whole number, a Fraction, or a decimal number, which is taken as it is written.
    profile
        ``main``: the fewest bits, with each frame as close to the splats given as is asked for. ``paper``: quantisers
        of the paper, which take splats of any size and place. None: ``main``, or ``paper`` where one of its options
        is given.
    quality, psnr
        Of profile `main`, one of them: 0..79, how fine the codes are, as in `Settings`; or the least PSNR in dB of each
        decoded frame against the picture of the splats given. Neither: 48 dB.
    refit
        Of profile `main`: how splats make up for the rounding of others in I-frames. ``all``, as None: in their
        positions, shapes and colours, by about a step of the codes. ``colors``: in their colours alone, so that
        positions and shapes are the nearest to those given. ``none``: each splat is rounded alone.
    bit_depth
        Bits of a sample of the decoded frames, 8 to 16.
    level
        The level of the stream; None: the least that allows all frames. What cannot be corrected, such as a pipe, is
        then written when all frames are there; with a level, frame by frame.
    key_frames
        ``auto``: an I-frame where one is better than a P-frame by rate and quality; every k frames; or the numbers
        listed (0 always is one). Where no splat of the frame before stays, there is one as well.
    degenerate
        What becomes of splats whose l11 or l22 is below 2^-126, which cover nothing (R-9.1-2). ``refuse``: an error.
        ``turn``: a column of L whose l11 or l22 is negative gets the other sign, which leaves the covariance L L^T as
        it is: right for trainers that do not hold l11 and l22 above 0. ``remove``: they are left out.
    cholesky_bits, color_stages, color_codewords
        Of profile `paper`: b, 1..12; M, 1..8; and B, 1..1024: how finely the Cholesky factors and the colours are
        quantised. None: 12 bits, and as many codewords as pay for the splats of the first frame.
    lane_count, index, checksums
        As in `Settings`.
    seed, threads, precision
        As in `Settings`: seed of the codebooks, and of which splats are rounded first; threads and precision of the
        renderer that measures.
    progress
        Called before each frame.

    Returns
    -------
    The report that `encode` returns; `FrameReport.psnr` compares the decoded frame with the frame of the splats given.

    Raises
    ------
    UsageError
        An option is out of its range; or, in the first frame, a splat that cannot be coded: the message names frame,
        splat, value, and what is allowed.
    IncompleteEncodeError
        A later frame cannot be coded; its `report` is about the frames that were saved.
    OSError
        The target cannot be written.
    Exception
        Exceptions of the caller's frames or of `progress` pass through, with a note if frames were saved.
    """
    if level is not None and level not in LEVELS:
        raise UsageError(f"level is {level!r}; it must be None or one of {', '.join(map(str, LEVELS))}")
    if height is None:
        raise UsageError("there is no height; give width and height as two numbers, as write(target, frames, 160, 120)")
    video = array_format(width, height, frame_rate, bit_depth)
    level_for(video.width, video.height)  # which refuses frames that no level allows
    options: dict[str, Any] = {
        "key_frames": key_frames, "index": index, "checksums": checksums, "seed": seed, "threads": threads,
        "precision": precision,
    } | ({} if lane_count is None else {"lane_count": lane_count})  # fmt: skip
    of_main = {"quality": quality, "psnr": psnr, "refit": refit}
    of_paper = {"cholesky_bits": cholesky_bits, "color_stages": color_stages, "color_codewords": color_codewords}
    profile = _profile(profile, of_main, of_paper)
    highest = level or max(LEVELS)
    size = video.width, video.height
    coder: SplatCoder | MainSplatCoder
    if profile == "main":
        limits = Limits.of_main()
        coder = MainSplatCoder(main_settings(quality, psnr, options), *size, video.bit_depth, highest, refit or "all")
    else:
        limits = Limits.of_paper(*size)
        sizes = color_stages is None and color_codewords is None
        settings = paper_settings(of_paper, options)
        coder = SplatCoder(settings, *size, video.bit_depth, highest, sizes_codebooks=sizes)
    given = GivenFrames(frames_of_splats, limits, degenerate)
    reporter = ProgressReporter(progress, len(frames_of_splats) if isinstance(frames_of_splats, Sized) else None)
    plan = StreamPlan(
        coder, video, highest, least_level=level is None, notes=lambda _: _notes(given, coder), threads=threads,
        wrapped=_correctable if level is None else nullcontext, name="gsvc_ref.write",
    )  # fmt: skip

    def encode(recording: Recording) -> None:
        source = SoundFrames(given)
        typed = plan.stages.timed_items("read and detect", _typed(source, key_frames))
        for encoded in encode_frames(typed, coder, reporter.watch):
            recording.put(encoded)
        source.check()
        if not recording.frames:
            raise UsageError("there are no frames; give the splats of at least one")

    return record(target, plan, encode)


@contextmanager
def _correctable(file: BinaryIO) -> Iterator[BinaryIO]:
    """The file itself if it can go back; otherwise a temporary one, whose bytes it gets when the block ends well."""
    if can_go_back(file):
        yield file
        return
    with TemporaryFile() as whole:
        yield cast(BinaryIO, whole)
        whole.seek(0)
        copyfileobj(whole, file)


def _profile(profile: ProfileName | None, of_main: Mapping[str, Any], of_paper: Mapping[str, Any]) -> ProfileName:
    """The profile of a stream with these options of either; raises UsageError where one is of another."""
    if profile not in (None, "main", "paper"):
        raise UsageError(f"profile is {profile!r}; it must be 'main' or 'paper'")
    given = [[name for name, value in options.items() if value is not None] for options in (of_main, of_paper)]
    chosen: ProfileName = profile or ("paper" if given[1] and not given[0] else "main")
    if wrong := given[chosen == "main"]:
        other = "paper" if chosen == "main" else "main"
        raise UsageError(f"{wrong[0]} is an option of profile {other}: leave it out, or give profile={other!r} alone")
    if of_main["refit"] not in (None, *get_args(Refit)):
        raise UsageError(f"refit is {of_main['refit']!r}; it must be one of {', '.join(get_args(Refit))}")
    return chosen


def main_settings(quality: int | None, psnr: float | None, options: Mapping[str, Any]) -> MainSettings:
    """The settings of `write` in profile `main`."""
    if quality is None and psnr is None:
        psnr = PSNR
    return MainSettings(preset="write", quality=quality, psnr=psnr).with_(decisions=False, **options)


def paper_settings(quantisers: Mapping[str, int | None], options: Mapping[str, Any]) -> PaperSettings:
    """The settings of `write` in profile `paper`: quantisers of values and of differences, and no iteration."""
    none = FitSettings(iterations=0, pruning=None, convergence=None)
    values = BlockSettings(
        position_step=POSITION_STEP, cholesky_bits=CHOLESKY_BITS, colors=RvqSettings(COLORS), weigh_by_area=True,
        quantizer_rate=0.0,
    )  # fmt: skip
    differences = values.with_(
        position_step=DIFFERENCE_STEP, cholesky_step=DIFFERENCE_STEP, static_threshold=0.5,
        colors=RvqSettings(COLORS, zero_codeword=True),
    )  # fmt: skip
    settings = PaperSettings(
        preset="write", intra=FrameSettings(none, none, values), inter=FrameSettings(none, none, differences)
    )
    return settings.with_(decisions=False, **quantisers, **options)


def _typed(frames: Iterable[GivenSplats], key: KeyFrames) -> Iterator[TypedFrame[GivenSplats]]:
    """The frames with their types, of which the coder may choose another."""
    for number, frame in enumerate(frames):
        if number == 0:
            yield TypedFrame(number, frame, "I", "first frame")
        elif isinstance(key, int) and number % key == 0:
            yield TypedFrame(number, frame, "I", f"every {key} frames")
        elif isinstance(key, tuple) and number in key:
            yield TypedFrame(number, frame, "I", "listed")
        else:
            yield TypedFrame(number, frame, "P", "predicted")


def _notes(given: GivenFrames, coder: SplatCoder | MainSplatCoder) -> list[str]:
    """Sentences on splats that were changed or left out."""
    notes = []
    if given.turned:
        notes.append(f"the signs of {given.turned} splats were turned so that l11 and l22 are above 0")
    if given.removed:
        notes.append(f"{given.removed} splats that cover nothing were left out")
    if isinstance(coder, MainSplatCoder) and coder.left_out:
        notes.append(
            f"{coder.left_out} splats that cannot be seen, or have less than half a step of colour, were left out"
        )
    return notes
