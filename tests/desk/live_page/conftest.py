"""A real browser, without a screen; and a monitor that serves its page to it."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, Request

from tests.daemon.end_to_end import command
from tests.desk.live_page.browser import served

Serve = Callable[..., str]


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
    with ExitStack() as stack:

        def started(*arguments: str | Path) -> str:
            return stack.enter_context(served(command("monitor", "--port", "0", *arguments), tmp_path)).url

        yield started
