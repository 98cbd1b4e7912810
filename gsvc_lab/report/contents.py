"""The contents of the page about a `.gsvc` file: of the file, its source, and the encode, as far as they are known."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal

import gsvc_ref
from gsvc_base.cli.text import plural
from gsvc_base.errors import UsageError
from gsvc_lab import machine
from gsvc_lab.pages.data import Choice, FrameRecord, Layer, ReportData
from gsvc_lab.pages.pictures import MAX_PREVIEW_FRAMES
from gsvc_lab.report.material import Material, gather, shrinking
from gsvc_lab.report.peers import Against, OnStep, against_x264
from gsvc_ref.cli.encode_text import effects_line
from gsvc_ref.cli.files import describe_format
from gsvc_ref.encoder import EncodeReport
from gsvc_ref.encoder.log import OFF, Decision
from gsvc_ref.stream import FrameSummary, StreamSummary
from gsvc_ref.video.alpha import Background
from gsvc_tools.cli.compare import Side, open_side
from gsvc_tools.cli.decisions import stream_decisions
from gsvc_tools.cli.info import all_gaps

MAX_KEYS: Final = 2
"""Key frames beside the first that are shown."""


@dataclass(frozen=True)
class Wanted:
    """A page to make."""

    file: Path  # the `.gsvc` file
    source: str | None = None  # anything that `open_video` reads, or None
    start: int = 0  # the frame of the source that frame 0 of the file shows
    encoded: EncodeReport | None = None  # the report of the encode, where that is known
    command: str = ""  # the command line to show
    title: str = ""  # Heading and a paragraph; empty: made from the names
    introduction: str = ""
    # Wall time of steps that are no part of the encode, in order; the encode's own come in place of ``encode``
    seconds: Mapping[str, float] | None = None
    vmaf: bool = True  # vmaf, x264: Whether to measure these
    x264: bool = True
    threads: int | None = None  # threads to compute with; None: all
    background: Background | None = None  # what is behind transparent pictures of the source


def summarise(file: Path) -> StreamSummary:
    """The account of a file; of a damaged one with all that is left."""
    with gsvc_ref.open(file) as stream:
        summary = stream.info()
        if summary.error is None:
            return summary
        salvaged = stream.info(salvage=True)
        return replace(salvaged, error=summary.error)


def damage_of(summary: StreamSummary) -> list[str]:
    """Sentences on the damage of a file; none of a sound one."""
    if summary.error is None:
        return []
    count = len(summary.frames)
    found = all_gaps(summary.gaps)
    return [f"{summary.error}.", f"{plural(count, 'frame')} can be shown; {found.total(count)}.", *found.lines()]


def check_source(summary: StreamSummary, side: Side, start: int) -> None:
    """Refuse a source that is no video of the file's size and depth, or has no frame `start`.

    A UsageError says that it is not.
    """
    header, video = summary.header, side.format
    ours, theirs = (header.width, header.height, header.bit_depth), (video.width, video.height, video.bit_depth)
    if ours != theirs:
        raise UsageError(
            f"{side.name} has {theirs[0]}x{theirs[1]} pixels of {theirs[2]} bits and the file {ours[0]}x{ours[1]} of "
            f"{ours[2]}; give the video that was encoded, or none"
        )
    if video.frame_count is not None and start >= video.frame_count:
        raise UsageError(f"{side.name} has {plural(video.frame_count, 'frame')} and no frame {start}")


def report_data(
    wanted: Wanted, summary: StreamSummary | None = None, on_step: OnStep = lambda text, done, total: None
) -> ReportData:
    """Measure everything for `gsvc_lab.pages.report`.

    A UsageError says that the source does not fit the file, or the file has no frame. A GsvcError says that the source
    cannot be read.
    """
    summary = summarise(wanted.file) if summary is None else summary
    if not summary.frames:
        raise UsageError(f"{wanted.file} has no complete frame to report on")
    notes: list[str] = []
    captions = _captions(summary, wanted.encoded)
    total = len(summary.frames)

    def done(count: int) -> None:
        on_step(f"frame {count}/{total}", count, total)

    damaged = summary.error is not None
    if wanted.source is None:
        found = gather(wanted.file, captions, damaged=damaged, threads=wanted.threads, on_frame=done)
        about = f"{wanted.file.name}: {_format(wanted.file)}."
    else:
        with gsvc_ref.open(wanted.file) as stream:
            like = stream.format
        with open_side(wanted.source, (wanted.start, None), "fast", background=wanted.background, like=like) as side:
            check_source(summary, side, wanted.start)
            found = gather(
                wanted.file, captions, side.frames, damaged=damaged, with_vmaf=wanted.vmaf, threads=wanted.threads,
                on_frame=done,
            )  # fmt: skip
            notes += [f"{side.name}: {note}" for note in side.notes]
            if side.frames.damage is not None:
                notes.append(f"{side.name} is damaged: {side.frames.damage}")
            notes += _lengths(side, wanted.start, len(found.levels), total)
        about = f"{wanted.file.name}: {_format(wanted.file)}. It is set against {side.name}."
    decisions, note = _decisions(summary, wanted.encoded)
    notes += _of_the_encode(wanted, note, found)
    against = Against()
    if wanted.source is not None and wanted.x264:
        bits = {frame.number: sum(_bits(frame).values()) for frame in summary.frames}
        against = against_x264(
            wanted.source, wanted.start, summary.header, bits, found.levels, on_step, wanted.background
        )
        notes += [against.missing] if against.missing else []
    comparison = found.comparison
    if comparison is not None:
        notes += [one for one in comparison.notes if "video ends" not in one]
    header, encoded = summary.header, wanted.encoded
    types = [frame.type for frame in summary.frames]
    return ReportData(
        title=wanted.title or f"{wanted.file.name}, {plural(total, 'frame')}",
        command=wanted.command,
        introduction=wanted.introduction or about,
        width=header.width,
        height=header.height,
        frame_rate=header.frame_rate,
        bit_depth=header.bit_depth,
        preset=encoded.settings.preset if encoded is not None else "",
        file_bytes=summary.file_bytes,
        bits_by_attribute={part: bits for part, bits in summary.bits.items() if bits},
        stages=_stages(wanted.seconds or {}, encoded),
        frames=_records(summary, decisions, found, encoded),
        ms_ssim=comparison.mean_ms_ssim if comparison is not None else None,
        vmaf=comparison.vmaf.mean if comparison is not None and comparison.vmaf is not None else None,
        pictures=found.pictures,
        preview_original=found.preview_original,
        preview_decoded=found.preview_decoded,
        preview_note=_preview_note(header.width, header.height, len(found.numbers)),
        savings=f"In all: {effects_line(decisions, types)}." if decisions else "",
        notes=list(dict.fromkeys(notes)),
        environment=machine.named(),
        layers=_layers(summary, found),
        damage=damage_of(summary),
        peers=against.table,
        peers_note=against.note,
        hint=_hint(wanted),
    )


def _format(file: Path) -> str:
    with gsvc_ref.open(file) as stream:
        return describe_format(stream.format)


def _captions(summary: StreamSummary, encoded: EncodeReport | None) -> dict[int, str]:
    """The first frame, key frames, and the last."""
    first, last = summary.frames[0].number, summary.frames[-1].number
    captions = {first: "the first frame"}
    for place, frame in enumerate(summary.frames):
        if frame.type == "I" and frame.number != first and len(captions) <= MAX_KEYS:
            reason = encoded.frames[place].reason if encoded is not None and place < len(encoded.frames) else ""
            captions[frame.number] = f"a key frame: {reason}" if reason else "a key frame"
    captions.setdefault(last, "the last frame")
    return captions


def _lengths(side: Side, start: int, compared: int, total: int) -> list[str]:
    """A sentence where file and source have other numbers of frames."""
    if compared < total:
        return [
            f"{side.name} has a frame for {compared:,} of the file's {total:,}; PSNR and other scores are about these"
        ]
    known = side.format.frame_count
    if known is not None and known - start > total:
        return [f"{side.name} has {plural(known, 'frame')}; the file has those from {start} to {start + total - 1}"]
    return []


def _decisions(summary: StreamSummary, encoded: EncodeReport | None) -> tuple[Sequence[Sequence[Decision]], str | None]:
    """The decisions about each frame, of the encode or in the file's log, and a note where there are none."""
    if encoded is not None and len(encoded.frames) == len(summary.frames):
        return [frame.decisions for frame in encoded.frames], None
    return stream_decisions(summary)


def _of_the_encode(wanted: Wanted, note: str | None, found: Material) -> list[str]:
    """What the encoder said, and what is not known since nobody told."""
    notes = [*wanted.encoded.notes] if wanted.encoded is not None else []
    notes += [note] if note is not None else []
    if wanted.source is None and wanted.encoded is None:
        notes.append(
            "the file does not tell its PSNR; with the source there are PSNR, MS-SSIM, VMAF and the differences: "
            f"gsvc report {shlex.quote(wanted.file.name)} SOURCE"
        )
    return notes


def _records(
    summary: StreamSummary, decisions: Sequence[Sequence[Decision]], found: Material, encoded: EncodeReport | None
) -> list[FrameRecord]:
    """A record of each frame."""
    own = {frame.number: frame for frame in encoded.frames} if encoded is not None else {}
    records = []
    for place, frame in enumerate(summary.frames):
        made = decisions[place] if decisions else ()
        by_effect = {one.effect: one for one in made}
        told = own.get(frame.number)
        reason = by_effect["dks"].reason if frame.type == "I" and "dks" in by_effect else ""
        records.append(
            FrameRecord(
                number=frame.number,
                type=frame.type,
                psnr=found.levels.get(frame.number, told.psnr if told is not None else None),
                bits_by_attribute=_bits(frame),
                splats=frame.splats + sum(layer.splats for layer in frame.layers),
                iterations=by_effect["frames"].iterations if "frames" in by_effect else None,
                seconds=told.seconds if told is not None else None,
                reason=told.reason if told is not None else reason,
                choices=[_choice(one) for one in made],
            )
        )
    return records


def _bits(frame: FrameSummary) -> dict[str, int]:
    """Bits of a frame with its layers by what they describe."""
    bits = dict(frame.bits)
    for layer in frame.layers:
        for name, count in layer.bits.items():
            bits[name] = bits.get(name, 0) + count
    return {name: count for name, count in bits.items() if count}


def _choice(one: Decision) -> Choice:
    state: Literal["done", "skipped", "off"] = "done" if one.done else "off" if one.reason == OFF else "skipped"
    return Choice(one.effect, state, one.reason)


def _layers(summary: StreamSummary, found: Material) -> list[Layer]:
    """The layers of a file that has several."""
    count = summary.header.layer_count
    if count == 1:
        return []
    layers = []
    for number in range(count):
        bits, splats = 0, []
        for frame in summary.frames:
            chunks = {layer.layer: layer for layer in frame.layers}
            here = chunks.get(number)
            bits += 8 * (frame.size if number == 0 else here.size if here is not None else 0)
            splats.append(frame.splats + sum(one.splats for k, one in chunks.items() if k <= number))
        name = f"layer {number}" if number else "base"
        layers.append(Layer(name, bits, (min(splats), max(splats)), found.layers[number] if found.layers else None))
    return layers


def _stages(seconds: Mapping[str, float], encoded: EncodeReport | None) -> dict[str, float]:
    """The steps with the encode split into its own stages; together the whole run."""
    if encoded is None:
        return dict(seconds)
    steps = dict(seconds) if "encode" in seconds else {"encode": encoded.seconds, **seconds}
    stages: dict[str, float] = {}
    for step, spent in steps.items():
        if step != "encode":
            stages[step] = spent
            continue
        own = {f"encode: {stage}": part for stage, part in encoded.seconds_by_stage.items()}
        stages |= own
        stages["encode: the rest"] = max(0.0, spent - sum(own.values()))
    return stages


def _preview_note(width: int, height: int, count: int) -> str:
    """What the preview leaves out."""
    first = f"the first {MAX_PREVIEW_FRAMES} of {count:,} frames" if count > MAX_PREVIEW_FRAMES else "all frames"
    times = shrinking(width, height)
    if times == 1:
        return f"It shows {first}." if count > MAX_PREVIEW_FRAMES else ""
    return f"It shows {first} at 1/{times} of their width and height."


def _hint(wanted: Wanted) -> list[str]:
    """Commands that show more of the file."""
    file = shlex.quote(str(wanted.file))
    return [f"gsvc view {file}", f"gsvc info {file} --decisions", f"gsvc decode {file} decoded.y4m"]
