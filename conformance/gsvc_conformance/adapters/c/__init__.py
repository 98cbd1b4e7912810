"""A decoder of profile `main` in C11, integers up to the parameters, which the kit asks as a server.

It was written from spec.md alone and shares no code with gsvc_ref: a second opinion on every sentence about bits. It
has one thread, and the structure of a decoder for a GPU: passes, items and prefix sums (`decoder.h` begins with a map
of the files). Judge it with `gsvc-conformance run --serve "python -m gsvc_conformance.adapters.c --serve"`, which
compiles it first; that takes a C compiler that knows the options of GCC: the one that CC names, or `cc`. Without
Python: `cc -O2 -o gsvc-main *.c` in this folder.

Its test compiles it with FAST: such a compiler may fuse, reorder and flush operations with numbers as it likes, and
the parameters are right to the bit all the same, since no operation that makes one is rounded (spec.md, R-15.4-2).

It is a decoder of bits and splats: `reconstruct_stream`, `reconstruct_layers`, `main_work` and all operations of
spec.md's section 15 but `decode_layers`; no rendering, and profile `paper` is refused at `profile` (R-5-6).
"""

import hashlib
import os
import shlex
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final

FOLDER: Final = Path(__file__).parent
PLAIN: Final = ("-O2",)
FAST: Final = ("-O3", "-march=native", "-ffast-math")
"""Options of compilers that a decoder must not notice."""


def program(flags: Sequence[str] = PLAIN) -> Path:
    """The program, compiled if that has not been done before with these sources, flags and compiler.

    Parameters
    ----------
    flags
        Options of the compiler, such as FAST.

    Returns
    -------
    Path
        In the folder `gsvc-c` of the user's cache (XDG_CACHE_HOME, else ~/.cache), which the user alone can enter.

    Raises
    ------
    NotImplementedError
        There is no C compiler.
    RuntimeError
        The compiler refuses the sources.
    """
    compiler = shlex.split(os.environ.get("CC", "cc"))
    told = ", ".join([" ".join(compiler), *flags])
    command = [*compiler, "-std=c11", *flags, f'-DFLAGS="{told}"']
    sources = sorted(FOLDER.glob("*.[ch]"))
    try:
        version = subprocess.run([*compiler, "--version"], capture_output=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        raise NotImplementedError(f"there is no C compiler {compiler[0]}: install one, or name one in CC") from None
    parts = [*(path.read_bytes() for path in sources), version, repr(command).encode()]
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gsvc-c"
    home.mkdir(mode=0o700, parents=True, exist_ok=True)
    result = home / hashlib.sha256(b"\0".join(parts)).hexdigest()[:32]
    if not result.exists():
        with tempfile.TemporaryDirectory(dir=home) as folder:  # two that compile at once are in nobody's way
            made = Path(folder, "program")
            c_files = [str(path) for path in sources if path.suffix == ".c"]
            done = subprocess.run([*command, "-o", str(made), *c_files], capture_output=True, text=True, check=False)
            if done.returncode:
                raise RuntimeError(f"{told} does not compile the decoder: {done.stderr.strip()}")
            made.replace(result)
    return result
