"""Reading streams without the compiler where they are small."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gsvc_ref._jit import SMALL_TO_READ, plain_kernels
from gsvc_ref.cli.compilation import compilation_notice
from gsvc_ref.cli.files import STDIO


@contextmanager
def reading(command: str, *names: str, silent: bool, small: int = SMALL_TO_READ) -> Iterator[None]:
    """Read streams: without the compiler if they are files of `small` bytes at most, else with `compilation_notice`."""
    files = [Path(name) for name in names]
    if STDIO not in names and all(map(Path.is_file, files)) and sum(file.stat().st_size for file in files) <= small:
        with plain_kernels():
            yield
    else:
        with compilation_notice(command, silent=silent):
            yield
