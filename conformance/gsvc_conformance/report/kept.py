"""The files of `run --keep DIR`: DIR/ID/in, DIR/ID/out and DIR/ID/expected of each wrong vector."""

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final

import numpy as np

from gsvc_conformance.expectations import Refusal
from gsvc_conformance.process import write_inputs
from gsvc_conformance.runner import Judged
from gsvc_conformance.scratch import remove

PARTS: Final = ("in", "out", "expected")


def forget(folder: Path, names: Iterable[str]) -> None:
    """Remove what an earlier run kept of some vectors, and nothing else."""
    for name in names:
        for part in PARTS:
            remove(folder / name / part)
        with suppress(OSError):  # it is not there, or holds something else
            (folder / name).rmdir()


def keep_files(folder: Path, judged: Judged) -> None:
    """Keep what was asked, what was answered and what was expected, as files of the process protocol."""
    home = folder / judged.vector.id
    expected = {
        name if not part else f"{name}.{part}": array
        for name, expectation in judged.vector.expected.items()
        if not isinstance(expectation, Refusal)
        for part, array in expectation.parts().items()
    }
    refusals = {name: e.value for name, e in judged.vector.expected.items() if isinstance(e, Refusal)}
    texts = {name: value for name, value in (judged.outputs or {}).items() if isinstance(value, str)}
    given = {name: value for name, value in (judged.outputs or {}).items() if isinstance(value, np.ndarray)}
    arrays = {name: value for name, value in given.items() if value.dtype.kind in "biuf"}
    streams = {name: value for name, value in (judged.outputs or {}).items() if isinstance(value, bytes)}
    for part, values in (("in", judged.vector.inputs), ("expected", expected), ("out", arrays | streams)):
        (home / part).mkdir(parents=True, exist_ok=True)
        write_inputs(home / part, values)
    for part, values in (("expected", refusals), ("out", texts)):
        for name, text in values.items():
            (home / part / f"{name}.txt").write_text(text, encoding="utf-8", errors="backslashreplace")
