"""The faulty streams: every rule that a stream can break is broken, kinds are those of spec.md, one fault each."""

import re
from typing import Final

import pytest

from gsvc_conformance.cases.building import operated
from gsvc_conformance.cases.faults import colored, flat, overview, rich, three
from gsvc_conformance.cases.faulty import faults
from gsvc_conformance.cases.faulty_layers import FAULTY_LAYERS, POINTS
from gsvc_conformance.spec import SPEC
from gsvc_ref.bitstream.rules import kind_of
from gsvc_ref.stream import StreamReader

OF_LAYERS: Final = {entry.rule for entry in FAULTY_LAYERS.values()} | {rule for rule, *_ in POINTS.values()}
"""Rules that streams with layers break."""

NOT_BREAKABLE = {
    "R-3.1-5", "R-3.1-6", "R-3.3-1", "R-3.3-2", "R-5-5", "R-5-6", "R-6.1-6", "R-6.1-7", "R-6.2-5", "R-6.2-6", "R-6.2-7",
    "R-6.2-8", "R-6.3-3", "R-6.3-4", "R-6.4-4", "R-6.4-5", "R-6.5-8", "R-6.5-9", "R-6.5-10", "R-6.7-2", "R-6.7-3",
    "R-7-2", "R-7-3", "R-8-2", "R-8-3", "R-9.4-2", "R-15.6-1", "R-15.6-2", "R-15.6-3", "R-15.6-4", "R-5-10",
    "R-15.13-3", "R-15.13-5",
}  # fmt: skip
"""These bind a decoder, or an encoder or editor whose faults no decoder sees: none refuses a stream for them."""


def test_without_lies_the_streams_are_legal():
    assert len(list(StreamReader(overview()))) == 3
    assert len(list(StreamReader(rich()))) == 5
    assert len(list(StreamReader(three()))) == 3
    assert len(list(StreamReader(colored(1)))) == 1
    assert len(list(StreamReader(flat(512, width=256, height=256)))) == 1
    assert len(list(StreamReader(operated(lambda chunks: chunks)))) == 3


def test_every_rule_is_broken():
    rules = set(re.findall(r"\*\*(R-(?:[3-8][\d.]*|15\.(?:5|6|13))-\d+)\*\*", SPEC.read_text(encoding="utf-8")))
    other = {rule for rule in rules if rule.startswith(("R-6.10-", "R-6.11-"))}
    # The first bind who joins streams, the others who writes time stamps; no decoder refuses a stream for them.
    assert {fault.rule for fault in faults()} | OF_LAYERS == rules - NOT_BREAKABLE - other


def test_kinds_are_those_of_the_spec():
    lines = SPEC.read_text(encoding="utf-8").splitlines()
    for kind in ("malformed", "unsupported", "limit"):
        row = next(line for line in lines if line.startswith(f"| `{kind}` |"))
        named = set(re.findall(r"R-[\d.]+-\d+", row))
        if kind == "limit":  # written as a range
            named |= {"R-5-2", "R-5-3", "R-5-8"}
        of_layers = {rule for rule in OF_LAYERS if kind_of(rule) == kind}
        assert {fault.rule for fault in faults() if fault.kind == kind} | of_layers == named - NOT_BREAKABLE


@pytest.mark.exhaustive
def test_each_stream_is_another():
    streams = [fault.make() for fault in faults()]
    assert len(set(streams)) == len(streams)
