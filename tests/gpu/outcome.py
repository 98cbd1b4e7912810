"""What a part of the command found, in a file that is always whole: whoever is ended leaves what it had."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from gsvc_base.files import write_text

State = Literal["right", "wrong", "measured", "failed", "stopped", "skipped"]
"""What became of a part: `stopped` by its time limit, `failed` by an error."""


@dataclass
class Record:
    """The values that a part's process has found so far."""

    path: Path
    values: dict[str, Any] = field(default_factory=dict)

    def keep(self, **values: Any) -> None:
        """Put values in the place of earlier ones of the same names, and write the file."""
        self.values.update(values)
        write_text(json.dumps(self.values, indent=1) + "\n", self.path)

    def end(self, **values: Any) -> None:
        """Keep last values: nothing is missing."""
        self.keep(**values, whole=True)


@dataclass(frozen=True)
class Outcome:
    """What became of a part."""

    name: str
    what: str  # what it is about, in words
    state: State
    told: str  # a sentence
    seconds: float = 0.0
    values: dict[str, Any] = field(default_factory=dict)  # of its record
