"""The server of the viewer: the loopback interface, a fixed set of paths after a random token, and nothing is written.

| path after the token | what it is |
|---|---|
| ``viewer/index.html``, … | the page, its scripts and its style |
| ``view.json`` | what there is to look at |
| ``stream`` | the bytes of the stream, in parts by ``Range``; of a live one as they come |
| ``source/N`` | the samples of frame N of the source |

Other pages of the same browser reach nothing: they do not know the token, a name that they have pointed at this machine
is not in the header ``Host`` that is allowed, and nothing allows them to read an answer. Other users of the machine do
not know it either, since no command line has it (`redirect_page`). It is in the address rather than in a cookie, since
a browser sends the cookies of 127.0.0.1 to the servers of all users, on every port. It can be used more than once: a
page may be loaded again, and anyone who saw an address that works only once could use it first.
"""

import errno
import hmac
import json
import os
import re
import secrets
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Final

from gsvc_base.errors import GsvcError, UsageError
from gsvc_tools.viewing.pages import MEDIA_TYPES, PAGE, viewer_files
from gsvc_tools.viewing.source_frames import SourceFrames
from gsvc_tools.viewing.streams import SENT_AT_ONCE, StreamBytes

LOOPBACK: Final = "127.0.0.1"
TOKEN_BYTES: Final = 18
"""Random bytes of the token: 144 bits, 24 letters."""
POLL_S: Final = 0.1
"""Seconds between two looks whether a live stream has grown."""
IDLE_S: Final = 60.0
"""Seconds for which a connection that has shown the token may wait for the next request."""
UNAUTHENTICATED_S: Final = 5.0
"""Seconds in which a connection must show the token."""
MAX_UNAUTHENTICATED: Final = 32
"""Connections that have not shown it; one more closes the oldest, so that a page can always connect."""
SAMPLES: Final = "application/octet-stream"
HEADERS: Final = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",  # the address holds the token
    "X-Content-Type-Options": "nosniff",
}


class Viewing:
    """What is looked at: a stream by its name on the page, and the frames that it was made of, if they are given."""

    def __init__(self, name: str, stream: StreamBytes, source: SourceFrames | None = None) -> None:
        self.name, self.stream, self.source = name, stream, source

    def described(self) -> dict[str, Any]:
        """What the page asks for first."""
        source = None
        if self.source is not None:
            video = self.source.format
            source = {
                "name": _text(Path(self.source.name).name), "width": video.width, "height": video.height,
                "bits": video.bit_depth,
            }  # fmt: skip
        return {"name": _text(self.name), "live": self.stream.live, "source": source}


def _text(name: str) -> str:
    """The name of a file, which may have bytes that are no characters."""
    return name.encode("utf-8", "backslashreplace").decode("utf-8")


class Server(ThreadingHTTPServer):
    """A server of one thing to look at, whose page is at `url`; a UsageError says that its port cannot be used."""

    daemon_threads = True
    allow_reuse_address = os.name == "posix"  # elsewhere two servers could share a port
    request_queue_size = 128  # where more wait than the system allows, a page would wait for a second

    def __init__(self, viewing: Viewing, port: int = 0) -> None:
        self._unauthenticated: dict[socket.socket, float] = {}  # when each is closed, the oldest first
        self._lock = threading.Lock()
        self.is_known = threading.Event()  # somebody has shown the token
        self.viewing, self.files, self.token = viewing, viewer_files(), secrets.token_urlsafe(TOKEN_BYTES)
        try:
            super().__init__((LOOPBACK, port), Handler)
        except OSError as error:
            reason = "is in use" if error.errno == errno.EADDRINUSE else f"cannot be used ({error.strerror})"
            raise UsageError(f"port {port} {reason}; give another --port, or leave it out") from None
        self.url = f"http://{LOOPBACK}:{self.server_port}/{self.token}/{PAGE}?view=../view.json"
        self.hosts = {f"{name}:{self.server_port}" for name in (LOOPBACK, "localhost")}

    def get_request(self) -> tuple[socket.socket, Any]:
        """The next connection."""
        try:
            return super().get_request()
        except OSError:  # no descriptor is left
            self._end_unauthenticated(most=len(self._unauthenticated) - 1)
            time.sleep(POLL_S / 10)  # in which its thread closes it
            raise

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer a connection in a thread."""
        with self._lock:
            self._unauthenticated[request] = time.monotonic() + UNAUTHENTICATED_S
        super().process_request(request, client_address)

    def service_actions(self) -> None:
        """After each connection and each POLL_S, close unauthenticated connections that are too old or too many."""
        self._end_unauthenticated(most=MAX_UNAUTHENTICATED)

    def _end_unauthenticated(self, most: int) -> None:
        """Close those whose time is over, and the oldest of more than `most`."""
        with self._lock:
            for connection, end in list(self._unauthenticated.items()):
                if len(self._unauthenticated) <= most and time.monotonic() < end:
                    break
                del self._unauthenticated[connection]
                with suppress(OSError):  # its thread, which closes it, may have done so
                    connection.shutdown(socket.SHUT_RDWR)

    def trust(self, connection: socket.socket) -> None:
        """Note that a connection has shown the token, so that it may stay."""
        with self._lock:
            self._unauthenticated.pop(connection, None)
        self.is_known.set()

    def shutdown_request(self, request: Any) -> None:
        """End a connection."""
        with self._lock:
            self._unauthenticated.pop(request, None)
        super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A page that went away is no error; nothing else is the terminal's concern."""


@contextmanager
def serving(viewing: Viewing, port: int = 0) -> Iterator[Server]:
    """A server that answers, in other threads, until the block ends."""
    with Server(viewing, port) as server:
        threading.Thread(target=server.serve_forever, args=(POLL_S,), name="server", daemon=True).start()
        try:
            yield server
        finally:
            server.shutdown()


class Handler(BaseHTTPRequestHandler):
    """Answers one connection."""

    server: Server
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "gsvc", ""
    timeout = IDLE_S

    def log_message(self, *_: Any) -> None:
        """Nothing is logged."""

    def do_GET(self) -> None:
        """Answer, as far as the address is one of those that there are."""
        self._begun = False
        with suppress(ConnectionError, TimeoutError):  # the page went away
            try:
                self._answer()
            except (ConnectionError, TimeoutError):
                raise
            except Exception as error:
                self.close_connection = True
                if not self._begun:
                    self.send_error(500, _text(" ".join(f"{type(error).__name__}: {error}".split())))

    do_HEAD = do_GET  # noqa: N815

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Refuse in a line of plain text."""
        self._send(code, "text/plain; charset=utf-8", f"{message or self.responses[code][0]}\n".encode(), last=True)

    def _answer(self) -> None:
        if self.headers.get("Host") not in self.server.hosts:  # DNS rebinding
            self.send_error(403, "this server answers at 127.0.0.1 only")
            return
        token, _, path = self.path.partition("?")[0].removeprefix("/").partition("/")
        if not hmac.compare_digest(token.encode(), self.server.token.encode()):
            self.send_error(404)
            return
        self.server.trust(self.connection)
        viewing = self.server.viewing
        if path in self.server.files:
            file = self.server.files[path]
            self._send(200, MEDIA_TYPES[file.suffix], file.read_bytes())
        elif path == "view.json":
            self._send(200, "application/json", json.dumps(viewing.described()).encode())
        elif path == "stream":
            self._stream(viewing.stream)
        elif viewing.source is not None and (match := re.fullmatch(r"source/(\d{1,9})", path, re.ASCII)):
            self._source(viewing.source, int(match[1]))
        else:
            self.send_error(404)

    def _source(self, source: SourceFrames, number: int) -> None:
        try:
            samples = source.samples(number)
        except (GsvcError, UsageError, FileNotFoundError) as error:
            self.send_error(500, _text(str(error)))
            return
        if samples is None:
            self._head(204, SAMPLES, None, {})
        else:
            self._send(200, SAMPLES, samples)

    def _stream(self, stream: StreamBytes) -> None:
        try:
            size = stream.size()
        except OSError as error:
            self.send_error(404, error.strerror)
            return
        if stream.live:
            self._follow(stream)
            return
        byte_range = parse_range(self.headers.get("Range"), size)
        if byte_range is not None and byte_range.start >= size:
            self._head(416, SAMPLES, 0, {"Content-Range": f"bytes */{size}"})
            return
        part = byte_range or range(size)
        more = {"Accept-Ranges": "bytes"}
        if byte_range is not None:
            more["Content-Range"] = f"bytes {part.start}-{part.stop - 1}/{size}"
        self._head(200 if byte_range is None else 206, SAMPLES, len(part), more)
        at = part.start
        while self.command == "GET" and at < part.stop:
            piece = stream.read(at, min(SENT_AT_ONCE, part.stop - at))
            if not piece:  # the file has become shorter
                self.close_connection = True
                return
            self.wfile.write(piece)
            at += len(piece)

    def _follow(self, stream: StreamBytes) -> None:
        """All that has come, and what comes, in chunks of HTTP."""
        self._head(200, SAMPLES, None, {"Transfer-Encoding": "chunked"})
        at, ended = 0, False
        while self.command == "GET":
            piece = stream.read(at, SENT_AT_ONCE)
            if piece:
                self.wfile.write(b"%x\r\n%b\r\n" % (len(piece), piece))
                at += len(piece)
            elif stream.size() < at:  # another encode writes to it: the page must not take this for the end
                self.close_connection = True
                return
            elif ended:  # since before it was looked whether there is more
                self.wfile.write(b"0\r\n\r\n")
                return
            else:
                ended = stream.ended()
                time.sleep(0 if ended else POLL_S)

    def _send(self, code: int, kind: str, body: bytes, *, last: bool = False) -> None:
        self._head(code, kind, len(body), {"Connection": "close"} if last else {})
        if self.command != "HEAD":
            self.wfile.write(body)

    def _head(self, code: int, kind: str, size: int | None, more: dict[str, str]) -> None:
        self._begun = True
        self.send_response(code)
        sizes = {} if size is None else {"Content-Length": str(size)}
        for name, value in {"Content-Type": kind, **sizes, **HEADERS, **more}.items():
            self.send_header(name, value)
        self.end_headers()


def parse_range(header: str | None, size: int) -> range | None:
    """The bytes of `size` that a header ``Range`` asks for; None: all of them, as for a header of several ranges."""
    match = re.fullmatch(r"bytes=(\d{0,18})-(\d{0,18})", header or "", re.ASCII)
    if match is None or match[0] == "bytes=-":
        return None
    first, last = match[1], match[2]
    if not first:
        return range(max(size - int(last), 0), size)
    stop = min(int(last) + 1, size) if last else size
    return None if last and int(last) < int(first) else range(int(first), max(stop, int(first)))
