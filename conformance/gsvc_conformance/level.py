"""The level of a vector: an implementation that claims this level (spec.md section 5) or a higher one must pass it."""

from collections.abc import Iterator
from typing import Final

from gsvc_conformance.operation import Operation, Values

LEVELS: Final = range(1, 6)
"""The levels of spec.md section 5."""
ROWS: Final = ("N", "count")
"""Symbols of the first dimension of inputs with a row for each splat."""
OF_NUMBERS: Final = ("from_half", "to_half")
"""Operations whose rows are numbers, not splats."""


def level_of(operation: Operation, inputs: Values) -> int:
    """The level of a vector, from 1.

    Of a stream it is the level that its header states, and 1 where the header cannot be read or states none: every
    decoder has to refuse such a stream. Of anything else it is the least level whose pixels, splats and rendering work
    the inputs fit, and the highest one where they fit none.

    Parameters
    ----------
    operation
        The operation of the vector.
    inputs
        Its inputs, by name.
    """
    streams = [value for value in inputs.values() if isinstance(value, bytes)]
    if streams:
        return max(map(_stated_level, streams))
    from gsvc_base import spec

    pixels = max(_pixels(operation, inputs), default=0)
    splats = max(splat_counts(operation, inputs), default=0)
    work = max(_works(operation, inputs), default=0)
    fitting = (
        number for number, level in spec.LEVELS.items()
        if pixels <= level["pixels"] and splats <= level["splats"] and work <= level["work"]
    )  # fmt: skip
    return next(fitting, max(LEVELS))


def _stated_level(stream: bytes) -> int:
    """The element `level` of a sequence header that stands where it must; else 1."""
    stated = header_payload(stream)[1:2]  # after `profile`
    return stated[0] if stated and stated[0] in LEVELS else 1


def header_payload(stream: bytes) -> bytes:
    """A stream from the payload of its sequence header on; empty if no such chunk stands where it must."""
    from gsvc_base import spec

    prefix = len(spec.MAGIC) + 2  # with the version
    if not stream.startswith(spec.MAGIC) or stream[prefix : prefix + 1] != b"H":
        return b""
    payload = prefix + 2  # after the type and the length, a uv
    while stream[payload - 1 : payload] >= b"\x80":
        payload += 1
    return stream[payload:]


def _pixels(operation: Operation, inputs: Values) -> Iterator[int]:
    """The pixels of each picture, and of each size that is given in numbers."""
    for width, height in (("width", "height"), ("new_width", "new_height")):
        if width in inputs:
            yield int(inputs[width]) * int(inputs[height])
    for port in operation.inputs:
        if port.shape.startswith(("(H, W", "(T, H, W")):
            first = 1 if port.shape.startswith("(T") else 0
            height, width = inputs[port.name].shape[first : first + 2]
            yield height * width


def splat_counts(operation: Operation, inputs: Values) -> Iterator[int]:
    """The rows of each input that has one for each splat, and numbers of splats."""
    if operation.name in OF_NUMBERS:
        return
    for port in operation.inputs:
        if port.shape.strip("(").partition(",")[0] in ROWS:
            yield len(inputs[port.name])
        elif port.name in ("count", "splats"):
            yield int(inputs[port.name])


def _works(operation: Operation, inputs: Values) -> Iterator[int]:
    """The rendering work of the splats that are drawn, of those of another size, too."""
    from gsvc_base import spec

    if "halvings" in inputs:
        yield spec.main_work(**inputs)["work"]
    if "parameters" not in inputs:
        return
    parameters = inputs["parameters"]
    if "residual" in inputs:
        height, width = inputs["residual"].shape[:2]
        yield spec.rendering_work(parameters, width, height)["work"]
    elif "width" in inputs:
        yield spec.rendering_work(parameters, inputs["width"], inputs["height"])["work"]
    if "new_width" in inputs:
        scaled = getattr(spec, operation.name)(**inputs)["parameters"]
        yield spec.rendering_work(scaled, inputs["new_width"], inputs["new_height"])["work"]
