"""The frame of the experiments: command, record, page, document."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest
from html_pages import parsed

from gsvc_base.errors import UsageError
from gsvc_lab.experiments import command, elsewhere, results
from gsvc_lab.experiments.experiment import Experiment, Result, Run, Table, Verdict
from gsvc_lab.experiments.markdown import anchor, document, write_document
from gsvc_lab.experiments.page import page
from gsvc_tools.jobs import cluster as clusters

RESULT = Result(
    "Measured on <nothing>.",
    {"psnr": [30.5, float("inf")]},
    (Table("Numbers", ("what", "PSNR, dB"), (("a|b & c", "30.50"),)),),
    {"splats-one": "A figure & its caption."},
    Verdict("partly", "Because it is < 1."),
)
EXPERIMENT = Experiment("splats", "Splats & quality", "More is better.", lambda run: RESULT, small_threads=1)


@pytest.fixture
def made(quiet):
    return results.record(EXPERIMENT, RESULT, quiet, 1.25)


def test_a_record_is_strict_json_with_all_that_is_promised(made):
    again = json.loads(json.dumps(made, allow_nan=False))
    results.check(again, "here")
    assert again["numbers"] == {"psnr": [30.5, None]}
    assert again["verdict"] == {"holds": "partly", "sentence": "Because it is < 1."}
    assert again["command"] == "python -m gsvc_lab.experiments splats"
    assert again["environment"]["threads"] == 1


def test_the_command_of_a_record_names_no_folders(quiet):
    run = replace(quiet, full=True, clips=("a.mp4", "b.mp4"), uvg="secret", threads=None)
    words = "python -m gsvc_lab.experiments splats --full --clip FILE --clip FILE --uvg DIR"
    assert results.command_line(EXPERIMENT, run) == words
    assert results.command_line(EXPERIMENT, replace(run, threads=2)) == f"{words} --threads 2"


def test_the_threads_of_a_small_version_are_its_own_unless_asked_for(quiet):
    assert [EXPERIMENT.threads(None, full=full) for full in (False, True)] == [1, None]
    assert EXPERIMENT.threads(3, full=False) == 3
    assert results.command_line(EXPERIMENT, quiet) == "python -m gsvc_lab.experiments splats"
    assert results.command_line(EXPERIMENT, replace(quiet, full=True)).endswith("--full --threads 1")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": 2}, "not a result of format 1"),
        ({"claim": None}, "claim must be a str"),
        ({"extra": 1}, "extra is unknown"),
        ({"verdict": {"holds": "maybe", "sentence": ""}}, "a verdict is one of yes, partly, no"),
        ({"tables": [{"title": "T", "columns": ["a"], "rows": [["1", "2"]]}]}, "not one cell for each column"),
    ],
)
def test_what_is_no_record_is_refused(made, change, message):
    with pytest.raises(UsageError, match=message):
        results.check(made | change, "here")


def test_records_come_back_in_the_order_of_the_names(made, tmp_path):
    for name in ("iterations", "splats"):
        results.write(made | {"name": name}, tmp_path)
    assert [one["name"] for one in results.read_all(tmp_path, command.NAMES)] == ["splats", "iterations"]
    (tmp_path / "time.json").write_text("{")
    with pytest.raises(UsageError, match=r"time\.json is no JSON"):
        results.read_all(tmp_path, command.NAMES)


def test_the_page_is_well_formed_and_says_everything(made):
    checked = parsed(page([made]))
    text = " ".join("".join(checked.text).split())
    for part in ("Splats & quality", "More is better.", "partly", "Because it is < 1.", "Measured on <nothing>.",
                 "a|b & c", "30.50", "python -m gsvc_lab.experiments splats", "A figure & its caption."):  # fmt: skip
        assert part in text
    assert ("src", "splats-one.svg") in checked.attributes
    assert ("href", "splats.json") in checked.attributes


def test_the_document_has_claim_verdict_numbers_and_command(made):
    text = document([made], "figures")
    assert "## Splats & quality\n\nThe paper: More is better.\n\n**Here: partly.** Because it is < 1." in text
    assert "![Splats & quality](figures/splats-one.svg)" in text
    assert "| what | PSNR, dB |\n|---|---:|\n| a\\|b & c | 30.50 |" in text
    assert "`python -m gsvc_lab.experiments splats`" in text
    assert f"(#{anchor('Splats & quality')})" in text


def test_sections_without_a_record_stay_as_they_are(made, tmp_path):
    target = tmp_path / "docs" / "experiments.md"
    results_of = tmp_path / "results"
    results_of.mkdir()
    (results_of / "splats-one.svg").write_text("<svg/>")
    (results_of / "old.svg").write_text("<svg/>")
    other = made | {"name": "time", "title": "Time", "figures": {"old": "Old."}}
    target.parent.mkdir()
    write_document([made, other], results_of, target, print)
    whole = target.read_text(encoding="utf-8")
    changed = made | {"setting": "Measured anew.", "verdict": {"holds": "yes", "sentence": "Now."}}
    write_document([changed], results_of, target, print)
    again = target.read_text(encoding="utf-8")
    assert again == document([changed, other], "experiments")
    assert again.split("\n## ")[2] == whole.split("\n## ")[2]
    write_document([other | {"figures": {}}], results_of, target, print)
    assert sorted(path.name for path in (target.parent / "experiments").iterdir()) == ["splats-one.svg"]


def test_a_verdict_says_what_it_is_about(quiet):
    verdict = Verdict("no", "It does not.")
    assert verdict.about(quiet, "1 frame", "--full takes 2").sentence == (
        "It does not. This is about 1 frame; --full takes 2."
    )
    assert verdict.about(replace(quiet, full=True), "1 frame", "--full takes 2").sentence.endswith("1 frame.")


def test_links_lead_to_headings():
    assert anchor("The jumping circle, with and without it") == "the-jumping-circle-with-and-without-it"


@pytest.fixture
def only_splats(monkeypatch):
    """The command with one experiment, which draws a figure by hand."""

    def make(run: Run) -> Result:
        run.say("one step")
        (run.folder / "splats-one.svg").write_text("<svg/>")
        return RESULT

    def load(name):
        if name != "splats":
            raise UsageError(f"{name} needs something")
        return replace(EXPERIMENT, run=make)

    monkeypatch.setattr(command, "load", load)
    monkeypatch.setattr(command, "check_figures", lambda: None)


def test_the_command_runs_keeps_and_shows(only_splats, tmp_path, capsys):
    document = tmp_path / "docs" / "experiments.md"
    words = ["splats", "--output", str(tmp_path), "--markdown", str(document)]
    assert command.main(words) == 0
    out = capsys.readouterr().out
    assert "one step" in out
    assert "Does it hold? partly. Because it is < 1." in out
    assert "Numbers\n\n| what" in out
    assert f"1 of {len(command.NAMES)} experiments" in out
    assert (tmp_path / "index.html").is_file()
    assert (document.parent / "experiments" / "splats-one.svg").read_text() == "<svg/>"
    assert "Splats & quality" in document.read_text(encoding="utf-8")


def test_json_is_all_that_is_printed(only_splats, tmp_path, capsys):
    assert command.main(["splats", "--output", str(tmp_path), "--json"]) == 0
    captured = capsys.readouterr()
    (made,) = json.loads(captured.out)
    assert made == json.loads((tmp_path / "splats.json").read_text(encoding="utf-8"))
    assert "one step" in captured.err


def test_an_experiment_that_cannot_be_made_does_not_stop_the_others(only_splats, tmp_path, capsys):
    assert command.main(["time", "splats", "--output", str(tmp_path)]) == 1
    captured = capsys.readouterr()
    assert "time cannot be made: time needs something" in captured.err
    assert (tmp_path / "splats.json").is_file()


def test_experiments_elsewhere_give_what_they_give_here(only_splats, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(elsewhere, "Processes", lambda jobs: ThreadPoolExecutor(1))  # output is redirected for all
    assert command.main(["time", "splats", "--output", str(tmp_path), "--jobs", "2"]) == 1
    captured = capsys.readouterr()
    assert "time cannot be made: time needs something" in captured.out
    assert f"  {tmp_path / 'splats.json'}, splats-one.svg\n" in captured.out
    assert captured.err == "not made: time\n"
    assert {path.name for path in tmp_path.iterdir()} == {"index.html", "splats.json", "splats-one.svg"}
    monkeypatch.setattr(clusters, "CONNECT_S", 0.1)
    assert command.main(["splats", "--output", str(tmp_path), "--scheduler", "tcp://127.0.0.1:1"]) == 2


def test_ctrl_c_leaves_a_page_of_what_was_made(only_splats, tmp_path, capsys, monkeypatch):
    load = command.load

    def interrupted(run: Run) -> Result:
        raise KeyboardInterrupt

    monkeypatch.setattr(
        command, "load", lambda name: load(name) if name == "splats" else replace(EXPERIMENT, run=interrupted)
    )
    assert command.main(["time", "--output", str(tmp_path / "empty")]) == 130
    assert command.main(["splats", "time", "--output", str(tmp_path)]) == 130
    assert "interrupted; what was done before is kept in" in capsys.readouterr().err
    assert "Splats &amp; quality" in (tmp_path / "index.html").read_text()


def test_failures_alone_are_all_that_is_told(only_splats, tmp_path, capsys):
    assert command.main(["time", "--output", str(tmp_path)]) == 1
    assert capsys.readouterr().err == "  time cannot be made: time needs something\nnot made: time\n"


def test_a_folder_that_cannot_be_is_told_before_anything_runs(only_splats, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert command.main(["splats", "--output", str(tmp_path / "file")]) == 2
    captured = capsys.readouterr()
    assert "file" in captured.err
    assert "one step" not in captured.out


def test_wrong_use_is_told(only_splats, tmp_path, capsys):
    assert command.main(["spalts"]) == 2
    assert "there is no experiment spalts; there are splats, iterations" in capsys.readouterr().err
    assert command.main(["--output", str(tmp_path), "--markdown", str(tmp_path / "a.md")]) == 2
    assert "holds no results" in capsys.readouterr().err


def test_the_command_lists_claims(only_splats, capsys):
    assert command.main(["splats", "--list"]) == 0
    assert capsys.readouterr().out == "splats: Splats & quality\n    More is better.\n"


def test_every_name_is_an_experiment():
    for name in command.NAMES:
        experiment = command.load(name)
        assert experiment.name == name
        assert experiment.claim.endswith(".")


def test_numbers_stand_at_the_right():
    table = {
        "columns": ["a", "b", "c"],
        "rows": [["10", "+0.1 ± 0.2", "with"], ["–", "3:05 min", "1"], ["", "−3", "x"]],
    }
    assert results.text_columns(table) == [False, False, True]
    assert results.text_columns({"columns": ["a", "b"], "rows": []}) == [False, False]
