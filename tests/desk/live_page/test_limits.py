"""Ends of an axis: around all that is to be seen, not too far, and the same as long as possible."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from playwright.sync_api import Browser, Page

import observer_rt.desk.live_page

_VALUES = st.floats(-1e4, 1e4)
Ends = tuple[float, float]


@pytest.fixture(scope="module")
def script(browser: Browser) -> Iterator[Page]:
    page = browser.new_page()
    page.goto((Path(observer_rt.desk.live_page.__file__).parent / "static" / "page.html").as_uri())
    yield page
    page.close()


def round_ends(script: Page, low: float, high: float, span: float, before: Ends) -> Ends:
    first, last = script.evaluate("arguments => roundEnds(...arguments)", [low, high, span, before])
    return first, last


@given(_VALUES, _VALUES, st.floats(0.1, 100.0), st.tuples(_VALUES, _VALUES))
def test_all_is_seen_and_fills_the_axis(script: Page, item: float, other: float, span: float, before: Ends) -> None:
    assume(before[0] < before[1])
    low, high = min(item, other), max(item, other)
    first, last = round_ends(script, low, high, span, before)
    slack = 1e-9 * max(abs(low), abs(high), 1.0)
    assert first <= low + slack
    assert last >= high - slack
    assert last - first >= span * (1.0 - 1e-9)
    assert last - first <= 3.0 * max(high - low, span) * (1.0 + 1e-9)
    assert round_ends(script, low, high, span, (first, last)) == (first, last)


def test_noise_moves_no_axis(script: Page) -> None:
    ends = round_ends(script, -0.3, 78.2, 10.0, (0.0, 10.0))
    assert ends == (-5.0, 80.0)
    assert round_ends(script, -0.1, 79.4, 10.0, ends) == ends
