"""Names of the elements of inputs and outputs: ``splat 2, l21`` in place of ``[2, 3]``."""

import re
from typing import Final

from gsvc_conformance.operation import Operation

SPLAT: Final = ("x", "y", "l11", "l21", "l22", "red", "green", "blue", "w")
"""Columns of parameters, their gradients, and values with a weight (spec.md 8 and 10.3)."""

CHANNELS: Final = ("red", "green", "blue")
CHOLESKY: Final = ("l11", "l21", "l22")
QUANTIZER: Final = ("scale", "offset")
BLOCK: Final = ("frame", "block (0 intra, 1 inter)", "splats", "positions_present", "cholesky_present",
                "quantizer_present", "colors_present", "codebooks_present")  # fmt: skip
"""Columns of `blocks` of read_stream."""

BODY: Final = ("frame", "quantizer", "lane_exponent", "motion_cell", "densities_present", "count")
"""Columns of `bodies` of read_main_stream."""
STATE: Final = ("X", "Y", "A", "B", "S", "n0", "n1", "n2")
"""Columns of states (spec.md 15.4)."""
SYMBOL: Final = ("c(s)", "f(s)", "pass", "lane")
"""Columns of `symbols` of read_main_stream."""
DIFFERENCES: Final = tuple(f"q{i}" for i in range(8))
"""Columns of `differences` (spec.md 15.11)."""

ITEMS: Final = {
    "N": "splat", "n": "splat", "M": "splat", "P": "splat", "n or 0": "splat", "H": "row", "T": "frame",
    "count": "symbol", "lanes": "lane",
}  # fmt: skip
"""The things that an axis of a port counts, by its letter."""

ITEMS_OF_PORTS: Final = {
    "values": "element", "bits": "element", "words": "word", "blocks": "block", "quantizers": "quantiser",
    "codebook_sizes": "codebook", "codewords": "codeword", "codebooks": "codeword", "sums": "codeword",
    "survivors": "survivor", "rates": "iteration", "key_frames": "entry", "counts": "entry", "iterations": "entry",
    "modes": "splat", "differences": "splat", "fields": "vector", "bodies": "body",
    "symbols": "symbol", "cumulative": "symbol",
}  # fmt: skip
"""The things that the first axis counts, of ports whose letter would be misleading."""


def dimensions(operation: Operation, output: str) -> tuple[str, ...]:
    """The letters of an output's axes: ``("H", "W", "3")``; none where the operation has no such output."""
    shape = next((port.shape for port in operation.outputs if port.name == output), "")
    return tuple(letter.strip() for letter in shape.strip("()").split(",") if letter.strip())


def item(operation: Operation, output: str) -> str:
    """The thing that the first axis of an output counts: ``splat``, ``row``, ``frame``, ``codeword``, ..."""
    letters = dimensions(operation, output)
    if output == "header":
        return "element"
    if output == "counts" and letters[:1] == ("K",) and operation.name == "rvq_update":
        return "codeword"
    if output == "survivors" and operation.name == "read_stream":
        return "splat"
    if letters[:1] in (("T",), ("H",)) or (len(letters) > 1 and letters[0] == "N"):
        return ITEMS[letters[0]]
    return ITEMS_OF_PORTS.get(output, ITEMS.get(letters[0] if letters else "", "entry"))


def columns(operation: Operation, output: str, size: int | None = None) -> tuple[str, ...]:
    """The names of the last axis of an output, or none; `size` is needed where the port's shape has a letter."""
    letters = dimensions(operation, output)
    if output == "header":
        from gsvc_conformance.spec import header_rows

        return tuple(name for name, *_ in header_rows("main" if operation.name == "read_main_stream" else "paper"))
    if len(letters) < 2:
        return ()
    last = int(letters[-1]) if letters[-1].isdigit() else size
    if output == "blocks":
        return BLOCK
    if output == "quantizers":
        return QUANTIZER
    if output == "bodies":
        return BODY
    if output in ("state", "states"):
        return STATE
    if output == "differences":
        return DIFFERENCES
    if output == "symbols":
        return SYMBOL
    if output in ("motion", "fields"):
        return SPLAT[:2]
    if output == "positions":
        return SPLAT[:2]
    if last in (8, 9):
        return SPLAT[:last]
    if last == 3 and (output == "cholesky" or operation.name.startswith("lsq_")):
        return CHOLESKY
    if letters[-1] == "M":
        return tuple(f"stage {number}" for number in range(last or 0))
    return CHANNELS if last == 3 and letters[-1] == "3" else ()


def element(operation: Operation, output: str, place: tuple[int, ...], shape: tuple[int, ...] | None = None) -> str:
    """The name of one element of an output.

    Parameters
    ----------
    operation, output
        The operation and the name of the output.
    place
        The indices of the element; none for a single number.
    shape
        The shape of the output, if it is known.
    """
    if not place:
        return output
    names = columns(operation, output, shape[-1] if shape else None)
    if output == "header":
        return names[place[0]] if place[0] < len(names) else f"element {place[0]}"
    letters = dimensions(operation, output)
    parts = []
    for axis, (letter, index) in enumerate(zip(letters, place, strict=False)):
        if letter in ("H", "h"):
            parts.append(f"pixel (x {place[axis + 1]}, y {index})")
        elif axis > 0 and axis == len(letters) - 1 and letter not in ("W", "w"):
            parts.append(names[index] if index < len(names) else f"column {index}")
        elif output == "quantizers" and axis == 1:
            parts.append(CHOLESKY[index] if index < len(CHOLESKY) else f"column {index}")
        elif axis == 0:
            parts.append(f"{item(operation, output)} {index}")
    return ", ".join(parts) or str(list(place))


def with_names(operation: Operation, output: str, message: str, shape: tuple[int, ...]) -> str:
    """A judgement's sentence with names in place of the indices of elements and columns."""

    def place(found: re.Match[str]) -> str:
        return f"at {element(operation, output, tuple(int(index) for index in found[1].split(', ')), shape)}"

    names = columns(operation, output, shape[-1] if shape else None)

    def named(found: re.Match[str]) -> str:
        return ", ".join(names[int(found[1]) : int(found[2]) + 1]) or found[0]

    return re.sub(r"columns (\d+)\.\.(\d+)", named, re.sub(r"at \[(\d+(?:, \d+)*)\]", place, message))
