"""The files of `run --keep DIR`: DIR/ID/in, DIR/ID/out and DIR/ID/expected of each wrong vector."""

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Final

import numpy as np

from gsvc_base.folders import OwnFolder
from gsvc_conformance.expectations import Refusal
from gsvc_conformance.process import files_of
from gsvc_conformance.runner import Judged

RECORD: Final = "kept.json"
"""The file of each vector that lists what was kept of it."""


def forget(folder: Path, names: Iterable[str]) -> None:
    """Remove what an earlier run kept of some vectors, and nothing else.

    Raises
    ------
    UsageError
        The folder is not the user's own.
    """
    if os.path.lexists(folder):
        with OwnFolder(folder, group=True) as own:
            for name in names:
                own.remove_listed(f"{name}/{RECORD}")


def keep_files(folder: Path, judged: Judged) -> None:
    """Keep what was asked, what was answered and what was expected, as files of the process protocol.

    Raises
    ------
    UsageError
        The folder is not the user's own, or has something else in place of the vector's.
    """
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
    files: dict[str, bytes] = {}
    for part, values in (("in", judged.vector.inputs), ("expected", expected), ("out", arrays | streams)):
        files |= {f"{part}/{name}": data for name, data in files_of(values).items()}
    for part, values in (("expected", refusals), ("out", texts)):
        files |= {f"{part}/{name}.txt": text.encode("utf-8", "backslashreplace") for name, text in values.items()}
    with OwnFolder(folder, group=True, parents=True) as own:
        own.write_listed(f"{judged.vector.id}/{RECORD}", files)
