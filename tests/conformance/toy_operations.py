"""Four small operations of four classes, each with one kind of check, and their vectors, for tests of the kit."""

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from gsvc_conformance.case import Case, Fault
from gsvc_conformance.expectations import Bounded, Decision, Exact, Expectation, Interval, Refusal
from gsvc_conformance.implementations import ModuleImplementation
from gsvc_conformance.operation import Operation, Values, _ports
from gsvc_conformance.runner import run_suite
from gsvc_conformance.vector import files_of, write
from gsvc_conformance.vector_folder import Selection, VectorFolder
from gsvc_conformance.verdicts import Report


def scale(values, factor):
    return {"scaled": values * np.float32(factor)}


def scale_oracle(values, factor) -> Mapping[str, Expectation]:
    exact = values.astype("f8") * factor
    return {"scaled": Bounded(exact, abs(exact) * 2.0**-23, groups=((0, 2),) if values.ndim == 2 else ())}


def paint(width, height, bit_depth):
    ramp = np.arange(height * width * 3).reshape(height, width, 3) % (1 << bit_depth)
    return {"frame": ramp.astype("|u1" if bit_depth == 8 else "<u2")}


def paint_oracle(width, height, bit_depth) -> Mapping[str, Expectation]:
    frame = paint(width, height, bit_depth)["frame"]
    return {"frame": Interval(frame, frame - (frame > 0), frame + (frame < 200))}


def halve(values):
    return {"half": np.rint(values / 2).astype("<i8"), "count": np.asarray(values.size, "<i8")}


def halve_oracle(values) -> Mapping[str, Expectation]:
    half = np.rint(values / 2).astype("<i8")
    return {"half": Decision(half, np.where(values == 5, 3, half)), "count": Exact(np.asarray(values.size, "<i8"))}


def parse(stream):
    error = "malformed R-3.1-1 8" if stream[:1] == b"x" else ""
    return {"count": np.asarray(0 if error else len(stream), "<i8"), "error": error}


def parse_oracle(stream) -> Mapping[str, Expectation]:
    answer = parse(stream)
    return {"count": Exact(answer["count"]), "error": Refusal(answer["error"])}


def _operation(group, function, oracle, inputs, outputs) -> Operation:
    title = f"The toy {function.__name__}."
    return Operation(function.__name__, group, title, _ports(inputs), _ports(outputs), ("9-1",), (), function, oracle)


OPERATIONS = {
    operation.name: operation
    for operation in (
        _operation("bitstream", parse, parse_oracle, "stream: stream", "count: i8 (); error: text"),
        _operation(
            "rendering", paint, paint_oracle, "width: int; height: int; bit_depth: int", "frame: u1|u2 (H, W, 3)"
        ),
        _operation("training", scale, scale_oracle, "values: f4 (N, P); factor: float", "scaled: f4 (N, P)"),
        _operation("quantization", halve, halve_oracle, "values: i8 (N,)", "half: i8 (N,); count: i8 ()"),
    )
}
REFERENCE = {"parse": parse, "paint": paint, "scale": scale, "halve": halve}

_TABLE = np.linspace(-3, 5, 14, dtype="<f4").reshape(7, 2)
INPUTS: dict[str, Values] = {
    "core/parse/three_bytes": {"stream": b"abc"},
    "core/paint/odd_size": {"width": 7, "height": 5, "bit_depth": 8},
    "core/scale/by_a_third": {"values": _TABLE, "factor": 1 / 3},
    "core/scale/by_two": {"values": _TABLE[:3], "factor": 2.0},
    "core/halve/one_to_six": {"values": np.arange(1, 7)},
    "uncommon/parse/empty": {"stream": b""},
    "uncommon/paint/ten_bits": {"width": 4, "height": 3, "bit_depth": 10},
    "stress/scale/nothing": {"values": _TABLE[:0], "factor": 1.0},
    "faulty/parse/bad_letter": {"stream": b"xyz"},
}


def case_of(name: str) -> Case:
    tier, operation, slug = name.split("/")
    fault = Fault("an x", "any other letter") if tier == "faulty" else None
    title, generator = f"The vector {slug}.", "toy_operations.py:INPUTS"
    return Case(name, tier, OPERATIONS[operation], title, "", (), (), (), fault, generator, lambda: None, {})


def write_vectors(folder: Path) -> Path:
    """Write all toy vectors to a folder."""
    made = {
        name: files_of(case_of(name), inputs, case_of(name).operation.oracle(**inputs))
        for name, inputs in INPUTS.items()
    }
    folder.mkdir(parents=True, exist_ok=True)
    write(folder, made)
    return folder


PROGRAM = """
import sys
from pathlib import Path
import numpy as np
sys.path.insert(0, {home!r})
import toy_operations
operation, inside, outside = sys.argv[-3:]
inputs = {{}}
for path in Path(inside).iterdir():
    value = path.read_bytes() if path.suffix == ".gsvc" else np.load(path)
    inputs[path.stem] = value.item() if getattr(value, "ndim", 1) == 0 else value
for name, value in toy_operations.REFERENCE[operation](**inputs).items():
    if isinstance(value, str):
        Path(outside, name + ".txt").write_text(value)
    else:
        np.save(Path(outside, name + ".npy"), value)
"""


def write_program(folder: Path, text: str) -> str:
    """A Python program in a folder, and the command that runs it."""
    path = folder / "program.py"
    path.write_text(text)
    return f"{sys.executable} {path}"


def good_program(folder: Path) -> str:
    """The command of a program that answers every toy operation."""
    return write_program(folder, PROGRAM.format(home=str(Path(__file__).parent)))


def judge(folder, implementation, selection=None, **options) -> Report:
    vectors = VectorFolder(folder)
    results = run_suite(implementation, vectors.read(vectors.select(selection or Selection())), **options)
    return Report({}, "run", "", [], results)


def module(**changes) -> ModuleImplementation:
    return ModuleImplementation("toy", {**REFERENCE, **changes})


def outcomes(report) -> dict:
    return {result.id: result.outcome for result in report.results}


def verdicts(report) -> dict:
    return {group.name: group.verdict for group in report.groups()}
