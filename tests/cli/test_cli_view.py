"""``gsvc view``: what it says, what it refuses, and that it ends with Ctrl-C. tests/tools/viewing has the server."""

import os
import signal
import subprocess
import sys
import urllib.request
import webbrowser
from types import SimpleNamespace

import pytest

from gsvc_ref.cli import main
from gsvc_tools.cli import view
from gsvc_tools.viewing import server

TIMEOUT_S = 120
START = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
from gsvc_ref.cli import main
raise SystemExit(main())
"""


@pytest.fixture
def ended_at_once(monkeypatch):
    """Ctrl-C as soon as all is said; the addresses that a browser was opened with."""

    def ctrl_c(_seconds):
        raise KeyboardInterrupt

    opened = []
    monkeypatch.setattr(view, "time", SimpleNamespace(sleep=ctrl_c))
    monkeypatch.setattr(webbrowser, "open", lambda url: opened.append(url) or True)
    monkeypatch.setattr(view, "elsewhere", lambda: "")
    return opened


def test_the_browser_is_opened_with_the_address_that_is_said(stream, clip, capsys, ended_at_once):
    assert main(["view", str(stream), str(clip)]) == 130
    (url,) = ended_at_once
    out, err = capsys.readouterr()
    assert out == f"{stream} beside {clip}: {url}\n  Ctrl-C ends it\n"
    assert url.startswith("http://127.0.0.1:")
    assert err == "gsvc view: ended; the page goes on with what it has read\n"


def test_without_a_browser_the_address_alone_is_printed(stream, capsys, ended_at_once):
    assert main(["view", str(stream), "--no-browser"]) == 130
    assert ended_at_once == []
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith("http://127.0.0.1:")
    assert line.endswith("/viewer/index.html?view=../view.json")


def test_where_no_browser_can_be_opened_it_is_said_what_to_do(stream, capsys, monkeypatch, ended_at_once):
    monkeypatch.setattr(view, "elsewhere", lambda: "there is no display here")
    main(["view", str(stream)])
    assert ended_at_once == []
    assert "note: no browser is opened, since there is no display here; on the machine" in capsys.readouterr().out
    monkeypatch.setattr(view, "elsewhere", lambda: "")
    monkeypatch.setattr(webbrowser, "open", lambda url: False)
    main(["view", str(stream)])
    assert "note: no browser was found: open the address in one\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("environment", "told"),
    [
        ({}, "there is no display here"),
        ({"DISPLAY": ":0"}, ""),
        ({"DISPLAY": "unix:0"}, ""),
        ({"WAYLAND_DISPLAY": "wayland-0"}, ""),
        ({"DISPLAY": "localhost:10.0"}, "the display localhost:10.0 is that of another machine"),
        ({"DISPLAY": "desk:0", "WAYLAND_DISPLAY": "wayland-0"}, ""),
    ],
)
def test_a_display_elsewhere(monkeypatch, environment, told):
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert view.elsewhere() == told


def test_what_is_to_come_is_waited_for(tmp_path, capsys, ended_at_once):
    path = tmp_path / "later.gsvc"
    assert main(["view", "--live", str(path)]) == 130
    assert f"note: {path} is not there yet; it is shown as soon as" in capsys.readouterr().out


def refused(capsys, *arguments):
    """The exit code and the sentence of a refusal, before anything is served."""
    code = main(["view", *map(str, arguments)])
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("gsvc view: ")
    assert err.count("\n") == 1
    return code, err.removeprefix("gsvc view: ").rstrip("\n")


def test_what_cannot_be_shown_is_refused(stream, clip, tmp_path, capsys):
    other = tmp_path / "other.y4m"
    other.write_bytes(clip.read_bytes().replace(b"W32 H24", b"W24 H32"))
    assert refused(capsys, tmp_path / "gone.gsvc")[0] == 2
    assert refused(capsys, tmp_path / "gone" / "x.gsvc", "--live")[0] == 2
    code, told = refused(capsys, clip)
    assert code == 1
    assert "encode it first" in told
    assert refused(capsys, stream, tmp_path / "gone.y4m")[0] == 2
    assert refused(capsys, stream, "-") == (
        2,
        "the source is read more than once, so it cannot be a pipe: give a file",
    )
    code, told = refused(capsys, stream, other)
    assert code == 2
    assert told.startswith(f"{other} has 24x32 pixels and {stream} 32x24; only equal ones can be compared")
    assert refused(capsys, stream, "--port", "70000") == (2, "--port is 70000; a port is a number from 1 to 65535")
    assert refused(capsys, stream, "--colour")[0] == 2
    assert refused(capsys, stream, "--source-from", "3")[0] == 2
    assert refused(capsys, stream, clip, "--source-from", "-1")[0] == 2


def test_a_pipe_of_something_else_ends_it(capsys, monkeypatch, standard_input):
    standard_input(b"YUV4MPEG2 W32 H24 F25:1")
    monkeypatch.setattr(view, "LOOK_S", 0.01)
    assert main(["view", "-", "--no-browser"]) == 1
    assert "standard input is no GSVC stream; encode a video first" in capsys.readouterr().err


def test_a_port_in_use_is_refused(stream, capsys):
    with server.Server(server.Viewing("a", None)) as taken:
        code, told = refused(capsys, stream, "--port", taken.server_port)
    assert (code, told) == (2, f"port {taken.server_port} is in use; give another --port, or leave it out")


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_it_answers_until_ctrl_c(stream, clip):
    with subprocess.Popen(
        [sys.executable, "-c", START, "view", str(stream), str(clip), "--no-browser"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        url = process.stdout.readline().strip()
        with urllib.request.urlopen(url, timeout=TIMEOUT_S) as page:
            assert b"GSVC viewer" in page.read()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=TIMEOUT_S)
    assert (process.returncode, out) == (130, "")
    assert err == "gsvc view: ended; the page goes on with what it has read\n"
