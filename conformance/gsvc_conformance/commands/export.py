"""``export``: write vectors in the forms of other projects."""

from argparse import ArgumentParser, Namespace
from collections import Counter
from pathlib import Path

from gsvc_base.cli.text import plural, show
from gsvc_base.errors import UsageError
from gsvc_conformance.commands import add_selection, add_vectors, selection
from gsvc_conformance.vector_folder import VectorFolder


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    form = parser.add_mutually_exclusive_group(required=True)
    form.add_argument(
        "--gltf", type=Path, metavar="OUT",
        help="the vectors of render_sum and render_frame as glTF files (KHR_gaussian_splatting) with the pictures that "
        "they must give, for renderers that know nothing of GSVC; docs/gltf.md tells what maps",
    )  # fmt: skip
    form.add_argument(
        "--fluster", type=Path, metavar="OUT",
        help="all deterministic frames of streams as test suites for fluster, with their streams and a decoder class",
    )  # fmt: skip
    add_vectors(parser)
    add_selection(parser)


def run(arguments: Namespace) -> int:
    """Write them; 0.

    Raises
    ------
    UsageError
        None of the selected vectors has that form.
    """
    return export_gltf(arguments) if arguments.gltf else export_fluster(arguments)


def export_fluster(arguments: Namespace) -> int:
    """Write the suites for fluster."""
    from gsvc_conformance.fluster import export, lines

    if str(selection(arguments)):
        raise UsageError("suites for fluster have all their vectors: leave the selection out")
    show(*lines(arguments.fluster, export(arguments.vectors, arguments.fluster)))
    return 0


def export_gltf(arguments: Namespace) -> int:
    """Write glTF files, and say how many vectors have none, and why."""
    from gsvc_conformance.gltf import OPERATIONS, export

    folder = VectorFolder(arguments.vectors)
    names = [name for name in folder.select(selection(arguments)) if name.split("/")[1] in OPERATIONS]
    if not names:
        raise UsageError(f"glTF files show pictures: select vectors of {' or '.join(OPERATIONS)}")
    written, others = export(folder.read(names), arguments.gltf)
    for reason, number in Counter(others.values()).items():
        show(f"left out: {plural(number, 'vector')}: each {reason}")
    show(f"{plural(len(written), 'picture')} in {arguments.gltf}; compare yours with: "
         f"python {arguments.gltf / 'compare_pictures.py'} FOLDER")  # fmt: skip
    return 0
