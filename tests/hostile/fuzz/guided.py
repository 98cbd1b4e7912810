"""Fuzzing guided by coverage, with atheris: inputs that reach something new are kept and mutated on.

Kernels run uncompiled, so that their branches count, and so slowly: tens to hundreds of executions a second.
"""

import importlib.util
import sys
import warnings
from pathlib import Path
from random import Random
from typing import Final

import numpy as np

INSTRUMENTED: Final = ("gsvc_ref.bitstream", "gsvc_ref.main", "gsvc_ref.paper", "gsvc_ref.video")
NOT_INSTRUMENTED: Final = ("gsvc_ref.bitstream.crc",)
"""Packages whose branches count, and of these a module whose branches would only cost time."""

NEEDS_ATHERIS: Final = "coverage-guided fuzzing needs atheris: pip install 'gsvc_ref[fuzz]'"

PLAIN_MUTATIONS: Final = 8
"""One of so many mutations is libFuzzer's own."""

SECONDS_OF_ONE: Final = 60


def not_instrumented() -> list[str]:
    """The modules of gsvc_ref whose branches do not count; atheris takes whole packages, and these as exceptions."""
    spec = importlib.util.find_spec("gsvc_ref")
    assert spec is not None
    assert spec.origin is not None
    home = Path(spec.origin).parent
    files = [file.relative_to(home.parent).with_suffix("") for file in home.rglob("*.py")]
    names = [".".join(file.parts).removesuffix(".__init__") for file in files]
    return [name for name in names if not name.startswith(INSTRUMENTED) or name in NOT_INSTRUMENTED]


def run(name: str, *, runs: int, seconds: int, seed: int, found: Path) -> int:
    """Fuzz until one of the limits is reached or a defect is found; libFuzzer then ends the process.

    Parameters
    ----------
    name
        Of the target.
    runs, seconds
        Most executions, and most seconds or 0.
    seed
        Of libFuzzer's choices.
    found
        Folder in which inputs that reach something new are kept.
    """
    try:
        import atheris
    except ImportError:
        print(NEEDS_ATHERIS, file=sys.stderr)
        return 2
    with atheris.instrument_imports(include=["gsvc_ref"], exclude=not_instrumented()):
        from .fuzzing import TARGETS
    from .seeded import pool, replay_command
    from .stream_mutations import MAX_BYTES

    target = TARGETS[name]
    inputs = pool(target)
    found.mkdir(parents=True, exist_ok=True)
    beginning = found / "beginning"
    beginning.mkdir(exist_ok=True)
    for number, data in enumerate(inputs):
        (beginning / str(number)).write_bytes(data)

    def one(data: bytes) -> None:
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):  # compiled, kernels do not warn of overflow
                warnings.simplefilter("error")
                target.run(data)
        except Exception:
            print(f"DEFECT with seed {seed}; replay: {replay_command(name, found / 'crash-*')}", flush=True)
            raise

    def mutated(data: bytes, most: int, number: int) -> bytes:
        rng = Random(number)
        if rng.randrange(PLAIN_MUTATIONS) == 0:
            return bytes(atheris.Mutate(data, most))
        return target.mutate(bytes(data), rng, inputs)[:most]

    options = [f"-runs={runs}", f"-seed={seed + 1}", f"-max_len={MAX_BYTES}", f"-timeout={SECONDS_OF_ONE}"]
    if seconds:
        options.append(f"-max_total_time={seconds}")
    folders = [f"-artifact_prefix={found}/", str(found), str(beginning)]
    atheris.Setup([sys.argv[0], *options, *folders], one, custom_mutator=mutated)
    atheris.Fuzz()
    return 0
