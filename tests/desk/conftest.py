"""The one browser of a process: Playwright cannot be begun twice in it."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, sync_playwright

from observer_rt.foundation.errors import UserError
from tests.desk.live_page.browser import launch


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        try:
            started = launch(playwright)
        except UserError as error:
            pytest.fail(str(error), pytrace=False)
        yield started
        started.close()
