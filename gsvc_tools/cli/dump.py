"""``gsvc dump``: every syntax element of a `.gsvc` file with its place, its value and the rules about it."""

import re
from argparse import ArgumentTypeError, Namespace
from typing import TYPE_CHECKING, Any, Final

from gsvc_base.cli.arguments import frame_range
from gsvc_base.cli.errors import EXIT_DATA, say
from gsvc_base.cli.progress import ProgressDisplay
from gsvc_base.cli.text import show, to_json
from gsvc_base.errors import GsvcError, UsageError
from gsvc_ref.cli.files import STDIO, check_input, display_name
from gsvc_tools.cli.info import error_object

if TYPE_CHECKING:
    from gsvc_tools.listing import Entry, Place

GSVC_DUMP: Final = "gsvc dump"
LINES_AT_ONCE: Final = 512
SHOWN_AS_THEY_ARE: Final = 6
"""Elements of a run whose values are all shown; of a longer one, their number and the least and the greatest."""
BYTES_SHOWN: Final = 16
HEAD: Final = f"{'byte':>9} {'bit':>3} {'bits':>8}  {'element':<52} value"


def add_command(commands: Any) -> None:
    """Add the command to the subparsers of ``gsvc``."""
    parser = commands.add_parser(
        "dump",
        help="list the syntax elements of a .gsvc file, also of a damaged one",
        description="List the syntax elements of a .gsvc file by their names in spec.md, as far as it is sound.",
        allow_abbrev=False,
    )
    parser.set_defaults(run=run)
    parser.add_argument("input", metavar="FILE", help="a .gsvc file, or - for standard input")
    parser.add_argument(
        "--at", metavar="BIT", type=bit_offset, help="name the element that holds this bit: 4255, or 531:7 (byte:bit)"
    )
    parser.add_argument("--frames", metavar="A:B", type=frame_range, help="only the chunks of frames A to B - 1")
    parser.add_argument("--all", action="store_true", help="each symbol, frequency, state, word, ... on its own line")
    parser.add_argument("--json", action="store_true", help="print a JSON object for each element, one a line")


def bit_offset(text: str) -> int:
    """``4255`` is bit 4255, ``531:7`` bit 7 of byte 531."""
    match = re.fullmatch(r"(\d{1,18})(?::([0-7]))?", text, re.ASCII)
    if match is None:
        raise ArgumentTypeError(f"{text!r} is neither a bit, such as 4255, nor a byte and its bit, such as 531:7")
    return int(match[1]) if match[2] is None else 8 * int(match[1]) + int(match[2])


def run(arguments: Namespace) -> int:
    """Print the elements; 0, or 1 for a damaged stream."""
    if arguments.at is not None and (arguments.frames or arguments.all):
        raise UsageError("--at names one element; drop --frames and --all")
    check_input(arguments.input)
    from gsvc_tools.cli.reading import reading

    with reading(GSVC_DUMP, arguments.input, silent=arguments.json):
        return _at(arguments) if arguments.at is not None else _list(arguments)


def _list(arguments: Namespace) -> int:
    from gsvc_tools.listing import list_elements

    with _Lines(arguments) as lines:
        if not arguments.json:
            lines.add(HEAD)
        fault, at_fault = list_elements(_source(arguments.input), lines.entry, *(arguments.frames or (0, None)))
        if fault is not None:
            lines.fault(fault, at_fault)
    return 0 if fault is None else _report(arguments.input, fault)


def _at(arguments: Namespace) -> int:
    from gsvc_tools.listing import place_of

    place = place_of(_source(arguments.input), arguments.at)
    if place.entry is None and place.fault is None:
        end = 0 if place.before is None else place.before.bit + place.before.bits
        raise UsageError(
            f"bit {arguments.at} is after the end: {display_name(arguments.input)} has the bits 0 to {end - 1}"
        )
    with _Lines(arguments) as lines:
        if arguments.json:
            found = {name: entry and entry_object(entry) for name, entry in _neighbours(place).items()}
            lines.add(_json({"at": arguments.at} | found))
        else:
            lines.add(*_place_lines(place, arguments.at))
        if place.fault is not None:
            lines.fault(place.fault, place.at_fault)
    return 0 if place.fault is None else _report(arguments.input, place.fault)


def _source(name: str) -> Any:
    import sys

    return sys.stdin.buffer if name == STDIO else name


def _report(name: str, fault: GsvcError) -> int:
    say(GSVC_DUMP, f"{display_name(name)} is damaged: {fault}")
    return EXIT_DATA


class _Lines:
    """The lines of the command, printed some at a time, beside a display of progress."""

    def __init__(self, arguments: Namespace) -> None:
        self._json, self._all = arguments.json, arguments.all
        self._lines: list[str] = []
        self._progress = ProgressDisplay(quiet=arguments.json)
        self._bits = 8 * _size(arguments.input)

    def add(self, *lines: str) -> None:
        """Print lines, perhaps later."""
        self._lines += lines
        if len(self._lines) >= LINES_AT_ONCE:
            self._print()

    def entry(self, entry: "Entry") -> None:
        """Print an element, or a run in one line or in many."""
        for item in entry.items() if self._all else (entry,):
            self.add(_json(entry_object(item)) if self._json else entry_line(item))
        self._progress.update("listing", entry.bit, self._bits or None)

    def fault(self, fault: GsvcError, at_fault: "Entry | None") -> None:
        """Print a fault and the element that it is about."""
        if self._json:
            about = at_fault and entry_object(at_fault) | description_object(at_fault)
            self.add(_json({"fault": error_object(fault), "element": about}))
        else:
            self.add("", *fault_lines(fault, at_fault))

    def _print(self) -> None:
        if self._lines:
            self._progress.close()
            show(*self._lines)
            self._lines.clear()

    def __enter__(self) -> "_Lines":
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.close()
        self._print()


def _size(name: str) -> int:
    """The bytes of a file; 0 of standard input."""
    from pathlib import Path

    return 0 if name == STDIO else Path(name).stat().st_size


def _json(value: Any) -> str:
    import json

    return json.dumps(to_json(value), allow_nan=False)


def entry_object(entry: "Entry") -> dict[str, Any]:
    """An element, or a run of them, for JSON."""
    from gsvc_base.syntax import rules_of

    value = entry.value
    described = {
        "bit": entry.bit, "bits": entry.bits, "element": entry.full_name, "name": entry.name, "index": entry.first,
        "part_of": entry.of or None, "block": entry.block or None, "chunk": entry.chunk or None, "frame": entry.frame,
        "rules": rules_of(entry.syntax) if entry.syntax else [],
    }  # fmt: skip
    if hasattr(value, "dtype"):
        return described | {"count": entry.count, "minimum": _least(value), "maximum": _greatest(value)}
    return described | {"value": value.hex() if isinstance(value, bytes) else value}


def description_object(entry: "Entry") -> dict[str, Any]:
    """What spec.md says about an element, for JSON."""
    syntax = entry.syntax or {}
    return {key: syntax.get(key) for key in ("descriptor", "range", "absent", "meaning")}


def entry_line(entry: "Entry") -> str:
    """An element, or a run of them, in one line."""
    from gsvc_base.syntax import rules_of

    rules = " ".join(rules_of(entry.syntax)) if entry.syntax else ""
    byte, bit = divmod(entry.bit, 8)
    text = f"{byte:>9} {bit:>3} {entry.bits:>8}  {entry.full_name:<52} {value_text(entry)}"
    return f"{text}  [{rules}]" if rules else text


def value_text(entry: "Entry") -> str:
    """A value as people read it; of a long run the number of values, the least and the greatest."""
    value, name = entry.value, entry.name
    if value is None:
        return "no such element"
    if hasattr(value, "dtype"):
        if value.size <= SHOWN_AS_THEY_ARE:
            return ", ".join(_number(item) for item in value.reshape(-1).tolist())
        return f"{value.size} values, {_number(_least(value))} to {_number(_greatest(value))}"
    if isinstance(value, bytes):
        rest = f" and {len(value) - BYTES_SHOWN} bytes more" if len(value) > BYTES_SHOWN else ""
        return (value[:BYTES_SHOWN].hex(" ").upper() or "empty") + rest
    if name == "chunk_type" and bytes([value]).isalpha():
        return chr(value)
    if name in ("chunk_crc", "parameter_checksum"):
        return f"{value:08X}"
    meaning = (entry.syntax or {}).get("values", {}).get(str(value))
    return f"{_number(value)} {meaning}" if meaning else _number(value)


def _number(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def _least(values: Any) -> Any:
    return values.min().item() if values.size else None


def _greatest(values: Any) -> Any:
    return values.max().item() if values.size else None


def _neighbours(place: "Place") -> dict[str, "Entry | None"]:
    return {"before": place.before, "here": place.entry, "after": place.after}


def _place_lines(place: "Place", bit: int) -> list[str]:
    where = f"byte {bit // 8} bit {bit % 8} (bit {bit})"
    entry = place.entry
    title = f"{where}: {entry.full_name}" if entry else f"{where} was not reached: the stream has a fault before it"
    marks = {"before": " ", "here": ">", "after": " "}
    rows = [marks[name] + entry_line(row) for name, row in _neighbours(place).items() if row is not None]
    return [title, *([f"  {line}" for line in description_lines(entry)] if entry else []), "", f" {HEAD}", *rows]


def description_lines(entry: "Entry") -> list[str]:
    """What spec.md says about an element: descriptor, range, meaning, and the rules in full."""
    from gsvc_base.syntax import rules_of, syntax

    about = entry.syntax
    if about is None:
        return []
    said = about["descriptor"] + (f", {about['range']}" if about.get("range") else "")
    lines = [f"{said}: {about['meaning']}" if about.get("meaning") else said]
    rules = syntax()["rules"]
    return lines + [f"{rule}  {rules[rule]['text'].replace('`', '')}" for rule in rules_of(about)]


def fault_lines(fault: GsvcError, at_fault: "Entry | None") -> list[str]:
    """A fault, the element that it is about, and what spec.md says about that element and the rule."""
    from gsvc_base.syntax import syntax

    lines = [f"fault: {fault}"]
    description = description_lines(at_fault) if at_fault else []
    if at_fault is not None:
        lines.append(f"  {'instead of' if at_fault.value is None else 'at'} {at_fault.full_name}")
        lines += [f"  {line}" for line in description]
    rule = syntax()["rules"].get(fault.rule)
    if rule is not None and not any(line.startswith(f"{fault.rule} ") for line in description):
        lines.append(f"  {fault.rule}  {rule['text'].replace('`', '')}")
    return lines
