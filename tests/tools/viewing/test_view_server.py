"""The server of `gsvc view`: its paths, who is refused, parts of a file, a file that grows, frames of the source."""

import http.client
import io
import json
import os
import shutil
import socket
import stat
import threading
import time
from contextlib import ExitStack, closing
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gsvc_base.errors import GsvcError, UsageError
from gsvc_base.files import try_lock
from gsvc_ref.stream.source import Source
from gsvc_ref.testing import OVERVIEW_HEADER, overview_frames, write_stream
from gsvc_ref.video import ColorDescription, VideoFormat, open_video, open_writer
from gsvc_tools.viewing import pages
from gsvc_tools.viewing import server as server_module
from gsvc_tools.viewing.pages import viewer_files
from gsvc_tools.viewing.redirect_page import RedirectPage
from gsvc_tools.viewing.server import MAX_UNAUTHENTICATED, UNAUTHENTICATED_S, Server, Viewing, parse_range, serving
from gsvc_tools.viewing.source_frames import SourceFrames
from gsvc_tools.viewing.streams import SENT_AT_ONCE, GrowingFile, Pipe, WholeFile, is_end, read_to_end_chunk

TIMEOUT_S = 60
STREAMS = Path(__file__).parents[3] / "vectors" / "core" / "decode_stream_deterministic"
STREAM = write_stream(OVERVIEW_HEADER, overview_frames(), index=False)


def write_video(path: Path, bit_depth: int = 8) -> list[np.ndarray]:
    """A y4m file of three frames of 16x12 pixels; the frames that its reader gives."""
    video = VideoFormat(16, 12, Fraction(25), bit_depth, "444", ColorDescription(1, 1, 1, False, 0))
    rng = np.random.default_rng(0)
    with open_writer(path, video) as writer:
        for _ in range(3):
            frame = rng.integers(0, 1 << bit_depth, (12, 16, 3))
            writer.write(frame.astype(np.uint8 if bit_depth == 8 else np.uint16))
    with open_video(path) as reader:
        return list(reader)


def ask(server, path, method="GET", host=None, token=None, headers=None):
    """The status, the headers and the body of an answer."""
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=TIMEOUT_S)
    host = host or f"127.0.0.1:{server.server_port}"
    connection.request(method, f"/{token or server.token}/{path}", headers={"Host": host, **(headers or {})})
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, answer.headers, body


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("viewing")


@pytest.fixture(scope="module")
def frames(folder):
    return write_video(folder / "clip.y4m")


@pytest.fixture(scope="module")
def server(folder, frames):
    path = folder / "<b>clip.gsvc"
    path.write_bytes(STREAM)
    source = SourceFrames(str(folder / "clip.y4m"))
    with serving(Viewing(path.name, WholeFile(path), source)) as running:
        yield running
    source.close()


def test_the_page_and_all_that_it_loads(server):
    files = viewer_files()
    assert {"viewer/index.html", "viewer/style.css", "viewer/viewer.js", "viewer/example-main.gsvc.js"} <= files.keys()
    assert "conformance/gsvc_conformance/adapters/web/stream.js" in files
    for path, file in files.items():
        status, headers, body = ask(server, path)
        assert (status, body) == (200, file.read_bytes())
        assert headers["Content-Type"].startswith(("text/html", "text/css", "text/javascript"))
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert headers["Referrer-Policy"] == "no-referrer"
    assert server.url.endswith(f"/{server.token}/viewer/index.html?view=../view.json")
    assert server.server_address[0] == "127.0.0.1"


def test_the_files_lie_in_a_wheel_as_in_a_checkout(tmp_path, monkeypatch):
    files = viewer_files()
    for path, file in files.items():
        (tmp_path / "web" / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(file, tmp_path / "web" / path)
    monkeypatch.setattr(pages, "ROOTS", (tmp_path / "web", tmp_path))
    assert viewer_files() == {path: tmp_path / "web" / path for path in files}
    (tmp_path / "web" / "viewer" / "style.css").unlink()
    with pytest.raises(UsageError, match="the files of the viewer are missing here"):
        viewer_files()


PATHS_OF_OTHERS = """
viewer/ viewer ../spec.md viewer/../../spec.md viewer/README.md viewer/%2e%2e/README.md //etc/passwd stream/ source/
conformance/gsvc_conformance/adapters/web/__init__.py source/-1 source/1e9 source/0/0 source/9999999999
"""


@pytest.mark.parametrize("path", ["", *PATHS_OF_OTHERS.split()])
def test_nothing_else_is_there(server, path):
    status, _, body = ask(server, path)
    assert (status, body) == (404, b"Not Found\n")


def test_who_does_not_know_the_token_gets_nothing(server):
    for token in ("x", server.token[:-1], server.token + "x", server.token.swapcase(), "%00"):
        assert ask(server, "stream", token=token)[0] == 404
    with Server(Viewing("a", WholeFile(Path("a")))) as other:
        assert other.token != server.token
        assert len(other.token) == 24


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:{}", "127.0.0.1", "127.0.0.1:1", "127.0.0.1:{}.evil.example"]
)
def test_a_name_of_others_for_this_machine_is_refused(server, host):
    assert ask(server, "stream", host=host.format(server.server_port))[0] == 403
    assert ask(server, "stream", host=f"localhost:{server.server_port}")[0] == 200


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "PATCH"])
def test_nothing_is_written(server, method):
    status, _, body = ask(server, "stream", method=method)
    assert status == 501
    assert body.count(b"\n") == 1


def test_head_has_no_body(server):
    for path in ("viewer/index.html", "stream", "view.json", "source/1"):
        status, headers, body = ask(server, path, method="HEAD")
        assert (status, body) == (200, b"")
        assert int(headers["Content-Length"]) == len(ask(server, path)[2])


RANGES = {
    "bytes=0-9": range(10),
    "bytes=90-": range(90, 100),
    "bytes=-7": range(93, 100),
    "bytes=-700": range(100),
    "bytes=99-2000": range(99, 100),
    "bytes=100-": range(100, 100),
    "bytes=200-300": range(200, 200),
    **dict.fromkeys(["bytes=9-3", "bytes=-", "bytes=0-1,4-5", "lines=0-1", "bytes=a-b", None, "bytes=٠-٣"]),
    f"bytes={'9' * 40}-": None,
}


@pytest.mark.parametrize("header", RANGES)
def test_ranges(header):
    assert parse_range(header, 100) == RANGES[header]


NO_REQUESTS = [b"GET /\xff\xff/stream HTTP/1.1\r\n\r\n", b"\x16\x03\x01\x00\xff\r\n\r\n", b"GET\r\n\r\n"]


@pytest.mark.parametrize("sent", NO_REQUESTS)
def test_what_is_no_request_does_no_harm(server, sent):
    with socket.create_connection(("127.0.0.1", server.server_port), timeout=TIMEOUT_S) as connection:
        connection.sendall(sent)
        answer = connection.recv(1 << 16)
    assert b"GSVC" not in answer
    assert ask(server, "stream")[2] == STREAM


def test_parts_of_the_stream(server):
    status, headers, body = ask(server, "stream")
    assert (status, body, headers["Accept-Ranges"]) == (200, STREAM, "bytes")
    status, headers, body = ask(server, "stream", headers={"Range": "bytes=10-51"})
    assert (status, body) == (206, STREAM[10:52])
    assert headers["Content-Range"] == f"bytes 10-51/{len(STREAM)}"
    assert ask(server, "stream", headers={"Range": "bytes=-5"})[2] == STREAM[-5:]
    assert ask(server, "stream", headers={"Range": "bytes=5-4"})[::2] == (200, STREAM)
    status, headers, body = ask(server, "stream", headers={"Range": f"bytes={len(STREAM)}-"})
    assert (status, headers["Content-Range"], body) == (416, f"bytes */{len(STREAM)}", b"")


def test_what_there_is_to_look_at(server, folder):
    told = json.loads(ask(server, "view.json")[2])
    source = {"name": "clip.y4m", "width": 16, "height": 12, "bits": 8}
    assert told == {"name": "<b>clip.gsvc", "live": False, "source": source}
    odd = json.loads(json.dumps(Viewing("a\udcff", WholeFile(folder)).described()))
    assert odd == {"name": "a\\udcff", "live": False, "source": None}


def test_frames_of_the_source(server, frames):
    for number in (2, 0, 1):
        status, _, body = ask(server, f"source/{number}")
        assert status == 200
        assert np.array_equal(np.frombuffer(body, "u1").reshape(12, 16, 3), frames[number])
    assert ask(server, "source/3")[::2] == (204, b"")


@pytest.mark.parametrize("room", [0, 1, 2, 9])
def test_frames_come_in_any_order_with_any_room(folder, room):
    frames = write_video(folder / "ten.y4m", bit_depth=10)
    source = SourceFrames(str(folder / "ten.y4m"), most_kept=room * 12 * 16 * 6)
    for number in (1, 0, 2, 2, 0, 1, 7, 2):
        samples = source.samples(number)
        assert samples == (frames[number].astype("<u2").tobytes() if number < 3 else None)
    source.close()


def test_a_source_may_begin_later(folder, frames):
    with closing(SourceFrames(str(folder / "clip.y4m"), first=1)) as source:
        assert [source.samples(number) for number in (1, 0, 2)] == [frames[2].tobytes(), frames[1].tobytes(), None]


def test_a_source_that_breaks_off_is_told(folder, frames):
    path = folder / "cut.y4m"
    path.write_bytes((folder / "clip.y4m").read_bytes()[:-10])
    source = SourceFrames(str(path))
    with serving(Viewing("a", WholeFile(path), source)) as running:
        assert ask(running, "source/1")[0] == 200
        for _ in range(2):  # also when it is asked again
            status, _, body = ask(running, "source/2")
            assert status == 500
            assert "is cut off in frame 2" in body.decode()
    source.close()


def test_without_a_source_there_are_no_frames_of_it(tmp_path):
    with serving(Viewing("a", WholeFile(tmp_path / "gone"))) as running:
        assert ask(running, "source/0")[0] == 404
        assert ask(running, "stream")[0] == 404


def test_a_port_that_is_taken():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(UsageError, match=f"^port {port} is in use; give another --port, or leave it out$"):
            Server(Viewing("a", WholeFile(Path("a"))), port)


# ---- who waits


def wait_until(holds):
    deadline = time.monotonic() + TIMEOUT_S
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.002)


def unauthenticated(server, sent=b""):
    connection = socket.create_connection(("127.0.0.1", server.server_port), timeout=TIMEOUT_S)
    connection.sendall(sent)
    return connection


def ends(connection):
    """Whether the server ends a connection without an answer."""
    with connection:
        return connection.recv(1) == b""


@pytest.fixture
def clock(monkeypatch):
    """clock(seconds): the time of the server goes on by so much, and not by itself."""
    now = [0.0]
    monkeypatch.setattr(server_module.Handler, "timeout", None)
    monkeypatch.setattr(server_module, "time", SimpleNamespace(monotonic=lambda: now[0], sleep=time.sleep))
    return lambda seconds: now.__setitem__(0, now[0] + seconds)


def accepted(server, count):
    """Wait until a server has this many unauthenticated connections."""
    wait_until(lambda: len(server._unauthenticated) == count)


@pytest.mark.parametrize("sent", [b"", b"GET /", b"GET / HTTP/1.1\r\n", b"GET / HTTP/1.1\r\nHost: a\r\nX: "])
def test_an_unauthenticated_connection_may_not_stay(server, clock, sent):
    waiting = unauthenticated(server, sent)
    accepted(server, 1)
    clock(UNAUTHENTICATED_S - 0.1)
    waiting.sendall(b"a")  # gives it no more time
    accepted(server, 1)
    clock(0.1)
    assert ends(waiting)


def test_who_has_shown_the_token_may_stay(server, clock):
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=TIMEOUT_S)
    with closing(connection), ExitStack() as stack:
        for _ in range(3):
            connection.request("GET", f"/{server.token}/stream")
            assert connection.getresponse().read() == STREAM
            assert connection.sock is not None
            connection.auto_open = False  # another connection would be no proof
            waiting = [stack.enter_context(unauthenticated(server)) for _ in range(MAX_UNAUTHENTICATED + 1)]
            assert ends(waiting[0])  # so all have come
            clock(UNAUTHENTICATED_S)
            accepted(server, 0)


def test_unauthenticated_connections_are_few(server, clock):
    with ExitStack() as stack:
        waiting = [stack.enter_context(unauthenticated(server)) for _ in range(MAX_UNAUTHENTICATED + 3)]
        assert all(ends(first) for first in waiting[:3])
        assert ask(server, "stream")[2] == STREAM
        for later in waiting[4:]:  # in the place of one more that came, if it was not at once that it showed the token
            later.setblocking(False)
            with pytest.raises(BlockingIOError):
                later.recv(1)
        last = waiting[-1]
        last.settimeout(TIMEOUT_S)
        last.sendall(f"GET /{server.token}/view.json HTTP/1.0\r\nHost: {min(server.hosts)}\r\n\r\n".encode())
        assert last.recv(12) == b"HTTP/1.1 200"


# ---- the redirect page


def test_the_redirect_page_is_for_its_owner_alone(server):
    with closing(RedirectPage()) as redirect:
        assert not redirect.is_open()
        page = redirect.write(server.url)
        assert redirect.is_open()
        assert f'content="0; url={server.url}"' in page.read_text()
        assert server.token not in str(page)
        if os.name == "posix":
            assert [stat.S_IMODE(path.stat().st_mode) for path in (page, page.parent)] == [0o600, 0o700]
    assert not page.parent.exists()
    redirect.close()


def test_the_redirect_page_is_where_a_browser_from_a_snap_may_look(tmp_path, monkeypatch):
    monkeypatch.setattr(os.path, "expanduser", lambda _: str(tmp_path))
    for by_snap in (False, True):
        with closing(RedirectPage()) as redirect:
            assert (redirect.write("http://127.0.0.1:1/").parents[1] == tmp_path) == by_snap
        (tmp_path / "snap").mkdir(exist_ok=True)
    assert [path.name for path in tmp_path.iterdir()] == ["snap"]


# ---- streams that grow


class Follower(threading.Thread):
    """Takes the bytes of a live stream as they come."""

    def __init__(self, server):
        super().__init__(daemon=True)
        self.server, self.taken, self.fault = server, bytearray(), None
        self.more = threading.Condition()
        self.start()

    def run(self):
        connection = http.client.HTTPConnection("127.0.0.1", self.server.server_port, timeout=TIMEOUT_S)
        connection.request("GET", f"/{self.server.token}/stream")
        answer = connection.getresponse()
        try:
            while piece := answer.read1(1 << 16):
                with self.more:
                    self.taken += piece
                    self.more.notify_all()
        except http.client.HTTPException as error:
            self.fault = error
        connection.close()

    def wait_for(self, count):
        with self.more:
            assert self.more.wait_for(lambda: len(self.taken) >= count, TIMEOUT_S)

    def end(self):
        self.join(TIMEOUT_S)
        assert not self.is_alive()
        return bytes(self.taken)


def test_a_file_that_grows_is_followed_to_its_end(tmp_path):
    path = tmp_path / "live.gsvc"
    with serving(Viewing("live", GrowingFile(path, quiet=TIMEOUT_S))) as running:
        follower = Follower(running)
        with path.open("wb", buffering=0) as file:
            for at in range(0, len(STREAM), 50):
                file.write(STREAM[at : at + 50])
                follower.wait_for(min(at + 50, len(STREAM)))
        assert follower.end() == STREAM
        assert follower.fault is None
        assert Follower(running).end() == STREAM  # a page that is loaded again


def test_a_file_whose_encoder_is_gone_ends_where_it_is(tmp_path):
    path = tmp_path / "live.gsvc"
    path.write_bytes(STREAM[:100])
    growing = GrowingFile(path, quiet=0)
    with path.open("rb") as encoder:
        if try_lock(encoder) is None:
            pytest.skip("files cannot be locked here")
        assert not growing.ended()
    assert growing.ended()
    assert not GrowingFile(tmp_path / "later.gsvc", quiet=0).ended()
    assert GrowingFile(tmp_path / "later.gsvc").size() == 0


def test_a_file_that_becomes_shorter_is_no_end(tmp_path):
    path = tmp_path / "live.gsvc"
    path.write_bytes(STREAM[:100])
    with serving(Viewing("live", GrowingFile(path, quiet=TIMEOUT_S))) as running:
        follower = Follower(running)
        follower.wait_for(100)
        path.write_bytes(STREAM[:50])
        follower.end()
        assert isinstance(follower.fault, http.client.IncompleteRead)


def test_a_pipe_is_followed_and_kept():
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb") as end, closing(Pipe(end)) as pipe, serving(Viewing("pipe", pipe)) as running:
        follower = Follower(running)
        os.write(writing, STREAM[:100])
        follower.wait_for(100)
        os.write(writing, STREAM[100:])
        os.close(writing)
        assert follower.end() == STREAM
        assert Follower(running).end() == STREAM
        assert ask(running, "stream", method="HEAD")[2] == b""


def test_an_end_is_known_by_its_checksum():
    assert is_end(STREAM[-14:])
    assert not is_end(STREAM[-13:])
    assert not is_end(STREAM[-15:-1])
    for bit in range(8 * 14):
        changed = bytearray(STREAM[-14:])
        changed[bit // 8] ^= 1 << bit % 8
        assert not is_end(bytes(changed))


def test_an_empty_pipe_ends():
    with closing(Pipe(io.BytesIO())) as pipe, serving(Viewing("pipe", pipe)) as running:
        assert Follower(running).end() == b""


@pytest.fixture
def piped():
    """piped(*pieces, most): a pipe that has brought some pieces, its size, and whether its writer is told to stop."""
    with ExitStack() as stack:

        def piped(*pieces, **limit):
            reading, writing = os.pipe()
            end = stack.enter_context(os.fdopen(reading, "rb"))
            stack.callback(os.close, writing)
            pipe = stack.enter_context(closing(Pipe(end, **limit)))
            for piece in pieces:
                before = pipe.size()
                os.write(writing, piece)
                wait_until(lambda before=before: pipe.size() > before or pipe.ended())
            return pipe, writing

        yield piped


def pour(writing):
    """Write without end, until nobody reads any more."""

    def is_closed():
        try:
            os.write(writing, bytes(SENT_AT_ONCE))
        except BlockingIOError:
            return False
        except BrokenPipeError:
            return True
        return False

    os.set_blocking(writing, False)
    wait_until(is_closed)


def test_nothing_after_the_end_chunk_is_read(piped):
    pipe, writing = piped(STREAM[:200], STREAM[200:])
    wait_until(pipe.ended)
    pour(writing)
    assert pipe.read(0, 1 << 20) == STREAM
    assert not pipe.is_full
    pipe, writing = piped(STREAM + b"x" * 100)
    pour(writing)
    assert pipe.read(0, 1 << 20) == STREAM + b"x" * 100  # so that the page says that something follows


def test_no_more_is_kept_than_allowed(piped):
    damaged = STREAM[:100] + b"\0" * (len(STREAM) - 100)
    for data, most in ((damaged, 150), (damaged, 100_000), (STREAM, 100), (damaged, len(STREAM))):
        pipe, writing = piped(data, most=most)
        pour(writing)
        assert pipe.is_full
        assert pipe.size() == most
        assert pipe.read(0, 1 << 20) == (data + bytes(100_000))[:most]
    pipe, writing = piped(STREAM, most=len(STREAM))
    pour(writing)
    assert not pipe.is_full


def test_what_is_no_stream_is_not_read(piped):
    pipe, writing = piped(b"YUV4MPEG2 W32")
    pour(writing)
    assert pipe.size() <= SENT_AT_ONCE


def test_the_end_is_found_in_every_stream_and_in_pieces_of_every_size():
    streams = [path.read_bytes() for path in sorted(STREAMS.glob("*/*.gsvc"))]
    assert len(streams) > 20
    for data in streams:
        source = Source(io.BytesIO(data + b"E\x08 more"))
        read_to_end_chunk(source)
        assert source.offset == len(data)
    for bit in range(8 * (len(STREAM) - 14), 8 * len(STREAM)):  # of the end chunk
        changed = bytearray(STREAM)
        changed[bit // 8] ^= 1 << bit % 8
        with pytest.raises(GsvcError):
            read_to_end_chunk(Source(io.BytesIO(changed)))

    class Slow(io.BytesIO):
        def read1(self, _size=-1):
            return super().read1(3)

    with closing(Pipe(Slow(STREAM + bytes(100)))) as pipe:
        wait_until(pipe.ended)
        assert pipe.size() == -(-len(STREAM) // 3) * 3
