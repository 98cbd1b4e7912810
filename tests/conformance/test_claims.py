"""Claims: which vectors they need, when they hold, and the words in which verdicts are quoted."""

import json
from dataclasses import replace

import numpy as np
import pytest
import toy_operations
from toy_operations import judge, module

from gsvc_base.errors import UsageError
from gsvc_conformance.__main__ import main
from gsvc_conformance.case import cases
from gsvc_conformance.cases.faults import overview
from gsvc_conformance.claim import Claim, read_claim
from gsvc_conformance.level import LEVELS, level_of
from gsvc_conformance.operation import operations
from gsvc_conformance.profiles import ANY, PROFILES
from gsvc_conformance.report.console import describe, last_line
from gsvc_conformance.report.json import from_object, to_object
from gsvc_conformance.report.junit import junit_xml
from gsvc_conformance.report.page import report_html
from gsvc_conformance.results import OutputResult, Result
from gsvc_conformance.spec import namespace
from gsvc_conformance.vector import VECTORS, sums_of
from gsvc_conformance.vector_folder import Selection, VectorFolder
from gsvc_conformance.verdicts import Report

ENVIRONMENT = {"implementation": "./toy", "vectors": "18fb5299" + "0" * 56, "vector set": "1"}
SET = "GSVC vectors 1 (sha256 18fb5299…)"


def result(level, outcome="pass", group="rendering", slug="x", tier="core"):
    return Result(f"{tier}/paint/{slug}_{level}_{outcome}", "Shows x.", group, outcome, level=level)


def report_of(*results, claim=None, whole=True):
    return Report(ENVIRONMENT, "gsvc-conformance run --impl ./toy", "", [], results, claim=claim, whole=whole)


def claim(level, *options):
    return Claim(("rendering",), "paper", level, options)


# The level of a vector


def test_the_levels_are_those_of_the_document():
    assert list(LEVELS) == list(namespace()["LEVELS"])


def with_level(level):
    data = bytearray(overview())
    data[13] = level  # magic, two versions, `H`, its length, `profile`
    return bytes(data)


@pytest.mark.parametrize(
    ("stream", "level"),
    [
        (with_level(1), 1),
        (with_level(2), 2),
        (with_level(5), 5),
        (with_level(0), 1),
        (with_level(6), 1),
        (with_level(4)[:14], 4),
        (with_level(4)[:13], 1),
        (b"", 1),
        (b"x" + with_level(4)[1:], 1),
        (with_level(4).replace(b"H", b"I", 1), 1),
    ],
)
def test_the_level_of_a_stream_is_what_its_header_states(stream, level):
    for name in ("read_stream", "reconstruct_stream", "decode_stream"):
        assert level_of(operations()[name], {"stream": stream}) == level


def test_a_length_of_several_bytes_stands_before_the_level():
    stream = with_level(3)
    assert level_of(operations()["read_stream"], {"stream": stream[:11] + b"\xc8\x80\x00" + stream[12:]}) == 3


ONE = np.array([[4, 4, 1, 0, 1, 1, 1, 1]], np.float32)
WIDE = np.array([[4, 4, 1e6, 0, 1e6, 1, 1, 1]], np.float32)


@pytest.mark.parametrize(
    ("name", "inputs", "level"),
    [
        ("from_half", {"bits": np.zeros(2**20, np.uint16)}, 1),
        ("render_sum", {"parameters": ONE, "width": 512, "height": 256}, 1),
        ("render_sum", {"parameters": ONE, "width": 513, "height": 256}, 2),
        ("render_sum", {"parameters": np.repeat(ONE, 2**14, 0), "width": 9, "height": 9}, 1),
        ("render_sum", {"parameters": np.repeat(ONE, 2**14 + 1, 0), "width": 9, "height": 9}, 2),
        ("render_sum", {"parameters": np.repeat(WIDE, 2**8, 0), "width": 512, "height": 256}, 1),
        ("render_sum", {"parameters": np.repeat(WIDE, 2**8 + 1, 0), "width": 512, "height": 256}, 2),
        ("render_gradients", {"parameters": np.repeat(WIDE, 257, 0), "residual": np.zeros((256, 512, 3), "f4")}, 2),
        ("scale_parameters", {"parameters": ONE, "width": 8, "height": 8, "new_width": 2048, "new_height": 2048}, 3),
        ("scale_parameters", {"parameters": ONE, "width": 8, "height": 8, "new_width": 65535, "new_height": 65535}, 5),
        ("to_frame", {"sum": np.zeros((256, 513, 3), "f4"), "bit_depth": 8}, 2),
        ("decode_plane", {"data": np.zeros(1, "u1"), "count": 2**18 + 1, "alphabet": 2, "entropy_precision": 12,
                          "lane_count": 1}, 4),
        ("pruning_plan", {"splats": 2**20, "iterations": 9, "fraction": 0.1, "first": 1, "last": 2, "interval": 1}, 4),
        ("learning_rates", {"iterations": np.arange(2**20), "rate": 1.0, "factor": 1.0, "interval": 1}, 1),
    ],
)  # fmt: skip
def test_the_level_of_inputs_is_the_least_that_allows_them(name, inputs, level):
    assert level_of(operations()[name], inputs) == level


def test_cases_of_levels_have_them():
    for number in LEVELS:
        case = cases()[f"core/read_stream/level_{number}"]
        assert level_of(case.operation, case.run()[0]) == number


# Claims in words


def test_a_claim_in_words():
    given = read_claim("bitstream+rendering,paper,2,sizes,live")
    assert given == Claim(("bitstream", "rendering"), "paper", 2, ("sizes", "live"))
    assert (given.judged, given.declared) == (("bitstream", "rendering", "sizes"), ("live",))
    assert str(given) == "bitstream+rendering,paper,2,sizes,live"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("bitstream", "must have the form"),
        ("bitstreem,paper,1", "did you mean|is it|bitstream"),
        ("bitstream,studio,1", "no profile 'studio'"),
        ("bitstream,paper,6", "no level '6'"),
        ("bitstream,paper,1,quick", "no option 'quick'"),
        ("bitstream+bitstream,paper,1", "twice"),
        ("bitstream,paper,1,sizes,sizes", "twice"),
    ],
)
def test_claims_that_are_none(text, reason):
    with pytest.raises(UsageError, match=reason):
        read_claim(text)


# When a claim holds


def test_a_claim_needs_every_vector_of_its_level_and_none_above():
    report = report_of(result(1), result(2), result(3, "unsupported"), claim=claim(2))
    assert report.quotes() == [f"passes {SET}, class rendering, profile paper, level 2, 0 waivers"]
    assert (report.conclusion, report.exit_code) == ("passed", 0)
    assert last_line(report) == "THE CLAIM HOLDS: rendering,paper,2"
    assert "class rendering  passed: 2 vectors pass up to level 2; above it 1 unsupported" in describe(report, 0)


@pytest.mark.parametrize("outcome", ["unsupported", "skipped", "fail", "error", "crash", "timeout"])
@pytest.mark.parametrize("tier", ["core", "uncommon", "stress", "faulty"])
def test_a_vector_of_the_claim_that_does_not_pass_breaks_it(outcome, tier):
    report = report_of(result(1), result(2, outcome, tier=tier), claim=claim(2))
    assert report.exit_code == 1
    assert last_line(report) == "THE CLAIM DOES NOT HOLD: rendering,paper,2"
    (quote,) = report.quotes()
    assert quote.startswith(f"does not pass {SET}, class rendering, profile paper, level 2: ")


@pytest.mark.parametrize("outcome", ["fail", "error", "crash", "timeout"])
def test_a_wrong_answer_above_the_claim_breaks_it(outcome):
    assert report_of(result(1), result(3, outcome), claim=claim(2)).exit_code == 1


@pytest.mark.parametrize("claimed", PROFILES)
def test_a_claim_asks_one_stream_of_another_profile_for_each_operation_that_has_one(claimed):
    vectors = VectorFolder(VECTORS)
    selection = Selection(groups=("bitstream", "seeking", "rendering", "layers"), profile=claimed)
    chosen = [vectors.manifest(name) for name in vectors.select(selection)]
    foreign = [manifest["operation"] for manifest in chosen if manifest["profile"] not in (claimed, ANY)]
    assert sorted(foreign) == ["decode_stream", "reconstruct_layers", "reconstruct_stream", "seek"]


@pytest.mark.parametrize(("outcome", "verdict"), [("pass", "passed"), ("unsupported", "passed"), ("fail", "failed")])
def test_a_stream_of_another_profile_must_be_right_or_refused(outcome, verdict):
    other = replace(result(1, outcome, slug="other"), profile="main")
    (group,) = report_of(replace(result(1), profile="paper"), other, claim=claim(1)).groups()
    assert group.verdict == verdict


def test_waivers_are_counted_in_what_is_quoted():
    report = report_of(result(1), result(1, "waived"), claim=claim(1))
    assert report.exit_code == 0
    assert report.quotes() == [f"passes {SET}, class rendering, profile paper, level 1, 1 waiver"]


def test_a_class_that_is_mostly_waived_is_not_quoted_as_passing():
    report = report_of(result(1), *(result(1, "waived", slug=slug) for slug in "ab"), claim=claim(1))
    assert report.quotes() == [
        f"answers 1 of 3 vectors rightly, 2 waived: {SET}, class rendering, profile paper, level 1"
    ]


def test_nothing_at_all_holds_no_claim():
    assert report_of(result(1, "unsupported"), claim=claim(1)).exit_code == 1


def test_options_are_classes_and_live_is_declared():
    given = report_of(result(1), result(1, group="sizes"), claim=claim(1, "sizes", "live"))
    assert given.quotes() == [
        f"passes {SET}, class rendering, profile paper, level 1, 0 waivers",
        f"passes {SET}, class sizes, profile paper, level 1, 0 waivers",
        "declares live, which no vector judges",
    ]


LAYERS = Result("core/reconstruct_layers/x", "Shows x.", "layers", "pass", profile="main")
NOT_DRAWN = Result("core/decode_layers/x", "Shows x.", "layers", "unsupported", profile="main")


@pytest.mark.parametrize(
    ("classes", "exit_code"),
    [(("reconstruction",), 0), (("bitstream", "rendering"), 1), (("bitstream", "deterministic"), 1)],
)
def test_a_claim_of_layers_needs_their_frames_only_where_frames_are_drawn(classes, exit_code):
    report = report_of(LAYERS, NOT_DRAWN, claim=Claim(classes, "main", 5, ("layers",)))
    assert report.exit_code == exit_code
    wrong = report_of(LAYERS, replace(NOT_DRAWN, outcome="fail"), claim=report.claim)
    assert wrong.exit_code == 1


@pytest.mark.parametrize(
    ("drawn", "verdict"),
    [([], "incomplete"), (["unsupported"], "passed"), (["unsupported", "pass"], "incomplete")],
)
def test_without_a_claim_who_draws_nothing_passes_layers(drawn, verdict):
    report = report_of(LAYERS, NOT_DRAWN, *(result(1, outcome, slug=outcome) for outcome in drawn))
    (layers,) = (group for group in report.groups() if group.name == "layers")
    assert layers.verdict == verdict


@pytest.mark.parametrize(
    ("results", "level", "verdict"),
    [
        ([result(1), result(3)], 5, "passed"),
        ([result(1), result(3, "unsupported")], 2, "passed"),
        ([result(1), result(2), result(4), result(3, "unsupported")], 2, "passed"),
        ([result(1, "unsupported"), result(2)], 0, "incomplete"),
        ([result(1), result(3, "skipped")], 2, "passed"),
        ([result(1), result(3, "fail")], 0, "failed"),
        ([result(1, "unsupported")], 0, "not claimed"),
    ],
)
def test_without_a_claim_the_highest_level_is_worked_out(results, level, verdict):
    report = report_of(*results)
    (group,) = report.groups()
    assert (group.level, group.verdict) == (level, verdict)
    quotes = [f"passes {SET}, class rendering, profile paper, level {level}, 0 waivers"] if level else []
    assert report.quotes() == quotes
    if verdict == "failed":
        assert group.reason.endswith("every one up to level 2 passes")


def test_a_part_of_a_class_is_not_quoted():
    assert report_of(result(1), whole=False).quotes() == []
    early = replace(report_of(result(1)), ended="ended early")
    assert early.quotes() == []
    assert [(one.verdict, one.reason.rpartition("; ")[2]) for one in early.groups()] == [("incomplete", "ended early")]


def test_reports_of_all_forms_have_claim_and_quotes(toys):
    report = report_of(result(1), result(3, "unsupported"), claim=claim(2, "live"))
    quote = f"passes {SET}, class rendering, profile paper, level 2, 0 waivers"
    value = json.loads(json.dumps(to_object(report)))
    assert (value["claim"], value["quotes"][0], value["classes"][0]["level"]) == ("rendering,paper,2,live", quote, 2)
    assert value["results"][1]["level"] == 3
    again = from_object(value)
    assert (again.claim, again.quotes(), again.exit_code) == (report.claim, report.quotes(), 0)
    assert f'name="claim" value="{report.claim}"' in junit_xml(report)
    assert quote in junit_xml(report)
    assert quote in report_html(report)


# The command


def run(folder, *words):
    return main(["run", "--vectors", str(folder), "--quiet", "--no-diagnosis", *words])


def at_level(folder, name, level):
    """Give a vector of a folder another level."""
    path = folder / name / "manifest.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "level": level}))
    files = {}
    for part in folder.glob("*/*/*/*"):
        files.setdefault(part.parent.relative_to(folder).as_posix(), {})[part.name] = part.read_bytes()
    (folder / "SHA256SUMS").write_bytes(sums_of(files))


def test_a_claim_judges_its_classes_alone_and_the_exit_code_says_whether_it_holds(folder, toy_module, capsys):
    wrong = toy_module(halve=lambda values: {})
    assert run(folder, "--module", wrong, "--claim", "bitstream+rendering,paper,1") == 0
    out = capsys.readouterr().out
    assert "THE CLAIM HOLDS: bitstream+rendering,paper,1" in out
    assert out.count("passes vectors of no set (sha256 ") == 2  # the toys are nobody's set
    assert "halve" not in out
    assert run(folder, "--module", wrong, "--claim", "quantization,paper,1") == 1
    assert "does not pass vectors of no set (sha256 " in capsys.readouterr().out


def test_a_decoder_of_a_low_level_refuses_what_is_above_it(folder, toy_module, capsys):
    def parse(stream):
        low = {"count": np.asarray(0), "error": "unsupported R-5-6 88"}
        return low if stream == b"abc" else toy_operations.parse(stream)

    at_level(folder, "core/parse/three_bytes", 3)
    assert run(folder, "--module", toy_module(parse=parse), "--claim", "bitstream,paper,2") == 0
    assert "up to level 2; above it 1 unsupported" in capsys.readouterr().out
    assert run(folder, "--module", toy_module(parse=parse), "--claim", "bitstream,paper,3") == 1
    assert run(folder, "--module", toy_module(parse=parse), "--class", "bitstream") == 0
    assert "class bitstream, profile paper, level 2, 0 waivers" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--claim", "metrics,paper,1"], "class metrics"),
        (["--claim", "rendering,paper,1,sizes"], "no vectors of profile paper in the class sizes"),
        (["--claim", "rendering,paper,1", "--operation", "paint"], "says which vectors are judged"),
        (["--claim", "rendering,paper,1", "--skip", "*"], "says which vectors are judged"),
        (["--claim", "rendering"], "must have the form"),
    ],
)
def test_claims_that_cannot_be_judged(folder, toy_module, capsys, words, reason):
    assert run(folder, "--module", toy_module(), *words) == 2
    assert reason in capsys.readouterr().err


# Rules and bits of refusals


def test_rules_and_bits_are_counted_by_class_for_implementations_that_name_them(folder):
    def parse(stream, error):
        given = toy_operations.parse(stream)
        return {**given, "error": error if given["error"] else ""}

    for error, said, advice in (
        ("malformed R-3.1-1 8", "rule right in 1 of 1, bit in 1 of 1", ""),
        ("malformed R-3.1-1 9", "rule right in 1 of 1, bit in 0 of 1", ""),
        ("malformed R-9-9 8", "rule right in 0 of 1, bit in 0 of 1", "names R-9-9, expected R-3.1-1"),
        ("malformed", "", ""),
    ):
        report = judge(folder, module(parse=lambda stream, error=error: parse(stream, error)))
        assert report.passed
        text = "\n".join(describe(report, 10))
        assert (f"refusals, class bitstream: {said}" in text) == bool(said)
        assert (f"advice: faulty/parse/bad_letter error {advice}" in text) == bool(advice)
        assert ("<h2>Refusals</h2>" in report_html(report)) == bool(said)
        assert said in report_html(report)
        assert advice in report_html(report)
        value = to_object(report)
        counts = next(entry for entry in value["classes"] if entry["name"] == "bitstream").get("refusals")
        assert (counts is not None) == bool(said)
        assert [output for _, output in from_object(value).advice()] == [output for _, output in report.advice()]


def test_no_more_advice_is_listed_than_asked_for():
    output = OutputResult("error", "refusal", True, refused="kind", advice="names R-9-9, expected R-3.1-1")
    results = [Result(f"faulty/parse/x_{n}", "x", "bitstream", "pass", "", (output,)) for n in range(5)]
    lines = describe(report_of(*results), 2)
    assert sum(line.startswith("advice: faulty/parse/x_") for line in lines) == 2
    assert "advice: 3 more vectors with a wrong rule" in lines
