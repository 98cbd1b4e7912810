"""``python -m gsvc_lab.benchmarks.adapters``: the same work on the same machine for every implementation here.

Each implementation runs in a process of its own and is called through its operations, as the conformance kit calls
it: copies to a device and back count. One is measured after the other, so only large differences mean something. The
results are a Markdown table and the file

    {
      "form": "speeds/1",
      "date": "2026-01-31",
      "machine": {"cpu": "...", "cores": 2, ...},                      what benchmarks.timing.environment says
      "works": {"render_sum_1080p": "render_sum, 1920x1080, ...", ...},   id: what it is, in the order of the table
      "implementations": [                                                in the order of the table
        {
          "implementation": "gsvc_conformance.adapters.pytorch",             as in the kit's report; ours is "gsvc_ref"
          "settings": {"GSVC_WEB_RENDERER": "webgl2"},                  environment variables that it was started with
          "environment": {"device": "...", ...},                        what its environment() says; {} without one
          "seconds": {"render_sum_1080p": {"median": 0.1, "low": 0.1, "high": 0.2, "calls": 12}, ...},
          "missing": {"adan_step": "there is no function adan_step", ...}   works that it does not do, and why
        }
      ]
    }

Every work is in `seconds` or in `missing`; `low` and `high` are quartiles. An implementation that cannot be imported is
in neither table nor file; which and why is printed. Where a module stands in the file more than once, with other
`settings`, the report of the kit that belongs to it is the one with the same `environment`.

What `make gpu` measures has the same form, in a file of its own such as docs/reports/speeds-nvidia-h200.json: `machine`
has the entries `card` and `driver`, of `seconds` only `median` is needed, and nothing has to be `missing`. The works in
the list `rates`, which may be left out, are shown as frames per second. Times of an implementation whose `environment`
names a device then appear beside no card: a driver for CPUs tells nothing of a GPU.
"""

import argparse
import copy
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np

import gsvc_ref
from gsvc_base.draws import Draws
from gsvc_base.processors import processors
from gsvc_lab.benchmarks.material import CACHE, trained
from gsvc_lab.benchmarks.results import Table
from gsvc_lab.benchmarks.timing import Spread
from gsvc_lab.machine import environment
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.main.cells import halving_count
from gsvc_ref.main.codes import MainCodes
from gsvc_ref.main.densities import Densities, Density
from gsvc_ref.main.frames import code_run
from gsvc_ref.main.kept_state import MainState
from gsvc_ref.testing import write_stream
from gsvc_ref.testing.random_main_streams import RandomRun

VECTORS: Final = Path(__file__).parents[2] / "vectors"

OURS: Final = "gsvc_ref"

CONTENDERS: Final[Sequence[tuple[str, Mapping[str, str]]]] = (
    (OURS, {}),
    ("gsvc_conformance.adapters.web", {"GSVC_WEB_RENDERER": "webgl2"}),
    ("gsvc_conformance.adapters.web", {"GSVC_WEB_RENDERER": "webgpu"}),
)
"""Modules to measure on any machine, with environment variables to start them with; `make gpu` measures the others."""

WARM_UP: Final = 2
"""Calls that are not counted: compilers, caches and clocks of a device."""

FEWEST: Final = 5
MOST: Final = 100

PATIENCE: Final = 900
"""Seconds after which an implementation is given up."""


@dataclass(frozen=True)
class Work:
    """Something to measure."""

    sentence: str  # description of it
    operation: str  # whose function is called
    inputs: Callable[[], dict[str, Any]]  # makes the inputs


@dataclass
class Measured:
    """The times of one implementation; its fields are those of the file."""

    implementation: str
    settings: Mapping[str, str]
    environment: Mapping[str, str]
    seconds: dict[str, dict[str, float]] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Such as ``web (webgl2)``."""
        name = self.implementation.rpartition(".")[2]
        return f"{name} ({', '.join(self.settings.values())})" if self.settings else name


def _splats(width: int, height: int, count: int) -> dict[str, Any]:
    return {"parameters": trained(width, height, count).splats.to_array(), "width": width, "height": height}


def _with_residual(width: int, height: int, count: int) -> dict[str, Any]:
    case = trained(width, height, count)
    return {"parameters": case.splats.to_array(), "residual": case.target - np.float32(0.5)}


def _optimizer_state(rows: int, columns: int) -> dict[str, Any]:
    rng = np.random.default_rng(0)
    names = ("parameters", "gradients", "m", "v", "n", "previous")
    state: dict[str, Any] = {name: rng.random((rows, columns), np.float32) for name in names}
    each = {"rates": np.full(columns, 1e-3, np.float32), "units": np.ones(columns, np.float32)}
    betas = {"beta1": 0.98, "beta2": 0.92, "beta3": 0.99, "epsilon": 1e-8}
    return {**state, "steps": rng.integers(0, 100, rows), **each, **betas}


def _stream(vector: str) -> dict[str, Any]:
    return {"stream": (VECTORS / vector / "stream.gsvc").read_bytes()}


DENSITIES: Final = (
    Density(0, 8, 90), Density(1, 6, 10, 6), Density(1, 5, 8, 5), Density(0, 20, 20, -8), Density(1, 21, 2, 1),
    Density(0, 24, -3),
)  # fmt: skip
"""Densities of luma, both chromas, size, aspect and shear, such as a fit has them."""


def _main_stream(count: int, lane_exponent: int) -> dict[str, Any]:
    """A stream of profile `main`: an I-frame and four P-frames that change its splats; symbols are random."""
    header = SequenceHeader(profile=1, level=4, width=352, height=288, max_lane_exponent=12)
    shapes = tuple(3 * i % 8 for i in range(halving_count(header.width, header.height)))
    rng, state = Draws(count), MainState.initial(header.width, header.height)
    densities = Densities(DENSITIES, shapes)
    state, frames = replace(state, densities=densities), []
    plans = [MainCodes(type="I", quantizer=24, lane_exponent=lane_exponent, densities=densities)]
    plans += [MainCodes(type="P", quantizer=24, lane_exponent=lane_exponent, motion_cell=3)] * 4
    for codes in plans:
        new = count if codes.type == "I" else 0
        state, codes = code_run(RandomRun(rng, "likely"), state, codes, new)
        frames.append(codes)
    return {"stream": write_stream(header, frames, index=False)}


def _of_lanes(count: int, lane_exponent: int) -> Work:
    lanes = f"{2**lane_exponent} lanes" if lane_exponent else "1 lane"
    sentence = f"read_main_stream, 352x288, an I-frame and four P-frames of {count:,} splats, {lanes}"
    return Work(sentence, "read_main_stream", lambda: _main_stream(count, lane_exponent))


WORKS: Final = {
    "render_sum_1080p": Work(
        "render_sum, 1920x1080, 10,000 trained splats", "render_sum", lambda: _splats(1920, 1080, 10_000)
    ),
    "render_sum_cif": Work("render_sum, 352x288, 2,000 trained splats", "render_sum", lambda: _splats(352, 288, 2000)),
    "render_gradients_cif": Work(
        "render_gradients, 352x288, 2,000 trained splats", "render_gradients", lambda: _with_residual(352, 288, 2000)
    ),
    "adan_step": Work("adan_step, 10,000 rows of 9 parameters", "adan_step", lambda: _optimizer_state(10_000, 9)),
    "decode_stream_small": Work(
        "decode_stream, 4 frames of 21x15: what a frame costs at least",
        "decode_stream",
        lambda: _stream("core/decode_stream/moving_frames"),
    ),
    "decode_stream_full_work": Work(
        "decode_stream, one frame of 256x256, 512 splats that all cover it: the work that level 1 allows",
        "decode_stream",
        lambda: _stream("core/reconstruct_stream/as_much_work_as_allowed"),
    ),
    **{
        f"read_main_stream_{count}_{2**lane_exponent}": _of_lanes(count, lane_exponent)
        for count in (2000, 10_000)
        for lane_exponent in (0, 5, 8)
    },
}
"""Works by id."""


def seconds_of(function: Callable[..., object], inputs: Mapping[str, Any], seconds: float) -> list[float]:
    """The time of each call, after calls that do not count; each gets inputs of its own, since it may change them."""
    times: list[float] = []
    end = np.inf
    while len(times) < WARM_UP + FEWEST or (len(times) < WARM_UP + MOST and time.perf_counter() < end):
        fresh = copy.deepcopy(dict(inputs))
        begin = time.perf_counter()
        function(**fresh)
        times.append(time.perf_counter() - begin)
        if len(times) == WARM_UP:
            end = time.perf_counter() + seconds
    return times[WARM_UP:]


def measure(
    functions: Mapping[str, Callable[..., Any]], works: Mapping[str, Work], seconds: float, into: Measured
) -> None:
    """Measure what there is a function for; what is not done is noted with its reason."""
    for name, work in works.items():
        function = functions.get(work.operation)
        if function is None:
            into.missing[name] = f"there is no function {work.operation}"
            continue
        try:
            with np.errstate(all="ignore"):
                times = seconds_of(function, work.inputs(), seconds)
        except NotImplementedError as error:
            into.missing[name] = str(error) or f"{work.operation} raises NotImplementedError"
        except Exception as error:  # whatever a driver or a compiler meets
            into.missing[name] = f"{type(error).__name__}: {error}"
        else:
            into.seconds[name] = {**asdict(Spread.of(times)), "calls": len(times)}


def measure_here(module: str, settings: Mapping[str, str], works: Mapping[str, Work], seconds: float) -> Measured:
    """Measure an implementation in this process.

    An ImportError says that it cannot be imported.
    """
    functions: Mapping[str, Any]
    if module == OURS:
        functions = {work.operation: getattr(gsvc_ref, work.operation) for work in works.values()}
    else:
        functions = vars(import_module(module))
    tell = functions.get("environment", dict)
    result = Measured(module, settings, tell())
    measure(functions, works, seconds, result)
    return result


def measure_apart(module: str, settings: Mapping[str, str], works: Sequence[str], seconds: float) -> Measured | str:
    """Measure an implementation in a process of its own, or say why that was not possible."""
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        words = [
            sys.executable,
            "-m",
            "gsvc_lab.benchmarks.adapters",
            module,
            "--seconds",
            f"{seconds:g}",
            "--here",
            str(answer),
        ]
        words += [word for name in settings for word in ("--setting", name)]
        words += [word for name in works for word in ("--work", name)]
        try:
            run = subprocess.run(
                words, env={**os.environ, **settings}, timeout=PATIENCE, capture_output=True, text=True, check=False
            )
        except subprocess.TimeoutExpired:
            return f"no end within {PATIENCE} s"
        if run.returncode or not answer.exists():
            lines = [line for line in run.stderr.splitlines() if line.strip()]
            return lines[-1] if lines else f"it ended with {run.returncode}"
        return Measured(**json.loads(answer.read_text(encoding="utf-8")))


def table(machine: Mapping[str, Any], works: Mapping[str, Work], results: Sequence[Measured]) -> Table:
    """A row for each work, a column for each implementation."""
    rows = []
    for name, work in works.items():
        cells = [_cell(result.seconds.get(name)) for result in results]
        rows.append([work.sentence, *cells])
    text = (
        f"Milliseconds, median (quartiles) of calls of operations, with all copies; {machine['cpu']}, "
        f"{machine['cores']} cores, {machine['system']}, Python {machine['python']}."
    )
    return Table(text, ["work", *(result.name for result in results)], rows)


def _cell(seconds: Mapping[str, float] | None) -> str:
    if seconds is None:
        return "–"
    low, median, high = (1000 * seconds[name] for name in ("low", "median", "high"))
    digits = 0 if median >= 100 else 1 if median >= 10 else 2
    return Spread(median, low, high).text(digits)


def main(words: Sequence[str] | None = None) -> None:
    """Measure, print, and keep the numbers."""
    parser = argparse.ArgumentParser(
        prog="python -m gsvc_lab.benchmarks.adapters", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument(
        "modules", nargs="*", metavar="MODULE", help="as for `gsvc-conformance run`; default: gsvc_ref and the web page"
    )
    parser.add_argument("--work", action="append", choices=tuple(WORKS), help="only this one; may be repeated")
    parser.add_argument("--seconds", type=float, default=5.0, metavar="S", help="for each work, about (5)")
    parser.add_argument("--json", type=Path, default=CACHE / "adapters.json", metavar="FILE", help="where numbers go")
    parser.add_argument("--here", type=Path, help=argparse.SUPPRESS)  # measure one module in this process
    parser.add_argument("--setting", action="append", default=[], help=argparse.SUPPRESS)  # given by the process above
    arguments = parser.parse_args(words)
    works = {name: work for name, work in WORKS.items() if not arguments.work or name in arguments.work}
    if arguments.here is not None:
        settings = {name: os.environ[name] for name in arguments.setting}
        try:
            result = measure_here(arguments.modules[0], settings, works, arguments.seconds)
        except ImportError as error:
            sys.exit(f"{type(error).__name__}: {error}")
        arguments.here.write_text(json.dumps(asdict(result)), encoding="utf-8")
        return
    for work in works.values():
        work.inputs()  # trains splats where there are none yet
    chosen = [one for one in CONTENDERS if not arguments.modules or one[0] in arguments.modules]
    chosen += [(module, {}) for module in arguments.modules if module not in dict(CONTENDERS)]
    results = []
    for module, variables in chosen:
        outcome = measure_apart(module, variables, tuple(works), arguments.seconds)
        if isinstance(outcome, str):
            print(f"{module} is left out: {outcome}", file=sys.stderr, flush=True)
            continue
        for name, reason in outcome.missing.items():
            print(f"{outcome.name}, {name}: {reason}", file=sys.stderr, flush=True)
        results.append(outcome)
        machine = write(works, results, arguments.json)
    if not results:
        sys.exit("nothing was measured")
    print(table(machine, works, results).markdown())


def write(works: Mapping[str, Work], results: Sequence[Measured], json_file: Path) -> dict[str, Any]:
    """Write the file, and return what it says of the machine."""
    machine = environment(processors())
    del machine["threads"]  # each implementation takes as many as it likes
    numbers = {
        "form": "speeds/1",
        "date": datetime.now(UTC).date().isoformat(),
        "machine": machine,
        "works": {name: work.sentence for name, work in works.items()},
        "implementations": [asdict(result) for result in results],
    }
    json_file.parent.mkdir(parents=True, exist_ok=True)
    json_file.write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")
    return machine


if __name__ == "__main__":
    main()
