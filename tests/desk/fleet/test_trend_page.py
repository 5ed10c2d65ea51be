"""Trends for people and programs: table, page, JSON."""

import html
import json
import re
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

from observer_rt.desk.fleet.trend import InjectorTrend, Limit, trends
from observer_rt.desk.fleet.trend_page import as_json, table_of, write_page
from observer_rt.foundation.console import results
from tests.desk.fleet.rows import campaign, rows

LIMIT = Limit.read("nozzle=30%")


def document(made: list[InjectorTrend], *limits: Limit) -> Any:
    return json.loads(json.dumps(as_json(made, limits), allow_nan=False))


def test_rates_have_their_sign_and_limits_a_date() -> None:
    limits = (LIMIT, Limit.read("nozzle=-30%"))
    wears, falls = document(
        trends(pa.concat_tables([campaign("wears", 0.02), campaign("falls", -0.01)])), *limits
    )
    assert wears["nozzle"]["rate_per_month"]["value"] == pytest.approx(0.02 * 3.04, rel=0.1)
    assert falls["nozzle"]["rate_per_month"]["ci95"][1] < 0.0
    above, below = wears["limits"]
    low, high = above["ci95"]
    assert low < "2026-05-31" < high < "2026-07-15"  # 150 days
    assert below == {"limit": "nozzle -30 %", "reached": False, "date": None, "ci95": [low_of(below), None]}
    assert low_of(below) > "2026-08"


def low_of(limit: Any) -> str:
    return str(limit["ci95"][0])


def test_the_terminal_has_a_row_of_each_injector_with_the_dates_of_limits(
    capsys: pytest.CaptureFixture[str],
) -> None:
    table = pa.concat_tables(
        [
            *(campaign("gone", 0.04), campaign("wears", 0.02), campaign("stays", 0.0)),
            *(rows("aa", "few", [0.1]), rows("ee", "doubtful", [0.9], valid=False)),
        ]
    )
    results().print(table_of(trends(table), [LIMIT]))
    heading, *lines = capsys.readouterr().out.splitlines()
    assert "nozzle +30 %" in heading
    said = {line.split()[0]: " ".join(line.split()) for line in lines}
    assert list(said) == ["gone", "wears", "few", "doubtful", "stays"]
    assert "reached 2026-03-1" in said["gone"]
    assert "2026-05-" in said["wears"]
    assert " to 2026-" in said["wears"]
    assert "not before 2026-08-" in said["stays"]
    assert said["few"].endswith("needs 4 recordings")
    assert "never" in said["doubtful"]


def test_the_page_has_every_injector_and_pictures_of_the_most_worn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("observer_rt.desk.fleet.trend_page._MOST_DRAWN", 3)
    table = pa.concat_tables(campaign(f"<b>{number:02}", 0.005 * number) for number in range(6))
    made = trends(table)
    write_page(tmp_path / "trend.html", made, [LIMIT], tmp_path)
    text = (tmp_path / "trend.html").read_text()
    names = [html.escape(trend.injector) for trend in made]
    assert re.findall(r"<tr><td>(.*?)</td>", text) == names
    assert re.findall(r"<h3>(.*)</h3>", text) == names[:3]
    assert text.count("<svg") == 3
    assert "src=" not in text
