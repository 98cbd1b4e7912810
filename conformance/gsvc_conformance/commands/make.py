"""``make``: make a vector of your own from inputs of an operation."""

import shlex
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gsvc_base.cli.text import plural, show
from gsvc_base.errors import UsageError
from gsvc_conformance.expectations import Bounded, Decision, Expectation, Interval, Refusal
from gsvc_conformance.operation import operations
from gsvc_conformance.spelling import question

if TYPE_CHECKING:
    from gsvc_conformance.making import OwnVector


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.epilog = (
        "INPUTS is an .npz file with the inputs by name; a folder of NAME.npy and NAME.gsvc, such as DIR/ID/in, which "
        "run --keep DIR leaves of a failure; or a .gsvc file, the stream of an operation that takes nothing else. "
        "gsvc-conformance list shows the inputs of each operation. OUT may have vectors of yours: "
        "gsvc-conformance run --vectors OUT judges all of them."
    )
    parser.add_argument("operation", metavar="OPERATION", help="such as render_sum; gsvc-conformance list names them")
    parser.add_argument("inputs", type=Path, metavar="INPUTS", help="an .npz file, a folder of .npy files, or a stream")
    parser.add_argument("folder", type=Path, metavar="OUT", help="the folder of your vectors; made if it is not there")
    parser.add_argument("--id", metavar="NAME", help="the last part of the vector's id (default: the name of INPUTS)")
    parser.add_argument("--title", metavar="TEXT", help="what it shows, a sentence (default: its dimensions)")
    parser.add_argument("--replace", action="store_true", help="take the place of the vector with that id")
    parser.add_argument(
        "--mutants", action="store_true", help="try which mutants of spec.md the vector finds, and note it; seconds"
    )


def run(arguments: Namespace) -> int:
    """Make the vector and say what it holds; 0, or 1 if gsvc_ref's own answer is not within it.

    Raises
    ------
    UsageError
        There is no such operation, or the inputs are none of it.
    """
    if arguments.operation not in operations():
        near = question(arguments.operation, operations()) or "; gsvc-conformance list names them"
        raise UsageError(f"there is no operation {arguments.operation!r}{near}")
    if not arguments.inputs.exists():
        raise UsageError(f"there is no {arguments.inputs}: give an .npz file, a folder of .npy files, or a stream")
    import gsvc_ref  # noqa: F401 - if it is missing, this is said before any work
    from gsvc_conformance.fitting import read_inputs
    from gsvc_conformance.making import TakenError, add_vectors, make_vector

    given = read_inputs(operations()[arguments.operation], arguments.inputs)
    vector = make_vector(
        arguments.operation, given,
        title=arguments.title, id=arguments.id or default_id(arguments.inputs), mutants=arguments.mutants,
    )  # fmt: skip
    ratio, fault = reference_verdict(vector)
    if fault:
        show(f"gsvc_ref itself fails this vector ({fault}): please report it with the inputs. Nothing was written")
        return 1
    try:
        add_vectors(arguments.folder, [vector], replace=arguments.replace)
    except TakenError as error:
        raise UsageError(f"{error.taken}: give another --id, or --replace") from None
    show(*description(vector, ratio), f"added to the folder {arguments.folder}; judge an implementation with:",
         f"    gsvc-conformance run --vectors {shlex.quote(str(arguments.folder))} --module mine")  # fmt: skip
    return 0


def default_id(inputs: Path) -> str:
    """The name of the inputs, made one of a vector; of a folder ``in``, that of the folder around it."""
    path = inputs.resolve()
    name = path.parent.name if path.is_dir() and path.name == "in" else path.name if path.is_dir() else path.stem
    kept = "".join(letter if letter.isascii() and (letter.isalnum() or letter in "_.-") else "_" for letter in name)
    return kept.lstrip(".-") or "inputs"


def reference_verdict(vector: "OwnVector") -> tuple[float | None, str]:
    """The worst error/bound ratio of gsvc_ref's answer, if there is one, and what is wrong with it, if anything."""
    from gsvc_conformance.commands.run import reference_implementation
    from gsvc_conformance.runner import judge_vector

    result = judge_vector(reference_implementation(), vector).result
    return result.ratio, "" if result.outcome == "pass" else f"{result.outcome}: {result.message}"


def description(vector: "OwnVector", ratio: float | None) -> Iterator[str]:
    """What a vector holds, a line for each output."""
    size = sum(map(len, vector.files.values()))
    yield f"{vector.id}: {vector.manifest['title']}; level {vector.level}; {plural(size, 'byte')}"
    for name, expectation in vector.expected.items():
        yield f"    {name}: {_expectation_words(expectation)}"
    if ratio is not None:
        yield f"    gsvc_ref's own answer: at most {ratio:.2g} of what is allowed"
    if "kills" in vector.manifest:
        found = vector.manifest["kills"]
        yield f"    finds {plural(len(found), 'mutant')}" + (f": {', '.join(found)}" if found else "")


def _expectation_words(expectation: Expectation) -> str:
    if isinstance(expectation, Refusal):
        return f"refusal, {expectation.value}" if expectation.value else "no refusal: the stream is read to its end"
    form = f"{expectation.check}, {expectation.value.shape}"
    if isinstance(expectation, Bounded) and expectation.bound.size:
        least, most = float(expectation.bound.min()), float(expectation.bound.max())
        return f"{form}, bounds {least:.3g} to {most:.3g}"
    if isinstance(expectation, Interval):
        return f"{form}, {_open(expectation.lowest != expectation.highest)} may be one of several"
    if isinstance(expectation, Decision):
        other = expectation.value if expectation.alternative is None else expectation.alternative
        return f"{form}, {_open(other != expectation.value)} may be the other value"
    return form


def _open(differ: np.ndarray) -> str:
    return f"{np.count_nonzero(differ)} of {differ.size} elements"
