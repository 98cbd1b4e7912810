"""What `gsvc_ref.encode` hands over: encodes in several jobs, to targets of the whole clip, with resume."""

from concurrent.futures import Executor
from pathlib import Path

from gsvc_base.errors import UsageError
from gsvc_ref.encoder.report import EncodeReport, OnProgress
from gsvc_ref.encoder.settings import Settings
from gsvc_ref.encoder.source_and_target import Source, Target
from gsvc_ref.video.format import FrameRate
from gsvc_tools.jobs.encode_once import encode_once
from gsvc_tools.jobs.processes import check_jobs
from gsvc_tools.targets.targets import encode_to_goal


def encode(
    source: Source,
    target: Target,
    settings: Settings,
    *,
    frame_rate: FrameRate | None,
    live: bool,
    jobs: int,
    executor: Executor | None,
    resume: str | Path | None,
    progress: OnProgress | None,
) -> EncodeReport:
    """Encode a video; parameters, results and errors are those of `gsvc_ref.encode`."""
    check_jobs(jobs)
    if settings.goal is None:
        return encode_once(source, target, settings, frame_rate, jobs, executor, progress, live=live, resume=resume)
    if resume is not None:
        raise UsageError(f"{settings.goal} takes several passes, with which resume cannot go on: drop one of the two")
    return encode_to_goal(source, target, settings, frame_rate, jobs, executor, progress, live=live)
