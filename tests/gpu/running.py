"""Parts in processes of their own, each with a time limit: whatever happens to one, the others go on."""

import json
import os
import signal
import subprocess
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from gsvc_base.processors import processors
from tests.gpu.advice import advice
from tests.gpu.outcome import Outcome, State
from tests.gpu.parts import Part
from tests.gpu.survey import ROOT

GRACE: Final = 5.0
"""Seconds that a process has to write what it found, when it is told to end, and then to die."""
GLANCE: Final = 0.1
"""Seconds between two looks at the processes."""
ALONE: Final = 0.42
"""Part of the time that is kept for what has to be alone, if it may need as much."""


@dataclass
class Running:
    """A part and its process."""

    part: Part
    process: subprocess.Popen[bytes]
    begin: float
    end: float  # when its time is over

    def stop(self) -> None:
        """Tell it and all that it started to end; kill them if they do not. A driver may keep a process even then."""
        for number in (signal.SIGTERM, signal.SIGKILL):
            with suppress(ProcessLookupError):
                os.killpg(self.process.pid, number)
            with suppress(subprocess.TimeoutExpired):
                self.process.wait(GRACE)
                return


def results_of(parts: Sequence[Part], folder: Path, seconds: float, width: int) -> Iterator[Outcome]:
    """Run parts, and yield what became of each as soon as it is known.

    What may run beside others runs first, for as long as leaves the others their time; then what has to be alone, one
    after the other.

    Parameters
    ----------
    parts
        Their names are those of files, NAME.json and NAME.log.
    folder
        Where these files go.
    seconds
        For everything.
    width
        The number of parts that may run at the same time.
    """
    folder.mkdir(parents=True, exist_ok=True)
    begin = time.monotonic()
    yield from (Outcome(part.name, part.what, "skipped", part.missing) for part in parts if part.missing)
    wanted = [part for part in parts if not part.missing]
    alone = [part for part in wanted if part.alone]
    together = [part for part in wanted if not part.alone]
    later = min(sum(part.limit for part in alone), ALONE * seconds)
    yield from _all_of(together, folder, begin + seconds - later, width)
    yield from _all_of(alone, folder, begin + seconds, 1)


def _all_of(parts: Sequence[Part], folder: Path, end: float, width: int) -> Iterator[Outcome]:
    """Run parts, so many at the same time, until `end` at most."""
    waiting, going = deque(parts), list[Running]()
    try:
        while waiting or going:
            now = time.monotonic()
            if now >= end:
                yield from (Outcome(part.name, part.what, "stopped", "there was no time left") for part in waiting)
                waiting.clear()
            while waiting and len(going) < width:
                going.append(_started(waiting.popleft(), folder, end, width))
            for one in [one for one in going if one.process.poll() is not None or now >= one.end]:
                in_time = one.process.poll() is not None
                if not in_time:
                    one.stop()
                going.remove(one)
                yield _outcome(one, folder, in_time)
            time.sleep(GLANCE)
    finally:  # whoever asked may be ended
        for one in going:
            one.stop()


def _started(part: Part, folder: Path, end: float, width: int) -> Running:
    now = time.monotonic()
    threads = str(max(1, processors() // width))
    variables = {**os.environ, "OMP_NUM_THREADS": threads, "NUMBA_NUM_THREADS": threads, **part.settings}
    (folder / f"{part.name}.json").unlink(missing_ok=True)
    with (folder / f"{part.name}.log").open("wb") as log:
        process = subprocess.Popen(
            [*part.command, str(folder / f"{part.name}.json")],
            cwd=ROOT, env=variables, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True,
        )  # fmt: skip
    return Running(part, process, now, max(now, min(now + part.limit, end)))


def _outcome(one: Running, folder: Path, in_time: bool) -> Outcome:
    """What became of a process that has ended, or was ended."""
    part, path = one.part, folder / f"{one.part.name}.json"
    seconds, values = time.monotonic() - one.begin, _values(path)
    state: State
    state, told = part.told(path, values) if values else ("failed", "")
    log = (folder / f"{part.name}.log").read_text(encoding="utf-8", errors="replace")
    code = one.process.returncode
    if not in_time:
        state, told = _unless_wrong(state, "stopped"), _joined(f"stopped after {seconds:.0f} s", told)
    elif state in ("stopped", "failed") or code not in (0, 1):
        state, told = _unless_wrong(state, "failed"), _joined(advice(log, code or 0), told)
    return Outcome(part.name, part.what, state, told, seconds, values)


def _unless_wrong(state: State, end: State) -> State:
    return "wrong" if state == "wrong" else end


def _joined(*sentences: str) -> str:
    return "; until then: ".join(sentence for sentence in sentences if sentence)


def _values(path: Path) -> dict[str, Any]:
    try:
        values: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return values
