"""Waivers: their file, the day on which they end, what is stale, and what `run` writes."""

import datetime
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import toy_operations

from gsvc_base.errors import UsageError
from gsvc_conformance.__main__ import main
from gsvc_conformance.report.json import read, to_text
from gsvc_conformance.results import Result
from gsvc_conformance.waivers import Waiver, Waivers, patterns, read_waivers, renewed, to_toml

TODAY = datetime.date(2026, 11, 23)
NAMES = [
    "core/halve/one_to_six", "core/scale/by_a_third", "core/scale/by_two", "core/scale/by_two_more", "core/scale/other",
    "stress/scale/nothing",
]  # fmt: skip


def written(folder, text):
    path = folder / "waivers.toml"
    path.write_text(text, encoding="utf-8")
    return path


def waivers_of(tmp_path, text, today=TODAY):
    return read_waivers(written(tmp_path, text), today)


def result(name, outcome="pass", message="", causes=()):
    return Result(name, "A title.", "training", outcome, message, causes=tuple(causes))


FILE = """
[[waiver]]
vectors = ["core/scale/by_*", "core/halve/one_to_six"]
reason = "driver bug"
issue = "https://example.org/1"
until = 2026-11-23

[[waiver]]
vectors = ["*/scale/*"]
reason = "not done"
"""


def test_the_first_that_names_a_vector_and_counts(tmp_path):
    waivers = waivers_of(tmp_path, FILE)
    assert waivers.of("core/scale/by_two").reason == "driver bug"
    assert waivers.of("stress/scale/nothing").reason == "not done"
    assert waivers.of("core/parse/three_bytes") is None
    assert waivers.reasons(NAMES)["core/halve/one_to_six"] == "driver bug (https://example.org/1)"
    assert waivers.reasons(NAMES)["core/scale/other"] == "not done"


def test_the_last_day_counts_and_the_next_one_not(tmp_path):
    after = waivers_of(tmp_path, FILE, TODAY + datetime.timedelta(1))
    assert after.of("core/halve/one_to_six") is None
    assert after.ended("core/halve/one_to_six") == 'the waiver "driver bug" ended on 2026-11-23: it counts no more'
    assert after.of("core/scale/by_two").reason == "not done"
    assert after.ended("core/scale/by_two") == ""
    assert 'the waiver "driver bug" ended on 2026-11-23: it counts no more' in after.stale([], NAMES)
    assert waivers_of(tmp_path, FILE).ended("core/halve/one_to_six") == ""


def test_what_is_stale(tmp_path):
    text = FILE + '[[waiver]]\nvectors = ["core/scale/by_tow", "core/halve/one_to_six"]\nreason = "old"\n'
    results = [result(name, "fail" if "halve" in name else "pass") for name in NAMES]
    assert waivers_of(tmp_path, text).stale(results, NAMES) == [
        'the waiver "old" names core/scale/by_tow, which matches no vector; did you mean core/scale/by_two or '
        "core/scale/by_two_more or core/scale/by_a_third?",
        'the waiver "driver bug" is not needed: core/scale/by_a_third, core/scale/by_two, core/scale/by_two_more pass',
        'the waiver "not done" is not needed: core/scale/other, stress/scale/nothing pass',
    ]
    unsupported = [result(name, "unsupported") for name in NAMES]
    assert waivers_of(tmp_path, FILE).stale(unsupported, NAMES) == []


BAD = {
    "no TOML": ('{"core/scale/by_two": "why"}', "cannot be read as TOML: Invalid statement"),
    "key of the file": ('[[waivers]]\nvectors = ["a"]', "has 'waivers' outside of a waiver; each waiver begins with"),
    "one table": ('[waiver]\nvectors = ["a"]\nreason = "b"', "has one [waiver]; each of them begins with [[waiver]]"),
    "unknown key": ('[[waiver]]\nvectors = ["a"]\nreson = "b"', "has the key 'reson'; did you mean reason?"),
    "unknown key far away": ("[[waiver]]\nxyz = 1", "has the key 'xyz'; it takes vectors, reason, issue, until"),
    "no vectors": ('[[waiver]]\nreason = "b"', 'must have vectors = ["..."]'),
    "a text of vectors": ('[[waiver]]\nvectors = "a"\nreason = "b"', 'must have vectors = ["..."]'),
    "no reason": ('[[waiver]]\nvectors = ["a"]', '(a) must have reason = "..."'),
    "an empty reason": ('[[waiver]]\nvectors = ["a"]\nreason = " "', '(a) must have reason = "..."'),
    "an issue by number": ('[[waiver]]\nvectors = ["a"]\nreason = "b"\nissue = 3', "has the issue 3; it must be"),
    "a date in quotes": ('[[waiver]]\nvectors = ["a"]\nreason = "b"\nuntil = "2027-01-31"', "has until = '2027-01-31'"),
    "a time": ('[[waiver]]\nvectors = ["a"]\nreason = "b"\nuntil = 2027-01-31T10:00:00', "must be a date without"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "sentence"), BAD.values(), ids=BAD)
def test_a_bad_file_is_named_in_a_sentence(tmp_path, text, sentence):
    with pytest.raises(UsageError) as raised:
        waivers_of(tmp_path, text)
    assert sentence in str(raised.value)
    assert "waivers.toml" in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(UsageError, match=r"none\.toml cannot be read: No such file"):
        read_waivers(tmp_path / "none.toml")
    assert read_waivers(None, TODAY).entries == ()


def test_globs_match_no_other_vectors():
    assert patterns(NAMES[1:4], NAMES) == ["core/scale/by_*"]
    assert patterns(NAMES[1:5], NAMES) == ["core/scale/*"]
    assert patterns(NAMES[2:4], NAMES) == NAMES[2:4]
    assert patterns([NAMES[0], NAMES[5]], NAMES) == [NAMES[0], NAMES[5]]


def test_what_is_written_is_read_again(tmp_path):
    awkward = Waiver(
        ("core/scale/by_two",), 'with "quotes", a \\, a\nline and µ', "https://x", datetime.date(2027, 1, 31)
    )
    waivers = Waivers((awkward, Waiver(("a", "b/*"), "plain")), TODAY)
    assert waivers_of(tmp_path, to_toml(waivers)) == waivers


def test_new_waivers_are_grouped_and_old_ones_kept_as_far_as_they_are_needed(tmp_path):
    text = """
        [[waiver]]
        vectors = ["core/halve/*", "core/scale/by_*", "core/paint/gone"]
        reason = "known"
        [[waiver]]
        vectors = ["stress/*"]
        reason = "of a tier that does not run"
        [[waiver]]
        vectors = ["core/scale/other"]
        reason = "mended"
        """
    names = [*NAMES, "core/paint/odd", "core/paint/even", "core/paint/third"]
    results = [
        result("core/halve/one_to_six", "waived"), result("core/scale/by_a_third", "waived"),
        result("core/scale/by_two"), result("core/scale/by_two_more", "waived"),
        result("core/scale/other"),
        result("core/paint/odd", "fail", "is 1", ["a cause", "another"]), result("core/paint/even", "fail", "is 2"),
        result("core/paint/third", "timeout", "no answer in 60 s"),
    ]  # fmt: skip
    new = renewed(waivers_of(tmp_path, text), results, names, {"core/paint/odd", "core/paint/even"})
    assert [(waiver.vectors, waiver.reason) for waiver in new.entries] == [
        (("core/halve/*", "core/scale/by_a_third", "core/scale/by_two_more"), "known"),
        (("stress/*",), "of a tier that does not run"),
        (("core/paint/odd",), "looks like a cause"),
        (("core/paint/even",), "examined, no cause found; others of paint look like a cause"),
        (("core/paint/third",), "timeout: no answer in 60 s"),
    ]
    unseen = renewed(Waivers(), results, names, {"core/paint/odd"}).entries
    assert [waiver.reason for waiver in unseen if waiver.vectors == ("core/paint/even",)] == [
        "not examined; others of paint look like a cause"
    ]


# The options of `run`


def wrong_halves(values):
    return {**toy_operations.halve(values), "count": np.asarray(0)}


def run(folder, *words) -> int:
    return main(["run", *words, "--vectors", str(folder), "--quiet", "--no-diagnosis"])


OPTIONS = """
[[waiver]]
vectors = ["core/halve/*"]
reason = "bug 12"

[[waiver]]
vectors = ["core/scale/by_two"]
reason = "old"

[[waiver]]
vectors = ["core/scale/gone"]
reason = "older"
until = 2020-01-01
"""


def test_a_run_tells_what_is_stale_and_a_strict_one_fails(folder, toy_module, tmp_path, capsys):
    name, file = toy_module(halve=wrong_halves), str(written(tmp_path, OPTIONS))
    assert run(folder, "--module", name, "--waivers", file) == 0
    out = capsys.readouterr().out
    assert "1 waived: bug 12 (halve 1)\n" in out
    assert 'note: the waiver "old" is not needed: core/scale/by_two passes' in out
    assert 'note: the waiver "older" ended on 2020-01-01: it counts no more' in out
    report, junit = tmp_path / "report.json", tmp_path / "junit.xml"
    files = ["--json", str(report), "--junit", str(junit)]
    assert run(folder, "--module", name, "--waivers", file, "--strict-waivers", *files) == 1
    out = capsys.readouterr().out
    assert 'stale: the waiver "old" is not needed: core/scale/by_two passes' in out
    assert out.endswith("FAILED: 3 stale waivers, take them out; 1 waived\n")
    assert to_text(read(report)) == report.read_text(encoding="utf-8")
    assert len(read(report).stale) == 3
    root = ET.parse(junit).getroot()
    assert root.get("failures") == "3"
    assert root.get("tests") == str(len(toy_operations.INPUTS) + 3)


def test_a_strict_run_with_good_waivers_passes(folder, toy_module, tmp_path, capsys):
    name, file = toy_module(halve=wrong_halves), tmp_path / "new.toml"
    assert run(folder, "--module", name, "--write-waivers", str(file)) == 1
    assert f"waivers: {file}" in capsys.readouterr().out
    (entry,) = read_waivers(file).entries
    assert entry.vectors == ("core/halve/one_to_six",)
    assert entry.reason.startswith("fail: output count is 0, expected 6")
    assert run(folder, "--module", name, "--waivers", str(file), "--strict-waivers") == 0
    assert run(folder, "--module", toy_module(), "--waivers", str(file), "--strict-waivers") == 1
    assert run(folder, "--module", toy_module(), "--waivers", str(file), "--write-waivers", str(file)) == 0
    assert read_waivers(file).entries == ()


def test_wrong_use(folder, toy_module, tmp_path, capsys):
    assert run(folder, "--module", toy_module(), "--strict-waivers") == 2
    assert "--strict-waivers needs --waivers FILE" in capsys.readouterr().err
    bad = str(written(tmp_path, "[[waiver]]\n"))
    assert run(folder, "--module", toy_module(), "--waivers", bad) == 2
    assert "waiver 1 of " in capsys.readouterr().err
    assert run(folder, "--module", toy_module(), "--write-waivers", str(tmp_path / "no" / "w.toml")) == 2
