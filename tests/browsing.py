"""A headless Chromium for the tests of pages. `python -m tests.browsing` (make browser) gets one
where there is none.

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
    browser, loop = _browser()
    if browser is None:
        pytest.skip("no Chromium here: make browser gets one")
    # Elsewhere others may begin event loops of their own: there, Playwright's does not count.
    asyncio._set_running_loop(loop)
    try:
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
    finally:
        for context in browser.contexts:
            context.close()
        asyncio._set_running_loop(None)


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
def _browser() -> tuple:
    """The browser that all pages of this process share, which ends with it, and Playwright's event
    loop; None where there is no browser.
    """
    from playwright.sync_api import sync_playwright

    playwright = sync_playwright().start()
    path = _executable(playwright)
    if path is None:
        playwright.stop()
        return None, None
    browser = playwright.chromium.launch(executable_path=path, args=_FLAGS)
    return browser, asyncio.get_running_loop()


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
