"""The contents of the report of ``gsvc demo``, put together from the encode, the comparison and the file."""

from collections.abc import Mapping
from itertools import islice
from pathlib import Path
from typing import Final, Literal

import gsvc_ref
from gsvc_lab import machine
from gsvc_lab.pages.data import Choice, FrameRecord, PictureRow, ReportData
from gsvc_ref.arrays import Frame
from gsvc_ref.cli.decisions import effects_line
from gsvc_ref.encoder import EncodeReport
from gsvc_ref.encoder.log import OFF, Decision
from gsvc_ref.metrics import Comparison
from gsvc_ref.stream import StreamSummary
from gsvc_ref.video import open_video

MAX_PREVIEW_FRAMES: Final = 120
"""The animation ends there, so that the page stays light."""

INTRODUCTION: Final = (
    "The built-in clip: a hand-held camera over two photographs, with a ball in front and one cut. It was encoded with "
    "the preset quick; what is shown as decoded is what a second process made of the file alone."
)


def report_data(
    original: Path, clip: Path, decoded: Path, command: str, seconds: Mapping[str, float],
    encoded: EncodeReport, comparison: Comparison, stream: StreamSummary,
) -> ReportData:  # fmt: skip
    """Everything for `gsvc_lab.pages.write_report`.

    Parameters
    ----------
    original, clip, decoded
        The source video, the `.gsvc` file and the decoded video.
    command
        The command line that makes the file.
    seconds
        Wall time of the steps of the demo, `encode` among them.
    encoded, comparison, stream
        The results of the encoder, the comparison and the file.
    """
    header = stream.header
    return ReportData(
        title="GSVC demo",
        command=command,
        introduction=INTRODUCTION,
        width=header.width,
        height=header.height,
        frame_rate=header.frame_rate,
        bit_depth=header.bit_depth,
        preset=encoded.settings.preset,
        file_bytes=stream.file_bytes,
        bits_by_attribute={part: bits for part, bits in stream.bits.items() if bits},
        stages=_stages(seconds, encoded),
        frames=_records(encoded, comparison),
        ms_ssim=comparison.mean_ms_ssim,
        vmaf=comparison.vmaf.mean if comparison.vmaf is not None else None,
        pictures=_pictures(original, clip, decoded, encoded, comparison),
        preview_original=_read(original, MAX_PREVIEW_FRAMES),
        preview_decoded=_read(decoded, MAX_PREVIEW_FRAMES),
        savings=f"In all: {effects_line([f.decisions for f in encoded.frames], [f.type for f in encoded.frames])}.",
        notes=[*encoded.notes, *comparison.notes],
        environment=machine.named(),
    )


def _stages(seconds: Mapping[str, float], encoded: EncodeReport) -> dict[str, float]:
    """The steps of the demo with the encode split into its own stages; together the whole run."""
    stages: dict[str, float] = {}
    for step, spent in seconds.items():
        if step != "encode":
            stages[step] = spent
            continue
        own = {f"encode: {stage}": part for stage, part in encoded.seconds_by_stage.items()}
        stages |= own
        stages["encode: the rest"] = max(0.0, spent - sum(own.values()))
    return stages


def _records(encoded: EncodeReport, comparison: Comparison) -> list[FrameRecord]:
    return [
        FrameRecord(
            frame.number,
            frame.type,
            decoded.psnr,
            frame.bits,
            frame.splats,
            frame.iterations,
            frame.seconds,
            frame.reason,
            [_choice(one) for one in frame.decisions],
        )
        for frame, decoded in zip(encoded.frames, comparison.frames, strict=False)
    ]


def _choice(one: Decision) -> Choice:
    state: Literal["done", "skipped", "off"] = "done" if one.done else "off" if one.reason == OFF else "skipped"
    return Choice(one.effect, state, one.reason)


def _pictures(
    original: Path, clip: Path, decoded: Path, encoded: EncodeReport, comparison: Comparison
) -> list[PictureRow]:
    """The first, the worst and the last frame, and the key frames."""
    last = min(len(encoded.frames), len(comparison.frames)) - 1
    captions = {0: "the first frame"}
    for frame in encoded.frames[1 : last + 1]:
        if frame.type == "I" and len(captions) < 4:
            captions[frame.number] = f"a key frame: {frame.reason}"
    worst = min(comparison.frames[: last + 1], key=lambda frame: frame.psnr)
    captions.setdefault(worst.number, "the frame with the lowest PSNR")
    captions.setdefault(last, "the last frame")
    before, after = _read(original, last + 1), _read(decoded, last + 1)
    rows = []
    with gsvc_ref.open(clip) as stream:
        for shown in stream:
            if shown.number in captions:
                n, splats = shown.number, shown.splats
                rows.append(PictureRow(n, before[n], after[n], splats.positions, splats.cholesky, captions[n]))
    return rows


def _read(video: Path, count: int) -> list[Frame]:
    with open_video(video) as reader:
        return list(islice(reader, count))
