"""``list``: show the stages or the cases."""

import json
from argparse import ArgumentParser, Namespace
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from conformance.case import Case, cases
from conformance.commands import add_selection, add_vectors, selection
from conformance.selection import Selection, VectorFolder
from conformance.stage import Port, Stage, stages
from gsvc_lab.pages.markers import put_between
from gsvc_ref.cli.text import print_json, show
from gsvc_ref.errors import UsageError

BEGIN = "<!-- begin: python -m conformance list --markdown conformance/protocol.md -->"
END = "<!-- end -->"


def add_arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    add_vectors(parser)
    add_selection(parser)
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--cases", action="store_true", help="the cases, each with its title; so does --flag")
    form.add_argument("--json", action="store_true", help="stages and cases as JSON")
    form.add_argument(
        "--markdown", nargs="?", type=Path, const=Path("-"), metavar="FILE",
        help="the table of stages in Markdown; with FILE, put it between the markers of that file",
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
        listed = [case for case in cases().values() if chosen.holds(case.id)]
        if chosen.of_manifests:
            selected = set(VectorFolder(arguments.vectors).select(chosen))
            listed = [case for case in listed if case.id in selected]
        if not listed:
            raise UsageError(f"no case is selected by {chosen}")
        if not arguments.json:
            show(*(f"{case.id}: {case.title}" for case in listed))
        else:
            checks = checks_of(arguments.vectors)
            objects = {"stages": [_stage_object(stage, checks) for stage in stages().values()],
                       "cases": [_case_object(case) for case in listed]}  # fmt: skip
            print_json(objects)
    else:
        show(*_lines(_selected(chosen, arguments.vectors)))
    return 0


def _selected(chosen: Selection, folder: Path) -> Iterable[Stage]:
    """The stages that are selected, or of which vectors are."""
    names = set(stages())
    if chosen.levels or chosen.patterns or chosen.of_manifests:
        names = {name.split("/")[1] for name in VectorFolder(folder).select(chosen)}
    for stage in stages().values():
        there = stage.name in (chosen.stages or names) and stage.name in names
        if there and (not chosen.groups or stage.group in chosen.groups):
            yield stage


def _lines(shown: Iterable[Stage]) -> Iterable[str]:
    for stage in shown:
        yield f"{stage.name} ({stage.group}): {stage.title}"
        yield f"    ({'; '.join(map(port_text, stage.inputs))}) -> {'; '.join(map(port_text, stage.outputs))}"


def port_text(port: Port) -> str:
    """``parameters: f4 (N, 8)``."""
    return f"{port.name}: {port.type} {port.shape}".rstrip()


def checks_of(folder: Path) -> Mapping[tuple[str, str], set[str]]:
    """The classes of checks of each stage's outputs among the vectors of a folder; none where there are no vectors."""
    found: dict[tuple[str, str], set[str]] = {}
    for path in folder.glob("*/*/*/manifest.json"):
        manifest = json.loads(path.read_text(encoding="utf-8"))
        for name, entry in manifest["outputs"].items():
            found.setdefault((manifest["stage"], name), set()).add(entry["check"])
    return found


def markdown(folder: Path) -> str:
    """The table of all stages; the checks are those of a folder's vectors."""
    checks = checks_of(folder)
    lines = ["| stage | class | inputs | outputs: check |", "|---|---|---|---|"]
    for stage in stages().values():
        inputs = "<br>".join(f"`{port_text(port)}`" for port in stage.inputs)
        outputs = "<br>".join(
            f"`{port_text(port)}`: {', '.join(sorted(checks.get((stage.name, port.name), ())))}"
            for port in stage.outputs
        )
        lines.append(
            f"| `{stage.name}`: {stage.title} | {stage.group} | {inputs} | {outputs} |".replace("u1|u2", "u1\\|u2")
        )
    return "\n".join(lines)


def _stage_object(stage: Stage, checks: Mapping[tuple[str, str], set[str]]) -> dict[str, Any]:
    def port(entry: Port) -> dict[str, Any]:
        return {"name": entry.name, "type": entry.type, "shape": entry.shape}

    outputs = [{**port(out), "checks": sorted(checks.get((stage.name, out.name), ()))} for out in stage.outputs]
    return {"name": stage.name, "class": stage.group, "title": stage.title, "inputs": [port(p) for p in stage.inputs],
            "outputs": outputs, "equations": stage.equations, "rules": stage.rules}  # fmt: skip


def _case_object(case: Case) -> dict[str, Any]:
    return {"id": case.id, "title": case.title, "reason": case.reason, "rules": case.rules,
            "equations": case.equations, "flags": case.flags}  # fmt: skip
