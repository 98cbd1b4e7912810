"""The process protocol (protocol.md): a command that is started for each vector, and files in and out.

Nothing that a command writes is trusted: files are measured before they are read, nothing in them is executed, and no
process that it started outlives the vector (`supervision`).
"""

import os
import shlex
import shutil
import signal
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gsvc_base.errors import UsageError
from gsvc_base.folders import UnusableFileError, read_regular
from gsvc_conformance.implementations import Answer, Failure, Unsupported
from gsvc_conformance.operation import Operation, Port, Values
from gsvc_conformance.reading import MAX_BYTES, parse_npy
from gsvc_conformance.scratch import TooMuchError, held_bytes, remove
from gsvc_conformance.supervision import Log, Program
from gsvc_conformance.vector import npy

EXIT_UNSUPPORTED: Final = 77
"""Exit status of a command that does not know an operation, or does not support what the inputs ask for."""
MAX_TEXT: Final = 1 << 12
"""Bytes of an output text."""
MAX_OUT: Final = 1 << 30
"""Bytes on the disk of all that stands in the folders of a command; one that writes more is ended."""
PERTURB: Final = "MALLOC_PERTURB_"
"""Variable by which the memory allocator of glibc fills what it gives; see mallopt(3)."""


class ProcessImplementation:
    """A command that is started as ``CMD OPERATION IN_DIR OUT_DIR`` for each vector (protocol.md).

    Parameters
    ----------
    command
        As for a shell, but no shell sees it.
    timeout
        Seconds that it may take for one vector.
    """

    in_full: Final = False
    environment: Final[Mapping[str, str]] = MappingProxyType({})

    def __init__(self, command: str, timeout: float) -> None:
        self._words = words_of(command, "--impl")
        self.name, self._timeout = command, timeout

    def run(self, operation: Operation, inputs: Values, turn: int = 0, name: str = "") -> Answer:
        """Start the command and read what it wrote; when it is asked again, new memory is filled with something else.

        So an answer that depends on memory nobody has written to differs, where the command allocates it by glibc.
        """
        with exchange(inputs) as files:
            words = [*self._words, operation.name, str(files.inside), str(files.outside)]
            variables = {PERTURB: str(turn * 85 % 255 + 1)} if turn and PERTURB not in os.environ else {}
            log = Log()
            try:
                with Program(words, log, variables) as program:
                    status = program.wait(self._timeout, files.measure)
            except OSError as error:
                return Failure("error", f"{self._words[0]} cannot be started: {error.strerror}")
            except TooMuchError as error:
                return Failure("error", f"{error}, and was ended", str(log))
            if failure := self._failure(status, str(log)):
                return failure
            answer = files.outputs(operation, "exit status 0")
            return replace(answer, log=str(log)) if isinstance(answer, Failure) else answer

    def _failure(self, status: int | None, log: str) -> Unsupported | Failure | None:
        if status is None:
            return Failure("timeout", f"no end after {self._timeout:g} s", log)
        if status == EXIT_UNSUPPORTED:
            return Unsupported(f"exit status {EXIT_UNSUPPORTED}")
        if status < 0:
            return Failure("crash", f"killed by {signal_name(-status)}", log)
        return Failure("error", f"exit status {status}", log) if status else None


def words_of(command: str, option: str) -> list[str]:
    """The words of the command that is given to an option; the first is a program that is there.

    Raises
    ------
    UsageError
        They are not.
    """
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise UsageError(f"the command {command!r} cannot be split into words: {error}") from None
    if not words:
        raise UsageError(f"{option} needs a command, such as './decoder --conformance'")
    if shutil.which(words[0]) is None:
        raise UsageError(_why_no_program(words[0]))
    return words


def _why_no_program(word: str) -> str:
    path = Path(word)
    if path.is_dir():
        return f"{path} is a folder, not a program"
    if path.is_file():
        if os.access(path, os.X_OK):
            return f"{path} is in the current folder, which is not searched: say ./{path}"
        return f"{path} cannot be executed: chmod +x makes it a program, or put its interpreter before it"
    return f"there is no program {word!r}; {'build it first' if '/' in word else 'give its path, such as ./decoder'}"


@dataclass(frozen=True)
class Exchange:
    """The folder of one vector, in which `inside` holds what is asked and `outside` what is answered."""

    folder: Path

    @property
    def inside(self) -> Path:
        """IN_DIR."""
        return self.folder / "in"

    @property
    def outside(self) -> Path:
        """OUT_DIR."""
        return self.folder / "out"

    def measure(self) -> None:
        """Refuse a folder that fills the disk.

        Raises
        ------
        TooMuchError
            It holds more than `MAX_OUT` bytes, or nests too deep.
        """
        if held_bytes(self.folder, MAX_OUT) > MAX_OUT:
            raise TooMuchError(f"it wrote more than {MAX_OUT >> 20} MiB to IN_DIR and OUT_DIR")

    def outputs(self, operation: Operation, status: str) -> Values | Failure:
        """The outputs of an operation, or what is wrong with their files, against what the status says."""
        try:
            return {port.name: read_output(self.outside, port) for port in operation.outputs}
        except (OSError, ValueError) as error:
            return Failure("error", f"{status}, but {error}")


@contextmanager
def exchange(inputs: Values) -> Iterator[Exchange]:
    """The folder of a vector with its inputs, which is removed in the end."""
    files = Exchange(Path(tempfile.mkdtemp(prefix="gsvc-conformance-")))
    try:
        files.inside.mkdir()
        files.outside.mkdir()
        write_inputs(files.inside, inputs)
        yield files
    finally:
        remove(files.folder)


def write_inputs(folder: Path, inputs: Values) -> None:
    """Write the inputs of an operation as files."""
    for name, data in files_of(inputs).items():
        (folder / name).write_bytes(data)


def files_of(values: Values) -> dict[str, bytes]:
    """Inputs or outputs of an operation as files: NAME.gsvc for streams, NAME.npy for all else."""
    files = {}
    for name, value in values.items():
        if isinstance(value, bytes):
            files[f"{name}.gsvc"] = value
        else:
            dtype = {int: "<i8", float: "<f8"}.get(type(value))
            files[f"{name}.npy"] = npy(np.asarray(value, dtype))
    return files


def read_output(folder: Path, port: Port) -> NDArray[Any] | str | bytes:
    """An output from its file.

    Raises
    ------
    OSError, ValueError
        It is missing, too large or not what its name says; with a message that begins with the file's name.
    """
    if port.type == "text":
        return _read_file(folder / f"{port.name}.txt", MAX_TEXT).decode(errors="replace").strip()
    if port.type == "stream":
        return _read_file(folder / f"{port.name}.gsvc", MAX_BYTES)
    name = f"{port.name}.npy"
    return parse_npy(_read_file(folder / name, MAX_BYTES), name)


def _read_file(path: Path, most: int) -> bytes:
    """An output, which must be a regular file and not a link."""
    try:
        return read_regular(path, most)
    except FileNotFoundError:
        raise ValueError(f"there is no {path.name}") from None
    except (UnusableFileError, UsageError) as error:
        raise ValueError(str(error).replace(str(path), path.name)) from None
    except OSError as error:
        raise ValueError(f"{path.name} cannot be read: {error.strerror}") from None


def signal_name(number: int) -> str:
    """The name of a signal of the system."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
