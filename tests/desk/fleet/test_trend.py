"""Wear over time: what all recordings of an injector say together, its line, the dates of limits, and the page."""

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from observer_rt.desk.fleet.recordings import PathPattern, TimeFrom
from observer_rt.desk.fleet.trend import (
    FEWEST,
    InjectorTrend,
    Limit,
    WearLine,
    as_json,
    needle_table_of,
    table_of,
    trends,
)
from observer_rt.desk.fleet.trend_figure import draw
from observer_rt.foundation.console import results
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import Floats
from tests.desk.fleet.rows import campaign, rows


def test_the_most_worn_comes_first_by_the_last_valid_estimate_of_each_recording() -> None:
    tables = [
        rows("aa", "healthy", [0.5, 0.01], day=0),
        rows("bb", "healthy", [0.005], day=1),
        rows("cc", "worn", [0.2], day=0),
        rows("dd", "worn", [0.25], day=2),
        rows("ee", "doubtful", [0.9], valid=False),
    ]
    worn, healthy, doubtful = trends(pa.concat_tables(tables))
    assert [worn.injector, healthy.injector, doubtful.injector] == ["worn", "healthy", "doubtful"]
    assert healthy.courses["nozzle"].value.tolist() == [0.01, 0.005]
    assert (healthy.recordings, healthy.injections) == (2, 3)
    assert doubtful.times == ()
    assert worn.courses["nozzle"].now == pytest.approx((0.25, 0.0196))
    assert worn.courses["nozzle"].rate is None


def test_recordings_at_one_time_are_refused() -> None:
    """As files seem to be that were copied together."""
    both = pa.concat_tables([rows("aa", "worn", [0.2, 0.2]), rows("bb", "worn", [0.3, 0.3])])
    with pytest.raises(UserError, match=r"trend of worn: has recordings at the same time(?s:.*)--time-from"):
        trends(both)


def test_times_that_only_the_file_system_says_are_asked_for() -> None:
    files = "a_20260301_1200.csv", "b_20260401_1200.csv"
    made = [rows(f"{k}", "worn", [0.1, 0.2], file=file, time_from=TimeFrom.WRITTEN) for k, file in enumerate(files)]
    with pytest.raises(UserError, match=r"2 recordings, such as a_2026(?s:.*)--time-from PATTERN"):
        trends(pa.concat_tables(made))
    (dated,) = trends(pa.concat_tables(made), dates=PathPattern.read("--time-from", r"_(\d{8}_\d{4})"))
    assert [f"{each:%m-%d %H:%M:%S}" for each in dated.times] == ["03-01 12:00:01", "04-01 12:00:01"]


def test_a_time_that_the_file_states_is_taken() -> None:
    (stated,) = trends(rows("aa", "worn", [0.1], time_from=TimeFrom.HEADER))
    assert len(stated.times) == 1


DAYS, LAST = np.array([0.0, 3.0, 11.0, 12.0, 30.0, 41.0, 60.0, 75.0, 90.0, 110.0]), 110.0


def line(level: float, rate: float, half: float = 0.004) -> WearLine:
    return WearLine.of(DAYS, level + rate * DAYS, np.full(DAYS.size, half))


@pytest.mark.parametrize("rate", [0.002, -0.002])
def test_a_known_line_is_found_and_a_bad_recording_counts_less(rate: float) -> None:
    value, half = 0.01 + rate * DAYS, np.full(DAYS.size, 0.004)
    value[4], half[4] = 0.5, 2.0
    result = WearLine.of(DAYS, value, half)
    assert result.coefficients == pytest.approx([rate, 0.01], abs=1e-5)


def test_intervals_hold_the_truth_as_often_as_they_say_when_values_scatter_beyond_theirs() -> None:
    random = np.random.default_rng(5)
    holds, dates = [], []
    for _ in range(600):
        rate, sigma = random.uniform(0.001, 0.003), random.uniform(0.002, 0.01, DAYS.size)
        value = rate * DAYS + random.normal(0.0, np.hypot(sigma, 0.015))
        result = WearLine.of(DAYS, value, 1.96 * sigma)
        level, half = result.at(DAYS[-1:])
        slope_half = math.sqrt(result.spread[0, 0])
        holds.append([abs(level[0] - rate * LAST) <= half[0], abs(result.coefficients[0] - rate) <= slope_half])
        low, _, high = result.reaches(Limit("nozzle", 1.3 * rate * LAST))
        dates.append(low <= 1.3 * LAST <= high)
    assert np.mean(holds, axis=0) == pytest.approx([0.95, 0.95], abs=0.025)
    assert np.mean(dates) == pytest.approx(0.95, abs=0.025)


@pytest.mark.parametrize(
    ("wear", "size", "day", "half"),
    [(0.002, 0.3, 150.0, 10.0), (-0.002, -0.3, 150.0, 10.0), (0.004, 0.25, 62.5, 2.5)],
)
def test_steady_wear_reaches_the_limit_in_time(wear: float, size: float, day: float, half: float) -> None:
    low, middle, high = line(0.0, wear).reaches(Limit("nozzle", size))
    assert day - half < low < day < high < day + half
    assert middle == pytest.approx(day, abs=0.3)


@pytest.mark.parametrize("size", [0.9, -0.3])
def test_a_limit_too_far_ahead_or_the_other_way_is_not_before_some_day(size: float) -> None:
    assert line(0.0, 0.002).reaches(Limit("nozzle", size)) == (2.0 * LAST, math.inf, math.inf)


@pytest.mark.parametrize("value", [[0.1] * FEWEST, [0.0, 0.1, 0.1, 0.3]])
def test_recordings_without_noise_do_no_harm(value: list[float]) -> None:
    days: Floats = np.arange(float(FEWEST))
    level, half = WearLine.of(days, np.array(value), np.zeros(FEWEST)).at(days)
    assert level == pytest.approx(np.polyval(np.polyfit(days, value, 1), days))
    assert np.isfinite(half).all()


@pytest.mark.parametrize(
    ("text", "limit"),
    [
        ("nozzle=30%", Limit("nozzle", 0.3)),
        (" seat=-.2 ", Limit("seat", -0.2)),
        ("closes_later=100us", Limit("closes_later", 1e-4)),
    ],
)
def test_a_limit_is_read(text: str, limit: Limit) -> None:
    assert Limit.read(text) == limit


@pytest.mark.parametrize(
    "text", ["nozzle", "nozzle=0", "lift=3%", "nozzle=much", "nozzle=3%%", "nozzle=3us", "seat=us"]
)
def test_another_text_than_a_limit_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(UserError, match="nozzle=30%"):
        Limit.read(text)


LIMIT = Limit.read("nozzle=30%")


def document(made: list[InjectorTrend], *limits: Limit) -> Any:
    return json.loads(json.dumps(as_json(made, limits), allow_nan=False))


def test_rates_have_their_sign_and_limits_a_date() -> None:
    limits = (LIMIT, Limit.read("nozzle=-30%"))
    wears, falls = document(trends(pa.concat_tables([campaign("wears", 0.02), campaign("falls", -0.01)])), *limits)
    assert wears["nozzle"]["rate_per_month"]["value"] == pytest.approx(0.02 * 3.04, rel=0.1)
    assert falls["nozzle"]["rate_per_month"]["ci95"][1] < 0.0
    above, below = wears["limits"]
    low, high = above["ci95"]
    assert low < "2026-05-31" < high < "2026-07-15"  # 150 days
    assert below == {"limit": "nozzle -30 %", "reached": False, "date": None, "ci95": [low_of(below), None]}
    assert low_of(below) > "2026-08"


def low_of(limit: Any) -> str:
    return str(limit["ci95"][0])


def test_the_terminal_has_a_row_of_each_injector_with_the_dates_of_limits(capsys: pytest.CaptureFixture[str]) -> None:
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


def by_commands(k: int, later: float, faster: float = -0.1) -> pa.Table:
    """A recording without the lift, of a needle that closes this late."""
    sizes = {"needle_closes_later{}_s": later, "needle_opens_later{}_s": 1e-5, "needle_opens_faster{}": faster}
    ends = {"": 0.0, "_ci95_low": -2e-6, "_ci95_high": 2e-6}
    needle = {name.format(end): size + off for name, size in sizes.items() for end, off in ends.items()}
    return rows(f"{k}", "sticks", [0.02], day=10 * k, **needle)


def test_a_needle_has_a_trend_where_no_lift_was_recorded(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    bare = [by_commands(k, 1e-5 * k) for k in range(8)]
    made, limit = (
        trends(pa.concat_tables([*bare, rows("9", "sticks", [0.03], day=90)])),
        Limit.read("closes_later=90us"),
    )
    (said,) = document(made, limit)
    assert said["closes_later"]["rate_per_month"]["value"] == pytest.approx(3.04e-5, rel=0.01)
    assert said["closes_later"]["value"] == pytest.approx(7e-5)
    assert said["closes_later"]["ci95"] == pytest.approx([7e-5, 7e-5], abs=3e-6)  # of 2 us each
    assert said["limits"][0]["date"][:10] == "2026-04-01"
    results().print(needle_table_of(made))
    assert [line.split()[1:4] for line in capsys.readouterr().out.splitlines()[1:]] == [
        *(["opens_later,", "us", "+10.00"], ["opens_faster,", "%", "-10.00"], ["closes_later,", "us", "+70.00"])
    ]
    draw(tmp_path / "trend.svg", made, [limit])
    drawn = (tmp_path / "trend.svg").read_text()
    assert [text in drawn for text in ("needle later, us", "needle faster, %", "change of flow, %")] == [True] * 3


def test_the_figure_shows_the_most_worn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("observer_rt.desk.fleet.trend_figure._MOST_DRAWN", 3)
    made = trends(pa.concat_tables(campaign(f"no_{number}", 0.005 * number) for number in range(6)))
    draw(tmp_path / "trend.svg", made, [LIMIT])
    said = re.findall(r"<!-- (no_\d) -->", (tmp_path / "trend.svg").read_text())
    assert said == [trend.injector for trend in made[:3]]
