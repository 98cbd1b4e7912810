"""The functions that gsvc_ref has for the operations of spec.md: the table that ``run --reference`` answers by.

An operation whose name and arguments gsvc_ref has too is a `Twin`: its answer is that function's, as it stands. Any
other is `Other`, with what gsvc_ref has instead and why; `gsvc_conformance.operations` translates it. A `Free` one has
no function in the code of spec.md either, because many answers are right.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import numpy as np

from gsvc_base.document import PATH


@dataclass(frozen=True)
class Twin:
    """gsvc_ref has a function with the operation's name, argument names and meaning.

    It is an attribute of gsvc_ref. It returns the one output, or a named tuple of all; a `Splats` is an array of its
    parameters. It may have further arguments by keyword.
    """


@dataclass(frozen=True)
class Other:
    """gsvc_ref has something else.

    Attributes
    ----------
    name
        Its place: ``module:name``.
    reason
        The reason of another name or other arguments.
    """

    name: str
    reason: str


@dataclass(frozen=True)
class Free(Other):
    """gsvc_ref has something else, and the code of spec.md has nothing: the reason says why."""


TWIN: Final = Twin()

INSTEAD: Final[Mapping[str, Other]] = {
    "metrics": Other("gsvc_ref.metrics:psnr", "mse, psnr and ms_ssim are functions of a module of this name"),
    "encode_video": Free("gsvc_ref.encoder:encode", "an encoder is free: whatever decodes to what was asked is right"),
}
"""By name of the operation; all others are twins."""

_ROW: Final = re.compile(r"^\| `(\w+)` \| ([\d.]+) \| .* \| .* \|$", re.MULTILINE)


@cache
def sections() -> Mapping[str, str]:
    """The section of spec.md that defines each operation, in the order of its section 4.3."""
    text = PATH.read_text(encoding="utf-8")
    return dict(_ROW.findall(text, text.index("\n### 4.3 "), text.index("\n## 5 ")))


PAIRS: Final[Mapping[str, Twin | Other]] = {name: INSTEAD.get(name, TWIN) for name in sections()}
"""By name of the operation, in the order of spec.md section 4.3."""


def twin(name: str) -> Callable[..., Any]:
    """gsvc_ref's function of an operation that is a `Twin`."""
    import gsvc_ref  # the implementation that is asked, as any other: what judges does without it

    function: Callable[..., Any] = getattr(gsvc_ref, name)
    return function


def answer(name: str, outputs: Mapping[str, str], inputs: Mapping[str, Any]) -> dict[str, Any]:
    """The outputs of an operation that is a `Twin`; `outputs` are their names and types."""
    found = twin(name)(**inputs)
    values = found._asdict() if hasattr(found, "_asdict") else dict(zip(outputs, [found], strict=True))
    return {
        name: value if isinstance(value, np.ndarray | str) else np.asarray(value, outputs[name])
        for name, value in values.items()
    }
