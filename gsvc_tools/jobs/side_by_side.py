"""Groups of pictures side by side, in tasks for any `concurrent.futures.Executor`.

The thread of the caller reads frames and hands them over (`SideBySide.put`). A thread of ours gives out segments, and
writes what comes back in order, so that frames are written while the caller waits for a slow source. The two send each
other messages, and neither touches what the other has.
"""

import threading
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import BrokenExecutor, Executor, Future
from enum import Enum
from functools import partial
from queue import SimpleQueue
from types import TracebackType
from typing import Final, NamedTuple, Self

from gsvc_base.arrays import Frame
from gsvc_ref.encoder.encoded_frame import EncodedFrame
from gsvc_ref.encoder.frame_types import TypedFrame
from gsvc_ref.encoder.loop import GroupCoder, described
from gsvc_ref.encoder.recording import Recording
from gsvc_ref.encoder.setup import EncodeSetup
from gsvc_tools.jobs.groups import EncodedSegment, Group, encode_segment
from gsvc_tools.jobs.processes import Processes
from gsvc_tools.jobs.resume import Keeper

GROUPS_AHEAD: Final = 2
"""Groups that may have been read and not yet written, for each job; one more is allowed in all."""

BYTES_AHEAD: Final = 1 << 28
"""Bytes of frames that may have been read and not yet written, for each job: 43 frames of 1920x1080. Long groups of
large frames are therefore read, and begun, only as those before them are done."""

RUN_TRIES: Final = 2
"""The most times that a segment is given out, if processes end before they are done with it."""


class DeadWorkerError(ChildProcessError):
    """The processes that a segment was given to ended before it was done."""


class _Written(NamedTuple):
    """Frames are written: their bytes in the source, and the number of groups that are done."""

    size: int
    groups: int


class _Encoded(NamedTuple):
    """A segment is done, or a frame was `kept`: its frames, the groups in work, the last frame's PSNR."""

    frames: int
    groups: int
    psnr: float
    kept: int = 0


class _Word(Enum):
    """Messages without contents: no frame follows; write what is done; no message follows."""

    END = "end"
    STOP = "stop"
    OVER = "over"


class SideBySide:
    """Encodes groups of pictures side by side; a context manager, left when all frames are put or none follows."""

    def __init__(
        self,
        coder: GroupCoder,  # encodes the first frame
        jobs: int,  # the number of tasks that are given out at the same time
        executor: Executor | None,  # takes the tasks; None: `jobs` processes of this machine
        # Called when the first frame is encoded, with a coder that knows what was decided
        on_first: Callable[[GroupCoder], None],
        # Called with each frame in order, as it was encoded, and the seconds that it took, in a thread of ours
        on_frame: Callable[[TypedFrame[Frame], EncodedFrame, float], None],
        # Called with the number of frames encoded, in any order, the number of groups in work, and the PSNR of the last
        # one, in the thread that puts frames
        on_progress: Callable[[int, int, float], None],
        # Keeps the groups that are done, and has those of an encode before; None: nothing is kept
        keeper: Keeper | None = None,
        *,
        segment_s: float | None = None,  # seconds that a task is meant to take; None: SEGMENT_S
        # Give out segments of the group of which most is left first, so that no long one is begun last; False: those of
        # earlier groups, which can then be written soonest, unless a later one would end last
        longest_first: bool = False,
    ) -> None:
        self._ours: Processes | None = None
        if executor is None:
            executor = self._ours = Processes(jobs, preload="gsvc_tools.jobs.groups")
        self._inbox: SimpleQueue[TypedFrame[Frame] | Group | _Word] = SimpleQueue()
        self._outbox: SimpleQueue[_Written | _Encoded | BaseException | _Word] = SimpleQueue()
        self._on_progress = on_progress
        self._leader = _Leader(
            coder, jobs, executor, on_first, on_frame, self._inbox, self._outbox, keeper, segment_s, longest_first
        )
        self._most_groups, self._most_bytes = GROUPS_AHEAD * jobs + 1, BYTES_AHEAD * jobs
        self._groups = self._bytes = self._encoded = 0
        self.kept = 0  # frames so far that `keeper` had
        # Whether the thread of ours has ended, which an interrupt does not wait for if a write never ends
        self.is_over = False

    def put(self, item: TypedFrame[Frame]) -> None:
        """Hand over the next frame; this waits while too many are read and not yet written.

        Raises what kept a frame before from being encoded or written; those before that one are written.
        """
        begins = item.type == "I"
        while not self._outbox.empty():
            self._hear()
        while self._bytes and (
            self._bytes + item.frame.nbytes > self._most_bytes or (begins and self._groups == self._most_groups)
        ):
            self._hear()
        self._bytes += item.frame.nbytes
        self._groups += begins
        self._inbox.put(item)

    def finish(self) -> None:
        """Wait until all frames are written; raises what `put` does."""
        self._inbox.put(_Word.END)
        while not self.is_over:
            self._hear()

    def _hear(self) -> None:
        """Take a message of the leader; this waits for one."""
        message = self._outbox.get()
        if isinstance(message, BaseException):
            raise message
        if isinstance(message, _Written):
            self._bytes -= message.size
            self._groups -= message.groups
        elif isinstance(message, _Encoded):
            self._encoded += message.frames
            self.kept += message.kept
            self._on_progress(self._encoded, message.groups, message.psnr)
        else:
            self.is_over = True

    def __enter__(self) -> Self:
        threading.Thread(target=self._leader.lead, name="gsvc_ref groups", daemon=True).start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Write what is done, in order, as far as there is no gap; end the processes that we started."""
        self._leader.is_stopped = True
        try:
            self._inbox.put(_Word.STOP)
            while not self.is_over:
                message = self._outbox.get()
                if isinstance(message, BaseException) and message is not error:
                    raise message
                self.is_over = message is _Word.OVER
        finally:
            if self._ours is not None:
                self._ours.shutdown() if kind is None else self._ours.kill()


class _Leader:
    """What the thread does that hands out segments and writes frames."""

    def __init__(
        self,
        coder: GroupCoder,
        jobs: int,
        executor: Executor,
        on_first: Callable[[GroupCoder], None],
        on_frame: Callable[[TypedFrame[Frame], EncodedFrame, float], None],
        inbox: "SimpleQueue[TypedFrame[Frame] | Group | _Word]",
        outbox: "SimpleQueue[_Written | _Encoded | BaseException | _Word]",
        keeper: Keeper | None,
        segment_s: float | None,
        longest_first: bool,
    ) -> None:
        self._jobs, self._executor = jobs, executor
        self._on_first, self._on_frame = on_first, on_frame
        self._inbox, self._outbox = inbox, outbox
        self._keeper, self._segment_s, self._longest_first = keeper, segment_s, longest_first
        self._first = coder
        self._later = None if coder.decides_first else coder.for_group()  # never used itself: each group has its own
        self._groups: deque[Group] = deque()  # in order, those of which something is left to be done
        # Set by the other thread: no more segments are to be given out
        self._is_begun = self._has_first = self._is_whole = self.is_stopped = False

    def lead(self) -> None:
        """Hand out segments and write frames until all is done, or something could not be done, or it is stopped."""
        try:
            while not self.is_stopped and not (self._is_whole and not self._groups):
                self._take(self._inbox.get())
                self._hand_out()
                self._write()
            for group in self._groups:
                if group.task is not None and not group.task.cancel() and group.task.done():
                    self._collect(group)
            self._write()
        except BaseException as error:
            self._outbox.put(error)
        finally:
            self._outbox.put(_Word.OVER)

    def _take(self, message: "TypedFrame[Frame] | Group | _Word") -> None:
        """Take a frame, the end of all frames, or a group whose segment has ended."""
        if isinstance(message, Group):
            self._collect(message)
        elif isinstance(message, TypedFrame):
            if message.type == "I":
                self._end_group(is_last=False)
                self._begin_group(message.number)
            psnr = self._groups[-1].take(message)
            if psnr is not None:
                self._outbox.put(_Encoded(1, self._at_work(), psnr, kept=1))
        elif message is _Word.END:
            self._end_group(is_last=True)
            self._is_whole = True

    def _begin_group(self, first: int) -> None:
        """A group begins with a frame of this number."""
        resumed = None if self._keeper is None else self._keeper.group(first)
        if not self._is_begun and resumed is not None and resumed.decide(self._first):
            self._has_first = True
            self._decide(self._first.for_group())
        later = None if self._later is None else self._later.for_group()
        self._groups.append(Group(later if self._is_begun else self._first, resumed, self._segment_s))
        self._is_begun = True
        if isinstance(self._executor, Processes):
            self._executor.start(min(len(self._groups), self._jobs))

    def _end_group(self, *, is_last: bool) -> None:
        """No frame follows in the group at the end."""
        if self._groups:
            self._groups[-1].end(is_last=is_last)

    def _hand_out(self) -> None:
        """Give out segments, those of longer groups first, or as `in_turn` says."""
        by_length = self._longest_first
        groups = sorted(self._groups, key=lambda one: -one.left) if by_length else in_turn(self._groups, self._jobs)
        for group in groups:
            if self._at_work() == self._jobs or self.is_stopped:
                return
            if group.coder is not None and group.may_go_on:
                group.tries += 1
                try:
                    group.task = self._executor.submit(encode_segment, group.coder, group.take_segment())
                except Exception as error:  # it is broken, or was shut down
                    group.fault = _dead_worker() if isinstance(error, BrokenExecutor) else error
                else:
                    group.task.add_done_callback(partial(self._tell, group))

    def _tell(self, group: Group, task: "Future[EncodedSegment]") -> None:
        """Send ourselves the message that the segment of a group has ended; any thread may call this."""
        self._inbox.put(group)

    def _at_work(self) -> int:
        """The number of groups that have a segment in work."""
        return sum(group.task is not None for group in self._groups)

    def _collect(self, group: Group) -> None:
        """Take what a segment became."""
        task, group.task = group.task, None
        assert task is not None
        try:
            segment = task.result()
        except BrokenExecutor:
            if group.tries == RUN_TRIES:
                group.fault = _dead_worker()
            return
        except Exception as error:
            group.fault = error
            return
        if segment.frames and not self._has_first:
            self._has_first = True
            self._decide(segment.coder.for_group())
        group.keep(segment)
        if segment.frames:
            self._outbox.put(_Encoded(len(segment.frames), self._at_work(), segment.frames[-1][0].psnr))

    def _decide(self, coder: GroupCoder) -> None:
        """Let all groups have what the first frame has decided."""
        self._on_first(coder)
        if self._later is None:
            self._later = coder
            for group in self._groups:
                group.coder = group.coder or coder.for_group()

    def _write(self) -> None:
        """Write the frames that are done, in order."""
        while self._groups:
            group = self._groups[0]
            while group.done:
                done = group.done.popleft()
                self._on_frame(done.item, done.encoded, done.seconds)
                self._outbox.put(_Written(done.size, 0))
            if group.fault is not None and not self.is_stopped:
                raise group.fault
            if not group.is_written:
                return
            self._groups.popleft()
            self._outbox.put(_Written(0, 1))


def encode_side_by_side(
    setup: EncodeSetup, recording: Recording, jobs: int, executor: Executor | None, keeper: Keeper | None
) -> None:
    """Encode and record the frames of a video, groups of pictures in tasks for an executor."""

    def on_first(coder: GroupCoder) -> None:
        setup.plan.coder = coder

    def on_frame(frame: TypedFrame[Frame], encoded: EncodedFrame, seconds: float) -> None:
        recording.write(described(encoded, frame, setup.coder, seconds))

    def on_progress(frames: int, groups: int, psnr: float) -> None:
        setup.progress.kept = side.kept
        setup.progress.show("groups", frames - 1, groups, jobs, psnr)

    segment_s: float | None = getattr(executor, "segment_s", None)  # a cluster says how long tasks are best
    side = SideBySide(
        setup.coder, jobs, executor, on_first, on_frame, on_progress, keeper,
        segment_s=segment_s, longest_first=segment_s is not None,
    )  # fmt: skip
    try:
        with side:
            try:
                for frame in setup.frames():
                    side.put(frame)
                side.finish()
            except BaseException:
                recording.interrupts.held = True  # processes are being ended
                raise
    finally:
        recording.is_broken |= not side.is_over


def in_turn(groups: Iterable[Group], jobs: int) -> list[Group]:
    """Groups, given in the stream's order, in the order in which they go on: that one, so that they are written soon.

    But a group comes first once it would end last, when as much is left of it as each job will have to do: otherwise it
    would be left over at the end, for one job alone.
    """
    groups = list(groups)
    share = sum(group.left for group in groups) / jobs
    return sorted(groups, key=lambda group: group.left < share)


def _dead_worker() -> DeadWorkerError:
    return DeadWorkerError(
        "a process was ended before its frames were encoded, and so was the next one that got them: something killed "
        "them, or there is too little memory for so many; give a lower number of jobs"
    )
