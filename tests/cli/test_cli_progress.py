import io
import sys

import pytest

from gsvc_base.cli.progress import DELAY_S, INTERVAL_S, PlainLine, ProgressDisplay, RichLine, open_line


class Terminal(io.StringIO):
    def isatty(self):
        return True


class Recorder:
    def __init__(self):
        self.shown = []

    def show(self, text, share):
        self.shown.append((text, share))

    def clear(self):
        self.shown.append("clear")


class Clock:
    now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def recorder():
    return Recorder()


def display(recorder, clock, **options):
    return ProgressDisplay(stream=Terminal(), clock=clock, line=lambda stream: recorder, **options)


def test_time_left_follows_from_the_share_done(recorder):
    clock = Clock()
    shown = display(recorder, clock)
    clock.now += 10
    shown.update("frame 5/20", 5, 20)
    shown.close()
    assert recorder.shown == [("frame 5/20  30 s left", 0.25), "clear"]


def test_nothing_is_estimated_before_the_first_is_done(recorder):
    clock = Clock()
    shown = display(recorder, clock)
    for done in (0.5, 1):
        clock.now += 10
        shown.update("frame 1/2", done, 2)
    assert recorder.shown == [("frame 1/2", 0.25), ("frame 1/2  20 s left", 0.5)]


def test_nothing_is_estimated_where_the_caller_would_know(recorder):
    clock = Clock()
    shown = display(recorder, clock)
    for left_s in (None, 7.0):
        clock.now += 10
        shown.update("frame 2/4", 2, 4, left_s=left_s, guess=False)
    assert recorder.shown == [("frame 2/4", 0.5), ("frame 2/4  about 7.0 s left", 0.5)]


def test_nothing_is_estimated_without_a_total(recorder):
    clock = Clock()
    shown = display(recorder, clock)
    clock.now += 10
    shown.update("frame 5", 5, None)
    assert recorder.shown == [("frame 5", None)]


def test_short_commands_and_frequent_updates_show_nothing(recorder):
    clock = Clock()
    shown = display(recorder, clock)
    clock.now += DELAY_S / 2
    shown.update("too soon", 1, 2)
    clock.now += DELAY_S
    shown.update("first", 1, None)
    clock.now += INTERVAL_S / 2
    shown.update("too soon again", 1, None)
    clock.now += INTERVAL_S
    shown.update("second", 1, None)
    assert recorder.shown == [("first", None), ("second", None)]


@pytest.mark.parametrize("quiet", [True, False])
def test_silent_when_quiet_or_not_on_a_terminal(recorder, quiet):
    clock = Clock()
    stream = Terminal() if quiet else io.StringIO()
    with ProgressDisplay(quiet=quiet, stream=stream, clock=clock, line=lambda stream: recorder) as shown:
        clock.now += 10
        shown.update("frame", 1, 2)
        shown.status("status")
        assert not shown.active
    assert recorder.shown == []
    assert stream.getvalue() == ""


def test_plain_line_overwrites_what_was_longer(monkeypatch):
    monkeypatch.setenv("COLUMNS", "20")
    stream = Terminal()
    line = PlainLine(stream)
    line.show("a long line that does not fit", None)
    line.show("short", 0.5)
    line.clear()
    first, second, blank, rest = stream.getvalue().split("\r")[1:]
    assert (first, second, blank, rest) == ("a long line that do", " 50%  short" + " " * 8, " " * 11, "")


def test_rich_line_hides_nothing_after_it_is_cleared(monkeypatch):
    pytest.importorskip("rich")
    monkeypatch.setenv("TERM", "xterm")
    stream = Terminal()
    line = open_line(stream)
    assert isinstance(line, RichLine)
    line.show("frame [1]/2", 0.5)
    line.clear()
    assert "frame [1]/2" in stream.getvalue()
    assert "\x1b[?25h" in stream.getvalue()  # the cursor is back


@pytest.mark.parametrize("reason", ["dumb terminal", "no rich"])
def test_plain_line_where_rich_cannot_be(monkeypatch, reason):
    monkeypatch.setenv("TERM", "dumb" if reason == "dumb terminal" else "xterm")
    if reason == "no rich":
        monkeypatch.setitem(sys.modules, "rich.console", None)
    assert isinstance(open_line(Terminal()), PlainLine)
