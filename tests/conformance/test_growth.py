"""Annex F of spec.md: its examples keep their bytes, and today's decoders answer them as it says."""

import hashlib
import re

import numpy as np
import pytest
from growth_examples import (
    HEADER,
    OVERVIEW,
    REORDER_FLAG,
    SHIFT_FLAG,
    Example,
    examples,
    layers,
    optional_elements,
    private_chunk,
    reordered,
    second_profile,
    time_stamps,
)

import gsvc_ref
from gsvc_conformance import spec
from gsvc_ref.testing import split_chunks

TEXT = spec.SPEC.read_text(encoding="utf-8")
EXAMPLES = pytest.mark.parametrize("example", examples(), ids=lambda example: example.clause)
DIGESTS = {
    "F.3": "1b82ac10c9e96d57",
    "F.4": "2ac88e734178b366",
    "F.5": "8e577a9e6fa7c50b",
    "F.6": "4844d8118708a4f0",
    "F.7": "2504f30ae3354443",
    "F.8": "96b9c9ee47df513f",
    "F.9": "bb4a20dbd072b12a",
}
"""How the SHA-256 of each example begins; a version, a checksum or a header element that changes, changes them all."""


def clause(name: str) -> str:
    return TEXT[TEXT.index(f"### {name} ") :].partition("\n### ")[0]


def payload(example: Example, chunk_type: str, occurrence: int = 0) -> bytes:
    found = [data for letter, data in split_chunks(example.data) if letter == chunk_type.encode()]
    return found[occurrence]


@EXAMPLES
def test_the_bytes_are_what_they_were(example):
    assert hashlib.sha256(example.data).hexdigest().startswith(DIGESTS[example.clause])


@EXAMPLES
def test_decoders_of_this_version_answer_as_it_says(example):
    for decoder in (
        spec.namespace()["reconstruct_stream"],
        lambda stream: gsvc_ref.reconstruct_stream(stream)._asdict(),
    ):
        answer = decoder(stream=example.data)
        assert (answer["error"], len(answer["counts"])) == (example.error, example.frames)
    if example.error:
        kind, rule, bit = example.error.split()
        said = " ".join(clause(example.clause).split())
        assert f"answers no frame, then `{kind}`, {rule}, at byte {int(bit) // 8}" in said


@EXAMPLES
def test_the_container_is_the_same(example):
    """Programs for the container alone find chunks that are whole, the size, and the number of frames."""
    chunks = split_chunks(example.data)
    s = spec.namespace()["Bits"](example.data)
    s.raw(10)
    read = [spec.namespace()["read_chunk"](s, 2**20) for _ in chunks]  # with their checksums
    assert [(letter.encode(), bytes(p.data)) for letter, p in read] == chunks
    header, end = chunks[0][1], chunks[-1][1]
    assert header[3:7] == HEADER[3:7]
    frames = [letter for letter, _ in chunks if letter in (b"I", b"P", b"R", b"B")]
    assert header[19:23] == end[:4] == len(frames).to_bytes(4, "little")


def test_what_is_ancillary_changes_no_frame():
    paper, main = (gsvc_ref.reconstruct_stream(data) for data in (OVERVIEW, second_profile().data))
    for before, example in ((main, layers()), (paper, time_stamps()), (paper, private_chunk())):
        answer = gsvc_ref.reconstruct_stream(example.data)
        assert answer.parameters.tobytes() == before.parameters.tobytes()
        assert answer.counts.tolist() == before.counts.tolist()


def test_a_flag_tells_a_legal_stream_of_tomorrow_from_a_damaged_one():
    answer = gsvc_ref.reconstruct_stream(reordered(flagged=False).data)
    assert answer.error.startswith("invalid R-6.4-1 ")
    assert len(answer.counts) == 1
    assert "`invalid`, R-6.4-1" in clause("F.5")
    assert payload(reordered(), "H")[2] == REORDER_FLAG


def test_the_shift_does_what_the_differences_did():
    example = optional_elements()
    assert payload(example, "H")[2] == SHIFT_FLAG | 1
    splats = gsvc_ref.reconstruct_stream(OVERVIEW).parameters
    elements = payload(example, "P")
    assert int.from_bytes(elements[1:5], "little") == gsvc_ref.parameter_checksum(splats[1:2])
    shift = np.frombuffer(elements[5:9], "<f2").astype(np.float32) * np.float32([8, 6])  # W/2, H/2
    assert (splats[0, :2] + shift).tolist() == splats[1, :2].tolist()


def read_splats(names, p, kind, count, reference=None):
    """The splats of a block, by the code of spec.md, in a decoder of tomorrow."""
    header = dict.fromkeys((name for name, *_ in spec.header_rows("paper")), 0)
    header |= {"level": 1, "cholesky_bits": 6, "color_stages": 1, "color_codewords": 1, "entropy_precision": 14}
    state = names["State"](header | {"lane_count": 1})
    block = names["read_splat_block"](p, state, count, kind)
    same = {name: block[name] for name in ("positions", "cholesky", "scale", "offset", "color_indices")}
    same |= {"codebook_sizes": block["codebook_sizes"], "codewords": block["codewords"]}
    if kind == "intra":
        return names["reconstruct_intra"](16, 12, **same)["parameters"]
    return names["reconstruct_inter"](16, 12, reference, np.ones(count, np.uint8), **same)["parameters"]


def test_a_layer_holds_the_splat_that_it_is_said_to():
    answer = spec.namespace()["reconstruct_layers"](layers().data, 1)
    assert answer["error"] == ""
    assert answer["counts"].tolist() == [2, 2, 2]
    x, y, l11, l21, l22, r, g, b = answer["parameters"][1].tolist()
    assert (x, y) == (8.125, 4.125)
    assert (l11, l21) == (l22, 0)
    assert g > 4 * abs(r)
    assert r == b
    assert answer["parameters"][3].tolist() == answer["parameters"][5].tolist() == answer["parameters"][1].tolist()


def test_a_layer_whose_chunk_is_missing():
    example = layers(whole=False)
    answer = spec.namespace()["reconstruct_layers"](example.data, 1)
    assert answer["error"] == f"invalid R-15.13-6 {8 * (len(example.data) - 14)}"
    assert answer["counts"].tolist() == [2, 2, 1]
    assert spec.namespace()["reconstruct_layers"](example.data, 0)["error"] == ""
    assert "`invalid`, R-15.13-6, at the end chunk" in " ".join(clause("F.6").split())


def test_the_stream_of_profile_main_holds_what_it_is_said_to():
    answer = gsvc_ref.reconstruct_stream(second_profile().data)
    first, moved, repeated = answer.parameters
    assert first[:2].tolist() == [4.125, 4.125]
    assert moved[:2].tolist() == [4.8046875, 3.8984375]
    assert repeated.tolist() == moved.tolist()
    assert (moved[5:] < first[5:]).all()


def test_a_frame_between_takes_the_splat_of_its_first_reference_half_of_the_way():
    names = spec.namespace()
    first, second = gsvc_ref.reconstruct_stream(OVERVIEW).parameters[:2]
    p = names["Bits"](payload(reordered(), "B"))
    number, backward_step, forward_step, new_splat_count = (p.uv() for _ in range(4))
    assert (number - backward_step, number + forward_step, new_splat_count) == (0, 2, 0)
    lanes = {"entropy_precision": 14, "lane_count": 1}
    assert names["read_plane"](p, lanes, 2, 2).tolist() == [1, 0]
    splats = read_splats(names, p, "inter", 1, first[None])
    names["check_filled"](p)
    assert (splats[0, :2] - first[:2]).tolist() == ((second - first)[:2] / 2).tolist()


def registry() -> list[list[str]]:
    return [
        [cell.strip() for cell in row.split("|")[1:-1]]
        for row in re.findall(r"^\| `[A-Za-z]`.*$", clause("F.10"), re.MULTILINE)
    ]


def test_the_registry_has_every_letter_once_and_in_its_class():
    letters = [letter for row in registry() for letter in re.findall("`(.)`", row[0])]
    assert sorted(letters) == sorted(chr(code) for code in range(128) if chr(code).isalpha())
    for cells, code, _, belongs_to, safe, *_ in registry():
        for letter in re.findall("`(.)`", cells):
            assert code in ("", f"{ord(letter):02X}")
            if letter.isupper():
                assert belongs_to == safe == ""
            else:
                assert (belongs_to == "frame", safe == "yes") == (bool(ord(letter) & 2), bool(ord(letter) & 1))


def test_what_is_assigned_is_what_the_decoder_knows():
    assigned = {row[0].strip("`") for row in registry() if row[5] == "assigned"}
    assert {letter for letter in assigned if letter.isupper()} == set(spec.namespace()["CRITICAL"])
    assert {letter for letter in assigned if letter.islower()} == {"x", "d", "t", "n"}
    rows = re.findall(
        r"^\| `(profile|level)` \| (\d+)(?: to (\d+))? \| .*?\| ([a-z ]+) \|", clause("F.10"), re.MULTILINE
    )
    ranges = {name: (lowest, highest) for name, _, lowest, highest in spec.namespace()["HEADER"]}
    for element in ("profile", "level"):
        said = {
            value: status
            for name, first, last, status in rows
            if name == element
            for value in range(int(first), int(last or first) + 1)
        }
        assert sorted(said) == list(range(256))
        lowest, highest = ranges[element]
        assert [value for value in said if said[value] == "assigned"] == list(range(lowest, highest + 1))
    flags = re.findall(r"^\| `flags` \| bit (\d) \| `\w+` \| assigned", clause("F.10"), re.MULTILINE)
    assert sum(2 ** int(bit) for bit in flags) == ranges["flags"][1]
