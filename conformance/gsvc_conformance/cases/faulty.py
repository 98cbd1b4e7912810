"""Faulty streams: each breaks one rule, its checksums being right, so that the fault itself is reached.

The tables of faults are in `faulty_container`, `faulty_numbers`, `faulty_payload`, `faulty_blocks`, `faulty_limits`,
`faulty_versions`, `faulty_order`, `faulty_main` and `pace`.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from gsvc_conformance.case import Fault, Inputs, add
from gsvc_conformance.cases import CAPACITY, pace
from gsvc_conformance.cases.building import result
from gsvc_conformance.cases.faults import MAIN, Broken
from gsvc_conformance.cases.faulty_blocks import block_faults
from gsvc_conformance.cases.faulty_container import container_faults, profile_faults, truncations
from gsvc_conformance.cases.faulty_limits import limit_faults, main_limits
from gsvc_conformance.cases.faulty_main import main_faults
from gsvc_conformance.cases.faulty_numbers import number_faults, number_forms
from gsvc_conformance.cases.faulty_order import container_orders, order_faults
from gsvc_conformance.cases.faulty_payload import payload_faults
from gsvc_conformance.cases.faulty_versions import later_faults, version_faults

FLAGS: Final = {"R-5-1": "limit", "R-5-2": "limit", "R-5-3": "limit", "R-5-4": "limit", "R-5-7": "limit",
                "R-5-8": "limit", "R-6.4-1": "prediction", "R-6.5-4": "kept", "R-6.6-3": "table", "R-6.6-4": "table",
                "R-6.7-1": "index", "R-6.8-2": "index", "R-7-1": "lanes", "R-8-1": "overflow"}  # fmt: skip
"""The flag of faults of a rule."""

NO_ROOM: Final = ("r_3_1_1_splat_count_six_bytes", "r_3_1_1_main_splat_number_six_bytes", "r_3_1_3_17_zeros",
                  "r_6_2_3_before_codewords", "r_6_2_3_before_lane_state", "r_6_2_3_before_symbols")  # fmt: skip
"""Faults that are found before the value of an element or of a run is looked at (R-3.1-6)."""

LONG: Final = ("r_5_7_main_splats", "r_5_7_main_bytes", "r_5_9_main_splats", "r_5_9_main_bytes")
"""Faults of streams that are too long for mutants, which streams of profile `paper` find as well."""


def faulty(value: Broken) -> Inputs:
    """A decoder reports the kind of the fault, and yields the frames before it."""
    data = value.make()
    expected = yield {"stream": data}
    kind, rule, bit = result(expected, "error").split()
    assert (kind, rule) == (value.kind, value.rule)
    assert 0 <= int(bit) <= 8 * len(data)
    assert len(result(expected, "counts")) == value.complete


def faults() -> list[Broken]:
    """All faulty streams."""
    return [
        *container_faults(), *number_faults(), *payload_faults(), *block_faults(), *limit_faults(),
        *pace.pace_faults(pace.PAPER), *version_faults(), *order_faults(), *truncations(), *main_faults(),
        *(replace(fault, twin=True) for fault in _twins()),
    ]  # fmt: skip


def _twins() -> Iterator[Broken]:
    """Faults of profile `paper` that streams of `main` can have, too."""
    yield from profile_faults(MAIN)
    yield from number_forms(MAIN)
    yield from main_limits()
    yield from pace.pace_faults(pace.MAIN)
    yield from pace.point_faults(pace.MAIN)
    yield from later_faults(MAIN)
    yield from container_orders(MAIN)
    yield from truncations(MAIN)


for entry in faults():
    add(
        "faulty",
        "reconstruct_stream",
        entry.slug,
        title=f"{entry.rule} is broken{' in profile `main`' * entry.twin}: {entry.lie}.",
        reason="" if entry.complete == 0 else f"Frames before the fault: {entry.complete}.",
        rules=[entry.rule, *entry.also, *(["R-3.1-6"] if entry.slug in NO_ROOM else [])],
        flags=[
            *(["check-order"] if entry.also else []),
            *([FLAGS[entry.rule]] if entry.rule in FLAGS else []),
            *([CAPACITY] if entry.slug in LONG else []),
        ],
        fault=Fault(entry.lie, entry.truth),
        function=faulty,
        arguments={"value": entry},
    )
