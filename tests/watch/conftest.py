"""A real browser, without a screen; and a monitor that serves its page to it."""

import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Error, Page, Playwright, Request, sync_playwright

_OBTAIN = f"{sys.executable} -m playwright install --with-deps chromium-headless-shell"
_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# nothing of its own goes out
_QUIET = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
_URL = re.compile(r"http://127\.0\.0\.1:\d+/")

Serve = Callable[..., str]


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """The system's Chromium, else Playwright's own: tools/test obtains one where it may."""
    with sync_playwright() as playwright:
        started = _launched(playwright)
        yield started
        started.close()


def _launched(playwright: Playwright) -> Browser:
    """The first that starts: Ubuntu's `chromium-browser` is there and only asks for a snap."""
    failures = []
    for path in (*filter(None, map(shutil.which, _BROWSERS)), None):
        try:
            return playwright.chromium.launch(executable_path=path, args=list(_QUIET))
        except Error as error:
            failures.append(f"{path or 'of Playwright'}: {error}")
    pytest.fail(f"no Chromium here; this would mend it: {_OBTAIN}\n" + "\n".join(failures), pytrace=False)


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """A page that must not ask any other computer for anything, nor fail in its own code."""
    opened = browser.new_page(viewport={"width": 1920, "height": 1080})
    wrong: list[str] = []

    def note(request: Request) -> None:
        if not request.url.startswith(("http://127.0.0.1", "ws://127.0.0.1", "data:", "blob:")):
            wrong.append(request.url)

    opened.on("request", note)
    opened.on("pageerror", lambda error: wrong.append(str(error)))
    yield opened
    opened.close()
    assert wrong == []


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Serve]:
    """Starts `observer-rt monitor` with some arguments; gives the address of its page."""
    with ExitStack() as stack:

        def started(*arguments: str | Path) -> str:
            words = [sys.executable, "-m", "observer_rt", "monitor", "--port", "0", *map(str, arguments)]
            process = stack.enter_context(
                subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
            )
            stack.callback(process.terminate)
            assert process.stderr is not None
            told = []
            for line in process.stderr:
                told.append(line)
                if (found := _URL.search(line)) is not None:
                    return found[0]
            raise AssertionError("".join(told))

        yield started
