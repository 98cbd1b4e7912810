"""What the suite can judge: functions of a Python module; a command is in `process`."""

import importlib
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np

from conformance.stage import DTYPES, Port, Stage, Values
from gsvc_ref.errors import UsageError


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
        The end of what it printed.
    """

    outcome: Literal["error", "crash", "timeout"]
    message: str
    log: str = ""


Answer = Values | Unsupported | Failure


class Implementation(Protocol):
    """Something that answers stages."""

    @property
    def name(self) -> str:
        """What it is called."""
        ...

    @property
    def in_full(self) -> bool:
        """Whether refusals are judged to the bit."""
        ...

    def run(self, stage: Stage, inputs: Values) -> Answer:
        """The outputs of a stage for some inputs, which it may change."""


@dataclass(frozen=True)
class ModuleImplementation:
    """Functions that are named as the stages and are called with keyword arguments.

    A function that is missing or raises NotImplementedError is unsupported.

    Attributes
    ----------
    functions
        By name of the stage; others are ignored.
    """

    name: str
    functions: Mapping[str, Any]
    in_full: bool = False

    def run(self, stage: Stage, inputs: Values) -> Answer:
        """Call the function."""
        function = self.functions.get(stage.name)
        if not callable(function):
            return Unsupported(f"there is no function {stage.name}")
        try:
            with np.errstate(all="ignore"):
                given = function(**inputs)
            return _collect(stage, given)
        except NotImplementedError as error:
            return Unsupported(str(error) or f"{stage.name} raises NotImplementedError")
        except (Exception, SystemExit) as error:
            return Failure("error", _last_line(error))


def load_module(name: str) -> ModuleImplementation:
    """The implementation that is a module.

    Raises
    ------
    UsageError
        It cannot be imported.
    """
    try:
        module = importlib.import_module(name)
    except Exception as error:
        raise UsageError(f"the module {name} cannot be imported: {type(error).__name__}: {error}") from None
    return ModuleImplementation(name, vars(module))


def _collect(stage: Stage, given: object) -> Values | Failure:
    """The outputs among what a function returned; single numbers may be Python's."""
    if not isinstance(given, Mapping):
        return Failure("error", f"{stage.name} returned {type(given).__name__}, not a dict of its outputs")
    if missing := [port.name for port in stage.outputs if port.name not in given]:
        return Failure("error", f"{stage.name} returned no {', '.join(missing)}")
    return {port.name: _output(port, given[port.name]) for port in stage.outputs}


def _output(port: Port, value: Any) -> Any:
    if port.type == "text" or isinstance(value, np.ndarray):
        return value
    if isinstance(value, int | float) and not isinstance(value, np.generic):
        return np.asarray(value, DTYPES.get(port.type))
    return np.asarray(value)


def _last_line(error: BaseException) -> str:
    frame = traceback.extract_tb(error.__traceback__)[-1]
    summary = " ".join(traceback.format_exception_only(error)[-1].split())
    return f"{summary} ({Path(frame.filename).name}, line {frame.lineno}, in {frame.name})"


def from_namespace(name: str, functions: Mapping[str, Callable[..., Any]]) -> ModuleImplementation:
    """One of the project's own implementations, of which refusals are judged in full."""
    return ModuleImplementation(name, functions, in_full=True)
