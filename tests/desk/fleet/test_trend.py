"""Wear over time: what all recordings of an injector say together, the most worn first."""

import json
import math
from typing import Any

import pyarrow as pa
import pytest

from observer_rt.desk.fleet.forecast import Limit
from observer_rt.desk.fleet.job import SCHEMA
from observer_rt.desk.fleet.moment import PATH, WRITTEN
from observer_rt.desk.fleet.trend import InjectorTrend, doubts, trends
from observer_rt.desk.fleet.trend_words import as_json, table_of
from observer_rt.foundation.console import results
from observer_rt.foundation.errors import UserError
from tests.desk.fleet.rows import rows


@pytest.fixture
def table() -> pa.Table:
    return pa.concat_tables(
        [
            rows("aa", "healthy", [0.5, 0.01], day=0),
            rows("bb", "healthy", [0.0], day=1),
            rows("cc", "worn", [0.2], day=0),
            rows("dd", "worn", [0.25], day=2),
            rows("ee", "doubtful", [0.9], valid=False),
        ]
    ).select(SCHEMA.names)


def test_the_most_worn_comes_first_by_the_last_valid_estimate_of_each_recording(table: pa.Table) -> None:
    worn, healthy, doubtful = trends(table)
    assert [worn.injector, healthy.injector, doubtful.injector] == ["worn", "healthy", "doubtful"]
    assert healthy.courses["nozzle"].value.tolist() == [0.01, 0.0]
    assert (healthy.recordings, healthy.injections) == (2, 3)
    assert doubtful.times == ()
    assert doubtful.wear == 0.0
    first = as_json([worn])[0]
    assert first["injector"] == "worn"


def test_recordings_at_one_time_are_refused() -> None:
    """As files seem to be that were copied together."""
    both = pa.concat_tables([rows("aa", "worn", [0.2, 0.2]), rows("bb", "worn", [0.3, 0.3])])
    with pytest.raises(UserError, match=r"trend of worn: has recordings at the same time(?s:.*)--time-from"):
        trends(both)


def test_the_terminal_has_a_row_of_each_injector(table: pa.Table, capsys: pytest.CaptureFixture[str]) -> None:
    results().print(table_of(trends(table)))
    heading, *lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["worn", "healthy", "doubtful"]
    assert "+24." in lines[0] or "+25." in lines[0]
    assert "never" in lines[2]
    assert "nan" not in "".join(lines)
    assert all(line == line.rstrip() for line in (heading, *lines))


def test_recordings_of_two_injectors_under_one_name_are_doubted() -> None:
    """Wear takes many recordings."""
    mixed = [rows(f"{day}", "injector_1", [0.15 * (day % 2)], day=day) for day in range(6)]
    worn = [rows(f"w{day}", "worn", [0.01 * day], day=day) for day in range(6)]
    (doubt,) = doubts(trends(pa.concat_tables([*mixed, *worn]).select(SCHEMA.names)))
    assert doubt.startswith("injector_1: nozzle flow changes by some ")
    assert "--injector-from" in doubt


def document(found: list[InjectorTrend]) -> Any:
    return json.loads(json.dumps(as_json(found), allow_nan=False))


def campaign(injector: str, change: float, **more: object) -> pa.Table:
    """Twelve recordings, ten days and 100 hours apart, between which nozzle flow changes so much."""
    return pa.concat_tables(
        rows(f"{injector}_{k}", injector, [change * k], day=10 * k, age=500.0 + 100.0 * k, **more)
        for k in range(12)
    )


def test_rates_have_their_sign_and_limits_a_date_and_an_age() -> None:
    limits = [Limit.read("nozzle=30%"), Limit.read("nozzle=-30%")]
    wears, falls = document(
        trends(pa.concat_tables([campaign("wears", 0.02), campaign("falls", -0.01)]), limits)
    )
    assert wears["nozzle"]["rate_per_month"]["value"] == pytest.approx(0.02 * 3.04, rel=0.1)
    assert wears["nozzle"]["rate_per_1000_of_age"]["value"] == pytest.approx(0.2, rel=0.1)
    assert falls["nozzle"]["rate_per_month"]["ci95"][1] < 0.0
    above, below = wears["limits"]
    low, high = above["date"]["ci95"]
    assert low < "2026-05-31" < high < "2026-07-15"  # 150 days
    assert above["age"]["value"] == pytest.approx(2000.0, abs=60.0)
    assert set(below["date"]) == {"not_before"}


def test_the_terminal_says_when_limits_are_reached(capsys: pytest.CaptureFixture[str]) -> None:
    table = pa.concat_tables([campaign("gone", 0.04), campaign("wears", 0.02), campaign("stays", 0.0)])
    table = table.drop_columns("age").append_column("age", pa.nulls(len(table), pa.float64()))
    few = rows("aa", "few", [0.1]).select(table.schema.names)
    results().print(table_of(trends(pa.concat_tables([table, few]), [Limit.read("nozzle=30%")])))
    said = " ".join(capsys.readouterr().out.split())
    for words in (
        "nozzle +30 %",
        "reached 2026-03-22",
        "2026-05-",
        " to 2026-",
        "not before 2026-08-",
        "asks 4 recordings",
    ):
        assert words in said


def test_an_age_that_falls_is_refused() -> None:
    both = [rows("aa", "worn", [0.1], age=900.0), rows("bb", "worn", [0.1], day=3, age=20.0)]
    with pytest.raises(UserError, match=r"falls in age from 900 to 20 at bb\.csv"):
        trends(pa.concat_tables(both))


def test_without_an_age_of_all_there_is_none() -> None:
    both = [rows("aa", "worn", [0.1], age=900.0), rows("bb", "worn", [0.1], day=3)]
    (worn,) = trends(pa.concat_tables(both))
    assert not worn.by_age
    assert math.isfinite(worn.courses["nozzle"].slope)
    assert document([worn])[0]["limits"] == []


def when_written(*files: str) -> pa.Table:
    made = [rows(f"{k}", "worn", [0.1, 0.2], file=file, time_from=WRITTEN) for k, file in enumerate(files)]
    return pa.concat_tables(made)


def test_times_that_only_the_file_system_says_are_asked_for() -> None:
    table = when_written("a_20260301_1200.csv", "b_20260401_1200.csv")
    with pytest.raises(
        UserError, match=r"2 recordings, such as a_2026(?s:.*)--time-from '\(\\d\{8\}.*--trust-file-"
    ):
        trends(table)
    (dated,) = trends(table, time_from=r"_(\d{8}_\d{4})")
    assert [f"{each:%m-%d %H:%M:%S}" for each in dated.times] == ["03-01 12:00:01", "04-01 12:00:01"]


def test_they_are_taken_if_one_says_so() -> None:
    (trusted,) = trends(when_written("a.csv"), trust_written=True)
    assert len(trusted.times) == 1
    (stated,) = trends(rows("aa", "worn", [0.1], time_from=PATH))
    assert len(stated.times) == 1
