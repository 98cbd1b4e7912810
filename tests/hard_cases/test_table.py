"""The tables of docs/stability.md have the cases of the catalogue."""

import re
from pathlib import Path

from gsvc_base.pages.markers import replaced
from tests.hard_cases.catalogue import catalogue
from tests.hard_cases.measuring import Measurement, Worst
from tests.hard_cases.table import BEGIN, END, failures, markdown, number, row

PAGE = Path(__file__).parents[2] / "docs/stability.md"


def test_the_page_lists_exactly_the_cases():
    table = PAGE.read_text(encoding="utf-8").partition(BEGIN)[2].partition(END)[0]
    named = [f"{operation}/{case}" for operation, case in re.findall(r"^\| `(\w+)` (\S+) \|", table, re.MULTILINE)]
    assert named == [*catalogue(), *catalogue()]


def test_the_page_says_of_each_case_what_the_catalogue_says():
    table = PAGE.read_text(encoding="utf-8").partition(BEGIN)[2]
    for entry in catalogue().values():
        assert f"| {entry.danger} | {entry.condition} |" in table


def test_a_line_shows_the_worst_elements():
    entry = next(iter(catalogue().values()))
    ours = {"one": Worst(1e-7, 1e-6), "other": Worst(3e-8, 1e-7)}
    line = row(entry, Measurement(ours, Worst(0.5, 0.25)))
    assert line[3:] == ("2", "0.3", "0.5", "3e-08", "1e-07")
    infinite = row(entry, Measurement({"one": Worst(0.0, 0.0)}, Worst(float("inf"), 0.25)))
    assert infinite[3:] == ("not finite", "equal", "not finite", "0", "exact")
    assert row(entry, Measurement(ours, Worst(1e-9, 0.0)))[3] == "another value"
    assert number(12345.0) == "1.2e+04"


def test_a_case_fails_if_ours_is_outside_or_the_naive_one_within():
    entry = next(iter(catalogue().values()))
    within, outside = Worst(1.0, 1.0), Worst(2.0, 1.0)
    for ours, naive, fails in ((within, outside, False), (outside, outside, True), (within, within, True)):
        assert bool(failures([(entry, Measurement({"one": ours}, naive))])) == fails


def test_only_the_table_of_a_page_is_replaced():
    lines = [(entry.name, entry.operation, *"abcdef") for entry in catalogue().values()]
    page = replaced(f"before\n{BEGIN}\nwhat was\n{END}\nafter\n", BEGIN, END, markdown(lines))
    assert page.startswith(f"before\n{BEGIN}\n\n| case |")
    assert page.endswith(f"|\n\n{END}\nafter\n")
    assert "what was" not in page
