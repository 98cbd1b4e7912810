"""One encode of a video, in this process or in groups of pictures side by side, kept or not."""

from concurrent.futures import Executor
from pathlib import Path

from gsvc_ref.encoder.loop import encode_frames
from gsvc_ref.encoder.recording import Recording, record
from gsvc_ref.encoder.report import EncodeReport, OnProgress
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.encoder.setup import CoderMaker, EncodeSetup, coder_of, missed_quality
from gsvc_ref.encoder.source_and_target import Source, Target, opened_source
from gsvc_ref.video.format import FrameRate
from gsvc_tools.jobs.resume import encode_kept, opened_keeper
from gsvc_tools.jobs.side_by_side import encode_side_by_side


def encode_once(
    source: Source,
    target: Target,
    settings: Settings,
    frame_rate: FrameRate | None = None,
    jobs: int = 1,
    executor: Executor | None = None,
    on_progress: OnProgress | None = None,
    *,
    live: bool = False,
    resume: str | Path | None = None,
    make_coder: CoderMaker = coder_of,
) -> EncodeReport:
    """Encode with settings that have no goal for the whole clip; parameters, results and errors are those of `encode`.

    `make_coder` makes the coder of the first frame.
    """
    is_side_by_side = jobs > 1 or executor is not None
    used = settings.with_(threads=1) if is_side_by_side and settings.threads is None else settings
    with opened_source(source, frame_rate) as reader, opened_keeper(resume, reader.format, settings) as keeper:
        setup = EncodeSetup(reader, used, on_progress, live=live, make_coder=make_coder)
        plan = setup.plan
        plan.threads = settings.threads
        if keeper is not None:
            keeper.header, keeper.is_sound = plan.header, lambda: setup.source.fault is None
            plan.notes = lambda frames: [*reader.notes, *keeper.notes, *missed_quality(frames, settings, reader.format)]

        def encode(recording: Recording) -> None:
            if is_side_by_side:
                encode_side_by_side(setup, recording, jobs, executor, keeper)
            elif keeper is not None:
                for encoded in encode_kept(setup.frames(), setup.coder, keeper, setup.progress):
                    recording.put(encoded)
            else:
                for encoded in encode_frames(setup.frames(), setup.coder, setup.progress.watch):
                    recording.put(encoded)
            setup.check_end(recording)

        report = record(target, plan, encode)
        if keeper is not None and not report.interrupted:
            keeper.remove()
        return report
