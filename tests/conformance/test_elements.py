"""The table of syntax elements is that of spec.md, and what a stream uses is found; verify says what no vector has."""

import re

from gsvc_conformance.cases.building import overview_bytes
from gsvc_conformance.element_values import plane_values, used, values
from gsvc_conformance.elements import ELEMENTS
from gsvc_conformance.spec import SPEC


def test_elements_are_those_of_the_spec():
    text = SPEC.read_text(encoding="utf-8")
    parts = {"\n## 6 ": "\n## 7 ", "\n## 15 ": "\n## Annex A"}
    sections = "".join(text[text.index(first) : text.index(end)] for first, end in parts.items())
    headings = re.findall(r"^#### (.*)$", sections, re.MULTILINE)
    names = [part.replace("`", "") for heading in headings for part in heading.split(", ")]
    assert sorted(names) == sorted(ELEMENTS)


def test_what_the_overview_uses():
    elements = used(overview_bytes())
    assert elements["width"] == (16, 16, 1)
    assert elements["chunk_type"] == (ord("E"), ord("R"), 5)
    assert elements["cholesky_code"] == (8, 16, 3)
    assert elements["cholesky_scale"] == (0.25, 0.25, 3)
    assert elements["frame_count"] == elements["frame_count (end)"] == (3, 3, 1)
    assert elements["reference_count"] == (1, 1, 1)
    assert "parameter_checksum" not in elements
    assert "entry_count" not in elements


def test_values_stop_at_a_fault():
    found = values(overview_bytes()[:-1])
    assert found["frame_number"] == (3, {0, 1, 2})
    assert "frame_count (end)" not in found


def test_elements_of_a_plane():
    found = plane_values(b"\x48", {"count": 2, "alphabet": 8, "entropy_precision": 12, "lane_count": 1})
    assert found == {"plane_mode": (1, {1}), "symbol": (1, {1, 0})}
