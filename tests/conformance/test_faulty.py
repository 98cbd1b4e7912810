"""The faulty streams: every rule that a stream can break is broken, kinds are those of spec.md, one fault each."""

import re
from typing import Final

import pytest

from gsvc_conformance import reference, spec
from gsvc_conformance.cases.building import operated
from gsvc_conformance.cases.faults import colored, flat, overview, rich, three
from gsvc_conformance.cases.faulty import faults
from gsvc_conformance.cases.faulty_layers import FAULTY_LAYERS, POINTS
from gsvc_conformance.spec import SPEC
from gsvc_ref.bitstream.chunks import PREFIX_SIZE
from gsvc_ref.bitstream.rules import kind_of
from gsvc_ref.stream import StreamReader

OTHERS: Final = {
    "an I-frame that keeps the inter quantiser": ("invalid R-6.5-4 1762", 3, """
        89475356430d0a1a8100482400010010000c001900000001000000000000000000000008010101000100060101000e01a50e9e9249300001
        f82d0000002d0000000000803e00000000080000803e000080c0100000803e0000000008010100003a0038003400d30cc5965031010020f8
        0c000000000000000000803e00000000000000803e00000000000000803e000000000001010000000000000000f481c00749300201f82d00
        00002d0000000000803e00000000080000803e000080c0100000803e0000000008010100003a0038003400db3697ae500803002050000000
        00ebfbd70d45080400000000000000213b87af
    """),
    "a P-frame whose splats grow": ("limit R-5-4 856", 1, """
        89475356430d0a1a81004824000100000100011900000001000000000000000000000008010101000100060101000e011ceb3227493100d8
        04f82d0000002d0000000000803e00000000080000803e000080c0100000803e0000000008010100003a0038003400352f4622501f010020
        6000007a44000000003f00007a44000000000000007a44000000003f522cdd66450802000000000000000243e21c
    """),
    "no colours in an intra block": ("invalid R-6.5-2 451", 0, """
        89475356430d0a1a8100482400010010000c001900000001000000000000000000000008010101000100060101000e01a50e9e9249260001
        e02d0000002d0000000000803e00000000080000803e000080c0100000803e0000000008f2b981c6450801000000000000006bc4a6c7
    """),
    "no Cholesky factors in an intra block": ("invalid R-6.5-2 449", 0, """
        89475356430d0a1a8100482400010010000c001900000001000000000000000000000008010101000100060101000e01a50e9e9249150001
        982d0000002d000000010100003a00380034006144610c450801000000000000006bc4a6c7
    """),
    "a table of one symbol": ("invalid R-6.6-4 475", 0, """
        89475356430d0a1a8100482400010010000c001900000001000000000000000000000008010101000100060101000e01a50e9e9249370001
        f88216968c000000010000002d0000000000803e00000000080000803e000080c0100000803e0000000008010100003a0038003400caefb8
        7e450801000000000000006bc4a6c7
    """),
    "a padding bit after a raw plane": ("invalid R-3.1-4 466", 0, """
        89475356430d0a1a8100482400010010000c001900000001000000000000000000000008010101000100060101000e01a50e9e9249300001
        f86d0100002d0000000000803e00000000080000803e000080c0100000803e0000000008010100003a003800340027470d2d450801000000
        000000006bc4a6c7
    """),
}  # fmt: skip
"""Streams of another encoder, written from the text of spec.md alone: error, frames before it, and the bytes."""

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


def test_slugs_say_the_rule():
    for fault in faults():
        assert re.fullmatch(r"r(_\d+)+_[a-z0-9_]+", fault.slug)


@pytest.mark.exhaustive
def test_each_stream_is_another():
    streams = [fault.make() for fault in faults()]
    assert len(set(streams)) == len(streams)


@pytest.mark.parametrize("name", OTHERS)
def test_streams_of_another_encoder_are_refused_alike(name):
    error, complete, digits = OTHERS[name]
    written = bytes.fromhex(digits)
    stream = written[:8] + overview()[8:PREFIX_SIZE] + written[PREFIX_SIZE:]  # the version of today
    for decode in (reference.reconstruct_stream, spec.namespace()["reconstruct_stream"]):
        found = decode(stream=stream)
        assert (found["error"], len(found["counts"])) == (error, complete)
