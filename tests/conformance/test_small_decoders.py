"""Decoders of profile `main` that are right and too small: no claim of it holds for them."""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Final

import numpy as np
import pytest

from gsvc_conformance.claim import read_claim
from gsvc_conformance.features import stated_header
from gsvc_conformance.implementations import ModuleImplementation
from gsvc_conformance.operation import operations
from gsvc_conformance.results import Report
from gsvc_conformance.runner import run_suite
from gsvc_conformance.vector import VECTORS, Vector
from gsvc_conformance.vector_folder import Selection, VectorFolder

CLAIM: Final = read_claim("bitstream+rendering+deterministic,main,5,seeking,layers")
OF_STREAMS: Final = {
    name: operation.reference
    for name, operation in operations().items() if any(port.type == "stream" for port in operation.inputs)
}  # fmt: skip
"""The operations on streams as gsvc_ref answers them."""

Answering = Callable[..., dict[str, Any]]


def of_frames(most: int) -> Callable[[Answering], Answering]:
    """A decoder that keeps so many frames."""

    def small(answering: Answering) -> Answering:
        def answer(**inputs: Any) -> dict[str, Any]:
            whole = answering(**inputs)
            kept = {name: whole[name][:most] for name in ("frames", "frame_types", "counts") if name in whole}
            end = int(kept["counts"].sum()) if "counts" in kept else 0
            return {**whole, **kept, **{name: whole[name][:end] for name in ("parameters", "states") if name in whole}}

        return answer

    return small


def of_splats(most: int) -> Callable[[Answering], Answering]:
    """A decoder that keeps so many splats of a frame."""

    def small(answering: Answering) -> Answering:
        def answer(**inputs: Any) -> dict[str, Any]:
            whole = dict(answering(**inputs))
            if "counts" in whole:
                counts = whole["counts"]
                place = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
                whole["counts"] = np.minimum(counts, most)
                for name in {"parameters", "states"} & whole.keys():
                    whole[name] = whole[name][place < most]
            return whole

        return answer

    return small


def of_sides(most: int) -> Callable[[Answering], Answering]:
    """A decoder that refuses frames with more columns or rows."""

    def small(answering: Answering) -> Answering:
        def answer(**inputs: Any) -> dict[str, Any]:
            header = stated_header(inputs["stream"])
            if max(header.get("width", 0), header.get("height", 0)) > most:
                raise NotImplementedError(f"frames of more than {most} columns or rows")
            return answering(**inputs)

        return answer

    return small


SMALL: Final[Mapping[str, dict[str, Answering]]] = {
    **{f"{most} frames": {name: of_frames(most)(f) for name, f in OF_STREAMS.items()} for most in (8, 256)},
    **{f"{most} splats": {name: of_splats(most)(f) for name, f in OF_STREAMS.items()} for most in (1200, 2**14, 2**16)},
    **{f"{most} on a side": {name: of_sides(most)(f) for name, f in OF_STREAMS.items()} for most in (1024, 2**15)},
    "no seeking": {name: f for name, f in OF_STREAMS.items() if name != "seek"},
    "the base for any layer": {
        **OF_STREAMS,
        **{name: lambda stream, layer, f=OF_STREAMS[name]: f(stream=stream, layer=0)
           for name in ("reconstruct_layers", "decode_layers")},
    },
}  # fmt: skip
"""The operations of each decoder, by what it has."""


@cache
def vectors() -> tuple[Vector, ...]:
    """The vectors of streams that are legal and of profile `main`."""
    folder = VectorFolder(VECTORS)
    names = folder.select(Selection(operations=tuple(OF_STREAMS), profile=CLAIM.profile))
    return tuple(folder.read(name for name in names if not name.startswith("faulty")))


def judged(functions: Mapping[str, Answering]) -> Report:
    results = run_suite(ModuleImplementation("small", functions), vectors(), level=CLAIM.level, profile=CLAIM.profile)
    return Report({}, "run", "", [], results, claim=CLAIM)


@pytest.mark.exhaustive
def test_the_claim_of_the_whole_decoder_holds() -> None:
    assert judged(OF_STREAMS).exit_code == 0


@pytest.mark.exhaustive
@pytest.mark.parametrize("what", SMALL)
def test_no_claim_of_a_small_decoder_holds(what: str) -> None:
    report = judged(SMALL[what])
    assert report.exit_code == 1
    assert len([result for result in report.results if result.outcome != "pass"]) >= 2
