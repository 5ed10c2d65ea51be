"""Wear over time: what all recordings of an injector say together, the most worn first."""

import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from observer_rt.desk.fleet.job import SCHEMA
from observer_rt.desk.fleet.trend import (
    SURE,
    as_json,
    doubts,
    smoothed,
    table_of,
    trends,
    write_page,
    write_picture,
)
from observer_rt.foundation.console import results
from observer_rt.foundation.errors import UserError
from tests.desk.fleet.rows import rows


def test_the_band_holds_what_drifts_and_is_narrower_than_single_sightings() -> None:
    random = np.random.default_rng(1)
    inside, widths = [], []
    for _ in range(30):
        truth = np.cumsum(random.normal(0.0, 0.004, 40))
        sigma = np.full(40, 0.01)
        course = smoothed(truth + random.normal(0.0, sigma), sigma)
        inside.append(np.abs(course.level - truth) <= SURE * course.level_sigma)
        widths.append(course.level_sigma.mean() / 0.01)
    assert 0.88 < np.mean(inside) < 0.99
    assert np.mean(widths) < 0.8


def test_what_stays_is_known_ever_better() -> None:
    random = np.random.default_rng(2)
    sigma = np.full(100, 0.01)
    course = smoothed(0.2 + random.normal(0.0, sigma), sigma)
    assert course.level[-1] == pytest.approx(0.2, abs=0.006)
    assert course.level_sigma[-1] < 0.005


@pytest.mark.parametrize("sightings", [0, 1, 2])
def test_few_sightings_are_taken_as_they_are(sightings: int) -> None:
    course = smoothed(np.full(sightings, 0.1), np.full(sightings, 0.01))
    assert course.level.tolist() == pytest.approx([0.1] * sightings)


def test_two_sightings_that_differ_are_no_quantity_that_stands_still() -> None:
    course = smoothed(np.array([0.02, 0.04]), np.full(2, 0.002))
    assert course.level == pytest.approx([0.02, 0.04], abs=0.004)


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


def test_page_and_picture_are_written(table: pa.Table, tmp_path: Path) -> None:
    found = trends(table)
    write_page(tmp_path / "trend.html", found, tmp_path)
    write_picture(tmp_path / "trend.png", found)
    page = (tmp_path / "trend.html").read_text()
    assert page.index("worn") < page.index("healthy") < page.index("doubtful")
    assert page.count("<svg") == len(found)
    assert not re.search(r"(?:src|href)=.http", page)
    assert (tmp_path / "trend.png").read_bytes().startswith(b"\x89PNG")
