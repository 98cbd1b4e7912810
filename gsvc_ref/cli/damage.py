"""Sentences about damaged streams: what is missing, why, and what to do."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

from gsvc_base.cli.text import plural
from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.cli.files import CUT_RULE

if TYPE_CHECKING:
    from gsvc_ref.stream import Gap, Stream

OTHER_STREAM_RULE: Final = "R-6.1-3"
TRAILING_RULE: Final = "R-6.1-4"
MAX_GAPS: Final = 1000
AGAIN: Final = "If it is still being written, try again later; otherwise fetch it again"


def describe_damage(name: str, stream: "Stream", fault: GsvcError, start: int, count: int) -> tuple[str, str]:
    """Two sentences about the fault that ended reading after `count` frames from `start` on: what it is, what to do."""
    total = stream.frame_count
    if count == 0:
        place = f"before the end of frame {start}" if start else "in the first frame"
    elif start == 0 and total and total >= count:  # a header may announce fewer frames than there are
        place = f"after {count:,} of {plural(total, 'frame')}"
    else:
        place = f"after {plural(count, 'complete frame')}"
    if fault.rule == TRAILING_RULE:
        return f"{name} is sound up to its end chunk: {fault}", "What follows the end is not part of the stream"
    advice = "Fetch the file again if you can"
    if _more_frames(stream, start + count):
        return f"{name} is damaged {place}: {fault}", f"{advice}; --salvage finds more frames after the damage"
    if fault.rule == CUT_RULE and not stream.has_end:
        return f"{name} is cut off, or still being written, {place}: {fault}", AGAIN
    return f"{name} is damaged {place}: {fault}", advice


def _more_frames(stream: "Stream", next_number: int) -> bool:
    """Whether salvaging finds a frame with this number or a greater one."""
    from gsvc_ref.stream import Gap

    try:
        return any(not isinstance(part, Gap) for part in stream.salvage(next_number))
    except UsageError:  # a pipe
        return False


def _numbers(runs: list[range]) -> str:
    """Frames in words, by runs of them."""
    parts = [f"{run.start}" if len(run) == 1 else f"{run.start} to {run.stop - 1}" for run in runs]
    return f"frame{'s' if sum(map(len, runs)) > 1 else ''} {', '.join(parts)}"


class Gaps:
    """The gaps of a stream as they are found: an `on_gap` for `gsvc_ref.decode`."""

    def __init__(self) -> None:
        self.found: list[Gap] = []  # the first `MAX_GAPS`: a hostile stream may have one in every few bytes
        self.count = 0  # of all gaps
        self.missing = 0  # frames, as far as is known
        self.more_may_be_missing = False  # the number of frames that the stream had is unknown
        self._lacking: dict[int, list[range]] = {}  # the frames from which each layer is missing

    def __call__(self, gap: "Gap") -> None:
        """Count a gap."""
        self.count += 1
        if len(self.found) < MAX_GAPS:
            self.found.append(gap)
        if gap.missing_count is None:
            self.more_may_be_missing = True
            return
        self.missing += gap.missing_count

    def incomplete(self, number: int, layers: Iterable[int]) -> None:
        """Note a frame from which layers are missing: an `on_incomplete` for `gsvc_ref.decode`."""
        for layer in layers:
            runs = self._lacking.setdefault(layer, [])
            if runs and runs[-1].stop == number:
                runs[-1] = range(runs[-1].start, number + 1)
            else:
                runs.append(range(number, number + 1))

    def lines(self) -> list[str]:
        """A line for each gap, for each other stream that begins inside of one, and for each layer that is missing."""
        lines = []
        for gap in self.found:
            lines.append(str(gap))
            lines += [f"  inside: {fault}" for fault in gap.faults[1:] if fault.rule == OTHER_STREAM_RULE]
        if others := self.count - len(self.found):
            lines.append(f"and {plural(others, 'more gap')}")
        return lines + [
            f"layer {layer} is missing from {_numbers(runs[:MAX_GAPS])}{' and others' if len(runs) > MAX_GAPS else ''}"
            for layer, runs in sorted(self._lacking.items())
        ]

    def total(self, count: int) -> str:
        """The number of missing frames, of these and the `count` frames that were found."""
        verb = "is" if self.missing == 1 else "are"
        if self.more_may_be_missing:
            known = f"{plural(self.missing, 'frame')} {verb} missing, and " if self.missing else ""
            return f"{known}any number may be missing at the end, since the file does not tell how many there were"
        if self.missing == 0:
            return "no frame is missing"
        return f"{self.missing:,} of {plural(count + self.missing, 'frame')} {verb} missing"
