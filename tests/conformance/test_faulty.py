"""The faulty streams: every rule that a stream can break is broken, kinds are those of spec.md, one fault each."""

import re

from conformance.cases.building import operated
from conformance.cases.faults import colored, flat, overview, rich, three
from conformance.cases.faulty import faults
from conformance.spec import SPEC
from gsvc_ref.bitstream import StreamReader

NOT_BREAKABLE = {"R-3.3-1", "R-6.4-4"}
"""These bind a decoder; no stream can break them."""


def test_without_lies_the_streams_are_legal():
    assert len(list(StreamReader(overview()))) == 3
    assert len(list(StreamReader(rich()))) == 5
    assert len(list(StreamReader(three()))) == 3
    assert len(list(StreamReader(colored(1)))) == 1
    assert len(list(StreamReader(flat(512, width=256, height=256)))) == 1
    assert len(list(StreamReader(operated(lambda chunks: chunks)))) == 3


def test_every_rule_is_broken():
    rules = set(re.findall(r"\*\*(R-[3-8][\d.]*-\d+)\*\*", SPEC.read_text(encoding="utf-8")))
    assert {fault.rule for fault in faults()} == rules - NOT_BREAKABLE


def test_kinds_are_those_of_the_spec():
    lines = SPEC.read_text(encoding="utf-8").splitlines()
    for kind in ("malformed", "unsupported", "limit"):
        row = next(line for line in lines if line.startswith(f"| `{kind}` |"))
        named = set(re.findall(r"R-[\d.]+-\d+", row))
        if kind == "limit":  # written as a range
            named |= {"R-5-2", "R-5-3"}
        assert {fault.rule for fault in faults() if fault.kind == kind} == named


def test_slugs_say_the_rule():
    for fault in faults():
        assert re.fullmatch(r"r(_\d+)+_[a-z0-9_]+", fault.slug)


def test_each_stream_is_another():
    streams = [fault.make() for fault in faults()]
    assert len(set(streams)) == len(streams)
