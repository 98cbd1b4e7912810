"""`gsvc_ref.encode`: a video through the loop into a recording; what is more than that goes to gsvc_tools."""

from concurrent.futures import Executor
from pathlib import Path

from gsvc_base.errors import UsageError
from gsvc_ref import plugins
from gsvc_ref.encoder.loop import encode_frames
from gsvc_ref.encoder.recording import Recording, record
from gsvc_ref.encoder.report import EncodeReport, OnProgress
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.encoder.setup import EncodeSetup
from gsvc_ref.encoder.source_and_target import Source, Target, opened_source, same_file
from gsvc_ref.video.format import FrameRate


def encode(
    source: Source,
    target: Target,
    settings: Settings | None = None,
    *,
    frame_rate: FrameRate | None = None,
    live: bool = False,
    jobs: int = 1,
    executor: Executor | None = None,
    resume: str | Path | None = None,
    progress: OnProgress | None = None,
) -> EncodeReport:
    """Encode a video.

    Whatever ends it early after at least one complete frame, the frames so far become a valid stream in the target's
    place. Only a target that cannot be written leaves what stood there before.

    Parameters
    ----------
    source
        A path to anything `gsvc_ref.video.open_video` reads, ``-`` for y4m from standard input, ``scene:NAME`` or a
        Scene of `gsvc_lab.scenes`, an open VideoReader, such as ``open_video("a.webp", background="white")`` for a
        transparent source, an array (T, H, W, 3) of R'G'B', u1 for 8 bits or u2 for 16, or an iterable of such frames
        (H, W, 3). For other depths, or to say what the colours are, a pair of frames and their VideoFormat.
    target
        A path, ``-`` for standard output, or a binary file. A path gets the stream under a temporary name in the same
        folder, ``.NAME.NUMBER.part``, and its own name when it is complete and on the disk: at every moment it
        is the old file or the new one, also if the process is killed.
    settings
        Settings.quick() if not given.
    frame_rate
        Of arrays: frames per second, 25 if not given; a whole number, a Fraction, or a decimal number.
    live
        Write under the final name from the first frame on, frame by frame, and never go back: at every moment the file
        can be decoded up to its last complete frame. Its header does not tell the number of frames.
    jobs
        The number of groups of pictures that are encoded at the same time, 1 to 1024; above 1 each in a process
        of its own, with one thread unless `settings.threads` says more. The bytes do not depend on it. Each process
        takes half a second to start, and imports the main module: a script encodes under
        ``if __name__ == "__main__"``. Frames are read ahead, at most 256 MiB of them for each job, and at most two
        groups for each and one more.
    executor
        Encodes the groups in place of these processes, `jobs` at the same time: any Executor whose workers can import
        gsvc_ref, such as that of a cluster (`gsvc_tools.jobs.cluster`). It stays open.
    resume
        A folder in which each group of pictures is kept as soon as it is done, and from which those are taken that an
        earlier encode has kept there. The bytes are those of an encode that nothing has ended. The folder is removed
        when the stream is complete. It is made if need be; for instance ``OUT.gsvc.resume``.
    progress
        Called now and then with the place where the encode is.

    Returns
    -------
    The report; its `interrupted` is True if Ctrl-C stopped the encode after at least one complete frame.

    Raises
    ------
    GsvcError
        The source cannot be read, or has no frames.
    UsageError
        The settings do not fit the source, or a frame its format; with `live`, another encode writes to the target.
        Or `jobs` is out of its range. Or `resume` has groups of another source, other settings, or other code, or is
        not a folder that an encode made and only this user can write to.
    IncompleteEncodeError
        One of these two came after at least one complete frame; its `report` is about the frames that were saved.
    OSError
        The target cannot be written; what stood under its name still does, unless `live`.
    ChildProcessError
        A process that encodes was killed, and so was the next one that got its frames; it has a note if frames were
        saved.
    ConnectionError
        The scheduler of a cluster went away, or its workers died of the same frames; with a note as well.
    Exception
        Exceptions of the caller's frames or of `progress` pass through, with a note if frames were saved.
    """
    chosen = Settings.quick() if settings is None else settings
    if not isinstance(chosen, Settings):
        raise UsageError(f"settings is a {type(settings).__name__}; give Settings.quick(...), slow or paper")
    if same_file(source, target):
        raise UsageError(f"{target} is the source itself; give the stream another name")
    if type(jobs) is not int or jobs != 1 or executor is not None or resume is not None or chosen.goal is not None:
        report: EncodeReport = plugins.encoder()(
            source, target, chosen, frame_rate=frame_rate, live=live, jobs=jobs, executor=executor, resume=resume,
            progress=progress,
        )  # fmt: skip
        return report
    with opened_source(source, frame_rate) as reader:
        setup = EncodeSetup(reader, chosen, progress, live=live)

        def encode_all(recording: Recording) -> None:
            for encoded in encode_frames(setup.frames(), setup.coder, setup.progress.watch):
                recording.put(encoded)
            setup.check_end(recording)

        return record(target, setup.plan, encode_all)
