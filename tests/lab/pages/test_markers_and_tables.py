"""Text between markers, and tables in HTML and Markdown."""

import pytest

from gsvc_base.errors import UsageError
from gsvc_base.pages.markers import check_markers, put_between, replaced
from gsvc_base.pages.tables import Markup, html_table, markdown_table

BEGIN, END = "<!-- begin: a command -->", "<!-- end -->"


def test_text_goes_between_the_markers(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n{END}\n", encoding="utf-8")
    for _ in range(2):
        check_markers(page, BEGIN, END)
        put_between(page, BEGIN, END, "new\n")
        assert page.read_text(encoding="utf-8") == f"before\n{BEGIN}\n\nnew\n\n{END}\nafter\n{END}\n"


@pytest.mark.parametrize("text", ["", f"{END}\n{BEGIN}\n", BEGIN, f"{BEGIN}{END}{BEGIN}", f"{BEGIN}{BEGIN}{END}"])
def test_markers_that_are_not_there_are_refused(tmp_path, text):
    page = tmp_path / "page.md"
    page.write_text(text, encoding="utf-8")
    for refuse in (lambda: check_markers(page, BEGIN, END), lambda: put_between(page, BEGIN, END, "new")):
        with pytest.raises(UsageError, match=r"page\.md needs the line .*a command"):
            refuse()
    assert page.read_text(encoding="utf-8") == text
    with pytest.raises(UsageError, match="the document needs"):
        replaced(text, BEGIN, END, "new")


def test_html_escapes_all_but_markup():
    table = html_table(
        ("a<b", "n"), [("x&y", Markup("<b>1</b>")), ("z", "2")], ("text",), foot=("sum", "3"), title='"', key_rows=[1]
    )
    assert table == (
        '<div class="scroll"><table title="&quot;"><thead><tr><th class="text">a&lt;b</th><th>n</th></tr></thead>'
        '<tbody><tr><td class="text">x&amp;y</td><td><b>1</b></td></tr>'
        '<tr class="key"><td class="text">z</td><td>2</td></tr></tbody>'
        '<tfoot><tr><td class="text">sum</td><td>3</td></tr></tfoot></table></div>'
    )
    assert html_table((), [("a",)]) == '<div class="scroll"><table><tbody><tr><td>a</td></tr></tbody></table></div>'


def test_markdown_tables():
    assert markdown_table(["a", "n"], [["x|y", "1"]], [1]) == "| a | n |\n|---|---:|\n| x\\|y | 1 |"
    aligned = markdown_table(["a", "n"], [["wide cell", "1"]], aligned=True)
    assert aligned.splitlines() == ["| a         | n |", "|-----------|---|", "| wide cell | 1 |"]
