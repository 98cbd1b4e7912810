"""What an implementation is made for: what features.toml may say, what vectors need, and how both judge."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import toy_operations
from test_claims import at_level
from toy_operations import judge, module, outcomes

from gsvc_base.errors import UsageError
from gsvc_conformance.__main__ import main
from gsvc_conformance.claim import read_claim
from gsvc_conformance.features import Features, features_of, most_splats, read_features, stated_header
from gsvc_conformance.operation import operations
from gsvc_conformance.report.console import describe, last_line
from gsvc_conformance.report.json import from_object, to_object
from gsvc_conformance.report.junit import junit_xml
from gsvc_conformance.report.page import report_html
from gsvc_conformance.vector import VECTORS, Vector
from gsvc_conformance.vector_folder import Selection, VectorFolder
from gsvc_ref.stream import reconstruct_stream

FULL = """
profiles = ["paper"]
level = 2
bit_depths = [8, 10]
lanes = [1, 32]
max_splats = 4096
classes = ["bitstream"]
operations = ["render_sum"]
"""


def written(tmp_path, text):
    path = tmp_path / "features.toml"
    path.write_text(text, encoding="utf-8")
    return path


# The file


def test_every_key_is_read(tmp_path):
    features = read_features(written(tmp_path, FULL))
    assert features == Features(("paper",), 2, (8, 10), (1, 32), 4096, ("bitstream",), ("render_sum",))
    assert str(features) == (
        "profile paper; level 2; bit depth 8, 10; lanes 1, 32; splats at most 4,096; class bitstream; "
        "operation render_sum"
    )
    assert features_of(features.to_object(), "x") == features
    assert read_features(written(tmp_path, "")) == Features()
    assert str(Features()) == "everything"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("bitdepths = [8]", "has the key 'bitdepths'; did you mean bit_depths?"),
        ("speed = 1", "has the key 'speed'; the keys are profiles, level, bit_depths, lanes, max_splats, classes"),
        ("level = 0", "level of .* is 0; it must be a whole number of 1 to 5"),
        ("level = true", "level of .* is True; it must be a whole number of 1 to 5"),
        ("level = '2'", "level of .* is '2'; it must be"),
        ("max_splats = -1", "max_splats of .* is -1; it must be a whole number of 0 to"),
        (
            "bit_depths = 8",
            "bit_depths of .* is 8; it must be a list with at least one entry: a whole number of 8 to 16",
        ),
        ("bit_depths = []", "must be a list with at least one entry"),
        ("bit_depths = [8, 17]", "bit_depths of .* has 17; an entry must be a whole number of 8 to 16"),
        ("lanes = [0]", "lanes of .* has 0; an entry must be a whole number of 1 to 64"),
        ("lanes = [true]", "lanes of .* has True; an entry must be"),
        ("lanes = [[1]]", r"lanes of .* has \[1\]; an entry must be"),
        ("lanes = [4, 4]", "lanes of .* has 4 twice"),
        ("profiles = ['papre']", "profiles of .* has 'papre'; did you mean paper?"),
        ("classes = ['renderin']", "did you mean rendering"),
        ("operations = ['render']", "did you mean render_sum"),
        ("level: 2", "features.toml cannot be read as TOML: "),
    ],
)
def test_files_with_something_wrong(tmp_path, text, reason):
    with pytest.raises(UsageError, match=reason):
        read_features(written(tmp_path, text))


def test_what_is_no_text_is_no_toml(tmp_path):
    (tmp_path / "features.toml").write_bytes(b"level = 2 # \xff")
    with pytest.raises(UsageError, match="cannot be read as TOML"):
        read_features(tmp_path / "features.toml")


# What vectors need


FOLDER = VectorFolder(VECTORS)


def vectors(**chosen):
    """Vectors of the set, by the kinds of a selection."""
    return FOLDER.read(FOLDER.select(Selection(**{kind: (value,) for kind, value in chosen.items()})))


def test_splats_are_those_that_the_fast_decoder_finds():
    for vector in vectors(tiers="uncommon", operations="reconstruct_stream"):
        assert most_splats(vector) == max(reconstruct_stream(vector.inputs["stream"]).counts, default=0)


def test_lanes_and_bit_depths_are_inputs_or_stand_in_headers():
    seen = {"bit_depth": set(), "lane_count": set()}
    for operation in ("decode_plane", "render_frame", "decode_stream"):
        for vector in vectors(operations=operation):
            stream = vector.inputs.get("stream")
            needs = stated_header(stream) if stream else vector.inputs
            for name, key, words in (("bit_depth", "bit_depths", "bit depth {}"), ("lane_count", "lanes", "{} lane")):
                if value := needs.get(name):
                    seen[name].add(value)
                    assert Features(**{key: (value,)}).outside(vector) == ""
                    assert Features(**{key: (value - 1,)}).outside(vector).startswith(words.format(value))
    assert {8, 16} <= seen["bit_depth"]
    assert {1, 64} <= seen["lane_count"]


def test_splats_are_rows_counts_and_what_faulty_frames_state():
    one = next(vectors(tiers="core", operations="render_sum"))
    rows = np.zeros((7, 8), "f4")
    many = replace(one, inputs={**one.inputs, "parameters": rows})
    assert Features(max_splats=6).outside(many) == "more than 6 splats"
    assert Features(max_splats=7).outside(many) == ""
    stated = vectors(patterns="r_5_2*")
    assert any(most_splats(vector) > 1 << 14 for vector in stated)


def test_a_header_that_cannot_be_read_states_nothing():
    for stream in (b"", b"GSVC", b"x" * 100):
        assert stated_header(stream) == {}
        assert most_splats(Vector("a/b/c", {}, operations()["reconstruct_stream"], {"stream": stream}, {})) == 0


def test_operations_are_those_of_the_classes_and_those_named():
    frame, plane = (next(vectors(tiers="core", operations=name)) for name in ("render_frame", "decode_plane"))
    for features, reasons in (
        (Features(classes=("rendering",)), ("", "the operation decode_plane")),
        (Features(operations=("decode_plane",)), ("the operation render_frame", "")),
        (Features(classes=("rendering",), operations=("decode_plane",)), ("", "")),
        (Features(level=5), ("", "")),
    ):
        assert (features.outside(frame), features.outside(plane)) == reasons


def test_frames_of_layers_are_for_what_draws():
    layers = next(vectors(tiers="core", operations="decode_layers"))
    assert Features(classes=("layers", "deterministic")).outside(layers) == ""
    assert Features(classes=("layers", "reconstruction")).outside(layers) == "the operation decode_layers"


def test_all_needs_are_told():
    vector = next(v for v in vectors(tiers="core", operations="render_frame") if v.inputs["bit_depth"] == 8)
    above = replace(vector, manifest={**vector.manifest, "level": 4, "profile": "main"})
    features = Features(("paper",), 3, (10,), None, None, ("bitstream",))
    assert features.outside(above) == "the operation render_frame, profile main, level 4, bit depth 8"


# How they judge


EIGHT = Features(bit_depths=(8,))
TEN = "uncommon/paint/ten_bits"


def unsupported(**_):
    raise NotImplementedError("no")


def paint(width, height, bit_depth):
    if bit_depth > 8:
        unsupported()
    return toy_operations.paint(width, height, bit_depth)


def result_of(report, name):
    return next(result for result in report.results if result.id == name)


def test_what_is_outside_may_be_refused(folder):
    report = replace(judge(folder, module(paint=paint), features=EIGHT), features=EIGHT)
    assert result_of(report, TEN).message == "no: outside of its features (bit depth 10)"
    assert (report.exit_code, report.features_hold) == (0, True)
    without = f"without part of paint (1 vector: {TEN}), outside of its features"
    assert f"incomplete: 1 vector pass, none is wrong; {without}" in str(describe(report, 5))
    assert last_line(report) == "ITS FEATURES HOLD, but incomplete: rendering"
    assert "features: bit depth 8; 8 vectors inside; 1 outside, of which 1 unsupported" in describe(report, 5)


def test_what_is_inside_must_not(folder):
    report = replace(judge(folder, module(halve=unsupported), features=EIGHT), features=EIGHT)
    result = result_of(report, "core/halve/one_to_six")
    assert (result.outcome, result.message) == ("fail", "inside of its features, and unsupported: no")
    assert (report.exit_code, report.features_hold) == (1, False)


def test_what_is_outside_and_right_passes(folder):
    report = judge(folder, module(), features=EIGHT)
    assert report.passed
    assert [result.id for result in report.results if result.outside] == [TEN]


def test_what_is_outside_and_wrong_is_wrong(folder):
    def black(width, height, bit_depth):
        given = toy_operations.paint(width, height, bit_depth)
        return {"frame": given["frame"] * 0 + 1000} if bit_depth > 8 else given

    def fails(width, height, bit_depth):
        return toy_operations.paint(width, height, bit_depth) if bit_depth == 8 else {}

    for function, outcome in ((black, "fail"), (fails, "error")):
        result = result_of(judge(folder, module(paint=function), features=EIGHT), TEN)
        assert result.outcome == outcome
        assert result.message.startswith(
            "outside of its features (bit depth 10), where it must be right or unsupported: "
        )


def test_streams_are_refused_by_their_error_too(folder):
    at_level(folder, "core/parse/three_bytes", 1)
    low = {"count": np.asarray(0), "error": "unsupported R-5-6 88"}
    refusing = module(parse=lambda stream: low if stream == b"abc" else toy_operations.parse(stream))
    name = "core/parse/three_bytes"
    none, inside = (judge(folder, refusing, features=features) for features in (None, EIGHT))
    assert outcomes(none)[name] == outcomes(inside)[name] == "fail"
    at_level(folder, name, 3)
    level = judge(folder, refusing, features=Features(level=2))
    assert result_of(level, name).message == "error is 'unsupported R-5-6 88': outside of its features (level 3)"
    assert outcomes(judge(folder, refusing, features=Features(level=3)))[name] == "fail"


def test_a_level_that_is_not_named_is_no_limit(folder):
    at_level(folder, "core/halve/one_to_six", 4)
    assert outcomes(judge(folder, module(halve=unsupported)))["core/halve/one_to_six"] == "unsupported"
    assert outcomes(judge(folder, module(halve=unsupported), features=EIGHT))["core/halve/one_to_six"] == "fail"


def test_what_is_skipped_inside_does_not_hold(folder):
    skips = {"core/halve/one_to_six": "--skip"}
    report = replace(judge(folder, module(paint=paint), features=EIGHT, skips=skips), features=EIGHT)
    assert last_line(report).startswith("NOTHING IS WRONG")
    report = replace(judge(folder, module(), features=EIGHT, skips={TEN: "--skip"}), features=EIGHT)
    assert last_line(report).startswith("ITS FEATURES HOLD")


# The command


def run(folder, *words):
    return main(["run", "--vectors", str(folder), "--quiet", "--no-diagnosis", *words])


def test_reports_of_all_forms_say_the_features(folder, toy_module, tmp_path, capsys):
    path = written(tmp_path, "bit_depths = [8]\n")
    name = toy_module(paint=paint)
    assert run(folder, "--module", name, "--features", str(path), "--json", str(tmp_path / "r.json")) == 0
    assert "ITS FEATURES HOLD, but incomplete: rendering" in capsys.readouterr().out
    value = json.loads((tmp_path / "r.json").read_text())
    assert value["features"] == {"bit_depths": [8]}
    assert [result["outside"] for result in value["results"] if "outside" in result] == ["bit depth 10"]
    report = from_object(value)
    assert report.features == EIGHT
    assert to_object(report) == value
    assert f"--features {path}" in report.command
    assert "bit depth 8: 8 vectors inside; 1 outside, of which 1 unsupported." in report_html(report)
    assert 'name="features" value="bit depth 8"' in junit_xml(report)


def test_right_answers_outside_are_noted(folder, toy_module, tmp_path, capsys):
    path = written(tmp_path, "bit_depths = [8]\n")
    assert run(folder, "--module", toy_module(), "--features", str(path)) == 0
    note = "1 vector outside of its features got right answers, which its features could claim: bit depth 10 (1)"
    assert f"note: {note}" in capsys.readouterr().out


def test_a_claim_that_agrees(folder, toy_module, tmp_path, capsys):
    path = written(tmp_path, "level = 1\nclasses = ['bitstream', 'rendering']\nprofiles = ['paper']\n")
    words = ("--module", toy_module(), "--features", str(path))
    assert run(folder, *words, "--claim", "bitstream,paper,1") == 0
    assert "THE CLAIM HOLDS" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("features", "claim", "keys"),
    [
        (Features(level=1), "rendering,paper,2", "level"),
        (Features(level=3), "rendering,paper,2", "level"),
        (Features(bit_depths=(8,), max_splats=5), "rendering,paper,2", "bit_depths, max_splats"),
        (Features(classes=("rendering",)), "rendering+bitstream,paper,2", "classes"),
        (Features(operations=("render_sum",)), "rendering,paper,2", "operations"),
        (Features(), "rendering,paper,2", ""),
        (Features(classes=("layers", "bitstream")), "bitstream,main,2,layers", ""),
        (Features(level=2, profiles=("paper",), classes=("rendering", "sizes")), "rendering,paper,2,sizes", ""),
    ],
)
def test_a_claim_that_does_not(features, claim, keys):
    if not keys:
        features.check_claim(read_claim(claim))
        return
    with pytest.raises(UsageError, match=re.escape(f"--claim {claim} and {keys} of --features do not agree")):
        features.check_claim(read_claim(claim))


def test_files_that_are_not_there(folder, toy_module, tmp_path, capsys):
    assert run(folder, "--module", toy_module(), "--features", str(tmp_path / "none.toml")) == 2
    assert "none.toml" in capsys.readouterr().err
