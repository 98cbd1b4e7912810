"""Pages of the browser for tests, whose methods wait, and a server for them."""

import asyncio
import contextlib
import functools
import http.server
import io
import threading
import time

import numpy as np
import pytest
from PIL import Image

from gsvc_conformance.adapters import web
from gsvc_conformance.adapters.web import browser
from gsvc_conformance.vector import VECTORS

ROOT = VECTORS.parent
INDEX = ROOT / "viewer" / "index.html"
STREAMS = VECTORS / "core" / "decode_stream_deterministic"


PATIENCE = 60_000  # milliseconds: a machine may be slow and busy


class Page:
    """A page of Playwright whose methods wait; what it complains of is kept."""

    def __init__(self, width=840, height=440, color_scheme="light", reduced_motion="reduce"):
        self.page = browser.opened("about:blank")
        self.complaints, self.requests = [], []
        browser.wait(self._listen())
        self.set_viewport_size({"width": width, "height": height})
        self.emulate_media(color_scheme=color_scheme, reduced_motion=reduced_motion)

    async def _listen(self):  # in the browser's loop: listeners from another thread race with what it sends
        self.page.set_default_timeout(PATIENCE)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", self._heard)
        self.page.on("request", lambda request: self.requests.append(request.url))

    def _heard(self, message):
        if message.type == "error":  # warnings are the browser's own: of adapters that it lacks, of slow drawing
            self.complaints.append(message.text)

    def __getattr__(self, name):
        attribute = getattr(self.page, name)

        def waiting(*words, **named):
            result = attribute(*words, **named)
            return browser.wait(result) if asyncio.iscoroutine(result) else result

        return waiting if callable(attribute) else attribute

    def press(self, *keys):
        for key in keys:
            browser.wait(self.page.keyboard.press(key))

    def text(self, selector):
        return self.text_content(selector)

    def picture(self):
        """What is seen of the screen, (H, W, 3)."""
        data = browser.wait(self.page.locator("#screen").screenshot())
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)

    def picture_when(self, holds):
        """The picture, as soon as something holds of it."""
        deadline = time.monotonic() + PATIENCE / 1000
        while not holds(picture := self.picture()):
            assert time.monotonic() < deadline, "the picture did not become what it should"
            time.sleep(0.05)
        return picture

    def drawn(self):
        """Wait for the first picture."""
        self.wait_for_function("() => document.querySelector('#drawing dd')")  # a function: pages may forbid eval

    def saved(self):
        """The name and the bytes of the file that the key for saving gives."""

        async def downloaded():
            async with self.page.expect_download() as download:
                await self.page.keyboard.press("s")
            file = await download.value
            return file.suggested_filename, await file.path()

        name, path = browser.wait(downloaded())
        return name, path.read_bytes()


class Quiet(http.server.SimpleHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def log_message(self, *_):
        pass


@contextlib.contextmanager
def serving(folder):
    """The URL of a server of a folder."""
    handler = functools.partial(Quiet, directory=folder)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/"
    finally:
        server.shutdown()
        server.server_close()


@contextlib.contextmanager
def pages():
    """open(**settings): a blank page, which must not complain until the end; skips where there is no browser."""
    try:
        web.environment()
    except FileNotFoundError as error:
        pytest.skip(str(error))
    opened = []

    def open_page(**settings):
        opened.append(Page(**settings))
        return opened[-1]

    try:
        yield open_page
    finally:
        for page in opened:
            page.close()
    complaints = [complaint for page in opened for complaint in page.complaints]
    assert not complaints, complaints


def viewer(page, url=None):
    """The page with the viewer, which has drawn its example."""
    page.goto(url or f"{INDEX.as_uri()}?renderer=webgl2")
    page.drawn()
    return page
