"""``list``: show the operations or the vectors."""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from gsvc_base.cli.text import print_json, show
from gsvc_base.pages.markers import put_between
from gsvc_conformance.commands import add_selection, add_set, add_vectors, selection, vectors_of
from gsvc_conformance.operation import Operation, Port, operations
from gsvc_conformance.vector import files_in, manifests_in
from gsvc_conformance.vector_folder import Selection

BEGIN = "<!-- begin: gsvc-conformance list --markdown conformance/protocol.md -->"
END = "<!-- end -->"
SHOWN = ("id", "title", "reason", "rules", "equations", "flags")
"""What is shown of a vector, of its manifest."""


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    add_vectors(parser)
    add_set(parser)
    add_selection(parser)
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--cases", action="store_true", help="the vectors, each with its title; so does --flag")
    form.add_argument("--json", action="store_true", help="operations and vectors as JSON")
    form.add_argument(
        "--markdown", nargs="?", type=Path, const=Path("-"), metavar="FILE",
        help="the table of operations in Markdown; with FILE, put it between the markers of that file",
    )  # fmt: skip


def run(arguments: Namespace) -> int:
    """Show them; 0."""
    chosen = selection(arguments)
    if arguments.markdown:
        if str(arguments.markdown) == "-":
            show(markdown(arguments.vectors))
        else:
            put_between(arguments.markdown, BEGIN, END, markdown(arguments.vectors))
    elif arguments.json or arguments.cases or chosen.flags:
        folder = vectors_of(arguments)
        listed = [folder.manifest(name) for name in folder.select(chosen)]
        if not arguments.json:
            show(*(f"{manifest['id']}: {manifest['title']}" for manifest in listed))
        else:
            checks = checks_of(arguments.vectors)
            objects = {"operations": [_operation_object(operation, checks) for operation in operations().values()],
                       "cases": [{field: manifest[field] for field in SHOWN} for manifest in listed]}  # fmt: skip
            print_json(objects)
    else:
        show(*_lines(_selected(chosen, arguments)))
    return 0


def _selected(chosen: Selection, arguments: Namespace) -> Iterable[Operation]:
    """The operations that are selected, or of which vectors are."""
    names = set(operations())
    if chosen.tiers or chosen.patterns or chosen.of_manifests:
        names = {name.split("/")[1] for name in vectors_of(arguments).select(chosen)}
    for operation in operations().values():
        there = operation.name in (chosen.operations or names) and operation.name in names
        if there and (not chosen.groups or operation.group in chosen.groups):
            yield operation


def _lines(shown: Iterable[Operation]) -> Iterable[str]:
    for operation in shown:
        yield f"{operation.name} ({operation.group}): {operation.title}"
        yield f"    ({'; '.join(map(port_text, operation.inputs))}) -> {'; '.join(map(port_text, operation.outputs))}"


def port_text(port: Port) -> str:
    """``parameters: f4 (N, 8)``."""
    return f"{port.name}: {port.type} {port.shape}".rstrip()


def checks_of(folder: Path) -> Mapping[tuple[str, str], set[str]]:
    """The classes of checks of each operation's outputs among the vectors of a folder; empty without vectors."""
    found: dict[tuple[str, str], set[str]] = {}
    for manifest in manifests_in(files_in(folder)).values():
        for name, entry in manifest["outputs"].items():
            found.setdefault((manifest["operation"], name), set()).add(entry["check"])
    return found


def markdown(folder: Path) -> str:
    """The table of all operations; the checks are those of a folder's vectors."""
    checks = checks_of(folder)
    lines = ["| operation | class | inputs | outputs: check |", "|---|---|---|---|"]
    for operation in operations().values():
        inputs = "<br>".join(f"`{port_text(port)}`" for port in operation.inputs)
        outputs = "<br>".join(
            f"`{port_text(port)}`: {', '.join(sorted(checks.get((operation.name, port.name), ())))}"
            for port in operation.outputs
        )
        lines.append(
            f"| `{operation.name}`: {operation.title} | {operation.group} | {inputs} | {outputs} |".replace(
                "u1|u2", "u1\\|u2"
            )
        )
    return "\n".join(lines)


def _operation_object(operation: Operation, checks: Mapping[tuple[str, str], set[str]]) -> dict[str, Any]:
    def port(entry: Port) -> dict[str, Any]:
        return {"name": entry.name, "type": entry.type, "shape": entry.shape}

    outputs = [{**port(out), "checks": sorted(checks.get((operation.name, out.name), ()))} for out in operation.outputs]
    return {
        "name": operation.name,
        "class": operation.group,
        "title": operation.title,
        "inputs": [port(p) for p in operation.inputs],
        "outputs": outputs,
        "equations": operation.equations,
        "rules": operation.rules,
    }
