"""The syntax of spec.md as data: all that the document says is in it, and the files are what it gives, also to C."""

import json
import re
import shutil
import subprocess

import pytest

import gsvc_base.syntax as reading
from gsvc_base.syntax import elements, named, number, rules_of, syntax
from gsvc_conformance.__main__ import main
from gsvc_conformance.c_header import c_header
from gsvc_conformance.elements import ELEMENTS
from gsvc_conformance.runner import judge_outputs
from gsvc_conformance.spec import SPEC, header_rows, namespace
from gsvc_conformance.syntax_files import FILES, ROOT, stale, write
from gsvc_conformance.vector import VECTORS, read
from gsvc_ref.bitstream import LEVELS

TEXT = SPEC.read_text(encoding="utf-8")
PARTS = {"\n## 6 ": "\n## 7 ", "\n## 15 ": "\n## Annex A"}
SECTIONS = "".join(TEXT[TEXT.index(first) : TEXT.index(end)] for first, end in PARTS.items())


def structure(name):
    return next(one for one in syntax()["structures"] if one["name"] == name)


def test_files_are_what_the_document_gives(tmp_path, capsys):
    assert stale() == []
    assert main(["syntax"]) == 0
    assert capsys.readouterr().out == ""
    assert stale(tmp_path) == list(FILES) == write(tmp_path)
    (tmp_path / "spec" / "gsvc.h").write_text("#define GSVC_LEVEL_MAX 6\n")
    assert stale(tmp_path) == write(tmp_path) == ["spec/gsvc.h"]
    assert stale(tmp_path) == []


def test_where_nothing_is_to_be_compared_the_command_says_so(tmp_path, capsys):
    assert main(["syntax", "--into", str(tmp_path)]) == 2
    said = f"{tmp_path} has neither {' nor '.join(FILES)}: give the folder of a checkout"
    assert said in capsys.readouterr().err


def test_the_command_tells_what_to_do(monkeypatch, capsys):
    monkeypatch.setattr("gsvc_conformance.commands.syntax.stale", lambda folder: ["spec/gsvc.h"])
    assert main(["syntax"]) == 1
    assert "spec/gsvc.h is not what spec.md gives; write it with: gsvc-conformance syntax --write" in (
        capsys.readouterr().out
    )


def test_shape():
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads((ROOT / "spec/syntax.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    written = json.loads((ROOT / "spec/syntax.json").read_text(encoding="utf-8"))
    jsonschema.validate(written, schema)
    del written["structures"][0]["elements"][0]["rules"]
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(written, schema)


def test_every_heading_and_every_row_of_sections_6_and_15_is_there():
    headings = re.findall(r"^#### (.*)$", SECTIONS, re.MULTILINE)
    names = [part.replace("`", "") for heading in headings for part in heading.split(", ")]
    assert sorted(names) == sorted(named()) == sorted(ELEMENTS)
    tables = re.findall(r"^\| (\w+)\(.*?\) \| descriptor \|\n\|[-| ]+\n((?:\|.*\n)+)", SECTIONS, re.MULTILINE)
    assert [name for name, _ in tables] == [one["name"] for one in syntax()["structures"]]
    for name, rows in tables:
        described = [row.split("|")[2].strip() for row in rows.splitlines()]
        own = [e["descriptor"] for e in structure(name)["elements"] if "descriptor" in e]
        assert {cell.removesuffix(" each").replace("`", "") for cell in described if cell} == set(own)


def test_every_rule_has_its_place():
    ids = set(re.findall(r"\*\*(R-[\w.-]+)\*\* ", TEXT))
    assert ids == set(syntax()["rules"])
    placed = {rule for one in syntax()["structures"] for rule in one["rules"]}
    placed |= {rule for _, element in elements() for rule in element["rules"]}
    assert {rule for rule in ids if re.match(r"R-6\.[1-8]-", rule)} <= placed


def test_header_is_that_of_the_code():
    rows = {row[0]: row[1:] for row in header_rows("paper")}
    elements_of_header = [e["name"] for e in structure("sequence_header")["elements"]]
    assert [name for name in elements_of_header if "(" not in name] == list(rows)
    for name, (size, *_) in rows.items():
        assert named()[name]["descriptor"] == f"le({size})"
    for name in ("level", "width", "height", "frame_rate_numerator", "bit_depth", "cholesky_bits", "color_stages",
                 "color_codewords", "entropy_precision", "lane_count"):  # fmt: skip
        assert (named()[name]["minimum"], named()[name]["maximum"]) == rows[name][1:3]


def test_levels_are_those_of_the_decoder():
    assert [row["level"] for row in syntax()["levels"]] == list(LEVELS)
    for row, level in zip(syntax()["levels"], LEVELS.values(), strict=True):
        assert list(row["limits"].values())[:4] == [level.pixels, level.splats, level.work, level.payload]


def test_what_is_said_about_an_element():
    frequency = named()["frequency"]
    assert frequency["descriptor"] == "eg(golomb_order)"
    assert frequency["within"] == [{"if": "plane_mode = 2, coded"}, {"for": "s = first_symbol .. last_symbol"}]
    assert "R-6.6-4" in frequency["rules"]
    assert "R-3.1-3" in rules_of(frequency)
    assert frequency["meaning"].startswith("The frequency of a symbol, in units of 2^−table_bits")
    assert named()["plane_mode"]["values"] == {"0": "constant", "1": "raw", "2": "coded"}
    assert named()["plane_mode"]["reserved"] == "plane_mode 3 is reserved"
    assert named()["flags"]["bits"]["parameter_checksum_flag"] == 0
    assert named()["cholesky_code"]["maximum"] == "2^b − 1"
    assert (named()["codeword_count"]["index"], named()["codeword_count"]["maximum"]) == ("k", "B")
    assert named()["frame_count (end)"]["rules"] == ["R-6.8-1"]
    assert named()["frame_count"] is not named()["frame_count (end)"]
    assert named()["quantizer_present"]["rules"].count("R-6.5-3") == 1
    assert named()["stage_count"]["absent"] == "Absent if codebooks_present is 0: that of the kept codebooks"


@pytest.mark.parametrize(
    ("text", "value"),
    [("1024", 1024), ("2^16", 65536), ("2¹⁷", 131072), ("2³² − 1", 2**32 - 1), ("2^b", None), ("a", None), ("", None)],
)
def test_numbers(text, value):
    assert number(text) == value


def test_rows_of_a_table_nest():
    rows = [
        ["if (`a` > 0) { for (i = 0 .. f(`n`) − 1) `b`[i]", "`u(1)`"],
        ["  each_of() } `c`, `d` (D)", "`le(2)` each"],
    ]
    found = [(e["name"], e["index"], e["descriptor"], e["within"]) for e in reading._elements(rows)]
    assert found == [
        ("b", "i", "u(1)", [{"if": "a > 0"}, {"for": "i = 0 .. f(n) − 1"}]),
        ("each_of()", None, None, [{"if": "a > 0"}]),
        ("c", None, "le(2)", []),
        ("d", None, "le(2)", []),
    ]
    with pytest.raises(ValueError, match="stays open"):
        list(reading._elements([["if (`a` > 0 `b`", "`u(1)`"]]))


def macros():
    """Names and values of the constants, but for the initialiser, as C writes them."""
    found = re.findall(r"^#define (GSVC_\w+) (?!\{)(\S.*?)(?: /\*.*)?$", c_header(), re.MULTILINE)
    assert len(found) == len({name for name, _ in found}) > 50
    return dict(found)


@pytest.mark.parametrize(
    ("compiler", "options"), [("cc", ["-x", "c", "-std=c99"]), ("c++", ["-x", "c++", "-std=c++17"])]
)
def test_the_header_is_c(tmp_path, compiler, options):
    """What a compiler takes the constants for is what spec.md says."""
    if shutil.which(compiler) is None:
        pytest.skip(f"there is no {compiler} here")
    program = tmp_path / "program.c"
    lines = [f'    printf("{name} %.17g\\n", (double)({name}));' for name in macros()]
    program.write_text(
        '#include <stdio.h>\n#include "gsvc.h"\n#include "gsvc.h"\nint main(void) {\n'
        "    static const unsigned char magic[GSVC_MAGIC_SIZE] = GSVC_MAGIC;\n"
        '    printf("GSVC_MAGIC %d\\n", magic[GSVC_MAGIC_SIZE - 1]);\n' + "\n".join(lines) + "\n    return 0;\n}\n"
    )
    strict = ["-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-I{ROOT / 'spec'}"]
    subprocess.run([compiler, *options, *strict, str(program), "-o", str(tmp_path / "run")], check=True)
    said = subprocess.run([str(tmp_path / "run")], check=True, capture_output=True, text=True).stdout
    values = {name: float(value) for name, value in (line.split() for line in said.splitlines())}
    assert values.pop("GSVC_MAGIC") == 0x1A
    assert values.keys() == macros().keys()
    code = namespace()
    compared = 0
    for constant in syntax()["constants"]:
        value = code.get(constant["name"] or "")
        if f"GSVC_{constant['name']}" in values and constant["name"] != "MAGIC":
            assert values[f"GSVC_{constant['name']}"] == float(value)
            compared += 1
    assert compared > 15
    for element in named().values():
        ends = [element.get("minimum"), element.get("maximum")]
        if all(isinstance(end, int) for end in ends):
            name = re.sub(r"\W+", "_", element["heading"]).strip("_").upper()
            assert [values[f"GSVC_{name}_{end}"] for end in ("MIN", "MAX")] == ends
    for number_of, level in LEVELS.items():
        assert values[f"GSVC_LEVEL_{number_of}_PIXELS"] == level.pixels
        assert values[f"GSVC_LEVEL_{number_of}_RENDERING_WORK_FRAME"] == level.work
    chunk_types = {name.rpartition("_")[2]: value for name, value in values.items() if name.startswith("GSVC_CHUNK_")}
    assert chunk_types == {"P": ord("p")} | {letter.upper(): ord(letter) for letter in "HIREdntxqrs"}
    assert [values[f"GSVC_LAYER_TYPE_{letter}"] for letter in "IPR"] == [0, 1, 2]
    assert (values["GSVC_PLANE_MODE_CODED"], values["GSVC_CHROMA_FORMAT_420"]) == (2, 1)


def test_two_constants_of_one_name_are_refused(monkeypatch):
    twice = {"name": "HALF", "value": "0.5", "hexadecimal": "0x1p-1", "meaning": None, "section": "9"}
    monkeypatch.setattr("gsvc_conformance.c_header.syntax", lambda: syntax() | {"constants": [twice, twice]})
    with pytest.raises(ValueError, match="GSVC_HALF"):
        c_header()


def test_the_kit_names_the_element_of_a_wrong_refusal():
    vector = read(VECTORS / "faulty/reconstruct_stream/r_6_6_4_sum_too_large")
    expected = vector.expected["error"].value
    outputs = {name: one.value for name, one in vector.expected.items()} | {"error": "malformed R-6.2-2 416"}
    message = judge_outputs(vector, outputs).message
    assert (
        f"(bit 416: chunk_type, frame 0; bit {expected.split()[2]}: frequency[0] of position_low x, frame 0)" in message
    )
