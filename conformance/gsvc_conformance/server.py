"""The protocol of a server (protocol.md): one process that answers vector after vector, by lines of JSON and files.

As for a command (`process`), nothing that it writes is trusted. What is wrong with an answer is the failure of that
vector; a process that broke the protocol is ended, and the next vector begins another one.
"""

import itertools
import json
import os
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import IO, Any, Final, Literal

from gsvc_base.cli.text import plural
from gsvc_base.errors import UsageError
from gsvc_conformance.implementations import Answer, Failure, Unsupported, checked_environment
from gsvc_conformance.operation import Operation, Values
from gsvc_conformance.process import exchange, signal_name, words_of
from gsvc_conformance.scratch import TooMuchError
from gsvc_conformance.supervision import INTERVAL_S, PATIENCE_S, Log, Program

Outcome = Literal["error", "crash", "timeout"]

PROTOCOL: Final = 1
"""The version of the protocol that the hello names."""
HELLO: Final = f'{{"gsvc": {PROTOCOL}, "name": "..."}}'
"""The first line of a server in its shortest form."""
STATUSES: Final = ("done", "unsupported", "error")
"""What an answer may say."""
START_S: Final = 60.0
"""Time from the start of a server to its hello, in seconds."""
END_S: Final = 5.0
"""Time from the end of its input to its own end, in seconds; then it is killed."""
STARTS: Final = 3
"""Number of times in a row that a server fails to start before no more is asked of it."""
MAX_LINE: Final = 1 << 16
"""Bytes of a line of a server."""
MAX_REQUEST: Final = 1 << 12
"""Bytes of a line of the kit, with its end."""
MAX_FOLDER: Final = 1000
"""Bytes of the name of the folder for temporary files, so that a request with two paths fits."""
WAITING: Final = 16
"""Number of reads (of at most 64 KiB) with lines that nobody asked for after which no more is read."""
SHOWN: Final = 100
"""Characters of a line that a message quotes."""
LATE_S: Final = 0.05
"""Time in which what was printed before an answer arrives, in seconds."""


class ServerImplementation:
    """A command that is started once, and asked by lines of JSON (protocol.md); with several jobs once for each.

    It is a context, which ends its processes.

    Parameters
    ----------
    command
        As for a shell, but no shell sees it.
    timeout
        Seconds that it may take for one vector.
    start_timeout
        Seconds that it may take to say hello.

    Raises
    ------
    UsageError
        It cannot be started, or says no hello that this kit understands.
    """

    in_full: Final = False

    def __init__(self, command: str, timeout: float, start_timeout: float = START_S) -> None:
        _check_folder(tempfile.gettempdir())
        self._words = words_of(command, "--serve")
        self._timeout, self._start_timeout = timeout, start_timeout
        self._numbers = itertools.count(1)
        self._lock = threading.Lock()
        self._failed_starts = 0
        try:
            first = _Server(self._words, start_timeout)
        except _ServerError as fault:
            raise UsageError(f"{command}: {fault.with_last_line()}") from None
        self._idle = [first]
        self.name, self.environment = first.name, first.environment

    def __enter__(self) -> "ServerImplementation":
        return self

    def __exit__(self, *_: object) -> None:
        for server in self._idle:
            server.tell_to_end()
        while self._idle:
            self._idle.pop().end()

    def run(self, operation: Operation, inputs: Values, turn: int = 0, name: str = "") -> Answer:
        """Ask a server that is free, or a new one, and read what it wrote.

        Raises
        ------
        UsageError
            None can be started any more.
        """
        try:
            server = self._free()
        except _ServerError as fault:
            return fault.failure("the server cannot be started again: ")
        with exchange(inputs) as files, server:
            try:
                words = {"operation": operation.name, "in": files.inside.as_posix(), "out": files.outside.as_posix()}
                status, message = server.ask(next(self._numbers), words, self._timeout, files.measure, name)
            except _ServerError as fault:
                return fault.failure()
            answer: Answer = Unsupported(message or "status unsupported")
            if status == "done":
                answer = files.outputs(operation, "status done")
            elif status == "error":
                answer = Failure("error", message or "status error, without a message")
            if isinstance(answer, Failure):
                answer = replace(answer, log=server.log())
            with self._lock:
                self._idle.append(server.kept())
            return answer

    def _free(self) -> "_Server":
        """A server that nobody asks; a new one if there is none.

        Raises
        ------
        _ServerError
            It cannot be started.
        UsageError
            That was so too many times in a row.
        """
        with self._lock:
            if self._idle:
                return self._idle.pop()
        try:
            server = _Server(self._words, self._start_timeout)
        except _ServerError as fault:
            with self._lock:
                self._failed_starts += 1
                if self._failed_starts < STARTS:
                    raise
            times = plural(self._failed_starts, "time")
            raise UsageError(
                f"the server did not start {times} in a row; the last time {fault.with_last_line()}"
            ) from None
        with self._lock:
            self._failed_starts = 0
        return server


class _ServerError(Exception):
    """The end of a server that does not keep to the protocol: what is to be said of it."""

    def __init__(self, outcome: Outcome, message: str, log: str) -> None:
        super().__init__(message)
        self._outcome, self._log = outcome, log

    def failure(self, before: str = "") -> Failure:
        """The failure of the vector that it was asked for."""
        return Failure(self._outcome, f"{before}{self}", self._log)

    def with_last_line(self) -> str:
        """The message, with the last line that was printed."""
        lines = self._log.split("\n")
        return f"{self}; it printed: {_shown(lines[-1].encode())}" if lines[-1].strip() else str(self)


class _Server:
    """One process of a server; as a context it is ended, unless it is `kept`.

    Raises
    ------
    _ServerError
        It cannot be started, or says no hello.
    """

    def __init__(self, words: list[str], timeout: float) -> None:
        self._keep = False
        self._before = "its hello"
        self._log_before = Log()  # what it printed from the request before to this one
        try:
            self._program = Program(words, Log(), {}, talks=True)
        except OSError as error:
            raise _ServerError("error", f"{words[0]} cannot be started: {error.strerror}", "") from None
        assert self._program.process.stdout is not None
        self._lines = _Lines(self._program.process.stdout)
        try:
            self.name, self.environment = self._read_hello(self._line(timeout, "hello"))
        except BaseException:
            self._close()
            raise

    def __enter__(self) -> "_Server":
        self._keep = False
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not self._keep:
            self._close()

    def kept(self) -> "_Server":
        """It, to be asked again."""
        self._keep = True
        return self

    def ask(
        self, number: int, words: Mapping[str, str], timeout: float, check: Callable[[], object], name: str = ""
    ) -> tuple[str, str]:
        """The status and the message of the answer to a request.

        Parameters
        ----------
        number
            The id of the request.
        words
            Its other fields, in their order.
        timeout
            In seconds.
        check
            Is called again and again until the answer is there; what it raises ends the server.
        name
            The id of the vector, by which messages of later ones name it.

        Raises
        ------
        _ServerError
            There is no answer, or another one.
        """
        self._log_before = self._program.log
        before = f"after {self._before} and before the next request"
        if (rest := self._unasked(before)) is not None:
            raise self._ended(rest, before)
        request = json.dumps({"id": number, **words}, ensure_ascii=False).encode() + b"\n"
        assert self._program.process.stdin is not None
        self._program.log = Log()
        try:
            self._program.process.stdin.write(request)
        except OSError:
            raise self._ended(b"", before) from None
        answer = self._object(self._line(timeout, "answer", check))
        if (given := answer.get("id")) != number or type(given) is not int:
            raise self._fault(f"it answered request {_json(given)}, but was asked request {number}")
        if (status := answer.get("status")) not in STATUSES:
            raise self._fault(f"the status of its answer is {_json(status)}, not one of {', '.join(STATUSES)}")
        if not isinstance(message := answer.get("message", ""), str):
            raise self._fault(f"the message of its answer is {_json(message)}, not a text")
        self._before = f"its answer to request {number}, {name or words['operation']},"
        if (rest := self._unasked("after its answer")) is not None:
            self._lines.put_back(rest)
        return str(status), " ".join(message.split())

    def log(self) -> str:
        """What it printed since it was asked."""
        time.sleep(LATE_S)
        return str(self._program.log)

    def tell_to_end(self) -> None:
        """Close its standard input."""
        with suppress(OSError):
            assert self._program.process.stdin is not None
            self._program.process.stdin.close()

    def end(self) -> None:
        """Tell it to end, and give it time for that."""
        self.tell_to_end()
        self._program.wait(END_S)
        self._close()

    def _close(self) -> None:
        self._program.close()
        self.tell_to_end()

    def _line(self, timeout: float, what: str, check: Callable[[], object] = int) -> bytes:
        """The next line.

        Raises
        ------
        _ServerError
            There is none in time, it has no end, or what `check` refuses.
        """
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0:
            alive = self._program.process.poll() is None
            with suppress(Empty):
                line, whole = self._lines.get(min(left, INTERVAL_S))
                if whole:
                    return line
                raise self._ended(line, f"without {_a(what)}")
            if not alive:  # somebody else holds its standard output
                raise self._ended(b"", f"without {_a(what)}")
            try:
                check()
            except TooMuchError as error:
                raise self._fault(f"{error}, and was ended") from None
        raise self._fault(f"no {what} after {timeout:g} s", "timeout")

    def _unasked(self, when: str) -> bytes | None:
        """What stands after the last line if nothing more can come; None if it can.

        Raises
        ------
        _ServerError
            There is a line already.
        """
        with suppress(Empty):
            line, whole = self._lines.get(0)
            if not whole:
                return line
            raise self._fault(f"it wrote a line {when}: {_shown(line)}")
        return None

    def _ended(self, rest: bytes, when: str) -> "_ServerError":
        """The error for a server that ended, whatever the reason.

        If it printed nothing since the request, its last words are what it printed since the request before.
        """
        status = self._program.wait(PATIENCE_S)
        self._close()
        if not str(self._program.log) and str(self._log_before):
            self._program.log = self._log_before
            if not when.startswith("after"):
                when += f"; it printed nothing since the request, so the log begins before {self._before.rstrip(',')}"
        when = f"in the middle of the line {_shown(rest)}" if rest else when
        if status is None:
            return self._fault(f"it closed its standard output {when}, and runs on")
        if status < 0:
            return self._fault(f"killed by {signal_name(-status)} {when}", "crash")
        return self._fault(f"it ended with exit status {status} {when}")

    def _read_hello(self, line: bytes) -> tuple[str, dict[str, str]]:
        """The name and the environment of its first line."""
        hello = self._object(line, "in place of the hello ")
        if type(version := hello.get("gsvc")) is not int:
            raise self._fault(f"its first line must be the hello, {HELLO}, and is {_shown(line)}")
        if version != PROTOCOL:
            raise self._fault(f"its hello is of version {version} of the protocol; this kit speaks version {PROTOCOL}")
        name, given = hello.get("name"), hello.get("environment", {})
        if not isinstance(name, str) or not name.strip():
            raise self._fault(f"its hello must have a name, a text that is not empty, and is {_shown(line)}")
        if not isinstance(given, dict) or not all(isinstance(text, str) for text in given.values()):
            raise self._fault(f"the environment of its hello must be an object of texts: {_shown(line)}")
        try:
            return " ".join(name.split()), checked_environment(given, "the environment of its hello")
        except UsageError as error:
            raise self._fault(str(error)) from None

    def _object(self, line: bytes, place: str = "") -> dict[str, Any]:
        """The object that a line is, which stands in some place.

        Raises
        ------
        _ServerError
            It is none.
        """
        if len(line) > MAX_LINE:
            raise self._fault(f"{place}it wrote a line of more than {MAX_LINE >> 10} KiB, which begins {_shown(line)}")
        try:
            value = json.loads(line.decode())
        except UnicodeDecodeError:
            raise self._fault(f"{place}it wrote a line that is no UTF-8: {_shown(line)}") from None
        except (ValueError, RecursionError):
            value = None
        if not isinstance(value, dict):
            raise self._fault(
                f"{place}it wrote a line that is not a JSON object: {_shown(line)}; standard output is the protocol's, "
                "so let it and its libraries print to standard error"
            )
        return value

    def _fault(self, message: str, outcome: Outcome = "error") -> _ServerError:
        """End the server; the error that says why."""
        self._close()
        return _ServerError(outcome, message, str(self._program.log))


class _Lines:
    """The lines of a pipe, read by a thread: the bytes of each, and whether it has an end; one without is the last."""

    def __init__(self, pipe: IO[bytes]) -> None:
        self._found: SimpleQueue[list[tuple[bytes, bool]]] = SimpleQueue()
        self._next: list[tuple[bytes, bool]] = []  # what came at once, the last first
        threading.Thread(target=self._read, args=(pipe,), daemon=True).start()

    def get(self, timeout: float) -> tuple[bytes, bool]:
        """The next one, for which it waits some seconds.

        Raises
        ------
        queue.Empty
            There is none.
        """
        if not self._next:
            self._next = (self._found.get(timeout=timeout) if timeout > 0 else self._found.get_nowait())[::-1]
        return self._next.pop()

    def put_back(self, rest: bytes) -> None:
        """Let the end come again."""
        self._next.append((rest, False))

    def _read(self, pipe: IO[bytes]) -> None:
        rest = b""
        with pipe:
            while data := os.read(pipe.fileno(), 1 << 16):
                *lines, rest = (rest + data).split(b"\n")
                if lines:
                    self._found.put([(line.removesuffix(b"\r"), True) for line in lines])
                if len(rest) > MAX_LINE or self._found.qsize() > WAITING:
                    self._found.put([(rest, True)])
                    return
        self._found.put([(rest, False)])


def _check_folder(folder: str) -> None:
    """Refuse a folder for temporary files whose name would not stand in a request as it is.

    Raises
    ------
    UsageError
        It is such.
    """
    name = Path(folder).as_posix()
    try:
        plain = json.dumps(name, ensure_ascii=False) == f'"{name}"' and len(name.encode()) <= MAX_FOLDER
    except UnicodeEncodeError:
        plain = False
    if not plain:
        raise UsageError(
            f"the folder for temporary files, {folder!r}, has a character that JSON escapes, is no UTF-8, or is longer "
            f"than {MAX_FOLDER} bytes: set TMPDIR to another one"
        )


def _shown(line: bytes) -> str:
    """The beginning of a line, for a message."""
    return f"'{_cut(line[: 4 * SHOWN].decode(errors='backslashreplace'))}'"


def _json(value: object) -> str:
    """The beginning of a value as JSON, for a message."""
    return _cut(json.dumps(value))


def _cut(text: str) -> str:
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def _a(what: str) -> str:
    return f"an {what}" if what[0] in "aeiou" else f"a {what}"
