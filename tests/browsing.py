"""A headless Chromium for the tests of pages, and a Firefox for the tour. `python -m
tests.browsing` (make browser) gets the first where there is none.

Playwright's own build is taken where it can be downloaded, else the distribution's. WebGL runs on
the processor: no GPU is needed.
"""

import asyncio
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache

import pytest

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
_FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
# What is no WebGL is drawn in half the time without it, as where there is no graphics card.
_FLAGS += ["--disable-gpu-compositing", "--disable-accelerated-2d-canvas"]
# As root, as in most containers, Chromium wants no sandbox.
_FLAGS += ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []


@contextmanager
def new_page(width: int = 1280, height: int = 900) -> Iterator[tuple]:
    """Opens an empty page; skips the test where there is no browser.

    Yields: The page (playwright.sync_api.Page), and a list that gathers what goes wrong in it:
        errors of the console, exceptions, failed and outside requests.
    """
    pytest.importorskip("playwright.sync_api", reason="playwright is not installed (make install)")
    browser = _browser()
    if browser is None:
        pytest.skip("no Chromium here: make browser gets one")
    with _in_loop():
        page = browser.new_page(viewport={"width": width, "height": height})
        faults: list[str] = []
        page.on(
            "console",
            lambda message: faults.append(message.text) if message.type == "error" else None,
        )
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on(
            "requestfailed",
            # A page that is left takes back what it has asked for.
            lambda request: (
                None
                if request.failure == "net::ERR_ABORTED"
                else faults.append(f"failed: {request.url}: {request.failure}")
            ),
        )
        page.on(
            "request",
            lambda request: None if _own(request.url) else faults.append(f"outside: {request.url}"),
        )
        yield page, faults
        for context in browser.contexts:
            context.close()


@contextmanager
def firefox_page() -> Iterator:
    """Opens an empty page of the distribution's Firefox, on a screen that nobody sees: without one
    it draws no WebGL. Skips the test where one of both is missing.
    """
    pytest.importorskip("playwright.sync_api", reason="playwright is not installed (make install)")
    firefox, server = shutil.which("firefox-esr") or shutil.which("firefox"), shutil.which("Xvfb")
    if firefox is None or server is None:
        pytest.skip("no Firefox here, or no Xvfb: apt-get install firefox-esr xvfb")
    words = [server, "-displayfd", "1", "-screen", "0", "1400x900x24"]
    with (
        subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as x,
        _in_loop() as playwright,
    ):
        assert x.stdout is not None
        screen = {"DISPLAY": f":{x.stdout.readline().strip()}", "LIBGL_ALWAYS_SOFTWARE": "1"}
        try:
            browser = playwright.firefox.launch(
                channel="moz-firefox",  # as it is distributed, by WebDriver BiDi
                executable_path=firefox,
                headless=False,
                firefox_user_prefs={"webgl.force-enabled": True},
                env={**os.environ, **screen},
            )
            yield browser.new_page(viewport={"width": 1366, "height": 768})
            browser.close()
        finally:
            x.terminate()


def until(page, condition: str | Callable[[], bool], seconds: float = 30.0) -> None:
    """Waits until an expression of JavaScript, or a function, is true.

    Playwright's own wait_for_function evaluates text within the page, which our pages forbid
    (Content-Security-Policy), unless it is true at once.
    """
    end = time.monotonic() + seconds
    while not (
        page.evaluate(f"Boolean({condition})") if isinstance(condition, str) else condition()
    ):
        assert time.monotonic() < end, f"it did not become true: {condition}"
        page.wait_for_timeout(20)


@cache
def _playwright() -> tuple:
    """Playwright, which ends with this process, and its event loop."""
    from playwright.sync_api import sync_playwright

    return sync_playwright().start(), asyncio.get_running_loop()


@contextmanager
def _in_loop() -> Iterator:
    """Playwright with its event loop: elsewhere others may begin event loops of their own."""
    playwright, loop = _playwright()
    asyncio._set_running_loop(loop)
    try:
        yield playwright
    finally:
        asyncio._set_running_loop(None)


@cache
def _browser():
    """The Chromium that all pages of this process share; None where there is none."""
    with _in_loop() as playwright:
        path = _executable(playwright)
        return path and playwright.chromium.launch(executable_path=path, args=_FLAGS)


def _own(url: str) -> bool:
    return url.startswith(
        ("http://localhost:", "http://127.0.0.1:", "ws://localhost:", "file:", "blob:", "data:")
    )


def _executable(playwright) -> str | None:
    """Returns Playwright's Chromium, else one on the path."""
    own = playwright.chromium.executable_path
    if os.path.exists(own):  # noqa: PTH110 (a string, as Playwright gives it)
        return own
    return next((result for result in map(shutil.which, _NAMES) if result), None)


def main() -> int:
    """Gets a Chromium. Never fails: without one, the tests of pages are skipped."""
    from playwright.sync_api import sync_playwright

    def there() -> str | None:
        with sync_playwright() as playwright:
            return _executable(playwright)

    root = [] if hasattr(os, "geteuid") and os.geteuid() == 0 else ["sudo", "-n"]
    ways = [[sys.executable, "-m", "playwright", "install", "chromium"]]
    if shutil.which("apt-get"):
        ways += [
            [*root, "apt-get", "update", "-qq"],
            [*root, "apt-get", "install", "-qq", "--no-install-recommends", "chromium"],
        ]
    for way in ways:
        if there():
            break
        print(" ".join(way), flush=True)
        try:
            subprocess.run(
                way,
                check=False,
                timeout=600,
                stdout=subprocess.DEVNULL,
                env={**os.environ, "DEBIAN_FRONTEND": "noninteractive"},
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            print(f"not so: {error}")
    none = "no Chromium could be had: install one by hand; until then tests of pages are skipped"
    path = there()
    print(f"Chromium: {path}" if path else none)
    return 0


if __name__ == "__main__":
    sys.exit(main())
