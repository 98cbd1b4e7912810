"""Whether many machines make the same bytes: ``python -m tests.machines [MACHINE ...]``.

Kinds of x86-64 are this machine with parts of it switched off; aarch64 and s390x are emulated (see `emulated`). Each
machine makes the parts of `digests`; every one must have the digest that is kept. Ends with a table, and exit code 1
if a digest differs or a machine could not run.
"""

import json
import os
import subprocess
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from time import perf_counter

from tests.machines.digests import OTHER_BYTES, PARTS, PROMISED, kept
from tests.machines.emulated import AARCH64, REPOSITORY, S390X, CannotRunError, Emulator, Processor

CACHE = Path(os.environ.get("GSVC_MACHINES", REPOSITORY / ".machines"))
"""Where the roots of emulated machines stay."""

PLAIN = ("NUMBA_DISABLE_JIT=1",)
"""Kernels as plain Python: where a processor is emulated, compiling takes longer than running."""


def dispatched() -> list[str]:
    """The kinds of processor that NumPy has loops of its own for, and this machine is, from the least."""
    from numpy._core import _multiarray_umath as multiarray

    return [name for name in multiarray.__cpu_dispatch__ if multiarray.__cpu_features__[name]]


@dataclass(frozen=True)
class Machine:
    """A machine, and what it makes.

    Attributes
    ----------
    name, title
        For the command line and the table.
    runs
        Some parts each, and the environment variables that they are made with.
    processor
        Which is emulated; None: that of this machine.
    nohup
        Whether hangups are ignored, as in a container or behind `nohup`.
    """

    name: str
    title: str
    runs: tuple[tuple[tuple[str, ...], tuple[str, ...]], ...]
    processor: Processor | None = None
    nohup: bool = False
    results: dict[str, dict[str, object]] = field(default_factory=dict)


def machines() -> list[Machine]:
    """All machines."""
    everything = tuple(part for part in PARTS if part not in ("some-vectors", "kills"))
    fewer = ("some-vectors", *everything[1:])
    slow = tuple(part for part in fewer if part != "encode")
    levels = dispatched()
    generic = (
        "NUMBA_CPU_NAME=generic", "NUMBA_CPU_FEATURES=", f"NPY_DISABLE_CPU_FEATURES={' '.join(levels)}",
        "OPENBLAS_CORETYPE=Nehalem", "OPENBLAS_NUM_THREADS=1", "NUMBA_NUM_THREADS=1",
        "GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F,-AVX512VL,-ERMS",
    )  # fmt: skip
    newest = [name for name in levels if "512" in name or name == "X86_V4"]
    haswell = (
        f"NPY_DISABLE_CPU_FEATURES={' '.join(newest)}", "OPENBLAS_CORETYPE=Haswell", "OPENBLAS_NUM_THREADS=2",
        "NUMBA_NUM_THREADS=2",
    )  # fmt: skip
    return [
        Machine("generic", "x86-64-v2 (no AVX, no FMA, one thread)", (((*everything, "kills"), generic),)),
        # Without newer ones it is the machine as it is, of which the tests make all vectors.
        Machine("haswell", "x86-64-v3 (AVX2 and FMA, two threads)", ((everything if newest else fewer, haswell),)),
        Machine(
            "native", f"x86-64 as it is ({levels[-1] if levels else 'v2'}), nohup", ((everything, ()),), nohup=True
        ),
        Machine("interpreted", "x86-64, kernels as plain Python", ((slow, PLAIN),)),
        Machine("aarch64", "aarch64, emulated", ((slow, PLAIN), (("encode",), ())), AARCH64),
        Machine("s390x", "s390x (big-endian), emulated", ((slow, PLAIN),), S390X),
    ]


def make(machine: Machine, cache: Path) -> Iterator[dict[str, object]]:
    """What a machine makes, part by part: ``part``, ``sha256`` and ``seconds``."""
    for parts, settings in machine.runs:
        words = ["-m", "tests.machines.digests", "--json", *parts]
        with TemporaryDirectory() as kernels:
            if machine.processor is not None:
                emulator = Emulator(machine.processor, cache)
                emulator.prepare()
                command, environment = emulator.command(["python3", *words], settings)
            else:
                command = ["nohup"] * machine.nohup + [sys.executable, *words]
                environment = os.environ | {"NUMBA_CACHE_DIR": kernels} | dict(text.split("=", 1) for text in settings)
            yield from lines(command, environment)


def lines(command: list[str], environment: Mapping[str, str]) -> Iterator[dict[str, object]]:
    """The lines of JSON that a command prints; raises CannotRunError if it fails."""
    with (
        TemporaryFile("w+") as said,
        subprocess.Popen(
            command, env=environment, cwd=REPOSITORY, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=said,
            text=True,
        ) as process,
    ):  # fmt: skip
        yield from map(json.loads, process.stdout)
        if process.wait() not in (0, OTHER_BYTES):
            said.seek(0)
            raise CannotRunError(f"the command ended with {process.returncode}: {said.read().strip()[-1500:]}")


def fill(machine: Machine, cache: Path, wanted: Mapping[str, str]) -> str:
    """Run a machine, telling each part; what went wrong, or nothing."""
    try:
        for made in make(machine, cache):
            same = made["sha256"] == wanted.get(str(made["part"]))
            machine.results[str(made["part"])] = {**made, "same": same}
            print(f"{machine.name}: {made['sha256']}  {made['part']}  {made['seconds']} s"
                  f"{'' if same else '  is not what is kept'}", flush=True)  # fmt: skip
    except CannotRunError as error:
        print(f"{machine.name}: NOT RUN: {error}", flush=True)
        return str(error)
    missing = {part for parts, _ in machine.runs for part in parts} - machine.results.keys()
    return f"{', '.join(sorted(missing))} missing" if missing else ""


def table(some: list[Machine]) -> Iterator[str]:
    """A line for each machine: whether each part is the same, and in how many seconds it was made."""
    width = max(len(machine.title) for machine in some)
    yield " " * width + "".join(f" {part:>13}" for part in PARTS)
    for machine in some:
        yield f"{machine.title:<{width}}" + "".join(f" {cell(machine.results.get(part)):>13}" for part in PARTS)


def cell(made: Mapping[str, object] | None) -> str:
    """What the table says of a part."""
    if made is None:
        return "-"
    word = "same" if made["same"] else "DIFFERS" if made["part"] in PROMISED else "other"
    return f"{word} {made['seconds']:>6} s"


def main() -> int:
    every = machines()
    parser = ArgumentParser(
        prog="python -m tests.machines", description=__doc__, formatter_class=RawDescriptionHelpFormatter
    )
    names = ", ".join(machine.name for machine in every)
    parser.add_argument("machines", nargs="*", metavar="MACHINE", help=f"of {names} (default: all)")
    parser.add_argument("--cache", type=Path, default=CACHE, metavar="DIR", help="where emulated machines stay")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="machines at a time (default: 2)")
    arguments = parser.parse_args()
    if unknown := set(arguments.machines) - {machine.name for machine in every}:
        parser.error(f"there is no machine {unknown.pop()!r}; there are {names}")
    some = [machine for machine in every if machine.name in (arguments.machines or [m.name for m in every])]
    start, wanted = perf_counter(), kept()
    # The slowest begin first.
    with ThreadPoolExecutor(arguments.jobs) as pool:
        order = sorted(some, key=lambda machine: machine.processor is None)
        faults = list(pool.map(lambda machine: fill(machine, arguments.cache.resolve(), wanted), order))
    print("", *table(some), f"{perf_counter() - start:.0f} s", sep="\n")
    promised = (machine.results[part] for machine in some for part in machine.results.keys() & set(PROMISED))
    good = not any(faults) and all(made["same"] for made in promised)
    print("every machine has the same bytes" if good else "NOT every machine has the same bytes")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
