"""Streams of a later minor version that break a rule: only what follows the elements of the header may be new."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Final

from gsvc_conformance.cases.building import Chunks, operated
from gsvc_conformance.cases.faults import PAPER, Broken, Sound, end_of, overview
from gsvc_ref.testing import Lie

LATER: Final = Lie("version_minor", 9)
"""Any minor version but 0."""

STILL: Final = "the rule holds for every minor version"


def _edited(of: Sound, number: int, change: Callable[[bytes], bytes]) -> bytes:
    """The plain stream under a later minor version, with another payload of one of its chunks H I P R x E."""

    def operation(chunks: Chunks) -> Chunks:
        chunks[number] = chunks[number][0], change(chunks[number][1])
        if chunks[number][0] == b"x":
            chunks[-1] = b"E", end_of(3, index=chunks[number][1])[1]
        return chunks

    return operated(operation, of.plain(LATER))


def version_faults() -> Iterator[Broken]:
    """All of profile `paper`."""
    yield from later_faults(PAPER)
    yield Broken("R-6.5-1", "unsupported", "later_version", "version_minor is 9, block_reserved 1", STILL,
                 lambda: overview(LATER, Lie("block_reserved", 1)))  # fmt: skip
    yield Broken("R-6.6-1", "unsupported", "later_version", "version_minor is 9, plane_mode 3", STILL,
                 lambda: overview(LATER, Lie("plane_mode", 3)))  # fmt: skip


def later_faults(of: Sound) -> Iterator[Broken]:
    """Those that a stream of any profile can have."""
    for number, name in enumerate(("i_frame", "p_frame", "r_frame", "index", "end"), 1):
        yield Broken("R-6.2-3", "malformed", f"later_version_{name}_too_long",
                     f"version_minor is 9, and a byte follows the last element of the {name.replace('_', '-')}", STILL,
                     partial(_edited, of, number, lambda payload: payload + b"\0"), min(number - 1, 3))  # fmt: skip
    yield Broken("R-6.2-3", "malformed", "later_version_header_too_short",
                 "version_minor is 9, and the header lacks its last byte", STILL,
                 partial(_edited, of, 0, lambda payload: payload[:-1]))  # fmt: skip
    own = (("layer_count", 5), ("main_tools", 1)) if of.is_main else ()
    for element, said in (("profile", 2), ("level", 6), ("flags", 4), *own):
        yield Broken("R-3.2-1", "unsupported", f"later_version_{element}_{said}",
                     f"version_minor is 9, {element} {said}", STILL,
                     partial(of.overview, LATER, Lie(element, said)))  # fmt: skip
    yield Broken("R-3.2-1", "unsupported", "later_version_chunk_b", "version_minor is 9, and a chunk has the type B",
                 STILL, lambda: operated(lambda c: [*c[:2], (b"B", b""), *c[2:]], of.overview(LATER)), 1)  # fmt: skip
