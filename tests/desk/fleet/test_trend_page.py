"""The page of trends in a browser: one scale, a map that leads to injectors, points that lead to recordings."""

import re
from pathlib import Path

import pyarrow as pa
import pytest
from playwright.sync_api import Browser

from observer_rt.desk.fleet.forecast import Limit
from observer_rt.desk.fleet.trend import trends
from observer_rt.desk.fleet.trend_page import scale_of, write_page, write_picture
from tests.desk.fleet.rows import rows


def fleet(injectors: int, recordings: int = 3) -> pa.Table:
    return pa.concat_tables(
        rows(
            f"{number}_{k}",
            f"<b>{number:02}</b>",
            [0.01 * number * k],
            day=10 * k + 1,
            file=f"measured/{number:02}/run {k}.csv",
        )
        for number in range(injectors)
        for k in range(recordings)
    )


def test_a_click_leads_to_an_injector_and_a_point_to_its_recording(browser: Browser, tmp_path: Path) -> None:
    unknown = rows("xx", "unknown", [0.9], valid=False)
    found = trends(pa.concat_tables([fleet(8), unknown]), [Limit.read("seat=-20%")])
    write_page(tmp_path / "trend.html", found, tmp_path)
    page = browser.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto((tmp_path / "trend.html").as_uri())
    assert page.locator("#name").inner_text() == "<b>07</b>"
    assert "+20 %" in page.locator("svg").inner_html()
    box = page.locator("#nozzle").bounding_box()
    assert box is not None
    page.locator("#nozzle").click(position={"x": box["width"] - 2, "y": 2.5 * box["height"] / 9})
    assert page.locator("#name").inner_text() == "<b>05</b>"
    assert "+20 %" in page.locator("svg").inner_html()  # of all injectors
    page.locator("circle").nth(1).dispatch_event("click")
    chosen = page.locator("tr.chosen")
    assert chosen.inner_text().startswith("2026-01-12")
    assert "+5.00 ± 1.96" in chosen.inner_text()
    link = chosen.locator("a").get_attribute("href")
    assert link is not None
    assert link.endswith("measured/05/run%201.csv")
    page.fill("#find", "unk")
    assert page.locator("#injectors tr:visible").count() == 2
    assert page.locator("#course").inner_text() == "no valid injection"
    assert not errors


def test_the_page_says_its_order_reaches_nothing_outside_and_stays_light(tmp_path: Path) -> None:
    sizes = []
    for injectors in (40, 80):
        write_page(tmp_path / "trend.html", trends(fleet(injectors)), tmp_path)
        sizes.append((tmp_path / "trend.html").stat().st_size)
    page = (tmp_path / "trend.html").read_text()
    assert "the larger of the last changes" in page
    assert not re.search(r"(?:src|href)=.http", page)
    assert "<b>79" not in page
    assert sizes[1] - sizes[0] < 40 * 3 * 400  # bytes of a recording, and its part of the injector's row


def test_one_scale_holds_all_and_limits() -> None:
    found = trends(fleet(8))
    assert scale_of(found, 1.0) == 20
    assert scale_of(found, 1.0, [0.31]) == 40
    assert scale_of([]) == 10


@pytest.mark.parametrize("injectors", [2, 30])
def test_the_picture_is_of_courses_or_of_many_a_map(tmp_path: Path, injectors: int) -> None:
    found = trends(pa.concat_tables([fleet(injectors), rows("xx", "unknown", [0.9], valid=False)]))
    write_picture(tmp_path / "trend.svg", found)
    assert ("the most worn first" in (tmp_path / "trend.svg").read_text()) is (injectors == 30)
