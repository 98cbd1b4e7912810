"""Implementations that the kit can judge: functions of a Python module; a command is in `process`.

A module may have a function ``environment() -> dict[str, str]`` that says what it runs on; reports show it.
"""

import importlib
import inspect
import sys
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, Protocol

import numpy as np

from gsvc_base.errors import UsageError
from gsvc_conformance.operation import DTYPES, Operation, Port, Values, operations
from gsvc_conformance.spelling import meant
from gsvc_conformance.standard_streams import kept_streams

INSTALLS: Final = {
    "torch": "torch",
    **dict.fromkeys(("pyopencl", "wgpu", "playwright"), "'gsvc-conformance[adapters]'"),
}
"""What pip must install for what an adapter imports."""
MAX_NEAR: Final = 4
"""Maximum number of names that are nearly those of operations in a message."""


@dataclass(frozen=True)
class Unsupported:
    """The implementation does not do this."""

    reason: str


@dataclass(frozen=True)
class Failure:
    """There is no answer, or one that cannot be read.

    Attributes
    ----------
    outcome
        ``error``, ``crash`` (killed by a signal) or ``timeout``.
    message
        A sentence.
    log
        The beginning and the end of what it printed.
    """

    outcome: Literal["error", "crash", "timeout"]
    message: str
    log: str = ""


FLUSHES: Final = (
    "it leaves the processor flushing subnormal numbers to zero, so that the kit's own arithmetic does it too; "
    "switch that off when the function returns, or connect by --impl"
)

Answer = Values | Unsupported | Failure


class Implementation(Protocol):
    """Something that answers operations."""

    @property
    def name(self) -> str:
        """The name of the implementation."""
        ...

    @property
    def in_full(self) -> bool:
        """Whether refusals are judged to the bit."""
        ...

    @property
    def environment(self) -> Mapping[str, str]:
        """The device, driver and versions that it runs on, as far as it says."""
        ...

    def run(self, operation: Operation, inputs: Values, turn: int = 0, name: str = "") -> Answer:
        """The outputs of an operation for some inputs, which it may change.

        `turn` counts earlier times; `name` is the id of the vector, for messages.
        """


@dataclass(frozen=True)
class ModuleImplementation:
    """Functions that are named as the operations and are called with keyword arguments.

    A function that is missing or raises NotImplementedError is unsupported.

    Attributes
    ----------
    functions
        The functions by the name of their operation; others are ignored.
    environment
        The environment that it runs on, by name.
    """

    name: str
    functions: Mapping[str, Any]
    in_full: bool = False
    environment: Mapping[str, str] = field(default_factory=dict)

    def run(self, operation: Operation, inputs: Values, turn: int = 0, name: str = "") -> Answer:
        """Call the function."""
        function = self.functions.get(operation.name)
        if not callable(function):
            return Unsupported(f"there is no function {operation.name}")
        if problem := _misfit(function, operation):
            return Failure("error", problem)
        try:
            with np.errstate(all="ignore"), kept_streams():
                given = function(**inputs)
            return Failure("error", FLUSHES) if _flushes() else collect(operation, given)
        except NotImplementedError as error:
            return Unsupported(str(error) or f"{operation.name} raises NotImplementedError")
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # those that end a task or a process, too
            return Failure("error", _last_line(error))


def load_module(name: str, home: Path | None = None) -> ModuleImplementation:
    """The implementation that is a module.

    Parameters
    ----------
    name
        As in an import statement.
    home
        A folder that it may be in, if it is not installed; None: the current folder.

    Raises
    ------
    UsageError
        It cannot be imported, has no function of an operation, or its `environment` fails.
    """
    if name.endswith(".py"):
        raise UsageError(f"a module is given by its name: {'.'.join(Path(name).with_suffix('').parts)}, not {name}")
    if (folder := str(home or Path.cwd())) not in sys.path:  # a command has it not, other than `python -m`
        sys.path.insert(0, folder)
    try:
        with kept_streams():
            module = importlib.import_module(name)
    except SystemExit as end:  # a script without a guard, or one that finds no device; else its code would be ours
        raise UsageError(f"the module {name} ended while it was imported: SystemExit: {end}") from None
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        advice = _import_advice(name, error)
        raise UsageError(f"the module {name} cannot be imported: {type(error).__name__}: {error}{advice}") from None
    functions = {key: value for key, value in vars(module).items() if callable(value) and not key.startswith("_")}
    if functions.keys().isdisjoint(operations()):
        near = [f"{key} for {meant(key, operations())[0]}" for key in functions if meant(key, operations())]
        hint = f"; is it {', '.join(near[:MAX_NEAR])}?" if near else "; see gsvc-conformance list"
        raise UsageError(f"no function of the module {name} is named as an operation{hint}")
    return ModuleImplementation(name, functions, environment=_environment_of(name, functions.get("environment")))


def _import_advice(name: str, error: BaseException) -> str:
    """Advice about a module that cannot be imported; empty if there is none."""
    if not isinstance(error, ModuleNotFoundError):
        return ""
    if Path(name).is_file():
        return f"; {name} is not a module; a program is judged with --impl"
    if error.name == name:
        return "; it must be in the current folder, installed, or in a folder of PYTHONPATH"
    if not name.startswith("gsvc_conformance.adapters."):
        return ""
    if extra := INSTALLS.get((error.name or "").partition(".")[0]):
        return f"; pip install {extra}"
    return "; its docstring says where to get it"


def _environment_of(name: str, function: Callable[[], object] | None) -> dict[str, str]:
    """The result of a module's function `environment`, if it has one.

    Raises
    ------
    UsageError
        It fails, as where there is no device, or returns something else than texts by name.
    """
    if function is None:
        return {}
    try:
        with kept_streams():
            given = function()
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise UsageError(f"{name}.environment() fails: {_last_line(error)}") from None
    if not isinstance(given, Mapping) or not all(isinstance(text, str) for pair in given.items() for text in pair):
        raise UsageError(f"{name}.environment() must return a dict of texts by name, not {given!r}")
    return checked_environment(given, f"{name}.environment()")


def checked_environment(given: Mapping[str, str], source: str) -> dict[str, str]:
    """Names and values for a report, each on one line.

    Raises
    ------
    UsageError
        A name or value is empty.
    """
    lines = {" ".join(key.split()): " ".join(value.split()) for key, value in given.items()}
    for key, value in lines.items():
        if not key or not value:
            raise UsageError(f"{source} has {key!r}: {value!r}; neither may be empty")
    return lines


def _flushes() -> bool:
    """Whether the processor takes subnormal numbers for zero; a library can switch that on for the whole thread."""
    return bool(np.array([2.0**-149], np.float32)[0] * np.float32(1) == 0)


def _misfit(function: Callable[..., Any], operation: Operation) -> str:
    """The fault of a function's parameters; empty if there is none, or if it does not show them."""
    names = [port.name for port in operation.inputs]
    try:
        inspect.signature(function).bind(**dict.fromkeys(names))
    except ValueError:  # built-in functions
        return ""
    except TypeError as error:
        return f"{operation.name} must take ({', '.join(names)}): {error}"
    return ""


def collect(operation: Operation, given: object) -> Values | Failure:
    """The outputs among what a function returned; single numbers may be Python's."""
    if not isinstance(given, Mapping):
        return Failure("error", f"{operation.name} returned {type(given).__name__}, not a dict of its outputs")
    if missing := [port.name for port in operation.outputs if port.name not in given]:
        return Failure("error", f"{operation.name} returned no {', '.join(missing)}")
    if masked := [port.name for port in operation.outputs if isinstance(given[port.name], np.ma.MaskedArray)]:
        advice = "return a plain one, such as numpy.ma.filled gives; what is masked could be anything"
        return Failure("error", f"{operation.name} returned {', '.join(masked)} as a masked array: {advice}")
    return {port.name: _output(port, given[port.name]) for port in operation.outputs}


def _output(port: Port, value: Any) -> Any:
    """An output as a plain array of its own: a function may return the same memory each time, or a subclass."""
    if port.type == "text":
        return value
    if port.type == "stream":
        return bytes(value) if isinstance(value, bytearray | memoryview) else value
    if isinstance(value, int | float) and not isinstance(value, np.generic):
        return np.asarray(value, port.type if port.type in DTYPES else None)
    return np.array(np.ndarray.view(value, np.ndarray) if isinstance(value, np.ndarray) else value)


def _last_line(error: BaseException) -> str:
    frame = traceback.extract_tb(error.__traceback__)[-1]
    summary = " ".join(traceback.format_exception_only(error)[-1].split())
    return f"{summary} ({Path(frame.filename).name}, line {frame.lineno}, in {frame.name})"


def from_namespace(name: str, functions: Mapping[str, Callable[..., Any]]) -> ModuleImplementation:
    """One of the project's own implementations, of which refusals are judged in full."""
    return ModuleImplementation(name, functions, in_full=True)
