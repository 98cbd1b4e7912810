"""Damaged streams of profile `main`: the library and the code of spec.md find the same fault, or none."""

from dataclasses import replace

import pytest

from gsvc_base.errors import GsvcError
from gsvc_ref.bitstream import SequenceHeader
from gsvc_ref.bitstream.header import MAIN
from gsvc_ref.bitstream.rules import kind_of
from gsvc_ref.stream import StreamReader
from gsvc_ref.testing import Lie, write_stream
from tests.main.material import HEADER, both, codes_of, damages, stream_of

PLAIN = SequenceHeader(profile=MAIN, level=1, width=20, height=9, max_lane_exponent=1)
STREAMS = {
    "plain": (PLAIN, "IPRI", 3, 3),
    "checksums": (HEADER, "IP", 5, 3),
    "empty": (PLAIN, "IP", 0, 0),
}


@pytest.mark.parametrize(
    ("name", "step"), [("plain", 13), *(pytest.param(name, 3, marks=pytest.mark.exhaustive) for name in STREAMS)]
)
def test_damages(name: str, step: int) -> None:
    """At most a third of them: neighbouring cuts and bits hurt the same element, and the fuzzer finds other places."""
    header, types, seed, count = STREAMS[name]
    for what, data in damages(stream_of(types, seed, count, header), step, first=step // 2):
        ours, theirs = both(data)
        assert ours == theirs, what


FAULTS = {
    "quantizer beyond 79": (Lie("quantizer", 80), "R-3.2-1"),
    "reserved lanes": (Lie("lane_exponent", 13), "R-3.2-1"),
    "tools of tomorrow": (Lie("main_tools", 1), "R-3.2-1"),
    "no quantizer": (Lie("quantizer_present", 0), "R-15.5-5"),
    "more lanes than the header says": (Lie("lane_exponent", 3), "R-15.5-1"),
    "a field in an I-frame": (Lie("motion_cell", 1), "R-15.5-2"),
    "splats without densities": (Lie("splat_number", lambda number: number - 1), "R-15.5-3"),
    "too many splats": (Lie("splat_number", 1 << 15), "R-5-2"),
    "too many with those before": (Lie("splat_number", (1 << 15) - 1, 1), "R-5-2"),
    "a lane below 2^16": (Lie("lane_state", lambda states: states * 0 + 65535), "R-6.6-5"),
    "a word too few": (Lie("word", lambda words: words[:-1]), "R-7-1"),
    "a word too many": (Lie("word", lambda words: [*words, 0]), "R-7-1"),
    "a byte too many": (Lie("raw_byte", lambda data: b"\0" + data), "R-7-1"),
    "a byte too few": (Lie("raw_byte", lambda data: data[1:]), "R-7-1"),
    "skipped bits": (Lie("align", 1), "R-3.1-4"),
    "a wrong checksum": (Lie("parameter_checksum", 0), "R-6.4-3"),
    "layers beyond 4": (Lie("layer_count", 5), "R-3.2-1"),
    "a profile that is not known": (Lie("profile", 2), "R-3.2-1"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults(name: str) -> None:
    lie, rule = FAULTS[name]
    data = write_stream(HEADER, codes_of("IP"), lies=[lie])
    ours, theirs = both(data)
    assert ours == theirs
    assert ours[2].split(" ")[:2] == [kind_of(rule), rule]
    with pytest.raises(GsvcError) as caught:
        list(StreamReader(data))
    assert caught.value.rule == rule


def test_new_splats_need_densities_since_the_last_i_frame() -> None:
    codes = [*codes_of("I", count=0), replace(codes_of("P", count=3)[0], quantizer_present=True)]
    data = write_stream(HEADER, codes, lies=[Lie("splat_number", lambda number: number - 1)])
    ours, theirs = both(data)
    assert ours == theirs
    assert ours[2].split(" ")[:2] == ["invalid", "R-15.5-4"]
