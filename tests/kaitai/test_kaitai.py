"""docs/gsvc.ksy has the names of spec.md, and what it reads of all legal streams is what gsvc_ref reads."""

import importlib.util
import re
import sys
from enum import Enum
from xml.etree import ElementTree

import numpy as np
import pytest

from gsvc_base.draws import Draws
from gsvc_base.syntax import named, syntax
from gsvc_conformance.cases.main_layers import BASE, LAYERS, with_layers
from gsvc_conformance.vector import VECTORS
from gsvc_ref import reconstruct_layers
from gsvc_ref.bitstream.header import MAIN
from gsvc_ref.stream import StreamReader
from gsvc_ref.testing import RICH_HEADER, random_main_stream, rich_frames, write_stream
from gsvc_tools.listing import list_elements
from tests.kaitai.compiler import ROOT, SOURCE, compile_to, missing
from tests.kaitai.diagram import readable

TEXT = SOURCE.read_text(encoding="utf-8")
STRUCTURES = syntax()["structures"]
NEEDS_COMPILER = pytest.mark.skipif(bool(missing()), reason=missing() or "all is there")


@pytest.fixture(scope="module")
def parser(tmp_path_factory):
    """The class that the compiler makes."""
    pytest.importorskip("kaitaistruct", reason="kaitaistruct, of the extra kaitai, is not installed")
    folder = tmp_path_factory.mktemp("kaitai")
    compile_to("python", folder)
    spec = importlib.util.spec_from_file_location("gsvc_kaitai", folder / "gsvc.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module.Gsvc


def test_names_are_those_of_the_spec():
    ids = set(re.findall(r"- id: (\w+)", TEXT))
    assert {name.partition(" (")[0] for name in named()} - {"raw_byte"} <= ids  # where they begin only decoding tells
    types = set(re.findall(r"^ +(\w+):$", TEXT, re.MULTILINE))
    assert {one["name"] for one in STRUCTURES} - {"stream"} <= types


def test_header_has_the_elements_in_their_order():
    part = TEXT[TEXT.index("\n  sequence_header:\n") : TEXT.index("\n  frame:\n")]
    said = re.findall(r"- id: (\w+)\n +type: u(\d)", part)
    elements = [e for one in STRUCTURES for e in one["elements"] if one["name"] in ("sequence_header", "main_header")]
    expected = [(e["name"], e["descriptor"]) for e in elements if e.get("descriptor", "").startswith("le")]
    assert [(name, f"le({size})") for name, size in said] == expected


def values_of(thing):
    """Names and values in the order in which they were read, down to single elements."""
    for name, value in vars(thing).items():
        if name.startswith("_") or name == "place":
            continue
        for item in value if isinstance(value, list) else [value]:
            if name in named():
                if isinstance(item, Enum | int | float | bytes):
                    yield name, item.value if isinstance(item, Enum) else item
                    continue
                number = item.bits if name == "symbol" else item
                if hasattr(number, "value"):
                    yield name, number.value
                    continue
            if hasattr(item, "_io"):
                yield from values_of(item)


def values_listed(data):
    """The same as gsvc_ref reads them; floats of 16 bits as their patterns."""
    found = []
    list_elements(data, found.append)
    for entry in found:
        if entry.syntax is not None:
            for item in entry.items():
                value = item.value
                if item.name == "codeword":
                    value = int(np.float16(value).view(np.uint16))
                yield item.name, value


def assert_read_alike(parser, data):
    """Numbers of frames and of complete ones."""
    splats = [len(frame.splats) for frame in StreamReader(data)]
    stream = parser.from_bytes(data)
    frames = [chunk.payload for chunk in stream.chunk if chunk.is_frame]
    assert len(frames) == len(splats)
    if stream.header.profile == MAIN:
        listed = [pair for pair in values_listed(data) if pair[0] not in ("word", "raw_byte")]
        assert list(values_of(stream)) == listed
        return len(frames), len(frames)
    complete = [frame.is_complete for frame in frames]
    for frame, count in zip(frames, splats, strict=True):
        assert frame.splats == (count if frame.is_complete else -1)
        assert frame.not_parsed == b"" or not frame.is_complete
    if all(complete):
        assert list(values_of(stream)) == list(values_listed(data))
    return len(frames), sum(complete)


@NEEDS_COMPILER
def test_a_rich_stream(parser):
    data = write_stream(RICH_HEADER, rich_frames())
    frames, complete = assert_read_alike(parser, data)
    assert frames == len(rich_frames())
    assert complete > 1


@NEEDS_COMPILER
def test_random_streams_of_profile_main(parser):
    frames = [assert_read_alike(parser, random_main_stream(seed, max_pixels=2**15).data)[0] for seed in range(60)]
    assert sum(frames) > 100


@NEEDS_COMPILER
def test_layers(parser):
    stream = parser.from_bytes(with_layers(Draws(29), BASE, LAYERS, parameter_checksum_flag=True))
    found = [
        (chunk.last_frame - stream.chunk[1].last_frame, chunk.payload)
        for chunk in stream.chunk
        if chunk.kind == parser.TypeOfPayload.layer
    ]
    assert [layer.layer for _, layer in found] == [entry.layer for entry in LAYERS]
    assert ["IPR"[layer.layer_type] for _, layer in found] == [entry.plan.type for entry in LAYERS]
    assert [layer.frame_low for _, layer in found] == [entry.frame for entry in LAYERS]
    assert [quality.quality_level for quality in stream.header.main_header.quality] == [1] * 4
    for entry, (_, layer) in zip(LAYERS, found, strict=True):
        if entry.plan.type == "R":
            continue
        if layer.body.quantizer_present:
            assert layer.body.quantizer == entry.plan.quantizer
        count = layer.body.splat_number.value // 2 + 1 if layer.body.new_present else 0
        assert count == entry.plan.count


OF_LAYERS = ("reconstruct_layers", "decode_layers")


@NEEDS_COMPILER
@pytest.mark.skipif(not VECTORS.is_dir(), reason="vectors/ is not there")
def test_all_legal_vectors(parser):
    frames, complete = 0, 0
    for path in sorted(VECTORS.glob("*/*/*/stream.gsvc")):
        tier, operation, _ = path.parts[-4:-1]
        data = path.read_bytes()
        # A stream to seek in may have a fault after the frame, and one with layers a fault above its quality.
        unmet = operation == "seek" or (operation in OF_LAYERS and reconstruct_layers(data, 3).error)
        if tier != "faulty" and not unmet:
            found = assert_read_alike(parser, data)
            frames, complete = frames + found[0], complete + found[1]
    assert frames > 1000
    assert complete > 0.99 * frames


@NEEDS_COMPILER
def test_other_languages(tmp_path):
    for language in ("cpp_stl", "java", "javascript"):
        compile_to(language, tmp_path)
    assert {"gsvc.cpp", "Gsvc.java", "Gsvc.js"} <= {path.name for path in tmp_path.iterdir()}


@NEEDS_COMPILER
def test_what_is_wrong_is_refused(tmp_path):
    wrong = tmp_path / "wrong.ksy"
    wrong.write_text(TEXT.replace("type: sequence_header", "type: no_such_type").replace("frame(place)", "frame(none)"))
    with pytest.raises(ValueError, match="none"):
        compile_to("python", tmp_path, wrong)


@NEEDS_COMPILER
def test_diagram(tmp_path):
    """docs/gsvc.svg shows the structures and elements of the graph that the compiler makes now."""
    compile_to("graphviz", tmp_path)
    graph = readable((tmp_path / "gsvc.dot").read_text(encoding="utf-8"))
    labels = {
        label for label in re.findall(r"<TD[^>]*>([a-z_]+)</TD>", graph) if label not in ("pos", "size", "type", "id")
    }
    assert {"magic", "chunk_crc", "survivor_map", "lane_state", "color_index"} <= labels
    assert "never" not in labels
    picture = ElementTree.parse(ROOT / "docs" / "gsvc.svg")
    texts = {element.text for element in picture.iter("{http://www.w3.org/2000/svg}text")}
    assert labels <= texts
