"""``gsvc view``: what it says, what it refuses, and that it ends with Ctrl-C. tests/tools/viewing has the server."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import urllib.parse
import urllib.request
import webbrowser
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

from gsvc_ref.cli import main
from gsvc_tools.cli import view
from gsvc_tools.viewing import redirect_page, server

TIMEOUT_S = 120
posix = pytest.mark.skipif(os.name != "posix", reason="signals, limits and named pipes of POSIX")
START = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
from gsvc_ref.cli import main
raise SystemExit(main())
"""


@pytest.fixture
def ended_at_once(monkeypatch):
    """Ctrl-C as soon as all is said; the pages that a browser was opened with."""

    def ctrl_c(_seconds):
        raise KeyboardInterrupt

    opened = []
    monkeypatch.setattr(view, "time", SimpleNamespace(sleep=ctrl_c))
    monkeypatch.setattr(webbrowser, "open", lambda url: opened.append((url, path_of(url).read_text())) or True)
    monkeypatch.setattr(view, "elsewhere", lambda: "")
    return opened


def path_of(url):
    """The file that a file:// address names."""
    return Path(urllib.request.url2pathname(urllib.parse.urlsplit(url).path))


def test_the_browser_is_led_to_the_address_that_is_said(stream, clip, capsys, ended_at_once):
    assert main(["view", str(stream), str(clip)]) == 130
    ((opened, page),) = ended_at_once
    out, err = capsys.readouterr()
    url = re.search('; url=([^"]*)', page)[1]
    assert out == f"{stream} beside {clip}: {url}\n  Ctrl-C ends it\n"
    assert url.startswith("http://127.0.0.1:")
    assert err == "gsvc view: ended; the page goes on with what it has read\n"
    assert opened.startswith("file:///")
    assert not path_of(opened).parent.exists()


def test_a_browser_that_cannot_be_led_there_is_not_opened(stream, capsys, monkeypatch, ended_at_once):
    monkeypatch.setattr(redirect_page.RedirectPage, "write", lambda *_: os.open("/gone/x", os.O_RDONLY))
    assert main(["view", str(stream)]) == 130
    assert ended_at_once == []
    assert "  note: no browser is opened, since its page cannot be written (No such" in capsys.readouterr().out


def test_a_browser_that_does_not_come_is_told_once_and_one_that_comes_needs_no_page(stream, capsys, monkeypatch):
    opened, seconds = [], []

    def look(waited):
        seconds.append(waited)
        if sum(seconds) == 2 * view.BROWSER_S:
            assert path_of(opened[0]).exists()
            with urllib.request.urlopen(re.search('http:[^"]*', path_of(opened[0]).read_text())[0]) as page:
                page.read()
        elif sum(seconds) > 2 * view.BROWSER_S + 1:
            assert not path_of(opened[0]).parent.exists()
            raise KeyboardInterrupt

    monkeypatch.setattr(view, "time", SimpleNamespace(sleep=look))
    monkeypatch.setattr(webbrowser, "open", lambda url: opened.append(url) or True)
    monkeypatch.setattr(view, "elsewhere", lambda: "")
    assert main(["view", str(stream)]) == 130
    note = "gsvc view: no browser has asked for the page so far; if none shows it, open the address above in one\n"
    assert capsys.readouterr().err == note + "gsvc view: ended; the page goes on with what it has read\n"


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
    assert "note: no browser was found: open the address above in one\n" in capsys.readouterr().out


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
    assert told.startswith(f"{other} has 24x32 pixels and {stream} 32x24, which cannot be compared")
    assert refused(capsys, stream, "--port", "70000") == (2, "--port is 70000; a port is a number from 1 to 65535")
    assert refused(capsys, stream, "--colour")[0] == 2
    assert refused(capsys, stream, "--source-from", "3")[0] == 2
    assert refused(capsys, stream, clip, "--source-from", "-1")[0] == 2
    assert refused(capsys, stream, "--max-bytes", "1G")[0] == 2


@posix
def test_a_pipe_with_a_name_is_not_waited_for(stream, tmp_path, capsys):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    told = f"{pipe} is a pipe or a device, which is read once only: give gsvc view - < {pipe}"
    assert refused(capsys, pipe) == (2, told)
    assert refused(capsys, pipe, "--live") == (2, told)
    assert refused(capsys, stream, pipe) == refused(capsys, stream, "-")


def test_a_pipe_of_something_else_ends_it(capsys, monkeypatch, standard_input):
    standard_input(b"YUV4MPEG2 W32 H24 F25:1")
    monkeypatch.setattr(view, "LOOK_S", 0.01)
    assert main(["view", "-", "--no-browser"]) == 1
    assert "standard input is not a GSVC stream; encode a video first" in capsys.readouterr().err


def test_more_than_is_kept_of_a_pipe_is_told_and_the_rest_shown(stream, monkeypatch, standard_input):
    said = []

    def say(_command, message):
        said.append(message)
        if len(said) == 1:
            raise KeyboardInterrupt

    standard_input(stream.read_bytes())
    monkeypatch.setattr(view, "say", say)
    monkeypatch.setattr(view, "LOOK_S", 0.01)
    assert main(["view", "-", "--no-browser", "--max-bytes", "100"]) == 130
    kept = "standard input has more than 100 bytes: the page shows these, and the rest is not read"
    assert said == [f"{kept}; a greater --max-bytes keeps more", "ended; the page goes on with what it has read"]


def test_a_port_in_use_is_refused(stream, capsys):
    with server.Server(server.Viewing("a", None)) as taken:
        code, told = refused(capsys, stream, "--port", taken.server_port)
    assert (code, told) == (2, f"port {taken.server_port} is in use; give another --port, or leave it out")


@contextmanager
def started(*words, before="", **settings):
    """``gsvc view`` in a process of its own, after a line of Python, until Ctrl-C."""
    with subprocess.Popen(
        [sys.executable, "-c", before + START, "view", *map(str, words)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **settings,
    ) as process:  # fmt: skip
        try:
            yield process
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=TIMEOUT_S)
        finally:
            process.kill()
    assert (process.returncode, out) == (130, "")
    assert err == "gsvc view: ended; the page goes on with what it has read\n"


@posix
def test_it_answers_until_ctrl_c(stream, clip):
    with started(stream, clip, "--no-browser") as process:
        url = process.stdout.readline().strip()
        with urllib.request.urlopen(url, timeout=TIMEOUT_S) as page:
            assert b"GSVC viewer" in page.read()


@posix
def test_unauthenticated_connections_cannot_take_all_descriptors(stream):
    limit = """
import resource
from gsvc_tools.viewing import server
resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))
server.UNAUTHENTICATED_S, server.Handler.timeout = 1e9, None  # they stay as long as they are few
"""
    with started(stream, "--no-browser", before=limit) as process, ExitStack() as stack:
        url = process.stdout.readline().strip()
        address = "127.0.0.1", urllib.parse.urlsplit(url).port
        for _ in range(64):
            stack.enter_context(socket.create_connection(address, timeout=TIMEOUT_S))
        with urllib.request.urlopen(url, timeout=TIMEOUT_S) as page:
            assert b"GSVC viewer" in page.read()


SPY = """
import contextlib, encodings.idna, glob, json, os, re, urllib.parse, urllib.request
with contextlib.suppress(urllib.error.HTTPError):  # whatever it imports: others may not read it
    urllib.request.urlopen("http://127.0.0.1:PORT/", timeout=TIMEOUT)
os.setgroups([]), os.setgid(65534), os.setuid(65534)
files, addresses, got = set(), set(), []
for name in glob.glob("/proc/[0-9]*/cmdline") + glob.glob("/proc/[0-9]*/environ"):
    try:
        words = open(name, "rb").read().decode(errors="replace")
    except OSError:
        continue
    files.update(re.findall(r"file://(/[^\\0 ]*gsvc-view-[^\\0 ]*)", words))
    addresses.update(re.findall(r"http://127.0.0.1:PORT/[^\\0 ]*", words))
for name in files:
    try:
        addresses.update(re.findall(r'http:[^"]*', open(name).read()))
    except OSError as error:
        got.append(str(error.errno))
for address in addresses | {"http://127.0.0.1:PORT/"}:
    for path in ("../stream", "../source/0", "../view.json", "stream", "index.html", ""):
        try:
            got.append(urllib.request.urlopen(urllib.parse.urljoin(address, path), timeout=TIMEOUT).status)
        except urllib.error.HTTPError as error:
            got.append(str(error.code))
print(json.dumps([sorted(files), got]))
"""


@pytest.mark.skipif(getattr(os, "geteuid", int)() != 0, reason="only root can become another user")
@pytest.mark.skipif(not Path("/proc/self/cmdline").exists(), reason="command lines are read in /proc")
def test_another_user_gets_nothing_out_of_command_lines(stream, clip, tmp_path):
    browser = tmp_path / "browser"
    browser.write_text(
        f"#!{sys.executable}\nimport os, time\nprint(os.getpid(), flush=True)\ntime.sleep({TIMEOUT_S})\n"
    )
    browser.chmod(0o700)
    with started(stream, clip, env={**os.environ, "DISPLAY": ":0", "BROWSER": f"{browser} %s &"}) as process:
        port = re.search(r"http://127.0.0.1:(\d+)/", process.stdout.readline())[1]
        assert process.stdout.readline() == "  Ctrl-C ends it\n"
        pid = int(process.stdout.readline())
        spy = SPY.replace("PORT", port).replace("TIMEOUT", str(TIMEOUT_S))  # no word of it is in a command line
        seen = subprocess.run([sys.executable, "-"], input=spy, check=True, stdout=subprocess.PIPE, text=True).stdout
        files, got = json.loads(seen)
        page = path_of(re.search(r"file://[^\0]+", Path(f"/proc/{pid}/cmdline").read_text())[0])
        os.kill(pid, signal.SIGKILL)
        if str(page) not in files:
            pytest.skip("command lines of others cannot be read here")
        assert page.exists()
        assert set(got) == {"13", "404"}  # permission denied, and not found
    assert not page.parent.exists()
