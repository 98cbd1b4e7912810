"""A headless Chromium with operations.html, and messages to it and back."""

import asyncio
import atexit
import base64
import os
import shutil
import threading
from collections.abc import Coroutine
from functools import cache
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
from playwright.async_api import Browser, BrowserType, Page, Playwright, async_playwright

PAGE: Final = Path(__file__).with_name("operations.html")
INSTALLED: Final = ("chromium", "chromium-browser", "google-chrome")
SOFTWARE: Final = "--enable-unsafe-swiftshader --enable-unsafe-webgpu --use-webgpu-adapter=swiftshader"
"""WebGL2 and WebGPU on a machine without a GPU."""

T = TypeVar("T")


def ask(operation: str, **inputs: Any) -> dict[str, Any]:
    """The outputs of an operation in JavaScript.

    Parameters
    ----------
    operation
        Its name in ``GSVC.operations``.
    inputs
        Arrays, numbers, and bytes for a stream.

    Raises
    ------
    NotImplementedError
        The page cannot do it, or not with these inputs.
    RuntimeError
        Something went wrong in the page.
    """
    page, _ = _judged(_renderer())
    message = {name: as_message(value) for name, value in inputs.items()}
    answer = wait(page.evaluate("([operation, inputs]) => GSVC.bridge.answer(operation, inputs)", [operation, message]))
    if "unsupported" in answer:
        raise NotImplementedError(answer["unsupported"])
    if "error" in answer:
        raise RuntimeError(answer["error"])
    return {name: from_message(value) for name, value in answer["outputs"].items()}


def described() -> dict[str, str]:
    """Browser, renderer and adapter."""
    _, description = _judged(_renderer())
    return {"browser": f"Chromium {_browser().version}, headless", **description}


def opened(url: str) -> Page:
    """A new page of the same browser."""

    async def gone_to() -> Page:
        page = await browser.new_page()
        await page.goto(url)
        return page

    browser = _browser()
    return wait(gone_to())


def wait(coroutine: Coroutine[Any, Any, T]) -> T:
    """The result of a coroutine that the browser's thread runs."""
    return asyncio.run_coroutine_threadsafe(coroutine, _loop()).result()


def as_message(value: Any) -> Any:
    """A number as it is; an array or a stream as a message."""
    if isinstance(value, np.ndarray):
        return {"dtype": value.dtype.str, "shape": list(value.shape), "base64": _base64(value.tobytes())}
    return {"base64": _base64(value)} if isinstance(value, bytes) else value


def from_message(value: Any) -> Any:
    """A text, or the array of a message."""
    if isinstance(value, str):
        return value
    return np.frombuffer(base64.b64decode(value["base64"]), value["dtype"]).reshape(value["shape"])


def _renderer() -> str:
    """``webgpu``, ``webgl2``, or ``auto``: the first that works."""
    return os.environ.get("GSVC_WEB_RENDERER", "auto")


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode()


@cache
def _judged(renderer: str) -> tuple[Page, dict[str, str]]:
    """The page that answers with a renderer, and what that is."""
    page = opened(PAGE.as_uri())
    return page, wait(page.evaluate("kind => GSVC.bridge.start(kind)", renderer))


@cache
def _browser() -> Browser:
    """The browser, which ends with this process."""

    async def launched() -> tuple[Browser, Playwright]:
        playwright = await async_playwright().start()
        arguments = os.environ.get("GSVC_WEB_ARGUMENTS", SOFTWARE).split()
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            arguments.append("--no-sandbox")  # Chromium's sandbox refuses to run for root
        try:
            executable = _executable(playwright.chromium)
            return await playwright.chromium.launch(executable_path=executable, args=arguments), playwright
        except BaseException:
            await playwright.stop()
            raise

    async def closed() -> None:
        await browser.close()
        await playwright.stop()

    browser, playwright = wait(launched())
    atexit.register(lambda: wait(closed()))
    return browser


def _executable(chromium: BrowserType) -> str:
    """GSVC_WEB_BROWSER, else Playwright's own Chromium if it is installed, else one in PATH."""
    own = chromium.executable_path
    candidates = [os.environ.get("GSVC_WEB_BROWSER"), own if Path(own).exists() else None]
    for path in (*candidates, *map(shutil.which, INSTALLED)):
        if path:
            return path
    raise FileNotFoundError("there is no Chromium: `playwright install chromium`, or name one in GSVC_WEB_BROWSER")


@cache
def _loop() -> asyncio.AbstractEventLoop:
    """An event loop in a thread of its own, so that callers may have theirs."""
    loop = asyncio.new_event_loop()
    threading.Thread(target=loop.run_forever, name="browser", daemon=True).start()
    return loop
